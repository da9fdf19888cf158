r"""Causes of a joint model's residual: effects that exoskeletons have, each tested by cross-validation.

A cause adds columns to the regression of a friction family: a parallel spring adds the position, friction that changes
along the travel adds products of both, and so on. Ten segments of the fitted recordings are each predicted from the
others, with and without these columns [1]_. A cause is reported if its columns reduce the squared error by a required
share and a paired test over blocks finds the reduction significant. Backlash is also reported without such a column:
parts separated by a gap rattle, and the error is larger around reversals of the load.

Errors of friction look like many causes. The model that is extended therefore has load friction, columns of all
friction that a family may lack (`NEGLECTED_EFFECTS`) and pulses where it turns, and samples near standstill are
excluded. Load friction is a parameter and no column: without it inertia and weight are estimated with an error, and so
is the load. Causes are taken one after another, the one that explains most first, and each is then part of the model
that the next one extends: of two that look alike over the recorded motion, only one is named.

Held-out recordings take no part.

.. [1] M. Stone, "Cross-validatory choice and assessment of statistical predictions", J. R. Statist. Soc. B 36, 1974.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.causes import (
    BACKLASH,
    DELAY,
    DRIFT,
    MISALIGNED_AXIS,
    PARALLEL_SPRING,
    POSITION_FRICTION,
    SATURATION,
    WARM_UP,
    Cause,
    ParallelSpring,
)
from ...models.estimates import Parameter
from ...models.friction_terms import grows_with_load
from ...models.joint import PARALLEL_STIFFNESS, SYMBOLS_BY_NAME, JointModel
from ...numerics.block_test import MIN_IMPROVEMENT, SIGNIFICANCE_LEVEL
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack
from .discrepancy import COMMON_LOAD_COEFFICIENT, NEGLECTED_EFFECTS, TWISTED_ANGLE
from .friction_solver import solve_family
from .joint_estimate import joint_states
from .left_out_stretches import TRAVEL_EFFECTS, LeftOutColumns, LeftOutStretches
from .spring_doubt import SPRING_SETTINGS
from .turning_friction import REVERSAL_TIMES_S, reversal_pulses


@dataclass(frozen=True)
class CauseThresholds:
    """Thresholds above which a cause is named.

    They were set on 400 plain and 196 spoilt joints of MuJoCo and Pinocchio with other seeds than those of
    `research/evidence/_causes.py`. Those of a spring are `SPRING_SETTINGS`.
    """

    min_share: float = 0.07  # Smallest share of the squared error on left-out stretches that a cause saves
    # Smallest share that it saves of the squared error of the model with load friction alone. Beside friction, a cause
    # may explain what a column of friction gets wrong.
    min_share_alone: float = 0.1
    # Smallest effort that a cause explains there, as a share of the root mean square effort. No friction law is more
    # accurate: on plain joints causes explained at most 0.0040, on spoilt ones at least 0.0084.
    min_effort_share: float = 0.006
    min_gap_range_share: float = 1e-3  # Smallest gap, as a share of the range of motion
    # Samples into which the filters carry speeds below this share of the root mean square speed are excluded.
    slow_speed_share: float = 0.05
    # Parts that a gap separates rattle around a reversal of the load, at these times from it [s]. No column predicts
    # that, but the squared error is larger there: 4.7 times and more in the median stretch of joints with a gap, at
    # most 2.0 times on plain ones and on those with another fault.
    rattle_times_s: tuple[float, float] = (-0.1, 0.3)
    min_rattle_ratio: float = 3.0
    # A gap that is smaller than the smallest one must explain this share: an effort that is held between samples also
    # leaves more around reversals, but little.
    min_rattle_share: float = 0.2
    # The range of effort that a sensor reads has this share of the samples beyond either end.
    limit_quantile: float = 0.002


CAUSE_THRESHOLDS = CauseThresholds()


def find_parallel_spring(model: JointModel, data: Stack[Motion]) -> ParallelSpring:
    """Find a spring in parallel to the drive of a joint, from segments of `data` that are predicted from the others.

    `model` is the one that is extended. One that has the stiffness, free or known, is not.
    """
    if PARALLEL_STIFFNESS in (*model.names, *model.known):
        return ParallelSpring()
    try:
        found = solve_family(model, data)
        stretches, reported = _stretches(model, data, found.values, SPRING_SETTINGS.slow_speed_share, found)
    except IdentificationError:
        return ParallelSpring()  # the fit that follows reports the error
    turning = stretches.columns(lambda m: reversal_pulses(m, m.velocity))
    return decide_parallel_spring(stretches, turning, _gap_columns(stretches), reported, "gravity" in model.names)


def decide_parallel_spring(
    stretches: LeftOutColumns,
    turning: Sequence[np.ndarray],
    gap: Sequence[np.ndarray],
    reported: float,
    has_gravity: bool,
    min_effort_share: float = 0.0,
) -> ParallelSpring:
    """Decide whether there is a spring in addition to errors of friction at reversals and to backlash.

    `turning` and `gap` are the columns, each (m,), of these two. `reported` is the mean square error of the model
    without load friction. `has_gravity` tells whether gravity is estimated, which a spring could falsify. The spring
    must explain at least `min_effort_share` of the root mean square effort.
    """
    stretches.add(turning)
    stretches.add(gap)
    position = [stretches.states.position]
    saved, p_value = stretches.saved(position)
    alone = stretches.share(position)
    least = SPRING_SETTINGS.min_saved_share if has_gravity else 1.0 - (1.0 - MIN_IMPROVEMENT) ** 2
    is_told = min(saved, alone) >= least and p_value <= SIGNIFICANCE_LEVEL
    # Hoses, cables and skin pull to their middle. A spring that pushes from it balances gravity, and is strong.
    if is_told and min(saved, alone) < SPRING_SETTINGS.min_needed_share:
        is_told = bool(stretches.coefficients(position)[0] > 0.0)
    if alone * stretches.own_error < min_effort_share**2 * float(np.mean(stretches.measured**2)):
        return ParallelSpring()
    if not is_told and not _needs_spring(stretches, position, [*turning, *gap]):
        return ParallelSpring()
    twist = [NEGLECTED_EFFECTS[TWISTED_ANGLE](stretches.states)]
    may_twist = False
    # The load turns the body against an encoder on the motor's side, and so lessens the weight that is felt there.
    if twist[0].any() and stretches.coefficients(twist)[0] < 0.0:
        (spring_adds, _), (twist_adds, p_value) = (
            stretches.saved_beyond(*pair) for pair in ((position, twist), (twist, position))
        )
        least = SPRING_SETTINGS.min_saved_share
        if twist_adds >= max(least, spring_adds) and p_value <= SIGNIFICANCE_LEVEL:
            return ParallelSpring()
        may_twist = spring_adds < least
    return ParallelSpring(True, min(alone * stretches.own_error / reported, 1.0), may_twist)


def spring_cause(spring: ParallelSpring, stiffness: Parameter, confidence: float, joint: str = "") -> Cause:
    """Return a spring that was found as a cause, with its estimated `stiffness` and its interval at a `confidence`."""
    low, high = stiffness.interval(confidence)
    half = 0.5 * (high - low) if stiffness.standard_error > 0.0 else float("nan")
    size, unit = float(stiffness.value), stiffness.unit
    return Cause(PARALLEL_SPRING, size, unit, spring.share, half, joint, spring.may_twist)


def _needs_spring(stretches: LeftOutColumns, position: Sequence[np.ndarray], few: Sequence[np.ndarray]) -> bool:
    """Whether a spring alone explains most of the error that all neglected effects together explain.

    Over a moderate range of angles, many columns resemble one stiffness. Without the term, the estimate of gravity
    would include it. With the term, the uncertainty of the stiffness widens the intervals (`spring_doubt`). The spring
    is compared with the model and a `few` columns.
    """
    saved, p_value = stretches.saved_beside(position, few)
    told = stretches.spring()
    if told is None or saved < SPRING_SETTINGS.min_needed_share:
        return False
    stiffness, error, _ = told
    least = 1.0 if p_value <= SIGNIFICANCE_LEVEL else SPRING_SETTINGS.found_standard_errors
    return stiffness > least * error


def _stretches(
    model: JointModel, data: Stack[Motion], values: np.ndarray, slow_speed_share: float, found: Solution | None = None
) -> tuple[LeftOutStretches, float]:
    """Return the segments of a `model` with `values`, (p,), and load friction, and the mean square error without it.

    `found` is the solution with these values, if there is one.

    Load friction shifts inertia and gravity, and so the load, which no additional column can correct.
    """

    def made(each: JointModel, at: np.ndarray, own: Solution | None) -> LeftOutStretches:
        return LeftOutStretches(each, data, at, joint_states(each, data, at), slow_speed_share, own)

    plain = made(model, values, found)
    if any(map(grows_with_load, (*model.names, *model.known))):
        return plain, plain.own_error
    richer = replace(model, symbols=(*model.symbols, SYMBOLS_BY_NAME[COMMON_LOAD_COEFFICIENT]))
    try:
        more = solve_family(richer, data)
        return made(richer, more.values, more), plain.own_error
    except IdentificationError:
        return plain, plain.own_error


def find_causes(
    model: JointModel, data: Stack[Motion], values: np.ndarray, delays: Mapping[str, float] | None = None
) -> tuple[Cause, ...]:
    """Return the causes of what a `model` with `values`, (p,), misses of `data`, the one that explains most first.

    `delays` are those that were corrected in `data` [s], by recording.
    """
    stretches, reported = _stretches(model, data, values, CAUSE_THRESHOLDS.slow_speed_share)
    # What friction misses where it turns would else be most of the error.
    stretches.add(stretches.columns(lambda m: reversal_pulses(m, m.velocity)))
    candidates = {name: columns for name, columns in _candidates(stretches) if columns}
    found = explain_residual(stretches, candidates, reported)
    if not any(cause.name == BACKLASH for cause in found):
        found += _rattle(stretches, reported)
    # A gap moves the effort against the position too.
    if delays and not any(cause.name == BACKLASH for cause in found):
        share, p_value = stretches.saved([], stretches.column(lambda m: _delayed(m, delays.get(m.recording, 0.0))))
        if _is_told(share, p_value):
            found.append(Cause(DELAY, max(delays.values(), key=abs), "s", share))
    return tuple(sorted(found, key=lambda cause: -cause.share))


def explain_residual(
    stretches: LeftOutColumns, candidates: Mapping[str, Sequence[np.ndarray]], reported: float
) -> list[Cause]:
    """Return the causes among `candidates`, columns by name, one after another, the one that explains most first.

    Each becomes part of the model that the next one extends. `reported` is the mean square error of the model without
    load friction.
    """
    left, found = dict(candidates), list[Cause]()
    while left:
        saved = {name: stretches.saved(columns) for name, columns in left.items()}
        name = max(saved, key=lambda each: saved[each][0])
        if not _is_told(*saved[name]):
            break
        columns = left.pop(name)
        cause = _cause(name, columns, stretches, reported)
        if cause is not None:
            found.append(cause)
            stretches.add(columns)
    return found


def _delayed(motion: Motion, delay: float) -> np.ndarray:
    """Return a motion's effort as it was recorded, before a `delay` was corrected [s]."""
    return np.interp(motion.time - delay, motion.time, motion.effort)


