"""What a model leaves out widens the intervals of what it may have moved, and of nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid.joint.fit.discrepancy import (
    CAUSE_GROUPS,
    FRICTION_EFFECTS,
    NEGLECTED_EFFECTS,
    TURNING_CAUSE,
    UNEQUAL_LOAD_LOSSES,
    States,
    estimate_discrepancy,
)
from pellucid.numerics.uncertainty import sandwich_covariance

NAMES = ("inertia", "gravity", "viscous", "coulomb")
TRUTH = np.array([0.05, 1.5, 0.1, 0.4])


def motion(rng, n=4000):
    t = np.arange(n) / 50.0
    w = 2.0 * np.pi * 0.13 * np.arange(1, 7)
    phase = rng.uniform(0.0, 2.0 * np.pi, 6)
    q = 0.8 + np.sin(t[:, None] * w + phase) @ (0.4 / np.arange(1, 7))
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    load = TRUTH[0] * a + TRUTH[1] * np.sin(q)
    states = States(q, v, a, load, np.cos(q), np.gradient(np.gradient(a, t), t), np.zeros(n))
    return states, np.column_stack([a, np.sin(q), v, np.sign(v)])


def estimated(states, w, effort):
    values = np.linalg.lstsq(w, effort, rcond=None)[0]
    residual = effort - w @ values
    statistical = sandwich_covariance(w, residual, [len(w)])
    return values, statistical, estimate_discrepancy(NAMES, values, w, residual, states, statistical)


def test_without_misfit_hardly_anything_is_added():
    rng = np.random.default_rng(1)
    states, w = motion(rng)
    _, statistical, lacking = estimated(states, w, w @ TRUTH + 0.05 * rng.standard_normal(len(w)))
    added = np.sqrt(np.diag(lacking.covariance) / np.diag(statistical))
    assert np.median(added) < 2.0
    assert np.sqrt(lacking.covariance[1, 1]) < 0.02 * TRUTH[1]


@pytest.mark.parametrize("name", ["friction that falls from rest", "friction that grows with the load"])
def test_the_truth_lies_within_where_physics_is_missing_that_a_joint_may_have(name):
    rng = np.random.default_rng(2)
    held_before, held = [], []
    for _ in range(12):
        states, w = motion(rng)
        extra = NEGLECTED_EFFECTS[name](states)
        effort = w @ TRUTH + 0.08 * extra / np.std(extra) + 0.02 * rng.standard_normal(len(w))
        values, statistical, lacking = estimated(states, w, effort)
        error = np.abs(values - TRUTH)
        held_before.append(error <= 1.96 * np.sqrt(np.diag(statistical)))
        held.append(error <= 1.96 * np.sqrt(np.diag(statistical + lacking.covariance)))
    assert np.mean(held_before) < 0.7
    assert np.mean(held) > 0.9


def test_the_cause_is_named():
    rng = np.random.default_rng(3)
    states, w = motion(rng)
    extra = NEGLECTED_EFFECTS["friction that grows with the load"](states)
    _, _, lacking = estimated(states, w, w @ TRUTH + 0.2 * extra + 0.01 * rng.standard_normal(len(w)))
    assert lacking.of(("coulomb",))[1] == ("friction that grows with the load",)
    assert lacking.of(("gravity", "inertia"))[0].shape == (2, 2)


def test_what_sticks_is_left_out():
    rng = np.random.default_rng(4)
    states, w = motion(rng)
    slow = np.abs(states.velocity) < 0.15
    effort = w @ TRUTH + 0.01 * rng.standard_normal(len(w)) - 0.3 * slow * states.direction
    stuck = States(**{**vars(states), "standstill": slow.astype(float)})
    values, statistical, lacking = estimated(stuck, w, effort)
    wide = 1.96 * np.sqrt(np.diag(statistical + lacking.covariance))
    assert abs(values[3] - TRUTH[3]) <= wide[3]
    assert lacking.causes[3] == "sticking at standstill"


def test_a_covariance_is_one_and_the_same_whatever_the_units():
    rng = np.random.default_rng(5)
    states, w = motion(rng)
    effort = (
        w @ TRUTH
        + 0.1 * NEGLECTED_EFFECTS["friction that falls from rest"](states)
        + 0.02 * rng.standard_normal(len(w))
    )
    unit = np.array([1e3, 1.0, 1e-2, 1.0])
    plain, scaled = estimated(states, w, effort)[2], estimated(states, w / unit, effort)[2]
    assert scaled.covariance == pytest.approx(plain.covariance * np.outer(unit, unit), rel=1e-4, abs=1e-12)
    assert np.linalg.eigvalsh(plain.covariance).min() > -1e-12


def test_what_only_scales_inertia_and_gravity_is_told_by_the_load_friction_not_by_the_residual():
    rng = np.random.default_rng(6)
    states, w = motion(rng)
    w = np.column_stack([w, states.direction * np.abs(states.load)])
    names, truth, lost = (*NAMES, "load_friction"), np.append(TRUTH, 0.06), 0.03
    effort = w @ truth + lost * states.load + 1e-3 * rng.standard_normal(len(w))
    values = np.linalg.lstsq(w, effort, rcond=None)[0]
    residual = effort - w @ values
    statistical = sandwich_covariance(w, residual, [len(w)])

    def half(names):
        added = estimate_discrepancy(names, values, w, residual, states, statistical).covariance
        return 1.96 * np.sqrt(np.diag(statistical + added))

    error = np.abs(values - truth)
    assert np.all(error[:2] > 0.9 * lost * truth[:2])
    assert np.all(error <= half(names))
    assert half(names)[:2] == pytest.approx(0.81 * 0.06 * truth[:2], rel=0.05)
    # where motoring and generating are told apart by a known load, nothing hides
    assert np.all(half((*NAMES, "load_motoring"))[:2] < 0.1 * lost * truth[:2])


def test_a_spring_that_shows_does_not_widen_the_friction():
    rng = np.random.default_rng(7)
    states, w = motion(rng)
    spring = 0.05 * states.snap / np.std(states.snap)
    _, statistical, lacking = estimated(states, w, w @ TRUTH + spring + 0.02 * rng.standard_normal(len(w)))
    added = np.sqrt(np.diag(lacking.covariance) / np.diag(statistical))
    assert lacking.causes[0] == "a spring in the drive"
    assert added[0] > 20.0
    assert np.all(added[1:] < 4.0)


def test_what_looks_like_a_spring_in_one_stretch_alone_widens_nothing():
    rng = np.random.default_rng(8)
    widths = []
    for _ in range(6):
        states, w = motion(rng)
        once = 0.1 * states.snap / np.std(states.snap) * (np.arange(len(w)) < 0.1 * len(w))
        _, statistical, lacking = estimated(states, w, w @ TRUTH + once + 0.05 * rng.standard_normal(len(w)))
        widths.append(np.sqrt((lacking.covariance[0, 0] + statistical[0, 0]) / statistical[0, 0]))
    assert np.median(widths) < 2.0


def test_friction_that_gives_way_where_the_joint_turns_is_no_other_friction():
    """It was taken for friction that falls from rest and the like, and intervals of inertia missed the truth."""
    rng, covered = np.random.default_rng(7), {"plain": [], "turning": []}
    for _ in range(8):
        states, w = motion(rng)
        rows = np.arange(len(w))
        after = rows - np.maximum.accumulate(np.where(np.diff(np.sign(states.velocity), prepend=0.0), rows, 0))
        turning = np.column_stack([states.direction * np.exp(-after / k) for k in (4.0, 8.0, 16.0)])
        effort = w @ TRUTH - turning @ [0.1, 0.2, 0.0] + 0.01 * rng.standard_normal(len(w))
        for key, own in (("plain", states), ("turning", replace(states, turning=turning))):
            values, statistical, lacking = estimated(own, w, effort)
            whole = statistical - lacking.explained + lacking.covariance
            covered[key].append(np.abs(values - TRUTH) <= 1.96 * np.sqrt(np.diag(whole)))
        assert TURNING_CAUSE in lacking.causes
    assert np.mean(covered["plain"]) < 0.8
    assert np.mean(covered["turning"]) > 0.9


def test_what_known_effects_explain_of_the_residual_is_no_noise():
    """It was counted twice: as coloured noise, and as the shift of the parameters that it makes."""
    rng = np.random.default_rng(8)
    states, w = motion(rng)
    effort = w @ TRUTH + 0.1 * NEGLECTED_EFFECTS["viscosity that changes along the travel"](states)
    _, statistical, lacking = estimated(states, w, effort + 0.01 * rng.standard_normal(len(w)))
    left = statistical - lacking.explained
    assert np.all(np.diag(left) <= 1.001 * np.diag(statistical))
    assert np.min(np.diag(left) / np.diag(statistical)) < 0.5
    error = np.sqrt(np.diag(statistical))
    assert np.linalg.eigvalsh(left / np.outer(error, error)).min() > -1e-6


def test_unequal_losses_of_the_load_are_one_cause_with_friction():
    """Tested alone, they would count as present wherever friction is: their column lies within the model's span."""
    assert set(CAUSE_GROUPS[0]) == {*FRICTION_EFFECTS, UNEQUAL_LOAD_LOSSES}
    assert sorted(name for group in CAUSE_GROUPS for name in group) == sorted(NEGLECTED_EFFECTS)
