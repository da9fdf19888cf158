"""The thesis's Tables 3.1 to 3.5 and Figs. 3.1 to 3.7 on the virtual orthosis, beside what it prints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...lab.knee.rig import KneeRig, knee_orthosis
from ...recordings.results import ResultRow
from ..printed import PrintedPaper, printed
from ..reproduction import Reproduced, write_results
from .recomputed import recomputed
from .residual import REPRODUCED, ControllerRow
from .residual_rows import residual_rows
from .rows import coupling_rows, limbs_rows, orthosis_rows, torques_rows
from .torque import AS_PUBLISHED, ESTIMATORS, TorqueMap, TorqueSteps
from .wearers import Bench, Drawn, WearerFound, identify_bench
from .work import KneeWork

SEEDS = tuple(range(1, 7))

COMMAND = "reproduce knee"

SPLITS = {
    "fitted": (".fitted", "knee.tf.fit.published_form", "knee.emg.target"),
    "simulated": (
        ".recomputed.", "knee.mgl_", ".inertia", ".damping", ".stiffness", ".coverage.", "knee.imu.", ".gravity",
        "_margin.",
    ),
}  # fmt: skip
"""What a row is judged on, by a part of its id: rows not named here, on recordings never fitted. What is compared with
the rig's own constants, and arithmetic, count as simulated."""

HELDOUT = (".heldout",)
"""Parts of ids that are held out whatever else they contain."""


@dataclass(frozen=True)
class KneeReproduction:
    """Everything `reproduce_knee` computed."""

    rows: tuple[Reproduced, ...]
    results: tuple[ResultRow, ...]
    rig: KneeRig
    paper: PrintedPaper
    bench: Bench
    wearers: Mapping[str, WearerFound]  # With the first seed
    steps: Mapping[tuple[str, str], TorqueSteps]  # By subject and protocol
    maps: tuple[TorqueMap, ...]
    drawn: tuple[Drawn, ...]  # All seeds
    compared: tuple[ControllerRow, ...] = ()  # Controllers, by wearer and swing


def reproduce_knee(
    out: Path,
    *,
    seeds: Sequence[int] = SEEDS,
    estimators: Sequence[str] = (*ESTIMATORS, *AS_PUBLISHED),
    compared: Sequence[str] = REPRODUCED,
    workers: int | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> KneeReproduction:
    """Do the thesis's experiments on the virtual orthosis, and write results.json and reproduction.json."""
    tell = on_progress or (lambda text, share: None)
    rig, paper = knee_orthosis(), printed("knee")
    tell("the orthosis alone", 0.0)
    bench = identify_bench(rig, seeds[0])
    published_time = paper["step_time"] * len(paper.values["torque_steps"])
    work = KneeWork(rig, bench, seeds, estimators, published_time=published_time, compared=compared)
    work.run(workers, tell)
    rows = (
        *orthosis_rows(bench, paper),
        *limbs_rows(rig, work.wearers, work.drawn, paper),
        *torques_rows(work.steps, work.maps, paper),
        *coupling_rows(work.wearers, work.drawn, paper),
        *residual_rows(work.compared),
        *recomputed(paper),
    )
    results = write_results(out, COMMAND, rows, _split)
    return KneeReproduction(
        rows, results, rig, paper, bench, work.wearers, work.steps, tuple(work.maps), tuple(work.drawn),
        tuple(work.compared),
    )  # fmt: skip


def _split(row: str) -> str:
    if any(part in row for part in HELDOUT):
        return "heldout"
    return next((split for split, parts in SPLITS.items() if any(part in row for part in parts)), "heldout")
