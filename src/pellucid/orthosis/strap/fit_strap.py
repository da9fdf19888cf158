"""A strap between wearer and orthosis, identified from arrays of swings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import IdentificationError, RecordingError
from ...models.estimates import Estimates
from .coupled_impedance import CouplingFit, fit_coupling
from .identified_strap import IdentifiedStrap, identify_strap
from .strap_torque import Orthosis, StrappedSwing, from_orthosis

SWING_ARRAYS = ("time", "position", "torque", "imu_time", "imu_angle")
"""Arrays that every swing consists of."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class StrapEstimate(Estimates):
    """An identified strap: damping, stiffness and the parameters of its features by name.

    Attributes
    ----------
    strap : IdentifiedStrap
        The chosen model with its test, the range of stretch that was seen, and its predictions.
    kelvin_voigt : CouplingFit
        The fit of a spring and a damper alone.
    """

    strap: IdentifiedStrap = field(repr=False)
    kelvin_voigt: CouplingFit = field(repr=False)

    def _facts(self) -> tuple[str, ...]:
        low, high = np.degrees(self.strap.range)
        holds = "describes" if self.strap.fits else "does not describe"
        return (
            f"{self.strap.model.words}; the model {holds} the held-out blocks (p {self.strap.holds:.2g})",
            f"stretch seen from {low:+.1f} to {high:+.1f} deg",
        )


def fit_strap(
    swings: Sequence[Mapping[str, ArrayLike]] | Mapping[str, ArrayLike],
    orthosis: Orthosis | Mapping[str, float],
    *,
    steps: Sequence[Mapping[str, ArrayLike]] = (),
) -> StrapEstimate:
    """Identify the strap between a limb and an orthosis from swings of the strapped limb.

    The orthosis's dynamic balance gives the strap's torque, an IMU on the limb the angle. Features beyond a spring and
    a damper (hardening, slack, relaxation, misalignment) are kept only where held-out blocks need them.

    Parameters
    ----------
    swings : sequence of mapping, or one mapping
        For each trial the arrays ``time`` [s], ``position`` [rad] and ``torque`` [N m] of the orthosis's actuator, each
        (n,), evenly sampled, and ``imu_time`` [s] and ``imu_angle`` [rad] of the limb, each (m,), on the IMU's clock.
    orthosis : Orthosis or mapping of str to float
        Parameters of the orthosis without a wearer, SI: ``inertia``, ``viscous``, ``gravity`` and optionally
        ``coulomb``, ``zero``, ``offset``.
    steps : sequence of mapping
        Trials with held torques, which show slow relaxation.

    Returns
    -------
    StrapEstimate
        ``fit["stiffness"]``, ``fit["damping"]`` with intervals, and ``fit.strap.model.features``.

    Raises
    ------
    RecordingError
        If an array is missing or shapes do not fit together.
    IdentificationError
        If the limb hardly moves, or the clocks do not overlap.

    Examples
    --------
    >>> fit = pl.fit_strap(swings, {"inertia": 0.12, "viscous": 0.3, "gravity": 4.0})      # doctest: +SKIP
    >>> fit["stiffness"].interval()                                                   # doctest: +SKIP
    """
    if isinstance(swings, Mapping):
        swings = [swings]
    if not swings:
        raise IdentificationError("fit_strap: found no swing, expected one or more")
    body = orthosis if isinstance(orthosis, Orthosis) else _orthosis(orthosis)
    trials = [_swing(f"swing {i + 1}", each) for i, each in enumerate(swings)]
    held = [_swing(f"steps {i + 1}", each) for i, each in enumerate(steps)]
    torques = [from_orthosis(trial, body) for trial in trials]
    coupling = fit_coupling(trials, torques)
    strap = identify_strap(trials, torques, coupling, held, [from_orthosis(trial, body) for trial in held])
    return StrapEstimate(
        parameters=(strap.stiffness, strap.damping, *strap.others),
        covariance=strap.covariance,
        title="Strap between limb and orthosis",
        strap=strap,
        kelvin_voigt=coupling,
    )


def _orthosis(numbers: Mapping[str, float]) -> Orthosis:
    allowed = ("inertia", "viscous", "gravity", "coulomb", "zero", "offset")
    wrong = [name for name in numbers if name not in allowed]
    missing = [name for name in allowed[:3] if name not in numbers]
    if wrong or missing:
        raise IdentificationError(
            f"fit_strap, orthosis: found {', '.join(numbers) or 'nothing'}, expected {', '.join(allowed[:3])} and "
            f"optionally {', '.join(allowed[3:])}"
        )
    inertia, viscous, gravity, coulomb, zero, offset = (float(numbers.get(name, 0.0)) for name in allowed)
    return Orthosis(inertia, viscous, gravity, coulomb, zero=zero, offset=offset)


def _swing(name: str, arrays: Mapping[str, ArrayLike]) -> StrappedSwing:
    missing = [key for key in SWING_ARRAYS if key not in arrays]
    if missing:
        raise RecordingError(
            f"fit_strap, {name}: found {', '.join(map(str, arrays))}, expected {', '.join(missing)} too"
        )
    found = {key: np.asarray(arrays[key], float) for key in SWING_ARRAYS}
    for keys in (SWING_ARRAYS[:3], SWING_ARRAYS[3:]):
        shapes = {key: found[key].shape for key in keys}
        if len(set(shapes.values())) > 1 or found[keys[0]].ndim != 1:
            raise RecordingError(f"fit_strap, {name}: found shapes {shapes}, expected one shape (n,)")
    for key in SWING_ARRAYS[:4]:
        if not np.isfinite(found[key]).all():
            raise RecordingError(f"fit_strap, {name}, {key}: found missing samples (NaN), expected none")
    steps = np.diff(found["time"])
    if np.min(steps) <= 0.0 or np.ptp(steps) > 0.01 * float(np.median(steps)):
        raise RecordingError(f"fit_strap, {name}: found uneven time, expected evenly increasing samples")
    return StrappedSwing(name, "fitted", *(found[key] for key in SWING_ARRAYS))
