r"""Gravity torque of a segment from angles at which it was held.

Held still, an actuator carries gravity and whatever friction left of its approach:

.. math::
    \tau = m g l \sin(q - q_0) + \tau_0 \pm \tau_f

with q = 0 hanging. Written with sin q, cos q and 1 it is linear. An angle reached once from below and once from above
tells friction from gravity; reached from one side only, a constant friction joins the offset and gravity is as good.

The thesis fits a straight line to torque over angle, and writes the torque with a cosine (its equations 2.3 and 2.6);
both are here as published alternatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri, stdtrit

from ..._errors import IdentificationError
from ...signals.filters import runs, zero_phase_lowpass
from ..parameter import Parameter

STILL = 0.02
"""Slower than this [rad/s] a segment is held."""
STILL_CUTOFF = 2.0
"""Low-pass ahead of that decision [Hz]: tremor and the encoder's steps are no motion."""
SHORTEST = 1.0
"""Seconds that a hold lasts at least once it has settled."""
SETTLING = 0.75
"""Seconds left out at the beginning of each hold; the loop creeps to its end there."""
DISTINCT = np.radians(3.0)
"""Holds nearer than this are at the same angle."""
FEWEST_ANGLES = 3
LEVEL = 0.95


@dataclass(frozen=True)
class Hold:
    """One angle at which a segment was held."""

    recording: str
    start: float  # start, end: Settled samples, on the recording's clock [s]
    end: float
    angle: float  # angle, torque: Means [rad], [N m]
    torque: float
    torque_sd: float  # Of the samples [N m]
    approach: int  # 1 from below, -1 from above, 0 for the first one


@dataclass(frozen=True)
class GravityFit:
    """Gravity of one segment."""

    gravity: Parameter  # m g l [N m]
    zero: Parameter | None  # Angle at which it hangs [rad]; None where nothing says that it is not 0
    offset: Parameter  # Torque that does not depend on the angle [N m]
    friction: Parameter | None  # Half the torque between both approaches [N m]; None where there was one approach only
    phasor: np.ndarray = field(repr=False)  # (2,) Coefficients of sin q and cos q [N m]
    phasor_covariance: np.ndarray = field(repr=False)  # (2, 2) [N^2 m^2]; widened for the few holds there are
    holds: tuple[Hold, ...] = field(repr=False)
    residual: np.ndarray = field(repr=False)  # (k,) Of each hold [N m]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those that were estimated."""
        return tuple(p for p in (self.gravity, self.zero, self.offset, self.friction) if p is not None)

    def torque(self, angle: np.ndarray) -> np.ndarray:
        """Torque that holds the segment, without friction, shape (n,) [N m], at `angle` of shape (n,) [rad]."""
        return self.phasor[0] * np.sin(angle) + self.phasor[1] * np.cos(angle) + self.offset.value


def find_holds(
    time: np.ndarray, position: np.ndarray, torque: np.ndarray, *, recording: str = "", shortest: float = SHORTEST
) -> tuple[Hold, ...]:
    """Where a recording stands still, without the time in which it settles. `time`, `position`, `torque` (n,) [s],
    [rad], [N m]."""
    fs = (len(time) - 1) / (time[-1] - time[0])
    velocity = np.gradient(zero_phase_lowpass(position, STILL_CUTOFF, 2, fs), 1.0 / fs)
    found: list[Hold] = []
    for run in runs(np.abs(velocity) < STILL):
        # The very first hold has nothing to settle from.
        start = run.start + (round(SETTLING * fs) if run.start else 0)
        if run.stop - start < shortest * fs:
            continue
        angle = float(np.mean(position[start : run.stop]))
        step = angle - found[-1].angle if found else 0.0
        # A pause in mid-approach ends where the next one begins.
        approach = (1 if step > 0.0 else -1) if abs(step) > DISTINCT else (found[-1].approach if found else 0)
        found.append(
            Hold(
                recording,
                float(time[start]),
                float(time[run.stop - 1]),
                angle,
                float(np.mean(torque[start : run.stop])),
                float(np.std(torque[start : run.stop])),
                approach,
            )
        )
    if not found:
        raise IdentificationError(
            f"{recording or 'the recording'}: found no {shortest:g} s in which the joint is held still, expected some "
            "at different angles"
        )
    return tuple(found)


