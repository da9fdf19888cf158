r"""Model discrepancy: how far effects that a model neglects may have moved its parameters.

Effects that a friction family lacks still act on the joint. Each known effect is one column
:math:`\varphi_k(q, \dot q, \ddot q, y)`, with y the load. Outside the model's span each column is scaled to the root
mean square of the least-squares residual, and

.. math::
   \tau = W\beta + \sum_k c_k \varphi_k + e, \qquad c_k \sim N(0, s_{g(k)}^2), \qquad
   e \text{ as coloured as the residual}

says that each may contribute a share of it. All friction shares one s, for its columns are different descriptions of
one curve. Spring, rotor, angle zero and twist have an s each: a spring that shows says nothing of friction. So does
friction that gives way where the joint turns, which several columns describe (`turning_friction.py`); without
them, other friction answers for what is left there. Marginal likelihood chooses every s between 0.001 and 1, those of
all causes together, so that none answers for what another shows. That of a spring, a rotor, an angle zero or a twist
returns to 0.001 unless its column also predicts the effort of blocks of time from which it was not fitted: what
differentiation and the friction's turning leave in the residual looks like a weak spring in any recording, and changes
from block to block. Samples into which the filters carry standstill are excluded, because stiction can take any value
there. The posterior gives, with b the least-squares estimate,

.. math::
   E[(b - \beta)(b - \beta)^T] = (b - \hat\beta)(b - \hat\beta)^T + V_\beta

The discrepancy part is the excess of this matrix over the statistical covariance. What this matrix lacks of the
statistical covariance is no noise: the columns explain that part of the residual, and their shift of the parameters is
in the first term. Where the residual outside the
model's span identifies the neglected effects, the first term carries their bias. Where it does not, the prior remains
[1]_, [2]_.

.. [1] M. C. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", J. R. Statist. Soc. B 63, 2001.
.. [2] J. Brynjarsdottir, A. O'Hagan, "Learning about physical parameters: the importance of model discrepancy", Inverse
   Problems 30, 2014.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np

from ...models.friction_terms import SEPARATE_LOAD_FEATURE, features_of, is_friction, shape_index
from ...numerics.motion import SLOW_SHARE
from ...numerics.regression import FittedMotion, Stack, column_norms, triangular_factor
from .unknown_payload import FRICTION_DRAWS, SteadyStates, carried_friction, draw_normal, standard_draws


@dataclass(frozen=True)
class DiscrepancySettings:
    """Settings of the estimate of neglected effects."""

    # Rows beyond this number are thinned. The neglected effects are smooth in the states, so thinning loses little.
    max_rows: int = 50_000
    # Below this share of the root mean square speed a joint counts as standing still, unless a dead band is given.
    standstill_speed_share: float = 0.05
    # The snap is low-passed at this share of the motion's cut-off. Differentiated four times, an encoder's noise
    # exceeds the motion near the cut-off, and the residual contains the same noise in the acceleration: a spring would
    # be found in it.
    snap_cutoff_share: float = 0.35
    # At this share of the root mean square speed, boundary friction has fallen to 1/e.
    stribeck_speed_share: float = 0.25
    validation_block_count: int = 10  # Number of blocks of time over which a single cause is cross-validated
    # A single cause counts as present if the mean fall of the squared error over blocks held out exceeds its standard
    # error at least so many times.
    min_validation_z: float = 2.0
    share_sweep_count: int = 3  # Each group's s is chosen anew so many times, with those of the others as they are
    # An effect counts as part of the model if less than this share of its column lies outside the model's span.
    min_column_remainder: float = 0.05


DISCREPANCY_SETTINGS = DiscrepancySettings()


DISCREPANCY_SHARE_GRID = np.geomspace(0.001, 1.0, 13)
"""Values of s among which marginal likelihood chooses."""

COMMON_SHARE_GRID = np.geomspace(0.01, 1.0, 9)
"""Values among which marginal likelihood chooses one s for all columns."""


@dataclass(frozen=True)
class States:
    """States of a joint in the rows of a regression; every array has shape (m,), SI."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    load: np.ndarray  # load through the drive: inertial and gravity effort
    cosine: np.ndarray  # cosine of the angle; 0 for a prismatic joint
    snap: np.ndarray  # second derivative of the acceleration
    standstill: np.ndarray  # share of each filtered row that comes from samples at standstill
    like: States | None = None  # states that define the usual travel and speed; these states if None
    heading: np.ndarray | None = None  # direction of friction, -1 to 1; the sign of the velocity if None
    # what friction may do where the joint turns, per unit of each column, in the `compared_rows` alone, (k, c); None if
    # that is not described
    turning: np.ndarray | None = None

    def part(self, rows: np.ndarray) -> States:
        """Return the states in some rows; the usual travel and speed stay those of all."""
        names = [each.name for each in fields(self) if each.name != "turning"]
        own = {name: x[rows] for name in names if isinstance(x := getattr(self, name), np.ndarray)}
        return replace(self, **own, like=self.like or self)

    @property
    def direction(self) -> np.ndarray:
        """Direction of friction, -1 to 1."""
        return np.sign(self.velocity) if self.heading is None else self.heading

    @property
    def travel(self) -> np.ndarray:
        """Position, centred and divided by its standard deviation."""
        usual = (self.like or self).position
        return (self.position - usual.mean()) / max(float(usual.std()), np.finfo(float).tiny)

    @property
    def boundary(self) -> np.ndarray:
        """Share of boundary lubrication: 1 at rest, tending to 0 at speed."""
        top = DISCREPANCY_SETTINGS.stribeck_speed_share * float(np.sqrt(np.mean((self.like or self).velocity ** 2)))
        return np.exp(-np.abs(self.velocity) / max(top, np.finfo(float).tiny))


