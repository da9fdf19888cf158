"""Steps 1 and 2 on the virtual shank exoskeleton: as published, corrected, and with a swing that shows inertia."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pellucid.models.estimates import Parameter
from pellucid.models.joint import GRAVITY
from pellucid.numerics.searches.adam import AdamPath
from pellucid.orthosis.swing.loaded_swing import (
    Swing,
    SwingFit,
    SwingForm,
    adam_swings,
    corrected_form,
    fit_swings,
    leg_alone,
    published_form,
)

from ...seated.subject import SeatedSubject
from .trials import SubjectSession, tissue_torque

ADAM_ITERATIONS = 3000
"""Iterations of Adam. The paper prints no number; chosen by judgement."""

ADAM_RATE = 0.02
"""Learning rate of Adam, at first where it falls. The paper prints no number; chosen by judgement."""

ADAM_FINAL_RATE = 1e-6
"""Learning rate at the last iteration where it falls. The paper prints no number; chosen by judgement."""

GRADIENT_SAMPLES = 50
"""A gradient on a part of a swing uses this many samples, which are 2 s."""

PUBLISHED_ZERO_RAD = np.pi
"""Position from hanging at which the paper's angle is 0.

Eqs. 9 and 10 of the paper describe a hanging leg only with this zero.
"""

DRIVEN_SWINGS = ("two_sines", "rich")
"""Swings that the motor makes: the paper's two sines (eq. 11), and a rich one that shows inertia."""


@dataclass(frozen=True, eq=False)
class IdentifiedBody:
    """One body identified from its swings: the exoskeleton, empty or with a leg in it."""

    published: SwingFit  # Least squares of eqs. 9 and 10 on the paper's swing, in closed form
    corrected: Mapping[str, SwingFit]  # Least squares of the corrected equations, by swing
    # Adam on eqs. 9 and 10 with a falling rate, each gradient from the whole swing
    falling: AdamPath = field(repr=False)
    # Adam with a falling rate, each gradient from a part of the swing
    falling_parts: AdamPath = field(repr=False)
    # Adam with a fixed rate, each gradient from a part of the swing
    fixed_parts: AdamPath = field(repr=False)
    swing: Swing = field(repr=False)  # The paper's swing

    @property
    def closed_form_difference(self) -> float:
        """Largest difference of p [kg m^2] or q [kg m] between Adam and the closed form."""
        return float(np.max(np.abs(self.falling.last - self.published.coefficients)))

    @property
    def spread_ratio(self) -> float:
        """Spread of p and q over Adam's last iterations, with the fixed rate over that with the falling one.

        It is the geometric mean over both parameters [1].
        """
        return float(np.exp(np.mean(np.log(self.fixed_parts.spread() / self.falling_parts.spread()))))


def find_body(swings: Mapping[str, Swing]) -> IdentifiedBody:
    """Identify an exoskeleton, empty or with a leg in it."""
    literal: SwingForm = published_form(PUBLISHED_ZERO_RAD)
    two = [swings["two_sines"]]
    options = {"rate": ADAM_RATE, "iterations": ADAM_ITERATIONS}
    return IdentifiedBody(
        published=fit_swings(two, literal),
        corrected={name: fit_swings([swings[name]], corrected_form(0.0)) for name in DRIVEN_SWINGS},
        falling=adam_swings(two, literal, final_rate=ADAM_FINAL_RATE, **options),
        falling_parts=adam_swings(two, literal, final_rate=ADAM_FINAL_RATE, batch=GRADIENT_SAMPLES, **options),
        fixed_parts=adam_swings(two, literal, batch=GRADIENT_SAMPLES, **options),
        swing=two[0],
    )


@dataclass(frozen=True, eq=False)
class IdentifiedLeg:
    """A subject's leg."""

    body: IdentifiedBody  # Leg and exoskeleton together
    inertia: Mapping[str, Parameter]  # p' - p of the corrected form, by swing [kg m^2]
    weight_moment: Mapping[str, Parameter]  # q' - q of the corrected form, by swing [kg m]
    true_inertia: float  # True inertia of shank and foot [kg m^2]
    true_weight_moment: float  # True weight moment of shank and foot [kg m]
    restoring_moment: float  # The relaxed leg's whole restoring torque over the rich swing, tissue included [kg m]


def find_leg(empty: IdentifiedBody, taken: SubjectSession) -> IdentifiedLeg:
    """Identify a subject's leg in the exoskeleton."""
    body = find_body({name: taken.driven(name) for name in DRIVEN_SWINGS})
    alone = {name: leg_alone(empty.corrected[name], body.corrected[name]) for name in DRIVEN_SWINGS}
    subject = taken.subject
    return IdentifiedLeg(
        body,
        {name: found[0] for name, found in alone.items()},
        {name: found[1] for name, found in alone.items()},
        subject.inertia,
        subject.moment,
        _restoring_slope(subject, taken.driven("rich").position),
    )


def _restoring_slope(subject: SeatedSubject, position: np.ndarray) -> float:
    """Return the slope of the true restoring torque over g sin(position), fitted together with a constant [kg m]."""
    torque = GRAVITY * subject.moment * np.sin(position - subject.ahead) - tissue_torque(subject, position)
    columns = np.column_stack([GRAVITY * np.sin(position), np.ones_like(position)])
    return float(np.linalg.lstsq(columns, torque, rcond=None)[0][0])
