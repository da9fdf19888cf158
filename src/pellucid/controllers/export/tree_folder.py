"""Write a law of several joints as a folder of C and C++, with arrays of joints and links and with a test vector."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ... import _core
from ...models.fields import Field, model_fields
from ...study.exporter import (
    OUTPUT_FILE,
    float_literal,
    header_files,
    needed_headers,
    record_outputs,
    refuse_other_makefile,
    write_files,
)
from .c_folder import refuse_faults, render, render_all
from .controller_values import TreeValues
from .replay_vector import (
    FAULT_STEPS,
    INIT_EVENT,
    MEMORY_EVENT,
    MOTION_STEPS,
    NO_EVENT,
    STOP_EVENT,
    Block,
    Reading,
    ReplayVector,
    StepInputs,
    assembled,
)

FOLDER_TITLE = "compensation of all joints of a robot"
"""Title in the exported files."""

_NO_LIMIT = float("inf")
"""Limit that nothing exceeds."""

# Configuration of the supervisor in which no check trips.
_UNCHECKED_LAW = {
    "raw_speed_limit": _NO_LIMIT,
    "raw_acceleration_limit": _NO_LIMIT,
    "range_min": -_NO_LIMIT,
    "range_max": _NO_LIMIT,
    "freeze_speed": _NO_LIMIT,
    "drive_expected": 0.0,
    "budget_store": _NO_LIMIT,
    "push_limit": _NO_LIMIT,
    "power_limit": _NO_LIMIT,
    "ringing_limit": _NO_LIMIT,
    "drive_surplus": _NO_LIMIT,
    "outside_limit": _NO_LIMIT,
    "joint_expected": 0.0,
    "wearer_torque": _NO_LIMIT,
    "force_tolerance": _NO_LIMIT,
    "force_burst": _NO_LIMIT,
    "force_excess": _NO_LIMIT,
    "force_expected": 0.0,
    "muscle_expected": 0.0,
    "wrench_expected": 0.0,
    "test_effort": 0.0,
    "drive_delay": _NO_LIMIT,
    "raw_power_limit": _NO_LIMIT,
    "raw_end_speed_limit": _NO_LIMIT,
    "rest_speed": _NO_LIMIT,
    "reset_delay": 0.02,
    "healthy_samples": 10.0,
}
SUPERVISOR_VARIANTS = {
    "law": _UNCHECKED_LAW,
    "jump": {**_UNCHECKED_LAW, "raw_acceleration_limit": 2000.0},
    "drive": {**_UNCHECKED_LAW, "drive_expected": 1.0, "drive_tolerance": 6.0},
    "power": {**_UNCHECKED_LAW, "raw_power_limit": 1e-6},
    "speed": {**_UNCHECKED_LAW, "raw_end_speed_limit": 1e-6},
    "ringing": {**_UNCHECKED_LAW, "ringing_limit": 1e-5},
    "outside": {**_UNCHECKED_LAW, "outside_limit": 1e-6},
    "force": {**_UNCHECKED_LAW, "force_expected": 1.0, "force_range": 1e-6, "degrades": 1.0},
    "start_up": {**_UNCHECKED_LAW, "test_effort": 0.5, "test_samples": 8.0, "test_rest": 2.0, "test_most": 1e-9},
    # All checks run here and none trips, to count a step's instructions.
    "counted": {
        **_UNCHECKED_LAW,
        "raw_speed_limit": 1e6,
        "raw_acceleration_limit": 1e9,
        "raw_power_limit": 1e6,
        "raw_end_speed_limit": 1e6,
        "ringing_limit": 1e6,
        "budget_store": 1e6,
    },
}
"""Configurations of the supervisor that stretches of the test vector are played with, by name."""


@dataclass(frozen=True)
class Table:
    """A C struct of numbers, and its rows for this robot."""

    name: str
    title: str
    fields: tuple[Field, ...]
    rows: tuple[dict, ...]

    @property
    def single(self) -> bool:
        """Whether the configuration has one such struct for all joints together."""
        return self.name.startswith("whole")


@dataclass(frozen=True)
class TreeStepInputs(StepInputs):
    """Inputs of one step: samples of the joints' encoders, the first joint's drive, and the wearer."""

    pushed: float = 0.0  # effort of the wearer [N m], [N]

    @property
    def numbers(self) -> tuple[float, ...]:
        """Numbers beside the samples."""
        return (self.drive, self.pushed)


def write_tree_folder(study: str, values: TreeValues, out: Path) -> Path:
    """Write the folder; files of an earlier export are replaced, all others stay."""
    refuse_other_makefile(out)
    headers = sorted({*needed_headers("tree_supervisor.hpp"), "watchdog.hpp"})
    files = header_files(headers)
    tables, vector, card = tables_of(values), tree_vector(values), values.law.card
    content = {
        "title": FOLDER_TITLE, "values": values, "study": study, "version": version("pellucid"), "headers": headers,
        "joints": len(card.names), "links": len(card.links), "faults": _core.FAULTS, "modes": _core.MODES,
        "tables": tables, "literal": float_literal, "vector": vector,
        "storage": _core.tree_law_storage(len(card.links)), "variants": SUPERVISOR_VARIANTS,
        "whole_names": {field.name for field in model_fields("tree_watch_whole")},
        "period": values.law.shares[0]["period"], "cards": values.cards, "checksums": values.checksums,
        "notes": values.notes,
    }  # fmt: skip
    files |= render_all("tree", **content)
    lines = [line.split() for line in record_outputs(files, out)]
    outputs = [(int(status), [int(x, 16) for x in bits]) for status, *bits in lines]
    refuse_faults(out, [status for status, _ in outputs[: vector.motion]])
    if outputs:
        files[OUTPUT_FILE] = render("vector_outputs.h", "tree", outputs=outputs)
    return write_files(files, out)


def tables_of(values: TreeValues) -> tuple[Table, ...]:
    """Return the tables of the configuration: links, joints, motors, shares and watches."""
    law, card = values.law, values.law.card
    numbers = law.numbers
    motors = numbers.get("motors", np.zeros((len(card.names), len(_core.TREE_MOTOR_PARAMETER_NAMES))))

    def table(name: str, title: str, model: str, *, rows: np.ndarray, names: tuple[str, ...]) -> Table:
        made = tuple(
            {"name": who, "numbers": tuple(map(float, row))}
            for who, row in zip(names, np.atleast_2d(rows), strict=True)
        )
        return Table(name, title, model_fields(model), made)

    def rows_of(tables: tuple, model: str) -> np.ndarray:
        return np.array([[one[field.name] for field in model_fields(model)] for one in tables])

    joint_watches = rows_of(law.watches, "tree_watch_joint")
    whole_watch = rows_of((law.whole_watch,), "tree_watch_whole")
    return (
        table("link", "A link, and the joint that carries it.", "link", rows=numbers["links"], names=card.bodies),
        table("joint", "Friction of a joint.", "tree_joint", rows=numbers["joints"], names=card.names),
        table("motor", "A motor that turns with several joints.", "tree_motor", rows=motors, names=card.names),
        table("share", "Control of one joint.", "tree_law_joint", rows=numbers["shares"], names=card.names),
        table("whole", "Control of all joints.", "tree_law_whole", rows=numbers["whole"], names=("whole",)),
        table("watch", "Watch of one joint.", "tree_watch_joint", rows=joint_watches, names=card.names),
        table("whole_watch", "Watch of all joints.", "tree_watch_whole", rows=whole_watch, names=("whole",)),
    )


def tree_vector(values: TreeValues, seed: int = 1) -> ReplayVector:
    """Return a motion of all joints with a repeated and a lost sample, then faults of single joints and of all."""
    law = values.law
    period = round(1e6 * law.shares[0]["period"])
    rng = np.random.default_rng(seed)
    rate, swings = 2 * np.pi * 4.0 / (MOTION_STEPS * 1e-6 * period), []
    for share, known in zip(law.shares, law.card.ranges, strict=True):
        low, high = max(share["position_min"], -1.0), min(share["position_max"], 1.0)
        speed = min(share["velocity_limit"], known.seen_velocity or 1.0)
        swings.append((0.5 * (low + high), min(0.3 * (high - low), 0.2 * speed / rate)))
    t = 1e-6 * period * np.arange(MOTION_STEPS)
    place = np.column_stack(
        [
            middle + swing * (np.sin(rate * t + k) + 0.2 * np.sin(2.3 * rate * t))
            for k, (middle, swing) in enumerate(swings)
        ]
    )
    place = (place + 1e-5 * rng.standard_normal(place.shape)).astype(np.float32)
    pushed = 0.5 * np.sin(1.7 * rate * t)

    def row(i: int) -> TreeStepInputs:
        now = 1_000_000 + i * period
        read = tuple(Reading(x, 0xFFFFFF00 + i & 0xFFFFFFFF, now - period // 10) for x in place[i])
        return TreeStepInputs(now, read, pushed=float(pushed[i]))

    blocks = (Block(*block) for block in _blocks(values, period))
    return assembled(row, blocks, SUPERVISOR_VARIANTS)


def _blocks(
    values: TreeValues, period: int
) -> Iterator[tuple[str, Callable[[int, TreeStepInputs], TreeStepInputs], int]]:
    """Yield faults of the last joint and of all joints, and attempts to end a stop."""

    def changed(i: int, row: TreeStepInputs, **change) -> TreeStepInputs:
        if i != FAULT_STEPS - 2:
            return row
        read = (*row.read[:-1], replace(row.read[-1], **change))
        return replace(row, read=read)

    for value in (np.nan, np.inf, -np.inf):
        yield "law", partial(changed, value=np.float32(value)), 3 * FAULT_STEPS
    yield "law", lambda i, row: changed(i, row, valid=0), 3 * FAULT_STEPS
    yield "law", lambda i, row: changed(i, row, time=row.read[-1].time - 10**6), 3 * FAULT_STEPS
    yield "law", lambda i, row: changed(i, row, sequence=row.read[-1].sequence - 20), 3 * FAULT_STEPS
    yield "law", lambda i, row: replace(row, before=STOP_EVENT) if i == 6 else row, 3 * FAULT_STEPS
    yield "jump", lambda i, row: changed(i, row, value=row.read[-1].value + np.float32(0.1)), 3 * FAULT_STEPS
    yield "drive", lambda i, row: replace(row, drive=15.0 + i) if i > 12 else row, 3 * FAULT_STEPS
    yield "drive", lambda i, row: replace(row, drive=np.nan) if i > 12 else row, 3 * FAULT_STEPS
    for variant in ("power", "speed", "outside", "force", "ringing"):
        yield variant, lambda i, row: row, 60

    def slide(i: int, row: TreeStepInputs) -> TreeStepInputs:
        way = np.float32(2e-7 * period * max(i - 6, 0))
        return replace(row, read=tuple(replace(each, value=way) for each in row.read))

    yield "start_up", slide, 90
    # The supervisor checks twelve words of memory in every fourth period: this is enough to check all of them twice.
    through = min(4 * -(-_core.tree_law_storage(len(values.law.card.links)) // (4 * 8)), MOTION_STEPS - 5)
    yield "law", lambda i, row: replace(row, before=MEMORY_EVENT) if i == 4 else row, 4 + through
    late = max(40, round(0.02 / (1e-6 * period)) + 14)

    def mended(i: int, row: TreeStepInputs) -> TreeStepInputs:
        return replace(row, before={4: STOP_EVENT, 8: INIT_EVENT}.get(i, NO_EVENT), token=int(i >= 12))

    yield "law", mended, late + 20
