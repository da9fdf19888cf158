r"""Known payloads give the drive constant, the mass of a lifted load, and the shares of the load that friction takes.

A payload of mass m at distance l adds :math:`m l^2` to the inertia and :math:`m g l` to the gravity of its recording.
In the drive's own unit u (ampere or volt)

.. math::  u = u(\beta', c), \qquad c = 1/k

where c multiplies the payload's contribution. It is one more parameter of the regression, with its interval. The
payloads must differ between recordings; otherwise the payload's column is proportional to columns of the joint. A
`model` with load friction includes the friction that the payload causes. Without that term, load friction counts as
gravity of the joint.

Payloads may also separate the share of the load lost in motoring from the share lost in generating. With :math:`\alpha`
the mean of both shares and :math:`\delta` half their difference, a joint with load y needs

.. math::  \tau = (1 + \delta)\,y + \alpha\,|y|\,\mathrm{sign}\,\dot q + \dots

If inertia and gravity are unknown, :math:`\delta` is not identifiable, because it scales both equally. A payload of
known mass contributes a known part of y, so recordings with different payloads identify :math:`\delta`. The drive
constant must be known too: an unknown constant scales every effort, as :math:`1 + \delta` does.

Neither share is negative, so :math:`|\delta| \le \alpha` holds without any payload. Both shares become free parameters
if the payloads determine :math:`\delta` more tightly than that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...models.filtered_dynamics import filtered_jacobian
from ...models.friction_terms import SEPARATE_LOAD_FEATURE, TERMS
from ...models.joint import GRAVITY, NAMES, PARAMETER_INDEX, JointModel
from ...numerics.filters import central_difference, zero_phase_lowpass
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, least_squares_within
from ...numerics.uncertainty import correlation_time, sandwich_covariance
from .discrepancy import COMMON_LOAD_COEFFICIENT, LOAD_SHARE_SPREAD_RATIO, estimate_discrepancy
from .friction_solver import solve_family
from .joint_estimate import JointEstimate, joint_states

if TYPE_CHECKING:
    from ...models.anthropometry import Segment

MAX_STEPS = 30
"""Gauss-Newton steps; a model without load friction needs two."""

STEP_TOLERANCE = 1e-7
"""The search ends when a step changes the effort by less than this share of it."""


def estimate_drive_constant(model: JointModel, data: Stack[Motion]) -> Parameter:
    """Estimate the effort per ampere or volt from known payloads [N*m/A, N*m/V, N/A or N/V]."""
    if len({m.payload for m in data.motions}) < 2:
        raise IdentificationError(
            "the drive constant needs recordings with at least two different payloads (no payload counts as one); "
            f"found {data.motions[0].payload[0]:g} kg in all recordings"
        )
    lower, upper = (np.append(bound, end) for bound, end in zip(model.bounds(), (-np.inf, np.inf), strict=True))
    # The payload's scale starts at 0; the first step estimates it.
    values = np.append(solve_family(replace(model, payload_scale=0.0), data).values, 0.0)
    size = float(np.linalg.norm(data.target))
    for _ in range(MAX_STEPS):
        w, residual = _rows_with_payload(model, values, data)
        norms = np.linalg.norm(w, axis=0)
        if np.linalg.cond(w / np.maximum(norms, np.finfo(float).tiny)) > 1e6:
            raise IdentificationError(
                "these recordings do not distinguish the payload's effort from that of the joint itself; record the "
                "same motion with another known payload"
            )
        step = least_squares_within(w, residual, lower - values, upper - values)
        values = values + step
        if np.linalg.norm(w @ step) < STEP_TOLERANCE * size:
            break
    w, residual = _rows_with_payload(model, values, data)
    covariance = sandwich_covariance(w, residual, data.lengths)
    inverse, sd = values[-1], float(np.sqrt(covariance[-1, -1]))
    if not inverse > 3.0 * sd:
        raise IdentificationError(
            f"the payload changes the drive's effort by {inverse:.3g} ± {sd:.2g} {model.effort_unit} per unit of "
            "effort, which is too small or has the wrong sign; check the payload's mass and the sign of the channel"
        )
    unit = f"{'N*m' if model.motion == 'rotary' else 'N'}/{model.effort_unit}"
    return Parameter("drive_constant", unit, float(1.0 / inverse), float(sd / inverse**2))


def _rows_with_payload(model: JointModel, values: np.ndarray, data: Stack[Motion]) -> tuple[np.ndarray, np.ndarray]:
    """Return the regressor, (m, p + 1), of the free parameters and the payload's scale, and the residual, (m,).

    The last of `values`, (p + 1,), is the scale.
    """
    scaled = replace(model, payload_scale=float(values[-1]))
    columns, efforts = [], []
    for motion in data.motions:
        own = scaled.vector(values[:-1])
        one = np.zeros_like(own)
        payload = replace(model, payload_scale=1.0).loaded(one, *motion.payload)
        selection = np.column_stack([model.selection(), payload])
        effort, jacobian = filtered_jacobian(scaled.loaded(own, *motion.payload), selection, motion)
        columns.append(motion.rows(jacobian))
        efforts.append(motion.rows(effort))
    return np.concatenate(columns), data.target - np.concatenate(efforts)


MIN_EMPTY_LIFTS = 3
"""Least number of lifts without a load: fewer give no spread that an interval could come from."""

MIN_LIFT_SPEED = 0.1
"""Smallest speed of used samples [rad/s]; at rest, friction can have any value up to its largest."""

MIN_MOVING_S = 0.1
"""Shortest time above `MIN_LIFT_SPEED` in a lift that tells a load [s]."""

NORMAL_QUANTILE_97_5 = 1.959964
"""Normal quantile of 97.5 %: an interval of 95 % reaches this many standard errors to either side."""

LIFT_FILTER_ORDER = 4
"""Order of the low-pass, which runs both ways."""


@dataclass(frozen=True)
class Lift:
    """One lift: signals of the robot at an even rate."""

    position: np.ndarray  # (n,) encoder, 0 where the joint hangs [rad]
    effort: np.ndarray  # (n,) effort of the drive at the joint [N*m]
    interaction: np.ndarray  # (n,) torque of the wearer on the robot, from the force sensor [N*m]
    fs: float  # sampling rate [Hz]


@dataclass(frozen=True)
class LoadEstimate:
    """A load as one lift tells it."""

    mass: float  # [kg]
    interval: tuple[float, float]  # 95 % interval of the mass [kg]
    distance: float  # from the joint's axis, as stated [m]

    @property
    def load(self) -> Segment:
        """The load as a law takes it."""
        from ...models.anthropometry import Segment

        return Segment(self.mass, self.distance, self.mass * self.distance**2)


def estimate_load(
    body: Mapping[str, float],
    empty: Sequence[Lift],
    loaded: Lift,
    *,
    distance: float,
    lowpass: float = 8.0,
    sensor_delay: float = 0.0,
    gain_error: float = 0.0,
) -> LoadEstimate:
    """Estimate the mass of a load at a stated distance from one lift.

    Parameters
    ----------
    body : mapping of str to float
        The robot without the load, by the core's names of a joint, SI; missing parameters are 0.
    empty : sequence of Lift
        Lifts without the load, at least three.
    loaded : Lift
        The lift with it.
    distance : float
        From the axis to the load [m].
    lowpass : float
        Cutoff of the zero-phase low-pass on all signals [Hz].
    sensor_delay : float
        Time by which the force sensor is late [s].
    gain_error : float
        Standard deviation of the force sensor's gain [1]. Lifts without a load do not show it.

    Returns
    -------
    LoadEstimate

    Raises
    ------
    IdentificationError
        If there are too few lifts without the load, or a lift does not move.

    Examples
    --------
    >>> import numpy as np
    >>> from pellucid.joint.fit.drive_constant import Lift, estimate_load
    >>> t = np.arange(0.0, 1.5, 1e-3)
    >>> q = 0.3 + 0.8 * (t / 1.5) ** 2 * (3.0 - 2.0 * t / 1.5)
    >>> a = 0.8 * (6.0 - 12.0 * t / 1.5) / 1.5**2
    >>> def lift(mass, error):
    ...     weight = (2.0 + 9.80665 * 0.3 * mass + error) * np.sin(q)
    ...     return Lift(q, weight + (0.05 + 0.09 * mass) * a, np.zeros_like(t), 1000.0)
    >>> empty = [lift(0.0, error) for error in (-0.02, 0.0, 0.03)]
    >>> found = estimate_load({"inertia": 0.05, "gravity_sine": 2.0}, empty, lift(1.0, 0.0), distance=0.3)
    >>> round(found.mass, 2), found.interval[0] < 1.0 < found.interval[1]
    (1.0, True)
    """
    from scipy.special import stdtrit

    if len(empty) < MIN_EMPTY_LIFTS:
        raise IdentificationError(
            f"load: found {len(empty)} lifts without load, expected at least {MIN_EMPTY_LIFTS}, whose spread gives the "
            "confidence interval"
        )
    if not distance > 0.0:
        raise IdentificationError(f"load: found a distance of {distance:g} m, expected one above 0")
    settings = {"distance": distance, "lowpass": lowpass, "sensor_delay": sensor_delay}
    apparent = np.array([_apparent_mass(body, lift, **settings) for lift in empty])
    mass = _apparent_mass(body, loaded, **settings) - float(apparent.mean())
    n = len(apparent)
    reach = float(stdtrit(n - 1, 0.975) * apparent.std(ddof=1) * np.sqrt(1.0 + 1.0 / n))
    reach = float(np.hypot(reach, NORMAL_QUANTILE_97_5 * gain_error * mass))
    return LoadEstimate(mass, (mass - reach, mass + reach), distance)


def _apparent_mass(
    body: Mapping[str, float], lift: Lift, *, distance: float, lowpass: float, sensor_delay: float
) -> float:
    """Return the mass at the distance that makes the robot's balance hold best over a lift [kg]."""
    unknown = sorted(set(body) - set(NAMES))
    if unknown:
        raise IdentificationError(f"load: found {', '.join(unknown)} in the body, expected any of {', '.join(NAMES)}")

    def smooth(samples: np.ndarray) -> np.ndarray:
        return zero_phase_lowpass(np.asarray(samples, float), lowpass, LIFT_FILTER_ORDER, lift.fs)

    late = round(sensor_delay * lift.fs)
    felt = np.concatenate([lift.interaction[late:], np.repeat(lift.interaction[-1], late)])
    q = smooth(lift.position)
    v = central_difference(q, lift.fs)
    a = central_difference(v, lift.fs)
    used = np.abs(v) > MIN_LIFT_SPEED
    if np.count_nonzero(used) < MIN_MOVING_S * lift.fs:
        raise IdentificationError(
            f"load: found {np.count_nonzero(used) / lift.fs:.3g} s of motion above {MIN_LIFT_SPEED:g} rad/s, expected "
            f"at least {MIN_MOVING_S:g} s: lift faster or longer"
        )
    vector = np.array([body.get(name, 0.0) for name in NAMES])
    inertia, sine, cosine = (vector[PARAMETER_INDEX[name]] for name in ("inertia", "gravity_sine", "gravity_cosine"))
    # What the transmission passes on, after friction under exactly that torque: the wearer's part does not pass it.
    drive = smooth(lift.effort)
    passed = inertia * _core.forward_dynamics(vector, q, v, drive) + sine * np.sin(q) + cosine * np.cos(q)
    missing = smooth(passed) + smooth(felt) - (inertia * a + sine * np.sin(q) + cosine * np.cos(q))
    row = distance * GRAVITY * np.sin(q) + distance**2 * a
    return float(row[used] @ missing[used] / (row[used] @ row[used]))


