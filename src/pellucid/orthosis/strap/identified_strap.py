"""Identify a strap: its model, stiffness, range of stretch and their uncertainty; `fit_strap` does so from arrays.

Stiffness is the long-term tangent where the strap begins to pull; a relaxing branch adds to it for a while. Its
interval includes the effect of features that were not significant and of physics that no model has. An interval that
would be too wide to be useful is refused with the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from ..._errors import IdentificationError, RecordingError
from ...models.estimates import Estimates, Parameter
from ...numerics.arguments import with_checked_arguments
from ...numerics.sampled import sampled
from ...numerics.uncertainty import correlation_time
from .coupled_impedance import CouplingFit, Instrument, decay_time, fit_coupling
from .strap_fit import StrapChoice, StrapFit, StrapRecord, choose_strap, fit_strap_model, strap_discrepancy
from .strap_model import FULL_MODEL, KELVIN_VOIGT, Orthosis, StrapModel, StrappedSwing, StrapTorque, from_orthosis

PRIOR_IMU_GAIN = Parameter("gain", "1", 1.0, 0.005)
"""Prior of the IMU's gain: filters that integrate rates are accurate to half a per cent."""


@dataclass(frozen=True)
class StrapSettings:
    """Priors and limits of an identified strap."""

    # Relative standard error of the spring's calibration with weights, which scales all torques and the strap alike.
    spring_calibration_error_share: float = 0.003
    # The interval of the stiffness is refused if its standard error exceeds this share of the value.
    max_standard_error_share: float = 0.10
    # Variance of an independent sample of the IMU's angle, assumed in the first fit [rad^2].
    first_noise_variance: float = 1e-3
    # Prior standard deviation of the clock's shift between trials, for trials whose motion does not determine it.
    clock_spread_s: float = 0.1
    clock_iteration_count: int = 4  # number of Gauss-Newton steps for the IMU's clock in a held-out trial
    # The strap counts as seen between these percentiles of its stretch.
    stretch_percentiles: tuple[float, ...] = (1.0, 99.0)


STRAP_SETTINGS = StrapSettings()


MODEL_TEST_LEVEL = 0.05
"""Significance level of the test whether the model describes the strap."""


@dataclass(frozen=True, eq=False)
class IdentifiedStrap:
    """One identified strap."""

    model: StrapModel
    stiffness: Parameter  # long-term tangent where the strap begins to pull [N m/rad]
    damping: Parameter
    others: tuple[Parameter, ...]  # parameters of the features
    covariance: np.ndarray = field(repr=False)  # (k, k) covariance of stiffness, damping and the others
    range: tuple[float, float]  # range of the stretch that was seen [rad]
    ends: tuple[Parameter, Parameter]  # tangents at both ends of that range [N m/rad]
    holds: float  # p value of the model: that no neglected effect improves its prediction
    errors: Mapping[str, float]  # RMS error on held-out blocks, by model name [rad]
    missed: Mapping[str, float]  # p value, by feature, of predicting no worse without it
    # (m,) mismatch by the IMU, corrected for misalignment [rad], and the strap's long-term torque there [N m]
    seen: tuple[np.ndarray, np.ndarray] = field(repr=False)
    plain: StrapFit = field(repr=False)  # fit of a spring and damper alone
    fit: StrapFit = field(repr=False)  # fit of the chosen model

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Damping, stiffness, and the parameters of the features."""
        return (self.damping, self.stiffness, *self.others)

    @property
    def fits(self) -> bool:
        """Whether the model is not rejected by its test."""
        return self.holds >= MODEL_TEST_LEVEL

    def mismatch(self, swing: StrappedSwing, torque: StrapTorque, *, plain: bool = False) -> np.ndarray:
        """Predict limb minus orthosis angle at the actuator's times, shape (n,) [rad], by this or the `plain` strap."""
        fit = self.plain if plain else self.fit
        record = StrapRecord(swing, torque, fit.shifts[0], 0.0)
        limb = record.response(fit.model, fit.values)[0]
        return CubicSpline(record.time, limb - record.robot)(np.clip(swing.time, record.time[0], record.time[-1]))

    def instrument(self, swing: StrappedSwing, torque: StrapTorque, clock: float) -> Instrument:
        """Estimate clock and mounting of the IMU in a trial with the strap fixed; its clock is about `clock` ahead
        [s]."""
        record = StrapRecord(swing, torque, clock, 0.0)
        path = CubicSpline(record.time, record.response(self.fit.model, self.fit.values)[0])
        shift, offset = clock, 0.0
        for _ in range(STRAP_SETTINGS.clock_iteration_count):
            at = np.clip(record.seen_time + shift, record.time[0], record.time[-1])
            off = record.seen - self.fit.gain * path(at)
            rate = self.fit.gain * path(at, 1)
            step = record.swiftly(np.column_stack([off, rate]))
            shift += float(step[:, 0] @ step[:, 1] / max(float(step[:, 1] @ step[:, 1]), 1e-12))
            offset = float(np.mean(off))
        return Instrument(shift, offset, self.fit.gain)

    def torque(self, stretch: np.ndarray) -> np.ndarray:
        """Return the long-term torque, shape (n,) [N m], at a mismatch, shape (n,) [rad], slack included."""
        half = 0.5 * self.fit.values.get("slack", 0.0)
        e = stretch - np.clip(stretch, -half, half)
        return self.fit.values["stiffness"] * e * (1.0 + self.fit.values.get("hardening", 0.0) * e**2 / 3.0)


