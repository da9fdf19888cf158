"""Posteriors: least squares' own answer where all is Gaussian, bounds where they hold, draws that settled."""

import sys

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.numerics.posterior.ensemble import drawn, settled
from pellucid.numerics.posterior.posterior import MarginalLikelihood, Noise, Prior, summary
from pellucid.numerics.uncertainty import sandwich_covariance

WIDE = 1e6


def linear(w, y, columns=None, *, prior=None, noise=None, **more):
    """The likelihood of a straight model, and its least squares."""
    columns = np.zeros((len(y), 0)) if columns is None else columns
    p, x = w.shape[1], np.hstack([w, columns])
    values = np.linalg.lstsq(w, y, rcond=None)[0]
    noise = noise or Noise.of(w, y - w @ values, [len(y)])
    prior = prior or Prior(np.full(p, -np.inf), np.full(p, np.inf), np.zeros(p), np.full(p, WIDE))
    least = float(np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2))

    def misfit(at):
        left = y - at @ w.T
        return np.sum(left**2, axis=1), left @ columns, columns.T @ columns

    return MarginalLikelihood(
        misfit, prior, noise, least, x.shape[1], np.ones(columns.shape[1]), np.zeros(columns.shape[1]), **more
    ), values


def sampled(likelihood, values, covariance, **more):
    p, found = len(values), drawn(likelihood, likelihood.start(values, covariance), **more)
    return summary([f"b{i}" for i in range(p)], ["1"] * p, found, likelihood.prior)


@pytest.fixture(scope="module")
def plain():
    rng = np.random.default_rng(4)
    w = np.column_stack([rng.standard_normal((800, 2)), np.ones(800)])
    w[:, 1] += 0.8 * w[:, 0]
    y = w @ [1.0, -2.0, 0.5] + 0.3 * rng.standard_normal(800)
    likelihood, values = linear(w, y)
    covariance = sandwich_covariance(w, y - w @ values, [800])
    textbook = np.linalg.inv(w.T @ w) * 0.3**2
    return likelihood, values, covariance, textbook, sampled(likelihood, values, covariance)


def test_white_residuals_give_least_squares_values_and_covariance(plain):
    likelihood, values, covariance, _, found = plain
    freedom = likelihood.noise.freedom
    exact = likelihood.noise.variance * freedom / (freedom - 2.0)
    w_gram = np.linalg.inv(plain[3]) * 0.3**2
    expected = exact * np.linalg.inv(w_gram)
    assert found.unsettled == ""
    error = np.sqrt(np.diag(expected))
    assert np.all(np.abs(found.array - values) < 0.15 * error)  # four standard errors of a thousand draws' median
    # A variance of a thousand draws has a standard error of 4 %: one chain is no evidence.
    more = [sampled(likelihood, values, covariance, seed=seed).covariance for seed in range(4)]
    drawn_covariance = np.mean([found.covariance, *more], axis=0)
    assert np.allclose(drawn_covariance / np.outer(error, error), expected / np.outer(error, error), atol=0.1)


def test_coloured_residuals_make_it_as_wide_as_the_interval_does():
    rng = np.random.default_rng(5)
    t = np.arange(3000) / 50.0
    w = np.column_stack([np.sin(0.7 * t), np.cos(1.9 * t)])
    e = np.zeros(len(t))
    for i in range(1, len(t)):
        e[i] = 0.95 * e[i - 1] + 0.05 * rng.standard_normal()
    likelihood, values = linear(w, w @ [1.0, 0.5] + e)
    covariance = sandwich_covariance(w, w @ [1.0, 0.5] + e - w @ values, [len(t)])
    found = sampled(likelihood, values, covariance)
    textbook = np.sqrt(np.diag(np.linalg.inv(w.T @ w)) * np.var(e))
    wide = np.sqrt(np.diag(found.covariance))
    assert np.all(wide > 2.0 * textbook)
    assert np.exp(np.mean(np.log(wide / np.sqrt(np.diag(covariance))))) == pytest.approx(1.0, abs=0.35)


def test_a_bound_cuts_it_and_what_the_data_do_not_tell_is_told_by_the_prior():
    rng = np.random.default_rng(6)
    w = np.column_stack([rng.standard_normal(200), 1e-3 * rng.standard_normal(200)])
    y = w @ [0.0, 0.0] + 0.5 * rng.standard_normal(200)
    prior = Prior(np.zeros(2), np.full(2, np.inf), np.zeros(2), np.array([10.0, 2.0]))
    likelihood, values = linear(w, y, prior=prior)
    found = sampled(likelihood, np.maximum(values, 0.0), sandwich_covariance(w, y - w @ values, [200]))
    low, high = found["b0"].interval()
    assert 0.0 <= low < high < 0.2
    assert not found["b0"].told_by_prior
    assert not found["b0"].identifiable
    assert found["b1"].told_by_prior
    assert found["b1"].interval()[1] == pytest.approx(2.0 * 2.2414, rel=0.1)


def test_physics_that_is_missing_widens_what_it_may_have_moved():
    rng = np.random.default_rng(7)
    w = rng.standard_normal((500, 2))
    column = w[:, :1] + 0.5 * rng.standard_normal((500, 1))
    y = w @ [1.0, 1.0] + 0.1 * rng.standard_normal(500)
    scaled = column * 0.1
    found = {}
    for name, columns in (("without", None), ("with", scaled)):
        likelihood, values = linear(w, y, columns)
        made = sampled(likelihood, values, sandwich_covariance(w, y - w @ values, [500]))
        found[name] = np.sqrt(np.diag(made.covariance))
    assert found["with"][0] > 2.0 * found["without"][0]
    assert found["with"][1] < 1.3 * found["without"][1]


