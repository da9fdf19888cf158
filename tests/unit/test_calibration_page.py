"""The head of a calibration's page: its answer, its tiles and the clock of its first figure."""

import numpy as np
import pytest

from pellucid.emg.estimators.emg_worth import EmgWorth
from pellucid.emg.study.emg_torque.calibrate import INVALID_BANDS_FINDING, CalibrationResult
from pellucid.emg.study.emg_torque.calibration_page import _answer, _worth_tile, torque_trace
from pellucid.emg.study.emg_torque.torque_findings import RecordingWorth
from pellucid.models.estimates import Verdict

GAIN = EmgWorth(0.25, 0.08, 0.43, 0.05, 12)


def result(*verdicts, recordings=("squat",)):
    worth = tuple(RecordingWorth("trunk", recording, GAIN) for recording in recordings)
    parts = {"tables": (), "rows": (), "cards": {}, "checksums": {}}
    return CalibrationResult(study="lifting", headline="", worth=worth, verdicts=verdicts, **parts)


@pytest.mark.parametrize(
    ("verdict", "answer"),
    [
        (Verdict("note", "of envelopes"), "yes"),
        (Verdict("warning", "Bands are not known to hold.", finding=INVALID_BANDS_FINDING), "yes"),
        (Verdict("wrong", "The scale is not one."), "unsure"),
    ],
)
def test_a_band_that_may_not_hold_says_nothing_against_the_worth_of_emg(verdict, answer):
    assert _answer(result(verdict), ()).verdict == answer


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
