"""Movements and their indices from arrays: a movement of minimum jerk has indices that are known."""

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import RecordingError

T = np.arange(0.0, 30.0, 0.005)


def record(travel=0.6, seconds=1.0):
    """Up and down every three seconds, at minimum jerk; the target steps ahead of each."""
    share = np.clip((T % 3.0 - 1.0) / seconds, 0.0, 1.0)
    rise = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    up = T // 3.0 % 2 == 0
    return travel * np.where(up, rise, 1.0 - rise), travel * np.where(T % 3.0 < 0.5, ~up, up)


def test_indices_of_minimum_jerk():
    angle, target = record()
    for found in (
        pl.movement_indices(T, angle, lowpass=12.0),
        pl.movement_indices(T, angle, target=target, lowpass=12.0),
    ):
        assert found.count == 10
        assert found["direction"].tolist() == [1.0, -1.0] * 5
        np.testing.assert_allclose(found["peak_velocity"], 1.875 * 0.6, rtol=0.02)
        np.testing.assert_allclose(found["travel"], 0.6, rtol=0.02)
        np.testing.assert_allclose(found["peak_time"], 0.5, atol=0.02)
        np.testing.assert_allclose(found["sparc"], -1.40, atol=0.03)
    assert "10 movements" in str(found)
    assert "<table" in found._repr_html_()
    assert set(found) == set(found.columns)


def test_a_lost_marker_leaves_its_movement_out():
    angle, target = record()
    angle[(T > 13.2) & (T < 13.6)] = np.nan
    found = pl.movement_indices(T, angle, target=target, lowpass=12.0)
    assert found.count == 9
    assert found.left_out == {"lost": 1}
    assert "excluded: 1 lost" in str(found)


def test_what_holds_no_movement_is_refused():
    with pytest.raises(RecordingError, match="found none in 0 stretches"):
        pl.movement_indices(T, np.zeros(len(T)))
    with pytest.raises(RecordingError, match=r"of the shapes \[\(6000,\), \(5,\)\]"):
        pl.movement_indices(T, np.zeros(5))
