"""SPARC and LDLJ against what minimum jerk has in closed form, and against what they must do."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from pellucid._errors import RecordingError
from pellucid.people.indices import log_dimensionless_jerk, normalised_jerk, spectral_arc_length


def speed(duration, fs=1000.0, parts=((0.0, 1.0, 1.0),)):
    s = np.arange(round(duration * fs) + 1) / (duration * fs)
    v = np.zeros(len(s))
    for start, length, height in parts:
        x = np.clip((s - start) / length, 0.0, 1.0)
        v += height * 30.0 * x**2 * (1.0 - x) ** 2 / length
    return v / duration


def spectrum(z):
    """|V(f)| / V(0) of a minimum-jerk speed, z = pi f T: the transform of 30 s^2 (1 - s)^2, a spherical Bessel j2."""
    j2 = (3.0 / z**3 - 1.0 / z) * np.sin(z) - 3.0 * np.cos(z) / z**2
    return abs(15.0 * j2 / z**2)


@pytest.mark.parametrize("duration", [0.4, 0.8, 2.0])
def test_sparc_of_minimum_jerk_is_the_length_of_its_main_lobe(duration):
    end = brentq(lambda z: spectrum(z) - 0.05, 3.0, 5.7)
    curve = lambda z: (spectrum(z + 1e-4) - spectrum(z - 1e-4)) / 2e-4  # noqa: E731
    length, _ = quad(lambda z: np.hypot(1.0 / end, curve(z)), 0.01, end)
    length += 0.01 * np.hypot(1.0 / end, 0.0)  # at 0 the spectrum is flat
    assert spectral_arc_length(speed(duration), 1000.0) == pytest.approx(-length, rel=0.01)


def test_ldlj_of_minimum_jerk_is_that_of_its_polynomial():
    """The integral of jerk squared is 720 A^2 / T^5 and the peak 15/8 A/T: -ln(1024/5)."""
    assert log_dimensionless_jerk(speed(0.9, 5000.0), 5000.0) == pytest.approx(-np.log(1024.0 / 5.0), abs=2e-3)


@pytest.mark.parametrize("duration", [0.4, 2.0])
@pytest.mark.parametrize("size", [0.1, 3.0])
def test_normalised_jerk_of_minimum_jerk_is_that_of_its_polynomial(duration, size):
    """The integral of jerk squared is 720 A^2 / T^5: sqrt(360)."""
    fs = 5000.0 / duration
    assert normalised_jerk(size * speed(duration, fs), fs) == pytest.approx(np.sqrt(360.0), rel=2e-3)


def test_normalised_jerk_of_a_point_does_not_depend_on_its_direction():
    along = speed(1.0, 2000.0)
    turned = along[:, None] * np.array([0.6, 0.8])
    assert normalised_jerk(turned, 2000.0) == pytest.approx(normalised_jerk(along, 2000.0), rel=1e-9)


@pytest.mark.parametrize("index", [spectral_arc_length, log_dimensionless_jerk, lambda v, fs: -normalised_jerk(v, fs)])
def test_submovements_are_less_smooth_and_size_does_not_matter(index):
    one = index(speed(1.0), 1000.0)
    two = index(speed(1.0, parts=((0.0, 0.6, 0.6), (0.4, 0.6, 0.4))), 1000.0)
    apart = index(speed(1.0, parts=((0.0, 0.45, 0.6), (0.55, 0.45, 0.4))), 1000.0)
    assert apart < two < one
    assert index(7.0 * speed(1.0), 1000.0) == pytest.approx(one, rel=1e-12)


@pytest.mark.parametrize("samples", [np.zeros(50), np.ones(3), np.array([1.0, np.nan, 2.0, 3.0])])
def test_what_is_no_movement_is_refused(samples):
    with pytest.raises(RecordingError, match="expected at least 4 numbers"):
        spectral_arc_length(samples, 100.0)


@pytest.mark.parametrize("index", [spectral_arc_length, log_dimensionless_jerk])
@pytest.mark.parametrize("value", [1.0, -1.0, 0.1, 1e-9])
def test_a_constant_speed_is_no_movement(index, value):
    for velocity in (np.full(20, value), value * (1.0 + 1e-14 * np.arange(20)), value * (-1.0) ** np.arange(20)):
        with pytest.raises(RecordingError, match="found a constant speed"):
            index(velocity, 100.0)
    circle = value * np.column_stack([np.cos(np.arange(20) / 3.0), np.sin(np.arange(20) / 3.0)])
    with pytest.raises(RecordingError, match="found a constant speed"):
        index(circle, 100.0)


def test_a_straight_line_has_no_jerk():
    with pytest.raises(RecordingError, match="without jerk"):
        log_dimensionless_jerk(np.arange(20.0), 100.0)


def test_sparc_is_of_the_speed_whatever_the_direction():
    """A point that moves along a line has one SPARC, whichever way the line points and whatever the sign."""
    there = speed(1.0) - 0.3 * np.roll(speed(1.0), 500)
    along = spectral_arc_length(there, 1000.0)
    assert along == spectral_arc_length(np.abs(there), 1000.0) == spectral_arc_length(-there, 1000.0)
    turned = np.outer(there, [0.6, 0.8])
    assert spectral_arc_length(turned, 1000.0) == pytest.approx(along, rel=1e-9)
    assert log_dimensionless_jerk(turned, 1000.0) == pytest.approx(log_dimensionless_jerk(there, 1000.0), rel=1e-9)


def test_ldlj_does_not_depend_on_the_rate_where_a_movement_turns_back():
    """The speed has a kink there, whose second difference grows with the rate; the velocity has none."""
    found = [
        log_dimensionless_jerk(speed(1.0, fs, ((0.0, 0.6, 1.2), (0.4, 0.6, -0.2))), fs) for fs in (500.0, 4000.0)
    ]
    assert found[0] == pytest.approx(found[1], abs=0.15)