UNEQUAL_LOAD_LOSSES = "different load losses in lifting and lowering"
"""The effect that is proportional to the load, and so looks like more inertia and gravity. Only a model with separate
coefficients for lifting and lowering contains it."""

TWISTED_ANGLE = "an angle that the load twists"
"""Effect of a compliant transmission with its encoder on the motor: gravity acts at another angle."""

NEGLECTED_EFFECTS: Mapping[str, Callable[[States], np.ndarray]] = {
    "friction that grows with the load": lambda s: s.direction * np.abs(s.load),
    UNEQUAL_LOAD_LOSSES: lambda s: s.load,
    "rotor inertia on the motor side of the load friction": lambda s: s.direction * np.sign(s.load) * s.acceleration,
    "a spring in the drive": lambda s: s.snap,
    "an error of the angle zero": lambda s: s.cosine,
    TWISTED_ANGLE: lambda s: s.cosine * s.load,
    "viscosity that declines with speed": lambda s: s.velocity * np.abs(s.velocity),
    "viscosity that declines in one direction": lambda s: s.velocity**2,
    "friction that falls from rest": lambda s: s.direction * s.boundary,
    "load friction that changes with speed": lambda s: s.direction * np.abs(s.load * s.velocity),
    "load friction that falls from rest": lambda s: s.direction * np.abs(s.load) * s.boundary,
    "friction that changes along the travel": lambda s: s.direction * s.travel,
    "friction that is largest in the middle of the travel": lambda s: s.direction * s.travel**2,
    "viscosity that changes along the travel": lambda s: s.velocity * s.travel,
}
"""Effects that a friction family may lack: each maps states to an effort of arbitrary scale, shape (m,)."""

FRICTION_EFFECTS = tuple(n for n in NEGLECTED_EFFECTS if n.startswith(("friction", "viscosity", "load friction")))
"""Names of the neglected effects that are friction."""

CAUSE_GROUPS: tuple[tuple[str, ...], ...] = (
    tuple(n for n in NEGLECTED_EFFECTS if n in (*FRICTION_EFFECTS, UNEQUAL_LOAD_LOSSES)),
    *((n,) for n in NEGLECTED_EFFECTS if n not in (*FRICTION_EFFECTS, UNEQUAL_LOAD_LOSSES)),
)
"""Groups of effects with a common s: all friction is one physical cause, the others are one each."""

TURNING_CAUSE = "presliding friction at reversals"
"""Cause that is stated where columns of `States.turning` move a parameter most; all of them share one s."""

