r"""Estimate the gravity torque of a segment from angles at which it was held.

At rest an actuator carries gravity, and friction whose sign depends on the direction of approach:

.. math::
    \tau = m g l \sin(q - q_0) + \tau_0 \pm \tau_f

with q = 0 hanging. Written with sin q, cos q and 1 it is linear. Approaching an angle from below and from above
separates friction from gravity. If all angles are approached from one side, a constant friction joins the offset, and
gravity is not affected.

The thesis fits a straight line to torque over angle, and writes the torque with a cosine (its equations 2.3 and 2.6).
Both are included as published alternatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri, stdtrit

from .._errors import IdentificationError
from ..models.estimates import Parameter
from .filters import runs, zero_phase_lowpass


@dataclass(frozen=True)
class HoldSettings:
    """What counts as a hold, and how many of them tell a weight."""

    max_hold_speed: float = 0.02  # Below this speed [rad/s] a segment counts as held
    # Cut-off of the low-pass before that decision [Hz], so that tremor and encoder steps do not count as motion.
    hold_cutoff_hz: float = 2.0
    min_hold_s: float = 1.0  # Shortest duration of a settled hold [s]
    # Time left out at the beginning of each hold [s], while the control loop creeps to its target.
    hold_settling_s: float = 0.75
    min_angle_count: int = 3  # Smallest number of different angles that determines gravity
    confidence_level: float = 0.95  # Confidence level of the intervals, unless another is given


HOLD_SETTINGS = HoldSettings()


MIN_ANGLE_DIFFERENCE_RAD = np.radians(3.0)
"""Two holds count as different angles if they are farther apart than this [rad]."""


@dataclass(frozen=True)
class Hold:
    """One angle at which a segment was held."""

    recording: str
    start: float  # time of the first settled sample, on the recording's clock [s]
    end: float  # time of the last settled sample [s]
    angle: float  # mean angle [rad]
    torque: float  # mean torque [N m]
    torque_sd: float  # standard deviation of the torque samples [N m]
    approach: int  # direction of approach: 1 from below, -1 from above, 0 for the first hold


@dataclass(frozen=True)
class GravityFit:
    """Gravity of one segment, estimated from holds."""

    gravity: Parameter  # m g l [N m]
    zero: Parameter | None  # angle at which the segment hangs [rad]; None if it does not differ from 0
    offset: Parameter  # torque that does not depend on the angle [N m]
    friction: Parameter | None  # half the torque difference between both approaches [N m]; None with one approach only
    phasor: np.ndarray = field(repr=False)  # coefficients of sin q and cos q, (2,) [N m]
    phasor_covariance: np.ndarray = field(repr=False)  # covariance of `phasor`, (2, 2) [N^2 m^2], widened for few holds
    holds: tuple[Hold, ...] = field(repr=False)
    residual: np.ndarray = field(repr=False)  # torque residual of each hold, (k,) [N m]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that were estimated."""
        return tuple(p for p in (self.gravity, self.zero, self.offset, self.friction) if p is not None)

    def torque(self, angle: np.ndarray) -> np.ndarray:
        """Return the torque that holds the segment, without friction, shape (n,) [N m], at `angle`, (n,) [rad]."""
        return self.phasor[0] * np.sin(angle) + self.phasor[1] * np.cos(angle) + self.offset.value


