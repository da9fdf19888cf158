"""Numbers are those of scikit-learn and SciPy, without the time that both take to load."""

import subprocess
import sys

import numpy as np
import pytest
from scipy import signal
from sklearn.decomposition import NMF
from sklearn.neural_network import MLPRegressor

from pellucid.emg.estimators.families.family import SEED
from pellucid.emg.estimators.feature_scale import mean_and_scale
from pellucid.emg.estimators.neural_network import HIDDEN_NEURON_COUNT, MAX_TRAINING_STEPS, NeuralNetwork
from pellucid.numerics.low_pass import butterworth, filter_settled
from pellucid.numerics.nonnegative_factors import nonnegative_factors


@pytest.mark.filterwarnings("ignore")
def test_a_network_is_that_of_scikit_learn(rng):
    x = rng.normal(size=(150, 4)) * [1.0, 3.0, 0.1, 20.0]
    y = np.sin(x[:, 0]) + 0.1 * x[:, 1] ** 2
    mean, scale = mean_and_scale(x)
    reference = MLPRegressor(
        hidden_layer_sizes=(HIDDEN_NEURON_COUNT,), activation="tanh", solver="lbfgs", alpha=0.1,
        max_iter=MAX_TRAINING_STEPS, random_state=SEED,
    ).fit((x - mean) / scale, (y - y.mean()) / y.std())  # fmt: skip
    expected = y.mean() + y.std() * reference.predict((x - mean) / scale)
    np.testing.assert_allclose(NeuralNetwork(0.1).fit(x, y).predict(x), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("number", [1, 2, 4])
def test_non_negative_factors_are_those_of_scikit_learn(number, rng):
    x = np.maximum(rng.uniform(size=(200, 4)) @ rng.uniform(size=(4, 7)) - 0.8, 0.0)
    reference = NMF(number, init="nndsvda", solver="cd", max_iter=300, tol=1e-4, random_state=0)
    expected = reference.fit_transform(x)
    w, h = nonnegative_factors(x, number, 300)
    np.testing.assert_allclose(w, expected, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(h, reference.components_, rtol=1e-7, atol=1e-9)


def test_a_filter_starts_as_if_the_first_sample_had_lasted(rng):
    x, sections = 5.0 + rng.normal(size=300), butterworth(2, 0.1)
    expected, _ = signal.sosfilt(sections, x, zi=signal.sosfilt_zi(sections) * x[0])
    np.testing.assert_allclose(filter_settled(sections[0], x), expected, rtol=1e-13)


def test_calibrating_loads_neither_scikit_learn_nor_all_of_scipy():
    code = "import sys, pellucid.emg.study.emg_torque.calibrate; print({'sklearn', 'scipy.stats'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
