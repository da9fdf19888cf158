"""One minute: a virtual joint recorded, identified and judged, then a real machine's recording if one is at hand."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .._errors import DatasetError, PellucidError
from ..datasets import init
from ..datasets.registry import names
from ..identification.fit import JointFit
from ..identification.identify import identify
from ..identification.save import save
from ..lab.virtual_joint import bench_joint, write_study
from ..recordings.results import ResultRow, write_rows
from ..recordings.study import STUDY_FILE, Study
from ..report.document import write_report
from .coverage import Coverage, coverage

COMMAND = "demo"
SEED = 11
VIRTUAL = "virtual"


@dataclass(frozen=True)
class Demonstration:
    """What `demo` made: identified studies and their reports, the intervals' coverage, and what it left out."""

    studies: tuple[tuple[Study, JointFit, Path], ...]
    coverages: tuple[Coverage, ...]
    notes: tuple[str, ...]


def demo(out: Path | str, *, on_progress: Callable[[str, float], None] | None = None) -> Demonstration:
    """Run the whole flow into a folder.

    Parameters
    ----------
    out : path
        Made if it is not there; studies an earlier demo left in it are replaced.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Demonstration

    Raises
    ------
    PellucidError
        If `out` holds something that no demo made.
    """
    tell = on_progress or (lambda text, share: None)
    out = Path(out)
    notes: list[str] = []
    studies = []
    tell("recording a virtual joint", 0.0)
    virtual = write_study(_cleared(out / VIRTUAL), bench_joint(), name=VIRTUAL, seed=SEED)
    studies.append(_identified(virtual, tell, 0.05, 0.35))
    rows, coverages = [], []
    for i, colour in enumerate(("white", "coloured")):
        tell(f"200 virtual recordings with {colour} noise: do intervals hold the truth?", 0.35 + 0.1 * i)
        found = coverage(bench_joint(), colour)
        coverages.append(found)
        rows.append(_coverage_row(found))
    write_rows(virtual.results_path, COMMAND, rows)
    name = names()[0]
    tell(f"a real machine: {name}", 0.55)
    try:
        folder = _cleared(out / name)
        real = init(folder, dataset=name)
    except DatasetError as error:
        notes.append(f"The real recording '{name}' is not here and could not be fetched: {error}")
    else:
        studies.append(_identified(real, tell, 0.55, 1.0))
    tell("done", 1.0)
    return Demonstration(tuple(studies), tuple(coverages), tuple(notes))


def _identified(
    study: Study, tell: Callable[[str, float], None], start: float, stop: float
) -> tuple[Study, JointFit, Path]:
    fit = identify(study, on_progress=lambda text, share: tell(f"{study.name}: {text}", start + share * (stop - start)))
    save(study, fit)
    return study, fit, write_report(study, fit)


def _coverage_row(found: Coverage) -> ResultRow:
    each = ", ".join(f"{name} {share:.1f}" for name, share in found.by_parameter.items())
    return ResultRow(
        id=f"{VIRTUAL}.symmetric.coverage.{found.colour}",
        value=found.lowest,
        unit="%",
        command=COMMAND,
        split="simulated",
        data_checksum="",
        note=(
            f"lowest over the parameters of how often the nominal 95 % interval held the truth, {found.repetitions} "
            f"seeded repetitions: {each}; textbook intervals {found.textbook:.1f}"
        ),
    )


def _cleared(folder: Path) -> Path:
    """The folder, with what an earlier demo left there removed; anything else is refused, not deleted."""
    if folder.exists():
        if any(folder.iterdir()) and not (folder / STUDY_FILE).is_file():
            raise PellucidError(f"{folder}: not empty and not a study; name another folder with --out")
        shutil.rmtree(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    return folder
