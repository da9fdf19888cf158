"""Where a limb's axis lies beside a robot's, from a free carriage and the limb's angle."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.joint.slider.axis_offset import estimate_axis_offset

FS = 100.0
ANGLE = 1.3 + 0.7 * np.sin(2.0 * np.pi * 0.15 * np.arange(4000) / FS)


def worn(along, across, angle=ANGLE, length=0.25):
    cuff = length * np.exp(1j * angle) + along + 1j * across
    return np.angle(cuff), np.abs(cuff), angle + 0.07


@pytest.mark.parametrize(("along", "across"), [(0.0, 0.0), (0.015, 0.0), (0.0, -0.015), (-0.008, 0.009)])
def test_an_axis_is_found_within_half_a_millimetre_without_noise(along, across):
    found = estimate_axis_offset(*worn(along, across), FS)
    assert np.hypot(found.along - along, found.across - across) < 5e-4
    assert found.length == pytest.approx(0.25, abs=2e-3)


def test_intervals_grow_with_noise_and_hold_the_axis():
    rng = np.random.default_rng(8)
    position, carriage, limb = worn(0.010, -0.006)
    clean = estimate_axis_offset(position, carriage, limb, FS)
    noisy = estimate_axis_offset(position, carriage + 0.002 * rng.standard_normal(len(ANGLE)), limb, FS)
    assert np.all(np.diag(noisy.covariance) > np.diag(clean.covariance))
    for truth, (low, high) in zip((0.010, -0.006), noisy.interval, strict=True):
        assert low < truth < high


def test_a_range_too_small_to_tell_is_refused():
    with pytest.raises(IdentificationError, match=r"found a range of 0.1\d* rad, expected at least 0.7 rad"):
        estimate_axis_offset(*worn(0.01, 0.0, angle=1.2 + 0.06 * np.sin(ANGLE * 20.0)), FS)


def test_missing_samples_and_unequal_lengths_are_refused():
    position, carriage, limb = worn(0.01, 0.0)
    with pytest.raises(IdentificationError, match="missing samples"):
        estimate_axis_offset(position, np.where(ANGLE > 1.99, np.nan, carriage), limb, FS)
    with pytest.raises(IdentificationError, match=r"expected \(n,\) for all three"):
        estimate_axis_offset(position, carriage[1:], limb, FS)
