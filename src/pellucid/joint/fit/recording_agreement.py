r"""Find recordings of one joint that disagree: compare each recording's own estimate with that from all the others.

Both estimates are linearised at the joint fit. A difference counts if it exceeds `MIN_BODY_STANDARD_ERRORS` standard
errors of both, which allow for coloured residuals, and a share `MIN_RELATIVE_DIFFERENCE` of the value. Inertia and
weight belong to the body and should not change. Friction depends on the motion, so an incomplete model finds different
friction in different motions; stricter thresholds apply to it. The fitted recording that differs most is removed before
the others are compared again, because a wrong recording also distorts the reference for the right ones. Of two fitted
recordings neither can be told to be the wrong one. A held-out recording is compared with the fitted ones that are left,
or with each of two that contradict each other, and is no part of the reference for any other. The zero of the angle is
free, so a recording with a different encoder zero is recognised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.joint import GRAVITY, JointModel
from ...numerics.block_test import MIN_IMPROVEMENT
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, nearest_feasible, reduce_motions, regression_rows, stack
from ...numerics.uncertainty import correlation_length, sandwich_covariance
from .angle_zero import has_free_gravity, with_free_zero
from .friction_solver import cross_validated_residuals

BODY_PARAMETERS = frozenset({"inertia", "gravity", "gravity_cosine"})
"""Parameters of the moving body; the others are friction and the offset."""

MIN_BODY_STANDARD_ERRORS = 5.0
"""A body parameter must differ by more than this many standard errors. The threshold is high because all parameters of
many recordings are tested."""

MIN_RELATIVE_DIFFERENCE = 1.0 / 3.0
"""A parameter must differ by more than this share of the larger of its two values."""

MIN_COSINE_DIFFERENCE = np.sin(np.radians(8.0))
"""The cosine term of gravity must differ by more than this share of the weight, which is a turn of 8 degrees."""

MIN_BODY_EFFORT_SHARE = 0.1
"""A body parameter's difference must change the effort by more than this share of the recording's RMS effort."""

MIN_FRICTION_STANDARD_ERRORS = 8.0
"""A friction parameter must differ by more than this many standard errors. Chosen by judgement; no measurement is
recorded."""

MIN_FRICTION_EFFORT_SHARE = 0.25
"""A friction parameter's difference must change the effort by more than this share of the recording's RMS effort.
Chosen by judgement; no measurement is recorded."""

MIN_INDEPENDENT_SAMPLES = 2.0
"""A recording has an estimate of its own only with at least this many independent samples per parameter."""

MAX_CONDITION_NUMBER = 50.0
"""A recording has no estimate of its own if the condition number of its scaled regressor exceeds this."""


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
    if len(w) <= w.shape[1] or not norms.all() or np.linalg.cond(w / norms) > MAX_CONDITION_NUMBER:
        return None
    step = np.linalg.lstsq(w / norms, e, rcond=None)[0] / norms
    residual = e - w @ step
    if len(residual) / correlation_length(residual) < MIN_INDEPENDENT_SAMPLES * w.shape[1]:
        return None
    lengths = [n for p in parts for n in p.lengths]
    return (step, sandwich_covariance(w, residual, lengths), residual) if max(lengths) > 20 else None


def _compare(
    part: RecordingRows, others: Sequence[RecordingRows], names: Sequence[str], values: np.ndarray
) -> tuple[float, Disagreement] | None:
    """Compare a recording with the others; return the significance and the disagreement, or None if they agree."""
    one, rest = estimate_step([part]), estimate_step(others)
    if one is None or rest is None:
        return None
    own, other = values + one[0], values + rest[0]
    own_sd, other_sd = (np.sqrt(np.maximum(np.diag(x[1]), 0.0)) for x in (one, rest))
    apart = np.abs(own - other)
    sure = apart / np.maximum(np.hypot(own_sd, other_sd), np.finfo(float).tiny)
    shows = apart * np.linalg.norm(part.w, axis=0) / np.linalg.norm(part.y)
    size = np.maximum(np.abs(own), np.abs(other))
    weight = [i for i, n in enumerate(names) if n in ("gravity", "gravity_cosine")]
    size[weight] = np.linalg.norm(size[weight])  # a shifted encoder zero turns one into the other
    large = (
        apart > np.where([n == "gravity_cosine" for n in names], MIN_COSINE_DIFFERENCE, MIN_RELATIVE_DIFFERENCE) * size
    )
    body = np.array([n in BODY_PARAMETERS for n in names])
    least = np.where(body, MIN_BODY_STANDARD_ERRORS, MIN_FRICTION_STANDARD_ERRORS)
    told = large & (sure > least) & (shows > np.where(body, MIN_BODY_EFFORT_SHARE, MIN_FRICTION_EFFORT_SHARE))
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
    from scipy.special import chdtrc

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
    p_values = chdtrc(len(parts) - 1, excess)
    values = np.tile(found.values, (len(parts), 1))
    values[:, free] += own
    spread, told = np.zeros(len(names)), np.zeros(len(names), bool)
    spread[free] = between
    told[free] = (p_values < (1.0 - level) / free.sum()) & (improvement >= MIN_IMPROVEMENT)
    return RecordingDrift(tuple(names), tuple(p.recording for p in parts), values, spread, told, improvement)


def _improvement(parts: Sequence[RecordingRows]) -> float:
    """Return the share of the error on blocks left out that parameters by recording save."""
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


def least_inertia(model: JointModel, values: np.ndarray, mass: float) -> float:
    """Return the smallest inertia about the axis that a body with the model's gravity can have [kg*m^2].

    `values` has shape (p,); `mass` is the moving mass [kg].
    """
    free = dict(zip(model.names, values, strict=True))
    amplitude2 = sum(free.get(n, model.known.get(n, 0.0)) ** 2 for n in ("gravity", "gravity_cosine"))
    return float(amplitude2 / (mass * GRAVITY**2))


def enforce_pseudo_inertia(
    model: JointModel, data: Stack[Motion], found: Solution, mass: float
) -> tuple[Solution, tuple[str, ...]]:
    """Move the least-squares solution `found` to the nearest physically consistent one, in the metric of its residuals.

    The body has at most `mass` [kg]. Returns the solution, and a note if it was moved.
    """
    if "inertia" not in model.names or model.motion != "rotary" or model.effort_unit != "N*m":
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
    note = f"inertia is held at the least that {mass:g} kg with this gravity torque can have"
    return replace(found, values=values, jacobian=jacobian, residual=residual, at_bound=at_bound), (note,)
