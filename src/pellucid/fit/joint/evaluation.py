"""How an identified joint predicts effort on recordings, fitted or never seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ... import _core
from ...models.joint import JointModel
from ...signals.motion import Motion
from ..regression import predicted
from .replay import relative_error


@dataclass(frozen=True)
class Prediction:
    """The effort a model predicts for a recording, after the same filter on both sides; scored samples only.

    `position`, `velocity`, `acceleration`, `load`, `effort`, `predicted`: shape (n,), SI; `effort_error` [%] is
    100 ||tau - tau_hat|| / ||tau||; `coverage` is the share of samples inside the prediction interval `half_width`.
    """

    recording: str
    split: str
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    load: np.ndarray
    effort: np.ndarray
    predicted: np.ndarray
    effort_error: float
    r2: float
    half_width: float
    coverage: float

    @property
    def residual(self) -> np.ndarray:
        """What the model misses, shape (n,), in the effort's unit."""
        return self.effort - self.predicted


def r_squared(measured: np.ndarray, modelled: np.ndarray) -> float:
    """1 - ||x - x_m||^2 / ||x - mean(x)||^2."""
    spread = float(np.sum((measured - measured.mean()) ** 2))
    return float(1.0 - np.sum((measured - modelled) ** 2) / spread) if spread else float("nan")


def predict(
    model: JointModel, values: np.ndarray, motions: Sequence[Motion], half_width: float
) -> tuple[Prediction, ...]:
    """Predict the effort of every motion; scored samples only. `values` (p,)."""
    bare = model.vector(values)
    whole: dict[str, list[tuple[Motion, np.ndarray]]] = {}
    for motion, effort in zip(motions, predicted(model, values, motions), strict=True):
        whole.setdefault(motion.recording, []).append((motion, effort))
    made = []
    for name, parts in whole.items():

        def joined(signal, parts=parts):
            return np.concatenate([m.reduce(signal(m, e))[m.moving] for m, e in parts])

        effort = joined(lambda m, e: m.effort)
        modelled = joined(lambda m, e: e)
        if len(effort) == 0:
            continue
        made.append(
            Prediction(
                recording=name,
                split=parts[0][0].split,
                time=np.concatenate([m.time[m.inner][:: m.filtering.decimate][m.moving] for m, _ in parts]),
                position=joined(lambda m, e: m.position),
                velocity=joined(lambda m, e: m.velocity),
                acceleration=joined(lambda m, e: m.acceleration),
                load=joined(lambda m, e: _core.load(model.loaded(bare, *m.payload), m.position, m.acceleration)),
                effort=effort,
                predicted=modelled,
                effort_error=relative_error(effort, modelled),
                r2=r_squared(effort, modelled),
                half_width=half_width,
                coverage=float(np.mean(np.abs(effort - modelled) <= half_width)),
            )
        )
    return tuple(made)


def pooled(predictions: Sequence[Prediction], split: str) -> tuple[float, float]:
    """Effort error [%] and R2 over all samples of one split; nan, nan where it is empty."""
    chosen = [p for p in predictions if p.split == split]
    if not chosen:
        return float("nan"), float("nan")
    effort = np.concatenate([p.effort for p in chosen])
    modelled = np.concatenate([p.predicted for p in chosen])
    return relative_error(effort, modelled), r_squared(effort, modelled)
