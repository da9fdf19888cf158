"""Second half of the reproduction's page: transparency of the control laws to simulated people."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pellucid.people.study import assessment_figures
from pellucid.people.study.assessment_figures import settling_figure
from pellucid.people.study.assessment_result import Settling
from pellucid.people.survival import survival
from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import Row, Table
from pellucid.study.pages.page import Section
from pellucid.study.pages.quantities import MINUS_SIGN, number, typeset_sentence

from ..figure import Reproduced
from ..row_sections import cell
from .law_comparison import COMPARED_CONTROLLERS, FC_WITH_OTHER_INERTIA, LAW_WORDS, UNPOWERED_ROBOT
from .transparency import CONTROL_CONDITION, LAWS, OWN_LAWS, Transparency
from .transparency_figures import LawChange, change_figure
from .transparency_rows import PRINTED_STATISTICS

MARK_COLOUR_ROLES = {
    "the paper": "measured",
    "as published": "fitted",
    "to first rest": "heldout",
    "content": "directional",
}
"""Colour role of each mark in the figure of changes, by its name in the legend."""

INDEX_TITLES = {
    "duration_median": "Duration, median",
    "vmax": "Peak velocity",
    "emgacc": "EMG/Acc",
    "duration": "Duration, mean to 20 s",
}
"""Titles of the indices, in the order of the table.

The last one has no panel, because a mean over movements that were cut off says little.
"""

OWN_LAW_WORDS = dict(zip(OWN_LAWS, ("Own, encoder", "Own, sensor"), strict=True))
"""Names of the toolkit's own laws in figures and tables."""


def transparency_sections(made: Transparency, rows: Mapping[str, Reproduced]) -> tuple[Section, ...]:
    """Return the sections on changes from control, Tables III to V, Figs. 6 to 8, and circumstances."""
    sections = [_changes(made, rows), _tables(made, rows), _circumstances(made, rows), _all_laws(rows)]
    if made.recorded.findings is not None:
        sections.insert(2, _figures(made))
    return tuple(sections)


def _changes(made: Transparency, rows: Mapping[str, Reproduced]) -> Section:
    panels = {}
    table = []
    for name, title in INDEX_TITLES.items():
        laws = []
        for law in (*LAWS, *OWN_LAWS):
            found = {
                "as published": rows[f"transparency.{name}.{law.lower()}"],
                "to first rest": rows[f"transparency.{name}.first_rest.{law.lower()}"],
                "content": rows[f"transparency.{name}.content.{law.lower()}"],
            }
            marks = {kind: _times(row) for kind, row in found.items()}
            printed = found["as published"].published
            if printed is not None:
                marks["the paper"] = (1.0 + printed / 100.0,) * 3
            laws.append(LawChange(OWN_LAW_WORDS.get(law, law), marks))
            cells = (_signed(row.ours) for row in found.values())
            between = f"{_signed(found['as published'].lower)} to {_signed(found['as published'].upper)}"
            ours, *others = cells
            beside = "–" if printed is None else _signed(printed)
            table.append(Row((title, OWN_LAW_WORDS.get(law, law), beside, ours, between, *others)))
        if name != "duration":
            panels[title] = laws
    studies = len(made.studies)
    return Section(
        "laws",
        "Do the laws change how people move?",
        (
            "Six simulated people reach over five amplitudes up and down: without a robot, with the paper's three "
            f"laws and with the toolkit's best two. The study is repeated {studies} times with other people. Their "
            "parameters come from movement without a robot, and each law is built from an identification of the robot. "
            "Their movement in the robot is therefore a prediction.",
            "The published rule ends a movement after the last sample above 5 % of its largest speed, and so counts "
            "every correction at the target. Where a robot drives or sticks, people correct again and again, and some "
            "never come to rest before the next target is shown after 20 s: "
            + "; ".join(f"{law} {rows[f'transparency.unsettled.{law.lower()}'].ours:.0f} %" for law in LAWS)
            + ". A mean of such durations is one of where they were cut off, and a few movements make most of it; so "
            "medians stand first, in which they count as longer than was seen (Kaplan and Meier). Up to their first "
            "rest the same movements take hardly longer. How finely people correct hardly shows without a robot. As "
            "drawn they aim more finely than the target is wide; people who are content as soon as they are on the "
            "target were tried after the others had been frozen, and are shown apart.",
        ),
        (
            Table(
                (
                    "Index", "Law", "Paper, real people (%)", "Ours, virtual people (%)", "Over studies",
                    "To first rest", "Content",
                ),
                tuple(table),
                frozenset({2, 3, 5, 6}),
                caption="Change from control: medians over people of each one's median duration (the paper prints "
                "means), else of means over people",
                wide=True,
            ),
        ),
        (
            draw(settling_figure, _settling(made), (CONTROL_CONDITION, *LAWS, *OWN_LAWS)),
            draw(
                change_figure, panels, "changes", roles=MARK_COLOUR_ROLES,
                caption="Every index under every law, times its value in control; bars reach over the studies. The "
                "paper prints no change of EMG/Acc, only the order FC < PCFr < CLPC.",
            ),
        ),
    )  # fmt: skip


