r"""Simulate and fit a driven pendulum with gravity, friction and a spring.

.. math::
   I\ddot q = \tau - b\dot q - c\tanh(\dot q/w) - m\,\sin q - k\,q - \tau_0

Friction and gravity are the core's joint; the spring, a torque that goes straight from sample to sample, and an initial
state that is an unknown like the others are what the core's simulation has not. A test holds both to the same motion.

Steps are fourth-order Runge-Kutta's. The whole motion is found by Newton's method: linearised about a guess, all steps
are one linear recursion, solved by BLAS. From the measured motion it takes a handful of iterations, and what it finds
is what stepping through would give, at a hundredth of the time that takes in Python.

**Fit.** Each parameter is known or estimated. A linear regression on filtered signals gives the start. Then the
simulated angle is fitted to the measured one with exact derivatives; every record's initial state is estimated too.
Parameters are bounded to physical values. For a parameter that ends at its bound, the fit reports the value that the
records would prefer without the bound.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, lsq_linear
from scipy.special import ndtri

from ... import _core
from ..._errors import IdentificationError
from ...models.estimates import Estimates, Parameter, Whiteness
from ...models.filtered_dynamics import regressor
from ...numerics.uncertainty import sandwich_covariance, whiteness
from ..input_output import InputOutput
from ..linear_recursion import march
from ..transfer_function import INPUT_HOLDS, filtered_powers, time_steps
from .fit_transfer_function import SINGULAR_VALUE_TOLERANCE, Response, require_samples

NAMES = ("inertia", "damping", "coulomb", "gravity", "stiffness", "offset")
"""I, b, c, m (mass times g times distance), k and tau_0, in this order everywhere."""

UNITS = ("kg*m^2", "N*m*s/rad", "N*m", "N*m", "N*m/rad", "N*m")


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of the Newton search for a whole motion."""

    newton_tolerance: float = 1e-10  # largest change of the motion, over its size, at which Newton's iteration stops
    max_newton_iterations: int = 30
    piece_steps: int = 256  # number of steps that are solved together if Newton's method fails for the whole motion
    min_piece_steps: int = 4  # the motion counts as diverging if even this many steps cannot be solved


NEWTON_SETTINGS = NewtonSettings()


MAX_END_SHIFT_RAD = 1e4
"""Radians by which a motion's end would move, to first order, if a parameter or the start were twice what it is: beyond
that, as after turns over the top, nothing can be fitted to it."""


@dataclass(frozen=True)
class PendulumMotion:
    """A simulated motion and its derivatives at the samples."""

    position: np.ndarray  # position, velocity: (n,) [rad], [rad/s]
    velocity: np.ndarray
    jacobian: np.ndarray  # (n, 8) Of the position, by the six parameters, then by the initial position and velocity
    states: np.ndarray  # (m, 2) Position and velocity at every step, for the next simulation to start from


@dataclass(frozen=True)
class PendulumDrive:
    """A record's torque, ready for simulation."""

    steps: np.ndarray  # (m,) [s]
    torque: np.ndarray  # (m, 3) At the start, the middle and the end of every step [N*m]
    substeps: int  # Steps between samples
    width: float  # width of the smooth sign of velocity [rad/s]


def pendulum_drive(
    time: np.ndarray, torque: np.ndarray, *, hold: str, width: float, substeps: int = 1
) -> PendulumDrive:
    """Torque at the instants that the integration needs. `time`, `torque` (n,) [s], [N*m]; `width` [rad/s]."""
    if hold not in INPUT_HOLDS:
        raise IdentificationError(f"hold: found {hold!r}, expected one of {', '.join(INPUT_HOLDS)}")
    if not width > 0.0:
        raise IdentificationError(f"width: found {width:g} rad/s, expected more than 0")
    steps = time_steps(time)
    torque = np.asarray(torque, float)
    rise = np.diff(torque) if hold == "first" else np.zeros(len(steps))
    share = (np.arange(substeps)[:, None] + np.array([0.0, 0.5, 1.0])) / substeps
    made = torque[:-1, None, None] + rise[:, None, None] * share
    return PendulumDrive(np.repeat(steps / substeps, substeps), made.reshape(-1, 3), substeps, width)


