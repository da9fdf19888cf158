"""Fuzzy and neural compensation of a worn elbow: what the recordings of its identification show beyond its model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..control.control_law import ControlLaw
from ..control.joint_compensation import carried
from ..control.transparent_laws import transparent, with_rules
from ..estimators.learnt_rules import LearntRules, RecordedResidual, RuleKind, learn_rules
from ..fit.slider.slider_fit import SliderFit
from ..models.friction_terms import is_friction
from ..models.slider_card import SliderCard

FRICTION_SHARE = 0.95
"""Of the friction that `transparent` carries: the rest is left for rules [1]."""

SHARES: Mapping[RuleKind, float] = {"fuzzy": 0.5, "network": 0.25}
"""Of what rules say that is carried [1]: of 0.25, 0.5, 0.75 and 1 those with the least torque on four of the robots
that other constants were chosen on. Beside dither, which leaves less than either, no share left less than none."""


def left_over(fit: SliderFit, card: SliderCard) -> list[RecordedResidual]:
    """What the robot took in every fitted recording beyond what the transparent law of its card carries: what its
    friction is more than the law dares, and what no model says."""
    shares = [FRICTION_SHARE if is_friction(p.name) else 1.0 for p in card.parameters]
    values = np.array([share * carried(p) for share, p in zip(shares, card.parameters, strict=True)])
    model, made = card.model(), []
    for motion in fit.motions:
        if motion.split == "fitted":
            torque = motion.effort - model.effort(values, motion)
            made.append(RecordedResidual(*(motion.rows(x) for x in (motion.position, motion.velocity, torque))))
    return made


def elbow_rules(fit: SliderFit, card: SliderCard, kind: RuleKind) -> LearntRules:
    """Rules of a kind for a robot, from the recordings that identified it."""
    return learn_rules(left_over(fit, card), kind)


def learnt_compensation(card: SliderCard, slider: float, rules: LearntRules) -> ControlLaw:
    """The transparent law, and a share of what rules say beyond it; the carriage is at `slider` [m]."""
    return with_rules(transparent(card, slider, friction_share=FRICTION_SHARE), rules.numbers(SHARES[rules.kind]))
