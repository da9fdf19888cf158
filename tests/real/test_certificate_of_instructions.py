"""People who point quickly or precisely, as told: a within-subject factor of known direction, through `assess`."""

import shutil

import pytest

from pellucid.people.study.assessment_page import page
from pellucid.people.study.certified_rows import certificate_table
from pellucid.people.study.primary_change import primary_change
from pellucid.study.pages.values import plain_text
from pellucid.study.procedures.print_result import print_to_text
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import assess

PEOPLE, CONDITIONS, BLOCKS = (1, 2, 8), {"3": "balance", "2": "speed", "5": "full_accuracy"}, (1, 3)

HEAD = """name = "instructions"
[rig]
joint = "hand"
motion = "prismatic"
[assessment]
control = "balance"
# These movements last 0.3 s, corrections 0.2 s: a low-pass at 3 Hz doubles their durations.
lowpass = "12 Hz"
[assessment.margins]
duration_median = "60 %"
[channels]
time = { column = "Time (in s)", unit = "s" }
position = { column = "X screen corrected (mm)", unit = "mm" }
"""


@pytest.fixture(scope="module")
def folder(data_folder, tmp_path_factory):
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
    return folder


@pytest.fixture(scope="module")
def found(folder):
    return assess(open_study(folder))


def test_the_settings_above_the_table_are_passed_over_and_time_goes_the_way_of_the_instruction(found):
    assert found.participants == ("P1", "P2", "P8")
    duration = found.assessed["duration_median"].table
    assert (duration.column("full_accuracy") > duration.column("balance")).all()
    assert (duration.column("speed") < duration.column("full_accuracy")).all()


@pytest.mark.parametrize("condition", ["speed", "full_accuracy"])
def test_one_change_of_recorded_people_is_one_number_everywhere(folder, found, condition):
    """Headline, tile, certificate, text, row and terminal tell the same change of the median duration."""
    change = primary_change(found, "duration_median", condition)
    told, rows = change.text, {row.id: row.value for row in found.rows}
    tiles = {tile.what: tile.figure for tile in page(open_study(folder), found).tiles}
    assert told in found.headline.replace("\N{MINUS SIGN}", "-")
    label = f"Median duration, {condition.replace('_', ' ')}"
    figure = plain_text(tiles.get(label, "")).replace("\N{MINUS SIGN}", "-")
    others = ("speed", "full_accuracy")
    least = min(others, key=lambda c: abs(primary_change(found, "duration_median", c).value))
    assert figure == (told.removesuffix(" %") if condition == least else "")  # the least changed one has tiles
    assert told in {row[2] for row in certificate_table(found).rows if row[0] == condition}
    assert f"({told}, 95 % CI" in found.paragraph.replace("\N{MINUS SIGN}", "-")
    assert rows[f"instructions.transparency.duration_median.{condition}"] == pytest.approx(change.value, rel=1e-12)
    certified = rows[f"instructions.certificate.{condition}.duration_median.change"]
    assert certified == pytest.approx(change.value, rel=1e-12)
    assert told.removesuffix(" %") in print_to_text(found).replace("\N{MINUS SIGN}", "-")


def test_three_people_cannot_say(found):
    said = {each.condition: each.certificate.verdict for each in found.certified}
    assert said == {"speed": "cannot say", "full_accuracy": "cannot say"}
    assert all(each.certificate.p_value >= 1 / 8 for each in found.certified)
