"""One IMU: dropouts and frozen sensors refused by name, orientation, clocks, wraps, and an encoder's angle."""

from pathlib import Path

import numpy as np
import pytest
from inertial_motion import FIELD, GRAVITY

from pellucid._errors import PellucidError
from pellucid.files.recording import Channel, Recording
from pellucid.numerics.clocks import align, clock_drift
from pellucid.numerics.resampling import resample, spline_bandwidth
from pellucid.numerics.wrapping import unwrap
from pellucid.orthosis.imu.imu_angle import (
    Inertial,
    compare_filters,
    fit_angle,
    inertial,
    orientation,
    principal_axis,
    segment_angle,
    twist,
)


def swing(time):
    ramp = np.clip(time / 3.0, 0.0, 1.0)
    return ramp * (0.7 * np.sin(1.7 * time) + 0.3 * np.sin(2.9 * time))


def swinging(rng, *, fs=20.0, seconds=60.0, noise=0.005) -> Inertial:
    """A leg that swings about its level axis, y, with an IMU on it."""
    time = np.arange(round(fs * seconds)) / fs
    angle, small = swing(time), 1e-4
    rate = (swing(time + small) - swing(time - small)) / (2.0 * small)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]

    def seen(v):
        turned = np.concatenate([cos * v[0] - sin * v[2], np.full_like(cos, v[1]), sin * v[0] + cos * v[2]], axis=1)
        return turned

    rates = np.zeros((len(time), 3))
    rates[:, 1] = rate
    return Inertial(
        time,
        rates + noise * rng.standard_normal(rates.shape),
        seen(GRAVITY) + 5.0 * noise * rng.standard_normal(rates.shape),
        seen(FIELD) + 1e-7 * rng.standard_normal(rates.shape),
    )


def recording(imu: Inertial, *, magnetometer=True) -> Recording:
    groups = {"angular_velocity": imu.angular_velocity, "acceleration": imu.acceleration}
    if magnetometer:
        groups["magnetic_field"] = imu.magnetic_field
    channels = {"time": Channel("time", imu.time, "s", "t")}
    for name, values in groups.items():
        for k, c in enumerate("xyz"):
            channel = f"imu.{name}.{c}"
            channels[channel] = Channel(channel, values[:, k], "1", channel)
    return Recording("leg", Path("leg_imu.csv"), "0", "fit", channels)


def without(imu: Inertial, kept: np.ndarray) -> Inertial:
    return Inertial(imu.time[kept], imu.angular_velocity[kept], imu.acceleration[kept], imu.magnetic_field[kept])


def test_short_dropouts_are_bridged_and_counted(rng):
    imu = swinging(rng)
    rows_lost = (imu.time > 20.01) & (imu.time < 20.99)
    found = inertial(recording(without(imu, ~rows_lost)))
    assert len(found) == len(imu)
    assert found.interpolated == rows_lost.sum()
    values_lost = Inertial(
        imu.time, np.where(rows_lost[:, None], np.nan, imu.angular_velocity), imu.acceleration, imu.magnetic_field
    )
    assert inertial(recording(values_lost)).interpolated == rows_lost.sum()


@pytest.mark.parametrize("as_rows", [True, False])
def test_a_dropout_of_two_seconds_is_refused_by_name(rng, as_rows):
    imu = swinging(rng)
    lost = (imu.time > 20.01) & (imu.time < 22.06)
    if as_rows:
        broken = without(imu, ~lost)
    else:
        broken = Inertial(imu.time, np.where(lost[:, None], np.nan, imu.angular_velocity), imu.acceleration)
    with pytest.raises(PellucidError, match=r"leg_imu.csv .*channel imu.angular_velocity: .*20\.000 s to 22\.100 s"):
        inertial(recording(broken, magnetometer=False) if not as_rows else recording(broken))


def test_a_frozen_sensor_is_refused(rng):
    imu = swinging(rng)
    force = imu.acceleration.copy()
    force[600:660] = force[600]
    with pytest.raises(PellucidError, match=r"imu.acceleration: the sensor is frozen: one value from 30\.000 s"):
        inertial(recording(Inertial(imu.time, imu.angular_velocity, force, imu.magnetic_field)))


def test_nine_axes_without_a_magnetometer_are_refused(rng):
    imu = swinging(rng)
    with pytest.raises(PellucidError, match=r"no channel imu.magnetic_field.x.*nine axes need a magnetometer"):
        inertial(recording(imu, magnetometer=False), magnetometer=True)
    with pytest.raises(PellucidError, match="nine axes need a magnetometer"):
        orientation(Inertial(imu.time, imu.angular_velocity, imu.acceleration), axes=9)


def test_a_missing_sample_is_not_handed_to_a_filter(rng):
    imu = swinging(rng)
    rate = imu.angular_velocity.copy()
    rate[100, 1] = np.nan
    with pytest.raises(PellucidError, match=r"angular velocity is not finite at 5\.000 s"):
        orientation(Inertial(imu.time, rate, imu.acceleration))


