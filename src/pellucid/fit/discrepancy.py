r"""What a model leaves out, and how far that may have moved its parameters.

Physics that a friction family does not have still acts. Each kind that is known of joints is one column
:math:`\varphi_k(q, \dot q, \ddot q, y)`, y the load, as large beside the model's span (root mean square) as what least
squares leaves over, and

.. math::
   \tau = W\beta + \sum_k c_k \varphi_k + e, \qquad c_k \sim N(0, s^2), \qquad e \text{ as coloured as the residual}

says that each may make s of it, s between nothing and all as the data make likeliest (marginal likelihood). Samples
into which the filters draw standstill are left out: what sticks may push with any force. Of the posterior, with b the
least-squares estimate,

.. math::
   E[(b - \beta)(b - \beta)^T] = (b - \hat\beta)(b - \hat\beta)^T + V_\beta

and what of it exceeds the statistical covariance is the discrepancy part. Where the misfit beside the model's span
tells the neglected physics, the first term carries its bias; where it cannot, the prior fills in [1]_, [2]_.

.. [1] M. C. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", J. R. Statist. Soc. B 63, 2001.
.. [2] J. Brynjarsdottir, A. O'Hagan, "Learning about physical parameters: the importance of model discrepancy", Inverse
   Problems 30, 2014.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..models.carried_friction import NORMAL_DRAW_SEED, SteadyStates, carried_friction, draw_normal, is_friction
from ..signals.motion import SLOW_SHARE
from .regression import Stack

MOST_ROWS = 50_000
"""More rows than these are thinned: what is sought is smooth in the states."""

STANDSTILL = 0.05  # of the root mean square speed: slower counts as still
STRIBECK = 0.25  # of the same: where boundary friction has fallen to 1/e
SHARES = np.geomspace(0.01, 1.0, 9)  # that s may be


@dataclass(frozen=True)
class States:
    """Where a joint is in the rows of a regression; every array (m,), SI."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    load: np.ndarray  # What passes through the drive: inertia and gravity
    cosine: np.ndarray  # Of the angle; 0 of what slides
    snap: np.ndarray  # Second derivative of the acceleration
    standstill: np.ndarray  # Share that the filters draw from standstill
    like: States | None = None  # Whose travel and speeds are the usual ones; its own if None

    @property
    def direction(self) -> np.ndarray:
        """Sign of the velocity."""
        return np.sign(self.velocity)

    @property
    def travel(self) -> np.ndarray:
        """Position, centred, over its spread."""
        usual = (self.like or self).position
        return (self.position - usual.mean()) / max(float(usual.std()), np.finfo(float).tiny)

    @property
    def boundary(self) -> np.ndarray:
        """How far friction is from that of a full film: 1 at rest, 0 at speed."""
        top = STRIBECK * float(np.sqrt(np.mean((self.like or self).velocity ** 2)))
        return np.exp(-np.abs(self.velocity) / max(top, np.finfo(float).tiny))


NEGLECTED: Mapping[str, Callable[[States], np.ndarray]] = {
    "friction that grows with the load": lambda s: s.direction * np.abs(s.load),
    "lifting and lowering that lose different shares of the load": lambda s: s.load,
    "a rotor before what rubs under the load": lambda s: s.direction * np.sign(s.load) * s.acceleration,
    "a spring in the drive": lambda s: s.snap,
    "an angle zero beside where the joint hangs": lambda s: s.cosine,
    "viscosity that declines with speed": lambda s: s.velocity * np.abs(s.velocity),
    "viscosity that declines in one direction": lambda s: s.velocity**2,
    "friction that falls from rest": lambda s: s.direction * s.boundary,
    "load friction that changes with speed": lambda s: s.direction * np.abs(s.load * s.velocity),
    "load friction that falls from rest": lambda s: s.direction * np.abs(s.load) * s.boundary,
    "friction that changes along the travel": lambda s: s.direction * s.travel,
    "friction that is largest amid the travel": lambda s: s.direction * s.travel**2,
    "viscosity that changes along the travel": lambda s: s.velocity * s.travel,
}
"""Physics that a family may lack: effort along a motion, of any size."""

