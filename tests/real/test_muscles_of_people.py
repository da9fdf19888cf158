"""Muscles calibrated on people: judged on strides and trials never fitted, less a margin for other libraries."""

import time

import numpy as np
import pytest

from pellucid.emg.estimators.cross_validation import score
from pellucid.emg.estimators.hill import fit_hill
from pellucid.emg.estimators.torque_map import cross_validate_torque_maps
from pellucid.emg.study.emg_torque.trial_sources import leg_extension_trials, moment_trials
from pellucid.study import datasets

CEINMS_SECONDS = {"knee": 208.0, "ankle": 97.0}
"""What CEINMS 0.9 took to calibrate on the same five seconds."""


@pytest.fixture(scope="module")
def walking(data_folder, tmp_path_factory):
    return datasets.init(tmp_path_factory.mktemp("walking") / "study", dataset="lower_limb_walking")


@pytest.mark.parametrize(("joint", "evaluated", "rest"), [("knee", 0.82, 0.79), ("ankle", 0.85, 0.86)])
def test_torque_of_strides_never_seen(walking, joint, evaluated, rest):
    fitted, *held = moment_trials(walking, joint)
    found = fit_hill([fitted])
    scores = [score(t.torque, found.predict(t)).r2 for t in held]
    assert scores[0] > evaluated
    assert scores[1] > rest
    inside = [np.mean(np.abs(t.torque - found.predict(t)) <= found.half_width(t)) for t in held]
    assert min(inside) > 0.85
    values = found.fit.values
    assert values["delay"] <= 0.1
    assert all(value <= 0.06 for name, value in values.items() if name.startswith("time_constant"))


@pytest.mark.parametrize("joint", ["knee", "ankle"])
def test_calibration_takes_less_than_a_hundredth_of_a_published_tools(walking, joint):
    found = fit_hill(moment_trials(walking, joint)[:1])
    assert len(found.fit.costs) == 3
    assert found.fit.seconds < 0.01 * CEINMS_SECONDS[joint]


def test_muscles_beat_ridge_on_a_trial_never_seen(data_folder, tmp_path):
    trials = moment_trials(datasets.init(tmp_path / "study", dataset="nmsm_knee_emg"), "knee")
    results = cross_validate_torque_maps(trials, ("hill", "ridge"))
    errors = {name: np.mean([s.rmse for s in r.by_trial.values()]) for name, r in results.items()}
    assert errors["hill"] < errors["ridge"]


def test_leg_extensions_of_a_person_without_a_maximal_contraction(data_folder, tmp_path):
    study = datasets.init(tmp_path / "study", dataset="uci_lower_limb")
    began = time.perf_counter()
    trials, weight = leg_extension_trials(study, "1N")
    assert len(trials) == 4
    assert not trials[0].muscles.maximal
    found = cross_validate_torque_maps(trials, ("hill",))["hill"]
    assert np.mean([s.rmse for s in found.by_trial.values()]) / weight < 0.2
    assert fit_hill(trials).effort < 0.3
    assert time.perf_counter() - began < 120.0