def fit_gravity(holds: Sequence[Hold], *, zero: Parameter | None = None, level: float = LEVEL) -> GravityFit:
    """Least squares of torque on sin(q - zero), an offset, and friction by the side of the approach."""
    angle, torque = np.array([h.angle for h in holds]), np.array([h.torque for h in holds])
    _refuse_few(angle, holds)
    approach = np.array([float(h.approach) for h in holds])
    both = np.sum(approach > 0.0) > 0 and np.sum(approach < 0.0) > 0
    columns = [np.sin(angle), np.ones_like(angle)] + ([approach] if both else [])
    if zero is not None:
        return _with_zero(holds, columns, torque, zero, level)
    turned = _solve(np.column_stack([*columns, np.cos(angle)]), torque, level)
    rest = turned is not None and abs(turned.values[-1]) > turned.half[-1]
    found = turned if rest else _solve(np.column_stack(columns), torque, level)
    if found is None:
        raise IdentificationError(
            f"{len(holds)} holds for {len(columns)} unknowns, expected more holds than unknowns: hold more angles"
        )
    a, b = found.values[0], found.values[-1] if rest else 0.0
    chosen = [0, len(found.values) - 1] if rest else [0]
    covariance = np.zeros((2, 2))
    covariance[: len(chosen), : len(chosen)] = found.covariance[np.ix_(chosen, chosen)]
    gravity, zero = phasor_parameters(np.array([a, b]), covariance)
    sd = np.sqrt(np.diag(found.covariance))
    friction = Parameter("friction", "N*m", float(found.values[2]), float(sd[2])) if both else None
    return GravityFit(
        gravity,
        zero if rest else None,
        Parameter("offset", "N*m", float(found.values[1]), float(sd[1])),
        friction,
        np.array([a, b]),
        covariance,
        tuple(holds),
        found.residual,
    )


def added_gravity(together: Sequence[Sequence[Hold]], alone: GravityFit) -> tuple[Parameter, Parameter]:
    """Gravity of what was fixed to a segment: the torque that holds both, less what holds the segment alone.

    What the torque's sensor shows without load, and the bearing's friction, are in both and go out of the difference:
    it is left with no constant, so that the angle at which the added body hangs can be told from few angles.

    Gives `gravity`, `zero` [N m], [rad].
    """
    blocks, targets, phasors = [], [], []
    for holds in together:
        angle = np.array([h.angle for h in holds])
        _refuse_few(angle, holds)
        friction = alone.friction.value if alone.friction is not None else 0.0
        carried = alone.torque(angle) + friction * np.array([h.approach for h in holds])
        blocks.append(np.column_stack([np.sin(angle), np.cos(angle)]))
        targets.append(np.array([h.torque for h in holds]) - carried)
        phasors.append(np.linalg.lstsq(blocks[-1], targets[-1], rcond=None)[0])
    found = _solve(np.vstack(blocks), np.concatenate(targets), LEVEL)
    if found is None:
        raise IdentificationError("too few holds of both bodies for a gravity torque and an angle of rest")
    covariance = found.covariance
    if len(phasors) > 1:
        widen = (stdtrit(len(phasors) - 1, 0.5 + LEVEL / 2.0) / ndtri(0.5 + LEVEL / 2.0)) ** 2
        between = widen * np.cov(np.transpose(phasors)) / len(phasors)
        covariance = between if between[0, 0] > covariance[0, 0] else covariance
    return phasor_parameters(found.values, covariance + alone.phasor_covariance)


def phasor_parameters(phasor: np.ndarray, covariance: np.ndarray) -> tuple[Parameter, Parameter]:
    """m g l and the angle of rest from the coefficients of sin q and cos q. `phasor` (2,) [N m]; `covariance` (2,
    2)."""
    a, b = phasor
    size = float(np.hypot(a, b))
    along, across = np.array([a, b]) / size, np.array([b, -a]) / size**2
    gravity = Parameter("gravity", "N*m", size, float(np.sqrt(along @ covariance @ along)))
    return gravity, Parameter("zero", "rad", float(np.arctan2(-b, a)), float(np.sqrt(across @ covariance @ across)))


