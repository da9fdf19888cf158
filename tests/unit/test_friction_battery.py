"""Every friction term has its role, limits, supervisor, prior, words, colour and advice; a half-added one is found."""

import subprocess
from pathlib import Path

import pytest
from copied_package import copied_package, run_copied
from term_battery import faults

TESTS = Path(__file__).parents[1]
CATALOGUE = "models/friction_terms.py"
RUN = f"import sys\nsys.path.append({str(TESTS)!r})\nfrom term_battery import faults\nprint(*faults(), sep='\\n')\n"
HALF_ADDED = {
    "no entry in the catalogue": (CATALOGUE, "    SQUARE_ROOT,\n", "", "square_root: the catalogue has no term for it"),
    "no family": (CATALOGUE, 'frozenset({"root"})', "frozenset()", "square_root: no family frees it"),
    "no words": (CATALOGUE, '"Friction with the root of speed"', '""', "square_root: the page has no words for it"),
    "no advice": (CATALOGUE, '"Record at several speeds, from slow to fast ones."', '""', "square_root: has no advice"),
    "no colour": (CATALOGUE, '(Stribeck)",\n        "stribeck"', '(Stribeck)",\n        "pink"', "has no colour"),
    "no role": (
        "models/fields.py",
        '"resists" in row else',
        '"resists" in row and "root" not in row["name"] else',
        "square_root: friction.hpp does not say what it resists by",
    ),
    "not counted by the supervisor": (
        "controllers/supervised.py",
        "        if name is not None:\n",
        "        if name is not None and speed != 0.5:\n",
        "square_root: the supervisor does not count it",
    ),
    "not counted by the limits": (
        "models/fields.py",
        "if each.resists is not None and",
        'if each.resists is not None and "stribeck" not in each.name and',
        "stribeck: the limits do not count it",
    ),
    "advice that no finding gives": (
        "joint/study/joint_case.py",
        "term.advice for term in TERMS}",
        'term.advice for term in TERMS if term.name != "square_root"}',
        "square_root: its advice cannot be reached",
    ),
}  # fmt: skip


def test_every_term_of_the_catalogue_is_whole():
    assert faults() == []


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    return copied_package(tmp_path_factory.mktemp("half_added"))


@pytest.mark.parametrize("what", HALF_ADDED)
def test_a_term_that_is_half_added_is_found(copy, what):
    name, old, new, said = HALF_ADDED[what]
    path = copy / name
    whole = path.read_text(encoding="utf-8")
    assert whole.count(old) == 1
    try:
        path.write_text(whole.replace(old, new), encoding="utf-8")
        run: subprocess.CompletedProcess = run_copied(copy.parent, RUN)
    finally:
        path.write_text(whole, encoding="utf-8")
    assert said in run.stdout, run.stdout + run.stderr
