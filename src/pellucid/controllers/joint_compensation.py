"""From the card of a joint to the law that carries its gravity and friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from .._errors import PellucidError
from ..models.card import Card, CardParameter, ModelCard
from ..models.fields import largest_friction
from ..models.friction_terms import is_friction
from ..models.joint import NAMES, SYMBOLS_BY_NAME
from ..models.slider_joint import SliderCard, SliderJointModel
from .control_law import JOINT_LAW, ControlLaw, Limits, gate_values

WIDTH_SHARE = 0.02
"""Width of the smooth sign of velocity in compensated friction, as a share of the largest recorded speed [1]."""

DEFAULT_PERIOD_S = 1e-3
"""Default control period."""

EFFORT_RISE_S = 0.02
"""Time in which the effort may rise from 0 to its limit, which sets the default rate limit."""

SLIDER_SPEED = 3.0
"""Default velocity limit of a joint with a carriage, whose card states no range of speeds [rad/s]."""


def compensation(
    card: Card,
    *,
    slider: float | None = None,
    limits: Limits | None = None,
    period: float = DEFAULT_PERIOD_S,
    **settings: float,
) -> ControlLaw:
    """Gravity of a joint carried, and four fifths of its friction, so that nothing is driven.

    `slider` is where a carriage is [m]; `limits` replace those that `card` suggests; `period` in [s]; `settings` are
    numbers of the law.
    """
    body = carried_body(card, slider)
    limits = suggested_limits(card, slider) if limits is None else limits
    law = ControlLaw(JOINT_LAW.name, JOINT_LAW.defaults | body | gate_values(limits, period))
    return law.changed(**settings)


def carried_body(card: Card, slider: float | None = None) -> dict[str, float]:
    """The core's parameters of the joint, SI, that are carried; a carriage is at `slider` [m], or amid its rail."""
    return _body_of(card, slider, carried) | {"velocity_width": WIDTH_SHARE * known_speed(card)}


def identified_body(card: Card, slider: float | None = None) -> dict[str, float]:
    """The core's parameters of the joint, SI, as identified; a carriage is at `slider` [m], or amid its rail."""
    return _body_of(card, slider, lambda parameter: parameter.value) | {
        "velocity_width": WIDTH_SHARE * known_speed(card)
    }


def rest_friction(card: Card, slider: float | None = None) -> float:
    """Return the friction of a joint at rest under its whole weight as it was identified, in the unit of the effort.

    A law carries less of it, so that a wrong estimate drives nothing; what starts the joint needs all of it. A carriage
    is at `slider` [m], or amid its rail.
    """
    body = _body_of(card, slider, lambda parameter: parameter.value)
    weight = _largest_load(body) + abs(body["offset"])
    return float(largest_friction(JOINT_LAW.fields, body, 0.0, weight))


def _body_of(card: Card, slider: float | None, taken: Callable[[CardParameter], float]) -> dict[str, float]:
    if isinstance(card, SliderCard):
        model = card.model()
        if not isinstance(model, SliderJointModel):
            raise PellucidError(
                f"model card '{card.family}': found separate parameters for each direction, which do not describe a "
                "rigid body; expected slider.consistent.json or slider.load.json"
            )
        vector = model.vector(np.array([taken(p) for p in card.parameters]), place_on_rail(card, slider), 1.0)
        body = dict(zip(NAMES, map(float, vector), strict=True))
    else:
        if slider is not None:
            raise PellucidError("found a place of a carriage, expected none: this joint has no carriage")
        body = dict.fromkeys(NAMES, 0.0)
        for name, value in (*card.known.items(), *((p.name, taken(p)) for p in card.parameters)):
            for target in SYMBOLS_BY_NAME[name].targets:
                body[target] = value
    return body


def known_speed(card: Card) -> float:
    """Largest speed that a card's model was fitted on [rad/s or m/s]."""
    speed = card.velocity_range if isinstance(card, ModelCard) else SLIDER_SPEED
    if not speed > 0.0:
        raise PellucidError(f"found a velocity range of {speed:g}, expected the speed it was fitted on")
    return speed


def suggested_limits(card: Card, slider: float | None = None) -> Limits:
    """The most that compensation asks at a speed it knows, half more than that speed, and no stops."""
    body, law, speed = carried_body(card, slider), JOINT_LAW.defaults, known_speed(card)
    weight = _largest_load(body)
    friction = largest_friction(JOINT_LAW.fields, body, speed, weight)
    effort = float(law["gravity_share"] * (weight + abs(body["offset"])) + law["friction_share"] * friction)
    return Limits(effort, effort / EFFORT_RISE_S, 1.5 * speed, (-np.inf, np.inf), 0.0)


SPRING_REACH = 1.0
"""Distance from the middle of a parallel spring up to which it is carried [rad or m]."""


def _largest_load(body: Mapping[str, float]) -> float:
    """Return the largest effort of a body's gravity and spring, SI."""
    weight = float(np.hypot(body["gravity_sine"], body["gravity_cosine"]))
    return weight + abs(body["parallel_stiffness"]) * SPRING_REACH


def place_on_rail(card: SliderCard, slider: float | None) -> float:
    """Position of the carriage [m]: as given, or the middle of its rail."""
    low, high = card.rail
    place = 0.5 * (low + high) if slider is None else slider
    if not low <= place <= high:
        raise PellucidError(f"found the carriage at {place:g} m, expected {low:g} to {high:g} m")
    return place


def carried(parameter: CardParameter) -> float:
    """The value of a parameter that a law may use.

    Of friction it is the part that the identification says may be carried, so that a wrong estimate does not drive the
    joint; on an old card it is the lower end of the interval.
    """
    if not is_friction(parameter.name):
        return parameter.value
    return max(parameter.interval[0], 0.0) if parameter.carried is None else parameter.carried


def identified_remarks(card: Card) -> Mapping[str, str]:
    """What a card says of the parameters of a body, by the core's name; of what depends on a carriage only that."""
    remarks = {}
    for p in card.parameters:
        low, high = p.interval
        said = f"identified as {p.value:.6g}, {low:.6g} to {high:.6g}"
        if carried(p) != p.value:
            said += "; the lower end is carried" if p.carried is None else f"; {carried(p):.6g} is carried"
        if isinstance(card, SliderCard) and not is_friction(p.name):
            said = "identified, at the place of the carriage"
        for target in SYMBOLS_BY_NAME[p.name].targets if p.name in SYMBOLS_BY_NAME else ():
            remarks[target] = said
    return remarks
