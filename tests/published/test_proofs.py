"""What the errata are proved with: bounds of a standard deviation, counts of parameters, moving averages."""

import moving_average
import numpy as np
import pytest
from parameter_count import chain_parameters, coupled_parameters, listed_sets
from sd_bounds import sd_bounds

from pellucid._errors import PellucidError


@pytest.mark.parametrize("n", [3, 4, 5, 6])
def test_sd_bounds_hold_samples_and_are_reached(n):
    """Samples with the same mean, minimum, median and maximum as another: none lies outside, some come close."""
    rng = np.random.default_rng(n)
    x = np.sort(rng.uniform(0.0, 1.0, n))
    known = {"mean": x.mean(), "low": x[0], "median": np.median(x), "high": x[-1]}
    least, most = sd_bounds(n, **known)
    assert least - 1e-6 <= x.std(ddof=1) <= most + 1e-6
    # Directions that keep all four statistics, from the sample on, as far as the order allows.
    forms = np.zeros((4, n))
    forms[0], forms[1, 0], forms[2, -1] = 1.0, 1.0, 1.0
    forms[3, (n - 1) // 2] += 0.5
    forms[3, n // 2] += 0.5
    _, s, vt = np.linalg.svd(forms)
    free = vt[np.sum(s > 1e-12) :]
    seen = [x.std(ddof=1)]
    for _ in range(20_000 if len(free) else 0):
        y = x + rng.normal(0.0, 0.3, len(free)) @ free
        if np.all(np.diff(y) >= 0.0):
            seen.append(y.std(ddof=1))
    assert least - 1e-6 <= min(seen)
    assert max(seen) <= most + 1e-6
    if len(free):
        assert len(seen) > 20
    assert min(seen) - least < 0.02
    assert most - max(seen) < 0.02


def test_sd_bounds_by_hand():
    """0, a, 0.5, b, 1 with a + b = 1: evenly squeezed to the middle, or thrown to the ends."""
    least, most = sd_bounds(5, mean=0.5, low=0.0, median=0.5, high=1.0)
    assert least == pytest.approx(np.sqrt(0.5 / 4.0), abs=1e-6)
    assert most == pytest.approx(np.sqrt(1.0 / 4.0), abs=1e-6)
    _, most = sd_bounds(5, mean=0.5, low=0.0, median=0.5, high=1.0, ddof=0)
    assert most == pytest.approx(np.sqrt(1.0 / 5.0), abs=1e-6)
    wider = sd_bounds(5, mean=0.5, low=0.0, median=0.5, high=1.0, half_unit=0.01)
    assert wider[0] < least
    assert wider[1] > np.sqrt(1.0 / 4.0)


def test_sd_bounds_refuse_what_cannot_be():
    with pytest.raises(PellucidError, match="no 6 values"):
        sd_bounds(6, mean=0.9, low=0.0, median=0.1, high=1.0)
    with pytest.raises(PellucidError, match="3 to 8"):
        sd_bounds(40, mean=0.5, low=0.0, median=0.5, high=1.0)


@pytest.mark.parametrize("joints", [1, 2, 3, 5, 7])
def test_parameter_counts_are_those_of_a_list(joints):
    chain = [set(range(i)) for i in range(joints)]
    full = [set(range(joints)) - {i} for i in range(joints)]
    assert chain_parameters(joints, 9) == 9 * listed_sets(chain)
    assert coupled_parameters(joints, 9) == 9 * listed_sets(full)


def test_parameter_counts_refuse_nothing_to_count():
    with pytest.raises(PellucidError, match="at least 1"):
        chain_parameters(0, 9)


@pytest.mark.parametrize(("n", "fs", "frequency"), [(100, 1000.0, 3.0), (40, 179.0, 1.1)])
def test_a_moving_average_by_averaging(n, fs, frequency):
    time = np.arange(20_000) / fs
    averaged = np.convolve(np.exp(2j * np.pi * frequency * time), np.full(n, 1.0 / n), mode="valid")
    assert np.abs(averaged) == pytest.approx(moving_average.gain(n, fs, frequency), rel=1e-9)
    late = -np.angle(averaged[0] / np.exp(2j * np.pi * frequency * time[n - 1])) / (2.0 * np.pi * frequency)
    assert late == pytest.approx(moving_average.delay(n, fs), rel=1e-9)
    assert moving_average.gain(n, fs, moving_average.cutoff(n, fs)) == pytest.approx(np.sqrt(0.5), rel=1e-9)
    with pytest.raises(PellucidError, match="no cutoff"):
        moving_average.cutoff(1, fs)
