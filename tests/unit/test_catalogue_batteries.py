"""Every law, estimator, fault and defect of the catalogues is whole; one that is half added is found."""

from pathlib import Path

import pytest
from catalogue_batteries import BATTERIES
from copied_package import copied_package, run_copied

TESTS = Path(__file__).parents[1]
HALF_ADDED = {
    "a law that nobody builds": (
        "laws", "controllers/transparent_laws.py", "kind=RULES_LAW.name", "kind=TRANSPARENT_LAW.name",
        "rules: no builder makes it",
    ),
    "an estimator without words": (
        "estimators", "emg/estimators/families/linear.py", '"M-BP, a network (reconstruction)"', '""',
        "mbp: has no words",
    ),
    "an estimator without a colour": (
        "estimators", "emg/estimators/families/trees.py",
        'colour="load",\n        weight', 'colour="pink",\n        weight',
        "tree: has no colour",
    ),
    "a fault of the core without an entry": (
        "faults", "controllers/supervisor_faults.py", '("ringing",)', '("push",)',
        "ringing: has no entry in the catalogue",
    ),
    "a fault that does not say what to do": (
        "faults", "controllers/supervisor_faults.py",
        '"Check for a load, a collision or a changed robot; identify the robot again if it has changed."', '""',
        "unexplained: has no words, or does not say what to do",
    ),
    "a defect that no study searches for": (
        "defects", "study/find_defects.py", "sensor_range, clipped, frozen)\n", "sensor_range, clipped)\n",
        "frozen_encoder: no study searches for it",
    ),
    "a defect whose search is no longer called": (
        "defects", "joint/study/joint_case.py", "import echoed, worn\n", "import echoed\n",
        "worn: pellucid.joint.study.joint_case does not search for it",
    ),
}  # fmt: skip


@pytest.mark.parametrize("which", BATTERIES)
def test_every_entry_of_a_catalogue_is_whole(which):
    assert BATTERIES[which]() == []


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    return copied_package(tmp_path_factory.mktemp("half_added"))


@pytest.mark.nightly
def test_entries_that_are_half_added_are_found(copy):
    for _, name, old, new, _ in HALF_ADDED.values():
        text = (copy / name).read_text(encoding="utf-8")
        assert text.count(old) == 1
        (copy / name).write_text(text.replace(old, new), encoding="utf-8")
    run = (
        f"import sys\nsys.path.append({str(TESTS)!r})\n"
        "from pellucid.controllers.export import c_folder\n"
        # Entries are half added in Python: the same C++ was compiled above.
        "c_folder.record_outputs = lambda files, out: []\n"
        "from catalogue_batteries import BATTERIES\n"
        "for which, battery in BATTERIES.items():\n    print(*(f'{which}: {said}' for said in battery()), sep='\\n')\n"
    )
    done = run_copied(copy.parent, run)
    found = done.stdout + done.stderr
    assert [what for what, (which, *_, said) in HALF_ADDED.items() if f"{which}: {said}" not in found] == [], found
