"""From the card of a joint to the numbers of its compensation."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

import numpy as np

from .._errors import PellucidError
from ..models.card import Card, CardParameter, ModelCard, read_card, read_table
from ..models.joint import NAMES, SYMBOLS
from ..models.slider_card import SliderCard, read_slider_card
from ..models.slider_joint import SliderJointModel
from ..recordings.study import Study
from .controller_values import ControllerValues

GRAVITY_SHARE, FRICTION_SHARE = 1.0, 0.8
"""Of gravity and of friction that is carried; a fifth of the friction is left, so that nothing is driven [1]."""

WIDTH_SHARE = 0.02
"""Velocity over which friction changes its sign, as a share of the largest speed seen [1]."""

PERIOD = 1e-3
"""Of the controller, where nothing else is asked for [s]."""

BANDWIDTH = 200.0
"""Of the velocity's filter [rad/s]."""

RISE = 0.02
"""In which the effort may go from 0 to its limit [s]."""

CARDS = ("joint.json", "slider.load.json", "slider.consistent.json")
"""Cards that can be compensated, the first that is there first."""

SLIDER_SPEED = 3.0
"""Of a joint with a carriage, whose card names no range of speeds [rad/s]."""

RESISTING = ("coulomb", "viscous", "stribeck", "load")
"""What the names of friction begin with."""


def joint_values(
    study: Study, *, card: str | None = None, slider: float | None = None, period: float = PERIOD
) -> ControllerValues:
    """Compensation of gravity and friction by a card that `identify` wrote.

    Parameters
    ----------
    study : Study
        Identified.
    card : str or None
        File name in its models folder; None: the first of `CARDS` that is there.
    slider : float or None
        Where the carriage is, for a joint that has one [m]; None: the middle of its rail.
    period : float
        Of the controller [s].

    Returns
    -------
    ControllerValues

    Raises
    ------
    PellucidError
        If there is no such card, it is of a model that is no coherent body, or the carriage is off its rail.
    """
    name = card or next((n for n in CARDS if (study.models_dir / n).is_file()), CARDS[study.rig.slider is not None])
    path = study.models_dir / name
    table = read_table(path)
    found, body, notes = (_slider_body if table.get("kind") == "slider" else _joint_body)(path, slider)
    speed = found.velocity_range if isinstance(found, ModelCard) else SLIDER_SPEED
    if not speed > 0.0:
        raise PellucidError(f"{path}: found a velocity range of {speed:g}, expected the speed it was fitted on")
    limits, body = study.rig.limits, {**body, "velocity_width": WIDTH_SHARE * speed}
    largest = _largest_effort(body, speed)
    remarks = identified_remarks(found)
    remarks["inertia"] += "; not carried"
    remarks |= {
        "velocity_width": f"{WIDTH_SHARE:.0%} of the largest speed seen",
        "gravity_share": "chosen",
        "friction_share": "chosen: what is left resists, so that nothing is driven",
        "bandwidth": "chosen",
        "rate_limit": f"chosen: from 0 to the limit in {1e3 * RISE:g} ms",
        "max_age": "chosen: five periods",
        "max_repeats": "chosen",
    }

    def limit(name: str, given: float | None, otherwise: float, why: str) -> float:
        remarks[name] = "from [rig.limits]" if given is not None else why
        return otherwise if given is None else given

    effort = limit("effort_limit", limits.effort, largest, "the most that this compensation asks at a speed it knows")
    stops = "none known: set yours"
    numbers = {
        **body,
        "gravity_share": GRAVITY_SHARE,
        "friction_share": FRICTION_SHARE,
        "bandwidth": BANDWIDTH,
        "effort_limit": effort,
        "rate_limit": effort / RISE,
        "velocity_limit": limit("velocity_limit", limits.velocity, 1.5 * speed, "half more than any speed seen"),
        "position_min": limit("position_min", limits.position_min, -np.inf, stops),
        "position_max": limit("position_max", limits.position_max, np.inf, stops),
        "stop_margin": 0.02 * (limits.position_max - limits.position_min)
        if limits.position_min is not None and limits.position_max is not None
        else 0.0,
        "max_age": 5.0 * period,
        "max_repeats": 2.0,
        "period": period,
    }
    if not (np.isfinite(numbers["position_min"]) and np.isfinite(numbers["position_max"])):
        notes += ("The study names no stops: set position_min, position_max and stop_margin before switching on.",)
    notes += drive_notes(found)
    return ControllerValues(
        law="joint",
        numbers={name: float(value) for name, value in numbers.items()},
        remarks=remarks,
        cards=(name,),
        checksums={name: sha256(path.read_bytes()).hexdigest()},
        motion=found.motion,
        effort_unit=found.effort_unit,
        speed=speed,
        notes=notes,
    )