@pytest.mark.parametrize("method", ["madgwick", "vqf"])
@pytest.mark.parametrize("axes", [6, 9])
def test_orientation_follows_a_swing(rng, method, axes):
    imu = swinging(rng, fs=100.0)
    found = orientation(imu, method, axes=axes)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    axis, share = principal_axis(imu.angular_velocity)
    np.testing.assert_allclose(axis, [0, 1, 0], atol=0.01)
    assert share > 0.99
    off = segment_angle(found, axis) - swing(imu.time)
    late = off[1000:] - off[1000:].mean()
    assert np.degrees(np.sqrt(np.mean(late**2))) < 2.0


def test_a_heading_that_drifts_does_not_change_the_angle_about_a_level_axis(rng):
    from pellucid.orthosis.imu.imu_angle import multiply

    angle, heading = swing(np.linspace(0, 20, 400)), np.linspace(0.0, 2.0, 400)
    zero = np.zeros(400)
    turn = np.stack([np.cos(angle / 2), zero, np.sin(angle / 2), zero], axis=-1)
    drift = np.stack([np.cos(heading / 2), zero, zero, np.sin(heading / 2)], axis=-1)
    np.testing.assert_allclose(twist(multiply(drift, turn), np.array([0.0, 1.0, 0.0])), angle, atol=1e-12)


def test_a_delay_is_found_to_a_fraction_of_a_sample(rng):
    time, fast = np.arange(0, 60, 0.05), np.arange(0, 60, 0.002)
    found = align(
        time, np.gradient(swing(time), time) + 0.01 * rng.standard_normal(len(time)),
        fast, -1.5 * np.gradient(swing(fast - 0.137), fast) + 0.2, longest=1.0,
    )  # fmt: skip
    assert abs(found.delay - 0.137) < 4.0 * found.delay_error < 0.005
    assert found.gain == pytest.approx(-1.5, abs=0.02)


def test_a_clock_that_runs_fast_is_found(rng):
    time, fast = np.arange(0, 300, 0.05), np.arange(0, 301, 0.02)
    shown = np.gradient(swing((fast - 0.1) / (1.0 + 2e-4)), fast)
    parts = []
    for start, stop in ((0, 60), (240, 300)):
        part = (time >= start) & (time < stop)
        rate = np.gradient(swing(time), time)[part] + 0.01 * rng.standard_normal(part.sum())
        inside = (fast >= start) & (fast <= stop)
        parts.append(align(time[part], rate, fast[inside], shown[inside], longest=0.5))
    drift, error = clock_drift(*parts)
    assert abs(drift - 2e-4) < 4.0 * error
    assert error < 5e-5


def test_two_motions_that_have_nothing_in_common_are_not_aligned(rng):
    time = np.arange(0, 60, 0.05)
    with pytest.raises(PellucidError, match="not two records of one motion"):
        align(time, np.sin(2 * time), time, rng.standard_normal(len(time)), longest=0.5)


def test_resampling_has_no_delay_and_the_bandwidth_it_states():
    slow, fast = np.arange(0, 40, 0.05), np.arange(5, 35, 0.002)
    cut = spline_bandwidth(20.0)
    assert 8.0 < cut < 10.0
    found = resample(slow, np.sin(2 * np.pi * cut * slow), fast).samples
    basis = np.stack([np.sin(2 * np.pi * cut * fast), np.cos(2 * np.pi * cut * fast)], axis=-1)
    amplitude, quadrature = np.linalg.lstsq(basis, found, rcond=None)[0]
    assert amplitude == pytest.approx(0.5**0.5, abs=0.01)
    assert abs(quadrature) < 0.01
    assert np.isnan(resample(slow, slow, np.array([-0.1, 40.1])).samples).all()


def test_an_angle_that_wraps_in_mid_trial_is_found_and_said():
    time = np.arange(0, 20, 0.01)
    true = 0.5 * time - 4.0
    found = unwrap(np.angle(np.exp(1j * true)))
    np.testing.assert_allclose(np.diff(found.angle), np.diff(true), atol=1e-12)
    assert len(found.wraps) == 2
    assert "wraps by a whole turn 2 times (at 1.72 s" in found.said("position", time)


def test_every_filter_is_compared_with_an_encoder_on_another_clock(rng):
    imu = swinging(rng)
    time = np.arange(0.0, 55.0, 0.002)
    alignment, errors = compare_filters(imu, time, 0.1 - swing(time - 0.23), fit_until=25.0)
    assert alignment.delay == pytest.approx(0.23, abs=0.005)
    assert {(e.method, e.axes) for e in errors} == {(m, a) for m in ("madgwick", "vqf") for a in (6, 9)}
    assert min(np.degrees(e.heldout) for e in errors if e.inputs == "axis") < 1.0


def test_a_regression_on_a_segment_that_does_not_move_is_refused():
    with pytest.raises(PellucidError, match="do not determine"):
        fit_angle(np.ones(100), np.ones(100))