LOAD_SHARE_NAMES = tuple(term.name for term in TERMS if term.feature == SEPARATE_LOAD_FEATURE)
"""Names of the two load coefficients: the shares of the load lost in motoring and in generating."""


@dataclass(frozen=True)
class LoadShares:
    """Decision on whether load friction has a separate coefficient for each direction of power."""

    separate: bool
    why: Literal["", "no known load", "unknown drive", "same payload", "small payload"] = ""  # reason if not separate


def decide_load_shares(model: JointModel, data: Stack[Motion]) -> LoadShares:
    """Decide whether the payloads of `data` separate the two shares of a `model` in which both are free."""
    payloads = {motion.payload for motion in data.motions}
    if not any(mass for mass, _ in payloads):
        return LoadShares(False, "no known load")
    if model.effort_unit not in ("N*m", "N"):
        return LoadShares(False, "unknown drive")
    if len(payloads) < 2:
        return LoadShares(False, "same payload")
    try:
        found = solve_family(model, data)
    except IdentificationError:
        return LoadShares(False, "small payload")
    at = [model.names.index(name) for name in LOAD_SHARE_NAMES]
    mean = float(np.mean(found.values[at]))
    if not _half_difference_error(model, data, found, at) < LOAD_SHARE_SPREAD_RATIO * mean:
        return LoadShares(False, "small payload")
    return LoadShares(True)