STICTION_CAUSE = "sticking at standstill"
"""Cause that is stated where no column of the neglected effects explains the shift of a parameter."""

COMMON_LOAD_COEFFICIENT = "load_friction"
"""Name of the coefficient that describes the losses in lifting and in lowering by one share of the load."""

LOAD_SHARE_SPREAD_RATIO = 0.8114 / 1.959964
"""Prior standard deviation of half the difference between the shares lost in lifting and in lowering, divided by their
mean a. Recordings that show only a leave each share between 0 and 2 a, and neither end is likely. The simplest such
density is a parabola, with 95 % within 0.81 a."""


@dataclass(frozen=True)
class Discrepancy:
    """The discrepancy part of a covariance, with the cause that moves each parameter most."""

    names: tuple[str, ...]  # parameters, p of them
    covariance: np.ndarray  # discrepancy part of their covariance, (p, p)
    causes: tuple[str, ...]  # for each parameter, the neglected effect that moves it most, in words
    carried: Mapping[str, float]  # for each friction coefficient, how much of it a controller may compensate
    explained: np.ndarray  # part of the statistical covariance that the effects explain, so that it counts once, (p, p)

    def of(self, names: Sequence[str]) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return the covariance, (k, k), and the causes of the parameters `names`."""
        at = [self.names.index(name) for name in names]
        return self.covariance[np.ix_(at, at)], tuple(self.causes[i] for i in at)


class DifferentiatedMotion(FittedMotion, Protocol):
    """A motion with its derivatives, each of shape (n,), SI."""

    @property
    def fs(self) -> float:
        """Rate of the samples [Hz]."""

    @property
    def position(self) -> np.ndarray:
        """Position, (n,) [rad or m]."""

    @property
    def acceleration(self) -> np.ndarray:
        """Acceleration, (n,) [rad/s^2 or m/s^2]."""

    def smooth(self, samples: np.ndarray, share: float = 1.0) -> np.ndarray:
        """Apply the motion's low-pass, with `share` times its cut-off, to `samples`, shape (n,)."""


DifferentiatedMotionT = TypeVar("DifferentiatedMotionT", bound=DifferentiatedMotion)

KINEMATIC_SIGNALS: tuple[Callable[[DifferentiatedMotion, float], np.ndarray], ...] = (
    lambda m, slow: m.position,
    lambda m, slow: m.velocity,
    lambda m, slow: m.acceleration,
    lambda m, slow: (
        np.gradient(np.gradient(m.smooth(m.acceleration, DISCREPANCY_SETTINGS.snap_cutoff_share))) * m.fs**2
    ),
    lambda m, slow: np.abs(m.smooth((np.abs(m.velocity) <= slow).astype(float))),
)
"""Signals of a motion that no model changes: position, velocity, acceleration, snap, and the share of each sample that
comes from speeds up to `slow`."""


def collect_states(
    data: Stack[DifferentiatedMotionT],
    rotary: bool,
    load: Callable[[DifferentiatedMotionT, np.ndarray, np.ndarray], np.ndarray],
    dead_band: float,
) -> States:
    """Collect the states in the rows of a stack.

    `load` returns the load of a motion at positions and accelerations, each (k,). The joint counts as standing still
    below the `dead_band`, or, without one, below a twentieth of the root mean square speed.
    """
    known = vars(data)
    if "_kinematics" not in known:  # computed once, because every model of these recordings has the same kinematics
        power = sum(float(m.velocity @ m.velocity) for m in data.motions)
        usual = np.sqrt(power / sum(len(m.velocity) for m in data.motions))
        slow = dead_band if dead_band > 0.0 else DISCREPANCY_SETTINGS.standstill_speed_share * float(usual)
        # Each motion is reduced in turn, to save memory.
        parts = [m.rows(np.column_stack([signal(m, slow) for signal in KINEMATIC_SIGNALS])) for m in data.motions]
        known["_kinematics"] = tuple(np.ascontiguousarray(np.concatenate(parts).T))
    position, velocity, acceleration, snap, standstill = known["_kinematics"]
    ends = np.cumsum(data.lengths)
    loads = [
        load(m, position[end - n : end], acceleration[end - n : end])
        for m, n, end in zip(data.motions, data.lengths, ends, strict=True)
    ]
    cosine = np.cos(position) if rotary else np.zeros(len(position))
    return States(
        position, velocity, acceleration, np.concatenate(loads), cosine, snap, standstill, heading=_heading(data)
    )


