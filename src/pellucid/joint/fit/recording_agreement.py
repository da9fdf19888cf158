r"""Changes of a joint within and between its recordings: encoder zero, drifts, contradictions, possible bodies.

The zero error of an encoder follows from gravity. A body that hangs at zero is turned by :math:`g\sin q`. With the
encoder's zero elsewhere the angle is :math:`q + \varphi`, and

.. math::  g\sin(q + \varphi) = g_s\sin q + g_c\cos q, \qquad \varphi = \operatorname{atan2}(g_c, g_s)

so that a fit with both terms free gives :math:`\varphi` with its interval.

A drift within a recording, as that of a gear that warms up, shows in its residual over time.

Each recording's own estimate is compared with that from all the others. Both estimates are linearised at the joint fit.
A difference counts if it exceeds some standard errors of both (`AGREEMENT_THRESHOLDS`), which allow for coloured
residuals, and a share of the value. Inertia and weight belong to the body and should not
change. Friction depends on the motion, so an incomplete model finds different friction in different motions; stricter
thresholds apply to it. The fitted recording that differs most is removed before the others are compared again, because
a wrong recording also distorts the reference for the right ones. Of two fitted recordings neither can be told to be the
wrong one. A held-out recording is compared with the fitted ones that are left, or with each of two that contradict each
other, and is no part of the reference for any other. The zero of the angle is free, so a recording with a different
encoder zero is recognised.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import GRAVITY, SYMBOLS_BY_NAME, JointModel
from ...numerics.block_test import MIN_IMPROVEMENT, compare_held_out
from ...numerics.distributions import chi_square_tail, normal_quantile
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, nearest_feasible, reduce_motions, regression_rows, stack
from ...numerics.uncertainty import correlation_length, sandwich_covariance
from .discrepancy import Discrepancy
from .friction_solver import cross_validated_residuals, solve_family

GRAVITY_NAMES = ("gravity", "gravity_cosine")
"""Parameters whose root sum of squares is the gravity torque."""


@dataclass(frozen=True)
class AgreementThresholds:
    """Thresholds above which a recording contradicts the others."""

    # A body parameter must differ by more than this many standard errors. The threshold is high because all parameters
    # of many recordings are tested.
    min_body_standard_errors: float = 5.0
    # A parameter must differ by more than this share of the larger of its two values.
    min_relative_difference: float = 1.0 / 3.0
    # A body parameter's difference must change the effort by more than this share of the recording's RMS effort.
    min_body_effort_share: float = 0.1
    # A friction parameter must differ by more than this many standard errors. Chosen by judgement; no measurement is
    # recorded.
    min_friction_standard_errors: float = 8.0
    # A friction parameter's difference must change the effort by more than this share of the recording's RMS effort.
    # Chosen by judgement; no measurement is recorded.
    min_friction_effort_share: float = 0.25
    # A recording has an estimate of its own only with at least this many independent samples per parameter.
    min_independent_samples: float = 2.0
    # A recording has no estimate of its own if the condition number of its scaled regressor exceeds this.
    max_condition_number: float = 50.0


AGREEMENT_THRESHOLDS = AgreementThresholds()


@dataclass(frozen=True)
class AngleZero:
    """Zero error of an encoder, with a test on left-out blocks."""

    angle: float  # angle to add to the encoder's reading [rad]
    standard_error: float  # standard error of `angle` [rad]
    gravity: float  # amplitude of gravity with the corrected zero, in the effort's unit
    p_value: float  # p value of the hypothesis that the corrected zero predicts effort no better
    before: float  # RMS effort error with the recorded zero
    after: float  # RMS effort error with the corrected zero


def has_free_gravity(model: JointModel) -> bool:
    """Return whether gravity is a free parameter of `model`, so that the zero can be estimated."""
    return "gravity" in model.names and not set(GRAVITY_NAMES) & set(model.known)


def with_free_zero(model: JointModel) -> JointModel:
    """Return the model with both terms of gravity free."""
    free = tuple(SYMBOLS_BY_NAME[n] for n in GRAVITY_NAMES)
    rest = tuple(s for s in model.symbols if s not in free)
    return replace(model, symbols=(rest[0], *free, *rest[1:]))


def estimate_angle_zero(model: JointModel, data: Stack[Motion]) -> AngleZero:
    """Estimate the encoder's zero error by fitting `model` to `data` with both terms of gravity free.

    The correction is tested on blocks of `data` that are predicted from the others.
    """
    free = with_free_zero(model)
    tied = replace(free, symbols=tuple(s for s in free.symbols if s.name != "gravity_cosine"))
    fits = {name: solve_family(each, data, consistent=False) for name, each in (("free", free), ("tied", tied))}
    found = fits["free"]
    at = [free.names.index(n) for n in GRAVITY_NAMES]
    sine, cosine = found.values[at]
    covariance = sandwich_covariance(found.jacobian, found.residual, data.lengths)[np.ix_(at, at)]
    size = float(np.hypot(sine, cosine))
    slope = np.array([-cosine, sine]) / size**2
    judged = compare_held_out({name: cross_validated_residuals(fit, data.lengths) for name, fit in fits.items()})
    return AngleZero(
        angle=float(np.arctan2(cosine, sine)),
        standard_error=float(np.sqrt(max(slope @ covariance @ slope, 0.0))),
        gravity=size,
        p_value=judged.p_values["tied"] if judged.winner == "free" else 1.0,
        before=judged.errors["tied"],
        after=judged.errors["free"],
    )


BLOCK_COUNT = 8
"""A recording is divided into this many blocks of time."""

MIN_ROWS_PER_BLOCK = 20
"""Smallest number of rows in a block that tell its friction."""


@dataclass(frozen=True)
class FrictionDrift:
    """Change of the friction level over one recording."""

    change: float  # friction at its end minus friction at its start, by a straight line [N m or N]
    standard_error: float  # standard error of the change, from the blocks' scatter about the line [N m or N]

    @property
    def z_value(self) -> float:
        """The change over its standard error."""
        return self.change / self.standard_error if self.standard_error > 0.0 else 0.0


def find_friction_drift(time: np.ndarray, velocity: np.ndarray, residual: np.ndarray) -> FrictionDrift | None:
    """Return how much the friction level changes over a recording; None if it is too short to tell.

    Parameters
    ----------
    time, velocity, residual : ndarray, shape (n,) each
        Time [s], velocity [rad/s or m/s], and measured minus predicted effort [N m or N], without rows at rest.
    """
    edges = np.linspace(time[0], time[-1], BLOCK_COUNT + 1) if len(time) else np.zeros(1)
    centres, levels = [], []
    for low, high in pairwise(edges.tolist()):
        inside = (time >= low) & (time <= high)
        way = np.sign(velocity[inside])
        # With both directions a constant residual does not look like friction.
        if min(int(np.sum(way > 0.0)), int(np.sum(way < 0.0))) < MIN_ROWS_PER_BLOCK:
            continue
        centres.append(0.5 * (low + high))
        levels.append(0.5 * (residual[inside][way > 0.0].mean() - residual[inside][way < 0.0].mean()))
    if len(levels) < BLOCK_COUNT // 2:
        return None
    x = np.array(centres) - np.mean(centres)
    y = np.array(levels)
    slope = float(x @ y / (x @ x))
    off = y - y.mean() - slope * x
    error = float(np.sqrt(off @ off / max(len(x) - 2, 1) / (x @ x)))
    span = float(time[-1] - time[0])
    return FrictionDrift(slope * span, error * span)


DRIFT_CAUSE = "a drift within recordings"
"""Cause that is stated where a drift adds most to a parameter's interval."""

