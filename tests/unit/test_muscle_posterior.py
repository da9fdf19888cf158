"""Where an isolated muscle was held: both sides of its optimal length, and constants that may be wrong."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid.emg.fit.muscle_posterior import ForceGrid, offset_interval, offset_posterior

pytestmark = pytest.mark.slow

TRUE = 4e-3
TIME = np.arange(400) * 2e-3


def force(offset, shift=0.0):
    """Of a made-up muscle: strongest at 0, on a length that moves; `shift` of its optimal length."""
    length = offset - shift + 2e-3 * np.sin(9.0 * TIME)
    return np.exp(-((length / 8e-3) ** 2))


def grid(noise, constants=True, offset=TRUE):
    offsets = np.linspace(-1e-2, 1e-2, 101)
    plain = np.array([force(x) for x in offsets])
    slopes = np.array([(force(x, 1e-6) - force(x)) * 1e4 for x in offsets])[:, :, None]  # by the log of 10 mm
    measured = force(offset) + noise * np.random.default_rng(2).standard_normal(len(TIME))
    return ForceGrid(offsets, plain, slopes if constants else 0.0 * slopes + 1e-9, measured, (len(TIME),))


def test_with_constants_known_it_is_least_squares():
    made = grid(0.05, constants=False)
    p, drawn = offset_interval(made, made.best), offset_posterior(made)["offset"]
    assert abs(drawn.value - p.value) < p.standard_error
    assert np.ptp(drawn.interval()) == pytest.approx(np.ptp(p.interval()), rel=0.4)
    assert drawn.interval()[0] < TRUE < drawn.interval()[1]


def test_a_constant_that_may_be_wrong_widens_it():
    known, unsure = (offset_posterior(grid(0.05, constants=c))["offset"] for c in (False, True))
    assert np.ptp(unsure.interval()) > 2.0 * np.ptp(known.interval())


def test_lengths_that_do_the_same_are_both_kept():
    made = grid(0.05, constants=False)
    still = np.exp(-((made.offsets / 8e-3) ** 2))[:, None] * np.ones(len(TIME))
    noise = 0.05 * np.random.default_rng(3).standard_normal(len(TIME))
    both = replace(made, forces=still, measured=np.exp(-((TRUE / 8e-3) ** 2)) + noise)
    draws = offset_posterior(both, most=1500)["offset"].draws
    assert 0.2 < np.mean(draws > 0.0) < 0.8
    assert np.mean(np.abs(np.abs(draws) - TRUE) < 1e-3) > 0.9