def _settling(made: Transparency) -> tuple[Settling, ...]:
    """Return the settling of all studies' movements together, by condition."""
    found = []
    for condition in (CONTROL_CONDITION, *LAWS, *OWN_LAWS):
        lasted = np.concatenate([t.lasted for study in made.with_law(condition) for t in study.of(condition)])
        found.append(Settling(condition, survival(*lasted.T)))
    return tuple(found)


def _signed(value: float, decimals: int = 1) -> str:
    return f"{value:+.{decimals}f}".replace("-", MINUS_SIGN)


def _times(row: Reproduced) -> tuple[float, float, float]:
    values = (row.ours, row.ours if row.lower is None else row.lower, row.ours if row.upper is None else row.upper)
    return tuple(1.0 + value / 100.0 for value in values)


def _tables(made: Transparency, rows: Mapping[str, Reproduced]) -> Section:
    tables = []
    conditions = (CONTROL_CONDITION, *LAWS)
    for name, caption, keys in (
        ("table3", "Table III: duration of movements over people (s)", conditions),
        ("table4", "Table IV: largest velocity over people (rad/s)", conditions),
        (
            "table5",
            "Table V: R² of mean velocity over amplitude",
            [f"{c}_{w}" for c in conditions for w in ("up", "down")],
        ),
    ):
        shown = []
        for key in keys:
            of = [rows[f"transparency.{name}.{key.lower()}.{statistic}"] for statistic in PRINTED_STATISTICS]
            control_errors = key.replace("_", ", ")
            shown.append(Row((control_errors, "paper, real people", *(f"{row.published:.3f}" for row in of))))
            shown.append(Row((control_errors, "ours, virtual people", *(f"{row.ours:.3f}" for row in of)), True))
        heads = ("", "", "Mean", "SD", "Min", "Median", "Max")
        tables.append(Table(heads, tuple(shown), frozenset(range(2, 7)), caption=caption, wide=True))
    control_errors = []
    for name, word in (("duration", "duration"), ("vmax", "peak velocity")):
        row = rows[f"transparency.control.{name}"]
        control_errors.append(f"{word} {_signed(row.ours)} % ({_signed(row.lower)} to {_signed(row.upper)})")
    return Section(
        "tables",
        "Tables III to V",
        (
            f"Ours are medians over {len(made.studies)} studies. Without a robot, against the paper: "
            f"{', '.join(control_errors)}.",
        ),
        tuple(tables),
    )


