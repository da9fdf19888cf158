"""Calibrated muscles as draws: the density's gradient, people that were drawn, and how little a recording tells."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import across, trial

from pellucid.emg.estimators.hill import fit_together
from pellucid.emg.estimators.muscle_trials import find_driven_muscles, make_muscle_samples
from pellucid.emg.fit import muscle_posterior as draws_of_muscles
from pellucid.emg.fit.muscle_calibration import MuscleProblem, Timing, solve_calibration
from pellucid.emg.fit.muscle_posterior import SHARED_QUANTITIES, calibration_posterior
from pellucid.numerics.posterior import ensemble as hamiltonian
from pellucid.numerics.posterior.ensemble import drawn_by_gradients
from pellucid.numerics.posterior.posterior import Noise

pytest.importorskip("emcee")

NOISE = 20.0
TRUE = {"strength.vastus_lateralis": 1.5, "strength.semimembranosus": 0.7}


def together():
    made = across(true={"strength.soleus": 1.3}, seconds=6.0)
    return fit_together({j: [t] for j, t in made.items()}, weights=(0.01,), timings=(Timing(0.04),))


def strengths(seed=0, noise=NOISE):
    """A knee whose strengths alone are free."""
    made = trial(seed=seed, seconds=6.0, noise=noise, true=TRUE)
    muscles = find_driven_muscles([made])
    samples, _ = make_muscle_samples([made], muscles=[m.name for m in muscles])
    return solve_calibration(MuscleProblem(muscles, samples, quantities=("strength",), passive=False, weight=0.01))


@pytest.fixture(scope="module")
def made():
    return together()


def test_the_gradient_of_the_density_is_exact(made):
    problem, z = draws_of_muscles._with_common(made.fit)
    likelihood = draws_of_muscles.MarginalLikelihood(
        None, draws_of_muscles._Anatomy(problem), Noise(1e-3, 20.0), 0.1, 10.0
    )
    density = draws_of_muscles._Density(problem, likelihood)
    mode, covariance = density.about_mode(z)
    at = mode + np.linalg.cholesky(covariance) @ np.random.default_rng(1).standard_normal(len(mode))
    (gradient,) = density(at[None])[1]
    for i in (*range(0, len(mode), 7), len(mode) - 1):
        step = 1e-5 * np.eye(len(mode))[i]
        (above,), (below,) = density((at + step)[None])[0], density((at - step)[None])[0]
        assert gradient[i] == pytest.approx((above - below) / 2e-5, rel=1e-5, abs=1e-5)
    away = np.vstack([mode, mode, mode])
    away[0, 0], away[1, -1] = np.nan, 1e3
    logs, slopes = density(away)
    assert np.isfinite(logs).tolist() == [False, False, True]
    assert np.isfinite(slopes).all()


def test_draws_of_a_known_density_have_its_covariance():
    rng = np.random.default_rng(4)
    root = rng.standard_normal((6, 6))
    covariance = root @ root.T + np.eye(6)
    inverse = np.linalg.inv(covariance)

    def density(x):
        return -0.5 * np.einsum("wi,ij,wj->w", x - 1.0, inverse, x - 1.0), -(x - 1.0) @ inverse

    found = drawn_by_gradients(density, np.zeros(6), np.eye(6), seed=3)
    assert not found.unsettled
    sd = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(found.values.mean(axis=0) - 1.0) < 0.15 * sd)
    assert np.cov(found.values.T) / np.outer(sd, sd) == pytest.approx(covariance / np.outer(sd, sd), abs=0.12)


@pytest.mark.slow
def test_draws_hold_what_the_recording_tells_and_no_bound_is_passed(monkeypatch):
    settings = replace(hamiltonian.SAMPLER_SETTINGS, hamiltonian_steps_per_round=120)
    monkeypatch.setattr(hamiltonian, "SAMPLER_SETTINGS", settings)
    fit = strengths()
    posterior = calibration_posterior(fit, most=120)
    assert set(SHARED_QUANTITIES) <= set(posterior)
    for name, value in TRUE.items():
        low, high = posterior.interval(name)
        assert low < value < high
        assert not posterior[name].told_by_prior
    assert posterior["optimal_length_shift"].draws.min() >= 0.0
    torques = posterior.torques(fit.problem.samples)
    counted = fit.problem.samples.weight > 0.0
    missed = torques.mean(axis=0)[counted] - fit.problem.samples.torque[counted]
    assert np.sqrt(np.mean(missed**2)) < 1.2 * NOISE
    # A recording that is mostly noise leaves what anatomy says of people.
    loud = calibration_posterior(strengths(noise=20.0 * NOISE), most=120)
    assert loud["strength.vastus_lateralis"].told_by_prior
    assert np.ptp(loud.interval("strength.vastus_lateralis")) > 2.0 * np.ptp(posterior.interval(next(iter(TRUE))))


def test_few_steps_do_not_settle(made, monkeypatch):
    settings = replace(hamiltonian.SAMPLER_SETTINGS, hamiltonian_steps_per_round=15)
    monkeypatch.setattr(hamiltonian, "SAMPLER_SETTINGS", settings)
    posterior = calibration_posterior(made.fit, most=15)
    assert posterior.unsettled
    assert all("has not settled" in p.refused for p in posterior.parameters)
