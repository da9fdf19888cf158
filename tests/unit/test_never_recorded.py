"""Muscles that never had an electrode, where the truth is known: found where they pull, refused where they do not."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import across

from pellucid.emg.estimators.cross_validation import score
from pellucid.emg.estimators.hill import fit_together
from pellucid.emg.estimators.unrecorded import fit_unrecorded_muscles
from pellucid.emg.fit.muscle_calibration import Timing

QUICK = {"weights": (0.01,), "timings": (Timing(0.04),)}


def fitted_to(trials):
    return fit_together({joint: [trial] for joint, trial in trials.items()}, **QUICK)


@pytest.fixture(scope="module")
def plain():
    trials = across(seconds=6.0, noise=0.5)
    return trials, fitted_to(trials)


def pulled(trials, found, weights):
    """The trials with what muscles without an electrode add."""
    more = replace(found, weights=weights).added_torque(trials)
    return {joint: replace(trial, torque=trial.torque + more[joint]) for joint, trial in trials.items()}


def test_they_are_refused_where_they_do_not_pull(plain):
    trials, fit = plain
    found = fit_unrecorded_muscles(fit, {joint: [trial] for joint, trial in trials.items()})
    assert {m.name for m in found.muscles} == {"sartorius", "gracilis", "tensor_fasciae_latae"}
    assert not found.helps
    silent = replace(found, weights=np.zeros_like(found.weights))
    assert silent.predict(trials)["knee"] == pytest.approx(fit.predict(trials)["knee"])


def test_they_are_found_where_they_pull_and_tell_another_recording_better(plain):
    trials, fit = plain
    alone = fit_unrecorded_muscles(fit, {joint: [trial] for joint, trial in trials.items()})
    weights = np.zeros_like(alone.weights)
    weights[[m.name for m in alone.muscles].index("gracilis"), 0] = 1.0
    loud = pulled(trials, alone, weights)
    asked = replace(fit, fit=replace(fit.fit, problem=_asked(fit, loud)))
    found = fit_unrecorded_muscles(asked, {joint: [trial] for joint, trial in loud.items()})
    assert found.helps
    other = across("b", seconds=4.0, seed=5, noise=0.5, heldout=True)
    judged = pulled(other, alone, weights)
    r2 = [score(judged["knee"].torque, made["knee"]).r2 for made in (fit.predict(judged), found.predict(judged))]
    assert r2[1] > r2[0]
    assert 1.0 - r2[1] < 0.5 * (1.0 - r2[0])
    # What is to be predicted is not looked at.
    blank = {j: replace(t, torque=np.zeros(len(t))) for j, t in judged.items()}
    assert np.array_equal(found.predict(blank)["knee"], found.predict(judged)["knee"])


def _asked(fit, trials):
    """The calibration's problem with other torques: what is tested here is not how muscles give way to each other."""
    problem = fit.fit.problem.held_by(fit.fit.problem.weight)
    problem.samples = replace(problem.samples, torque=np.array([trials[joint].torque for joint in fit.joints]))
    return problem