def test_pairs_that_trade_off_are_named():
    rng = np.random.default_rng(8)
    w = rng.standard_normal((300, 2))
    w[:, 1] = w[:, 0] + 0.1 * w[:, 1]
    y = w @ [1.0, 1.0] + 0.1 * rng.standard_normal(300)
    likelihood, values = linear(w, y)
    found = sampled(likelihood, values, sandwich_covariance(w, y - w @ values, [300]))
    [(a, b, correlation)] = found.pairs
    assert {a, b} == {"b0", "b1"}
    assert correlation < -0.9
    assert "trade off" in str(found)


def test_a_seed_decides_every_draw(plain):
    likelihood, values, covariance, _, found = plain
    again = sampled(likelihood, values, covariance)
    others = [sampled(likelihood, values, covariance, seed=seed) for seed in (7, 8, 9)]
    assert np.array_equal(again.draws, found.draws)
    assert not any(np.array_equal(other.draws, found.draws) for other in others)
    # A median of a thousand draws strays by .04 standard errors; that of one seed strayed by .22 with another kernel.
    apart = np.mean([other.array for other in others], axis=0) - found.array
    assert np.all(np.abs(apart) < 0.2 * np.sqrt(np.diag(covariance)))


def test_ensembles_that_stay_apart_are_refused_in_words():
    rng = np.random.default_rng(9)

    def two_valleys(places):
        return np.logaddexp(-0.5 * (places[:, 0] + 9.0) ** 2, -0.5 * (places[:, 0] - 9.0) ** 2)

    def start(side):
        return side * 9.0 + rng.standard_normal((8, 1))

    begun = iter([start(1), start(1), start(-1)])
    found = drawn(two_valleys, lambda rng, walkers: next(begun), most=400)
    assert "disagree" in found.unsettled


def test_too_few_steps_are_refused_in_words():
    walk = np.cumsum(np.random.default_rng(10).standard_normal((400, 8, 1)), axis=0)
    assert "steps with an autocorrelation time of" in settled([walk, walk + 1.0]).unsettled


def test_walkers_that_never_move_are_refused_in_words():
    still = np.tile(np.random.default_rng(10).standard_normal((1, 8, 1)), (400, 1, 1))
    assert "0 independent draws" in settled([still, still]).unsettled


def test_without_the_sampler_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "emcee", None)
    with pytest.raises(PellucidError, match=r"found no package emcee, expected it: pip install \"emcee"):
        drawn(lambda places: -np.sum(places**2, axis=1), lambda rng, walkers: rng.standard_normal((walkers, 2)))


def test_the_density_is_that_of_the_normal_distribution_it_stands_for():
    rng = np.random.default_rng(11)
    w, columns, freedom = rng.standard_normal((12, 2)), rng.standard_normal((12, 3)), 7.0
    x = np.hstack([w, columns])
    y = w @ [1.0, -1.0] + rng.standard_normal(12)
    left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    noise = Noise(float(left @ left) / freedom, freedom)
    prior = Prior(np.full(2, -np.inf), np.full(2, np.inf), np.zeros(2), np.ones(2))
    likelihood, _ = linear(w, y, columns, prior=prior, noise=noise, scale_prior=(0.0, 1.0))
    places = np.column_stack([rng.standard_normal((6, 3)), rng.uniform(np.log(0.01), 0.0, 6)])
    expected = []
    for place in places:
        r, v, s = y - w @ place[:2], np.exp(place[2]), np.exp(place[3])
        spread = v * np.eye(12) + s**2 * columns @ columns.T
        expected.append(-0.5 * r @ np.linalg.solve(spread, r) - 0.5 * np.linalg.slogdet(spread)[1])
    expected = np.array(expected) - 0.5 * np.sum(places[:, :3] ** 2, axis=1)
    found = likelihood(places)
    assert np.allclose(found - found[0], expected - expected[0], rtol=1e-10)


@pytest.mark.nightly
def test_ranks_of_the_truth_among_draws_are_even():
    """Talts et al. 2018: over truths from the prior each rank is likely; more in `research/evidence/posterior.py`."""
    rng = np.random.default_rng(12)
    prior = Prior(np.zeros(1), np.full(1, np.inf), np.zeros(1), np.ones(1))
    ranks = []
    for _ in range(16):
        truth, log_v = abs(rng.standard_normal()), 0.3 * rng.standard_normal()
        w = rng.standard_normal((6, 1))
        y = truth * w[:, 0] + np.exp(0.5 * log_v) * rng.standard_normal(6)
        left = y - w @ np.linalg.lstsq(w, y, rcond=None)[0]
        likelihood, values = linear(w, y, prior=prior, noise=Noise(left @ left / 5.0, 5.0), scale_prior=(0.0, 0.3))
        found = drawn(likelihood, likelihood.start(np.abs(values), np.eye(1)), most=500, seed=int(rng.integers(2**31)))
        ranks.append([np.mean(found.values[:, i] < t) for i, t in enumerate((truth, log_v))])
    for place in np.array(ranks).T:
        counts = np.histogram(place, 4, (0.0, 1.0))[0]
        assert np.sum((counts - 4.0) ** 2) / 4.0 < 11.3  # 1 % of chi square with 3 degrees of freedom
