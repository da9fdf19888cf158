"""Steps 1 and 2 on the virtual shank exoskeleton: as published, corrected, and with a swing that shows inertia."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...fit.parameter import Parameter
from ...fit.searches.adam import AdamPath
from ...fit.swing.leg_balance import leg_alone
from ...fit.swing.loaded_swing import (
    Swing,
    SwingFit,
    SwingForm,
    adam_swings,
    corrected_form,
    fit_swings,
    published_form,
)
from ...lab.seated.subject import SeatedSubject
from ...models.joint import GRAVITY
from .trials import SubjectTaken, tissue_torque

ITERATIONS, RATE, FINAL_RATE = 3000, 0.02, 1e-6
"""Of Adam; the paper tells none of them."""

PART = 50
"""Samples of each gradient where it rests on parts of a swing: 2 s."""

UPRIGHT = np.pi
"""Position at which the paper's angle is 0 for its eqs. 9 and 10 to be those of a leg that hangs [rad]."""

SWINGS = ("two_sines", "rich")
"""The paper's, and the one that shows inertia."""


@dataclass(frozen=True, eq=False)
class BodyFound:
    """What swings say of one body."""

    published: SwingFit  # Eqs. 9 and 10 on the paper's swing, in closed form.
    corrected: Mapping[str, SwingFit]  # By swing
    # Adam on eqs. 9 and 10 with a rate that falls, each gradient of the whole swing.
    falling: AdamPath = field(repr=False)
    # falling_parts, fixed_parts: The same with gradients of parts of it, and with a fixed rate.
    falling_parts: AdamPath = field(repr=False)
    fixed_parts: AdamPath = field(repr=False)
    swing: Swing = field(repr=False)  # The paper's

    @property
    def closed_form_difference(self) -> float:
        """Largest difference of p and q between Adam and the closed form, SI."""
        return float(np.max(np.abs(self.falling.last - self.published.coefficients)))

    @property
    def spread_ratio(self) -> float:
        """Of p and q over Adam's last iterations, fixed rate over falling, geometric mean."""
        return float(np.exp(np.mean(np.log(self.fixed_parts.spread() / self.falling_parts.spread()))))


def find_body(swings: Mapping[str, Swing]) -> BodyFound:
    """Identify an exoskeleton, empty or with a leg in it."""
    literal: SwingForm = published_form(UPRIGHT)
    two = [swings["two_sines"]]
    options = {"rate": RATE, "iterations": ITERATIONS}
    return BodyFound(
        published=fit_swings(two, literal),
        corrected={name: fit_swings([swings[name]], corrected_form(0.0)) for name in SWINGS},
        falling=adam_swings(two, literal, final_rate=FINAL_RATE, **options),
        falling_parts=adam_swings(two, literal, final_rate=FINAL_RATE, batch=PART, **options),
        fixed_parts=adam_swings(two, literal, batch=PART, **options),
        swing=two[0],
    )


@dataclass(frozen=True, eq=False)
class LegFound:
    """A subject's leg."""

    body: BodyFound  # With the exoskeleton
    inertia: Mapping[str, Parameter]  # p' - p of the corrected form, by swing [kg m^2]
    weight_moment: Mapping[str, Parameter]  # q' - q of the same [kg m]
    true_inertia: float  # Of shank and foot alone [kg m^2]
    true_weight_moment: float  # Of the same [kg m]
    restoring_moment: float  # The relaxed leg's whole restoring torque over the rich swing, tissue included [kg m]


def find_leg(empty: BodyFound, taken: SubjectTaken) -> LegFound:
    """Identify a subject's leg in the exoskeleton."""
    body = find_body({name: taken.driven(name) for name in SWINGS})
    alone = {name: leg_alone(empty.corrected[name], body.corrected[name]) for name in SWINGS}
    subject = taken.subject
    return LegFound(
        body,
        {name: found[0] for name, found in alone.items()},
        {name: found[1] for name, found in alone.items()},
        subject.inertia,
        subject.moment,
        _restoring(subject, taken.driven("rich").position),
    )


def _restoring(subject: SeatedSubject, position: np.ndarray) -> float:
    """Slope of the true restoring torque on g sin(position), beside a constant [kg m]."""
    torque = GRAVITY * subject.moment * np.sin(position - subject.ahead) - tissue_torque(subject, position)
    columns = np.column_stack([GRAVITY * np.sin(position), np.ones_like(position)])
    return float(np.linalg.lstsq(columns, torque, rcond=None)[0][0])