RUBBING = tuple(n for n in NEGLECTED if n.startswith(("friction", "viscosity", "load friction")))
STICKING = "sticking at standstill"
OWN = 0.05  # share of a column beside the model's span below which the model has this physics itself
TIED = "load_friction"  # both shares of the load as one
UNSEEN = "lifting and lowering that lose different shares of the load"
"""What looks like more inertia and gravity, and is neither: a model without both coefficients does not have it."""

SPLIT = 0.8114 / 1.959964
"""Standard deviation, over their mean a, of how far the shares lost in lifting and in lowering are from it, where only
a shows: each is between 0 and 2 a, and neither end is likely. Of the simplest such density, a parabola, 95 % are within
0.81 a."""


@dataclass(frozen=True)
class Discrepancy:
    """The discrepancy part of a covariance, (p, p), and for each of p parameters what moves it most, in words; and how
    much of each coefficient of friction may be compensated."""

    names: tuple[str, ...]
    covariance: np.ndarray
    causes: tuple[str, ...]
    carried: Mapping[str, float]

    def of(self, names: Sequence[str]) -> tuple[np.ndarray, tuple[str, ...]]:
        """Covariance, (k, k), and causes of the parameters `names`."""
        at = [self.names.index(name) for name in names]
        return self.covariance[np.ix_(at, at)], tuple(self.causes[i] for i in at)


class DifferentiatedMotion(Protocol):
    """A motion whose states are known: each (n,), SI."""

    fs: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    def smooth(self, samples: np.ndarray) -> np.ndarray:
        """The motion's own low-pass."""


def states_of(
    data: Stack,
    rotary: bool,
    load: Callable[[DifferentiatedMotion, np.ndarray, np.ndarray], np.ndarray],
    dead_band: float,
) -> States:
    """States in the rows of a stack, with the `load` of a motion at positions and accelerations, each (k,); slower than
    the `dead_band`, or than a twentieth of the usual speed, a joint stands still."""
    known = vars(data)
    if "_kinematics" not in known:  # the same for every model of these recordings
        power = sum(float(m.velocity @ m.velocity) for m in data.motions)
        usual = np.sqrt(power / sum(len(m.velocity) for m in data.motions))
        slow = dead_band if dead_band > 0.0 else STANDSTILL * float(usual)
        known["_kinematics"] = tuple(
            np.concatenate([m.rows(of(m, slow)) for m in data.motions])
            for of in (
                lambda m, slow: m.position,
                lambda m, slow: m.velocity,
                lambda m, slow: m.acceleration,
                lambda m, slow: np.gradient(np.gradient(m.acceleration)) * m.fs**2,
                lambda m, slow: np.abs(m.smooth((np.abs(m.velocity) <= slow).astype(float))),
            )
        )
    position, velocity, acceleration, snap, standstill = known["_kinematics"]
    ends = np.cumsum(data.lengths)
    loads = [
        load(m, position[end - n : end], acceleration[end - n : end])
        for m, n, end in zip(data.motions, data.lengths, ends, strict=True)
    ]
    cosine = np.cos(position) if rotary else np.zeros(len(position))
    return States(position, velocity, acceleration, np.concatenate(loads), cosine, snap, standstill)


@dataclass(frozen=True)
class Neglected:
    """What a model may lack, beside what it has: columns of `rows` of a regression, scaled to norm 1 of its own and to
    what least squares leaves over of the others."""

    rows: np.ndarray  # (k,) Those of the regression that are used
    free: np.ndarray  # (p,) Parameters that have an effect
    scale: np.ndarray  # (q,) Norms of their columns, over all rows
    own: np.ndarray  # (k, q) Their columns
    columns: np.ndarray  # (k, c) Of neglected physics
    words: tuple[str, ...]  # What each is
    sizes: np.ndarray  # (c,) Of one unit of each
    target: np.ndarray  # (k,) What least squares leaves over
    noise: float  # Variance of a row beside all columns, as large as its colour makes it count
    tied: np.ndarray  # (c,) Variance of a column's coefficient beyond what the residual tells of it

    @property
    def both(self) -> np.ndarray:
        """All columns, (k, q + c), the model's own first."""
        return np.hstack([self.own, self.columns])


