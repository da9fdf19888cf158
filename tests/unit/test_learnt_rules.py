"""Rules learnt beyond a model: what the core computes of them, when they are believed, and what is told of them."""

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.transparent_laws import with_rules
from pellucid_lab.learnt_rules import RULE_GRID, LearntRules, RecordedResidual, learn_rules, memberships


def moved(seed, size, noise, count=6):
    """Recordings in which a wave along the angle and a kink at rest is left over, of a size [N m]."""
    rng, made = np.random.default_rng(seed), []
    for _ in range(count):
        t = np.arange(400) / 100.0
        q = 1.0 + 0.8 * np.sin(rng.uniform(1.0, 3.0) * t + rng.uniform(0.0, 6.0))
        v = np.gradient(q, t)
        left = size * (np.sin(2.0 * q) + np.tanh(v / 0.1))
        made.append(RecordedResidual(q, v, left + noise * rng.standard_normal(len(t))))
    return made


def test_a_rule_holds_whole_at_its_place_and_all_sum_to_one():
    q, v = np.random.default_rng(1).uniform([[-1.0], [-9.0]], [[3.0], [9.0]], (2, 200))
    assert memberships(q, v, 0.0, 2.0).sum(axis=1) == pytest.approx(1.0)
    # The second angle of five and the sixth speed of seven, 2/3 = v / (v + w).
    one = memberships(np.array([0.5]), np.array([0.6]), 0.0, 2.0).reshape(RULE_GRID.angles, RULE_GRID.speeds)
    assert one[1, 5] == pytest.approx(1.0)


@pytest.mark.parametrize("kind", ["fuzzy", "network"])
def test_what_a_model_leaves_is_learnt_and_judged_on_other_recordings(kind):
    found = learn_rules(moved(2, 0.3, 0.02), kind)
    assert found.rms_with_rules < 0.3 * found.rms_without_rules
    assert np.isfinite(found.stiffness)
    fresh = moved(3, 0.3, 0.0)[0]
    off = fresh.torque - found.predict(fresh.position, fresh.velocity)
    assert np.sqrt(np.mean(off**2)) == pytest.approx(found.rms_with_rules, rel=0.6)


@pytest.mark.parametrize("kind", ["fuzzy", "network"])
def test_noise_teaches_nothing(kind):
    # Far more noise than samples could average: rules that say much would be wrong on recordings left out.
    found = learn_rules(moved(4, 0.0, 1.0), kind)
    assert np.abs(found.torque).max() < 0.5
    assert found.rms_with_rules > 0.97 * found.rms_without_rules


def test_too_few_recordings_and_one_angle_are_refused():
    with pytest.raises(PellucidError, match="found 3 recordings, expected 4 or more"):
        learn_rules(moved(5, 0.3, 0.0, count=3), "fuzzy")
    still = [RecordedResidual(np.ones(9), np.zeros(9), np.zeros(9))] * 5
    with pytest.raises(PellucidError, match="every angle is 1 rad"):
        learn_rules(still, "fuzzy")


def test_the_core_says_what_the_rules_say():
    table = np.random.default_rng(6).uniform(-1.0, 1.0, (RULE_GRID.angles, RULE_GRID.speeds))
    rules = LearntRules("fuzzy", 0.2, 2.2, table, 0.1, 0.0, 0.0)
    values = LAWS["transparent"].defaults | {
        "velocity_width": 0.1, "bandwidth": 150.0, "energy_store": np.inf, "innovation_gate": 0.1,
        "max_rejections": 9.0, "effort_limit": 10.0, "rate_limit": 1e5, "velocity_limit": 8.0, "position_min": 0.0,
        "position_max": 2.6, "max_age": 0.005, "max_repeats": 2.0, "period": 0.001,
    }  # fmt: skip
    law = with_rules(ControlLaw("transparent", values), rules.numbers())
    t = 1e-3 * np.arange(2400)
    for speed, start in ((0.8, 0.3), (-0.5, 2.2)):
        q = start + speed * t
        law.reset()
        efforts = law.start().run(t, q)
        late = t > 0.3  # the Kalman filter has found the velocity
        expected = rules.predict(q, np.full(len(t), speed))
        assert efforts[late] == pytest.approx(expected[late], abs=5e-3)
