"""People who point quickly or precisely, as told: a within-subject factor of known direction, through `assess`."""

import shutil

import pytest

from pellucid.procedures.registry import open_study
from pellucid.procedures.run import assess

PEOPLE, CONDITIONS, BLOCKS = (1, 2, 8), {"3": "balance", "2": "speed", "5": "full_accuracy"}, (1, 3)

HEAD = """name = "instructions"
[rig]
joint = "hand"
motion = "prismatic"
[assessment]
control = "balance"
[assessment.margins]
duration_median = "60 %"
[channels]
time = { column = "Time (in s)", unit = "s" }
position = { column = "X screen corrected (mm)", unit = "mm" }
"""


@pytest.fixture(scope="module")
def found(data_folder, tmp_path_factory):
    source = data_folder / "human_pointing"
    if not source.is_dir():
        pytest.skip("no recordings of human_pointing")
    folder = tmp_path_factory.mktemp("instructions")
    (folder / "recordings").mkdir()
    told = [HEAD, *(f'[participants.P{person}]\nmass = "70 kg"\n' for person in PEOPLE)]
    for person in PEOPLE:
        for key, condition in CONDITIONS.items():
            for block in BLOCKS:
                name = f"P{person}_{key}1{block}.csv"
                shutil.copy(source / name, folder / "recordings")
                told.append(
                    f'[[recordings]]\nname = "P{person}_{condition}_{block}"\nfile = "recordings/{name}"\n'
                    f'participant = "P{person}"\ncondition = "{condition}"\n'
                )
    (folder / "study.toml").write_text("".join(told), encoding="utf-8")
    return assess(open_study(folder))


def test_the_settings_above_the_table_are_passed_over_and_time_goes_the_way_of_the_instruction(found):
    assert found.participants == ("P1", "P2", "P8")
    duration = found.assessed["duration_median"].table
    assert (duration.column("full_accuracy") > duration.column("balance")).all()
    assert (duration.column("speed") < duration.column("full_accuracy")).all()


def test_three_people_cannot_say(found):
    said = {each.condition: each.certificate.verdict for each in found.certified}
    assert said == {"speed": "cannot say", "full_accuracy": "cannot say"}
    assert all(each.certificate.p_value >= 1 / 8 for each in found.certified)
