"""The head of a calibration's page: its answer, its tiles and the clock of its first figure."""

import numpy as np
import pytest

from pellucid.emg.estimators.emg_worth import EmgWorth
from pellucid.emg.study.emg_torque.calibrate import CalibrationResult
from pellucid.emg.study.emg_torque.calibration_page import _worth_tile, torque_trace
from pellucid.emg.study.emg_torque.torque_findings import RecordingWorth
from pellucid.models.estimates import Verdict

GAIN = EmgWorth(0.25, 0.08, 0.43, 0.05, 12)


def result(*verdicts, recordings=("squat",)):
    worth = tuple(RecordingWorth("trunk", recording, GAIN) for recording in recordings)
    parts = {"tables": (), "rows": (), "cards": {}, "checksums": {}}
    return CalibrationResult(study="lifting", headline="", worth=worth, verdicts=verdicts, **parts)


def test_a_band_that_may_not_hold_says_nothing_against_the_worth_of_emg():
    """The gain is that of predictions; the warning on a band leaves it as it is."""
    plain, doubted = (result(*verdicts).answer for verdicts in ((), (Verdict("warning", "", finding="bands"),)))
    assert plain == doubted
    (adds,) = plain.parts
    assert (adds.name, adds.verdict) == ('EMG over angles alone, trunk, recording "squat"', "yes")
    assert "gain in R² +0.25, 95 % interval +0.08 to +0.43" in adds.reason


def test_one_answer_is_not_counted():
    assert _worth_tile(result()).more.endswith("worth it")
    assert _worth_tile(result(recordings=("squat", "stoop"))).more.endswith("worth it: 2")


@pytest.mark.parametrize(("start", "label"), [(24.0, "Time (s)"), (1.667e9, "Time since the first sample (s)")])
def test_a_date_is_drawn_from_the_first_sample_on(start, label):
    time, torque = start + np.arange(200) / 50.0, np.sin(np.arange(200) / 9.0)
    drawing = torque_trace(
        time, torque, {"ridge": torque, "motion": torque}, "torque_1", chosen="ridge", bare="motion",
        words={"ridge": "ridge", "motion": "angles"}, caption="",
    )  # fmt: skip
    top, bottom = drawing.figure.axes
    assert bottom.get_xlabel() == label
    assert max(np.max(each.get_xdata()) for each in top.lines) == pytest.approx(28.0 if start == 24.0 else 4.0, abs=0.1)
