"""Derive the numbers of a joint's compensation from its card."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256

from ..._errors import PellucidError
from ...models.card import Card, read_card, read_table
from ...models.slider_card import SliderCard, read_slider_card
from ...study.procedures.card_sources import require_fresh, source_notes
from ...study.study import Study
from ..joint_compensation import (
    DEFAULT_PERIOD_S,
    EFFORT_RISE_S,
    WIDTH_SHARE,
    compensation,
    identified_remarks,
    known_speed,
    place_on_rail,
    rest_friction,
    suggested_limits,
)
from ..study.rig_instruments import rig_instruments
from .controller_values import ControllerValues

CARD_NAMES = ("joint.json", "slider.load.json", "slider.consistent.json")
"""File names of the cards that a compensation can be built from; the first one that exists is used."""


def joint_values(
    study: Study,
    *,
    card: str | None = None,
    slider: float | None = None,
    period: float = DEFAULT_PERIOD_S,
    allow_outside: bool = False,
) -> ControllerValues:
    """Return the numbers that compensate gravity and friction, from a card that `identify` wrote.

    `card` is its file name in the study's models folder; None for the first of `CARD_NAMES` that exists. `slider` is
    the position of a carriage [m]; None for the middle of its rail. `period` is that of the controller [s], and
    `allow_outside` admits a card outside the study's folder.
    """
    if allow_outside:
        study = replace(study, allow_outside=True)
    name = card or next((n for n in CARD_NAMES if study.card(n).is_file()), CARD_NAMES[study.rig.slider is not None])
    path = study.card(name)
    read = read_slider_card if read_table(path).get("kind") == "slider" else read_card
    found = require_fresh(study, path, read(path))
    given = study.rig.limits
    try:
        usual = suggested_limits(found, slider)
        effort = usual.effort if given.effort is None else given.effort
        stops = (given.position_min, given.position_max)
        limits = replace(
            usual,
            effort=effort,
            rate=effort / EFFORT_RISE_S,
            velocity=usual.velocity if given.velocity is None else given.velocity,
            position=tuple(u if x is None else x for x, u in zip(stops, usual.position, strict=True)),
            stop_margin=0.0 if None in stops else 0.02 * (stops[1] - stops[0]),
        )
        law = compensation(found, slider=slider, limits=limits, period=period)
    except PellucidError as error:
        raise PellucidError(f"{path.name}: {error}") from None
    remarks = dict(identified_remarks(found))
    remarks["inertia"] += "; not carried"
    remarks |= {
        "velocity_width": f"{WIDTH_SHARE:.0%} of the largest speed seen",
        "gravity_share": "chosen",
        "friction_share": "chosen: what is left resists, so that nothing is driven",
        "bandwidth": "chosen",
        "rate_limit": f"chosen: from 0 to the limit in {1e3 * EFFORT_RISE_S:g} ms",
        "max_age": "chosen: five periods",
        "max_repeats": "chosen",
    }
    chosen = {
        "effort_limit": (given.effort, "the most that this compensation asks at a speed it knows"),
        "velocity_limit": (given.velocity, "half more than any speed seen"),
        "position_min": (given.position_min, "none known: set yours"),
        "position_max": (given.position_max, "none known: set yours"),
    }
    remarks |= {key: why if value is None else "from [rig.limits]" for key, (value, why) in chosen.items()}
    notes = source_notes(name, found)
    if isinstance(found, SliderCard):
        place = place_on_rail(found, slider)
        notes += (f"The carriage is at {place:.4g} m: inertia and gravity hold there only.",)
    if None in stops:
        notes += ("The study names no stops: set position_min, position_max and stop_margin before switching on.",)
    return ControllerValues(
        law=law.kind,
        numbers=law.values,
        remarks=remarks,
        cards=(name,),
        checksums={name: sha256(path.read_bytes()).hexdigest()},
        motion=found.motion,
        effort_unit=found.effort_unit,
        speed=known_speed(found),
        notes=notes + drive_notes(found),
        instruments=rig_instruments(study.rig),
        rest_friction=rest_friction(found, slider),
    )


def drive_notes(card: Card) -> tuple[str, ...]:
    """Return a note with the gain from the drive's command to the effort, if it is known."""
    gain = card.drive.get("gain", 1.0)
    if gain == 1.0 or card.effort_unit not in ("N*m", "N"):
        return ()
    return (f"The effort is the joint's. The drive gives {gain:.6g} {card.effort_unit} per unit of command.",)
