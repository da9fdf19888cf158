"""Which parameters a recording leaves to chance: a change far below any sensor's moves them beyond their interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ..parameter import UNDETERMINED, Parameter
from ..regression import Solution, Stack, stack
from .friction_solver import solve_family

CHANGE = 1e-12
"""Standard deviation of what is added to each column, over its own size: what another processor rounds otherwise."""

SEEDS = (1, 2)
"""Of the changes that are tried."""


def undetermined(
    model: JointModel, data: Stack, found: Solution, widths: Iterable[float], seeds: Sequence[int] = SEEDS
) -> frozenset[str]:
    """Names of the parameters that a refit of columns changed by `CHANGE`, once for each of `seeds`, moves by more than
    their interval's half width, of `widths` (p,); those that have no effect at all are it without one."""
    norms = np.linalg.norm(found.jacobian, axis=0)
    idle = frozenset(name for name, n in zip(model.names, norms, strict=True) if n <= 1e-12 * norms.max())
    if idle:
        return idle
    widths, moved = np.asarray(list(widths), float), np.zeros(len(found.values))
    for seed in seeds:
        try:
            again = solve_family(model, _changed(data, np.random.default_rng(seed)))
        except IdentificationError:
            return frozenset(model.names)
        moved = np.maximum(moved, np.abs(again.values - found.values))
    # Within rounding nothing has moved, however narrow an interval is.
    beyond = moved > np.maximum(widths, 1e-9 * np.abs(found.values))
    return frozenset(name for name, out in zip(model.names, beyond, strict=True) if out)


def marked(parameters: Iterable[Parameter], names: frozenset[str]) -> tuple[Parameter, ...]:
    """The same parameters, those of these names with an interval that should not be read."""
    return tuple(replace(p, refused=UNDETERMINED) if p.name in names else p for p in parameters)


def _changed(data: Stack, rng: np.random.Generator) -> Stack:
    def change(x: np.ndarray) -> np.ndarray:
        return x + CHANGE * float(np.sqrt(np.mean(x**2))) * rng.standard_normal(x.shape)

    columns = ("position", "velocity", "acceleration", "effort")
    return stack([replace(m, **{name: change(getattr(m, name)) for name in columns}) for m in data.motions])
