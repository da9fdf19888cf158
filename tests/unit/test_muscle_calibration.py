"""Muscles whose truth is known: what is found, what cannot be, and how sure."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import trial

from pellucid._errors import IdentificationError
from pellucid.emg.estimators.cross_validation import score
from pellucid.emg.estimators.hill import fit_hill
from pellucid.emg.estimators.muscle_trials import find_driven_muscles, make_muscle_samples
from pellucid.emg.fit.muscle_calibration import MuscleProblem, solve_calibration
from pellucid.emg.fit.muscle_posterior import (
    count_bounds_reported_as_estimates,
    covariance,
    muscle_parameters,
    muscle_verdicts,
    reported_covariance,
)

TRUE = {
    "strength.rectus_femoris": 1.4,
    "strength.biceps_femoris_long": 0.7,
    "delay": 0.06,
    "shape": -2.0,
    "joint.offset": 2.0,
}


def problem(*, seconds=12.0, noise=0.3, weight=0.003, true=TRUE, **asked):
    made = trial(seconds=seconds, noise=noise, true=true)
    muscles = find_driven_muscles([made])
    samples, _ = make_muscle_samples([made], muscles=[m.name for m in muscles])
    return MuscleProblem(muscles, samples, weight=weight, **asked)


@pytest.fixture(scope="module")
def fitted():
    return solve_calibration(problem(), iterations=300)


def test_the_gradient_is_exact():
    """Against central differences, through priors, logarithms and the joint's own tissue."""
    asked = problem()
    z = np.random.default_rng(3).normal(0.0, 0.3, len(asked.lower))
    z = np.clip(z, asked.lower + 0.01, asked.upper - 0.01)
    _, gradient = asked.cost_and_gradient(z)
    for i in range(0, len(z), 5):
        step = np.zeros(len(z))
        step[i] = 1e-5
        difference = (asked.cost(z + step) - asked.cost(z - step)) / 2e-5
        assert gradient[i] == pytest.approx(difference, rel=1e-4, abs=1e-8)


def test_what_torque_says_much_of_is_found(fitted):
    values = fitted.values
    assert values["delay"] == pytest.approx(0.06, abs=0.012)
    assert values["joint.offset"] == pytest.approx(2.0, abs=1.5)
    assert score(fitted.problem.samples.torque, fitted.predict(fitted.problem.samples)).rmse < 0.45


def test_intervals_hold_most_of_the_truth(fitted):
    truth = dict(zip(fitted.problem.names, fitted.problem.expected, strict=True)) | TRUE
    z = fitted.problem.deviations(np.array([truth[n] for n in fitted.problem.names]))
    free = ~fitted.at_bound
    sd = np.sqrt(np.diag(covariance(fitted)))
    assert np.mean(np.abs(z - fitted.z)[free] < 2.5 * sd[free] + 1e-9) > 0.8


def test_what_no_recording_can_say_is_named(fitted):
    """The short head of biceps has no EMG of its own: its numbers stay what anatomy says."""
    unknown = [p.name for p in muscle_parameters(fitted) if not p.identifiable]
    assert any("biceps_femoris_short" in name for name in unknown)
    said = " ".join(v.text for v in muscle_verdicts(fitted, "knee"))
    assert "does not identify" in said
    for name in unknown[:3]:
        assert name in said


def test_a_parameter_on_its_bound_is_told():
    """A torque that comes 0.12 s later than any muscle of this delay gives it."""
    late = problem(true={"delay": 0.08})
    late.samples.torque[:] = np.concatenate((np.full(12, late.samples.torque[0]), late.samples.torque[:-12]))
    found = solve_calibration(late, iterations=300)
    reported = muscle_parameters(found)
    delay = next(p for p in reported if p.name == "delay")
    assert delay.at_bound
    assert not delay.identifiable
    assert not delay.trusted
    assert np.isnan(delay.standard_error)
    assert count_bounds_reported_as_estimates(found, reported) == 0
    as_before = [replace(p, standard_error=0.0, refused="", identifiable=True) for p in reported]
    assert count_bounds_reported_as_estimates(found, as_before) == found.at_bound.sum() > 0
    spread = reported_covariance(found)
    assert np.array_equal(np.isnan(spread), found.at_bound | found.at_bound[:, None])
    said = muscle_verdicts(found, "knee")[0]
    assert said.kind == "warning"
    assert "are not identifiable" in said.text
    assert "delay (0.1 s)" in said.text


@pytest.mark.parametrize("method", ["swarm", "descent"])
def test_every_way_down_comes_near(fitted, method):
    other = solve_calibration(fitted.problem, method=method)
    assert other.cost < 0.2 * fitted.problem.cost(np.zeros(len(fitted.z)))
    assert other.cost > 0.95 * fitted.cost


def test_positive_samples_alone_can_be_fitted(fitted):
    samples = fitted.problem.samples
    part = samples.only(samples.torque > 0.0)
    found = solve_calibration(MuscleProblem(fitted.problem.model.muscles, part, weight=0.003))
    counted = part.weight > 0.0
    assert score(samples.torque[counted], found.predict(samples)[counted]).rmse < 0.6
    assert counted.sum() < (samples.weight > 0.0).sum()


def test_a_torque_that_does_not_change_is_refused(fitted):
    samples = fitted.problem.samples
    with pytest.raises(IdentificationError, match="expected a torque that changes"):
        MuscleProblem(fitted.problem.model.muscles, samples.only(np.zeros(0, int)))


def test_an_unknown_way_down_is_refused(fitted):
    with pytest.raises(IdentificationError, match="'guess'"):
        solve_calibration(fitted.problem, method="guess")


def test_torque_of_another_trial_and_its_interval():
    found = fit_hill([trial(seconds=10.0, true=TRUE)], weights=(0.02, 0.005))
    other = trial("b", seconds=8.0, seed=3, true=TRUE, heldout=True)
    made, half = found.predict(other), found.half_width(other)
    assert score(other.torque, made).r2 > 0.9
    late = slice(40, None)
    inside = np.mean(np.abs(other.torque - made)[late] <= half[late])
    assert 0.85 < inside <= 1.0


def test_the_stream_gives_what_the_arrays_give():
    """Sample by sample through the core, as a robot runs it."""
    made = trial(seconds=6.0, true=TRUE)
    found = fit_hill([made], weights=(0.01,), causal=True)
    samples, _ = found.samples(made)
    estimator, (offset, stiffness, damping) = found.stream(samples.data.period)
    data = samples.data
    streamed = [
        estimator.step(*(x[:, i] for x in data.arrays))
        + offset - stiffness * samples.angle[i] - damping * samples.speed[i]
        for i in range(200)
    ]  # fmt: skip
    np.testing.assert_allclose(streamed, found.predict(made)[:200], atol=1e-9)
    assert estimator.delays.max() <= 0.1 + 2 * 0.06 + 1e-9
