"""Muscles of knee and ankle calibrated at once, where the truth is known: what is found, when, and how surely."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import across

from pellucid._errors import IdentificationError
from pellucid.emg.estimators.cross_validation import score
from pellucid.emg.estimators.hill import fit_together
from pellucid.emg.fit.muscle_calibration import (
    DELAY_BOUNDS,
    GROUP_STRENGTH_CORRELATION,
    TIMING_CANDIDATES,
    Timing,
    coupled_priors,
)
from pellucid.emg.fit.muscle_posterior import count_bounds_reported_as_estimates, covariance, muscle_parameters

TRUE = {
    "strength.gastrocnemius_medialis": 1.4,
    "strength.soleus": 1.3,
    "strength.vastus_lateralis": 0.8,
    "delay": 0.02,
    "time_constant": 0.02,
    "shape": -1.5,
    "knee.offset": 2.0,
}
QUICK = {"weights": (0.005,), "timings": (Timing(0.04),)}


def fitted_to(trials, **asked):
    return fit_together({joint: [trial] for joint, trial in trials.items()}, **{**QUICK, **asked})


@pytest.fixture(scope="module")
def trials():
    return across(true=TRUE)


@pytest.fixture(scope="module")
def found(trials):
    return fitted_to(trials)


def test_a_muscle_of_two_joints_has_one_set_of_numbers(found):
    names = [p.name for p in found.parameters]
    assert names.count("strength.gastrocnemius_medialis") == 1
    assert {"knee.offset", "ankle.offset", "delay", "time_constant", "shape"} <= set(names)
    gastrocnemius = next(p for p in found.parameters if p.name == "strength.gastrocnemius_medialis")
    low, high = gastrocnemius.interval()
    assert low < 1.4 < high
    soleus = next(p for p in found.parameters if p.name == "strength.soleus")
    assert soleus.value == pytest.approx(1.3, abs=0.05)
    data = found.fit.problem.samples.data
    arms = data.moment_arm[:, list(found.driven).index("gastrocnemius_medialis")]
    assert np.all(np.abs(arms).min(axis=1) > 0.005)


def test_other_movements_of_both_joints_lie_within_the_bands(found):
    other = across("b", seed=5, true=TRUE, heldout=True)
    made, half = found.predict(other), found.half_width(other)
    for joint in ("knee", "ankle"):
        assert score(other[joint].torque, made[joint]).r2 > 0.99
        assert np.mean(np.abs(other[joint].torque - made[joint]) <= half[joint]) > 0.9


def test_the_gradient_of_coupled_muscles_is_exact(found):
    asked = found.fit.problem
    z = np.clip(np.random.default_rng(3).normal(0.0, 0.3, len(asked.lower)), asked.lower + 0.01, asked.upper - 0.01)
    _, gradient = asked.cost_and_gradient(z)
    for i in range(0, len(z), 5):
        step = 1e-5 * np.eye(len(z))[i]
        difference = (asked.cost(z + step) - asked.cost(z - step)) / 2e-5
        assert gradient[i] == pytest.approx(difference, rel=1e-4, abs=1e-8)


def test_intervals_hold_people_drawn_from_what_people_are():
    """As many as they promise, less what eight people leave to chance; bounds are no estimates."""

    def person(seed):
        def z(problem):
            root = np.linalg.cholesky(np.linalg.inv(problem.hold))
            drawn = 0.7 * root @ np.random.default_rng(900 + seed).standard_normal(len(root))
            return np.clip(drawn, problem.lower + 1e-3, problem.upper - 1e-3)

        return z

    inside = []
    for seed in range(8):
        made = fitted_to(across(seed=seed, seconds=6.0, true=person(seed)), weights=(0.01,))
        sd, free = np.sqrt(np.diag(covariance(made.fit))), ~made.fit.at_bound
        inside.append((np.abs(person(seed)(made.fit.problem) - made.fit.z) <= 1.96 * sd)[free])
        assert count_bounds_reported_as_estimates(made.fit, muscle_parameters(made.fit)) == 0
    assert 0.9 < np.mean(np.concatenate(inside)) <= 1.0


@pytest.mark.parametrize("early", [-0.08, 0.0, 0.12])
def test_the_streams_offset_is_found_with_its_interval(early):
    made = fitted_to(across(seed=3, true=TRUE, early=early), offset=True)
    assert made.offset.low < early < made.offset.high
    assert made.offset.high - made.offset.low < 0.12
    assert made.offset.value == pytest.approx(early, abs=0.02)
    assert made.offset.certain == (early != 0.0)
    delay = next(p for p in made.parameters if p.name == "delay")
    assert delay.value == pytest.approx(0.02 + early, abs=0.01)


def test_no_muscle_takes_longer_than_muscles_do():
    """The stream runs 0.12 s ahead, and nobody asked for its offset: the delay ends on its bound, undetermined."""
    made = fitted_to(across(seed=3, true=TRUE, early=0.12))
    assert DELAY_BOUNDS.min_total_s <= made.delays.min() <= made.delays.max() <= DELAY_BOUNDS.max_total_s
    delay = next(p for p in made.parameters if p.name == "delay")
    assert delay.at_bound
    assert not delay.identifiable
    assert np.isnan(delay.standard_error)
    assert made.offset is None


@pytest.mark.parametrize("period", [1e-3, 1e-2])
@pytest.mark.parametrize("timing", TIMING_CANDIDATES)
def test_every_way_to_share_the_delay_stays_between_10_and_100_ms(found, timing, period):
    muscles = found.fit.problem.model.muscles
    priors, hold = coupled_priors(muscles, timing, period)
    for bound, end in (("lower", DELAY_BOUNDS.min_total_s), ("upper", DELAY_BOUNDS.max_total_s)):
        of = {p.free.quantity: getattr(p.free, bound) for p in priors}
        each = replace(
            muscles[0], delay=of["delay"], time_constant_1=of["time_constant"], time_constant_2=of["time_constant"]
        )
        late = type(found.fit.problem.model)([each]).estimator(period).delays[0]
        assert late <= end if bound == "upper" else late >= end
    inverse = np.linalg.inv(hold)
    names = [p.free.name for p in priors]
    pair = names.index("strength.vastus_lateralis"), names.index("strength.vastus_medialis")
    assert inverse[pair] == pytest.approx(GROUP_STRENGTH_CORRELATION)
    assert inverse[pair[0], names.index("strength.soleus")] == pytest.approx(0.0, abs=1e-12)


def test_joints_of_different_recordings_are_refused(trials):
    other = replace(trials["ankle"], name="c")
    with pytest.raises(IdentificationError, match="found the knee's torque in a and the ankle's in c"):
        fitted_to({"knee": trials["knee"], "ankle": other})
    short = {name: x[:-5] for name, x in other.envelopes.items()}
    cut = replace(
        trials["ankle"], time=other.time[:-5], torque=other.torque[:-5], envelopes=short,
        angles={j: q[:-5] for j, q in other.angles.items()},
    )  # fmt: skip
    with pytest.raises(IdentificationError, match="the knee's torque at 1000 instants and the ankle's at 995"):
        fitted_to({"knee": trials["knee"], "ankle": cut})
    with pytest.raises(IdentificationError, match="two joints or more"):
        fitted_to({"knee": trials["knee"]})
    with pytest.raises(IdentificationError, match="held-out trial a"):
        fitted_to({j: replace(t, heldout=True) for j, t in trials.items()})
