"""Laws of the strap that hold for any pair of bodies, and of its identification whatever the units and the signs."""

from dataclasses import replace

import numpy as np
import pytest
from two_bodies import Pair, record, swing

from pellucid.orthosis.strap.coupled_impedance import fit_coupling, mismatch
from pellucid.orthosis.strap.strap_model import Limb, Orthosis, from_orthosis

DRAWS = range(3)
ORTHOSIS = Pair().orthosis


def drawn(seed):
    """Any pair that a strap could join."""
    rng = np.random.default_rng(seed)
    orthosis = Orthosis(rng.uniform(0.03, 0.08), rng.uniform(0.0, 0.1), rng.uniform(0.8, 3.0))
    limb = Limb(rng.uniform(0.2, 0.6), rng.uniform(5.0, 13.0), rng.uniform(0.0, 0.4))
    return Pair(orthosis, limb, rng.uniform(8.0, 60.0), rng.uniform(0.2, 2.0), drag=rng.uniform(0.2, 1.0))


@pytest.fixture(scope="module")
def seen():
    truth = swing(Pair(), seconds=12.0, substeps=2)[0]
    return record(truth, np.random.default_rng(0))


def fitted(swing, orthosis=ORTHOSIS):
    fit = fit_coupling([swing], [from_orthosis(swing, orthosis)])
    return np.array([fit.stiffness.value, fit.damping.value, fit.inertia.value])


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in DRAWS[1:])])
def test_no_strap_is_in_the_sum_of_both_balances(seed):
    """Whatever the strap: what is left of equation 2.2's right-hand side is both bodies' own damping."""
    pair = drawn(seed)
    o, m = pair.orthosis, pair.limb
    t = swing(pair, seconds=4.0, seed=seed, substeps=4)[0]
    static = t.knee_torque + t.torque - m.gravity * np.sin(t.limb) - o.gravity * np.sin(t.position)
    left = static - m.inertia * t.limb_rates[:, 1] - o.inertia * t.position_rates[:, 1]
    own = m.viscous * t.limb_rates[:, 0] + o.viscous * t.position_rates[:, 0]
    assert np.abs(left - own).max() < 1e-9


@pytest.mark.nightly
@pytest.mark.parametrize("seed", DRAWS)
def test_any_strap_is_found_without_noise(seed):
    pair = drawn(seed)
    truth = swing(pair, seconds=12.0, seed=seed, substeps=4)[0]
    clean = record(truth, np.random.default_rng(0), noise=0.0, torque_noise=0.0, encoder=0.0)
    assert fitted(clean, pair.orthosis)[:2] == pytest.approx([pair.stiffness, pair.damping], rel=0.02)


def test_twice_all_torques_are_twice_the_strap(seen):
    o = ORTHOSIS
    double = replace(o, inertia=2 * o.inertia, viscous=2 * o.viscous, gravity=2 * o.gravity)
    heavy = replace(seen, torque=2.0 * seen.torque)
    assert fitted(heavy, double) == pytest.approx(2.0 * fitted(seen), rel=1e-6)


def test_a_mirrored_swing_has_the_same_strap(seen):
    mirrored = replace(seen, position=-seen.position, torque=-seen.torque, imu_angle=-seen.imu_angle)
    assert fitted(mirrored) == pytest.approx(fitted(seen), rel=1e-6)


def test_clocks_may_start_anywhere(seen):
    moved = replace(seen, time=seen.time + 500.0, imu_time=seen.imu_time + 500.0)
    assert fitted(moved) == pytest.approx(fitted(seen), rel=1e-5)


@pytest.mark.parametrize("inertia", [0.0, 0.01, -0.01])
def test_the_response_adds_and_scales(inertia):
    rng = np.random.default_rng(1)
    a, b = np.cumsum(rng.standard_normal((2, 2000)), axis=1)
    strap = {"stiffness": 20.0, "damping": 1.0, "inertia": inertia}
    both = mismatch(2.0 * a - b, 500.0, **strap)
    assert both == pytest.approx(2.0 * mismatch(a, 500.0, **strap) - mismatch(b, 500.0, **strap), abs=1e-9)
