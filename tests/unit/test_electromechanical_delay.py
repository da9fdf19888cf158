"""What is said of the time from EMG to force."""

import numpy as np

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