def find_holds(
    time: np.ndarray,
    position: np.ndarray,
    torque: np.ndarray,
    *,
    recording: str = "",
    shortest: float = HOLD_SETTINGS.min_hold_s,
) -> tuple[Hold, ...]:
    """Find the holds of a recording, without the time in which they settle.

    `time` [s], `position` [rad] and `torque` [N m] have shape (n,).
    """
    fs = (len(time) - 1) / (time[-1] - time[0])
    velocity = np.gradient(zero_phase_lowpass(position, HOLD_SETTINGS.hold_cutoff_hz, 2, fs), 1.0 / fs)
    found: list[Hold] = []
    for run in runs(np.abs(velocity) < HOLD_SETTINGS.max_hold_speed):
        # A hold at the start of the recording has already settled.
        start = run.start + (round(HOLD_SETTINGS.hold_settling_s * fs) if run.start else 0)
        if run.stop - start < shortest * fs:
            continue
        angle = float(np.mean(position[start : run.stop]))
        step = angle - found[-1].angle if found else 0.0
        # A hold at the same angle as the last one continues its approach.
        approach = (
            (1 if step > 0.0 else -1) if abs(step) > MIN_ANGLE_DIFFERENCE_RAD else (found[-1].approach if found else 0)
        )
        ends, held = (float(time[start]), float(time[run.stop - 1])), torque[start : run.stop]
        found.append(Hold(recording, *ends, angle, float(np.mean(held)), float(np.std(held)), approach))
    if not found:
        raise IdentificationError(
            f"{recording or 'the recording'}: found no {shortest:g} s in which the joint is held still, expected some "
            "at different angles"
        )
    return tuple(found)


def fit_gravity(
    holds: Sequence[Hold], *, zero: Parameter | None = None, level: float = HOLD_SETTINGS.confidence_level
) -> GravityFit:
    """Fit gravity to holds by least squares of torque on sin(q - zero), an offset, and the sign of the approach.

    `zero` is a known angle of rest; without it the angle is estimated if it differs from 0 significantly.
    """
    angle, torque = np.array([h.angle for h in holds]), np.array([h.torque for h in holds])
    _require_different_angles(angle, holds)
    approach = np.array([float(h.approach) for h in holds])
    both = np.sum(approach > 0.0) > 0 and np.sum(approach < 0.0) > 0
    columns = [np.sin(angle), np.ones_like(angle)] + ([approach] if both else [])
    if zero is not None:
        return _fit_about_zero(holds, columns, torque, zero, level)
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
    """Estimate the gravity of a body fixed to a segment, from the torque that holds both minus that of the segment.

    The torque sensor's offset and the bearing's friction cancel in the difference. It has no constant term, so few
    angles determine the angle at which the added body hangs.

    Returns the gravity amplitude [N m] and the angle of rest [rad].
    """
    blocks, targets, phasors = [], [], []
    for holds in together:
        angle = np.array([h.angle for h in holds])
        _require_different_angles(angle, holds)
        friction = alone.friction.value if alone.friction is not None else 0.0
        carried = alone.torque(angle) + friction * np.array([h.approach for h in holds])
        blocks.append(np.column_stack([np.sin(angle), np.cos(angle)]))
        targets.append(np.array([h.torque for h in holds]) - carried)
        phasors.append(np.linalg.lstsq(blocks[-1], targets[-1], rcond=None)[0])
    found = _solve(np.vstack(blocks), np.concatenate(targets), HOLD_SETTINGS.confidence_level)
    if found is None:
        raise IdentificationError(
            f"found {sum(map(len, targets))} holds of both bodies, too few for a gravity torque and an angle of rest: "
            "hold more angles"
        )
    covariance = found.covariance
    if len(phasors) > 1:
        widen = (
            stdtrit(len(phasors) - 1, 0.5 + HOLD_SETTINGS.confidence_level / 2.0)
            / ndtri(0.5 + HOLD_SETTINGS.confidence_level / 2.0)
        ) ** 2
        between = widen * np.cov(np.transpose(phasors)) / len(phasors)
        covariance = between if between[0, 0] > covariance[0, 0] else covariance
    return phasor_parameters(found.values, covariance + alone.phasor_covariance)


def phasor_parameters(phasor: np.ndarray, covariance: np.ndarray) -> tuple[Parameter, Parameter]:
    """Return m g l and the angle of rest from the coefficients of sin q and cos q.

    `phasor` has shape (2,) [N m], its `covariance` (2, 2).
    """
    a, b = phasor
    size = float(np.hypot(a, b))
    along, across = np.array([a, b]) / size, np.array([b, -a]) / size**2
    gravity = Parameter("gravity", "N*m", size, float(np.sqrt(along @ covariance @ along)))
    return gravity, Parameter("zero", "rad", float(np.arctan2(-b, a)), float(np.sqrt(across @ covariance @ across)))