def widen_for_unknown_shares(constant: Parameter, estimate: JointEstimate) -> Parameter:
    r"""Widen the error of a drive `constant` from payloads, because the two load shares may differ.

    The payloads determine the constant divided by :math:`1 + \delta`. An `estimate` with load friction limits
    :math:`\delta`.
    """
    if COMMON_LOAD_COEFFICIENT not in estimate:
        return constant
    error = np.hypot(
        constant.standard_error, LOAD_SHARE_SPREAD_RATIO * estimate[COMMON_LOAD_COEFFICIENT].value * constant.value
    )
    return replace(constant, standard_error=float(error))


def _half_difference_error(model: JointModel, data: Stack[Motion], found: Solution, at: list[int]) -> float:
    """Return the standard error of half the difference of the two shares, whose indices are `at`."""
    memory = correlation_time(found.residual, data.lengths)
    covariance = sandwich_covariance(found.jacobian, found.residual, data.lengths, memory=memory)
    states = joint_states(model, data, found.values)
    beside = estimate_discrepancy(model.names, found.values, found.jacobian, found.residual, states, covariance)
    total = (covariance + beside.covariance)[np.ix_(at, at)]
    half_difference = np.array([0.5, -0.5])
    return float(np.sqrt(half_difference @ total @ half_difference))
