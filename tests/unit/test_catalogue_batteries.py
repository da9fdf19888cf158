"""Every law, estimator, fault and defect of the catalogues is whole; one that is half added is found."""

import subprocess
from pathlib import Path

import pytest
from catalogue_batteries import BATTERIES
from copied_package import copied_package, run_copied

TESTS = Path(__file__).parents[1]
HALF_ADDED = {
    "a law that nobody builds": (
        "laws", "control/transparent_laws.py", "ControlLaw(RULES_LAW.name", "ControlLaw(TRANSPARENT_LAW.name",
        "rules: no builder makes it",
    ),
    "an estimator without words": (
        "estimators", "estimators/families/network.py", '"M-BP, a network (reconstruction)"', '""',
        "mbp: has no words",
    ),
    "an estimator without a colour": (
        "estimators", "estimators/families/tree.py", 'colour="load"\n', 'colour="pink"\n', "tree: has no colour",
    ),
    "a fault of the core without an entry": (
        "faults", "control/supervisor_faults.py", '("ringing",)', '("push",)',
        "ringing: has no entry in the catalogue",
    ),
    "a fault that does not say what to do": (
        "faults", "control/supervisor_faults.py",
        '"Lower the gains of the law, or measure the delay of the loop; then reset."', '""',
        "ringing: has no words, or does not say what to do",
    ),
    "a defect that no study searches for": (
        "defects", "studies/find_defects.py", "spikes, clipped, frozen)\n", "spikes, clipped)\n",
        "frozen_encoder: no study searches for it",
    ),
}  # fmt: skip


@pytest.mark.parametrize("which", BATTERIES)
def test_every_entry_of_a_catalogue_is_whole(which):
    assert BATTERIES[which]() == []


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    return copied_package(tmp_path_factory.mktemp("half_added"))


@pytest.mark.parametrize("what", HALF_ADDED)
def test_an_entry_that_is_half_added_is_found(copy, what):
    which, name, old, new, said = HALF_ADDED[what]
    run = (
        f"import sys\nsys.path.append({str(TESTS)!r})\n"
        f"from catalogue_batteries import BATTERIES\nprint(*BATTERIES[{which!r}](), sep='\\n')\n"
    )
    path = copy / name
    whole = path.read_text(encoding="utf-8")
    assert whole.count(old) == 1
    try:
        path.write_text(whole.replace(old, new), encoding="utf-8")
        done: subprocess.CompletedProcess = run_copied(copy.parent, run)
    finally:
        path.write_text(whole, encoding="utf-8")
    assert said in done.stdout, done.stdout + done.stderr