# --- as published ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LineFit:
    """A straight line through torque over angle: `slope` [N m/rad], `intercept` [N m], the slope through the origin,
    and the largest residual [N m]."""

    slope: float
    intercept: float
    through_origin: float
    largest_residual: float


def line_of_best_fit(angle: np.ndarray, torque: np.ndarray) -> LineFit:
    """The thesis's trend line of torque against angle (its section 2.3.1). `angle`, `torque` (k,) [rad], [N m]."""
    slope, intercept = np.polyfit(angle, torque, 1)
    residual = torque - slope * angle - intercept
    return LineFit(
        float(slope), float(intercept), float(angle @ torque / (angle @ angle)), float(np.abs(residual).max())
    )


def cosine_moment(angle: np.ndarray, torque: np.ndarray) -> float:
    """m g l by the thesis's equation 2.3, tau = m g l cos q, by least squares [N m]. `angle`, `torque` (k,) [rad],
    [N m]."""
    c = np.cos(angle)
    return float(c @ torque / (c @ c))


def accuracy(found: float, theoretical: float) -> tuple[float, float]:
    """How near two values are [%]: relative to what was found (as the thesis computes it), and to the theoretical one
    (as it says)."""
    off = abs(found - theoretical)
    return 100.0 * (1.0 - off / abs(found)), 100.0 * (1.0 - off / abs(theoretical))


# --- least squares --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Solution:
    values: np.ndarray
    covariance: np.ndarray  # wide enough that 1.96 standard errors are Student's interval
    half: np.ndarray
    residual: np.ndarray


def _solve(columns: np.ndarray, torque: np.ndarray, level: float) -> _Solution | None:
    n, p = columns.shape
    if n <= p or np.linalg.cond(columns) > 1e6:
        return None
    values, *_ = np.linalg.lstsq(columns, torque, rcond=None)
    residual = torque - columns @ values
    widen = stdtrit(n - p, 0.5 + level / 2.0) / ndtri(0.5 + level / 2.0)
    covariance = widen**2 * (residual @ residual) / (n - p) * np.linalg.inv(columns.T @ columns)
    half = ndtri(0.5 + level / 2.0) * np.sqrt(np.diag(covariance))
    return _Solution(values, covariance, half, residual)


def _with_zero(
    holds: Sequence[Hold], columns: list[np.ndarray], torque: np.ndarray, zero: Parameter, level: float
) -> GravityFit:
    """The fit about a given angle of rest, and what its uncertainty does to gravity."""
    angle = np.array([h.angle for h in holds])
    about = [_solve(np.column_stack([np.sin(angle - z), *columns[1:]]), torque, level) for z in
             (zero.value, zero.value + max(zero.standard_error, 1e-6))]  # fmt: skip
    if about[0] is None or about[1] is None:
        raise IdentificationError(
            f"{len(holds)} holds for {len(columns)} unknowns, expected more holds than unknowns: hold more angles"
        )
    found, moved = about[0], about[1].values[0] - about[0].values[0]
    size, z = float(found.values[0]), zero.value
    sd = np.sqrt(np.diag(found.covariance))
    # By size, and by the angle: a wrong zero also moves the size.
    by_size = np.array([np.cos(z), -np.sin(z)])
    by_zero = size * np.array([-np.sin(z), -np.cos(z)]) * zero.standard_error + moved * by_size
    return GravityFit(
        Parameter("gravity", "N*m", size, float(np.hypot(sd[0], moved))),
        zero,
        Parameter("offset", "N*m", float(found.values[1]), float(sd[1])),
        Parameter("friction", "N*m", float(found.values[2]), float(sd[2])) if len(columns) > 2 else None,
        size * by_size,
        found.covariance[0, 0] * np.outer(by_size, by_size) + np.outer(by_zero, by_zero),
        tuple(holds),
        found.residual,
    )


def _refuse_few(angle: np.ndarray, holds: Sequence[Hold]) -> None:
    distinct = np.sum(np.diff(np.sort(angle)) > DISTINCT) + 1 if len(angle) else 0
    if distinct < FEWEST_ANGLES:
        where = ", ".join(sorted({h.recording for h in holds if h.recording})) or "the recordings"
        raise IdentificationError(
            f"{where}: the segment is held at {distinct} angle(s), expected {FEWEST_ANGLES} or more apart by at least "
            f"{np.degrees(DISTINCT):.0f} deg"
        )
