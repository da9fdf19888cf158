r"""Fit one model of a robot by weighted least squares, with intervals that are robust to coloured residuals.

**Covariance.** The textbook covariance treats every row of every joint as independent. Here rows are cut into blocks of
ten correlation times (the mean of the joints'), with all joints of a block together. Blocks are nearly independent of
each other, rows within one are not [1]_. With W_b the weighted rows of block b, H_b its part of the projection, and r_b
its residuals,

.. math::
   C = k^2 B \Big(\sum_b W_b^T (I - H_b)^{-1/2} r_b\, r_b^T (I - H_b)^{-1/2} W_b\Big) B,
   \qquad B = \Big(\sum_b W_b^T W_b\Big)^{-1}.

The root corrects for the part of each block's residual that the fit removed (CR2 [2]_). k is the ratio of Student's
quantile to the normal one, with one degree of freedom less than there are blocks. Segments play no part and nothing is
fitted again. The jackknife over segments, which end where a robot stops, is therefore an independent check.

.. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
.. [2] R. M. Bell, D. F. McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples",
   Survey Methodology 28, 2002.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.causes import Cause, ParallelSpring
from ...models.estimates import Parameter
from ...models.joint import PARALLEL_STIFFNESS
from ...models.robot import Robot
from ...numerics.block_test import MIN_IMPROVEMENT
from ...numerics.motion import require_fitted
from ...numerics.regression import make_parameters
from ...numerics.uncertainty import BLOCK_SETTINGS, correlation_time, student_to_normal_ratio
from ..tree_motion import TreeMotion
from .friction_terms import FURTHER_MOTOR_TERMS, FURTHER_TERMS, STRIBECK_VELOCITY_NAME, plain_families
from .joint_causes import find_joint_causes, find_parallel_springs
from .tree_estimate import BaseParameters, TreeEstimate
from .tree_families import FamilyChoice, SpectralLine, choose_families, choose_ripples
from .tree_regression import (
    LinearisedModel,
    TreeModel,
    TreeRows,
    TreeSolution,
    collect_rows,
    compute_loads,
    fit_rows,
    left_out_joint_losses,
    linearise_rows,
    sum_normal_equations,
)

ModelFit = Callable[[TreeRows], tuple[TreeModel, TreeSolution]]
"""A function from rows to a model and its values, which includes all choices."""


@dataclass(frozen=True)
class SegmentsOut:
    """Errors of cross-validation over segments.

    Attributes
    ----------
    errors : ndarray, shape (m,)
        RMS error divided by the RMS effort, both over the rows that count [%].
    each : ndarray, shape (S, m)
        Error of each segment, divided by the same RMS effort [%]; nan where a joint rests.
    models : tuple of TreeModel
        Model chosen without each segment.
    values : tuple of ndarray
        Parameters of each of these models.
    """

    errors: np.ndarray
    each: np.ndarray
    models: tuple[TreeModel, ...]
    values: tuple[np.ndarray, ...]

    @property
    def mean(self) -> float:
        """Mean error over joints [%]."""
        return float(self.errors.mean())


def residuals_on(model: TreeModel, values: np.ndarray, rows: TreeRows) -> tuple[np.ndarray, ...]:
    """Return the residuals of each joint on the rows that count, (n_j,)."""
    return linearise_rows(model, rows, compute_loads(rows, model, values)).residuals(values)


def relative_errors(residuals: tuple[np.ndarray, ...], size: np.ndarray) -> np.ndarray:
    """Return the RMS residual of each joint divided by its RMS effort `size`, (m,) [%]; nan without rows."""
    found = [np.sqrt(np.mean(r**2)) if len(r) else np.nan for r in residuals]
    return 100.0 * np.array(found) / size


def cross_validate_segments(rows: TreeRows, fit: ModelFit) -> SegmentsOut:
    """Return the errors on each segment of the model that `fit` estimates from all other segments."""
    numbers = np.unique(rows.segment[rows.used.any(axis=1)])
    if len(numbers) < 2:
        raise IdentificationError(f"found {len(numbers)} segment for cross-validation, expected at least 2")
    models, values, each = [], [], []
    squares, counts = np.zeros((2, len(rows.size)))
    for number in numbers:
        model, found = fit(rows.only(numbers[numbers != number]))
        residuals = residuals_on(model, found.values, rows.only([number]))
        models.append(model)
        values.append(found.values)
        squares += [np.sum(r**2) for r in residuals]
        counts += [len(r) for r in residuals]
        each.append(relative_errors(residuals, rows.size))
    errors = 100.0 * np.sqrt(squares / np.maximum(counts, 1)) / rows.size
    return SegmentsOut(errors, np.array(each), tuple(models), tuple(values))


def heldout_errors(estimate: TreeEstimate, motions: Sequence[TreeMotion]) -> np.ndarray:
    """Return the RMS error of an estimate on held-out recordings, divided by the RMS effort of each joint, (m,) [%]."""
    off = np.concatenate([m.effort - estimate.effort(m) for m in motions])
    effort, moving = (np.concatenate([getattr(m, name) for m in motions]) for name in ("effort", "moving"))
    count = moving.sum(axis=0)
    if not count.all():
        still = estimate.robot.names[int(np.argmin(count))]
        names = ", ".join(sorted({m.recording for m in motions}))
        raise IdentificationError(f"joint {still!r} never moves in {names}: expected motion to evaluate its error")
    return 100.0 * np.sqrt(np.sum(moving * off**2, axis=0) / np.sum(moving * effort**2, axis=0))


AGREEMENT_FACTOR = 2.0
"""A stated standard error agrees with the jackknife's if their ratio is within this factor."""


