"""Knee and ankle moments of a walking person from EMG and angles: fitted on five seconds, judged on others.

What is asserted was measured, less a margin for other versions of the libraries. A tool with muscle models reaches an
R² of 0.75 (knee) and 0.81 (ankle) on the same windows.
"""

import pytest

from pellucid import datasets
from pellucid.estimators.cross_validation import score
from pellucid.estimators.torque_map import fit_torque_map
from pellucid.procedures.emg_torque.trial_sources import moment_trials


@pytest.fixture(scope="module")
def study(data_folder, tmp_path_factory):
    return datasets.init(tmp_path_factory.mktemp("walking") / "study", dataset="lower_limb_walking")


@pytest.mark.parametrize(
    ("joint", "estimator", "evaluated", "rest"),
    [
        ("knee", "ridge", 0.82, 0.80),
        ("knee", "tree", 0.79, 0.77),
        ("knee", "linear", 0.74, 0.67),
        pytest.param("knee", "boost", 0.82, 0.82, marks=pytest.mark.slow),
        ("ankle", "ridge", 0.94, 0.91),
        ("ankle", "tree", 0.91, 0.90),
        ("ankle", "linear", 0.93, 0.88),
        pytest.param("ankle", "bagging", 0.92, 0.91, marks=pytest.mark.slow),
    ],
)
def test_moments_of_strides_never_seen(study, joint, estimator, evaluated, rest):
    fitted, *held = moment_trials(study, joint)
    assert (fitted.time[0], fitted.time[-1]) == pytest.approx((19.0, 23.99))
    assert [t.heldout for t in held] == [True, True]
    found = fit_torque_map([fitted], estimator)
    scores = [score(t.torque, found.predict(t)).r2 for t in held]
    assert scores[0] > evaluated
    assert scores[1] > rest
    # Cross-validation within five seconds hopes for more than later strides give, and not for much more.
    assert found.choice.score.r2 - min(scores) < 0.15


def test_defaults_of_another_tool_are_beaten(study):
    """Two settings nobody chose, with the features of the thesis, against those that cross-validation chose."""
    fitted, held, _ = moment_trials(study, "ankle")
    errors = {}
    for name in ("tree", "tree_published"):
        errors[name] = score(held.torque, fit_torque_map([fitted], name).predict(held)).rmse
    assert errors["tree"] < 0.6 * errors["tree_published"]