def _figures(made: Transparency) -> Section:
    found = made.recorded.findings
    shown = {name: found.assessed[name] for name in ("duration", "vmax", "emgacc") if name in found.assessed}
    return Section(
        "figures",
        "Figs. 6 to 8, from recordings",
        (
            "The first study went through markers, encoder and EMG, and was assessed as any lab's recordings are.",
            typeset_sentence(found.paragraph),
        ),
        (),
        (
            draw(assessment_figures.profile_figure, found.profiles, found.profile_of, found.conditions),
            draw(assessment_figures.isochrony_figure, found.isochrony, found.conditions),
            draw(assessment_figures.index_figure, shown, found.conditions),
        ),
    )


def _circumstances(made: Transparency, rows: Mapping[str, Reproduced]) -> Section:
    required = {name: rows[f"transparency.required.{name}"].ours for name in ("inertia", "viscous", "coulomb")}
    needed = ", or ".join(
        f"{number(value, digits=2)} {unit}"
        for value, unit in zip(
            required.values(), ("kg·m² of inertia", "N·m·s/rad", "N·m of Coulomb friction"), strict=True
        )
        if np.isfinite(value)
    )
    energy = "; ".join(f"{law} {_signed(rows[f'transparency.energy.{law.lower()}'].ours, 2)} J" for law in LAWS)
    paragraphs = [
        f"The change of 20 % that the paper found under CLPC and PCFr would take, by the choice of durations alone, "
        f"{needed} more than an arm has.",
        f"Energy given over a closed cycle, the largest of 99 %: {energy}. Two gravities and friction, as identified, "
        "just about make up for the robot's friction; what FC's inertia term (equation 8) pushes on top of that "
        "drives. It pushes forwards at constant speed, and while a movement is braked.",
    ]
    if made.recorded.refused:
        paragraphs.append(
            f"The assessment refused the first study's recordings: {made.recorded.refused.splitlines()[0]}"
        )
    k = Table(
        ("k of eq. 8", "Up (N·m)", "Down (N·m)"),
        tuple(
            Row((cell(k), f"{up:.3f}", f"{down:.3f}"), k in made.exponents)
            for k, (up, down) in sorted(made.torques.items())
        ),
        frozenset({1, 2}),
        caption="Interaction torque (RMS) of the five people who chose k; it takes "
        f"{cell(made.exponents[0])} up and {cell(made.exponents[1])} down (the paper's people: "
        f"{cell(rows['transparency.exponent.up'].published)} and {cell(rows['transparency.exponent.down'].published)})",
    )
    return Section("behind", "What is behind it", tuple(paragraphs), (k,))


def _all_laws(rows: Mapping[str, Reproduced]) -> Section:
    table = []
    for law in (*COMPARED_CONTROLLERS, *FC_WITH_OTHER_INERTIA, UNPOWERED_ROBOT):
        torque = rows.get(f"transparency.torque.{law}_over_fc")
        given, resting = rows[f"transparency.given.{law}"].ours, rows[f"transparency.resting.{law}"].ours
        over = ("1", "") if torque is None else (f"{torque.ours:.2f}", f"{torque.lower:.2f} to {torque.upper:.2f}")
        law_words = LAW_WORDS.get(law, law.replace("_", " "))
        still = f"{resting:.3f}" if np.isfinite(resting) else "stopped"
        table.append(Row((law_words, *over, _signed(given, 3), still), law in OWN_LAWS))
    return Section(
        "alllaws",
        "All laws, on held-out robots",
        (
            f"{rows['transparency.given.fc'].note.capitalize()}; each robot is identified separately. The dithered law "
            "prevents stiction by dither of the motor. Its effect depends on the presliding displacement of a real "
            "transmission.",
        ),
        (
            Table(
                ("Law", "Torque over FC's", "Over robots", "Energy given (J)", "At rest (rad/s)"),
                tuple(table),
                frozenset({1, 3, 4}),
                caption="Interaction torque (RMS), median over robots; energy over a movement there and back (99 % of "
                "them) and speed two seconds after a movement, each on its worst robot",
                wide=True,
            ),
        ),
    )