def _heading(data: Stack[DifferentiatedMotionT]) -> np.ndarray | None:
    """Return the direction of friction in the rows of a stack, filtered as the model's is; None if by the velocity."""
    turning = [(getattr(m, "direction", None), getattr(m, "slip_velocity", None)) for m in data.motions]
    if all(direction is None and slip is None for direction, slip in turning):
        return None
    made = []
    for m, (direction, slip) in zip(data.motions, turning, strict=True):
        sharp = np.sign(m.velocity if slip is None else slip) if direction is None else direction
        made.append(m.rows(m.smooth(sharp)))
    return np.concatenate(made)


@dataclass(frozen=True)
class NeglectedColumns:
    """Columns of the model and of neglected effects in the rows of a regression.

    The model's columns are scaled to unit norm, those of neglected effects to the least-squares residual.
    """

    rows: np.ndarray  # indices of the regression rows that are used, (k,)
    free: np.ndarray  # mask of the parameters that have an effect, (p,)
    scale: np.ndarray  # norms of their columns over all rows, (q,)
    own: np.ndarray  # scaled columns of the model, (k, q)
    columns: np.ndarray  # scaled columns of neglected effects, (k, c)
    words: tuple[str, ...]  # names of the neglected effects, c of them
    sizes: np.ndarray  # scale of each neglected column, (c,)
    target: np.ndarray  # least-squares residual, (k,)
    noise: float  # variance of a row outside all columns, enlarged for autocorrelation
    tied: np.ndarray  # prior variance of each neglected coefficient in addition to s^2, (c,)

    @property
    def both(self) -> np.ndarray:
        """All columns, shape (k, q + c), the model's own first."""
        return np.hstack([self.own, self.columns])

    @cached_property
    def own_errors(self) -> np.ndarray:
        """Squared error of each left-out block by a fit of the model's own columns to the others, (b,)."""
        return self.left_out_errors(np.arange(self.own.shape[1]))

    @cached_property
    def _block_products(self) -> np.ndarray:
        """Products of all columns and the target, one after another, in each block, (b, q + c + 1, q + c + 1)."""
        x = np.column_stack([self.own, self.columns, self.target])
        return np.array([part.T @ part for part in np.array_split(x, DISCREPANCY_SETTINGS.validation_block_count)])

    def left_out_errors(self, used: np.ndarray) -> np.ndarray:
        """Return the squared error of each left-out block by a fit of the `used` ones of all columns to the others."""
        products = self._block_products
        grams, moments = products[:, used[:, None], used], products[:, used, -1]
        gram, moment = grams.sum(axis=0), moments.sum(axis=0)
        errors = products[:, -1, -1].copy()
        for i, (own, own_moment) in enumerate(zip(grams, moments, strict=True)):
            fitted = np.linalg.lstsq(gram - own, moment - own_moment, rcond=None)[0]
            errors[i] += fitted @ (own @ fitted - 2.0 * own_moment)
        return errors


