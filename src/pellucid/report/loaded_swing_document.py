"""The report of an exoskeleton's swings: bodies, legs by difference, and the torque that was and was not explained."""

from __future__ import annotations

from importlib.metadata import version

from ..identification.findings import FigureTable, ParameterTable
from ..identification.swing.identify_loaded_swing import LoadedSwingFindings
from ..recordings.study import Study
from .drawing import Drawing, draw
from .knee_figures import Traces, over_time
from .page import Page, Section, Tile
from .quantities import cell_text, number, parameter_interval, parameter_note, prose, unit_text
from .tables import Row, Table

DRAWN, SHOWN = 4, 20.0
"""Recordings that are drawn, and how long of each [s]."""


def page(study: Study, findings: LoadedSwingFindings) -> Page:
    """Everything that was found, as a page.

    Parameters
    ----------
    study : Study
    findings : LoadedSwingFindings

    Returns
    -------
    Page
    """
    tiles = [Tile("Exoskeleton, inertia", number(findings.empty.p.value, findings.empty.p.standard_error), "kg·m²")]
    tiles += [
        Tile(f"Leg, {who}", number(leg.p.value, leg.p.standard_error), "kg·m²", f"{number(leg.q.value, digits=3)} kg·m")
        for who, leg in findings.legs.items()
    ]
    judged = tuple(_figures(t) for t in findings.tables if isinstance(t, FigureTable))
    parts = tuple(_parameters(t, findings.confidence) for t in findings.tables if isinstance(t, ParameterTable))
    told = tuple(prose(v.text) for v in findings.verdicts)
    return Page(
        title=f"{findings.study}: legs in an exoskeleton",
        kicker="Pellucid report",
        headline=prose(findings.headline),
        tiles=tuple(tiles),
        sections=(
            Section("swing_found", "What was found", told, judged),
            Section("swing_torque", "The motor's torque", drawings=(_torque(findings),)),
            Section("swing_parameters", "Parameters", tables=parts),
            Section(
                "swing_provenance",
                "How",
                (
                    f"Position and torque low-passed alike at {study.config.loaded_swing.lowpass:g} Hz, zero-phase; "
                    "least squares of inertia, weight, viscous and Coulomb friction and an offset; intervals allow for "
                    f"coloured residuals. {len(findings.checksums)} recordings; their checksums are on the cards.",
                ),
            ),
        ),
        footer=f"Written by pellucid {version('pellucid')}. Every figure is beside this page as SVG and PDF, every "
        "number in results.json.",
    )


def _torque(findings: LoadedSwingFindings) -> Drawing:
    panels = []
    for name in list(findings.swings)[:DRAWN]:
        made = findings.swings[name]
        who = next((w for w in findings.legs if name.startswith(f"{w}_")), None)
        fit = findings.empty if who is None else findings.legs[who].loaded
        shown = made.time < made.time[0] + SHOWN
        lines = {"measured": made.torque[shown], "fitted": fit.torque(made)[shown]}
        rest = "exoskeleton alone" if who is None else f"with {who}'s leg"
        panels.append(Traces(name.replace("_", " "), rest, made.time[shown], lines, "Torque (N·m)"))
    roles = {"measured": "measured", "fitted": "fitted"}
    return draw(over_time, panels, "swing_torque", roles=roles, caption="Torque of the motor, and what swings take.")


def _parameters(table: ParameterTable, level: float) -> Table:
    rows = tuple(
        Row(
            (
                p.name,
                number(p.value, p.standard_error),
                unit_text(p.unit) or "–",
                parameter_interval(p, level),
                parameter_note(p, level),
            )
        )
        for p in table.parameters
    )
    heads = ("Parameter", "Value", "Unit", f"{100 * level:g} % interval", "Notes")
    return Table(heads, rows, frozenset({1, 3}), f"{table.title}.")


def _figures(table: FigureTable) -> Table:
    rows = tuple(Row(tuple(cell_text(cell) for cell in row)) for row in table.rows)
    heads = tuple(head.replace("*", "·").replace("^2", "²").replace(" - ", " − ") for head in table.heads)
    return Table(heads, rows, frozenset(range(1, len(heads))), f"{table.title}.", True)
