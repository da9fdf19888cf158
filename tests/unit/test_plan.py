"""Planning a certificate before there are recordings: numbers of the search itself, wherever it runs, and what is
refused."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pellucid._errors import PellucidError, RecordingError, StudyError
from pellucid.people.equivalence import Margin
from pellucid.people.power import Active, find_equivalence_participants, participants_for_changes
from pellucid.people.study.plan import plan
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check

STUDY = """name = "planned"
[rig]
joint = "elbow"
motion = "rotary"
[channels]
time = { column = "time", unit = "s" }
[assessment]
control = "Ctrl"
[assessment.margins]
duration_median = "10 %"
end_absolute = "2 deg"
[assessment.spreads]
"""
SPREADS = 'duration_median = "3 %"\nend_absolute = "0.6 deg"\n'


@pytest.fixture
def study(tmp_path):
    def made(spreads=SPREADS, head=STUDY):
        (tmp_path / "study.toml").write_text(head + spreads, encoding="utf-8")
        return open_study(tmp_path)

    return made


@pytest.mark.nightly
def test_it_is_the_search_of_the_certificate(study):
    found = plan(study(), studies=300)
    margins = [Margin.of_ratio(0.1), Margin(-np.inf, np.radians(2.0))]
    spread = np.array([np.log1p(0.03), np.radians(0.6)])
    third = np.array([margin.high for margin in margins]) / 3.0
    active = Active(order=True, learning=True)
    needed = find_equivalence_participants(np.diag(spread**2), margins, change=third, active=active, studies=300)
    assert found.heads[3:] == ("Median duration", "End-point error")
    rows = {row[0]: row[1:] for row in found.rows}
    assert rows["a third"][0] == (needed or ">128")
    # Together asks for no fewer than each alone, and going together for no more, within what 300 studies tell.
    for together, correlated, *alone in rows.values():
        assert max(alone) - 3 <= correlated <= together + 3
    assert rows["none"][0] < rows["a half"][0]


@pytest.mark.nightly
def test_it_is_the_same_wherever_it_runs(study):
    with ThreadPoolExecutor(2) as pool:
        assert plan(study(), studies=200, executor=pool).rows == plan(study(), studies=200).rows


@pytest.mark.parametrize(
    ("spreads", "said"),
    [
        ('duration_median = "3 %"\n', "expected those of duration_median, end_absolute"),
        (SPREADS.replace("3 %", "60 ms"), "of the kind of its margin, 10 %"),
        (SPREADS.replace("0.6 deg", "0 deg"), "above 0"),
    ],
)
def test_spreads_that_do_not_fit_are_told(study, spreads, said):
    with pytest.raises(StudyError, match=said):
        plan(study(spreads))


def test_without_margins_there_is_nothing_to_plan(study):
    with pytest.raises(StudyError, match=r"no \[assessment.margins\]"):
        plan(study("", STUDY.partition("[assessment.margins]")[0]))
    with pytest.raises(PellucidError, match="expected one above 0"):
        participants_for_changes([0.1], [], (0.0,), (0.0,))


def test_a_number_of_people_that_cannot_certify_is_refused(study):
    with pytest.raises(StudyError, match="found 8 participants, expected at least 12"):
        plan(study(), participants=8, studies=200)
    found = plan(study(), participants=20, studies=200)
    assert found.heads[-1] == "Power with 20 people (%)"
    assert found.rows[0][-1] > found.rows[-1][-1]


@pytest.mark.nightly
def test_a_pilots_own_people_may_take_the_place_of_normal_ones(study):
    rng = np.random.default_rng(4)
    skewed = np.exp(rng.standard_normal((12, 2))) * np.array([0.02, 0.006])
    pilot = {"duration_median": skewed[:, 0], "end_absolute": skewed[:, 1]}
    found = plan(study(), pilot=pilot, studies=300)
    assert "resampled from the pilot's 12" in found.note
    with pytest.raises(StudyError, match="expected end_absolute too"):
        plan(study(), pilot={"duration_median": skewed[:, 0]}, studies=200)


def test_a_plan_tells_its_progress_and_what_it_is_based_on(study):
    shares = []
    found = plan(study(), studies=100, participants=20, on_progress=lambda text, share: shares.append(share))
    assert shares == sorted(shares)
    assert len(set(shares)) > 10
    assert shares[-1] < 1.0
    assert found.answer.basis.sentence == (
        "Based on 100 experiments, simulated; numbers are of people sampled from the spreads that study.toml states."
    )


def test_a_study_without_a_recording_is_not_fit(study):
    """A plan has no recordings yet; `check` said that they are fit."""
    with pytest.raises(RecordingError, match="has no recording, expected one or more"):
        check(study())