@dataclass(frozen=True)
class SegmentJackknife:
    """Standard errors by the jackknife, compared with stated ones; nan for parameters on a bound or undetermined."""

    sd: np.ndarray  # jackknife standard errors, (p,)
    stated: np.ndarray  # stated standard errors, (p,)
    textbook: np.ndarray  # standard errors for white residuals, (p,)
    segments: int  # number of segments

    @property
    def ratios(self) -> np.ndarray:
        """Stated over jackknife standard errors, of the parameters that have both."""
        both = np.isfinite(self.sd) & np.isfinite(self.stated) & (self.sd > 0.0) & (self.stated > 0.0)
        return self.stated[both] / self.sd[both]

    @property
    def share_within(self) -> float:
        """Share of parameters for which both agree within `AGREEMENT_FACTOR` [%]."""
        ratios = self.ratios
        return (
            float(100.0 * np.mean((ratios < AGREEMENT_FACTOR) & (ratios > 1.0 / AGREEMENT_FACTOR)))
            if len(ratios)
            else float("nan")
        )

    @property
    def textbook_ratio(self) -> float:
        """Median ratio of jackknife to textbook standard errors."""
        both = (self.textbook > 0.0) & np.isfinite(self.sd)
        return float(np.median(self.sd[both] / self.textbook[both]))


def jackknife_segments(
    model: TreeModel, rows: TreeRows, found: TreeSolution, covariance: np.ndarray, textbook: np.ndarray
) -> SegmentJackknife:
    """Compute the jackknife of a solution with its `covariance`, (p, p), and the `textbook` one, (p, p).

    The model is not chosen again.
    """
    numbers = np.unique(rows.segment[rows.used.any(axis=1)])
    values = np.array([fit_rows(model, rows.only(numbers[numbers != n]), start=found)[0].values for n in numbers])
    sd = np.sqrt((len(numbers) - 1) / len(numbers) * np.sum((values - values.mean(axis=0)) ** 2, axis=0))
    free = found.seen & ~found.held
    stated, by_book = (np.where(free, np.sqrt(np.diag(c)), np.nan) for c in (covariance, textbook))
    return SegmentJackknife(np.where(free, sd, np.nan), stated, by_book, len(numbers))


