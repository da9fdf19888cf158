"""Predictions of effort by an identified joint, on fitted and held-out recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, fields, replace

import numpy as np

from ... import _core
from ...models.joint import JointModel
from ...numerics.motion import Motion
from ...numerics.regression import predict_effort_rows
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

    def part(self, most: int) -> Prediction:
        """Return an excerpt of at most `most` consecutive samples from the middle of the recording."""
        n = len(self.time)
        if n <= most:
            return self
        middle = slice((n - most) // 2, (n - most) // 2 + most)
        return replace(self, **{f.name: getattr(self, f.name)[middle].copy() for f in fields(self) if _is_signal(f)})

    @property
    def residual(self) -> np.ndarray:
        """Measured minus predicted effort, shape (n,), in the effort's unit."""
        return self.effort - self.predicted


def _is_signal(field: Field) -> bool:
    """Return whether a field of `Prediction` holds one number per sample."""
    return field.type == "np.ndarray"


def r_squared(measured: np.ndarray, modelled: np.ndarray) -> float:
    """Return the coefficient of determination, 1 - ||x - x_m||^2 / ||x - mean(x)||^2; nan for a constant x."""
    spread = float(np.sum((measured - measured.mean()) ** 2))
    return float(1.0 - np.sum((measured - modelled) ** 2) / spread) if spread else float("nan")


def predict(
    model: JointModel,
    values: np.ndarray,
    motions: Sequence[Motion],
    half_width: float,
    known: Mapping[int, np.ndarray] | None = None,
) -> tuple[Prediction, ...]:
    """Predict the effort of every motion in its scored samples.

    `values` has shape (p,). `known` has the modelled effort, (m,), of some motions by their `id`, if it was computed
    before.
    """
    known = known or {}
    bare = model.vector(values)
    whole: dict[str, list[Motion]] = {}
    for motion in motions:
        whole.setdefault(motion.recording, []).append(motion)
    made = []
    for name, parts in whole.items():
        columns = [m.state_columns for m in parts]
        time, position, velocity, acceleration, effort = columns[0] if len(parts) == 1 else np.hstack(columns)
        if len(effort) == 0:
            continue
        found = [known[id(m)] if id(m) in known else predict_effort_rows(model, values, m) for m in parts]
        modelled = np.concatenate(found)
        loads = [_core.load(model.loaded(bare, *m.payload), *m.states[:, [1, 3]].T) for m in parts]
        made.append(
            Prediction(
                recording=name,
                split=parts[0].split,
                time=time,
                position=position,
                velocity=velocity,
                acceleration=acceleration,
                load=np.concatenate(loads),
                effort=effort,
                predicted=modelled,
                effort_error=relative_error(effort, modelled),
                r2=r_squared(effort, modelled),
                half_width=half_width,
                coverage=float(np.mean(np.abs(effort - modelled) <= half_width)),
            )
        )
    return tuple(made)


def pool_errors(predictions: Sequence[Prediction], split: str) -> tuple[float, float]:
    """Return the effort error [%] and R2 over all samples of one split; nan and nan if it is empty."""
    chosen = [p for p in predictions if p.split == split]
    if not chosen:
        return float("nan"), float("nan")
    effort = np.concatenate([p.effort for p in chosen])
    modelled = np.concatenate([p.predicted for p in chosen])
    return relative_error(effort, modelled), r_squared(effort, modelled)