def _is_told(share: float, p_value: float) -> bool:
    return share >= CAUSE_THRESHOLDS.min_share and p_value <= SIGNIFICANCE_LEVEL


def _candidates(stretches: LeftOutStretches) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Yield the name of each cause that is sought, with its columns, each (m,)."""
    states, model = stretches.states, stretches.model
    yield POSITION_FRICTION, travel_columns(stretches)
    if model.motion == "rotary" and "gravity" in model.names:
        yield MISALIGNED_AXIS, [np.sin(2.0 * states.position), np.cos(2.0 * states.position)]
    yield BACKLASH, _gap_columns(stretches)
    yield SATURATION, excess_columns(stretches)
    yield DRIFT, drift_columns(stretches)


def travel_columns(stretches: LeftOutColumns) -> list[np.ndarray]:
    """Return the columns of friction that depends on the position."""
    return [NEGLECTED_EFFECTS[name](stretches.states) for name in TRAVEL_EFFECTS]


def _load(stretches: LeftOutStretches) -> Callable[[Motion], np.ndarray]:
    """Return the function that gives the load through the drive along a motion, (n,)."""
    bare = stretches.model.vector(stretches.values)

    def load(motion: Motion) -> np.ndarray:
        vector = stretches.model.loaded(bare, *motion.payload)
        return _core.load(vector, motion.position.copy(), motion.acceleration.copy())

    return load


def _gap_columns(stretches: LeftOutStretches) -> list[np.ndarray]:
    """Return pulses at times from every reversal of the load through the drive."""
    load = _load(stretches)
    return stretches.columns(lambda m: reversal_pulses(m, load(m)))


def _least_gap(stretches: LeftOutColumns) -> float:
    """Return the smallest gap that is named."""
    return CAUSE_THRESHOLDS.min_gap_range_share * float(np.ptp(stretches.states.position))


def _rattle(stretches: LeftOutStretches, reported: float) -> Iterator[Cause]:
    """Yield a backlash whose parts rattle: the residual is larger around reversals of the load.

    `reported` is the mean square error of the model without load friction.
    """
    load = _load(stretches)
    first, last = CAUSE_THRESHOLDS.rattle_times_s

    def near(motion: Motion) -> np.ndarray:
        reversals = np.flatnonzero(np.diff(np.sign(load(motion))) != 0.0)
        edges = np.zeros(len(motion.position) + 1)
        np.add.at(edges, np.clip(reversals + round(first * motion.fs), 0, len(edges) - 1), 1.0)
        np.add.at(edges, np.clip(reversals + round(last * motion.fs), 0, len(edges) - 1), -1.0)
        return (np.cumsum(edges[:-1]) > 0.0)[motion.kept]

    ratio, share = stretches.contrast(np.concatenate([near(m) for m in stretches.data.motions]))
    if ratio >= CAUSE_THRESHOLDS.min_rattle_ratio:
        size, unit = _gap_size(_gap_columns(stretches), stretches)
        if abs(size) < _least_gap(stretches) and share < CAUSE_THRESHOLDS.min_rattle_share:
            return
        yield Cause(BACKLASH, float("nan"), unit, min(share * stretches.error / reported, 1.0))


def excess_columns(stretches: LeftOutColumns) -> list[np.ndarray]:
    """Return by how much the modelled effort is beyond the range of the recorded one, above and below."""
    measured, modelled = stretches.measured, stretches.effort
    low, high = np.quantile(measured, [CAUSE_THRESHOLDS.limit_quantile, 1.0 - CAUSE_THRESHOLDS.limit_quantile])
    return [np.maximum(modelled - high, 0.0), np.minimum(modelled - low, 0.0)]


def drift_columns(stretches: LeftOutColumns, which: np.ndarray | None = None) -> list[np.ndarray]:
    """Return the columns of the parameters in a mask, (p,), times the time from start to end of each recording."""
    made = stretches.jacobian if which is None else stretches.jacobian[:, which]
    return list((made * stretches.time[:, None]).T)


def _cause(name: str, columns: Sequence[np.ndarray], stretches: LeftOutColumns, reported: float) -> Cause | None:
    """Return a cause that was found, with its size and share; None if it explains too little of the model alone.

    `reported` is the mean square error of the model without load friction.
    """
    if name == DRIFT:
        name, columns = _kind_of_drift(columns, stretches)
    size, unit = _SIZES[name](columns, stretches)
    least = _least_gap(stretches) if name == BACKLASH else 0.0
    alone = stretches.share(columns)
    explained = alone * stretches.own_error
    too_little = CAUSE_THRESHOLDS.min_effort_share**2 * float(np.mean(stretches.measured**2))
    if alone < CAUSE_THRESHOLDS.min_share_alone or abs(size) < least or explained < too_little:
        return None
    return Cause(name, float(size), unit, min(explained / reported, 1.0))


def _kind_of_drift(columns: Sequence[np.ndarray], stretches: LeftOutColumns) -> tuple[str, list[np.ndarray]]:
    """Return whether friction alone falls, by what the drift of all saves beyond it; and the columns of the drift."""
    friction = drift_columns(stretches, stretches.friction)
    alone, every = stretches.saved(friction)[0], stretches.saved(columns)[0]
    is_friction_alone = bool(friction) and every - alone < CAUSE_THRESHOLDS.min_share * (1.0 - alone)
    # Friction falls as a gear warms up. What rises is a drift of something else.
    is_warm_up = is_friction_alone and _warm_up_size(friction, stretches)[0] < 0.0
    return (WARM_UP, friction) if is_warm_up else (DRIFT, list(columns))


def _travel_friction_size(columns: Sequence[np.ndarray], stretches: LeftOutColumns) -> tuple[float, str]:
    """Return the range of friction along the recorded travel at the usual speed, and its unit."""
    along, amid, viscous = stretches.coefficients(columns)
    travel = stretches.states.travel
    speed = float(np.sqrt(np.mean(stretches.states.velocity**2)))
    low, high = np.quantile(travel, [0.05, 0.95])
    place = np.linspace(low, high, 21)
    return float(np.ptp((along + viscous * speed) * place + amid * place**2)), stretches.effort_unit


def _axis_size(columns: Sequence[np.ndarray], stretches: LeftOutStretches) -> tuple[float, str]:
    """Return the angle by which the axis of the encoder, or of gravity, makes the joint's angle err."""
    gravity = abs(float(stretches.values[stretches.model.names.index("gravity")]))
    # g sin(q + e sin(q + phase)) has the second harmonic g e / 2.
    return 2.0 * float(np.hypot(*stretches.coefficients(columns))) / max(gravity, np.finfo(float).tiny), "rad"