MAX_LEVERAGE = 0.999
"""Upper limit of a block's leverage in any direction. A leverage of 1 would leave no residual."""


@dataclass(frozen=True)
class TreeUncertainty:
    """Covariance of a robot's parameters from blocks of rows."""

    covariance: np.ndarray  # block-robust covariance, (p, p)
    freedom: float  # degrees of freedom
    textbook: np.ndarray  # covariance for independent rows, (p, p)


def student_ratio(freedom: float) -> float:
    """Return Student's 97.5 % quantile over the normal one; 6.5, which it is for one degree of freedom, for less."""
    return student_to_normal_ratio(freedom) if freedom > 1.0 else 6.5


def correlation_times(rows: TreeRows, residuals: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return the correlation time of each joint's residual, (m,), in rows; rows that do not count enter as 0."""
    lengths = np.bincount(rows.stretch).tolist()
    found = []
    for lines, residual in zip(rows.lines, residuals, strict=True):
        whole = np.zeros(len(rows.stretch))
        whole[lines] = residual
        found.append(correlation_time(whole, lengths))
    return np.array(found)


def block_numbers(rows: TreeRows, memory: float) -> np.ndarray:
    """Return the block number of each row, (N,).

    A block has ten correlation times of `memory` rows, and never spans two recordings.
    """
    lengths = np.bincount(rows.stretch)
    longest = max(1, len(rows.stretch) // BLOCK_SETTINGS.min_blocks)
    length = int(np.clip(round(BLOCK_SETTINGS.block_correlation_times * memory), 1, longest))
    made, first = [], 0
    for n in lengths:
        count = max(1, round(n / length))
        made.append(np.arange(n) * count // max(n, 1) + first)
        first += count
    return np.concatenate(made)


def estimate_uncertainty(at: LinearisedModel, found: TreeSolution) -> TreeUncertainty:
    """Compute the covariance of a solution on the model linearised there.

    It is 0 for parameters that are on a bound or undetermined.
    """
    rows, p = at.rows, len(found.values)
    free = np.flatnonzero(found.seen & ~found.held)
    place_of = np.full(p, -1)
    place_of[free] = np.arange(len(free))
    residuals = at.residuals(found.values)
    block = block_numbers(rows, float(correlation_times(rows, residuals).mean()))
    parts, gram = [], np.zeros((len(free), len(free)))
    for j, (place, x, r) in enumerate(zip(at.places, at.columns, residuals, strict=True)):
        known = place_of[place] >= 0
        own = x[:, known] / found.sd[j]
        parts.append((place_of[place[known]], own, r / found.sd[j], block[rows.lines[j]]))
        gram[np.ix_(parts[-1][0], parts[-1][0])] += own.T @ own
    size = np.sqrt(np.diag(gram))
    # B = L'L with L = `root`: the projection's part of a block is (W L')(W L')'.
    root = np.linalg.inv(np.linalg.cholesky(gram / np.outer(size, size))) / size
    score_rows = []
    for b in range(int(block.max()) + 1):
        inner, pull = np.zeros_like(gram), np.zeros(len(free))
        for place, own, r, blocks in parts:
            first, last = np.searchsorted(blocks, [b, b + 1])
            mine = own[first:last]
            inner[np.ix_(place, place)] += mine.T @ mine
            pull[place] += mine.T @ r[first:last]
        if not pull.any():
            continue
        # A' (I - A A')^(-1/2) r equals (I - A'A)^(-1/2) A' r.
        taken, ways = np.linalg.eigh(root @ inner @ root.T)
        left = 1.0 - np.clip(taken, 0.0, MAX_LEVERAGE)
        score_rows.append(root.T @ (ways @ ((ways.T @ (root @ pull)) / np.sqrt(left))))
    scores = np.array(score_rows)
    freedom = float(max(len(scores) - 1, 1))
    k = student_ratio(freedom)
    covariance, textbook = np.zeros((2, p, p))
    covariance[np.ix_(free, free)] = k**2 * scores.T @ scores
    textbook[np.ix_(free, free)] = root.T @ root
    return TreeUncertainty(covariance, freedom, textbook)


UNDETERMINED_REASON = "these recordings do not distinguish it from the other parameters"
"""Reason for refusing the interval of a parameter that the recordings do not determine."""

GRID_SEARCH_REASON = "searched on a grid, not fitted"
"""Reason for refusing the interval of a Stribeck velocity."""


def fit_tree(
    robot: Robot,
    motions: Sequence[TreeMotion],
    families: Sequence[Sequence[str]] | None = None,
    *,
    name: str = "base",
    width: float = 0.0,
) -> TreeEstimate:
    """Fit base parameters and friction by weighted least squares.

    `families` are the friction terms of each joint, plain ones by default. `width` is that of the smooth sign of
    friction, 0 for the true sign [rad/s; m/s].
    """
    rows = collect_rows(robot, motions, width=width)
    plain = plain_families(len(robot.names), robot.shared)
    model = TreeModel(robot, rows.base, plain if families is None else tuple(map(tuple, families)))
    return make_tree_estimate(name, rows, *fit_rows(model, rows))


def make_tree_estimate(
    name: str,
    rows: TreeRows,
    found: TreeSolution,
    at: LinearisedModel,
    *,
    method: str = "weighted",
    uncertainty: TreeUncertainty | None = None,
    notes: Sequence[str] = (),
) -> TreeEstimate:
    """Build an estimate with intervals from the solution `found` of the rows, linearised there (`at`)."""
    model = at.model
    sure = estimate_uncertainty(at, found) if uncertainty is None else uncertainty
    parameters = _parameters(model, rows, found, at, sure)
    speeds = {f"{model.robot.names[k]}.{STRIBECK_VELOCITY_NAME}": (k, v) for k, v in (model.speeds or {}).items()}
    ripples = []
    for i, ripple in enumerate(model.ripples):
        first = len(model.base.names) + len(model.parts) + 2 * i
        ripples.append(replace(ripple, sine=found.values[first], cosine=found.values[first + 1]))
    for label, (k, value) in speeds.items():
        unit = f"{model.robot.units[k][0]}/s"
        parameters[label] = Parameter(label, unit, value, 0.0, refused=GRID_SEARCH_REASON)
    size = len(parameters)
    covariance = np.zeros((size, size))
    covariance[: len(found.values), : len(found.values)] = sure.covariance
    return TreeEstimate(
        title=f"{len(model.robot.names)} joints, {len(found.values)} parameters, {name}",
        name=name,
        robot=model.robot,
        families=model.families,
        parameters=parameters,
        covariance=covariance,
        velocity_width=rows.width,
        ripples=tuple(ripples),
        readings={n: model.base.reading(n) for n in model.base.names},
        residual_sd=tuple(float(x) for x in found.sd),
        freedom=sure.freedom,
        method=method,
        notes=tuple(notes),
    )


def _parameters(
    model: TreeModel, rows: TreeRows, found: TreeSolution, at: LinearisedModel, sure: TreeUncertainty
) -> dict[str, Parameter]:
    """Return the parameters by name, each with its influence on the effort of all joints."""
    power = np.zeros(len(found.values))
    for place, x in zip(at.places, at.columns, strict=True):
        power[place] += np.sum(x**2, axis=0)
    whole = sum(float(np.sum(rows.effort[lines, j] ** 2)) for j, lines in enumerate(rows.lines))
    plain = make_parameters(model.names, model.units, found.values, sure.covariance, found.held, ~found.seen)
    made = {}
    for parameter, seen, strength in zip(plain, found.seen, power, strict=True):
        refused = "" if seen else UNDETERMINED_REASON
        influence = float(np.sqrt(strength / whole))
        made[parameter.name] = replace(parameter, influence=influence, refused=refused)
    return made


@dataclass(frozen=True, eq=False)
class TreeIdentification:
    """Identification of a robot from its recordings.

    Attributes
    ----------
    rows : TreeRows
        Regression rows of the fitted recordings.
    base, best : TreeEstimate
        Estimate with plain friction, and estimate with friction and ripple chosen within these rows.
    choice : FamilyChoice
        Chosen friction terms, in the order of the choice.
    lines : sequence of Line
        Strongest spectral line of each motor's residual over its angle.
    base_out, best_out, maker_out : SegmentsOut or None
        Errors on left-out segments of both estimates, and of the maker's inertias with fitted friction; None if not
        requested.
    jackknife : SegmentJackknife or None
        Jackknife check of the best estimate's standard errors.
    heldout : mapping of str to ndarray
        Errors of "base" and "best" on held-out recordings, (m,) [%].
    causes : tuple of Cause
        Causes of what the best estimate misses at each joint, springs among its terms included.
    """

    rows: TreeRows
    base: TreeEstimate
    best: TreeEstimate
    choice: FamilyChoice
    lines: Sequence[SpectralLine]
    base_out: SegmentsOut | None
    best_out: SegmentsOut | None
    maker_out: SegmentsOut | None
    jackknife: SegmentJackknife | None
    heldout: dict[str, np.ndarray]
    causes: tuple[Cause, ...]


def identify_tree(
    robot: Robot,
    motions: Sequence[TreeMotion],
    judged: Sequence[TreeMotion] = (),
    *,
    width: float = 0.0,
    leave_out: bool = True,
    terms: Sequence[str] = FURTHER_TERMS + FURTHER_MOTOR_TERMS,
    ripple: bool = True,
) -> TreeIdentification:
    """Identify a robot from `motions`, and test it on the held-out motions of the argument `judged`.

    `width` is the velocity width of friction's smooth sign [rad/s; m/s]. `leave_out` adds cross-validation over
    segments. `terms` are the candidate friction terms of the joints. `ripple` adds a search for drive ripple.
    """
    require_fitted(motions, "identify_tree")
    rows = collect_rows(robot, motions, width=width)
    rate = motions[0].rate
    plain = plain_model(rows)
    base = make_tree_estimate("base", rows, *fit_rows(plain, rows))
    choice, lines, found, at = fit_best_model(rows, rate, terms, ripple)
    sure = estimate_uncertainty(at, found)
    best = make_tree_estimate("best", rows, found, at, uncertainty=sure, notes=_notes(rows, choice, at.model))
    causes = find_joint_causes(at, found, best, choice.springs)
    base_out = best_out = maker_out = jackknife = None

    def choose_and_fit(part: TreeRows) -> tuple[TreeModel, TreeSolution]:
        *_, solution, linearised = fit_best_model(part, rate, terms, ripple)
        return linearised.model, solution

    if leave_out and rows.segments > 1:
        base_out = cross_validate_segments(rows, lambda part: (plain, fit_rows(plain, part)[0]))
        best_out = cross_validate_segments(rows, choose_and_fit)
        jackknife = jackknife_segments(at.model, rows, found, sure.covariance, sure.textbook)
        maker = rows_without_maker_effort(rows, motions)
        friction = plain_model(maker)
        maker_out = cross_validate_segments(maker, lambda part: (friction, fit_rows(friction, part)[0]))
        maker_out = replace(maker_out, errors=maker_out.errors * maker.size / rows.size)
    heldout = {e.name: heldout_errors(e, judged) for e in (base, best)} if judged else {}
    outs = base_out, best_out, maker_out
    return TreeIdentification(rows, base, best, choice, lines, *outs, jackknife, heldout, causes)


def plain_model(rows: TreeRows) -> TreeModel:
    """Return the model with base parameters and plain friction."""
    return TreeModel(rows.robot, rows.base, plain_families(len(rows.robot.names), rows.robot.shared))


def fit_best_model(
    rows: TreeRows, rate: float, terms: Sequence[str] = FURTHER_TERMS + FURTHER_MOTOR_TERMS, ripple: bool = True
) -> tuple[FamilyChoice, Sequence[SpectralLine], TreeSolution, LinearisedModel]:
    """Choose friction `terms`, springs, and `ripple` if requested, within `rows` at `rate` [Hz], and fit the model."""
    choice = choose_families(rows, terms)
    model = TreeModel(rows.robot, rows.base, choice.families, choice.speeds)
    found, at = fit_rows(model, rows)
    # A spring at one joint may hide one at another, and what looked like friction without it.
    while new := _springs_of_robot(at, found, find_parallel_springs(at, found)):
        springs = {**choice.springs, **new}
        choice = replace(choose_families(rows, terms, sprung=springs), springs=springs)
        model = TreeModel(rows.robot, rows.base, choice.families, choice.speeds)
        found, at = fit_rows(model, rows)
    ripples, lines = choose_ripples(at, found, rate) if ripple else ((), ())
    if ripples:
        model = replace(model, ripples=ripples)
        found, at = fit_rows(model, rows, load=compute_loads(rows, model, found.values))
    return choice, lines, found, at


def _springs_of_robot(
    at: LinearisedModel, found: TreeSolution, springs: Mapping[int, ParallelSpring]
) -> dict[int, ParallelSpring]:
    """Return those of `springs`, by joint, that predict left-out segments better in the model of all joints."""
    if not springs:
        return {}
    rows, model = at.rows, at.model
    families = tuple(f + (PARALLEL_STIFFNESS,) * (k in springs) for k, f in enumerate(model.families))
    load = compute_loads(rows, model, found.values)
    wide = linearise_rows(replace(model, families=families), rows, load, model.alpha(found.values))
    present = np.unique(rows.segment[rows.used.any(axis=1)])
    before, after = (
        left_out_joint_losses(sum_normal_equations(x).of_segments(present), found.sd).sum(axis=0) for x in (at, wide)
    )
    return {k: spring for k, spring in springs.items() if after[k] <= (1.0 - MIN_IMPROVEMENT) ** 2 * before[k]}


def rows_without_maker_effort(rows: TreeRows, motions: Sequence[TreeMotion]) -> TreeRows:
    """Return rows for the baseline with the maker's links: their effort is subtracted, and rotors and friction remain
    to be fitted."""
    robot = rows.robot
    stated = np.concatenate(
        [robot.tree.core.regressor(m.position, m.velocity, m.acceleration) @ robot.tree.parameters for m in motions]
    )
    rotors = [f"{name}.rotor_inertia" for name in robot.names]
    motors = [f"{robot.names[i]}.motor_inertia" for i in robot.shared]
    turns = np.asarray(robot.turns)
    acceleration = np.concatenate([m.acceleration for m in motions])
    m = len(robot.names)
    rigid = np.zeros((*rows.effort.shape, m + len(motors)))
    rigid[:, np.arange(m), np.arange(m)] = acceleration
    for i, motor in enumerate(robot.shared):
        rigid[:, :, m + i] = np.outer(acceleration @ turns[motor], turns[motor])
    names = (*rotors, *motors)
    base = BaseParameters(names, names, np.arange(len(names)), np.eye(len(names)))
    return replace(rows, base=base, rigid=rigid, effort=rows.effort - stated)


def _notes(rows: TreeRows, choice: FamilyChoice, model: TreeModel) -> tuple[str, ...]:
    """Return sentences about the chosen friction terms and ripple."""
    said = [
        f"{rows.robot.names[x.joint]} has the friction term {x.term.replace('_', ' ')}: it reduces the squared error "
        f"on held-out segments by {x.saved:.1f} % (p = {x.p_value:.2g})"
        for x in choice.taken
    ]
    said += [
        f"{rows.robot.names[x.motor]} has a ripple of {x.order:.1f} periods a turn of its joint" for x in model.ripples
    ]
    return tuple(said)
