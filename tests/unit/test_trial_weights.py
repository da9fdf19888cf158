"""Trials are weighed by a noise model, so that the one with the largest torques does not decide."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import trial

from pellucid.emg.estimators.condition_choice import make_choice_tests, run_condition_tests
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES
from pellucid.emg.estimators.feature_scale import (
    ERROR_FLOOR_SHARE,
    find_row_weights,
    find_trial_weights,
)
from pellucid.emg.estimators.muscle_trials import make_muscle_samples
from pellucid.emg.estimators.ridge import Ridge
from pellucid.emg.estimators.torque_map import fit_torque_map
from pellucid.emg.estimators.torque_regressor import TorqueRegressor
from pellucid.emg.estimators.torque_trial import Features
from pellucid.emg.estimators.tree_ensembles import BoostedTrees


def test_weights_follow_the_noise_model_and_have_a_mean_of_one():
    rng = np.random.default_rng(1)
    small, large, still = rng.normal(0.0, 5.0, 400), rng.normal(0.0, 50.0, 100), np.zeros(50)
    weights = find_trial_weights([small, large, still])
    variance = np.array([np.var(small), np.var(large), 0.0]) + ERROR_FLOOR_SHARE**2 * np.var(large)
    assert weights * variance == pytest.approx(np.full(3, weights[0] * variance[0]))
    assert np.average(weights, weights=[400, 100, 50]) == pytest.approx(1.0)
    # The floor: a trial in which nothing moves counts hardly more than one of a few N m.
    assert weights[2] < 1.5 * weights[0]
    assert np.array_equal(find_row_weights([small, large, still]), np.repeat(weights, [400, 100, 50]))


def test_one_trial_or_equal_ones_have_no_weights():
    torque = np.sin(np.arange(100.0))
    assert find_trial_weights([torque]) is None
    assert find_trial_weights([torque, torque[::-1]]) is None
    assert find_trial_weights([np.zeros(9), np.zeros(9)]) is None


def test_weighted_ridge_regression_is_that_of_repeated_rows():
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(60, 3)), rng.normal(size=60)
    times = rng.integers(1, 4, 60)
    weighted = Ridge(0.5, (0, 1)).fit(x, y, row_weight=times.astype(float))
    repeated = Ridge(0.5, (0, 1)).fit(np.repeat(x, times, axis=0), np.repeat(y, times))
    assert weighted.predict(x) == pytest.approx(repeated.predict(x), abs=1e-10)
    (shared,) = Ridge(products=(0, 1)).predict_each(x, y, [0.5], x, row_weight=times.astype(float))
    assert shared == pytest.approx(repeated.predict(x), abs=1e-8)


def test_weighted_boosting_is_that_of_repeated_rows():
    rng = np.random.default_rng(3)
    x, times = rng.normal(size=(50, 2)), rng.integers(1, 4, 50)
    y = np.sign(x[:, 0]) + 0.1 * rng.normal(size=50)
    settings = {"n_estimators": 5, "max_leaf_nodes": 3}
    weighted = BoostedTrees(**settings).fit(x, y, row_weight=times.astype(float))
    repeated = BoostedTrees(**settings).fit(np.repeat(x, times, axis=0), np.repeat(y, times))
    assert weighted.predict(x) == pytest.approx(repeated.predict(x))


@pytest.mark.parametrize("name", ["tree", "boost", "bagging"])
def test_trees_weigh_rows(name):
    """A single leaf answers the weighted mean."""
    family, rng = ESTIMATOR_FAMILIES[name], np.random.default_rng(4)
    assert family.weight_argument
    x, y = np.zeros((40, 1)), rng.normal(size=40)
    weight = np.where(y > 0.0, 1e6, 1e-6)
    made = family.make(family.settings[0], Features(x, ("angle",), ())).fit(x, y, **family.weights(weight))
    assert made.predict(x[:1]) == pytest.approx(np.average(y, weights=weight), rel=0.15)
    assert made.predict(x[:1]) > y.mean() + 0.3


def two_speeds(ratio=8.0):
    """Two fitted trials: in the second the torques are `ratio` times as large, and envelopes mean something else."""
    slow, fast = trial("slow", seconds=4.0, seed=1), trial("fast", seconds=4.0, seed=2)
    return slow, replace(fast, torque=ratio * fast.torque)


@pytest.mark.parametrize("name", ["ridge", "linear"])
def test_the_trial_with_the_largest_torques_does_not_decide(name):
    slow, fast = two_speeds()
    family = ESTIMATOR_FAMILIES[name]
    assert family.weight_argument

    def error_share(fit):
        return float(np.mean((fit.predict(slow) - slow.torque) ** 2) / np.var(slow.torque))

    weighted = error_share(fit_torque_map([slow, fast], name))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pellucid.emg.estimators.torque_map.find_row_weights", lambda torques: None)
        plain = error_share(fit_torque_map([slow, fast], name))
    assert weighted < plain


def test_muscles_weigh_trials_unless_a_published_method_asks_otherwise():
    slow, fast = two_speeds()
    names = [m for m in slow.envelopes if m in slow.known_muscles.constants]
    samples, own = make_muscle_samples([slow, fast], muscles=names)
    levels = [set(samples.weight[part].tolist()) - {0.0} for part in own]
    weights = find_trial_weights([slow.torque, fast.torque])
    assert [level.pop() for level in levels] == pytest.approx(weights)
    plain, _ = make_muscle_samples([slow, fast], muscles=names, weighs_trials=False)
    assert set(plain.weight.tolist()) <= {0.0, 1.0}
    published = [n for n, f in ESTIMATOR_FAMILIES.items() if f.reconstruction or n.endswith("_published")]
    assert not any(ESTIMATOR_FAMILIES[n].weight_argument for n in published)


def test_condition_tests_report_the_weights_of_samples():
    slow, fast = two_speeds()
    found = run_condition_tests(fit_torque_map([slow, fast], "ridge"), [slow, fast])
    weights = find_row_weights([slow.torque, fast.torque])
    tests = make_choice_tests([slow, fast])
    # Each trial is held out once, and blocks of both are, in which samples keep the weights of their trials.
    assert found.words == ("without slow", "without fast", *(f"block {i}" for i in range(1, 6)))
    assert all(np.array_equal(own, weights[test.judged]) for own, test in zip(found.weights, tests, strict=True))
    trial_weights = find_trial_weights([slow.torque, fast.torque])
    assert [np.unique(own) for own in found.weights[:2]] == pytest.approx(np.reshape(trial_weights, (2, 1)))
    alone = run_condition_tests(fit_torque_map([slow], "ridge"), [slow])
    assert alone.weights == ()


def test_the_regressor_of_arrays_weighs_groups():
    slow, fast = two_speeds()
    x = np.vstack([np.column_stack([*t.envelopes.values(), *t.angles.values()]) for t in (slow, fast)])
    y, groups = np.concatenate([slow.torque, fast.torque]), np.repeat([0, 1], [len(slow), len(fast)])
    weighted = TorqueRegressor("ridge", settings={"penalty": 1.0}).fit(x, y, groups=groups)
    wanted = Ridge(1.0).fit(x, y, row_weight=find_row_weights([slow.torque, fast.torque]))
    assert weighted.predict(x) == pytest.approx(wanted.predict(x))