MAX_ROWS = 50_000
"""Rows beyond this number are thinned; a drift is slow."""

MIN_ROWS_PER_PARAMETER = 50
"""Smallest number of rows for each parameter, from which a drift is estimated."""


@dataclass(frozen=True)
class ParameterDrift:
    """Changes of parameters from the start to the end of the recordings."""

    names: tuple[str, ...]  # parameters, p of them
    change: np.ndarray  # mean change from start to end of a recording, (p,), SI
    standard_error: np.ndarray  # its standard error, (p,), SI
    is_told: np.ndarray  # mask of the parameters that drift, (p,)
    improvement: float  # share of the error on blocks left out that drifts save

    @property
    def covariance(self) -> np.ndarray:
        """What the drift adds to the parameters' covariance, (p, p)."""
        return np.diag(np.where(self.is_told, np.square(self.change) / 4.0, 0.0))


def find_parameter_drift(
    names: Sequence[str], found: Solution, data: Stack[Motion], level: float = 0.95
) -> ParameterDrift | None:
    """Return the drift of the parameters of the solution `found` on `data`; None if there are too few rows.

    Parameters that have no effect do not drift. `level` is the confidence level for all parameters together.
    """
    step = max(1, -(-len(found.residual) // MAX_ROWS))
    ends = np.cumsum(data.lengths)[:-1]
    kept = np.concatenate([at[::step] for at in np.split(np.arange(len(found.residual)), ends)])
    lengths = [-(-n // step) for n in data.lengths]
    weights = found.weights[kept]
    w, residual = found.jacobian[kept] * weights[:, None], found.residual[kept] * weights
    norms = np.linalg.norm(w, axis=0)
    free = (norms > 1e-12 * norms.max()) & ~found.at_bound
    p = int(free.sum())
    if len(residual) < 2 * MIN_ROWS_PER_PARAMETER * max(p, 1) or not np.any(residual):
        return None
    w = w[:, free]
    both = np.hstack([w, w * shares_of_time(data)[kept, None]])
    scale = np.linalg.norm(both, axis=0)
    if not np.all(scale > 0.0):
        return None
    both = both / scale
    one = np.ones(len(residual))
    steps = np.linalg.lstsq(both, residual, rcond=1e-10)[0]
    with_drift = Solution(steps, both, residual - both @ steps, one, np.zeros(2 * p, bool), 1, True)
    plain_steps = np.linalg.lstsq(both[:, :p], residual, rcond=1e-10)[0]
    plain = Solution(plain_steps, both[:, :p], residual - both[:, :p] @ plain_steps, one, np.zeros(p, bool), 1, True)
    errors = [
        float(np.linalg.norm(np.concatenate(cross_validated_residuals(each, lengths)))) for each in (plain, with_drift)
    ]
    improvement = 1.0 - errors[1] / errors[0] if errors[0] > 0.0 else 0.0
    covariance = sandwich_covariance(both, with_drift.residual, lengths)
    change, error = np.zeros(len(names)), np.full(len(names), np.inf)
    change[free] = (steps / scale)[p:]
    error[free] = np.sqrt(np.maximum(np.diag(covariance), 0.0))[p:] / scale[p:]
    times = normal_quantile(1.0 - 0.5 * (1.0 - level) / p)
    told = (np.abs(change) > times * error) & (improvement >= MIN_IMPROVEMENT)
    return ParameterDrift(tuple(names), change, error, told, improvement)


def add_drift(discrepancy: Discrepancy, drift: np.ndarray, drift_cause: str = DRIFT_CAUSE) -> Discrepancy:
    """Return the discrepancy with what a `drift` adds to the covariance, (p, p), of the same parameters."""
    before, added = np.diag(discrepancy.covariance), np.diag(drift)
    causes = tuple(
        drift_cause if more > usual else cause
        for cause, usual, more in zip(discrepancy.causes, before, added, strict=True)
    )
    return replace(discrepancy, covariance=discrepancy.covariance + drift, causes=causes)


MAX_HALVES_RATIO = 1.5
"""RMS speeds of the halves of a recording have at most this ratio, where a drift is to be told from them."""


def shares_of_time(data: Stack[Motion]) -> np.ndarray:
    """Return the time of all rows from -1/2 at the start of their recording to 1/2 at its end, (m,).

    It is 0 throughout a recording whose speeds change along it; see `centred_time`.
    """
    known, motions = vars(data), data.motions

    def span_of(name: str) -> tuple[float, float] | None:
        return steady_span(lambda: ((m.time, m.velocity) for m in motions if m.recording == name))

    if "_shares_of_time" not in known:  # computed once, because no model of these recordings changes it
        spans = {name: span_of(name) for name in {m.recording for m in motions}}
        shares = [centred_time(m.states[:, 0], spans[m.recording]) for m in motions]
        known["_shares_of_time"] = np.concatenate(shares)
    return known["_shares_of_time"]


def steady_span(parts: Callable[[], Iterable[tuple[np.ndarray, np.ndarray]]]) -> tuple[float, float] | None:
    """Return the first and the last time of a recording; None where speeds change along it, as those of a chirp.

    `parts` gives the times and speeds of all its samples, two arrays of shape (k,) for each stretch. It is called
    again, so that one stretch at a time is in memory.
    """
    first, last = np.inf, -np.inf
    for time, _ in parts():
        first, last = min(first, float(time.min())), max(last, float(time.max()))
    sums, counts = [0.0, 0.0], [0, 0]
    for time, speeds in parts():
        is_late = time > 0.5 * (first + last)
        for half, samples in enumerate((speeds[is_late], speeds[~is_late])):
            sums[half] += float(samples @ samples)
            counts[half] += len(samples)
    means = [total / count for total, count in zip(sums, counts, strict=True) if count]
    return None if max(means) > MAX_HALVES_RATIO**2 * min(means) else (first, last)


def centred_time(time: np.ndarray, span: tuple[float, float] | None) -> np.ndarray:
    """Return times, (n,), from -1/2 at the start of a recording to 1/2 at its end; (n,).

    `span` is that of `steady_span`. The result is 0 without one: what changes with time cannot be told there from what
    changes with speed.
    """
    if span is None:
        return np.zeros(len(time))
    first, last = span
    return (time - first) / max(last - first, np.finfo(float).tiny) - 0.5


BODY_PARAMETERS = frozenset({"inertia", *GRAVITY_NAMES})
"""Parameters of the moving body; the others are friction and the offset."""

MIN_COSINE_DIFFERENCE = np.sin(np.radians(8.0))
"""The cosine term of gravity must differ by more than this share of the weight, which is a turn of 8 degrees."""


@dataclass(frozen=True)
class Disagreement:
    """A recording whose parameters contradict those of the others."""

    recording: str
    split: str
    own: dict[str, tuple[float, float]]  # its own value and standard error of each contradicting parameter
    others: dict[str, tuple[float, float]]  # value and standard error from the other recordings
    together: dict[str, float]  # value from all recordings together
    scale: float  # factor on the effort that alone makes the others' model fit this recording; nan if none does
    turned: float = float("nan")  # angle from the others' zero to its own [rad]; nan without gravity


@dataclass(frozen=True)
class RecordingRows:
    """Regression rows of one recording."""

    recording: str
    split: str
    w: np.ndarray  # regressor, (n, p)
    e: np.ndarray  # residual of the joint fit, (n,)
    y: np.ndarray  # measured effort, (n,)
    lengths: list[int]  # rows of each stretch


def find_disagreements(model: JointModel, values: np.ndarray, motions: Sequence[Motion]) -> tuple[Disagreement, ...]:
    """Find recordings among `motions` that contradict the others, by a `model` with `values`, (p,).

    The fitted ones come first, the worst of them before the others; held-out ones are compared with fitted ones only.
    """
    fitted, judged = ([m for m in motions if m.split == split] for split in ("fitted", "heldout"))
    data = stack(fitted)
    start = dict(zip(model.names, values, strict=True))
    model = with_free_zero(model) if has_free_gravity(model) else model
    values = np.array([start.get(name, 0.0) for name in model.names])
    w, effort = regression_rows(model, values, data)
    active = np.linalg.norm(w, axis=0) > 0.0  # a Stribeck velocity without a level has no effect
    names = [n for n, a in zip(model.names, active, strict=True) if a]
    parts = _split_by_recording(fitted, data.lengths, w[:, active], data.target - effort, data.target)
    found: list[Disagreement] = []
    every = parts
    while len(parts) > 1:
        compared = [_compare(part, [p for p in parts if p is not part], names, values[active]) for part in parts]
        worst = max((c for c in compared if c is not None), key=lambda c: c[0], default=None)
        if worst is None:
            break
        found.append(worst[1])
        parts = [p for p in parts if p.recording != worst[1].recording]
    if judged:
        beside = reduce_motions(judged)
        w, effort = regression_rows(model, values, beside)
        own = _split_by_recording(judged, beside.lengths, w[:, active], beside.target - effort, beside.target)
        references = [[part] for part in every] if len(every) == 2 and found else [parts]
        nearest = []
        for part in own:
            against = [_compare(part, others, names, values[active]) for others in references]
            apart = [pair for pair in against if pair is not None]
            if len(apart) == len(references):
                nearest.append(min(apart, key=lambda pair: pair[0]))
        found += [disagreement for _, disagreement in sorted(nearest, key=lambda pair: -pair[0])]
    return tuple(found)


def _split_by_recording(
    motions: Sequence[Motion], lengths: Sequence[int], w: np.ndarray, e: np.ndarray, y: np.ndarray
) -> list[RecordingRows]:
    """Split the rows of a regression by recording."""
    owner = np.repeat([m.recording for m in motions], lengths)
    split = {m.recording: m.split for m in motions}
    made = []
    for name in split:
        mine = owner == name
        own = [n for n, m in zip(lengths, motions, strict=True) if m.recording == name]
        made.append(RecordingRows(name, split[name], w[mine], e[mine], y[mine], own))
    return made


def estimate_step(parts: Sequence[RecordingRows]) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the step of some recordings from the joint fit, (p,), its covariance, (p, p), and its residual, (n,).

    Returns None if the motion does not determine the parameters.
    """
    w, e = np.concatenate([p.w for p in parts]), np.concatenate([p.e for p in parts])
    norms = np.linalg.norm(w, axis=0)
    if len(w) <= w.shape[1] or not norms.all() or np.linalg.cond(w / norms) > AGREEMENT_THRESHOLDS.max_condition_number:
        return None
    step = np.linalg.lstsq(w / norms, e, rcond=None)[0] / norms
    residual = e - w @ step
    if len(residual) / correlation_length(residual) < AGREEMENT_THRESHOLDS.min_independent_samples * w.shape[1]:
        return None
    lengths = [n for p in parts for n in p.lengths]
    return (step, sandwich_covariance(w, residual, lengths), residual) if max(lengths) > 20 else None


def _step_from(part: RecordingRows, start: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return what `estimate_step` does of a recording that determines some combinations of parameters only.

    The others stay at `start`, (p,), so that a recording that moves little cannot contradict what it does not show.
    """
    norms = np.linalg.norm(part.w, axis=0)
    if len(part.w) <= part.w.shape[1] or not norms.all() or max(part.lengths) <= 20:
        return None
    _, sizes, ways = np.linalg.svd(part.w / norms, full_matrices=False)
    ways = ways[sizes > sizes[0] / AGREEMENT_THRESHOLDS.max_condition_number] / norms
    turned = part.w @ ways.T
    e = part.e - part.w @ start
    found = np.linalg.lstsq(turned, e, rcond=None)[0]
    residual = e - turned @ found
    if len(residual) / correlation_length(residual) < AGREEMENT_THRESHOLDS.min_independent_samples * len(ways):
        return None
    covariance = sandwich_covariance(turned, residual, part.lengths)
    return start + ways.T @ found, ways.T @ covariance @ ways, residual


def _compare(
    part: RecordingRows, others: Sequence[RecordingRows], names: Sequence[str], values: np.ndarray
) -> tuple[float, Disagreement] | None:
    """Compare a recording with the others; return the significance and the disagreement, or None if they agree."""
    rest = estimate_step(others)
    if rest is None:
        return None
    one = estimate_step([part]) or _step_from(part, rest[0])
    if one is None:
        return None
    own, other = values + one[0], values + rest[0]
    own_sd, other_sd = (np.sqrt(np.maximum(np.diag(x[1]), 0.0)) for x in (one, rest))
    apart = np.abs(own - other)
    sure = apart / np.maximum(np.hypot(own_sd, other_sd), np.finfo(float).tiny)
    shows = apart * np.linalg.norm(part.w, axis=0) / np.linalg.norm(part.y)
    size = np.maximum(np.abs(own), np.abs(other))
    weight = [i for i, n in enumerate(names) if n in GRAVITY_NAMES]
    size[weight] = np.linalg.norm(size[weight])  # a shifted encoder zero turns one into the other
    large = (
        apart
        > np.where(
            [n == "gravity_cosine" for n in names], MIN_COSINE_DIFFERENCE, AGREEMENT_THRESHOLDS.min_relative_difference
        )
        * size
    )
    body = np.array([n in BODY_PARAMETERS for n in names])
    least = np.where(
        body, AGREEMENT_THRESHOLDS.min_body_standard_errors, AGREEMENT_THRESHOLDS.min_friction_standard_errors
    )
    told = (
        large
        & (sure > least)
        & (
            shows
            > np.where(body, AGREEMENT_THRESHOLDS.min_body_effort_share, AGREEMENT_THRESHOLDS.min_friction_effort_share)
        )
    )
    if not told.any():
        return None

    def table(v: np.ndarray, sd: np.ndarray) -> dict[str, tuple[float, float]]:
        return {n: (float(v[i]), float(sd[i])) for i, n in enumerate(names) if told[i]}

    together = {n: float(values[i]) for i, n in enumerate(names) if told[i]}
    scale = _effort_scale(part, rest[0], one[2])
    turned = float(np.angle(np.exp(1j * (_zero_angle(names, own) - _zero_angle(names, other)))))
    found = Disagreement(
        part.recording, part.split, table(own, own_sd), table(other, other_sd), together, scale, turned
    )
    return float(np.max(np.where(told, sure / least, 0.0))), found


def _zero_angle(names: Sequence[str], values: np.ndarray) -> float:
    """Return the angle of the encoder's zero from the terms of gravity [rad]; nan without both terms."""
    found = dict(zip(names, values, strict=True))
    return float(np.arctan2(found.get("gravity_cosine", np.nan), found.get("gravity", np.nan)))


def _effort_scale(part: RecordingRows, step: np.ndarray, own_residual: np.ndarray) -> float:
    """Return the factor on the others' modelled effort that fits this recording; nan if no factor makes it fit."""
    predicted = part.y - part.e + part.w @ step
    factor = float(predicted @ part.y / (predicted @ predicted))
    left = np.linalg.norm(part.y - factor * predicted)
    return factor if left < 1.5 * np.linalg.norm(own_residual) else float("nan")


RECORDING_DRIFT_CAUSE = "a drift between recordings"
"""Cause that is stated where the spread between recordings adds most to a parameter's interval."""


@dataclass(frozen=True)
class RecordingDrift:
    """Parameters by recording, and how far they spread beyond their errors."""

    names: tuple[str, ...]  # parameters, p of them
    recordings: tuple[str, ...]  # recordings with estimates of their own, r of them
    values: np.ndarray  # estimates of each recording, (r, p), SI
    spread: np.ndarray  # standard deviation between recordings beyond the estimates' own errors, (p,), SI
    is_told: np.ndarray  # mask of the parameters that differ, (p,)
    improvement: float  # share of the error on blocks left out that parameters by recording save

    @property
    def covariance(self) -> np.ndarray:
        """What the spread adds to the parameters' covariance, (p, p)."""
        return np.diag(np.where(self.is_told, np.square(self.spread), 0.0))


def find_recording_drift(
    names: Sequence[str], found: Solution, data: Stack[Motion], *, neglected: np.ndarray, level: float = 0.95
) -> RecordingDrift | None:
    """Return the parameters by recording of the solution `found` on `data`.

    `neglected`, (p, p), is the covariance that allows for what the model neglects. Parameters on a bound or without an
    effect do not differ. `level` is the confidence level for all parameters
    together. Returns None where fewer than two recordings determine their parameters.
    """
    owner = [m.recording for m in data.motions]
    if len(set(owner)) < 2:
        return None
    weights = found.weights[:, None]
    w, residual = found.jacobian * weights, found.residual * found.weights
    norms = np.linalg.norm(w, axis=0)
    free = (norms > 1e-12 * norms.max()) & ~found.at_bound
    if not free.any() or not np.any(residual):
        return None
    rows = np.repeat(owner, data.lengths)
    parts, steps, variances = [], [], []
    for name in dict.fromkeys(owner):
        mine = rows == name
        lengths = [n for n, own in zip(data.lengths, owner, strict=True) if own == name]
        part = RecordingRows(name, "fitted", w[mine][:, free], residual[mine], residual[mine], lengths)
        step = estimate_step([part])
        if step is not None and np.all(np.diag(step[1]) > 0.0):
            parts.append(part)
            steps.append(step[0])
            variances.append(np.diag(step[1]) + np.diag(neglected)[free])
    if len(parts) < 2:
        return None
    own, variance = np.array(steps), np.array(variances)
    precision = 1.0 / variance
    mean = (own * precision).sum(axis=0) / precision.sum(axis=0)
    excess = (precision * (own - mean) ** 2).sum(axis=0)
    usual = precision.sum(axis=0) - (precision**2).sum(axis=0) / precision.sum(axis=0)
    between = np.sqrt(np.maximum(excess - (len(parts) - 1), 0.0) / usual)
    improvement = _improvement(parts)
    p_values = np.array([chi_square_tail(len(parts) - 1, each) for each in excess])
    values = np.tile(found.values, (len(parts), 1))
    values[:, free] += own
    spread, told = np.zeros(len(names)), np.zeros(len(names), bool)
    spread[free] = between
    told[free] = (p_values < (1.0 - level) / free.sum()) & (improvement >= MIN_IMPROVEMENT)
    return RecordingDrift(tuple(names), tuple(p.recording for p in parts), values, spread, told, improvement)


def _improvement(parts: Sequence[RecordingRows]) -> float:
    """Return the share by which separate parameters for each recording reduce the cross-validated error."""
    errors = [_error_without_blocks(parts), float(np.linalg.norm([_error_without_blocks([p]) for p in parts]))]
    return 1.0 - errors[1] / errors[0] if errors[0] > 0.0 else 0.0


def _error_without_blocks(parts: Sequence[RecordingRows]) -> float:
    """Return the norm of the residuals of blocks that are predicted from the others of the same recordings."""
    w, e = np.concatenate([p.w for p in parts]), np.concatenate([p.e for p in parts])
    step = np.linalg.lstsq(w, e, rcond=1e-10)[0]
    solution = Solution(step, w, e - w @ step, np.ones(len(e)), np.zeros(w.shape[1], bool), 1, True)
    lengths = [n for p in parts for n in p.lengths]
    return float(np.linalg.norm(np.concatenate(cross_validated_residuals(solution, lengths))))


RELINEARISATION_COUNT = 4
"""Number of relinearisations of a nonlinear model. A model that is linear in its parameters needs one."""


class StatedValueError(IdentificationError):
    """A value that is stated of the joint contradicts its recordings, or leaves nothing to estimate."""


def least_inertia(model: JointModel, values: np.ndarray, mass: float) -> float:
    """Return the smallest inertia about the axis that a body with the model's gravity can have [kg*m^2].

    `values` has shape (p,); `mass` is the moving mass [kg].
    """
    free = dict(zip(model.names, values, strict=True))
    amplitude2 = sum(free.get(n, model.known.get(n, 0.0)) ** 2 for n in GRAVITY_NAMES)
    return float(amplitude2 / (mass * GRAVITY**2))


def require_possible_mass(
    model: JointModel, values: np.ndarray, covariance: np.ndarray, mass: float, level: float
) -> None:
    """Refuse a moving `mass` [kg] that an estimate without this limit contradicts.

    `values`, (p,), and `covariance`, (p, p), are those of the estimate. A body with that mass and gravity must have an
    inertia that exceeds the estimated one by more than the interval of their difference at `level`. A limit that is
    enforced all the same falsifies gravity and friction.
    """
    at, least = model.names.index("inertia"), least_inertia(model, values, mass)
    of_gravity = np.array([name in GRAVITY_NAMES for name in model.names])
    slope = np.where(of_gravity, -2.0 * values / (mass * GRAVITY**2), 0.0)
    slope[at] = 1.0
    missing = least - values[at]
    if missing <= normal_quantile(0.5 + 0.5 * level) * np.sqrt(slope @ covariance @ slope):
        return
    expected = f"at least {mass * least / values[at]:.3g} kg" if values[at] > 0.0 else "a larger one"
    raise StatedValueError(
        f"moving_mass: found {mass:g} kg, expected {expected}: with the estimated gravity of "
        f"{np.sqrt(least * mass) * GRAVITY:.3g} N*m, a body of {mass:g} kg has an inertia of at least {least:.3g} "
        f"kg*m^2, and the recordings show {values[at]:.3g} kg*m^2; correct the mass, or the gear ratio or constant of "
        "the drive"
    )


def is_pseudo_inertia_bounded(model: JointModel) -> bool:
    """Return whether a mass bounds the inertia of a model: that of a rotary joint whose effort is known in SI."""
    return "inertia" in model.names and model.motion == "rotary" and model.effort_unit == "N*m"


def enforce_pseudo_inertia(
    model: JointModel, data: Stack[Motion], found: Solution, mass: float
) -> tuple[Solution, tuple[str, ...]]:
    """Move the least-squares solution `found` to the nearest physically consistent one, in the metric of its residuals.

    The body has at most `mass` [kg]. Returns the solution, and a note if it was moved.
    """
    if not is_pseudo_inertia_bounded(model):
        return found, ()
    i = model.names.index("inertia")
    if found.values[i] >= least_inertia(model, found.values, mass):
        return found, ()
    values, jacobian, residual = found.values, found.jacobian, found.residual
    w, least = found.weights, max(least_inertia(model, found.values, mass), np.finfo(float).tiny)

    def room(x: np.ndarray) -> float:
        return (x[i] - least_inertia(model, x, mass)) / least

    for _ in range(1 if model.linear else RELINEARISATION_COUNT):
        values = nearest_feasible(jacobian * w[:, None], residual * w, values, model.bounds(), room, values)[0]
        jacobian, effort = regression_rows(model, values, data)
        residual = data.target - effort
    at_bound = found.at_bound.copy()
    at_bound[i] = True
    note = f"inertia is at its lower bound for a mass of {mass:g} kg with this gravity torque"
    return replace(found, values=values, jacobian=jacobian, residual=residual, at_bound=at_bound), (note,)
