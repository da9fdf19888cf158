"""Regression rows of a robot that carries payloads: its base parameters and ten inertial parameters of each payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot
from ..tree_motion import TreeMotion
from .base_parameters import BaseParameters, find_base_parameters
from .tree_regression import TreeRows, collect_rows

PAYLOAD_PREFIX = "payload"
"""Prefix of the names of a payload's parameters."""


@dataclass(frozen=True, eq=False)
class LoadedRows:
    """Regression rows of recordings without and with loads."""

    rows: TreeRows  # rows whose base parameters end in ten parameters of each load, in the frame of the carrying link
    link: int  # index of the link that carries the loads
    place: int  # index of the first load's first parameter
    loads: int  # number of different loads

    def numbers(self, load: int = 0) -> np.ndarray:
        """Return the indices of the ten parameters of a load, (10,)."""
        return self.place + len(BODY_QUANTITIES) * load + np.arange(len(BODY_QUANTITIES))


def collect_loaded_rows(
    robot: Robot,
    empty: Sequence[TreeMotion],
    loaded: Sequence[Sequence[TreeMotion]],
    *,
    width: float = 0.0,
    link: str | None = None,
) -> LoadedRows:
    """Collect the rows of `empty` recordings and of those with each of several loads.

    `link` carries the loads; the last link by default. `width` is that of the smooth sign of friction [rad/s; m/s].
    """
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
    rows = collect_rows(robot, motions, width=width, base=find_base_parameters(robot))
    carried = np.zeros((*rows.rigid.shape[:2], len(BODY_QUANTITIES) * len(loaded)))
    first, columns = sum(map(len, empty)), slice(len(BODY_QUANTITIES) * at, len(BODY_QUANTITIES) * (at + 1))
    for k, each in enumerate(loaded):
        for x in each:
            y = robot.tree.core.regressor(x.position, x.velocity, x.acceleration)[:, :, columns]
            carried[first : first + len(x), :, len(BODY_QUANTITIES) * k : len(BODY_QUANTITIES) * (k + 1)] = y
            first += len(x)
    names = tuple(
        f"{PAYLOAD_PREFIX}{f'_{k + 1}' if len(loaded) > 1 else ''}.{n}"
        for k in range(len(loaded))
        for n in BODY_QUANTITIES
    )
    rigid = np.concatenate([rows.rigid, carried], axis=2)
    extended = replace(rows, base=_append_independent(rows.base, names), rigid=rigid)
    return LoadedRows(extended, at, len(rows.base.names), len(loaded))


def _append_independent(base: BaseParameters, names: tuple[str, ...]) -> BaseParameters:
    """Append parameters `names` that are independent to base parameters."""
    (r, p), more = base.combination.shape, len(names)
    combination = np.zeros((r + more, p + more))
    combination[:r, :p], combination[r:, p:] = base.combination, np.eye(more)
    chosen = np.append(base.chosen, p + np.arange(more))
    return BaseParameters((*base.names, *names), (*base.members, *names), chosen, combination)
