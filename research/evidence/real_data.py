"""Public recordings of real machines and people, each identified or calibrated by its command.

``python -m research.evidence.real_data`` runs all commands, and writes the results file and the page; with ``--page``
it only writes the page.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from pellucid.study.results import ResultRow, read_rows
from research.benchmarks._size import is_smallest

from ._real_data_page import wanted_ids, write_page, write_results

COMMANDS: Mapping[str, tuple[str, ...]] = {
    "emps": ("identify",),
    "bam_servo": ("identify",),
    "staubli_tx40": ("identify",),
    "ur10e": ("identify",),
    "elderly_isometric": ("emg", "force"),
    "lower_limb_walking": ("calibrate",),
    "lumbar_lifting": ("calibrate",),
}
"""The command that computes the results of each data set."""


def rows() -> Iterator[ResultRow]:
    """Run each command in a temporary folder, and yield the figures that the page shows."""
    with TemporaryDirectory() as folder:
        for name in ["emps"] if is_smallest() else COMMANDS:
            study = Path(folder) / name
            for words in (("init", str(study), "--dataset", name), (*COMMANDS[name], str(study))):
                subprocess.run([sys.executable, "-m", "pellucid", *words, "-q"], check=True, stdout=subprocess.DEVNULL)
            yield from chosen_rows(study / "results.json")


def chosen_rows(path: Path) -> Iterator[ResultRow]:
    """Yield the figures of a study's results.json that the page shows."""
    wanted = set(wanted_ids())
    yield from (row for row in read_rows(path) if row.id in wanted)


if __name__ == "__main__":
    if sys.argv[1:] != ["--page"]:
        write_results(rows())
    write_page()
