r"""Calibrate Hill-type muscles to a person: from EMG envelopes and muscle geometry to the measured joint torque.

The free parameters are :math:`z = (x - \bar x)/\sigma`, standard deviations from the anatomical value (of the logarithm
for factors). The cost is

.. math::
   C(z) = \frac{1}{2 n s^2} \sum_t w_t \, (\tau_t(z) - \tau^{ref}_t)^2 + \frac{\lambda^2}{2} \, z^T z, \qquad
   \tau = \sum_m r_m F_m + c - k q - b \dot q

with s the standard deviation of the reference torque. The last three terms are the joint's passive tissue. Several
joints share one set of muscles: each joint's errors are divided by its own s, and n counts the samples of all joints.
For coupled priors a quadratic form replaces :math:`z^T z` (`coupled_priors`). The core computes exact derivatives. The
default method is bounded least squares; a particle swarm with conjugate gradients, and these alone, are those of
published methods.
Envelopes are relative to a maximal contraction [1]_.

.. [1] D. G. Lloyd, T. F. Besier, "An EMG-driven musculoskeletal model to estimate muscle forces and knee joint moments
   in vivo", J. Biomech. 36, 2003.

Quantities of muscles that a calibration may change: physiological bounds and the variation between people.

EMG envelopes and a joint's torque do not determine every parameter of every muscle. Each parameter therefore has a
prior: its anatomical value, with the standard deviation among people. A parameter that the recording determines moves
freely within its bounds; any other stays near its anatomical value.

Anatomical priors of muscles that are calibrated across several joints: correlated strengths and a common delay.

The muscles of a functional group are strong or weak together, so their strengths are correlated among people. All
muscles share one shape of activation, one delay and, unless cross-validation prefers more, one time constant. The time
from an envelope to the force lies between 10 and 100 ms; it is the sum of a pure delay and two first-order lags.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..._errors import IdentificationError
from ...numerics.searches.bounded_least_squares import Descent, bounded_least_squares
from ...numerics.searches.swarm import conjugate_gradient, swarm_with_gradients
from ..models.hill import FreeParameter, HillData, HillModel, HillMuscle


@dataclass(frozen=True)
class Freedom:
    """Bounds and prior of one quantity that a calibration may free."""

    quantity: str  # name in `pellucid.emg.models.hill`
    shared: bool  # whether all muscles share one value
    relative: bool  # whether bounds and spread are factors of each muscle's anatomical value instead of SI
    lower: float
    upper: float
    spread: float  # standard deviation among people around the anatomical value
    logarithm: bool = False  # whether the spread is that of the logarithm, so that half and double are equally far


QUANTITY_FREEDOMS: Mapping[str, Freedom] = {
    freedom.quantity: freedom
    for freedom in (
        Freedom("strength", False, True, 0.3, 3.0, 0.4, logarithm=True),
        Freedom("tendon_slack_length", False, True, 0.95, 1.05, 0.02),
        Freedom("optimal_fibre_length", False, True, 0.85, 1.15, 0.06),
        Freedom("passive_scale", False, False, 0.0, 3.0, 0.5),
        Freedom("shape", True, False, -3.0, 0.0, 1.0),
        Freedom("time_constant", False, False, 0.005, 0.06, 0.015),
        Freedom("delay", True, False, 0.0, 0.1, 0.02),
        Freedom("max_velocity", True, False, 5.0, 15.0, 3.0),
        Freedom("force_length_width", True, False, 0.25, 0.8, 0.15),
        Freedom("optimal_length_shift", True, False, 0.0, 0.25, 0.1),
    )
}
"""All quantities that can be freed, by name. The bounds on activation (A in [-3, 0], delay up to 100 ms) are
published."""

DEFAULT_QUANTITIES = (
    "strength",
    "tendon_slack_length",
    "optimal_fibre_length",
    "passive_scale",
    "shape",
    "time_constant",
    "delay",
)
"""Quantities that are freed by default."""

QUANTITY_UNITS: Mapping[str, str] = {"time_constant": "s", "delay": "s", "max_velocity": "1/s"}
"""Units of the quantities that are not dimensionless."""


@dataclass(frozen=True)
class Prior:
    """A free parameter with its anatomical prior: mean and standard deviation, the latter of the logarithm if so
    stated."""

    free: FreeParameter
    expected: float
    spread: float
    logarithm: bool = False

    @property
    def unit(self) -> str:
        """Unit of the parameter; "1" for a factor."""
        return "1" if self.free.relative else QUANTITY_UNITS.get(self.free.quantity, "1")


def muscle_priors(muscles: Sequence[HillMuscle], quantities: Sequence[str] = DEFAULT_QUANTITIES) -> tuple[Prior, ...]:
    """Return the free parameters of some muscles with their priors."""
    names = tuple(m.name for m in muscles)
    free = []
    for quantity in quantities:
        f = QUANTITY_FREEDOMS[quantity]
        for group in (names,) if f.shared else tuple((name,) for name in names):
            name = quantity if f.shared else f"{quantity}.{group[0]}"
            free.append(FreeParameter(name, quantity, group, f.lower, f.upper, f.relative))
    start = HillModel(muscles, free).start
    return tuple(
        Prior(
            parameter,
            float(expected),
            QUANTITY_FREEDOMS[parameter.quantity].spread,
            QUANTITY_FREEDOMS[parameter.quantity].logarithm,
        )
        for parameter, expected in zip(free, start, strict=True)
    )


CALIBRATION_METHODS = ("least_squares", "swarm", "descent")
"""Bounded least squares; swarm with conjugate gradients; these alone."""


@dataclass(frozen=True)
class SearchSettings:
    """Start and end of the least-squares search."""

    # Number of starting points of least squares: the anatomical values, and random draws for the rest
    start_count: int = 3
    screening_evaluations: int = 15  # After this many evaluations only the best of several starts is continued
    # Least squares stops when a step would reduce the cost by less than this share. The recording cannot resolve
    # smaller changes.
    cost_tolerance: float = 1e-3
    seed: int = 160214  # Seed of the random starting points
    # A parameter closer to a bound than this, in standard deviations among people, counts as held by it
    at_bound_distance: float = 0.01
    anatomy_weight: float = 0.01  # Default of lambda, the weight of anatomy


FIT_SEARCH = SearchSettings()


PASSIVE_TISSUE_PARAMETERS = (("offset", "N*m", -20.0, 20.0, 5.0), ("stiffness", "N*m/rad", 0.0, 40.0, 10.0),
           ("damping", "N*m*s/rad", 0.0, 3.0, 0.5))  # fmt: skip
"""Parameters of the joint's passive tissue: name, unit, lower and upper bound, and prior standard deviation around
0."""


@dataclass(frozen=True, eq=False)
class MuscleSamples:
    """Samples that muscles are calibrated to."""

    data: HillData  # envelopes and geometry of m muscles, n samples
    torque: np.ndarray  # (n,) reference torque [N m]; this and the next three are (j, n) for several joints
    angle: np.ndarray  # (n,) joint angle, positive in the direction of the torque [rad]
    speed: np.ndarray  # (n,) joint velocity [rad/s]
    weight: np.ndarray  # (n,) weight of the squared error; 0 excludes a sample, but its envelope still enters the lags
    joints: tuple[str, ...] = ("joint",)  # name of each joint; arrays of a single joint have no row axis

    @cached_property
    def passive(self) -> np.ndarray:
        """Derivatives of the torque by each joint's passive offset, stiffness and damping, (3, n) or (3 j, j, n)."""
        each = np.stack((np.ones_like(self.angle), -self.angle, -self.speed))
        if self.torque.ndim == 1:
            return each
        own = np.eye(len(self.joints))[:, None, :, None]
        return (own * each.swapaxes(0, 1)[:, :, None]).reshape(-1, *self.torque.shape)

    def only(self, counted: np.ndarray) -> MuscleSamples:
        """Return the same samples with nonzero weight only where `counted` (indices or mask)."""
        weight = np.zeros_like(self.weight)
        weight[..., counted] = self.weight[..., counted]
        return replace(self, weight=weight)