# --- as published ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LineFit:
    """A straight line through torque over angle."""

    slope: float  # [N m/rad]
    intercept: float  # [N m]
    through_origin: float  # slope of the best line through the origin [N m/rad]
    largest_residual: float  # largest residual of the line with intercept [N m]


def line_of_best_fit(angle: np.ndarray, torque: np.ndarray) -> LineFit:
    """Fit the thesis's trend line of torque, (k,) [N m], against angle, (k,) [rad] (its section 2.3.1)."""
    slope, intercept = np.polyfit(angle, torque, 1)
    residual = torque - slope * angle - intercept
    return LineFit(
        float(slope), float(intercept), float(angle @ torque / (angle @ angle)), float(np.abs(residual).max())
    )


def cosine_moment(angle: np.ndarray, torque: np.ndarray) -> float:
    """Fit m g l [N m] in the thesis's equation 2.3, tau = m g l cos q, to `torque` [N m] at `angle` [rad], both
    (k,)."""
    c = np.cos(angle)
    return float(c @ torque / (c @ c))


def accuracy(found: float, theoretical: float) -> tuple[float, float]:
    """Return the agreement of two values [%], relative to the value found and relative to the theoretical one.

    The thesis computes the first and describes the second.
    """
    off = abs(found - theoretical)
    return 100.0 * (1.0 - off / abs(found)), 100.0 * (1.0 - off / abs(theoretical))


# --- least squares --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Solution:
    """Least-squares solution with p coefficients from k holds."""

    values: np.ndarray  # coefficients, (p,)
    covariance: np.ndarray  # covariance, (p, p), widened so that 1.96 standard errors give Student's interval
    half: np.ndarray  # half width of each coefficient's interval, (p,)
    residual: np.ndarray  # torque residual, (k,) [N m]


def _solve(columns: np.ndarray, torque: np.ndarray, level: float) -> _Solution | None:
    """Solve for the coefficients of `columns`, (k, p); None if they are not determined."""
    n, p = columns.shape
    if n <= p or np.linalg.cond(columns) > 1e6:
        return None
    values, *_ = np.linalg.lstsq(columns, torque, rcond=None)
    residual = torque - columns @ values
    widen = stdtrit(n - p, 0.5 + level / 2.0) / ndtri(0.5 + level / 2.0)
    covariance = widen**2 * (residual @ residual) / (n - p) * np.linalg.inv(columns.T @ columns)
    half = ndtri(0.5 + level / 2.0) * np.sqrt(np.diag(covariance))
    return _Solution(values, covariance, half, residual)


def _fit_about_zero(
    holds: Sequence[Hold], columns: list[np.ndarray], torque: np.ndarray, zero: Parameter, level: float
) -> GravityFit:
    """Fit gravity about a given angle of rest, and add the effect of that angle's uncertainty."""
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
    # Derivatives of the phasor by the amplitude, and by the zero, which also changes the fitted amplitude.
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


def _require_different_angles(angle: np.ndarray, holds: Sequence[Hold]) -> None:
    """Refuse holds at too few different angles."""
    distinct = np.sum(np.diff(np.sort(angle)) > MIN_ANGLE_DIFFERENCE_RAD) + 1 if len(angle) else 0
    if distinct < HOLD_SETTINGS.min_angle_count:
        where = ", ".join(sorted({h.recording for h in holds if h.recording})) or "the recordings"
        raise IdentificationError(
            f"{where}: the segment is held at {distinct} angle(s), expected {HOLD_SETTINGS.min_angle_count} or more "
            f"apart by at least {np.degrees(MIN_ANGLE_DIFFERENCE_RAD):.0f} deg"
        )
