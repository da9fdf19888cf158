"""Run an exported controller on a Cortex-M4F in QEMU, count its instructions, and compare outputs with the host's."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from ..._errors import PellucidError
from ...study.results import ResultRow, write_rows
from ...study.study import Study
from .c_folder import copied_controller

COMMAND_NAME = "export"
"""Name of the command in the rows of results.json."""

NEEDED_TOOLS = ("make", "cc", "arm-none-eabi-g++", "arm-none-eabi-size", "qemu-system-arm")
"""Programs that `measure` needs."""


@dataclass(frozen=True)
class OnCortexM4:
    """Figures of one controller on a Cortex-M4F."""

    steps: int  # number of steps of the test vector
    wrong: int  # number of steps with an output that differs from the host's in any bit
    instructions: float  # mean number of instructions in a step of the test vector's motion
    most: int  # number of instructions in the costliest step, accurate to 40
    code: int  # size of text and initialised data of the interface and the law [bytes]
    constants: int  # size of the configuration [bytes]
    memory: int  # size of a context [bytes]

    @property
    def bytes(self) -> int:
        """Size of code and constants [bytes]."""
        return self.code + self.constants

    @property
    def text(self) -> str:
        """The figures in one line."""
        same = "equal to this machine's bit by bit" if not self.wrong else f"{self.wrong} not equal to this machine's"
        return (
            f"{self.steps} steps, {same}; {self.instructions:.0f} instructions a step, {self.bytes} bytes of code and "
            f"constants, {self.memory} of memory"
        )


def missing_tools() -> list[str]:
    """Return those of `NEEDED_TOOLS` that are not installed."""
    return [tool for tool in NEEDED_TOOLS if shutil.which(tool) is None]


def measure(folder: Path) -> OnCortexM4:
    """Compile an exported controller for a Cortex-M4F, play its test vector in QEMU, and count the instructions."""
    absent = missing_tools()
    if absent:
        raise PellucidError(f"{folder}: found no {', '.join(absent)}, expected the tools for a Cortex-M4 and QEMU")
    with copied_controller(folder) as copy:
        checked, counted = _run_target(copy, "m4"), _run_target(copy, "count")
        text, data = _size(copy)
    return OnCortexM4(
        steps=checked["steps"],
        wrong=checked["wrong"],
        instructions=counted["instructions"] / counted["steps"],
        most=counted["most"],
        code=text + data,
        constants=counted["constants"],
        memory=counted["memory"],
    )


def save_measured(
    study: Study, folder: Path, found: OnCortexM4 | None, *, controller: str | None = None
) -> list[ResultRow]:
    """Write the measurements to results.json, replacing those of an earlier export."""
    checksum = sha256((folder / "pellucid_constants.h").read_bytes()).hexdigest()
    rows = [] if found is None else list(_rows(study.name, found, checksum, controller))
    if rows or study.results_path.exists():
        write_rows(study.results_path, COMMAND_NAME, rows)
    return rows


def _rows(study: str, found: OnCortexM4, checksum: str, controller: str | None) -> Iterator[ResultRow]:
    def row(name: str, value: float, unit: str, note: str) -> ResultRow:
        return ResultRow(f"{study}.export.m4.{name}", value, unit, COMMAND_NAME, "simulated", checksum, note)

    which = f"controller {controller}; " if controller else ""
    how = f"{which}QEMU, Cortex-M4F, -icount shift=0, SysTick; mean over the test vector's motion"
    yield row("instructions_per_step", found.instructions, "1", f"{how}; the costliest step {found.most}")
    yield row("bytes", found.bytes, "B", f"{which}code {found.code}, configuration {found.constants}; -O2")
    yield row("memory", found.memory, "B", "one context")
    yield row("wrong", found.wrong, "1", f"of {found.steps} steps, those that differ from the host's in any bit")


def _run_target(folder: Path, target: str) -> dict[str, int]:
    run = _make(folder, target)
    counts = dict(line.split() for line in run.stdout.splitlines() if len(line.split()) == 2)
    # A check that finds a wrong output prints their number and fails. A program that cannot run prints nothing.
    if "steps" not in counts or (run.returncode and not int(counts.get("wrong", 0))):
        raise PellucidError(f"{folder}: make {target} failed:\n{(run.stderr or run.stdout).strip()}")
    return {word: int(number) for word, number in counts.items()}


def _size(folder: Path) -> tuple[int, int]:
    run = _make(folder, "size")
    try:
        text, data = run.stdout.splitlines()[-1].split()[:2]
        return int(text), int(data)
    except (IndexError, ValueError):
        raise PellucidError(f"{folder}: make size failed:\n{run.stderr.strip()}") from None


def _make(folder: Path, target: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(["make", "-s", target], cwd=folder, capture_output=True, text=True, timeout=300)
    except subprocess.TimeoutExpired:
        raise PellucidError(
            f"{folder}: make {target} took more than five minutes, expected less; run it by hand to see where it stops"
        ) from None
