"""Find parameters that recordings do not determine: a perturbation far below sensor resolution moves them beyond their
interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import UNDETERMINED_REASON, Parameter
from ...models.joint import JointModel
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, stack
from .friction_solver import solve_family

PERTURBATION_SHARE = 1e-12
"""Standard deviation of the perturbation of each column, divided by its root mean square. It has the size of rounding
differences between processors."""

PERTURBATION_SEEDS = (1, 2)
"""Random seeds of the perturbations that are tried."""


def find_undetermined(
    model: JointModel,
    data: Stack[Motion],
    found: Solution,
    widths: Iterable[float],
    seeds: Sequence[int] = PERTURBATION_SEEDS,
) -> frozenset[str]:
    """Return the names of parameters that a refit to perturbed columns moves by more than their interval's half width.

    `widths` are those half widths, (p,). There is one refit for each of `seeds`, with perturbations of size
    `PERTURBATION_SHARE`. Parameters without any effect are undetermined, and no refit is needed to see it.
    """
    norms = np.linalg.norm(found.jacobian, axis=0)
    idle = frozenset(name for name, n in zip(model.names, norms, strict=True) if n <= 1e-12 * norms.max())
    if idle:
        return idle
    widths, moved = np.asarray(list(widths), float), np.zeros(len(found.values))
    for seed in seeds:
        try:
            again = solve_family(model, _perturb(data, np.random.default_rng(seed)))
        except IdentificationError:
            return frozenset(model.names)
        moved = np.maximum(moved, np.abs(again.values - found.values))
    # Changes within rounding do not count, however narrow an interval is.
    beyond = moved > np.maximum(widths, 1e-9 * np.abs(found.values))
    return frozenset(name for name, out in zip(model.names, beyond, strict=True) if out)


def mark_undetermined(parameters: Iterable[Parameter], names: frozenset[str]) -> tuple[Parameter, ...]:
    """Return the parameters, with the intervals of those in `names` refused as undetermined."""
    return tuple(replace(p, refused=UNDETERMINED_REASON) if p.name in names else p for p in parameters)


def _perturb(data: Stack[Motion], rng: np.random.Generator) -> Stack[Motion]:
    """Return the stack with noise of relative size `PERTURBATION_SHARE` added to its states and efforts."""

    def change(x: np.ndarray) -> np.ndarray:
        return x + PERTURBATION_SHARE * float(np.sqrt(np.mean(x**2))) * rng.standard_normal(x.shape)

    return stack(
        [
            replace(
                m,
                position=change(m.position),
                velocity=change(m.velocity),
                acceleration=change(m.acceleration),
                effort=change(m.effort),
            )
            for m in data.motions
        ]
    )
