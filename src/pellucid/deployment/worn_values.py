"""From the cards of an orthosis and its wearer to the numbers of the residual compensator."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256

from .._errors import PellucidError
from ..control.coupling import Coupling
from ..control.limits import Limits
from ..control.residual_compensator import design, within
from ..models.parameter_card import read_parameter_card
from ..procedures.card_sources import require_fresh, source_notes
from ..procedures.coupling.actuator_card import CHANNELS, NAME, actuator_card
from ..recordings.study import Study
from .controller_values import ControllerValues
from .study_limits import limits_of

GAIN_DB, DELAY = 6.0, 0.020
"""Margins that the loop keeps on every strap of `UNCERTAIN` [dB], [s]."""

UNCERTAIN = (0.7, 1.3)
"""Factors on the strap's stiffness and damping, in every combination [1]."""

DEAD_SAMPLES = 1
"""Of the actuator's torque loop, from reading to current."""

IDENTIFIED: Mapping[str, tuple[str, str]] = {
    "orthosis_inertia": ("orthosis", "inertia"),
    "orthosis_viscous": ("orthosis", "damping"),
    "orthosis_gravity": ("orthosis", "gravity"),
    "coulomb": ("orthosis", "coulomb"),
    "limb_inertia": ("limb", "inertia"),
    "limb_viscous": ("limb", "damping"),
    "limb_gravity": ("limb", "gravity"),
    "strap_stiffness": ("coupling", "stiffness"),
    "strap_damping": ("coupling", "damping"),
}
"""The law's parameter, by card and by its name there."""


def worn_values(study: Study, *, participant: str | None = None, period: float | None = None) -> ControllerValues:
    """The residual compensator for one wearer, weakened until its margins hold on every strap that may be the true
    one. `period` [s]."""
    wearer = _wearer(study, participant)
    names = {"orthosis": "orthosis.json", "limb": f"{wearer}.limb.json", "coupling": f"{wearer}.coupling.json"}
    paths = {kind: study.card(name) for kind, name in names.items()}
    cards = {kind: require_fresh(study, path, read_parameter_card(path)) for kind, path in paths.items()}
    actuator, sampled = _actuator(study)
    coupling = Coupling.of_cards(cards["orthosis"], cards["limb"], cards["coupling"], actuator)
    straps = [coupling.scaled(strap_stiffness=k, strap_damping=b) for k in UNCERTAIN for b in UNCERTAIN]
    limits, stops = limits_of(study, Limits())
    made = design(coupling, sampled if period is None else period, limits=limits)
    made = within(made, [coupling, *straps], gain_db=GAIN_DB, delay=DELAY)
    law = made.control_law()
    remarks = {name: "chosen" for name in law.values}
    for name, (kind, parameter) in IDENTIFIED.items():
        if parameter in cards[kind].values:
            low, high = cards[kind][parameter].interval
            remarks[name] = f"identified, {low:.6g} to {high:.6g}"
    remarks |= {name: "from recordings of the orthosis alone" for name in actuator if name in remarks}
    remarks |= {name: "of the steady-state Kalman filter" for name in remarks if name.startswith("correct_")}
    gain, delay = f"{GAIN_DB:g} dB", f"{1e3 * DELAY:g} ms"
    told = [note for kind, name in names.items() for note in source_notes(name, cards[kind])]
    notes = (
        f"For the wearer {wearer} alone: limb and strap are theirs.",
        f"The loop keeps {gain} and {delay} on straps {1 - UNCERTAIN[0]:.0%} softer and stiffer than identified.",
        "muscle is the output of your EMG chain; without it (valid = 0) what needs no EMG goes on.",
        "The effort is the torque wanted from the spring: your torque loop follows it.",
    )
    return ControllerValues(
        law=law.kind,
        numbers=law.values,
        uses=law.uses,
        remarks=remarks,
        cards=tuple(names.values()),
        checksums={name: sha256(paths[kind].read_bytes()).hexdigest() for kind, name in names.items()},
        notes=(*notes, *stops, *told),
    )


def _wearer(study: Study, participant: str | None) -> str:
    known = [path.name.removesuffix(".coupling.json") for path in study.cards("*.coupling.json")]
    if participant is None and len(known) == 1:
        return known[0]
    if participant is None or participant not in known:
        found = "none" if participant is None else repr(participant)
        raise PellucidError(
            f"export of {study.name}: found the participant {found}, expected one of {', '.join(known) or 'nobody'}"
        )
    return participant


def _actuator(study: Study) -> tuple[dict[str, float], float]:
    """By the names of `Coupling`, and the sampling period [s]; the card of a study identified before there was one is
    made of its recordings."""
    path = study.card(f"{NAME}.json")
    if path.is_file():
        card = require_fresh(study, path, read_parameter_card(path))
    else:
        card = actuator_card(study.name, study.recordings("fit"))
    if card is None:
        raise PellucidError(
            f'export of {study.name}: found no recording of protocol "sine_tracking" with {", ".join(CHANNELS)} that '
            "shows the actuator, expected one: its lag comes from it"
        )
    period, known = float(card.settings["period"]), Coupling.__dataclass_fields__
    return {n: x for n, x in card.values.items() if n in known} | {"delay": DEAD_SAMPLES * period}, period