def simulate_pendulum(
    values: np.ndarray, initial: np.ndarray, drive: PendulumDrive, guess: np.ndarray
) -> PendulumMotion:
    """Simulate a motion from its initial state. `values` (6,); `initial` (2,); `guess` (m + 1, 2)."""
    states = _solve_whole_motion(values, initial, drive, guess)
    if states is None:
        states = _solve_piecewise(values, initial, drive)
    if not np.isfinite(states).all():
        raise IdentificationError("the simulated pendulum diverges; check the torque's sign and unit")
    _, slopes = _integrate_steps(values, states[:-1], drive, parameters=True)
    start = np.zeros((2, 8))
    start[:, 6:] = np.eye(2)
    forcing = np.concatenate([slopes[:, :, 2:], np.zeros((len(slopes), 2, 2))], axis=2)
    spread = march(slopes[:, :, :2], forcing, start)
    weight = np.maximum(np.abs(np.concatenate([values, initial])), 1e-3)
    if not np.abs(spread[-1, 0] * weight).max() < MAX_END_SHIFT_RAD:
        raise IdentificationError(
            "the simulated pendulum diverges: a small change of its start changes its end without bound; record "
            "slower or shorter motion"
        )
    samples = slice(None, None, drive.substeps)
    return PendulumMotion(states[samples, 0], states[samples, 1], spread[samples, 0], states)


_CORE_SELECTION = np.zeros((len(_core.PARAMETER_NAMES), 5))
"""Core parameters of a unit of damping, Coulomb friction, gravity and offset, and of cos q, the slope of sin q."""
for _column, _targets in enumerate(
    (
        ("viscous_positive", "viscous_negative"),
        ("coulomb_positive", "coulomb_negative"),
        ("gravity_sine",),
        ("offset",),
        ("gravity_cosine",),
    )
):
    for _target in _targets:
        _CORE_SELECTION[_core.PARAMETER_NAMES.index(_target), _column] = 1.0
_ACTIVE_PARAMETERS = tuple(np.flatnonzero(_CORE_SELECTION.any(axis=1)).tolist())


def resistance(q: np.ndarray, v: np.ndarray, width: float) -> np.ndarray:
    """Torque that a unit of damping, Coulomb friction, gravity and offset takes, and cos q, shape (m, 5)."""
    return regressor(q, v, np.zeros(len(q)), _ACTIVE_PARAMETERS, width) @ _CORE_SELECTION[list(_ACTIVE_PARAMETERS)]


