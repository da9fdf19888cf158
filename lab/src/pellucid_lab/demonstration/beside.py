"""What the demo's second process does; it loads no more than that, because to load a library takes seconds."""

from __future__ import annotations

from pathlib import Path

from pellucid.study.datasets import init
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import identify
from pellucid.study.procedures.run import report as write_report

from ..bench.rig import bench_joint
from .coverage import Coverage, coverage


def identify_machine(folder: Path, name: str) -> None:
    """Identify a real machine from the recordings that come with the package, keep the result, write its report."""
    study = init(folder, dataset=name)
    fit = identify(study)
    fit.save(study)
    write_report(study, fit)


def write_kept_report(folder: Path) -> None:
    """Write the report of what a study's commands kept."""
    write_report(open_study(folder))


def count_coverage(repetitions: int) -> tuple[Coverage, ...]:
    """Return the coverage of intervals for white and for coloured noise."""
    return tuple(coverage(bench_joint(), colour, repetitions=repetitions) for colour in ("white", "coloured"))
