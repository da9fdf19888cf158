"""Derive the numbers of a worn elbow robot's law from the card of a joint with a carriage."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from hashlib import sha256
from typing import Any

from ..._errors import PellucidError
from ...models.anthropometry import Segment, forearm
from ...models.slider_joint import SliderCard, read_slider_card
from ...study.procedures.card_sources import require_fresh, source_notes
from ...study.study import Study
from ..control_law import LAWS, ControlLaw
from ..elbow_controllers import ELBOW_CONTROLLERS, ElbowController, stated_load
from ..elbow_laws import ELBOW_LIMITS, PUBLISHED_EXPONENTS
from ..joint_compensation import (
    DEFAULT_PERIOD_S,
    SLIDER_SPEED,
    compensation,
    identified_remarks,
    place_on_rail,
    rest_friction,
)
from ..study.rig_instruments import rig_instruments
from ..supervised import body_of
from ..transparent_laws import MIN_STIFF_RESONANCE_HZ
from .controller_values import ControllerValues, drive_notes, limits_of

CARD_PREFIXES = ("inertia", "gravity", "stribeck_velocity", "offset", "stiffness", "energy_store")
"""Beginnings of the names of parameters that follow from the card, beside friction; all other parameters are chosen."""

BODY_CARD = "slider.load.json"
"""File name of the card whose body the supervisor holds against the motion, whichever law runs."""

LIMIT_KEYS = {
    "effort_limit": "effort",
    "velocity_limit": "velocity",
    "position_min": "position_min",
    "position_max": "position_max",
}
"""Key of [rig.limits] that sets each parameter of the safety gate."""


def elbow_values(
    study: Study,
    controller: str,
    *,
    slider: float | None = None,
    participant: str | None = None,
    exponents: tuple[float, float] | None = None,
    period: float | None = None,
    load: tuple[float, float] | None = None,
    held: tuple[float, float] | None = None,
) -> ControllerValues:
    """Return the numbers of a worn elbow robot's law for one study. `slider` [m]; `period` [s].

    `load` is fastened to the robot and `held` in the wearer's hand: mass [kg] and distance from the axis [m].
    """
    if controller not in ELBOW_CONTROLLERS:
        known = ", ".join(ELBOW_CONTROLLERS)
        raise PellucidError(f'export of {study.name}: found the controller "{controller}", expected one of {known}')
    named = ELBOW_CONTROLLERS[controller]
    if exponents is not None and not named.exponents:
        raise PellucidError(f'export of {study.name}: found exponents, expected none: "{controller}" has none')
    path = study.card(named.card)
    if study.rig.slider is None and not path.is_file():
        raise PellucidError(
            f'export of {study.name}: found the controller "{controller}", expected none: this joint has no carriage'
        )
    card = require_fresh(study, path, read_slider_card(path))
    if card.effort_unit != "N*m":
        raise PellucidError(
            f"{path}: found efforts in {card.effort_unit}, expected N*m: this law's limits are torques; "
            "give [rig.drive] its torque_constant and identify again"
        )
    try:
        place = place_on_rail(card, slider)
    except PellucidError as error:
        raise PellucidError(f"{path.name}: {error}") from None
    limits, notes = limits_of(study, ELBOW_LIMITS)
    settings: dict[str, Any] = {"limits": limits, "period": DEFAULT_PERIOD_S if period is None else period}
    if named.wearer or participant is not None:
        settings |= _limb(study, controller, named, participant)
    if exponents is not None:
        settings["exponents"] = exponents
    stiff = named.build_stiff(card, place, **settings)
    where = f"export of {study.name}"
    carried_loads = {"load": stated_load(where, "load", load), "held": stated_load(where, "held", held)}
    law = named.build(card, place, lowest_resonance=lowest_resonance(study), **carried_loads, **settings)
    remarks = dict(_remarks(study, law, named.card))
    if LAWS[law.kind].carries_body:
        remarks |= {name: remark for name, remark in identified_remarks(card).items() if name in law.values}
    if law.emg:
        remarks |= {name: f"of {participant}, by mass and height" for name in ("limb_inertia", "limb_gravity")}
    if law.load is not None or law.supported > 0.0:
        remarks["gravity_sine"] += f"; {law.values['gravity_sine'] - stiff.values['gravity_sine']:.6g} of it of loads"
    if named.exponents:
        remark = "chosen" if exponents else "chosen by five people on another robot"
        remarks |= dict.fromkeys(("exponent_up", "exponent_down"), remark)
    notes += tuple(_notes(law, named, card, controller=controller, exponents=exponents, place=place))
    notes += tuple(_gain_notes(stiff, law)) + tuple(_load_notes(law, held))
    body, friction = _body(study, place)
    notes += source_notes(named.card, card)
    return ControllerValues(
        law=law.kind,
        numbers=law.values,
        uses=law.uses,
        remarks=remarks,
        cards=(named.card,),
        checksums={named.card: sha256(path.read_bytes()).hexdigest()},
        speed=SLIDER_SPEED,
        notes=notes,
        instruments=rig_instruments(study.rig),
        body=body,
        rest_friction=friction,
        load=law.load,
        supported=law.supported,
    )


def lowest_resonance(study: Study) -> float | None:
    """Return the lowest resonance of rotor and joint that a study states [Hz], or None."""
    return study.rig.drive.lowest_resonance if study.rig.drive else None


def _gain_notes(stiff: ControlLaw, law: ControlLaw) -> Iterator[str]:
    if law.values.get("proportional") != stiff.values.get("proportional"):
        yield (
            f"The gain on the interaction torque is {law.values['proportional']:g}, as in the virtual lab, not "
            f"{stiff.values['proportional']:g} as on a stiff transmission: behind a soft one the force answers late, "
            f"and more would ring. If rotor and joint resonate at {MIN_STIFF_RESONANCE_HZ:g} Hz or higher, say so with "
            "lowest_resonance in [rig.drive] and export again."
        )
    if law.values.get("disturbance_share") != stiff.values.get("disturbance_share"):
        yield (
            f"The share of the disturbance observer is {law.values['disturbance_share']:.2g}, as in the virtual lab: "
            "with more, some rang whose wearer carried a load."
        )


def _load_notes(law: ControlLaw, held: tuple[float, float] | None) -> Iterator[str]:
    if law.load is not None:
        yield (
            f"It carries a load of {law.load.mass:.3g} kg at {law.load.centre:.3g} m that is fastened to the robot, "
            "and the supervisor expects it: put the load on before the start. A load that falls off stops the robot if "
            "a force sensor contradicts it."
        )
    if law.supported > 0.0:
        what = "the wearer's limb" if held is None else "the wearer's limb or of the load in the wearer's hand"
        yield (
            f"It carries {law.supported:.3g} N*m of the weight of {what}. No sensor of the robot tells that this "
            "weight is gone: whoever lets go of a load, or takes the arm out, is pushed with that torque."
        )


def _body(study: Study, place: float) -> tuple[Mapping[str, float] | None, float | None]:
    """Return the supervisor's model of the robot and its friction at rest: both None without the card of the body.

    The model is the identified body, whichever law runs.

    A law by direction has no single body, and a law of position has no friction. The virtual lab measures every law
    with the identified body.
    """
    path = study.card(BODY_CARD)
    if not path.is_file():
        return None, None
    card = require_fresh(study, path, read_slider_card(path))
    body = body_of(compensation(card, slider=place, limits=limits_of(study, ELBOW_LIMITS)[0]))
    return body, rest_friction(card, place)


def _limb(study: Study, controller: str, named: ElbowController, participant: str | None) -> dict[str, Segment]:
    if not named.wearer:
        raise PellucidError(
            f'export of {study.name}: found a participant, expected none: "{controller}" is the same for everybody'
        )
    people = study.config.participants
    if participant not in people:
        found = "none" if participant is None else repr(participant)
        raise PellucidError(
            f"export of {study.name}: found the participant {found}, expected one of [participants]: "
            f"{', '.join(people) or 'nobody'}; {controller} needs their mass and height"
        )
    who = people[participant]
    if who.mass is None or who.height is None:
        missing = [key for key in ("mass", "height") if getattr(who, key) is None]
        raise PellucidError(f"{study.name}: [participants.{participant}] lacks {' and '.join(missing)}")
    return {"limb": forearm(who.mass, who.height)}


def _remarks(study: Study, law: ControlLaw, card: str) -> Mapping[str, str]:
    given = study.rig.limits
    friction = {field.name for field in LAWS[law.kind].fields if field.resists is not None}
    remarks = {}
    for name, value in law.values.items():
        if name in friction or (name.startswith(CARD_PREFIXES) and not name.endswith("_share")):
            remarks[name] = f"from {card}"
        elif name in LIMIT_KEYS and getattr(given, LIMIT_KEYS[name]) == value:
            remarks[name] = "from [rig.limits]"
        else:
            remarks[name] = "chosen"
    return remarks


def _notes(
    law: ControlLaw,
    named: ElbowController,
    card: SliderCard,
    *,
    controller: str,
    exponents: tuple[float, float] | None,
    place: float,
) -> Iterator[str]:
    yield f"{controller}: {named.title}."
    yield f"The carriage is at {place:.4g} m: inertia and gravity hold there only."
    if LAWS[law.kind].optional_sensors:
        used = " and ".join(name for name in law.sensors if name in law.uses)
        yield f"Of its optional inputs it uses {used or 'none'}; leave the others not valid."
    if law.emg:
        yield "muscle is the output of your EMG chain: the torque of the wearer's muscles at the joint."
    if law.values.get("dither") and card.presliding_travel is not None:
        yield (
            "The motor dithers against sticking, which is heard and warms it: begin with dither = 0, and watch what "
            "the drive makes of more. Friction was measured to build up over "
            f"{1e3 * card.presliding_travel.value:.2g} mrad; over more than 0.5 dither does not free a robot."
        )
    if named.exponents and exponents is None:
        up, down = PUBLISHED_EXPONENTS
        yield (
            f"k of equation 8 is {up:g} up and {down:g} down, which five people chose on another robot: "
            "let people choose on yours, and export again with --exponents."
        )
    if controller == "fc":
        yield (
            "Equation 8 pushes at constant speed, beyond the robot's own friction: on the virtual robot this law gives "
            "its wearer energy over most movements there and back. transparent and force_sensor take some."
        )
    yield from drive_notes(card)
