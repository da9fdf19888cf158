"""The report of an exoskeleton's swings: bodies, legs by difference, and the torque that was and was not explained."""

from __future__ import annotations

from ....study.drawing.drawing import Drawing, draw
from ....study.pages.moving import Traces, over_time
from ....study.pages.page import Page, Section, Tile
from ....study.pages.quantities import number
from ....study.procedures.study_page import figure_tables, parameter_tables, study_page
from ....study.study import Study
from .identify_loaded_swing import LoadedSwingResult
from .loaded_swing_table import LoadedSwingTable

MAX_DRAWN_RECORDINGS = 4
"""The page draws the torque of at most this many recordings."""

DRAWN_SPAN_S = 20.0
"""The page draws this long a stretch of each."""


def page(study: Study, findings: LoadedSwingResult) -> Page:
    """Return the report's page, figures drawn."""
    asked = study.table(LoadedSwingTable)
    bare = findings.empty.inertia
    tiles = [Tile("Exoskeleton, inertia", number(bare.value, bare.standard_error), "kg·m²")]
    for who, leg in findings.legs.items():
        moment = f"{number(leg.weight_moment.value, digits=3)} kg·m"
        tiles.append(Tile(f"Leg, {who}", number(leg.inertia.value, leg.inertia.standard_error), "kg·m²", moment))
    return study_page(
        title=f"{findings.study}: legs in an exoskeleton",
        answer=findings.answer,
        verdicts=findings.verdicts,
        tiles=tuple(tiles),
        sections=(
            Section("swing_found", "What was found", (), figure_tables(findings)),
            Section("swing_torque", "The motor's torque", drawings=(_torque(findings),)),
            Section("swing_parameters", "Parameters", tables=parameter_tables(findings)),
            Section(
                "swing_provenance",
                "How",
                (
                    f"Position and torque low-passed alike at {asked.lowpass:g} Hz, zero-phase; "
                    "least squares of inertia, weight, viscous and Coulomb friction and an offset; intervals allow for "
                    f"coloured residuals. {len(findings.checksums)} recordings; their checksums are on the cards.",
                ),
            ),
        ),
    )


def _panels(findings: LoadedSwingResult) -> list[Traces]:
    """Return each recording's measured torque with the torque of its own body's model."""
    panels = []
    for name in list(findings.swings)[:MAX_DRAWN_RECORDINGS]:
        made = findings.swings[name]
        who = findings.wearers[name]
        fit = findings.empty if who is None else findings.legs[who].loaded
        shown = made.time < made.time[0] + DRAWN_SPAN_S
        lines = {"measured": made.torque[shown], "fitted": fit.torque(made)[shown]}
        rest = "exoskeleton alone" if who is None else f"with {who}'s leg"
        panels.append(Traces(name.replace("_", " "), rest, made.time[shown], lines, "Torque (N·m)"))
    return panels


def _torque(findings: LoadedSwingResult) -> Drawing:
    roles = {"measured": "measured", "fitted": "fitted"}
    return draw(
        over_time, _panels(findings), "swing_torque", roles=roles, caption="Torque of the motor, and what swings take."
    )
