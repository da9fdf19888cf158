"""Control of four joints: a step of the law in nanoseconds and in instructions of a Cortex-M4F, and the simulated arm.

The law is the transparent one with its observer of momentum, under every gate. `step_rows`, `export_rows` and
`over_pinocchio` run one part each.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pellucid import _core
from pellucid.controllers.export.controller_values import TreeValues
from pellucid.controllers.export.microcontroller import measure, missing_tools
from pellucid.controllers.export.tree_folder import write_tree_folder
from pellucid.controllers.tree_laws import TreeLaw, carried, full_compensation, transparent
from pellucid.models.tree_card import JointRange, TreeCard

from . import kinematic_tree
from ._size import sized
from .identification import _row

CYCLE_COUNT = sized(20_000, smallest=1_000)
"""Number of control cycles that are timed in a run."""

ROUND_COUNT = sized(7, smallest=1)
"""Number of timed runs."""

EXPORTED_COUNT = sized(None, smallest=1)
"""Number of laws that are measured on a Cortex-M4F, the first of all; None for every one."""

STEP_ROW = "tree law"
"""First word of the rows on the time of a step."""

EXPORT_ROW = "tree export"
"""First word of the rows on exported code."""


def card() -> TreeCard:
    """Four links of 2 kg in a chain, with the friction that identification knows."""
    arm = kinematic_tree.chain("zxyx", np.random.default_rng(1))
    m = len(arm.moving)
    joints = np.zeros((m, len(_core.TREE_JOINT_PARAMETER_NAMES)))
    for name, value in {
        "coulomb_positive": 0.5, "coulomb_negative": 0.4, "viscous_positive": 0.1, "viscous_negative": 0.1,
        "load_motoring": 0.05, "load_generating": 0.05,
    }.items():  # fmt: skip
        joints[:, _core.TREE_JOINT_PARAMETER_NAMES.index(name)] = value
    return TreeCard(
        study="bench", family="best", method="made", names=tuple(f"joint{k}" for k in range(m)),
        bodies=tuple(f"link{k}" for k in range(m)), links=tuple(map(tuple, arm.links_array.tolist())),
        gravity=tuple(map(float, arm.gravity)), joints=tuple(map(tuple, joints.tolist())),
        turns=tuple(map(tuple, np.eye(m).tolist())), motors=(), gains=(1.0,) * m, gains_known=(True,) * m,
        drive_units=("N*m",) * m, effort_units=("N*m",) * m,
        ranges=(JointRange(-1.5, 1.5, effort=60.0, seen_velocity=3.0),) * m, families=(("coulomb", "viscous"),) * m,
        consistent=True, parameters=(), covariance=(), heldout_error=(), processing="", confidence=0.95, notes=(),
        checksums={}, pellucid="0",
    )  # fmt: skip


def variants() -> Mapping[str, TreeLaw]:
    """Laws of the same arm."""
    return {"full": full_compensation(card()), "carried": carried(card()), "transparent": transparent(card())}


def step_rows() -> list[dict]:
    """One control step in double, each timed by itself: the median of medians of rounds, the variants by turns."""
    running = {name: law.start() for name, law in variants().items()}
    taken: dict[str, list[float]] = {name: [] for name in running}
    late: dict[str, list[float]] = {name: [] for name in running}
    for _ in range(ROUND_COUNT):
        for name, law in running.items():
            law.reset()
            times = law.time(CYCLE_COUNT)
            taken[name].append(1e-3 * float(np.median(times)))
            late[name].append(1e-3 * float(np.quantile(times, 0.999)))
    return [
        _row(
            f"{STEP_ROW}: {name}, step",
            taken[name],
            "us",
            f"four joints, double; 99.9 % below {min(late[name]):.3g} us",
        )
        for name in taken
    ]


def export_rows() -> list[dict]:
    """The same on a Cortex-M4F under its supervisor: instructions of a step, and steps that differ from the host's in
    any bit; none without the tools."""
    if missing_tools():
        return []
    made = []
    for name, law in islice(variants().items(), EXPORTED_COUNT):
        with TemporaryDirectory() as scratch:
            found = measure(write_tree_folder("bench", TreeValues(law, ("bench.json",), {}, ()), Path(scratch) / "c"))
        size = f"{found.bytes} bytes of code and constants, {found.memory} of memory"
        note = f"supervised; the costliest {found.most}; {size}"
        made.append(_row(f"{EXPORT_ROW}: {name}, instructions per step", [found.instructions], "1", note))
        made.append(_row(f"{EXPORT_ROW}: {name}, wrong", [float(found.wrong)], "1", f"of {found.steps} steps"))
    return made


def over_pinocchio() -> dict[str, float]:
    """Time of what Pinocchio also does, over its own, in one run: "regressor", "normal_equations" over its regressor
    alone, "inverse_dynamics" called one by one from Python and "inverse_dynamics_at_once"; empty without it."""
    rows = {row["name"]: row["value"] for row in kinematic_tree.run()}
    names = {
        "regressor": "regressor",
        "normal_equations": "regressor and normal equations",
        "inverse_dynamics": "inverse dynamics, one by one",
        "inverse_dynamics_at_once": "inverse dynamics, all at once",
    }
    found = {key: rows.get(f"tree: {name}, ratio") for key, name in names.items()}
    return {key: value for key, value in found.items() if value is not None}


def run() -> list[dict]:
    """Rows of name, value, unit, note; the arm's simulation is among kinematic_tree's."""
    return [*step_rows(), *export_rows()]