def place_on_rail(card: SliderCard, slider: float | None, path: Path) -> float:
    """Where the carriage is.

    Parameters
    ----------
    card : SliderCard
    slider : float or None
        As asked for [m]; None: the middle of the rail.
    path : Path
        Of the card, for messages.

    Returns
    -------
    float
        [m]

    Raises
    ------
    PellucidError
        If it is off the rail.
    """
    low, high = card.rail
    place = 0.5 * (low + high) if slider is None else slider
    if not low <= place <= high:
        raise PellucidError(f"{path.name}: found the carriage at {place:g} m, expected {low:g} to {high:g} m")
    return place


def drive_notes(card: ModelCard | SliderCard) -> tuple[str, ...]:
    """What turns the effort into the drive's command, if that is known.

    Parameters
    ----------
    card : ModelCard or SliderCard

    Returns
    -------
    tuple of str
    """
    gain = card.drive.get("gain", 1.0)
    if gain == 1.0 or card.effort_unit not in ("N*m", "N"):
        return ()
    return (f"The effort is the joint's. The drive gives {gain:.6g} {card.effort_unit} per unit of command.",)


def _joint_body(path: Path, slider: float | None) -> tuple[Card, dict[str, float], tuple[str, ...]]:
    if slider is not None:
        raise PellucidError(f"{path.name}: found a place of a carriage, expected none: this joint has no carriage")
    card = read_card(path)
    body = dict.fromkeys(NAMES, 0.0)
    for name, value in (*card.known.items(), *((p.name, _carried(p)) for p in card.parameters)):
        for target in SYMBOLS[name].targets:
            body[target] = value
    return card, body, ()


def _slider_body(path: Path, slider: float | None) -> tuple[Card, dict[str, float], tuple[str, ...]]:
    card: SliderCard = read_slider_card(path)
    model = card.model()
    if not isinstance(model, SliderJointModel):
        raise PellucidError(
            f"{path.name}: found one set of parameters for each direction, which is no body; "
            "expected slider.consistent.json or slider.load.json"
        )
    place = place_on_rail(card, slider, path)
    body = model.vector(np.array([_carried(p) for p in card.parameters]), place, 1.0)
    note = f"The carriage is at {place:.4g} m: inertia and gravity hold there only."
    return card, dict(zip(NAMES, map(float, body), strict=True)), (note,)


def _carried(parameter: CardParameter) -> float:
    """Of friction the lower end of its interval, so that a wrong estimate does not drive; of all else the value."""
    if not parameter.name.startswith(RESISTING) or parameter.name == "stribeck_velocity":
        return parameter.value
    return max(parameter.interval[0], 0.0)


def identified_remarks(card: Card) -> dict[str, str]:
    """What a card says of the parameters of a body.

    Parameters
    ----------
    card : Card

    Returns
    -------
    dict of str to str
        By the core's name of the parameter; of a joint with a carriage, what depends on its place is only said to.
    """
    remarks = {}
    for p in card.parameters:
        low, high = p.interval
        said = f"identified as {p.value:.6g}, {low:.6g} to {high:.6g}"
        if _carried(p) != p.value:
            said += "; the lower end is carried"
        if isinstance(card, SliderCard) and not p.name.startswith(RESISTING):
            said = "identified, at the place of the carriage"
        for target in SYMBOLS[p.name].targets if p.name in SYMBOLS else ():
            remarks[target] = said
    return remarks


def _largest_effort(body: Mapping[str, float], speed: float) -> float:
    weight = float(np.hypot(body["gravity_sine"], body["gravity_cosine"]))
    level = max(body["coulomb_positive"], body["coulomb_negative"]) + body["stribeck"]
    slope = max(body["viscous_positive"], body["viscous_negative"])
    load = max(body["load_motoring"], body["load_generating"])
    return GRAVITY_SHARE * (weight + abs(body["offset"])) + FRICTION_SHARE * (level + slope * speed + load * weight)
