"""Derive the numbers of the residual compensator from the cards of an orthosis and its wearer."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from typing import ClassVar

from ..._errors import PellucidError
from ...controllers.control_law import Limits
from ...controllers.coupling import Coupling
from ...controllers.export.controller_exporter import LawExporter
from ...controllers.export.controller_values import ControllerValues, limits_of
from ...controllers.study.rig_instruments import rig_instruments
from ...controllers.worn import INERTIA_FACTORS, MIN_DELAY_MARGIN_S, MIN_GAIN_MARGIN_DB, STRAP_FACTORS, design_worn_law
from ...models.parameter_card import read_parameter_card
from ...study.exporter import ExportRequest
from ...study.procedures.card_sources import require_fresh, source_notes
from ...study.study import Study
from .coupling.cards import CARD_NAME, REQUIRED_CHANNELS, actuator_card

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
    """Return the numbers of `design_worn_law` for one wearer. `period` [s]."""
    wearer = _wearer(study, participant)
    names = {"orthosis": "orthosis.json", "limb": f"{wearer}.limb.json", "coupling": f"{wearer}.coupling.json"}
    paths = {kind: study.card(name) for kind, name in names.items()}
    cards = {kind: require_fresh(study, path, read_parameter_card(path)) for kind, path in paths.items()}
    actuator, sampled = _actuator(study)
    coupling = Coupling.of_cards(cards["orthosis"], cards["limb"], cards["coupling"], actuator)
    limits, stops = limits_of(study, Limits())
    law = design_worn_law(coupling, sampled if period is None else period, limits).control_law()
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
        f"For the wearer {wearer} only, whose limb and strap it uses.",
        f"The loop has margins of {gain} and {delay} with straps {1 - STRAP_FACTORS[0]:.0%} softer and "
        f"{STRAP_FACTORS[-1] - 1:.0%} stiffer than identified.",
        f"In simulation the motion also settles with {1 - INERTIA_FACTORS[0]:.0%} less and "
        f"{INERTIA_FACTORS[-1] - 1:.0%} more inertia of the orthosis, and when the effort reaches its rate limit.",
        "In 40 simulated runs behind a spring, the supervisor detected a drive with three times the effort in 38 (up "
        "to 3.5 J). It detected a drive with 20 ms of latency in none (4 J). Keep an emergency stop within reach.",
        "joint is the motor's encoder, where the robot has one: it measures the energy that the motor returns.",
        "muscle is the output of your EMG chain; without it (valid = 0) all terms that need no EMG continue.",
        "The effort is the commanded torque of the spring, which your torque loop follows.",
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


class WornExporter(LawExporter):
    """The residual compensator of an orthosis and its wearer."""

    order: ClassVar[int] = 30
    default_name: ClassVar[str] = "residual compensator"
    named_by_cards: ClassVar[bool] = True
    unused: ClassVar[tuple[str, ...]] = ("card", "slider", "controller", "exponents", "load", "held")
    why_unused: ClassVar[str] = "a worn orthosis has one controller, from its own model cards"

    def fits(self, request: ExportRequest) -> bool:
        """Return whether the study is of a worn orthosis."""
        return request.study.has_table("coupling")

    def values(self, request: ExportRequest) -> ControllerValues:
        """Return the numbers of the law."""
        return worn_values(request.study, participant=request.participant, period=request.period)
