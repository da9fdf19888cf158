"""Angle of a segment from two markers: known rotations in any direction of the room, and what has no angle."""

from pathlib import Path

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.files.optical import OpticalRecording
from pellucid.people.movements import segment_angle


def seen(angle, heading=0.7, down=(0.0, 0.0, -1.0), out_of_plane=0.0):
    down = np.array(down) / np.linalg.norm(down)
    side = np.linalg.svd(down[None, :])[2][1:]  # two directions across gravity
    forward = np.cos(heading) * side[0] + np.sin(heading) * side[1]
    normal = np.cross(down, forward)
    elbow = np.array([0.3, -0.2, 1.1]) + 0.01 * np.sin(np.arange(len(angle)))[:, None]
    wrist = elbow + 0.25 * (np.sin(angle)[:, None] * forward + np.cos(angle)[:, None] * down + out_of_plane * normal)
    time = np.arange(len(angle)) / 100.0
    return OpticalRecording(Path("x.csv"), "0", time, {"elbow": elbow, "wrist": wrist}, down)


@pytest.mark.parametrize("down", [(0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (0.3, 0.1, -1.0)])
@pytest.mark.parametrize("heading", [0.0, 2.0, 4.0])
def test_the_angle_is_that_with_the_vertical_towards_where_it_points(down, heading):
    angle = np.linspace(0.3, 2.4, 50)
    assert segment_angle(seen(angle, heading, down), "elbow", "wrist") == pytest.approx(angle, abs=1e-9)


def test_it_may_swing_past_hanging_and_lean_out_of_the_plane():
    angle = np.linspace(-0.4, 1.8, 60)
    assert segment_angle(seen(angle, out_of_plane=0.1), "elbow", "wrist") == pytest.approx(angle, abs=0.08)


def test_lost_frames_stay_lost():
    made = seen(np.linspace(0.5, 1.5, 20))
    wrist = made.markers["wrist"].copy()
    wrist[3:6] = np.nan
    lost = OpticalRecording(made.path, "0", made.time, {"elbow": made.markers["elbow"], "wrist": wrist}, made.down)
    angle = segment_angle(lost, "elbow", "wrist")
    assert np.flatnonzero(np.isnan(angle)).tolist() == [3, 4, 5]


def test_what_has_no_angle_is_refused():
    with pytest.raises(RecordingError, match="found the markers elbow, wrist, expected hand"):
        segment_angle(seen(np.ones(5)), "elbow", "hand")
    with pytest.raises(RecordingError, match="points 0 % to a side"):
        segment_angle(seen(np.zeros(5)), "elbow", "wrist")
    with pytest.raises(RecordingError, match="0 mm apart"):
        segment_angle(seen(np.ones(5)), "elbow", "elbow")
    made = seen(np.ones(5))
    blind = {"elbow": made.markers["elbow"], "wrist": np.full((5, 3), np.nan)}
    with pytest.raises(RecordingError, match="no frame that saw both"):
        segment_angle(OpticalRecording(made.path, "0", made.time, blind, made.down), "elbow", "wrist")
