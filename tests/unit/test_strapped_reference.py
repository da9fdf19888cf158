"""The wearer's torque through straps that yield: exact where the strap is known, and what taking both for one costs."""

import numpy as np
import pytest
from two_bodies import Pair, swing

from pellucid.emg.estimators.torque_trial import MovedBody, human_torque
from pellucid.orthosis.strap.orthosis_alone import strapped_torque
from pellucid.orthosis.strap.strap_model import KELVIN_VOIGT, Limb, Orthosis, StrapModel

FS, LOWPASS = 500.0, 6.0
ORTHOSIS, LIMB = Orthosis(0.05, 0.01, 1.6), Limb(0.3, 8.0, 0.15, zero=0.05)


def plain(stiffness: float, damping: float) -> np.ndarray:
    return KELVIN_VOIGT.core({"stiffness": stiffness, "damping": damping})


def recorded(stiffness: float, damping: float):
    """Both bodies moved together and apart, slowly enough for the low-pass: actuator's record, and the true torque."""
    t = np.arange(0.0, 20.0, 1.0 / FS)
    w, u = 2.0 * np.pi * 0.4, 2.0 * np.pi * 0.25
    ahead = 0.3 * np.sin(u * t)
    d_ahead = 0.3 * u * np.cos(u * t)
    through = stiffness * ahead + damping * d_ahead
    q, v, a = 0.8 + 0.3 * np.sin(w * t), 0.3 * w * np.cos(w * t), -0.3 * w * w * np.sin(w * t)
    spring = ORTHOSIS.inertia * a + ORTHOSIS.viscous * v + ORTHOSIS.gravity * np.sin(q) - through
    limb, d_limb, dd_limb = q + ahead, v + d_ahead, a - 0.3 * u * u * np.sin(u * t)
    knee = LIMB.inertia * dd_limb + LIMB.viscous * d_limb + LIMB.gravity * np.sin(limb - LIMB.zero) + through
    return t, q, spring, knee


@pytest.mark.parametrize(("stiffness", "damping"), [(12.0, 0.4), (30.0, 1.0)])
def test_it_is_exact_where_the_strap_is_known(stiffness, damping):
    t, q, spring, knee = recorded(stiffness, damping)
    found = strapped_torque(
        t, q, spring, orthosis=ORTHOSIS, limb=LIMB, strap=plain(stiffness, damping), lowpass=LOWPASS
    )
    inside = slice(1000, -1000)
    assert np.sqrt(np.mean((found - knee)[inside] ** 2)) < 0.01 * knee.std()


def test_taking_both_for_one_body_is_off_by_the_limb_s_weight():
    t, q, spring, knee = recorded(12.0, 0.4)
    together = MovedBody(ORTHOSIS.gravity + LIMB.gravity, ORTHOSIS.inertia + LIMB.inertia, 0.16)
    as_one = human_torque(q, spring, together, lowpass=LOWPASS, fs=FS)
    found = strapped_torque(t, q, spring, orthosis=ORTHOSIS, limb=LIMB, strap=plain(12.0, 0.4), lowpass=LOWPASS)
    inside = slice(1000, -1000)
    off = [np.sqrt(np.mean((x - knee)[inside] ** 2)) for x in (as_one, found)]
    assert off[0] > 20.0 * off[1]
    assert off[0] > 0.5  # N m


def test_a_strap_that_hardly_yields_makes_no_difference():
    t, q, spring, _ = recorded(12.0, 0.4)
    together = MovedBody(ORTHOSIS.gravity + 8.0, ORTHOSIS.inertia + LIMB.inertia, ORTHOSIS.viscous + LIMB.viscous)
    level = Limb(LIMB.inertia, LIMB.gravity, LIMB.viscous)
    stiff = strapped_torque(t, q, spring, orthosis=ORTHOSIS, limb=level, strap=plain(1e6, 1.0), lowpass=LOWPASS)
    as_one = human_torque(q, spring, together, lowpass=LOWPASS, fs=FS)
    inside = slice(1000, -1000)
    assert np.abs(stiff - as_one)[inside].max() < 0.02 * as_one.std()


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("features", "speeds", "most"),
    [
        ({"hardening": 40.0, "along": -0.1}, (0.6, 0.75, 0.9), 0.01),
        # Nothing tells the limb's own motion through the gap: as slowly as torques are stepped.
        ({"hardening": 40.0, "slack": 0.03}, (0.2, 0.3, 0.4), 0.06),
    ],
    ids=("hardening_askew", "hardening_slack"),
)
def test_a_strap_that_is_more_than_a_spring_and_a_damper_is_seen_through(features, speeds, most):
    pair = Pair(**features)
    true = swing(pair, seconds=12.0, seed=3, speeds=speeds, substeps=2)[0]
    model = StrapModel(tuple({"along": "askew"}.get(name, name) for name in features))
    chosen = model.core({"stiffness": pair.stiffness, "damping": pair.damping, "across": 0.0, **features})
    inside = slice(1000, -1000)
    # The simplest rival at its best: the spring and the damper nearest to the torque that was there.
    velocity, acceleration = true.limb_rates.T
    pull = true.knee_torque - pair.limb.inertia * acceleration - pair.limb.viscous * velocity
    pull = pull - pair.limb.gravity * np.sin(true.limb)
    columns = np.column_stack([true.mismatch, velocity - true.position_rates[:, 0]])
    nearest = np.linalg.lstsq(columns[inside], pull[inside], rcond=None)[0]
    off = []
    for strap in (chosen, plain(*nearest)):
        found = strapped_torque(
            true.time, true.position, true.torque, orthosis=pair.orthosis, limb=pair.limb, strap=strap, lowpass=LOWPASS
        )
        off.append(np.sqrt(np.mean((found - true.knee_torque)[inside] ** 2)) / true.knee_torque.std())
    assert off[0] < most
    assert off[1] > 3.0 * off[0]
