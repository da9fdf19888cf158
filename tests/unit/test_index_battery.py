"""Every index of the catalogue is whole; an index that is half added is found."""

from pathlib import Path

import pytest
from copied_package import copied_package, run_copied
from index_battery import faults

TESTS = Path(__file__).parents[1]
CATALOGUE = "people/indices.py"
RUN = f"import sys\nsys.path.append({str(TESTS)!r})\nfrom index_battery import faults\nprint(*faults(), sep='\\n')\n"
HALF_ADDED = {
    "no words": ('words="Mean velocity"', 'words=""', "vmean: has no words"),
    "no unit": (
        'short="Peak acceleration", unit="rad/s^2"', 'short="Peak acceleration", unit=""', "acceleration: has no unit"
    ),
    "no worse direction": (
        'words="Spectral arc length", short="Spectral arc length", unit="1",\n    worse=Worse.EITHER_WAY, ',
        'words="Spectral arc length", short="Spectral arc length", unit="1",\n    ',
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
    "a place that another has": ('of="end_error",\n', 'of="end_error", panel_place=7,\n', "panels: places"),
    "no index that leads": ("    leads=True,\n", "", "not exactly one index leads"),
}


# The package cannot be imported with these, so that each is tried by itself.
REFUSED = {what for what, (*_, said) in HALF_ADDED.items() if said.startswith("missing")}


def test_every_index_of_the_catalogue_is_whole():
    assert faults() == []


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    return copied_package(tmp_path_factory.mktemp("half_added"))


def said_with(copy: Path, *which: str) -> str:
    """Return what the battery says of a copy of the package in which indices are half added in these ways."""
    path = copy / CATALOGUE
    whole = half = path.read_text(encoding="utf-8")
    for what in which:
        old, new, _ = HALF_ADDED[what]
        assert half.count(old) == 1
        half = half.replace(old, new)
    try:
        path.write_text(half, encoding="utf-8")
        run = run_copied(copy.parent, RUN)
    finally:
        path.write_text(whole, encoding="utf-8")
    return run.stdout + run.stderr


def test_indices_that_are_half_added_are_found(copy):
    found = said_with(copy, *(what for what in HALF_ADDED if what not in REFUSED))
    assert [what for what, (*_, said) in HALF_ADDED.items() if what not in REFUSED and said not in found] == [], found


@pytest.mark.parametrize("what", sorted(REFUSED))
def test_an_index_that_leaves_out_what_it_must_say_is_refused(copy, what):
    assert HALF_ADDED[what][-1] in said_with(copy, what)
