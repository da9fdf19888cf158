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
"""Prefixes of parameters from the card, in addition to friction; all other parameters are chosen."""

BODY_CARD = "slider.load.json"
"""File name of the card whose body the supervisor compares with the motion, for every control law."""

LIMIT_KEYS = {
    "effort_limit": "effort",
    "velocity_limit": "velocity",
    "position_min": "position_min",
    "position_max": "position_max",
}
"""Key of [rig.limits] that sets each parameter of the safety gate."""


LARGEST_EXPONENT = 10.0
"""Largest size of an exponent of equation 8; the published ones are -1 and -1.9 [1]."""


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
        raise PellucidError(f'export of {study.name}: found exponents, expected none: only "fc" and "pcfr" have them')
    if exponents is not None and not all(abs(k) <= LARGEST_EXPONENT for k in exponents):
        raise PellucidError(
            f"export of {study.name}: found exponents {exponents[0]:g} and {exponents[1]:g}, expected "
            f"-{LARGEST_EXPONENT:g} to {LARGEST_EXPONENT:g}"
        )
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
        remarks["gravity_sine"] += f"; {law.values['gravity_sine'] - stiff.values['gravity_sine']:.6g} of it from loads"
    if named.exponents:
        remark = "chosen" if exponents else "chosen by five people on another robot"
        remarks |= dict.fromkeys(("exponent_up", "exponent_down"), remark)
    notes += tuple(_notes(law, named, card, controller=controller, exponents=exponents, place=place))
    notes += drive_notes(card, study.rig) + tuple(_gain_notes(stiff, law)) + tuple(_load_notes(law, held))
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
            f"The gain on the interaction torque is {law.values['proportional']:g}, for a compliant transmission, "
            "which delays the force; a larger gain may be unstable. A stiff transmission allows "
            f"{stiff.values['proportional']:g}: if rotor and joint resonate at {MIN_STIFF_RESONANCE_HZ:g} Hz or "
            "higher, state lowest_resonance in [rig.drive] and export again."
        )
    if law.values.get("disturbance_share") != stiff.values.get("disturbance_share"):
        yield (
            f"The share of the disturbance observer is {law.values['disturbance_share']:.2g}, as in simulation, where "
            "larger shares were unstable for some wearers with a load."
        )


def _load_notes(law: ControlLaw, held: tuple[float, float] | None) -> Iterator[str]:
    if law.load is not None:
        yield (
            f"The controller compensates a load of {law.load.mass:.3g} kg at {law.load.centre:.3g} m that is fastened "
            "to the robot, and the supervisor expects it. Fasten the load before the start. If the load falls off, the "
            "supervisor stops the robot only if a force sensor shows it."
        )
    if law.supported > 0.0:
        what = "the wearer's limb" if held is None else "the wearer's limb or the load in the wearer's hand"
        yield (
            f"The controller supports {law.supported:.3g} N*m of the weight of {what}. No sensor of the robot detects "
            "that this weight is gone: if the wearer releases the load or withdraws the arm, the robot pushes with "
            "this torque."
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
            f'export of {study.name}: found a participant, expected none: "{controller}" does not depend on the wearer'
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
        raise PellucidError(
            f"{study.name}: [participants.{participant}] lacks {' and '.join(missing)}, expected mass and height"
        )
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
    yield f"The parameters are valid only with the carriage at {place:.4g} m, where inertia and gravity were computed."
    if LAWS[law.kind].optional_sensors:
        used = " and ".join(name for name in law.sensors if name in law.uses)
        yield f"Optional inputs that the controller uses: {used or 'none'}. The others stay not valid (`valid` = 0)."
    if law.emg:
        yield "The input muscle is the output of your EMG chain: the torque of the wearer's muscles at the joint."
    if law.values.get("dither") and card.presliding_travel is not None:
        yield (
            "Dither prevents sticking, but is audible and warms the motor: start with dither = 0 and increase it while "
            f"you observe the drive. The measured presliding displacement is "
            f"{1e3 * card.presliding_travel.value:.2g} mrad; dither does not prevent sticking above 0.5 mrad."
        )
    if named.exponents and exponents is None:
        up, down = PUBLISHED_EXPONENTS
        yield (
            f"The exponent k of equation 8 is {up:g} up and {down:g} down, the choice of five people on another robot. "
            "Let your participants choose, and export again with --exponents."
        )
    if controller == "fc":
        yield (
            "Equation 8 compensates more than the robot's friction at constant speed. In simulation, this controller "
            "delivers energy to the wearer in most back-and-forth movements; transparent and force_sensor absorb "
            "energy."
        )