class MuscleProblem:
    """Cost, gradient and normal equations of a calibration, as functions of z, standard deviations from anatomy."""

    def __init__(
        self,
        muscles: Sequence[HillMuscle],
        samples: MuscleSamples,
        *,
        quantities: Sequence[str] = DEFAULT_QUANTITIES,
        passive: bool = True,
        weight: float = FIT_SEARCH.anatomy_weight,
        priors: Sequence[Prior] | None = None,
        hold: np.ndarray | None = None,
    ):
        self.samples, self.weight = samples, weight
        self.priors = tuple(muscle_priors(muscles, quantities) if priors is None else priors)
        self.model = HillModel(muscles, [p.free for p in self.priors])
        self.passive = passive
        rows = [
            (p.free.name, p.unit, p.expected, p.spread, p.logarithm, low, high)
            for p, low, high in zip(self.priors, *self.model.bounds, strict=True)
        ]
        rows += [
            (f"{joint}.{name}", unit, 0.0, spread, False, low, high)
            for joint in (samples.joints if passive else ())
            for name, unit, low, high, spread in PASSIVE_TISSUE_PARAMETERS
        ]
        self.names, self.units, expected, spread, log, low, high = zip(*rows, strict=True)
        self.expected, self.spread, self._log = np.array(expected), np.array(spread), np.array(log, bool)
        self.lower, self.upper = self.deviations(np.array(low)), self.deviations(np.array(high))
        # `hold` is the prior's precision matrix: the inverse of the correlations of z among people.
        self.hold = np.eye(len(self.names))
        if hold is not None:
            self.hold[: len(hold), : len(hold)] = hold
        self.count = float(samples.weight.sum())
        spreads = []
        for torque, own_weight in zip(*map(np.atleast_2d, (samples.torque, samples.weight)), strict=True):
            counted = own_weight > 0.0
            if not counted.any() or np.std(torque[counted]) == 0.0:
                raise IdentificationError(
                    f"calibration: found {int(counted.sum())} samples that count"
                    + (" and a torque that does not change" if counted.any() else "")
                    + ", expected a torque that changes"
                )
            spreads.append(float(np.std(torque[counted])))
        self.scale = spreads[0] if samples.torque.ndim == 1 else np.array(spreads)[:, None]
        self.root = np.sqrt(samples.weight / self.count) / self.scale
        self._muscles = len(self.model.free)
        self._tissue = (samples.passive * self.root).reshape(-1, samples.torque.size) if passive else None

    def held_by(self, weight: float) -> MuscleProblem:
        """Return the same problem with another weight of anatomy."""
        made = copy(self)
        made.weight = weight
        return made

    def values(self, z: np.ndarray) -> np.ndarray:
        """Convert z, shape (..., p), to parameters in their units."""
        moved = self.spread * np.asarray(z, float)
        return np.where(self._log, self.expected * np.exp(np.where(self._log, moved, 0.0)), self.expected + moved)

    def gains(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives of the parameters with respect to z, shape (p,)."""
        return self._gains(self.values(z))

    def _gains(self, x: np.ndarray) -> np.ndarray:
        return self.spread * np.where(self._log, x, 1.0)

    def deviations(self, values: np.ndarray) -> np.ndarray:
        """Convert parameters in their units to z, shape (p,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self._log, np.log(values / self.expected), values - self.expected) / self.spread

    def torque(self, z: np.ndarray, samples: MuscleSamples | None = None) -> np.ndarray:
        """Predict the torque for z, shape (n,) or (j, n) [N m], of the problem's or of other `samples`."""
        samples, x = samples or self.samples, self.values(z)
        return self._with_tissue(self.model.torque(samples.data, x[: self._muscles]), x, samples)

    def _with_tissue(self, torque: np.ndarray, x: np.ndarray, samples: MuscleSamples) -> np.ndarray:
        if not self.passive:
            return torque
        return torque + (x[self._muscles :] @ samples.passive.reshape(-1, torque.size)).reshape(torque.shape)

    def jacobian(self, z: np.ndarray, samples: MuscleSamples | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque, shape (n,) or (j, n), and its derivatives by z, shape (p, n) or (p, j, n)."""
        samples, x = samples or self.samples, self.values(z)
        torque, slopes = self.model.jacobian(samples.data, x[: self._muscles])
        torque = self._with_tissue(torque, x, samples)
        slopes = np.concatenate((slopes, samples.passive)) if self.passive else slopes
        return torque, slopes * self._gains(x).reshape(-1, *(1,) * torque.ndim)

    def weighed(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the weighted errors, shape (n,) or (j, n), and their derivatives by z, (p, n) or (p, j, n)."""
        torque, slopes = self.jacobian(z)
        return (torque - self.samples.torque) * self.root, slopes * self.root

    def _rows(self, z: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return cost, weighted errors, their derivatives by the parameters, the parameters' by z, and the prior's
        gradient."""
        x = self.values(z)
        torque, slopes = self.model.jacobian(self.samples.data, x[: self._muscles])
        error = ((self._with_tissue(torque, x, self.samples) - self.samples.torque) * self.root).ravel()
        rows = np.empty((len(x), error.size))
        np.multiply(slopes, self.root, out=rows[: self._muscles].reshape(slopes.shape))
        if self.passive:
            rows[self._muscles :] = self._tissue
        pulled = self.weight**2 * (self.hold @ z)
        return 0.5 * float(error @ error) + 0.5 * float(z @ pulled), error, rows, self._gains(x), pulled

    def equations(self, z: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Return cost, gradient and normal matrix, with the prior included."""
        cost, error, rows, gains, pulled = self._rows(z)
        normal = gains[:, None] * (rows @ rows.T) * gains + self.weight**2 * self.hold
        return cost, gains * (rows @ error) + pulled, normal

    def cost(self, z: np.ndarray) -> float:
        """Return the cost."""
        error = ((self.torque(z) - self.samples.torque) * self.root).ravel()
        return 0.5 * float(error @ error) + 0.5 * self.weight**2 * float(z @ self.hold @ z)

    def cost_and_gradient(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the cost and its gradient."""
        cost, error, rows, gains, pulled = self._rows(z)
        return cost, gains * (rows @ error) + pulled


@dataclass(frozen=True, eq=False)
class MuscleFit:
    """Calibrated muscles."""

    problem: MuscleProblem = field(repr=False)
    z: np.ndarray = field(repr=False)  # (p,) estimate in standard deviations from anatomy
    normal: np.ndarray = field(repr=False)  # (p, p) J'J at the estimate, with the prior included
    cost: float
    method: str
    costs: tuple[float, ...]  # cost of each start when the best was chosen
    evaluations: int  # number of evaluations of the cost, over all starts
    seconds: float  # duration of the calibration, all starts included [s]

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name, in their units."""
        return dict(zip(self.problem.names, map(float, self.problem.values(self.z)), strict=True))

    @property
    def muscles(self) -> tuple[HillMuscle, ...]:
        """The calibrated muscles."""
        return self.problem.model.with_values(self.problem.values(self.z)[: len(self.problem.priors)])

    @property
    def passive(self) -> tuple[float, float, float]:
        """Offset [N m], stiffness [N m/rad] and damping [N m s/rad] of the first joint's passive tissue."""
        return next(iter(self.tissue.values()))

    @property
    def tissue(self) -> dict[str, tuple[float, float, float]]:
        """Offset, stiffness and damping of the passive tissue, by joint."""
        joints = self.problem.samples.joints
        if not self.problem.passive:
            return dict.fromkeys(joints, (0.0, 0.0, 0.0))
        own = self.problem.values(self.z)[len(self.problem.priors) :].reshape(
            len(joints), len(PASSIVE_TISSUE_PARAMETERS)
        )
        return {joint: (float(row[0]), float(row[1]), float(row[2])) for joint, row in zip(joints, own, strict=True)}

    @property
    def at_bound(self) -> np.ndarray:
        """Whether each parameter ended on a bound, or too close to it to be distinguished from it, shape (p,)."""
        return (self.z <= self.problem.lower + FIT_SEARCH.at_bound_distance) | (
            self.z >= self.problem.upper - FIT_SEARCH.at_bound_distance
        )

    def predict(self, samples: MuscleSamples) -> np.ndarray:
        """Predict the torque of other samples, shape (n,) or (j, n) [N m]; their own torque is not used."""
        return self.problem.torque(self.z, samples)


def solve_calibration(
    problem: MuscleProblem,
    *,
    method: str = "least_squares",
    starts: int = FIT_SEARCH.start_count,
    iterations: int | None = None,
    near: np.ndarray | None = None,
) -> MuscleFit:
    """Calibrate muscles to a measured torque by one of `CALIBRATION_METHODS`.

    Least squares starts from `near`, a z of shape (p,), if it is given, and from random draws for further `starts`.
    """
    if method not in CALIBRATION_METHODS:
        raise IdentificationError(
            f"calibration: found the method {method!r}, expected one of {', '.join(CALIBRATION_METHODS)}"
        )
    began, rng = time.perf_counter(), np.random.default_rng(FIT_SEARCH.seed)
    low, high = problem.lower, problem.upper
    first = np.clip(np.zeros(len(low)) if near is None else near, low, high)
    if method == "least_squares":
        begin = [first, *(np.clip(rng.normal(0.0, 0.7, len(low)), low, high) for _ in range(starts - 1))]
        most = iterations or 60
        found = [_descend(problem, z, FIT_SEARCH.screening_evaluations if starts > 1 else most) for z in begin]
        evaluations, costs = sum(end.evaluations for end in found), tuple(end.cost for end in found)
        end = found[int(np.argmin(costs))]
        if starts > 1 and not end.converged:
            end = _descend(problem, end.x, most)
            evaluations += end.evaluations
        return MuscleFit(problem, end.x, end.normal, end.cost, method, costs, evaluations, time.perf_counter() - began)
    if method == "swarm":
        ends = swarm_with_gradients(
            problem.cost, problem.cost_and_gradient, low, high, rng=rng, iterations=iterations or 30
        )
    else:
        ends = conjugate_gradient(
            problem.cost_and_gradient, first, value=problem.cost, lower=low, upper=high, iterations=iterations or 200
        )
    cost, _, normal = problem.equations(ends.best)
    return MuscleFit(problem, ends.best, normal, cost, method, (cost,), ends.evaluations, time.perf_counter() - began)


def _descend(problem: MuscleProblem, start: np.ndarray, iterations: int) -> Descent:
    """Run bounded least squares from one start."""
    return bounded_least_squares(
        problem.equations,
        start,
        problem.lower,
        problem.upper,
        iterations=iterations,
        tolerance=FIT_SEARCH.cost_tolerance,
    )


MUSCLE_GROUPS: Mapping[str, tuple[str, ...]] = {
    "quadriceps": ("rectus_femoris", "vastus_intermedius", "vastus_lateralis", "vastus_medialis"),
    "hamstrings": ("biceps_femoris_long", "biceps_femoris_short", "semimembranosus", "semitendinosus"),
    "triceps_surae": ("gastrocnemius_lateralis", "gastrocnemius_medialis", "soleus"),
}
"""Functional groups of muscles. A muscle in no group is uncorrelated with the others."""

GROUP_STRENGTH_CORRELATION = 0.7
"""Correlation among people between the logarithms of the strengths of a group's muscles."""


@dataclass(frozen=True)
class DelayBounds:
    """Bounds of the time from an envelope to the force, and its prior."""

    min_total_s: float = 0.01  # Shortest time from an envelope to the force, pure delay and lags together
    max_total_s: float = 0.1  # Longest time from an envelope to the force, pure delay and lags together
    min_lag_s: float = 0.005  # Smallest time constant of either lag
    # Margin for rounding, by which the longest pure delay stays below `max_total_s` minus the lags
    rounding_s: float = 1e-6
    # Bounds of the clock offset of an EMG stream, where it is estimated; positive where the stream is early
    offset_bounds_s: tuple[float, float] = (-0.15, 0.3)
    offset_spread_s: float = 0.1  # Prior standard deviation of that offset around 0


DELAY_BOUNDS = DelayBounds()


@dataclass(frozen=True)
class Timing:
    """How the time from an envelope to the force is divided into lags and a pure delay."""

    longest_lag: float  # largest time constant of either lag [s]; the pure delay takes the remainder of 100 ms
    own: bool = False  # whether each muscle has its own time constant
    offset: bool = False  # whether the clock offset of the EMG stream is estimated

    def pure(self, period: float) -> float:
        """Return the longest pure delay [s] for a sampling `period` [s], so that delay and lags stay below 100 ms."""
        pole = np.exp(-period / self.longest_lag)
        return DELAY_BOUNDS.max_total_s - 2.0 * period * float(pole / (1.0 - pole)) - DELAY_BOUNDS.rounding_s

    @property
    def ahead(self) -> float:
        """Time by which envelopes are advanced before they are delayed, so that a late stream has a short delay [s]."""
        return -DELAY_BOUNDS.offset_bounds_s[0] if self.offset else 0.0

    @property
    def words(self) -> str:
        """The timing as a noun phrase."""
        return ("a time constant each" if self.own else "one time constant") + f" up to {1e3 * self.longest_lag:.0f} ms"


TIMING_CANDIDATES = tuple(Timing(longest, own) for own in (False, True) for longest in (0.025, 0.04))
"""Candidates from which cross-validation within the fitted data chooses, the simplest first."""

_PRIOR_QUANTITIES_WITHOUT_TIMING = ("strength", "tendon_slack_length", "optimal_fibre_length", "passive_scale", "shape")


def coupled_priors(
    muscles: Sequence[HillMuscle], timing: Timing, period: float
) -> tuple[tuple[Prior, ...], np.ndarray]:
    """Return the p free parameters of muscles across joints with their priors, and the inverse correlation matrix.

    The matrix, shape (p, p), is that of the deviations from anatomy. `period` is the sampling period [s].
    """
    names = tuple(m.name for m in muscles)
    priors = [*muscle_priors(muscles, _PRIOR_QUANTITIES_WITHOUT_TIMING), *_timing_priors(names, timing, period)]
    correlation = np.eye(len(priors))
    at = {p.free.muscles[0]: i for i, p in enumerate(priors) if p.free.quantity == "strength"}
    for group in MUSCLE_GROUPS.values():
        own = [at[name] for name in group if name in at]
        correlation[np.ix_(own, own)] = GROUP_STRENGTH_CORRELATION
    np.fill_diagonal(correlation, 1.0)
    return tuple(priors), np.linalg.inv(correlation)


def _timing_priors(names: tuple[str, ...], timing: Timing, period: float) -> list[Prior]:
    """Return the priors of the time constants and of the delay."""
    most, spread = timing.longest_lag, QUANTITY_FREEDOMS["time_constant"].spread
    of = [(f"time_constant.{name}", (name,)) for name in names] if timing.own else [("time_constant", names)]
    lags = [
        Prior(
            FreeParameter(name, "time_constant", driven, DELAY_BOUNDS.min_lag_s, most),
            0.5 * (DELAY_BOUNDS.min_lag_s + most),
            spread,
        )
        for name, driven in of
    ]
    first, last = DELAY_BOUNDS.min_total_s, timing.pure(period)
    middle, spread = 0.5 * (first + last), QUANTITY_FREEDOMS["delay"].spread
    if timing.offset:
        first, last, middle = 0.0, last + timing.ahead + DELAY_BOUNDS.offset_bounds_s[1], middle + timing.ahead
        spread = DELAY_BOUNDS.offset_spread_s
    return [*lags, Prior(FreeParameter("delay", "delay", names, first, last), middle, spread)]
