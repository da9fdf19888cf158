"""What a motion can show of a joint, from the motion alone: how much of each parameter's effort no other one makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.joint import JointModel
from ..regression import Stack, rows_of


@dataclass(frozen=True)
class Excitation:
    """Ranges of `position` (both ends) [rad or m], `speed` and `acceleration` (largest); the regressor's `condition`
    number with columns of equal length; `own`, by parameter, the share of what it does that no other explains."""

    position: tuple[float, float]
    speed: float
    acceleration: float
    condition: float
    own: dict[str, float]


def excitation(model: JointModel, data: Stack) -> Excitation:
    """Excitation of a linear `model` by the motions of `data`; their effort is not looked at."""
    w, _ = rows_of(model, np.zeros(len(model.names)), data)
    norms = np.linalg.norm(w, axis=0)
    w = w[:, norms > 0.0] / norms[norms > 0.0]
    # Of fewer rows than columns what no row shows counts as nothing.
    w = np.vstack([w, np.zeros((max(w.shape[1] - len(w), 0), w.shape[1]))])
    _, singular, axes = np.linalg.svd(np.linalg.qr(w, mode="r"))
    # One over the diagonal of the inverse of W'W: the squared part of a column that is normal to all others.
    apart = 1.0 / np.sum((axes / np.maximum(singular, 1e-12 * singular[0])[:, None]) ** 2, axis=0)
    seen = iter(np.sqrt(apart))
    own = {name: float(next(seen)) if n > 0.0 else 0.0 for name, n in zip(model.names, norms, strict=True)}
    position = data.reduced([m.position for m in data.motions])
    return Excitation(
        position=(float(position.min()), float(position.max())),
        speed=float(np.abs(data.reduced([m.velocity for m in data.motions])).max()),
        acceleration=float(np.abs(data.reduced([m.acceleration for m in data.motions])).max()),
        condition=float(singular[0] / max(singular[-1], 1e-300)) if norms.all() else float("inf"),
        own=own,
    )
