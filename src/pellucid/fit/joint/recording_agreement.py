r"""Whether recordings of one joint agree: each recording's own estimate against that of all the others.

Both are linearised where the joint fit ended. A difference counts where it is sure, that is beyond `SURE` standard
errors of both (coloured residuals allowed for), and large: `LARGE` of the value. Inertia and weight are the body's,
whatever it does; friction depends on how it moves, so that a model which misses something finds other friction in
other motions: it must differ more, and by an effort that shows. The recording that differs most is set aside before the
others are compared again, since a false one spoils what the true ones are held against. The zero of the angle is free,
so that a recording whose encoder was set otherwise shows it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.joint import JointModel
from ...signals.correlation_length import correlation_length
from ...signals.motion import Motion
from ..regression import rows_of, stack
from ..uncertainty import sandwich
from .angle_zero import has_weight, with_free_zero

BODY = frozenset({"inertia", "gravity", "gravity_cosine"})
SURE = 5.0  # standard errors: far enough out for all parameters of many recordings
LARGE = 1.0 / 3.0  # share of the larger value
TURNED = np.sin(np.radians(8.0))  # share of the weight, as a cosine: the same by an angle
SHOWS = 0.1  # of a recording's RMS effort, that a difference of a body parameter must make
FRICTION_SURE, FRICTION_SHOWS = 8.0, 0.25
FEWEST = 2.0  # independent samples for each parameter, without which a recording has no estimate of its own
TIED = 50.0  # condition number, columns of equal length, above which it has none either


@dataclass(frozen=True)
class Disagreement:
    """A recording that contradicts the others: its `own` values, the `others'`, each with its standard error, by
    parameter; `scale`, the factor that alone makes the others' model fit it, or nan; `turned`, the angle from the
    others' zero to its own [rad], or nan."""

    recording: str
    split: str
    own: dict[str, tuple[float, float]]
    others: dict[str, tuple[float, float]]
    together: dict[str, float]
    scale: float
    turned: float = float("nan")


@dataclass(frozen=True)
class _Part:
    """Rows of one recording: `w` (n, p), `e` (n,) what the joint fit misses, `y` (n,) the effort."""

    recording: str
    split: str
    w: np.ndarray
    e: np.ndarray
    y: np.ndarray
    lengths: list[int]


def disagreements(model: JointModel, values: np.ndarray, motions: Sequence[Motion]) -> tuple[Disagreement, ...]:
    """Recordings among `motions` that contradict the others by a `model` with `values`, (p,), worst first."""
    data = stack(motions)
    start = dict(zip(model.names, values, strict=True))
    model = with_free_zero(model) if has_weight(model) else model
    values = np.array([start.get(name, 0.0) for name in model.names])
    w, effort = rows_of(model, values, data)
    active = np.linalg.norm(w, axis=0) > 0.0  # a Stribeck velocity without a level has no effect
    names = [n for n, a in zip(model.names, active, strict=True) if a]
    parts = _parts(motions, data.lengths, w[:, active], data.target - effort, data.target)
    found: list[Disagreement] = []
    while len(parts) > 1:
        compared = [_compared(part, [p for p in parts if p is not part], names, values[active]) for part in parts]
        worst = max((c for c in compared if c is not None), key=lambda c: c[0], default=None)
        if worst is None:
            break
        found.append(worst[1])
        parts = [p for p in parts if p.recording != worst[1].recording]
    return tuple(found)


def _parts(
    motions: Sequence[Motion], lengths: Sequence[int], w: np.ndarray, e: np.ndarray, y: np.ndarray
) -> list[_Part]:
    owner = np.repeat([m.recording for m in motions], lengths)
    split = {m.recording: m.split for m in motions}
    made = []
    for name in split:
        mine = owner == name
        own = [n for n, m in zip(lengths, motions, strict=True) if m.recording == name]
        made.append(_Part(name, split[name], w[mine], e[mine], y[mine], own))
    return made


def _estimate(parts: Sequence[_Part]) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Step from the joint fit, (p,), its covariance, (p, p), and residual, (n,); None where the motion cannot tell."""
    w, e = np.concatenate([p.w for p in parts]), np.concatenate([p.e for p in parts])
    norms = np.linalg.norm(w, axis=0)
    if len(w) <= w.shape[1] or not norms.all() or np.linalg.cond(w / norms) > TIED:
        return None
    step = np.linalg.lstsq(w / norms, e, rcond=None)[0] / norms
    residual = e - w @ step
    if len(residual) / correlation_length(residual) < FEWEST * w.shape[1]:
        return None
    lengths = [n for p in parts for n in p.lengths]
    return (step, sandwich(w, residual, lengths), residual) if max(lengths) > 20 else None


def _compared(
    part: _Part, others: Sequence[_Part], names: Sequence[str], values: np.ndarray
) -> tuple[float, Disagreement] | None:
    """How surely a recording contradicts the others, and in what; None where it does not."""
    one, rest = _estimate([part]), _estimate(others)
    if one is None or rest is None:
        return None
    own, other = values + one[0], values + rest[0]
    own_sd, other_sd = (np.sqrt(np.maximum(np.diag(x[1]), 0.0)) for x in (one, rest))
    apart = np.abs(own - other)
    sure = apart / np.maximum(np.hypot(own_sd, other_sd), np.finfo(float).tiny)
    shows = apart * np.linalg.norm(part.w, axis=0) / np.linalg.norm(part.y)
    size = np.maximum(np.abs(own), np.abs(other))
    weight = [i for i, n in enumerate(names) if n in ("gravity", "gravity_cosine")]
    size[weight] = np.linalg.norm(size[weight])  # a turned angle makes one of the other
    large = apart > np.where([n == "gravity_cosine" for n in names], TURNED, LARGE) * size
    body = np.array([n in BODY for n in names])
    least = np.where(body, SURE, FRICTION_SURE)
    told = large & (sure > least) & (shows > np.where(body, SHOWS, FRICTION_SHOWS))
    if not told.any():
        return None

    def table(v: np.ndarray, sd: np.ndarray) -> dict[str, tuple[float, float]]:
        return {n: (float(v[i]), float(sd[i])) for i, n in enumerate(names) if told[i]}

    together = {n: float(values[i]) for i, n in enumerate(names) if told[i]}
    scale = _scale(part, rest[0], one[2])
    turned = float(np.angle(np.exp(1j * (_zero(names, own) - _zero(names, other)))))
    found = Disagreement(
        part.recording, part.split, table(own, own_sd), table(other, other_sd), together, scale, turned
    )
    return float(np.max(np.where(told, sure / least, 0.0))), found


def _zero(names: Sequence[str], values: np.ndarray) -> float:
    """The angle at which the body hangs, as its weight has it [rad]; nan without both of its terms."""
    found = dict(zip(names, values, strict=True))
    return float(np.arctan2(found.get("gravity_cosine", np.nan), found.get("gravity", np.nan)))


def _scale(part: _Part, step: np.ndarray, own_residual: np.ndarray) -> float:
    """The factor by which the others' effort must be taken to be this recording's; nan where none makes it fit."""
    predicted = part.y - part.e + part.w @ step
    factor = float(predicted @ part.y / (predicted @ predicted))
    left = np.linalg.norm(part.y - factor * predicted)
    return factor if left < 1.5 * np.linalg.norm(own_residual) else float("nan")