def neglected(
    names: Sequence[str],
    values: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    states: States,
    statistical: np.ndarray,
) -> Neglected | None:
    """Columns of what a model may lack, arguments as of `discrepancy_of`; None where too few rows move, or nothing is
    left over."""
    norms = np.linalg.norm(jacobian, axis=0)
    free = (norms > 1e-12 * norms.max()) & (np.diag(statistical) > 0.0)
    scale = norms[free]
    w = jacobian[:, free] / scale
    error = np.sqrt(np.diag(statistical)[free]) * scale  # of the scaled parameters
    size = float(np.sqrt(np.mean(residual**2)))
    kept = states.standstill < SLOW_SHARE
    if kept.mean() < 0.5:
        kept = states.standstill <= np.median(states.standstill)
    if not size > 0.0 or kept.sum() < 4 * (int(free.sum()) + len(NEGLECTED)):
        return None
    rows = np.flatnonzero(kept)[:: max(1, int(kept.sum()) // MOST_ROWS)]
    columns, words, sizes = _columns(states, rows, w[rows], size, "" if "load_motoring" in names else UNSEEN)
    x, y = np.hstack([w[rows], columns]), residual[rows]
    # As much noise as makes the textbook's errors the statistical ones, in the rows that are used.
    coloured = float(np.median(error**2 / np.diag(np.linalg.inv(w.T @ w)))) * len(rows) / len(residual)
    step = np.linalg.lstsq(x, y, rcond=None)[0]
    white = float(np.mean((y - x @ step) ** 2)) / size**2
    noise = max(coloured * min(1.0, white), np.finfo(float).tiny * size**2)
    tied = np.zeros(len(words))
    if UNSEEN in words and TIED in names:
        at = words.index(UNSEEN)
        # Fitted, load friction is not in the residual: of its two shares it tells more than that does.
        tied[at] = (SPLIT * values[list(names).index(TIED)] / sizes[at]) ** 2
    return Neglected(rows, free, scale, w[rows], columns, words, sizes, y, noise, tied)


def discrepancy_of(
    names: Sequence[str],
    values: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    states: States,
    statistical: np.ndarray,
) -> Discrepancy:
    """How far what a model leaves out may have moved its p parameters `names` from their `values`, (p,), beyond their
    `statistical` covariance, (p, p). `jacobian` (m, p) and `residual` (m,) at the least-squares solution."""
    p = jacobian.shape[1]
    covariance = np.zeros((p, p))
    values = np.asarray(values, float)
    friction = _Friction.of(names, values, states)

    def nothing() -> Discrepancy:
        certain = draw_normal(values, statistical)[:, friction.at] @ friction.terms.T
        return Discrepancy(tuple(names), np.zeros((p, p)), ("",) * p, friction.carried(certain))

    lacks = neglected(names, values, jacobian, residual, states, statistical)
    if lacks is None:
        return nothing()
    free, scale, rows, words, sizes = lacks.free, lacks.scale, lacks.rows, lacks.words, lacks.sizes
    count, size, x = len(scale), float(np.sqrt(np.mean(residual**2))), lacks.both
    w = jacobian[:, free] / scale
    gram, moment = x.T @ x / lacks.noise, x.T @ lacks.target / lacks.noise
    spread = likeliest_share(gram, moment, count) ** 2 + lacks.tied
    prior = np.concatenate([np.zeros(count), 1.0 / spread])
    try:
        posterior = np.linalg.inv(gram + np.diag(prior))
    except np.linalg.LinAlgError:
        return nothing()
    found = posterior @ moment
    plain = np.linalg.lstsq(w, residual, rcond=None)[0]  # not 0 where a bound holds a parameter
    shift = plain - found[:count]
    units = np.outer(scale, scale)
    part = np.outer(shift, shift) + beyond(posterior[:count, :count], statistical[np.ix_(free, free)] * units)
    covariance[np.ix_(free, free)] = part / units
    moved = np.linalg.lstsq(w[rows], x[:, count:] * found[count:], rcond=None)[0]
    moved = np.column_stack([moved, shift - moved.sum(axis=1)])
    words = (*words, STICKING)
    cause = iter(np.argmax(np.abs(moved), axis=1))
    steps = draw_normal(found, posterior)
    drawn = np.tile(values, (len(steps), 1))
    drawn[:, free] += steps[:, :count] / scale
    rubbing = friction.beside(words[:-1]) * sizes
    forces = drawn[:, friction.at] @ friction.terms.T + steps[:, count:] @ rubbing.T
    # What least squares leaves over may all be friction.
    forces += size * np.random.default_rng(NORMAL_DRAW_SEED + 1).standard_normal(forces.shape)
    causes = tuple(words[next(cause)] if f else "" for f in free)
    return Discrepancy(tuple(names), covariance, causes, friction.carried(forces))


@dataclass(frozen=True)
class _Friction:
    """Steady states within a recording's, and the coefficients of friction: where they stand, (k,), what they are, and
    what one unit of each makes there, (n, k)."""

    states: States
    steady: SteadyStates
    at: np.ndarray
    names: tuple[str, ...]
    values: np.ndarray
    terms: np.ndarray

    @classmethod
    def of(cls, names: Sequence[str], values: np.ndarray, states: States) -> _Friction:
        at = np.array([i for i, name in enumerate(names) if is_friction(name)], int)
        own = tuple(names[i] for i in at)
        boundary = float(values[list(names).index("stribeck_velocity")]) if "stribeck_velocity" in names else 0.0
        steady = SteadyStates.within(states.velocity, states.load)
        return cls(states, steady, at, own, values[at], steady.terms(own, boundary))

    def beside(self, physics: Sequence[str]) -> np.ndarray:
        """What resists per unit of each neglected physics, amid the travel; 0 of what is no friction. Gives (n, k)."""
        still, v, y = np.zeros(len(self.terms)), self.steady.velocity, self.steady.load
        moving = States(still + self.states.position.mean(), v, still, y, still, still, still, self.states)
        return np.column_stack(
            [np.zeros((len(still), 0))]
            + [NEGLECTED[name](moving) * moving.direction if name in RUBBING else still for name in physics]
        )

    def carried(self, forces: np.ndarray) -> Mapping[str, float]:
        """How much of each coefficient may be compensated where the friction may be any of `forces`, (d, n)."""
        return carried_friction(self.names, self.values, self.terms, forces) if len(self.at) else {}


def _columns(
    states: States, rows: np.ndarray, w: np.ndarray, size: float, unseen: str
) -> tuple[np.ndarray, tuple[str, ...], np.ndarray]:
    """Columns of neglected physics in `rows`, (m, k), each of root mean square `size` beside the span of the model, `w`
    (m, p), but for those within it, the `unseen` apart; their words, and the size of one unit, (k,)."""
    basis = np.linalg.qr(w)[0]
    made, words, sizes = [np.zeros((len(w), 0))], [], []
    for name, physics in NEGLECTED.items():
        column = physics(states)[rows]
        norm = float(np.linalg.norm(column))
        beside = float(np.linalg.norm(column - basis @ (basis.T @ column)))
        if norm > 0.0 and (beside > OWN * norm or name == unseen):
            sizes.append(size * np.sqrt(len(column)) / (norm if name == unseen else beside))
            made.append(sizes[-1] * column[:, None])
            words.append(name)
    return np.hstack(made), tuple(words), np.array(sizes)


def likeliest_share(gram: np.ndarray, moment: np.ndarray, count: int) -> float:
    """The likeliest s, of normal equations of p + k columns over the noise, the first `count` of them the model's."""
    own, cross, beside = gram[:count, :count], gram[:count, count:], gram[count:, count:]
    solved = np.linalg.solve(own, np.column_stack([cross, moment[:count]]))
    information = beside - cross.T @ solved[:, :-1]
    score = moment[count:] - cross.T @ solved[:, -1]
    values, vectors = np.linalg.eigh(information)
    values, score = np.maximum(values, 0.0), vectors.T @ score
    s2 = SHARES[:, None] ** 2
    return float(SHARES[np.argmax(np.sum(score**2 * s2 / (1.0 + s2 * values) - np.log1p(s2 * values), axis=1))])


def beyond(whole: np.ndarray, part: np.ndarray) -> np.ndarray:
    """What of a covariance exceeds another, both (p, p), in every direction in which it does."""
    error = np.sqrt(np.diag(part))
    values, vectors = np.linalg.eigh(part / np.outer(error, error))
    root = vectors * np.sqrt(np.maximum(values, 1e-9))
    inverse = np.linalg.inv(root)
    ratio = inverse @ (whole / np.outer(error, error)) @ inverse.T
    values, vectors = np.linalg.eigh(0.5 * (ratio + ratio.T))
    root = root @ vectors
    return (root * np.maximum(values - 1.0, 0.0)) @ root.T * np.outer(error, error)
