"""Margins of study.toml against a study's indices: what passes, what fails, what cannot be said, what is refused."""

import re

import made_pointing
import pytest

from pellucid._errors import StudyError
from pellucid.procedures.assessment.certified import certificate_rows
from pellucid.procedures.registry import open_study
from pellucid.procedures.run import assess


def with_margins(study, margins):
    path = study.folder / "study.toml"
    told = re.sub(r"\n\[assessment\.margins\][^[]*", "\n", path.read_text(encoding="utf-8"))
    path.write_text(told + "\n[assessment.margins]\n" + margins + "\n", encoding="utf-8")
    return open_study(study.folder)


@pytest.fixture(scope="module")
def pointing(tmp_path_factory):
    return made_pointing.study(tmp_path_factory.mktemp("margins"))


def test_wide_margins_hold_and_narrow_ones_fail(pointing):
    found = assess(with_margins(pointing, 'duration_median = "60 %"\nvmax = "60 %"\ntorque_rms = "0.6 N*m"'))
    said = {each.condition: each.certificate.verdict for each in found.certified}
    assert said == dict.fromkeys(("FC", "PCFr", "CLPC"), "transparent")
    slowest = max(made_pointing.SLOWER, key=made_pointing.SLOWER.get)
    found = assess(with_margins(pointing, 'duration_median = "2 %"\ntorque_rms = "0.6 N*m"'))
    of = {each.condition: each for each in found.certified}
    assert of[slowest].certificate.verdict == "not transparent"
    assert of[slowest].certificate.said_of("torque_rms") == "within"
    row = {r.id.partition(".certificate.")[2]: r for r in certificate_rows(found, None)}
    assert row[f"{slowest.lower()}.transparent"].value == 0.0
    # A ratio is shown as one: the change that was made.
    made = 100.0 * (made_pointing.SLOWER[slowest] - 1.0)
    assert row[f"{slowest.lower()}.duration_median.change"].value == pytest.approx(made, abs=4.0)
    assert row[f"{slowest.lower()}.duration_median.change"].unit == "%"
    assert row[f"{slowest.lower()}.torque_rms.high"].value == pytest.approx(0.38, abs=0.05)


@pytest.mark.parametrize(
    ("margins", "said"),
    [
        ('smoothness = "10 %"', "expected one of"),
        ('vmax = "10 deg"', "rad/s"),
        ('vmax = "-10 %"', "above 0"),
        ('sparc = "10 %"', "no zero"),
        ('torque_rms = "10 %"', "without the robot"),
        ('emg_level = "10 %"', "was not recorded"),
    ],
)
def test_a_margin_that_cannot_be_held_against_anything_is_told(pointing, margins, said):
    with pytest.raises(StudyError, match=said):
        assess(with_margins(pointing, margins))
