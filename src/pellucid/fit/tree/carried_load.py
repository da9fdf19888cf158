"""A robot that carries something in some recordings: its base parameters, and ten numbers of each load beside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion
from .base_parameters import BaseParameters, base_parameters
from .tree_regression import TreeRows, tree_rows

PAYLOAD = "payload"


@dataclass(frozen=True, eq=False)
class LoadedRows:
    """`rows` of recordings without and with loads, whose base parameters end in ten numbers of each load, in the frame
    of the `link` that carries it; `place` is where the first load's stand."""

    rows: TreeRows
    link: int
    place: int
    loads: int

    def numbers(self, load: int = 0) -> np.ndarray:
        """Where the ten numbers of a load stand among the parameters, (10,)."""
        return self.place + len(BODY_QUANTITIES) * load + np.arange(len(BODY_QUANTITIES))


def loaded_rows(
    robot: Robot,
    empty: Sequence[TreeMotion],
    loaded: Sequence[Sequence[TreeMotion]],
    *,
    width: float = 0.0,
    link: str | None = None,
) -> LoadedRows:
    """Rows of recordings without load, and of those with each of several; `link` carries them, the last if not given;
    `width` of the smooth sign of friction [rad/s; m/s]."""
    children = [joint.child for joint in robot.tree.order]
    if link is not None and link not in children:
        raise IdentificationError(
            f"{robot.tree.source}: found no link {link!r} for the payload, expected one of {', '.join(children)}"
        )
    if not empty or not loaded or not all(loaded):
        raise IdentificationError(
            "a payload needs recordings with it and without; found "
            f"{len(empty)} without and {sum(map(len, loaded))} with: record the same motion both ways"
        )
    at = len(children) - 1 if link is None else children.index(link)
    motions = [*empty, *(x for each in loaded for x in each)]
    rows = tree_rows(robot, motions, width=width, base=base_parameters(robot))
    carried = np.zeros((*rows.rigid.shape[:2], len(BODY_QUANTITIES) * len(loaded)))
    first, columns = sum(map(len, empty)), slice(len(BODY_QUANTITIES) * at, len(BODY_QUANTITIES) * (at + 1))
    for k, each in enumerate(loaded):
        for x in each:
            y = robot.tree.core.regressor(x.position, x.velocity, x.acceleration)[:, :, columns]
            carried[first : first + len(x), :, len(BODY_QUANTITIES) * k : len(BODY_QUANTITIES) * (k + 1)] = y
            first += len(x)
    names = tuple(
        f"{PAYLOAD}{f'_{k + 1}' if len(loaded) > 1 else ''}.{n}" for k in range(len(loaded)) for n in BODY_QUANTITIES
    )
    rigid = np.concatenate([rows.rigid, carried], axis=2)
    extended = replace(rows, base=_with(rows.base, names), rigid=rigid)
    return LoadedRows(extended, at, len(rows.base.names), len(loaded))


def _with(base: BaseParameters, names: tuple[str, ...]) -> BaseParameters:
    """Base parameters, and others that stand for themselves."""
    (r, p), more = base.combination.shape, len(names)
    combination = np.zeros((r + more, p + more))
    combination[:r, :p], combination[r:, p:] = base.combination, np.eye(more)
    chosen = np.append(base.chosen, p + np.arange(more))
    return BaseParameters((*base.names, *names), (*base.members, *names), chosen, combination)