def _acceleration(
    values: np.ndarray, q: np.ndarray, v: np.ndarray, torque: np.ndarray, width: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Acceleration, its derivatives by q and v, and the torque of a unit of each parameter, shape (m, 5)."""
    inertia, damping, coulomb, gravity, stiffness, offset = values
    columns = resistance(q, v, width)
    resisting = columns[:, :4] @ np.array([damping, coulomb, gravity, offset])
    a = (torque - resisting - stiffness * q) / inertia
    by_q = -(gravity * columns[:, 4] + stiffness) / inertia
    by_v = -(damping + coulomb * (1.0 - columns[:, 1] ** 2) / width) / inertia
    return a, by_q, by_v, columns


def _integrate_steps(
    values: np.ndarray, states: np.ndarray, drive: PendulumDrive, *, parameters: bool
) -> tuple[np.ndarray, np.ndarray]:
    """All steps at once: states after, shape (m, 2), and their derivatives by the states before and by parameters."""
    h = drive.steps
    m = len(h)
    width = 8 if parameters else 2
    seed = np.zeros((2, m, width))
    seed[0, :, 0] = seed[1, :, 1] = 1.0
    q0, v0 = states.T
    q, v, tangent = q0, v0, seed
    total_q, total_v, total = np.zeros(m), np.zeros(m), np.zeros((2, m, width))
    for stage, (weight, reach) in enumerate(((1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0))):
        torque = drive.torque[:, (0, 1, 1, 2)[stage]]
        a, by_q, by_v, columns = _acceleration(values, q, v, torque, drive.width)
        slope = np.empty((2, m, width))
        slope[0] = tangent[1]
        slope[1] = by_q[:, None] * tangent[0] + by_v[:, None] * tangent[1]
        if parameters:
            damped, rubbed, hung, constant, _ = columns.T
            slope[1, :, 2:] -= np.column_stack([a, damped, rubbed, hung, q, constant]) / values[0]
        total_q, total_v, total = total_q + weight * v, total_v + weight * a, total + weight * slope
        if reach:
            q, v, tangent = q0 + reach * h * v, v0 + reach * h * a, seed + (reach * h)[:, None] * slope
    sixth = h / 6.0
    after = np.column_stack([q0 + sixth * total_q, v0 + sixth * total_v])
    return after, np.moveaxis(seed + sixth[:, None] * total, 0, 1)


def _solve_whole_motion(
    values: np.ndarray, initial: np.ndarray, drive: PendulumDrive, guess: np.ndarray
) -> np.ndarray | None:
    """States at every step, shape (m + 1, 2); None where the iteration does not settle."""
    states = np.array(guess, float)
    states[0] = initial
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(NEWTON_SETTINGS.max_newton_iterations):
            after, slopes = _integrate_steps(values, states[:-1], drive, parameters=False)
            if not (np.isfinite(after).all() and np.isfinite(slopes).all()):
                return None
            change = march(slopes, (after - states[1:])[:, :, None], np.zeros((2, 1)))[:, :, 0]
            states = states + change
            if not np.isfinite(states).all():
                return None
            if np.abs(change).max() <= NEWTON_SETTINGS.newton_tolerance * (1.0 + np.abs(states).max()):
                return states
    return None


def _solve_piecewise(values: np.ndarray, initial: np.ndarray, drive: PendulumDrive) -> np.ndarray:
    """The same from no guess: piece after piece, each started at rest where the last one ended."""
    states = np.empty((len(drive.steps) + 1, 2))
    states[0] = initial
    begin, length = 0, NEWTON_SETTINGS.piece_steps
    while begin < len(drive.steps):
        end = min(begin + length, len(drive.steps))
        part = PendulumDrive(drive.steps[begin:end], drive.torque[begin:end], 1, drive.width)
        found = _solve_whole_motion(values, states[begin], part, np.tile(states[begin], (end - begin + 1, 1)))
        if found is None and length <= NEWTON_SETTINGS.min_piece_steps:
            states[begin:] = np.nan
            break
        if found is None:
            length //= 4
            continue
        states[begin : end + 1] = found
        begin, length = end, NEWTON_SETTINGS.piece_steps
    return states


@dataclass(frozen=True)
class PendulumSettings:
    """Settings of the fit of a pendulum."""

    width_share: float = 0.02  # default width of the smooth sign of velocity, as a share of the records' largest speed
    min_inertia_share: float = 1e-6  # lower bound of the inertia, as a share of its first estimate
    # Time steps are divided until the product of a step and friction's rate at rest, (b + c/w)/I, is below this.
    max_step_rate_product: float = 0.5
    # A time step is divided into at most this many substeps. More would only resolve a smooth sign that is too narrow.
    max_substeps: int = 16
    velocity_reach_s: float = 0.02  # the first estimate of the velocity is a difference over twice this time


PENDULUM_SETTINGS = PendulumSettings()


DEFAULT_FREE_PARAMETERS = NAMES
"""Parameters that are estimated by default."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PendulumFit(Estimates):
    """An identified pendulum with the covariance of its parameters, shape (p, p)."""

    known: Mapping[str, float]  # parameters held at a given value, SI
    reasons: Mapping[str, str]  # explanation for each parameter that ended at its bound, by name
    responses: tuple[Response, ...]  # fitted records; `initial` is the initial angle [rad] and velocity [rad/s]
    hold: str  # assumed behaviour of the torque between samples
    width: float  # width of the smooth sign of velocity [rad/s]
    residual_sd: float  # standard deviation of the residual [rad]
    evaluations: int  # number of simulations of all records
    converged: bool
    whiteness: Whiteness

    @property
    def complete(self) -> np.ndarray:
        """All six parameters, shape (6,), SI; zero for a term that was neither free nor known."""
        free = {p.name: p.value for p in self.parameters}
        return np.array([free.get(name, self.known.get(name, 0.0)) for name in NAMES])


def fit_pendulum(
    records: Sequence[InputOutput],
    *,
    hold: str,
    free: Sequence[str] = DEFAULT_FREE_PARAMETERS,
    known: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    width: float | None = None,
) -> PendulumFit:
    """Identify a pendulum from records of torque [N*m] and angle [rad].

    `free` and `known` name the estimated and the known parameters. `width` is that of the smooth sign of velocity
    [rad/s].
    """
    known = dict(known or {})
    wrong = [name for name in (*free, *known, *(bounds or {})) if name not in NAMES]
    if wrong:
        raise IdentificationError(f"pendulum: found parameters {', '.join(wrong)}, expected some of {', '.join(NAMES)}")
    names = [name for name in NAMES if name in free and name not in known]
    if not names or ("inertia" not in names and known.get("inertia", 0.0) <= 0.0):
        raise IdentificationError("pendulum: found no inertia, expected it free or known and positive")
    for record in records:
        _require(record, len(names) + 2)
    speeds = [_speed(r) for r in records]
    if width is None:
        width = PENDULUM_SETTINGS.width_share * max(float(np.quantile(np.abs(v), 0.99)) for v in speeds)
    problem = _Problem(tuple(records), tuple(names), known, hold, width)
    lower, upper = _bounds(names, bounds or {})
    starts = (problem.started(rate, speeds, lower, upper) for rate in _rates(records))
    costs = [(problem.cost(start), i, start) for i, start in enumerate(starts) if start is not None]
    best = min(costs, key=lambda each: each[:2], default=(np.inf, 0, None))
    if not np.isfinite(best[0]):
        raise IdentificationError(
            f"{_names(records)}: no first guess can be simulated; check the torque's sign and unit"
        )
    start = best[2]
    if "inertia" in names:
        i = names.index("inertia")
        lower[i] = max(lower[i], PENDULUM_SETTINGS.min_inertia_share * start[i])
    k = len(names)
    free_state = np.full(2 * len(records), np.inf)
    low, high = np.concatenate([lower, -free_state]), np.concatenate([upper, free_state])
    problem.prepare(start)
    found = least_squares(
        problem.residual, np.clip(start, low, high), jac=problem.jacobian, bounds=(low, high), x_scale="jac",
        xtol=1e-7, ftol=1e-9, max_nfev=40,
    )  # fmt: skip
    return _result_at(problem, found.x, lower, upper, int(found.nfev), bool(found.success), k)


def evaluate_pendulum(fit: PendulumFit, record: InputOutput) -> Response:
    """Simulate a record with fixed parameters; only its initial state is estimated.

    A validation record must not stop a fit: if the simulation diverges, `Response.diverges` is True.
    """
    _require(record, 2)
    held = dict(zip(NAMES, fit.complete, strict=True))
    problem = _Problem((record,), (), held, fit.hold, fit.width)
    start = np.array([record.output[0], _speed(record)[0]])
    problem.prepare(start)
    found = least_squares(problem.residual, start, jac=problem.jacobian, x_scale="jac", max_nfev=30)
    if problem.motions(found.x) is None:
        return Response.of(record, np.full(len(record), np.nan), (np.nan, np.nan))
    return problem.responses(found.x)[0]


class _Problem:
    """Records, free parameters, and the motions simulated last, from which the next simulation starts."""

    def __init__(
        self,
        records: tuple[InputOutput, ...],
        names: tuple[str, ...],
        known: Mapping[str, float],
        hold: str,
        width: float,
    ):
        self.records, self.names, self.known, self.hold, self.width = records, names, known, hold, width
        self.columns = [NAMES.index(name) for name in names]
        self.lengths = [len(r) for r in records]
        self.drives: list[PendulumDrive] = []
        self.guesses: list[np.ndarray] = []
        self.last: tuple[np.ndarray, list[PendulumMotion] | None] | None = None
        self.prepared = 0

    def full(self, x: np.ndarray) -> np.ndarray:
        """Return all six parameters, shape (6,), from the free ones."""
        values = np.array([self.known.get(name, 0.0) for name in NAMES])
        values[self.columns] = x[: len(self.names)]
        return values

    def prepare(self, x: np.ndarray) -> None:
        """Choose time steps short enough for the friction of `x`, and start the simulations from measured motions."""
        inertia, damping, coulomb = self.full(x)[:3]
        longest = max(float(np.median(np.diff(r.time))) for r in self.records)
        wanted = longest * (damping + coulomb / self.width) / inertia / PENDULUM_SETTINGS.max_step_rate_product
        substeps = int(np.clip(np.ceil(wanted), 1, PENDULUM_SETTINGS.max_substeps))
        if substeps == self.prepared:
            return
        self.prepared, self.last = substeps, None
        self.drives = [
            pendulum_drive(r.time, r.input, hold=self.hold, width=self.width, substeps=substeps) for r in self.records
        ]
        self.guesses = [_states_at_steps(r, substeps) for r in self.records]

    def motions(self, x: np.ndarray) -> list[PendulumMotion] | None:
        """Simulate every record; None if one diverges."""
        if self.last is not None and np.array_equal(self.last[0], x):
            return self.last[1]
        values, k = self.full(x), len(self.names)
        try:
            made = [
                simulate_pendulum(values, x[k + 2 * i : k + 2 * i + 2], drive, guess)
                for i, (drive, guess) in enumerate(zip(self.drives, self.guesses, strict=True))
            ]
        except IdentificationError:
            made = None
        if made is not None:
            self.guesses = [m.states for m in made]
        self.last = (np.array(x), made)
        return made

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Return simulated minus measured angle, shape (m,)."""
        made = self.motions(x)
        if made is None:  # a diverging trial step must have a large cost, not stop the solver
            return np.full(sum(self.lengths), 1e3)
        return np.concatenate([m.position - r.output for m, r in zip(made, self.records, strict=True)])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the residual's derivatives, shape (m, free + 2 records)."""
        made, k = self.motions(x), len(self.names)
        matrix = np.zeros((sum(self.lengths), len(x)))
        begin = 0
        for i, motion in enumerate(made or ()):
            rows = slice(begin, begin + self.lengths[i])
            matrix[rows, :k] = motion.jacobian[:, self.columns]
            matrix[rows, k + 2 * i : k + 2 * i + 2] = motion.jacobian[:, 6:]
            begin += self.lengths[i]
        return matrix

    def cost(self, x: np.ndarray) -> float:
        """Return the sum of squares, infinite if a record's simulation diverges."""
        self.prepare(x)
        residual = self.residual(x)
        return float(residual @ residual) if self.last is not None and self.last[1] is not None else float("inf")

    def started(self, rate: float, speeds: list[np.ndarray], lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
        """Estimate parameters and initial states by a regression on signals filtered by (s + rate)^2."""
        blocks, targets = [], []
        denominator = np.poly([-rate, -rate])
        held = np.array([self.known.get(name, 0.0) for name in NAMES])
        for i, (record, speed) in enumerate(zip(self.records, speeds, strict=True)):
            q = record.output
            _, rubbed, hung, constant = resistance(q, speed, self.width)[:, :4].T
            signals = np.column_stack([record.input, q - q[0], rubbed, hung, q, constant])
            powers = filtered_powers(denominator.tolist(), record.time, signals, hold="first")
            plain = powers[:, 2, :]
            columns = np.column_stack([powers[:, 0, 1], powers[:, 1, 1], plain[:, 2:]])
            # The filtered acceleration lacks the initial velocity, which has its own column.
            impulse = np.zeros((len(q), len(self.records)))
            t = record.time - record.time[0]
            impulse[:, i] = t * np.exp(-rate * t)
            blocks.append(np.hstack([columns[:, self.columns], impulse]))
            targets.append(plain[:, 0] - columns @ held)
        w, y = np.concatenate(blocks), np.concatenate(targets)
        scale = np.linalg.norm(w, axis=0)
        if not np.isfinite(scale).all() or np.any(scale == 0.0):
            return None
        open_ends = np.full(len(self.records), np.inf)
        low = np.concatenate([lower, -open_ends]) * scale
        high = np.concatenate([upper, open_ends]) * scale
        values = lsq_linear(w / scale, y, (low, high)).x / scale
        x = np.concatenate(
            [values[: len(self.names)], *([r.output[0], v[0]] for r, v in zip(self.records, speeds, strict=True))]
        )
        return x if self.full(x)[0] > 0.0 else None

    def responses(self, x: np.ndarray) -> tuple[Response, ...]:
        """Return every record with its simulation."""
        made, k = self.motions(x), len(self.names)
        if made is None:
            raise IdentificationError(
                f"{_names(self.records)}: the simulated pendulum diverges; check the torque's sign and unit"
            )
        states = x[k:].reshape(-1, 2)
        return tuple(Response.of(r, m.position, q) for r, m, q in zip(self.records, made, states, strict=True))


def _result_at(
    problem: _Problem, x: np.ndarray, lower: np.ndarray, upper: np.ndarray, evaluations: int, converged: bool, k: int
) -> PendulumFit:
    x = x.copy()
    # The solver stays strictly inside the bounds, so a value this close to a bound counts as on it.
    near = 1e-6 * np.maximum(np.abs(x[:k]), 1e-9)
    jacobian = problem.jacobian(x)
    scale = np.linalg.norm(jacobian, axis=0)
    noise = np.linalg.norm(problem.residual(x)) / np.sqrt(len(jacobian))
    near = np.maximum(near, 1e-4 * noise * np.sqrt(len(jacobian)) / np.maximum(scale[:k], np.finfo(float).tiny))
    held_low, held_high = x[:k] <= lower + near, x[:k] >= upper - near
    x[:k] = np.where(held_low, lower, np.where(held_high, upper, x[:k]))
    residual, jacobian = problem.residual(x), problem.jacobian(x)
    scale = np.linalg.norm(jacobian, axis=0)
    singular = np.linalg.svd(jacobian / np.maximum(scale, np.finfo(float).tiny), full_matrices=False)
    if np.any(scale == 0.0) or singular[1][-1] <= SINGULAR_VALUE_TOLERANCE * singular[1][0]:
        share = np.abs(singular[2][-1])[:k]
        tied = [n for n, s in zip(problem.names, share, strict=True) if s > 0.1 * share.max()]
        raise IdentificationError(
            f"{_names(problem.records)}: {', '.join(tied)} are not identifiable separately: their effects "
            "are proportional; record larger or faster motion, or state one of them"
        )
    covariance = sandwich_covariance(jacobian, -residual, problem.lengths)[:k, :k]
    # The first-order estimate of all parameters without bounds.
    wanted = x[:k] - (np.linalg.lstsq(jacobian / scale, residual, rcond=None)[0] / scale)[:k]
    slope = jacobian.T @ residual
    parameters, reasons = [], {}
    for i, name in enumerate(problem.names):
        error = float(np.sqrt(max(covariance[i, i], 0.0)))
        held = bool(held_low[i] or held_high[i])
        made = Parameter(name, UNITS[NAMES.index(name)], float(x[i]), error, at_bound=held)
        low, high = made.interval()
        parameters.append(Parameter(name, made.unit, made.value, error, held, identifiable=not low <= 0.0 <= high))
        if held:
            edge = lower[i] if held_low[i] else upper[i]
            reasons[name] = _bound_reason(made, edge, float(wanted[i]), float(slope[i]))
    return PendulumFit(
        title="Pendulum",
        parameters=tuple(parameters),
        known=dict(problem.known),
        covariance=covariance,
        reasons=reasons,
        responses=problem.responses(x),
        hold=problem.hold,
        width=problem.width,
        residual_sd=float(np.sqrt(residual @ residual / max(len(residual) - len(x), 1))),
        evaluations=evaluations,
        converged=converged,
        whiteness=whiteness(-residual, problem.lengths),
    )


def _bound_reason(parameter: Parameter, edge: float, wanted: float, slope: float) -> str:
    half = float(ndtri(0.975)) * parameter.standard_error
    side = "below" if wanted < edge else "above"
    low, high = wanted - half, wanted + half
    text = (
        f"{parameter.name} ended at its bound, {edge:.4g} {parameter.unit}: the squared error falls on beyond it "
        f"(slope {2.0 * slope:+.3g} rad^2 per {parameter.unit}), towards {wanted:.3g}, whose 95 % interval, "
        f"{low:.3g} to {high:.3g}, "
    )
    if low <= edge <= high:
        return text + "holds the bound: the records do not show this term"
    return text + f"lies {side} the bound: another term that the model lacks or holds makes up for it"


def _bounds(names: Sequence[str], given: Mapping[str, tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    pairs = [given.get(name, (-np.inf if name == "offset" else 0.0, np.inf)) for name in names]
    for name, (low, high) in zip(names, pairs, strict=True):
        if not low < high:
            raise IdentificationError(f"pendulum: {name}: found bounds {low:g} to {high:g}, expected the lower first")
    return np.array([p[0] for p in pairs], float), np.array([p[1] for p in pairs], float)


def _rates(records: Sequence[InputOutput]) -> np.ndarray:
    """Return filter rates for the first estimate, shape (3,) [1/s]: the motion's typical rate and two faster ones."""
    cycles = []
    for r in records:
        still = r.output - r.output.mean()
        speed = _speed(r)
        cycles.append(float(np.sqrt(np.mean(speed**2) / np.mean(still**2))))
    step = max(float(np.median(np.diff(r.time))) for r in records)
    middle = float(np.median(cycles))
    return np.minimum(middle * np.array([1.0, 3.0, 9.0]), 0.5 / step)


def _speed(record: InputOutput) -> np.ndarray:
    """Return a rough velocity, shape (n,) [rad/s]: differences over a reach, against quantisation."""
    n = len(record)
    reach = max(1, round(PENDULUM_SETTINGS.velocity_reach_s / float(np.median(np.diff(record.time)))))
    after, before = np.minimum(np.arange(n) + reach, n - 1), np.maximum(np.arange(n) - reach, 0)
    return (record.output[after] - record.output[before]) / (record.time[after] - record.time[before])


def _states_at_steps(record: InputOutput, substeps: int) -> np.ndarray:
    """Return the measured angle and velocity at every substep, shape (m + 1, 2)."""
    fine = np.concatenate(
        [(record.time[:-1, None] + np.diff(record.time)[:, None] * np.arange(substeps) / substeps).ravel(),
         record.time[-1:]]
    )  # fmt: skip
    speed = _speed(record)
    return np.column_stack([np.interp(fine, record.time, record.output), np.interp(fine, record.time, speed)])


def _require(record: InputOutput, unknowns: int) -> None:
    where = require_samples(record, unknowns)
    if not np.all(np.diff(record.time) > 0.0):
        raise IdentificationError(f"{where}: found time that does not increase, expected one that does")
    if np.ptp(record.output) == 0.0:
        raise IdentificationError(
            f"{where}: found an angle that stays at {record.output[0]:.6g} rad, expected a motion"
        )


def _names(records: Sequence[InputOutput]) -> str:
    return "recording " + ", ".join(f"'{r.recording}'" for r in records)
