"""Indices of co-contraction: known ones, intervals that hold, and bad input that is named."""

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.emg.cocontraction import cocontraction_over_time
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, report
from pellucid.study.procedures.run import cocontraction as run

TIME = np.arange(0.0, 10.0, 0.01)
STUDY = """
name = "pair"
[rig]
joint = "ankle"
motion = "rotary"
lifts = "extension"
[channels]
time = { column = "time", unit = "s" }
emg.tibialis = { column = "tibialis", unit = "1" }
emg.soleus = { column = "soleus", unit = "1" }
[cocontraction]
chain = "none"
pairs = [["tibialis", "soleus"]]
[[recordings]]
name = "walk"
file = "walk.csv"
"""


def study(folder, text=STUDY, change=lambda x: x):
    folder.mkdir()
    wave = 0.5 + 0.5 * np.sin(2.0 * np.pi * TIME)
    np.savetxt(
        folder / "walk.csv", np.column_stack([TIME, change(wave), 1.0 - wave]), delimiter=",",
        header="time,tibialis,soleus", comments="",
    )  # fmt: skip
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return open_study(folder)


def test_the_same_activity_is_common_altogether():
    x = 0.3 + 0.2 * np.sin(TIME)
    found = cocontraction_over_time(TIME, x, x)
    assert found.common.value == pytest.approx(100.0)
    assert found.weighed.value == pytest.approx(200.0 * x.mean(), rel=1e-2)


def test_muscles_that_alternate_have_nothing_in_common():
    on = (np.sin(2.0 * np.pi * TIME) > 0.0).astype(float)
    assert cocontraction_over_time(TIME, on, 1.0 - on).common.value == 0.0


def test_constant_envelopes_give_the_published_formulas():
    found = cocontraction_over_time(TIME, np.full(len(TIME), 0.6), np.full(len(TIME), 0.2))
    assert found.common.value == pytest.approx(100.0 * 2.0 * 0.2 / 0.8)
    assert found.weighed.value == pytest.approx(100.0 * (0.2 / 0.6) * 0.8)


def test_how_hard_they_work_counts_in_the_second_alone():
    x, y = 0.5 + 0.4 * np.sin(TIME), 0.5 + 0.4 * np.cos(TIME)
    whole, half = cocontraction_over_time(TIME, x, y), cocontraction_over_time(TIME, 0.5 * x, 0.5 * y)
    assert half.common.value == pytest.approx(whole.common.value)
    assert half.weighed.value == pytest.approx(0.5 * whole.weighed.value)


def test_intervals_hold_the_index_of_the_process():
    held = []
    truth = None
    for seed in range(40):
        rng = np.random.default_rng(seed)
        n = 2000 if seed else 400_000
        time = 0.01 * np.arange(n)
        slow = [np.convolve(rng.standard_normal(n + 40), np.ones(41) / np.sqrt(41), "valid") for _ in range(2)]
        found = cocontraction_over_time(time, np.abs(slow[0]), np.abs(slow[1])).common
        if truth is None:
            truth = found.value
            continue
        held.append(found.interval[0] <= truth <= found.interval[1])
    assert 0.85 <= np.mean(held) <= 1.0


def test_a_short_recording_has_no_interval():
    assert cocontraction_over_time(TIME[:300], TIME[:300], TIME[:300] + 0.1).common.interval is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda x: np.where(np.arange(len(x)) == 5, np.nan, x), "missing samples"),
        (lambda x: x - 1.0, "expected none below 0"),
        (lambda x: 0.0 * x, "found no activity in either"),
    ],
)
def test_what_is_no_envelope_is_refused(change, said):
    x = np.abs(np.sin(TIME))
    with pytest.raises(RecordingError, match=said):
        cocontraction_over_time(TIME, change(x), 0.0 * x)


def test_a_study_has_rows_and_a_page(tmp_path):
    opened = study(tmp_path / "pair")
    # Both envelopes reach 1: a scale of their own would make them so.
    assert {fault.kind for fault in check(opened)} == {"normalised_per_trial"}
    found = run(opened)
    rows = {row.id: row.value for row in found.rows}
    # The mean of the lower of two waves half a turn apart is 1/2 - 1/pi.
    assert rows["pair.walk.tibialis_soleus.falconer_winter"] == pytest.approx(100.0 - 200.0 / np.pi, rel=1e-3)
    assert "pair_1" in report(opened, found).read_text()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('["tibialis", "soleus"]', '["tibialis", "peroneus"]', "expected peroneus too"),
        ('["tibialis", "soleus"]', '["soleus", "soleus"]', "found soleus twice"),
        ('chain = "none"', 'chain = "hill"', "expected V for the chain hill"),
        ('tibialis", unit = "1"', 'tibialis", unit = "mV"', "expected an envelope"),
    ],
)
def test_a_study_that_cannot_be_answered_is_refused(tmp_path, old, new, said):
    opened = study(tmp_path / "pair", STUDY.replace(old, new))
    with pytest.raises(RecordingError, match=said):
        run(opened)
    assert "refuse" in {fault.severity for fault in check(opened)}
