"""What is said of the time from EMG to force."""

from types import SimpleNamespace

import numpy as np

from pellucid.emg.study.emg_torque.calibrate import calibration_answer
from pellucid.emg.study.emg_torque.torque_findings import electromechanical_delay_verdict


def test_a_delay_of_people_is_a_note():
    said = electromechanical_delay_verdict("knee", np.array([0.03, 0.095]))
    assert said.kind == "note"
    assert "electromechanical delay" in said.said
    assert "30 to 95 ms" in said.said


def test_a_delay_beyond_people_is_the_stream_s():
    said = electromechanical_delay_verdict("knee", np.array([0.103, 0.21]))
    assert said.kind == "warning"
    assert "103 to 210 ms" in said.said
    assert "stream is probably ahead" in said.said


def test_streams_that_share_no_clock_are_the_first_step():
    """Steps asked for more recordings with the same fault; the delay stood in a warning alone."""
    said = electromechanical_delay_verdict("knee", np.array([0.118, 0.2]))
    result = SimpleNamespace(chosen=(), worth=(), checksums={}, headline="", live={}, verdicts=(said,), computed="")
    first, *_ = calibration_answer(result).next
    assert first.text.startswith("Check that EMG and torque share a clock, and that no causal filter delays the torque")
    assert first.text.endswith("is 118 to 200 ms, more than the physiological 10 to 100 ms")
    result.verdicts = (electromechanical_delay_verdict("knee", np.array([0.03, 0.095])),)
    assert "clock" not in calibration_answer(result).next[0].text
