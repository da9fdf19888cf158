"""Estimators of torque as scikit-learn has them: its own checks, its tools, and one more estimator in one file."""

import numpy as np
import pytest
from copied_package import copied_package, run_copied
from made_muscles import trial
from sklearn.base import clone
from sklearn.model_selection import GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import get_tags
from sklearn.utils.estimator_checks import check_estimator
from test_calibrate import leg

import pellucid as pl
from pellucid._errors import IdentificationError
from pellucid.emg.estimators.hill import fit_hill


@pytest.mark.parametrize("method", ["ridge", "tree", "mbp"])
@pytest.mark.filterwarnings("ignore")
def test_scikit_learns_own_checks(method):
    check_estimator(pl.TorqueRegressor(method), on_skip=None)


NAMED = ("hill", "nmco", "nmcoa", "nmnc")
"""Methods made of muscles."""


@pytest.mark.parametrize("method", NAMED)
@pytest.mark.filterwarnings("ignore")
def test_methods_made_of_muscles_declare_that_they_need_named_columns(method):
    found = check_estimator(pl.TorqueRegressor(method), on_skip=None, on_fail=None)
    assert not [check["check_name"] for check in found if check["status"] == "failed"]
    assert not get_tags(pl.TorqueRegressor(method)).input_tags.two_d_array
    assert get_tags(pl.TorqueRegressor(method, columns=("time", "emg.a", "angle.b"))).input_tags.two_d_array


def test_every_other_method_takes_any_array():
    assert {m for m in pl.TorqueRegressor.methods() if not get_tags(pl.TorqueRegressor(m)).input_tags.two_d_array} == {
        *NAMED
    }
    assert get_tags(pl.TorqueRegressor("unknown")).input_tags.two_d_array


@pytest.mark.parametrize("method", ["ridge", "linear", "boosting", "bagging", "tree", "mbp"])
def test_its_tools_work(method, rng):
    X = rng.uniform(0.0, 1.0, (240, 3))
    y = X @ [30.0, -25.0, 5.0] + 0.2 * rng.standard_normal(240)
    groups = np.repeat(np.arange(6), 40)
    estimator = clone(pl.TorqueRegressor(method, folds=2))
    assert estimator.get_params()["method"] == method
    r2 = cross_val_score(make_pipeline(StandardScaler(), estimator), X, y, groups=groups, cv=GroupKFold(2))
    assert r2.mean() > (0.99 if method in ("ridge", "linear", "mbp") else 0.7)


def test_settings_are_chosen_within_groups(rng):
    """Rows of a group are copies: who leaves out rows alone would choose the tree that remembers."""
    X = np.repeat(rng.standard_normal((12, 1)), 20, axis=0) + 1e-3 * rng.standard_normal((240, 1))
    y = np.repeat(rng.standard_normal(12), 20)
    shuffled = rng.permutation(240)
    X, y, groups = X[shuffled], y[shuffled], np.repeat(np.arange(12), 20)[shuffled]
    together = pl.TorqueRegressor("tree").fit(X, y, groups=groups)
    apart = pl.TorqueRegressor("tree").fit(X, y)
    assert min(apart.tried_.values()) < 0.2 * min(together.tried_.values())
    assert together.settings_["min_samples_leaf"] > apart.settings_["min_samples_leaf"]


def test_columns_tell_motion_from_emg(rng):
    X = rng.uniform(-1.0, 1.0, (200, 2))
    y = 3.0 * X[:, 0] + X[:, 1] ** 2
    named = pl.TorqueRegressor("ridge", columns=("emg.flexor", "angle.knee")).fit(X, y)
    assert named.settings_["products"] == "motion"
    assert len(named.tried_) == 18
    plain = pl.TorqueRegressor("ridge").fit(X, y)
    assert plain.settings_["products"] == "all"
    assert len(plain.tried_) == 12
    given = pl.TorqueRegressor("ridge", settings={"penalty": 2.0}).fit(X, y)
    assert (given.settings_, given.tried_, given.regressor_.alpha) == ({"penalty": 2.0}, {}, 2.0)


def test_muscles_are_an_estimator_too():
    """The same as fitting the trial itself; two trials in one table are told apart by their time."""
    made = trial(seconds=6.0)
    names = ["time", *(f"emg.{m}" for m in made.envelopes), *(f"angle.{j}" for j in made.angles)]
    X = np.column_stack([made.time, *made.envelopes.values(), *made.angles.values()])
    estimator = pl.TorqueRegressor("hill", columns=names, joint="knee", muscles=made.muscles).fit(X, made.torque)
    expected = fit_hill([made]).predict(made)
    np.testing.assert_allclose(estimator.predict(X), expected, rtol=1e-9, atol=1e-9)
    both = estimator.predict(np.vstack([X, X]))
    np.testing.assert_allclose(both, np.tile(expected, 2), rtol=1e-9, atol=1e-9)


def test_what_does_not_fit_is_refused():
    X, y = np.eye(6, 3), np.arange(6.0)
    with pytest.raises(IdentificationError, match="found the estimator 'forest', expected one of boost, bagging"):
        pl.TorqueRegressor("forest").fit(X, y)
    with pytest.raises(IdentificationError, match=r"found groups of shape \(2,\), expected \(6,\)"):
        pl.TorqueRegressor().fit(X, y, groups=[1, 2])
    with pytest.raises(IdentificationError, match="found 2 names of columns"):
        pl.TorqueRegressor(columns=("a", "b")).fit(X, y)
    with pytest.raises(
        IdentificationError, match=r"hill: found the columns x0, x1, x2, expected time, emg.<name>, angle"
    ):
        pl.TorqueRegressor("hill").fit(X, y)
    with pytest.raises(ValueError, match="NaN"):
        pl.TorqueRegressor().fit(np.full((6, 3), np.nan), y)


NEIGHBOURS = '''"""Nearest neighbours, from scikit-learn."""

from .family import Family


def neighbours(settings, seen):
    """The mean of the nearest samples' torques."""
    from sklearn.neighbors import KNeighborsRegressor

    return KNeighborsRegressor(**settings)


FAMILIES = {"neighbours": Family("nearest neighbours", neighbours, ({"n_neighbors": 5}, {"n_neighbors": 20}))}
'''
SCRIPT = """
import sys
import numpy as np
import pellucid as pl
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES
X = np.linspace(0.0, 1.0, 50)[:, None]
assert abs(pl.TorqueRegressor("neighbours").fit(X, X[:, 0]).predict(X)[25] - X[25, 0]) < 0.05
for name in set(ESTIMATOR_FAMILIES) - {"neighbours", "ridge", "motion", "boost", "hill"}:
    del ESTIMATOR_FAMILIES[name]
ESTIMATOR_FAMILIES["boost"] = ESTIMATOR_FAMILIES["ridge"]
rows = {row.id: row.value for row in pl.calibrate(pl.open(sys.argv[1])).rows}
print(rows["leg.knee.neighbours.r2"])
"""


@pytest.mark.nightly
@pytest.mark.slow
def test_an_estimator_is_one_file(tmp_path):
    copy = copied_package(tmp_path)
    (copy / "emg" / "estimators" / "families" / "neighbours.py").write_text(NEIGHBOURS, encoding="utf-8")
    study = leg(tmp_path / "leg")
    run = run_copied(copy.parent, SCRIPT, study.folder)
    assert run.returncode == 0, run.stderr
    assert float(run.stdout) > 0.5
