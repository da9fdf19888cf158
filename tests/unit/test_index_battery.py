"""Every index of the catalogue is whole; an index that is half added is found."""

import subprocess
from pathlib import Path

import pytest
from copied_package import copied_package, run_copied
from index_battery import faults

TESTS = Path(__file__).parents[1]
CATALOGUE = "assessment/indices.py"
RUN = f"import sys\nsys.path.append({str(TESTS)!r})\nfrom index_battery import faults\nprint(*faults(), sep='\\n')\n"
HALF_ADDED = {
    "no words": ('words="Mean velocity"', 'words=""', "vmean: has no words"),
    "no unit": ('short="Mean vel.", unit="rad/s"', 'short="Mean vel.", unit=""', "vmean: has no unit"),
    "no worse direction": (
        'words="Spectral arc length", short="SPARC", unit="1",\n    worse=Worse.EITHER_WAY, ',
        'words="Spectral arc length", short="SPARC", unit="1",\n    ',
        "missing 1 required keyword-only argument: 'worse'",
    ),
    "no meaning of a percentage": (
        'percent_of=PercentOf.NOTHING_AT_ALL, of="sparc"',
        'of="sparc"',
        "missing 1 required keyword-only argument: 'percent_of'",
    ),
    "a value that nobody computes": ('of="ldlj"', 'of="jerk"', "ldlj: nobody computes its value"),
    "a robot that it does not say it needs": (
        'of="work", needs_robot=True',
        'of="work"',
        "work: does not say whether it needs a robot",
    ),
    "cut off movements": (", cut_off=CutOff.AT_LEAST_SEEN", "", "duration_median: does not say what a movement"),
    "a place that another has": ('of="ldlj"', 'of="ldlj", panel_place=7', "panels: places"),
    "no index that leads": ("    leads=True, ", "    ", "not exactly one index leads"),
}


def test_every_index_of_the_catalogue_is_whole():
    assert faults() == []


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    return copied_package(tmp_path_factory.mktemp("half_added"))


@pytest.mark.parametrize("what", HALF_ADDED)
def test_an_index_that_is_half_added_is_found(copy, what):
    old, new, said = HALF_ADDED[what]
    path = copy / CATALOGUE
    whole = path.read_text(encoding="utf-8")
    assert whole.count(old) == 1
    try:
        path.write_text(whole.replace(old, new), encoding="utf-8")
        run: subprocess.CompletedProcess = run_copied(copy.parent, RUN)
    finally:
        path.write_text(whole, encoding="utf-8")
    assert said in run.stdout + run.stderr, run.stdout + run.stderr
