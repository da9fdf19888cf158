"""Fuzzy and neural compensation of a worn elbow robot, learnt from the residuals of its identification."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.joint_compensation import carried
from pellucid.controllers.transparent_laws import transparent, with_rules
from pellucid.joint.slider.slider_fit import SliderFit
from pellucid.models.friction_terms import is_friction
from pellucid.models.slider_joint import SliderCard

from ..learnt_rules import LearntRules, RecordedResidual, RuleKind, learn_rules

FRICTION_SHARE = 0.95
"""Share of the friction that the transparent law compensates; the rest is left to the rules [1]."""

RULE_SHARES: Mapping[RuleKind, float] = {"fuzzy": 0.5, "network": 0.25}
"""Share of the rules' output that is added to the effort [1]. Of 0.25, 0.5, 0.75 and 1 these gave the least torque on
four of the robots on which other constants were chosen. With dither, which gives less torque than either, no share
improved on 0."""


def recorded_residuals(fit: SliderFit, card: SliderCard) -> list[RecordedResidual]:
    """Return the effort in every fitted recording beyond that of the transparent law of the robot's card.

    It contains the friction that the law leaves, and the effects that the model lacks.
    """
    shares = [FRICTION_SHARE if is_friction(p.name) else 1.0 for p in card.parameters]
    values = np.array([share * carried(p) for share, p in zip(shares, card.parameters, strict=True)])
    model, made = card.model(), []
    for motion in fit.motions:
        if motion.split == "fitted":
            torque = motion.effort - model.effort(values, motion)
            made.append(RecordedResidual(*(motion.rows(x) for x in (motion.position, motion.velocity, torque))))
    return made


def elbow_rules(fit: SliderFit, card: SliderCard, kind: RuleKind) -> LearntRules:
    """Learn rules of a kind for a robot from the recordings that identified it."""
    return learn_rules(recorded_residuals(fit, card), kind)


def learnt_compensation(card: SliderCard, slider: float, rules: LearntRules) -> ControlLaw:
    """Return the transparent law with a share of the rules' output added; the carriage is at `slider` [m]."""
    return with_rules(transparent(card, slider, friction_share=FRICTION_SHARE), rules.numbers(RULE_SHARES[rules.kind]))
