"""Errors learnt online: what is known helps, what is not yet known is not looked at."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.emg.estimators.adaptive_correction import fit_adaptive_correction

FS = 100.0


def motion(seconds, seed=0):
    rng, t = np.random.default_rng(seed), np.arange(round(seconds * FS)) / FS
    q = np.sin(2.0 * np.pi * 0.5 * t)
    return np.column_stack((q, np.gradient(q, 1.0 / FS))), 3.0 * q**2 - 1.0 + 0.1 * rng.standard_normal(len(t))


@pytest.fixture
def correction():
    return fit_adaptive_correction([motion(6.0)])


def test_a_repeated_error_is_taken_off(correction):
    x, error = motion(12.0, seed=1)
    made = correction.correct(x, np.zeros(len(x)), error, FS)
    late = slice(300, None)
    assert np.std((error - made)[late]) < 0.25 * np.std(error[late])


def test_no_sample_sees_its_own_torque_or_a_later_one(correction):
    x, error = motion(6.0, seed=1)
    made = correction.correct(x, np.zeros(len(x)), error, FS)
    spoilt = error.copy()
    spoilt[400:] += 50.0
    np.testing.assert_array_equal(correction.correct(x, np.zeros(len(x)), spoilt, FS)[:401], made[:401])


def test_without_errors_nothing_is_changed(correction):
    x, _ = motion(3.0)
    torque = np.linspace(0.0, 5.0, len(x))
    np.testing.assert_allclose(correction.correct(x, torque, torque, FS), torque, atol=1e-12)


def test_noise_is_not_learnt():
    """Errors that features do not explain: what is chosen hardly corrects."""
    rng = np.random.default_rng(4)
    x, _ = motion(10.0)
    error = rng.standard_normal(len(x))
    chosen = fit_adaptive_correction([(x, error)])
    made = chosen.correct(x, np.zeros(len(x)), error, FS)
    assert np.std(error - made) < 1.15 * np.std(error)


def test_too_few_samples_are_refused():
    with pytest.raises(IdentificationError, match="found 5 samples, expected at least 10"):
        fit_adaptive_correction([(np.zeros((5, 2)), np.zeros(5))])
