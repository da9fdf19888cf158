"""The swept sine: exact derivatives, the pulsation it promises, and how far the literal reading overshoots it."""

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.numerics.protocols.excitation import swept_sine

PRINTED = {"amplitude": 0.5, "start": 1.0, "growth": 3.0}


@pytest.mark.parametrize("literal", [False, True])
def test_velocity_and_acceleration_are_the_derivatives(literal):
    fs = 10_000.0
    position, velocity, acceleration = swept_sine(25.0, fs, **PRINTED, literal=literal)
    central = 0.5 * fs * (position[2:] - position[:-2])
    # A central difference is off by the third derivative over 6 fs^2: 0.5 * 7^3 / 6e8 at most.
    assert np.abs(central - velocity[1:-1]).max() < 5e-7
    assert np.abs(0.5 * fs * (velocity[2:] - velocity[:-2]) - acceleration[1:-1]).max() < 5e-6
    assert len(position) == 250_000


@pytest.mark.parametrize(("literal", "slope"), [(False, 3.0), (True, 6.0)])
def test_the_instantaneous_pulsation(literal, slope):
    """From the sine's own phase, unwrapped, and not from the formula."""
    fs, duration = 2_000.0, 25.0
    position, velocity, _ = swept_sine(duration, fs, **PRINTED, literal=literal)
    time = np.arange(len(position)) / fs
    phase = np.unwrap(np.arctan2(position, velocity / (1.0 + slope * time / duration)))
    pulsation = fs * np.diff(phase)
    expected = 1.0 + slope * (time[:-1] + 0.5 / fs) / duration
    assert np.abs(pulsation - expected).max() < 1e-6


def test_the_peaks_of_both_readings():
    _, velocity, acceleration = swept_sine(25.0, 1000.0, **PRINTED, literal=True)
    assert np.abs(velocity).max() == pytest.approx(3.455, abs=0.005)
    assert np.abs(acceleration).max() == pytest.approx(24.25, abs=0.01)
    _, velocity, acceleration = swept_sine(25.0, 1000.0, **PRINTED)
    assert np.abs(velocity).max() == pytest.approx(2.0, rel=0.03)
    assert np.abs(velocity).max() < 2.0  # A times the largest pulsation
    assert np.abs(acceleration).max() == pytest.approx(8.0, rel=0.03)


def test_without_growth_both_are_a_plain_sine():
    plain = swept_sine(3.0, 500.0, amplitude=0.2, start=2.0, growth=0.0)
    literal = swept_sine(3.0, 500.0, amplitude=0.2, start=2.0, growth=0.0, literal=True)
    time = np.arange(1500) / 500.0
    assert np.allclose(plain[0], 0.2 * np.sin(2.0 * time), atol=1e-15)
    for a, b in zip(plain, literal, strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize(("duration", "fs"), [(0.0, 100.0), (1.0, -5.0), (float("nan"), 100.0)])
def test_misuse_is_refused(duration, fs):
    with pytest.raises(PellucidError, match="must be positive"):
        swept_sine(duration, fs, **PRINTED)
