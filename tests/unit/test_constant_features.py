"""A feature that does not vary in what was fitted changes no torque later, on any processor."""

import numpy as np
import pytest

from pellucid.emg.estimators.adaptive_correction import fit_adaptive_correction
from pellucid.emg.estimators.cross_validation import first_best
from pellucid.emg.estimators.neural_network import NeuralNetwork
from pellucid.emg.estimators.ridge import Ridge

ANGLE = np.radians(-60.0)
"""An angle whose mean over thousands of samples is not the angle itself: sums round."""


def isometric(angle, n=3001):
    """Return features (envelope, the constant angle) and the torque, which is proportional to the envelope."""
    envelope = 0.4 + 0.3 * np.sin(np.arange(n) / 50.0)
    return np.column_stack([envelope, np.full(n, angle)]), 10.0 * envelope


@pytest.mark.parametrize(
    "estimator", [Ridge(0.1), Ridge(0.0), Ridge(0.1, products=(0, 1)), Ridge(0.0, products=(0, 1)), NeuralNetwork(1e-4)]
)
def test_a_joint_held_at_another_angle_gives_the_torque_of_its_envelope(estimator):
    x, y = isometric(ANGLE)
    fitted = estimator.fit(x, y)
    assert x[:, 1].std() > 0.0, "the deviation that rounding leaves"
    assert np.abs(fitted.predict(isometric(2.0 * ANGLE)[0]) - y).max() < 0.02 * np.ptp(y)


def test_several_penalties_at_once_do_not_see_a_constant_either():
    x, y = isometric(ANGLE)
    new = isometric(2.0 * ANGLE)[0]
    for predicted in Ridge(products=(0, 1)).predict_each(x, y, [0.1, 1.0], new):
        assert np.abs(predicted - y).max() < 0.02 * np.ptp(y)


def test_the_same_map_in_words_has_no_coefficient_for_a_constant():
    terms = Ridge(0.1, products=(0, 1)).fit(*isometric(ANGLE)).unscaled_coefficients(["emg", "angle"])
    assert [name for name, value in terms.items() if value == 0.0] == ["angle", "emg * angle", "angle * angle"]


def test_an_adaptive_correction_compares_by_what_varied():
    x, y = isometric(ANGLE)
    rng = np.random.default_rng(0)
    correction = fit_adaptive_correction([(x, 0.1 * y + 0.01 * rng.standard_normal(len(y)))])
    assert np.isfinite(correction.scale[0])
    assert np.isinf(correction.scale[1])


def test_the_first_of_equal_errors_is_the_least():
    assert first_best([3.0, 1.0 + 1e-13, 1.0]) == 1
    assert first_best([np.nan, 2.0, 1.0]) == 2