def compared_rows(standstill: np.ndarray) -> np.ndarray:
    """Return the rows, (k,), in which effects are compared: those in motion, thinned if there are many.

    `standstill`, (m,), is the share of each row that comes from samples at standstill.
    """
    kept = standstill < SLOW_SHARE
    if kept.mean() < 0.5:
        kept = standstill <= np.median(standstill)
    rows = np.flatnonzero(kept)
    return rows[:: max(1, len(rows) // DISCREPANCY_SETTINGS.max_rows)]


def neglected_columns(
    names: Sequence[str],
    values: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    states: States,
    statistical: np.ndarray,
) -> NeglectedColumns | None:
    """Return the columns of effects that a model may lack; None if too few rows move or the residual is 0.

    The arguments are those of `estimate_discrepancy`.
    """
    norms = column_norms(jacobian)
    free = (norms > 1e-12 * norms.max()) & (np.diag(statistical) > 0.0)
    scale = norms[free]
    error = np.sqrt(np.diag(statistical)[free]) * scale  # standard errors of the scaled parameters
    size = float(np.sqrt(np.mean(residual**2)))
    rows = compared_rows(states.standstill)
    turning = 0 if states.turning is None else states.turning.shape[1]
    if not size > 0.0 or len(rows) < 4 * (int(free.sum()) + len(NEGLECTED_EFFECTS) + turning):
        return None
    w = jacobian[np.ix_(rows, free)] / scale
    columns, words, sizes = _effect_columns(
        states, rows, w, size, "" if SEPARATE_LOAD_FEATURE in features_of(names) else UNEQUAL_LOAD_LOSSES
    )
    x, y = np.hstack([w, columns]), residual[rows]
    # The noise variance for which ordinary least squares on the used rows has the statistical standard errors.
    gram = (jacobian.T @ jacobian)[np.ix_(free, free)] / np.outer(scale, scale)
    coloured = float(np.median(error**2 / np.diag(np.linalg.inv(gram)))) * len(rows) / len(residual)
    step = np.linalg.lstsq(x, y, rcond=None)[0]
    white = float(np.mean((y - x @ step) ** 2)) / size**2
    noise = max(coloured * min(1.0, white), np.finfo(float).tiny * size**2)
    tied = np.zeros(len(words))
    if UNEQUAL_LOAD_LOSSES in words and COMMON_LOAD_COEFFICIENT in names:
        at = words.index(UNEQUAL_LOAD_LOSSES)
        # The fitted load friction limits the difference of its two shares more tightly than the residual does.
        tied[at] = (LOAD_SHARE_SPREAD_RATIO * values[list(names).index(COMMON_LOAD_COEFFICIENT)] / sizes[at]) ** 2
    return NeglectedColumns(rows, free, scale, w, columns, words, sizes, y, noise, tied)


def estimate_discrepancy(
    names: Sequence[str],
    values: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    states: States,
    statistical: np.ndarray,
) -> Discrepancy:
    """Estimate how far neglected effects may have moved p parameters, beyond their `statistical` covariance, (p, p).

    `names` and `values`, (p,), are the parameters; `jacobian`, (m, p), and `residual`, (m,), belong to the
    least-squares solution.
    """
    p = jacobian.shape[1]
    covariance, explained = np.zeros((p, p)), np.zeros((p, p))
    values = np.asarray(values, float)
    friction = _FrictionTerms.of(names, values, states)

    def nothing() -> Discrepancy:
        certain = draw_normal(values, statistical)[:, friction.at] @ friction.terms.T
        return Discrepancy(tuple(names), covariance, ("",) * p, friction.carried(certain), explained)

    lacks = neglected_columns(names, values, jacobian, residual, states, statistical)
    if lacks is None:
        return nothing()
    free, scale, words, sizes = lacks.free, lacks.scale, lacks.words, lacks.sizes
    count, size, x = len(scale), float(np.sqrt(np.mean(residual**2))), lacks.both
    gram, moment = x.T @ x / lacks.noise, x.T @ lacks.target / lacks.noise
    members = (*CAUSE_GROUPS, (TURNING_CAUSE,))
    groups = [np.array([i for i, word in enumerate(words) if word in group], int) for group in members]
    shares = fit_discrepancy_shares(gram, moment, count, groups)
    for group in groups:
        if len(group) == 1 and words[group[0]] != TURNING_CAUSE and not is_cause_validated(lacks, int(group[0])):
            shares[group] = DISCREPANCY_SHARE_GRID[0]
    spread = shares**2 + lacks.tied
    prior = np.concatenate([np.zeros(count), 1.0 / spread])
    try:
        posterior = np.linalg.inv(gram + np.diag(prior))
    except np.linalg.LinAlgError:
        return nothing()
    found = posterior @ moment
    factor = triangular_factor(jacobian, residual)
    # The solution differs from 0 where a bound holds a parameter.
    plain = np.linalg.lstsq(factor[:, :-1][:, free] / scale, factor[:, -1], rcond=None)[0]
    shift = plain - found[:count]
    units, at = np.outer(scale, scale), np.ix_(free, free)
    whole = np.outer(shift, shift) + posterior[:count, :count]
    part = excess_covariance(whole, statistical[at] * units)
    covariance[at] = part / units
    explained[at] = statistical[at] - (whole - part) / units
    moved = np.linalg.lstsq(x[:, :count], x[:, count:] * found[count:], rcond=None)[0]
    turned = np.array([word == TURNING_CAUSE for word in words], bool)
    # What the columns of the turning move is one effect.
    moved = np.column_stack([np.where(turned, 0.0, moved), moved[:, turned].sum(axis=1), shift - moved.sum(axis=1)])
    cause = iter(np.argmax(np.abs(moved), axis=1))
    steps = draw_normal(found, posterior)
    drawn = np.tile(values, (len(steps), 1))
    drawn[:, free] += steps[:, :count] / scale
    rubbing = friction.beside(words) * sizes
    forces = drawn[:, friction.at] @ friction.terms.T + steps[:, count:] @ rubbing.T
    # The whole least-squares residual may be friction.
    forces += size * standard_draws(forces.shape[1], FRICTION_DRAWS.seed + 1)
    said = (*words, TURNING_CAUSE, STICTION_CAUSE)
    causes = tuple(said[next(cause)] if f else "" for f in free)
    return Discrepancy(tuple(names), covariance, causes, friction.carried(forces), explained)


@dataclass(frozen=True)
class _FrictionTerms:
    """Friction coefficients of a model and the friction they make in steady states within the recorded ones."""

    states: States
    steady: SteadyStates  # n steady states
    at: np.ndarray  # indices of the friction coefficients among all parameters, (k,)
    names: tuple[str, ...]  # names of the friction coefficients
    values: np.ndarray  # values of the friction coefficients, (k,)
    terms: np.ndarray  # friction per unit of each coefficient in each steady state, (n, k)

    @classmethod
    def of(cls, names: Sequence[str], values: np.ndarray, states: States) -> _FrictionTerms:
        at = np.array([i for i, name in enumerate(names) if is_friction(name)], int)
        own = tuple(names[i] for i in at)
        shape = shape_index(names)
        boundary = float(values[shape]) if shape is not None else 0.0
        steady = SteadyStates.within(states.velocity, states.load)
        return cls(states, steady, at, own, values[at], steady.terms(own, boundary))

    def beside(self, physics: Sequence[str]) -> np.ndarray:
        """Return the friction per unit of each neglected effect at mid-travel, (n, k); 0 for effects other than
        friction."""
        still, v, y = np.zeros(len(self.terms)), self.steady.velocity, self.steady.load
        moving = States(still + self.states.position.mean(), v, still, y, still, still, still, self.states)
        return np.column_stack(
            [np.zeros((len(still), 0))]
            + [
                NEGLECTED_EFFECTS[name](moving) * moving.direction if name in FRICTION_EFFECTS else still
                for name in physics
            ]
        )

    def carried(self, forces: np.ndarray) -> Mapping[str, float]:
        """Return how much of each coefficient may be compensated, given draws of the friction `forces`, (d, n)."""
        return carried_friction(self.names, self.values, self.terms, forces) if len(self.at) else {}


def _effect_columns(
    states: States, rows: np.ndarray, w: np.ndarray, size: float, unseen: str
) -> tuple[np.ndarray, tuple[str, ...], np.ndarray]:
    """Return the columns of neglected effects in `rows`, (m, k), their names, and the scale of each, (k,).

    Each column has root mean square `size` outside the span of the model, `w` (m, p). Effects within that span are left
    out, except the `unseen` one, which is scaled as a whole.
    """
    basis = np.linalg.qr(w)[0]
    made, words, sizes = [np.zeros((len(w), 0))], [], []
    used = states.part(rows)
    effects = [(name, physics(used)) for name, physics in NEGLECTED_EFFECTS.items()]
    if used.turning is not None:
        effects += [(TURNING_CAUSE, column) for column in used.turning.T]
    for name, column in effects:
        norm = float(np.linalg.norm(column))
        beside = float(np.linalg.norm(column - basis @ (basis.T @ column)))
        if norm > 0.0 and (beside > DISCREPANCY_SETTINGS.min_column_remainder * norm or name == unseen):
            sizes.append(size * np.sqrt(len(column)) / (norm if name == unseen else beside))
            made.append(sizes[-1] * column[:, None])
            words.append(name)
    return np.hstack(made), tuple(words), np.array(sizes)


def fit_discrepancy_share(gram: np.ndarray, moment: np.ndarray, count: int) -> float:
    """Return the s with the largest marginal likelihood.

    `gram` and `moment` are normal equations of p + k columns divided by the noise variance; the first `count` columns
    are the model's.
    """
    own, cross, beside = gram[:count, :count], gram[:count, count:], gram[count:, count:]
    solved = np.linalg.solve(own, np.column_stack([cross, moment[:count]]))
    information = beside - cross.T @ solved[:, :-1]
    score = moment[count:] - cross.T @ solved[:, -1]
    values, vectors = np.linalg.eigh(information)
    values, score = np.maximum(values, 0.0), vectors.T @ score
    s2 = COMMON_SHARE_GRID[:, None] ** 2
    return float(
        COMMON_SHARE_GRID[np.argmax(np.sum(score**2 * s2 / (1.0 + s2 * values) - np.log1p(s2 * values), axis=1))]
    )


def fit_discrepancy_shares(
    gram: np.ndarray, moment: np.ndarray, count: int, groups: Sequence[np.ndarray]
) -> np.ndarray:
    """Return the s of each neglected column, (k,), with the largest marginal likelihood.

    `gram`, `moment` and `count` are those of `fit_discrepancy_share`. Each group, an array of column indices, has a
    common s. The search starts from the smallest s of all and chooses those of one group after the other.
    """
    own, cross, beside = gram[:count, :count], gram[:count, count:], gram[count:, count:]
    solved = np.linalg.solve(own, np.column_stack([cross, moment[:count]]))
    information = beside - cross.T @ solved[:, :-1]
    score = moment[count:] - cross.T @ solved[:, -1]

    def likelihoods(tried: np.ndarray) -> np.ndarray:
        scaled = information * (tried[:, :, None] * tried[:, None, :]) + np.eye(tried.shape[1])
        pull = tried * score
        solved = np.linalg.solve(scaled, pull[:, :, None])[:, :, 0]
        return np.einsum("ij,ij->i", pull, solved) - np.linalg.slogdet(scaled)[1]

    shares = np.full(len(score), DISCREPANCY_SHARE_GRID[0])
    for _ in range(DISCREPANCY_SETTINGS.share_sweep_count):
        for group in groups:
            if not len(group):
                continue
            tried = np.tile(shares, (len(DISCREPANCY_SHARE_GRID), 1))
            tried[:, group] = DISCREPANCY_SHARE_GRID[:, None]
            shares[group] = DISCREPANCY_SHARE_GRID[int(np.argmax(likelihoods(tried)))]
    return shares


def is_cause_validated(lacks: NeglectedColumns, index: int) -> bool:
    """Return whether the neglected column at `index` lowers the squared error of blocks from which it was not fitted.

    The effect that its own column cannot show, because it lies within the model's span, is never tested: it counts as
    present.
    """
    if lacks.words[index] == UNEQUAL_LOAD_LOSSES:
        return True
    count = lacks.own.shape[1]
    falls = lacks.own_errors - lacks.left_out_errors(np.append(np.arange(count), count + index))
    error = float(falls.std(ddof=1)) / np.sqrt(len(falls))
    return bool(falls.mean() > DISCREPANCY_SETTINGS.min_validation_z * error)


def excess_covariance(whole: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return the positive part of `whole` - `part`, both covariances (p, p), in the metric of `part`."""
    error = np.sqrt(np.diag(part))
    values, vectors = np.linalg.eigh(part / np.outer(error, error))
    root = vectors * np.sqrt(np.maximum(values, 1e-9))
    inverse = np.linalg.inv(root)
    ratio = inverse @ (whole / np.outer(error, error)) @ inverse.T
    values, vectors = np.linalg.eigh(0.5 * (ratio + ratio.T))
    root = root @ vectors
    return (root * np.maximum(values - 1.0, 0.0)) @ root.T * np.outer(error, error)
