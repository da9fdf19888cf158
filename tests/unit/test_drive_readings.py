"""A drive whose measurement is as accurate as stated is no fault, however long it runs; one that adds energy is."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid import _core
from pellucid_lab.drive_reading import EXACT_READING, DriveReading, stated_readings
from pellucid_lab.safety.fault_table import draw_worn_robot, with_stated_reading
from pellucid_lab.safety.worn_knee import draw_worn_knee
from pellucid_lab.safety.worn_knee import with_stated_reading as with_stated_spring

LIFE_S = 40.0
"""Length of a healthy life: without an allowance an error of the gain of 2 % is taken for a fault after 15 s."""


@pytest.fixture(scope="module")
def worn():
    return draw_worn_robot(0, seed=20281101)


@pytest.mark.parametrize("index", range(8))
@pytest.mark.parametrize("law", ["compensation", "force_sensor"])
def test_a_measurement_as_accurate_as_stated_is_no_fault(worn, law, index):
    inexact = with_stated_reading(worn, index)
    lived = inexact.live(inexact.law(law), longest=LIFE_S, seconds=np.inf)
    assert (lived["fault"], lived["periods"]) == ("none", round(LIFE_S / worn.rig.period))
    assert lived["surplus"] < inexact.law(law).supervision["drive_surplus"]


def test_without_an_allowance_a_small_error_of_the_gain_is_taken_for_a_fault(worn):
    inexact = replace(worn, reading=DriveReading(gain=1.02))
    strict = inexact.law("compensation", drive_gain=0.0, drive_offset=0.0, drive_forget=0.0)
    assert inexact.live(strict, longest=LIFE_S, seconds=np.inf)["fault"] == "drive_effort"
    assert inexact.live(inexact.law("compensation"), longest=LIFE_S, seconds=np.inf)["fault"] == "none"


def test_a_drive_that_says_that_it_adds_more_energy_than_its_accuracy_is_found(worn):
    adds = replace(worn, reading=DriveReading(gain=1.15))
    lived = adds.live(adds.law("compensation"), longest=LIFE_S, seconds=np.inf)
    assert lived["fault"] == "drive_effort"
    assert lived["periods"] * worn.rig.period < 10.0


def test_a_drive_that_gives_three_times_the_effort_is_found_by_every_stated_measurement(worn):
    for index in range(8):
        inexact = with_stated_reading(worn, index)
        lived = inexact.live(inexact.law("compensation"), "drive_triple", onset=3.0, seconds=10.0, longest=15.0)
        assert lived["early"] == 0
        assert 0 <= lived["found"] * worn.rig.period < 1.0


@pytest.mark.parametrize("index", [0, 7])
def test_a_knees_spring_measured_as_accurately_as_stated_is_no_fault(index):
    knee = with_stated_spring(draw_worn_knee(301), index)
    periods = round(20.0 / knee.rig.period)
    plant, acting = knee.start(periods + 1)
    seen, noise = plant.step(0.0, float("nan")), knee.reading.draw_noise(knee.seed)
    for k in range(periods):
        muscle = acting.step(k, *seen[:3])
        seen = plant.step(muscle, knee.emg_gain * muscle, noise[k])
    assert plant.fault == "none"


def test_a_reading_is_what_its_numbers_say():
    assert [_core.DriveReading(EXACT_READING.numbers, 1e-3).step(x) for x in (0.1, -2.0)] == [0.1, -2.0]
    lagging = _core.DriveReading(DriveReading(gain=1.1, offset=0.2, lag=2e-3).numbers, 1e-3)
    read = [lagging.step(1.0) for _ in range(3)]
    np.testing.assert_allclose(read, 0.2 + 1.1 * (1.0 - np.exp(-0.5 * np.arange(1, 4))), rtol=1e-12)
    coarse = _core.DriveReading(DriveReading(quantum=0.25).numbers, 1e-3)
    assert [coarse.step(0.3), coarse.step(0.3, 0.1)] == [0.25, 0.5]
    with pytest.raises(ValueError, match="drive_reading: expected a gain above 0"):
        _core.DriveReading([0.0, 0.0, 0.0, 0.0], 1e-3)
    assert {(one.gain, one.offset, one.lag) for one in stated_readings(10.0)} == {
        (gain, offset, lag) for gain in (0.95, 1.05) for offset in (-0.1, 0.1) for lag in (0.3e-3, 2e-3)
    }
