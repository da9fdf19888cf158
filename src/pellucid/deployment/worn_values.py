"""Derive the numbers of the residual compensator from the cards of an orthosis and its wearer."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256

from .._errors import PellucidError
from ..control.coupling import Coupling
from ..control.limits import Limits
from ..control.residual_compensator import design, within
from ..models.parameter_card import read_parameter_card
from ..procedures.card_sources import require_fresh, source_notes
from ..procedures.coupling.actuator_card import CARD_NAME, REQUIRED_CHANNELS, actuator_card
from ..procedures.rig_instruments import rig_instruments
from ..studies.study import Study
from .controller_values import ControllerValues
from .study_limits import limits_of

MIN_GAIN_MARGIN_DB = 6.0
"""Gain margin that the loop keeps with every strap of `STRAP_FACTORS` [dB]."""

MIN_DELAY_MARGIN_S = 0.020
"""Delay margin that the loop keeps with every strap of `STRAP_FACTORS` [s]."""

STRAP_FACTORS = (0.7, 1.6)
"""Factors on the identified stiffness and damping of the strap, in every combination [1].

A strap hardens as it is pulled. With 1.3 the loop swung by itself on two of ten foreign straps of 20261101, which are
0.7 to 1.4 times as stiff as identified and twice as stiff at 0.05 to 0.12 rad."""

INERTIA_FACTORS = (0.7, 1.4)
"""Factors on the identified inertia of the orthosis with which the loop still comes to rest, on every such strap [1].

Without them the loop swung at its limit of rate, at 7 to 13 Hz, on 11 of 300 foreign orthoses of 20261103 and 20261105
to 20261107, and their drive's watch stopped it."""

DEAD_TIME_SAMPLES = 1
"""Dead time of the actuator's torque loop, from the reading to the current [samples]."""

IDENTIFIED_PARAMETERS: Mapping[str, tuple[str, str]] = {
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
"""Kind of card and name on it of each parameter of the law that is identified."""


def worn_values(study: Study, *, participant: str | None = None, period: float | None = None) -> ControllerValues:
    """Return the residual compensator's numbers for one wearer, weakened until its margins hold with every strap of
    `STRAP_FACTORS`. `period` [s]."""
    wearer = _wearer(study, participant)
    names = {"orthosis": "orthosis.json", "limb": f"{wearer}.limb.json", "coupling": f"{wearer}.coupling.json"}
    paths = {kind: study.card(name) for kind, name in names.items()}
    cards = {kind: require_fresh(study, path, read_parameter_card(path)) for kind, path in paths.items()}
    actuator, sampled = _actuator(study)
    coupling = Coupling.of_cards(cards["orthosis"], cards["limb"], cards["coupling"], actuator)
    straps = [coupling.scaled(strap_stiffness=k, strap_damping=b) for k in STRAP_FACTORS for b in STRAP_FACTORS]
    limits, stops = limits_of(study, Limits())
    made = design(coupling, sampled if period is None else period, limits=limits)
    worn = [coupling, *straps]
    wrong = [one.scaled(orthosis_inertia=factor) for one in worn for factor in INERTIA_FACTORS]
    made = within(made, worn, gain_db=MIN_GAIN_MARGIN_DB, delay=MIN_DELAY_MARGIN_S, wrong_plants=[*worn, *wrong])
    law = made.control_law()
    remarks = {name: "chosen" for name in law.values}
    for name, (kind, parameter) in IDENTIFIED_PARAMETERS.items():
        if parameter in cards[kind].values:
            low, high = cards[kind][parameter].interval
            remarks[name] = f"identified, {low:.6g} to {high:.6g}"
    remarks |= {name: "from recordings of the orthosis alone" for name in actuator if name in remarks}
    remarks |= {name: "of the steady-state Kalman filter" for name in remarks if name.startswith("correct_")}
    gain, delay = f"{MIN_GAIN_MARGIN_DB:g} dB", f"{1e3 * MIN_DELAY_MARGIN_S:g} ms"
    source_remarks = [note for kind, name in names.items() for note in source_notes(name, cards[kind])]
    notes = (
        f"For the wearer {wearer} alone: limb and strap are theirs.",
        f"The loop keeps {gain} and {delay} on straps {1 - STRAP_FACTORS[0]:.0%} softer and "
        f"{STRAP_FACTORS[-1] - 1:.0%} stiffer than identified.",
        f"It comes to rest with {1 - INERTIA_FACTORS[0]:.0%} less and {INERTIA_FACTORS[-1] - 1:.0%} more inertia of "
        "the orthosis, also at its limit of rate.",
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
        notes=(*notes, *stops, *source_remarks),
        instruments=rig_instruments(study.rig),
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
    """Return the actuator's parameters by the names of `Coupling`, and the sampling period [s].

    A study that was identified by an earlier version has no actuator card, which is then made from its recordings.
    """
    path = study.card(f"{CARD_NAME}.json")
    if path.is_file():
        card = require_fresh(study, path, read_parameter_card(path))
    else:
        card = actuator_card(study.name, study.recordings("fit"))
    if card is None:
        raise PellucidError(
            f'export of {study.name}: found no recording of protocol "sine_tracking" with '
            f"{', '.join(REQUIRED_CHANNELS)} that "
            "shows the actuator, expected one: its lag comes from it"
        )
    period, known = float(card.settings["period"]), Coupling.__dataclass_fields__
    return {n: x for n, x in card.values.items() if n in known} | {"delay": DEAD_TIME_SAMPLES * period}, period
