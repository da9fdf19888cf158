"""Straight lines between samples, of a part of a record as of the whole."""

import numpy as np
import pytest

from pellucid.numerics.resampling import linear


@pytest.mark.parametrize("span", [(3.0, 5.0), (-1.0, 0.5), (9.5, 12.0), (-3.0, -2.0), (20.0, 21.0), (4.0, 4.0)])
def test_a_part_is_as_numpy_makes_the_whole(rng, span):
    time = np.cumsum(rng.uniform(0.005, 0.015, 1000))
    samples = rng.standard_normal(1000)
    wanted = np.linspace(*span, 77)
    assert np.array_equal(linear(time, samples, wanted), np.interp(wanted, time, samples))
    assert len(linear(time, samples, wanted[:0])) == 0


def test_where_samples_are_it_passes_through_them(rng):
    time, samples = np.arange(100) / 50.0, rng.standard_normal(100)
    assert np.array_equal(linear(time, samples, time[20:30]), samples[20:30])
