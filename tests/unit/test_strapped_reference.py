"""The wearer's torque through straps that yield: exact where the strap is known, and what taking both for one costs."""

import numpy as np
import pytest

from pellucid.estimators.strapped_reference import strapped_torque
from pellucid.estimators.torque_reference import MovedBody, human_torque
from pellucid.fit.strap.strap_torque import Limb, Orthosis

FS, LOWPASS = 500.0, 6.0
ORTHOSIS, LIMB = Orthosis(0.05, 0.01, 1.6), Limb(0.3, 8.0, 0.15, zero=0.05)


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
        t, q, spring, orthosis=ORTHOSIS, limb=LIMB, stiffness=stiffness, damping=damping, lowpass=LOWPASS
    )
    inside = slice(1000, -1000)
    assert np.sqrt(np.mean((found - knee)[inside] ** 2)) < 0.01 * knee.std()


def test_taking_both_for_one_body_is_off_by_the_limb_s_weight():
    t, q, spring, knee = recorded(12.0, 0.4)
    together = MovedBody(ORTHOSIS.gravity + LIMB.gravity, ORTHOSIS.inertia + LIMB.inertia, 0.16)
    as_one = human_torque(q, spring, together, lowpass=LOWPASS, fs=FS)
    found = strapped_torque(t, q, spring, orthosis=ORTHOSIS, limb=LIMB, stiffness=12.0, damping=0.4, lowpass=LOWPASS)
    inside = slice(1000, -1000)
    off = [np.sqrt(np.mean((x - knee)[inside] ** 2)) for x in (as_one, found)]
    assert off[0] > 20.0 * off[1]
    assert off[0] > 0.5  # N m


def test_a_strap_that_hardly_yields_makes_no_difference():
    t, q, spring, _ = recorded(12.0, 0.4)
    together = MovedBody(ORTHOSIS.gravity + 8.0, ORTHOSIS.inertia + LIMB.inertia, ORTHOSIS.viscous + LIMB.viscous)
    level = Limb(LIMB.inertia, LIMB.gravity, LIMB.viscous)
    stiff = strapped_torque(t, q, spring, orthosis=ORTHOSIS, limb=level, stiffness=1e6, damping=1.0, lowpass=LOWPASS)
    as_one = human_torque(q, spring, together, lowpass=LOWPASS, fs=FS)
    inside = slice(1000, -1000)
    assert np.abs(stiff - as_one)[inside].max() < 0.02 * as_one.std()
