"""The share of inertia of a law with encoders alone: how much it may grow, what is refused, what is lowered."""

import numpy as np
import pytest
from test_tree_laws import arm, with_joint_numbers

from pellucid._errors import PellucidError
from pellucid.controllers import tree_laws
from pellucid.controllers.controller import (
    INERTIA_SHARE_STEP,
    MIN_INERTIA_MARGIN,
    inertia_margin,
    supported_inertia_share,
)

WIDTH = np.full(4, 0.05)
SETTINGS = {"friction_share": 0.95, "bandwidth": 100.0, "period": 1e-3}


def test_twice_the_share_has_half_the_margin():
    card = arm()
    one, two = (inertia_margin(card, WIDTH, share=share, **SETTINGS) for share in (0.2, 0.4))
    assert one.factor == pytest.approx(2.0 * two.factor, abs=2.0 * INERTIA_SHARE_STEP / 0.2)
    assert 0.0 < two.factor < MIN_INERTIA_MARGIN < one.factor
    assert two.joint in card.names
    late = inertia_margin(card, WIDTH, share=0.4, friction_share=0.95, bandwidth=30.0, period=1e-3)
    assert late.factor < two.factor


def test_a_share_beyond_its_margin_is_refused_and_the_usual_one_is_lowered():
    card = arm()
    with pytest.raises(PellucidError, match=r"found an inertia_share of 0\.4 .* expected 1\.5: use 0\.\d+ or less"):
        tree_laws.transparent(card, inertia_share=0.4)
    usual = tree_laws.transparent(card).shares[0]["inertia_share"]
    assert 0.0 < usual < tree_laws.MOST_INERTIA_SHARE
    tree_laws.transparent(card, inertia_share=usual)
    unchecked = tree_laws.transparent(card, inertia_share=0.4, check_margin=False)
    assert unchecked.shares[2]["inertia_share"] == 0.4
    assert tree_laws.transparent(card, inertia_share=0.0).shares[0]["inertia_share"] == 0.0


def test_what_is_within_its_margin_stays():
    sticky = with_joint_numbers(arm(), viscous_positive=3.0, viscous_negative=3.0)
    most = supported_inertia_share(sticky, WIDTH, most=0.1, friction_share=0.5, bandwidth=100.0, period=1e-3)
    assert most == 0.1