def _gap_size(columns: Sequence[np.ndarray], stretches: LeftOutStretches) -> tuple[float, str]:
    """Return the gap, from the shift of gravity's angle that it makes, or else from the effort's pulses."""
    unit = "rad" if stretches.model.motion == "rotary" else "m"
    pulses = stretches.coefficients(columns)
    names, values = stretches.model.names, stretches.values
    inertia = values[names.index("inertia")] if "inertia" in names else stretches.model.known.get("inertia", np.nan)
    # Twice over time the pulses are the inertia beyond the gap times the gap, which the link falls behind.
    moments = 2.0 * abs(float(pulses @ np.array(REVERSAL_TIMES_S))) / inertia
    if "gravity" not in names:
        return moments, unit
    side = stretches.states.cosine * np.sign(stretches.states.load)
    gravity = abs(float(values[names.index("gravity")]))
    shift = abs(float(stretches.coefficients([side, *columns])[0]))
    return 2.0 * shift / max(gravity, np.finfo(float).tiny), unit


def _limit_size(columns: Sequence[np.ndarray], stretches: LeftOutColumns) -> tuple[float, str]:
    """Return the limit of the effort that is reached more."""
    measured = stretches.measured
    quantile = CAUSE_THRESHOLDS.limit_quantile
    low, high = (float(x) for x in np.quantile(measured, [quantile, 1.0 - quantile]))
    above, below = (float(np.sum(each**2)) for each in columns)
    return (high if above >= below else low), stretches.effort_unit