def identify_strap(
    swings: Sequence[StrappedSwing],
    torques: Sequence[StrapTorque],
    coupling: CouplingFit,
    steps: Sequence[StrappedSwing] = (),
    step_torques: Sequence[StrapTorque] = (),
) -> IdentifiedStrap:
    """Choose and fit a strap model to swings, and to `steps`, trials with held torques.

    The search starts from the spring and damper of `coupling`.
    """
    start = {"stiffness": coupling.stiffness.value, "damping": coupling.damping.value}
    records, full = _records(swings, torques, coupling, start, steps, step_torques)
    return _known(choose_strap(records, PRIOR_IMU_GAIN, full), records, held=len(records) > len(swings))


def _records(swings, torques, coupling, start, steps, step_torques) -> tuple[list[StrapRecord], StrapFit]:
    """Prepare all trials, weighted by their noise, with the swings' clocks found from their motion; return a first
    fit."""
    decay = decay_time(start["stiffness"], start["damping"])
    clocks: Sequence[float] = [i.shift for i in coupling.instruments]
    # The records are made again after the clocks are known, because the excluded samples depend on the clock.
    records = [StrapRecord(s, t, c, decay) for s, t, c in zip(swings, torques, clocks, strict=True)]
    clocks = fit_strap_model(
        KELVIN_VOIGT, records, gain=PRIOR_IMU_GAIN, noise=STRAP_SETTINGS.first_noise_variance, start=start
    ).shifts
    records = [StrapRecord(s, t, c, decay) for s, t, c in zip(swings, torques, clocks, strict=True)]
    usual = float(np.mean(clocks))
    for swing, torque in zip(steps, step_torques, strict=True):
        try:
            records.append(StrapRecord(swing, torque, usual, decay, slowest=0.0, late=STRAP_SETTINGS.clock_spread_s))
        except IdentificationError:
            continue  # too few usable samples: the swings are fitted without this trial
    first = fit_strap_model(
        FULL_MODEL, records, gain=PRIOR_IMU_GAIN, noise=STRAP_SETTINGS.first_noise_variance, start=start
    )
    ends = np.cumsum(first.lengths)
    residuals = [first.residual[e - n : e] for e, n in zip(ends, first.lengths, strict=True)]
    noise = [2.0 * correlation_time(r, [len(r)]) * float(np.mean(r**2)) for r in residuals]
    usual = float(np.mean(noise[: len(swings)]))
    for record, own in zip(records, noise, strict=True):
        record.weight = float(np.sqrt(usual / own))
    near = {**first.values, "gain": first.gain}
    full = fit_strap_model(FULL_MODEL, records, gain=PRIOR_IMU_GAIN, noise=usual, start=near, shifts=first.shifts)
    return records, full


