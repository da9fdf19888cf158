"""Cost of `pellucid calibrate` on five seconds of walking, knee and ankle by every method, in a fresh process.

References are the published time of CEINMS for the muscles of one knee on another machine, and scikit-learn for the
ridge regressions: a plain GridSearchCV over the same candidates, folds and rows. Fresh processes of both run in turn;
figures are medians.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from pellucid.emg.estimators.families.linear import PENALTY_CANDIDATES
from pellucid.emg.estimators.torque_trial import ENVELOPE_LAGS_S, FeatureSet, compute_features
from pellucid.emg.study.emg_torque.trial_sources import moment_trials

from ._size import sized
from ._walking import walking_study
from .commands import COMMAND_LINE, processor_seconds

CEINMS_S = 208.0
"""Time of CEINMS for the same calibration [s]: a reported figure, not run here."""

REPEAT_COUNT = sized(3, smallest=1)
"""Number of runs of each call."""

RIDGE_BY_PELLUCID = """
import sys
import numpy as np
import pellucid as pl
told = np.load(sys.argv[1])
made = pl.TorqueRegressor("ridge", columns=told["names"].tolist()).fit(told["x"], told["y"])
print(made.settings_, min(made.tried_.values()))
"""
"""Python code of the ridge regression with Pellucid."""

RIDGE_BY_SCIKIT_LEARN = """
import sys
import numpy as np
from sklearn.compose import ColumnTransformer
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler
told = np.load(sys.argv[1])
every = PolynomialFeatures(2, include_bias=False)
motion = [i for i, name in enumerate(told["names"]) if not str(name).startswith("emg.")]
some = ColumnTransformer([("motion", every, motion)], remainder="passthrough")
steps = Pipeline([("products", "passthrough"), ("scale", StandardScaler()), ("ridge", Ridge())])
candidates = {"products": ["passthrough", some, every], "ridge__alpha": told["penalties"].tolist()}
made = GridSearchCV(steps, candidates, cv=KFold(5), scoring="neg_root_mean_squared_error")
print(made.fit(told["x"], told["y"]).best_params_, -made.best_score_)
"""
"""Python code of the same regression with scikit-learn alone."""


def run() -> list[dict]:
    """Return rows of wall and processor time of the whole command, and of the ridge regressions and scikit-learn's."""
    with tempfile.TemporaryDirectory() as folder:
        study = walking_study(Path(folder) / "walking")
        trial = next(t for t in moment_trials(study, "knee") if not t.heldout)
        seen = compute_features(trial, FeatureSet(neighbours=True, velocities=True, lags=ENVELOPE_LAGS_S))
        arrays = Path(folder) / "ridge.npz"
        np.savez(arrays, x=seen.x, y=trial.torque, names=np.array(seen.names), penalties=PENALTY_CANDIDATES)
        jobs = {
            "pellucid calibrate": ("-c", COMMAND_LINE, "calibrate", str(study.folder)),
            "ridge": ("-c", RIDGE_BY_PELLUCID, str(arrays)),
            "plain": ("-c", RIDGE_BY_SCIKIT_LEARN, str(arrays)),
        }
        taken: dict[str, list[tuple[float, float]]] = {name: [] for name in jobs}
        for _ in range(REPEAT_COUNT):
            for name, arguments in jobs.items():
                began = time.perf_counter()
                used = processor_seconds(*arguments)
                taken[name].append((time.perf_counter() - began, used))
    wall, used = ({name: statistics.median(each) for name, each in (
        (name, [pair[i] for pair in pairs]) for name, pairs in taken.items())} for i in (0, 1))  # fmt: skip
    what = f"knee and ankle by every method, {REPEAT_COUNT} runs"
    return [
        {"name": "pellucid calibrate, walking", "value": wall["pellucid calibrate"], "unit": "s",
         "note": f"by the clock: {what}; CEINMS is published with {CEINMS_S:g} s for the muscles of one knee"},
        {"name": "walking calibrate", "value": used["pellucid calibrate"], "unit": "s",
         "note": f"processor, of all processes together: {what}"},
        {"name": "ridge regression with its choice", "value": used["ridge"], "unit": "s",
         "note": f"{seen.x.shape[0]} rows, {seen.x.shape[1]} columns, 18 candidates, 5 folds; a fresh process"},
        {"name": "scikit-learn: GridSearchCV of the same", "value": used["plain"], "unit": "s",
         "note": "the same rows, candidates and folds; a fresh process"},
        {"name": "ridge regression over GridSearchCV", "value": used["ridge"] / used["plain"], "unit": "1",
         "note": "medians of processor seconds"},
    ]  # fmt: skip