def _drift_size(columns: Sequence[np.ndarray], stretches: LeftOutColumns) -> tuple[float, str]:
    """Return the change of the effort from start to end of a recording, as a share of the effort [%]."""
    change = np.column_stack(columns) @ stretches.coefficients(columns)
    # The change at time t is t times that from start to end, and t is even from -1/2 to 1/2.
    whole = float(np.sqrt(np.sum(change**2) / max(float(np.sum(stretches.time**2)), np.finfo(float).tiny)))
    return 100.0 * whole / float(np.sqrt(np.mean(stretches.measured**2))), "%"


def _warm_up_size(columns: Sequence[np.ndarray], stretches: LeftOutColumns) -> tuple[float, str]:
    """Return the change of friction from start to end of a recording, below 0 if it falls."""
    change = np.column_stack(columns) @ stretches.coefficients(columns)
    way = stretches.time * stretches.states.direction
    return float(change @ way) / max(float(way @ way), np.finfo(float).tiny), stretches.effort_unit


def _delay_size(columns: Sequence[np.ndarray], stretches: LeftOutColumns) -> tuple[float, str]:
    """Return the time by which the effort is late, from the column of its derivative."""
    return float(stretches.coefficients(columns)[0]), "s"


_SIZES: Mapping[str, Callable[..., tuple[float, str]]] = {
    POSITION_FRICTION: _travel_friction_size,
    MISALIGNED_AXIS: _axis_size,
    BACKLASH: _gap_size,
    SATURATION: _limit_size,
    DRIFT: _drift_size,
    WARM_UP: _warm_up_size,
    DELAY: _delay_size,
}
"""Function that gives the size of each cause, with its unit, from its columns."""