def _known(choice: StrapChoice, records: Sequence[StrapRecord], *, held: bool) -> IdentifiedStrap:
    fit = choice.fit
    statistical = fit.covariance() + fit.moved_by_body(records)
    beside = strap_discrepancy(fit, records, statistical)
    count = len(fit.model.coefficients)
    total = (statistical + beside.covariance)[:count, :count].copy()
    values = np.array([c.sought(fit.values[c.name]) for c in fit.model.coefficients])
    total[:2, :2] += STRAP_SETTINGS.spring_calibration_error_share**2 * np.outer(values[:2], values[:2])
    # Features that were not significant may exist all the same, so their effect widens the interval.
    # Beside tissue, the stiffness is the strap's own and not the whole one, so such a model is no rival of others.
    full = choice.tried[(FULL_MODEL if fit.model.has("tissue") else FULL_MODEL.without("tissue")).name]
    if full is not fit:
        other = full.covariance() + full.moved_by_body(records)
        for i in range(2):
            apart = full.values[fit.free[i]] - fit.values[fit.free[i]]
            total[i, i] += apart**2 + max(other[i, i] - statistical[i, i], 0.0)
    error, own = np.sqrt(np.diag(total)), np.sqrt(np.diag(statistical)[:count])
    parameters = []
    for i, c in enumerate(fit.model.coefficients):
        value, unit = fit.values[c.name], c.value(values[i]) if c.searched == "logarithm" else 1.0
        refused = ""
        # Swings cannot distinguish a branch that relaxes within seconds from permanent stiffness.
        if c.name == "stiffness" and (not held or error[i] > STRAP_SETTINGS.max_standard_error_share * value):
            refused = "these motions do not distinguish the strap's stiffness from its relaxation; hold torques"
        bound = c.name in fit.at_bound
        told = not bound and abs(value) > 1.96 * error[i] * unit
        parameters.append(
            Parameter(c.name, c.unit, value, error[i] * unit, bound, told, statistical_error=own[i] * unit,
                      refused=refused)
        )  # fmt: skip
    seen = np.concatenate([r.response(fit.model, fit.values)[1] for r in records])
    low, high = (float(v) for v in np.percentile(seen, STRAP_SETTINGS.stretch_percentiles))
    return IdentifiedStrap(
        fit.model, parameters[0], parameters[1], tuple(parameters[2:]), total, (low, high),
        (_tangent(parameters, total, low), _tangent(parameters, total, high)), beside.holds, choice.errors,
        choice.missed, _seen(fit, records), choice.plain, fit,
    )  # fmt: skip


def _seen(fit: StrapFit, records: Sequence[StrapRecord]) -> tuple[np.ndarray, np.ndarray]:
    """Return the measured mismatch and the model's long-term torque at the IMU's samples."""
    places, torques = [], []
    half, ends = 0.5 * fit.values.get("slack", 0.0), np.cumsum(fit.lengths)
    for record, shift, n, end in zip(records, fit.shifts, fit.lengths, ends, strict=True):
        stretch = record.at_imu(record.response(fit.model, fit.values)[1][:, None], shift)[:, 0]
        side = np.sign(record.at_imu(record.torque[:, None], shift)[:, 0])
        places.append(stretch + half * side + fit.residual[end - n : end] / (fit.gain * record.weight))
        curved = 1.0 + fit.values.get("hardening", 0.0) * stretch**2 / 3.0
        torques.append(fit.values["stiffness"] * stretch * curved)
    return np.concatenate(places), np.concatenate(torques)


def _tangent(parameters: Sequence[Parameter], covariance: np.ndarray, stretch: float) -> Parameter:
    """Return the tangent stiffness at a stretch [rad]."""
    k, u, slope = parameters[0].value, 0.0, np.zeros(len(parameters))
    for i, p in enumerate(parameters):
        if p.name == "hardening":
            u, slope[i] = p.value, k * stretch**2
    slope[0] = 1.0 + u * stretch**2
    error = float(np.sqrt(slope @ covariance @ slope))
    return Parameter("tangent", "N*m/rad", k * slope[0], error, refused=parameters[0].refused)


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


@with_checked_arguments
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
    where = f"fit_strap, {name}"
    actuator = sampled(where, arrays["time"], position=arrays["position"], torque=arrays["torque"])
    (imu_time,) = sampled(f"{where}, imu_time", arrays["imu_time"], even=False)
    imu_angle = np.asarray(arrays["imu_angle"], float)
    if imu_angle.shape != imu_time.shape:
        raise RecordingError(f"{where}, imu_angle: found shape {imu_angle.shape}, expected {imu_time.shape}")
    return StrappedSwing(name, "fitted", *actuator, imu_time, imu_angle)
