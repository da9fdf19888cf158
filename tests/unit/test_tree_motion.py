"""Motions of all joints at once: both sides alike, rows that count, segments between common stops."""

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.arm.tree_motion import tree_motion_of
from pellucid.numerics.motion import Filtering

FS = 500.0
FILTERING = Filtering(lowpass=20.0, decimate=5, dead_band=0.05, trim=50)


def stopping(stops=6, seconds=1.0):
    """Two joints that stop together `stops` times: time (n,), position, velocity, acceleration (n, 2)."""
    t = np.arange(int(FS * seconds * stops)) / FS
    w = np.array([2.0, -1.0]) * 2 * np.pi / seconds
    phase = 2 * np.pi * t / seconds
    amplitude = np.array([0.1, 0.2])
    # 1 - cos: its speed and place begin and end each period at rest.
    q = amplitude * (1.0 - np.cos(phase))[:, None] * np.sign(w)
    v = amplitude * np.sin(phase)[:, None] * 2 * np.pi / seconds * np.sign(w)
    a = amplitude * np.cos(phase)[:, None] * (2 * np.pi / seconds) ** 2 * np.sign(w)
    return t, q, v, a


def test_rows_have_the_angles_that_were_recorded():
    """Efforts depend on angles by sines: a filter that changes an angle by one percent would look like a spring."""
    t = np.arange(0.0, 40.0, 1.0 / FS)
    slow = np.column_stack([1.0 + 0.5 * np.sin(2.0 * np.pi * 0.3 * t), np.cos(2.0 * np.pi * 1.5 * t)])
    made = tree_motion_of(t, slow, np.zeros_like(slow), Filtering(lowpass=10.0, decimate=24, trim=100))
    np.testing.assert_allclose(made.position[20:-20], slow[100:-100:24][20:-20], atol=2e-4)


def test_rows_are_what_was_moved():
    t, q, v, a = stopping()
    drive = np.column_stack([np.sin(3 * t), np.cos(5 * t)])
    made = tree_motion_of(t, q, drive, FILTERING, gain=np.array([2.0, -3.0]), turns=np.array([[1.0, 0.0], [0.5, 1.0]]))
    rows = slice(50, len(t) - 50, 5)
    np.testing.assert_allclose(made.time, t[rows])
    np.testing.assert_allclose(made.position, q[rows], atol=1e-4)
    np.testing.assert_allclose(made.velocity, v[rows], atol=5e-3)
    np.testing.assert_allclose(made.acceleration, a[rows], atol=5e-2)
    efforts = drive[rows] * [2.0, -3.0]
    np.testing.assert_allclose(made.effort[:, 0], efforts[:, 0] + 0.5 * efforts[:, 1], atol=1e-3)
    np.testing.assert_allclose(made.effort[:, 1], efforts[:, 1], atol=1e-3)
    assert made.rate == FS / 5
    # A joint that shares a motor counts only where that motor turns too.
    turning = np.abs(made.velocity @ [0.5, 1.0]) > 0.05
    np.testing.assert_array_equal(made.moving, (np.abs(made.velocity) > 0.05) & turning[:, None])


def test_a_recorded_velocity_is_taken():
    t, q, v, a = stopping()
    made = tree_motion_of(t, q, q, FILTERING, velocity=2.0 * v)
    np.testing.assert_allclose(made.velocity, 2.0 * v[50:-50:5], atol=1e-3)
    np.testing.assert_allclose(made.acceleration, 2.0 * a[50:-50:5], atol=2e-2)


def test_segments_lie_between_common_stops():
    t, q, _, _ = stopping(6)
    made = tree_motion_of(t, q, q, FILTERING)
    # Each period has a stop in its middle too.
    assert set(made.segment) == {-1, *range(12)}
    assert not made.moving[made.segment < 0].any()
    assert all(np.ptp(made.time[made.segment == s]) < 0.5 for s in range(12))


def test_segments_are_equal_parts_where_joints_never_stop_together():
    t, q, _, _ = stopping(6)
    q = np.column_stack([q[:, 0], 0.3 * np.sin(7.0 * t)])
    made = tree_motion_of(t, q, q, FILTERING)
    assert set(made.segment) == set(range(10))
    assert set(np.unique(made.segment, return_counts=True)[1]) <= {len(made) // 10, len(made) // 10 + 1}
    assert set(tree_motion_of(t, q, q, FILTERING, segments=4).segment) == set(range(4))
    ended = tree_motion_of(t, q, q, FILTERING, segments=[2.0, 5.0])
    assert set(ended.time[ended.segment == -1] >= 5.0) == {True}
    assert ended.time[ended.segment == 0].max() < 2.0 <= ended.time[ended.segment == 1].min()


def test_a_low_pass_beyond_the_rate_is_refused():
    t, q, _, _ = stopping()
    with pytest.raises(RecordingError, match="found a low-pass of 300 Hz"):
        tree_motion_of(t, q, q, Filtering(lowpass=300.0))
