"""Figures of the controllers that are compared on a worn orthosis: rows, and the page's section."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import Row, number_table
from pellucid.study.pages.page import Section

from ...knee.chosen_constants import REQUIRED_DELAY_MARGIN_S, REQUIRED_GAIN_MARGIN_DB
from ...knee.rig import knee_orthosis
from ...processes import ordered_results
from ..figure import Reproduced, figure, spread
from .controllers import CONTROLLER_WORDS
from .knee_figures import ControllerRatios, torque_ratios
from .residual import SWING_SEEDS, TEST_WEARER_SEEDS, ControllerRow, evaluate_changes, evaluate_wearer

TARGET_TORQUE_SHARE = 0.5
"""The goal for a compensator: at most this share of zero-impedance mode's strap torque."""

MAX_GAIN_MARGIN_DB = 40.0
"""Gain margins are searched up to this value; a row with it stands for more."""

MAX_DELAY_MARGIN_S = 0.1
"""Largest delay margin that is searched; a row with it means this value or more."""

DRAWN_GROUP = "drawn"
"""Group of the held-out simulated wearers."""

RIG_GROUP = "rig"
"""Group of the rig's own wearers, who were known during the design of the controllers."""

GROUP_WORDS: Mapping[str, str] = {DRAWN_GROUP: "held-out wearers", RIG_GROUP: "the rig's own"}
"""Words for the two groups of wearers."""

GROUP_COLOUR_ROLES = {GROUP_WORDS[DRAWN_GROUP]: "fitted", GROUP_WORDS[RIG_GROUP]: "measured"}
"""Colour role of each group, by its words."""

_row = partial(figure, "knee.residual")


def group_of(row: ControllerRow) -> str:
    """Return the group of a row's wearer, `DRAWN_GROUP` or `RIG_GROUP`."""
    return DRAWN_GROUP if row.subject.startswith("D") else RIG_GROUP


def residual_rows(compared: Sequence[ControllerRow]) -> list[Reproduced]:
    """Return strap torque, mismatch and margins of every controller as rows."""
    rows: list[Reproduced] = []
    for kind, words in CONTROLLER_WORDS.items():
        mine = [r for r in compared if r.controller == kind]
        for group, ending in ((DRAWN_GROUP, ""), (RIG_GROUP, f".{RIG_GROUP}")):
            own = [r for r in mine if group_of(r) == group]
            if not own:
                continue
            note = f"RMS; {len({r.subject for r in own})} wearers ({GROUP_WORDS[group]}), {len(own)} swings"
            rows += [
                _row(f"{what}.{kind}{ending}", f"{quantity}, {words}", unit, map(of, own), None, note)
                for what, quantity, unit, of in COMPARED_MEASURES
            ]
        rows += _margins(kind, words, mine)
    return rows


COMPARED_MEASURES: tuple[tuple[str, str, str, Callable[[ControllerRow], float]], ...] = (
    ("torque_ratio", "Interaction torque as a share of zero-impedance mode's", "1", lambda r: r.ratio),
    ("torque_rms", "Interaction torque", "N*m", lambda r: r.strap_torque),
    ("mismatch_rms", "Angle between leg and orthosis", "deg", lambda r: float(np.degrees(r.mismatch))),
)
"""Measures of the comparison: name in ids, words, unit, and the value from a `ControllerRow`."""


def _margins(kind: str, words: str, rows: Sequence[ControllerRow]) -> list[Reproduced]:
    made = []
    linear = [r for r in rows if r.gain_db is not None]
    if linear and kind not in ("zero_impedance", "no_control"):
        covers = "smallest of all wearers, with the strap as identified and both its constants 30 % off, friction at "
        covers += "0.1 to 4 rad/s, with and without EMG"
        for what, quantity, unit, most, values in (
            ("gain_margin", "Gain margin", "dB", MAX_GAIN_MARGIN_DB, [r.gain_db for r in linear]),
            ("delay_margin", "Delay margin", "s", MAX_DELAY_MARGIN_S, [r.delay for r in linear]),
        ):
            least = min(values)
            note = covers if np.isfinite(least) else f"{covers}; none below {most:g} {unit}, where the search ends"
            made.append(_row(f"{what}.{kind}", f"{quantity}, {words}", unit, min(least, most), None, note))
    tried = {r.subject: r.holds for r in rows if r.holds is not None}
    if tried:
        share = float(np.mean(list(tried.values())))
        gain, delay = f"{REQUIRED_GAIN_MARGIN_DB:g} dB", f"{1e3 * REQUIRED_DELAY_MARGIN_S:g} ms"
        note = f"simulated with {gain} more gain, and with {delay} more delay"
        made.append(_row(f"holds.{kind}", f"Wearers with whom it does not sway, {words}", "1", share, None, note))
    return made


def change_rows(found: Sequence[Mapping[str, Sequence[ControllerRow]]]) -> list[tuple[str, str, str]]:
    """Return a table's rows on the compensator under each perturbation."""
    made = []
    for what in found[0]:
        for kind in dict.fromkeys(r.controller for r in found[0][what]):
            median, low, high = spread(r.ratio for one in found for r in one[what] if r.controller == kind)
            made.append((what, CONTROLLER_WORDS[kind], f"{median:.3f} ({low:.3f} to {high:.3f})"))
    return made


def residual_section(compared: Sequence[ControllerRow]) -> Section:
    """Return the page's section on the comparison."""
    rows = {row.id: row for row in residual_rows(compared)}
    kinds = [kind for kind in CONTROLLER_WORDS if any(r.controller == kind for r in compared)]

    def cell(what: str, kind: str, scale: float = 1.0) -> str:
        row = rows.get(f"knee.residual.{what}.{kind}")
        if row is None:
            return "–"
        between = "" if row.lower is None else f" ({scale * row.lower:.3g} to {scale * row.upper:.3g})"
        return f"{scale * row.ours:.3g}{between}"

    cells = [
        Row(
            (
                CONTROLLER_WORDS[kind],
                cell("torque_ratio", kind),
                cell("torque_ratio", f"{kind}.{RIG_GROUP}"),
                cell("torque_rms", kind),
                cell("mismatch_rms", kind),
                cell("gain_margin", kind),
                cell("delay_margin", kind, 1e3),
                cell("holds", kind, 100.0),
            ),
            kind == "residual",
        )
        for kind in kinds
    ]
    heads = (
        "", "Share of torque, held-out wearers", "Share of torque, the rig's own", "Torque (N·m)", "Mismatch (deg)",
        "Gain margin (dB)", "Delay margin (ms)", "No sway (%)",
    )  # fmt: skip
    best = rows.get("knee.residual.torque_ratio.residual")
    lines = [
        ControllerRatios(
            CONTROLLER_WORDS[kind],
            {
                words: np.array([r.ratio for r in compared if r.controller == kind and group_of(r) == group])
                for group, words in GROUP_WORDS.items()
                if any(group_of(r) == group for r in compared)
            },
        )
        for kind in kinds
    ]
    text = (
        "The thesis proposes as future work a compensator that uses the identified strap and EMG. This page implements "
        "it from each wearer's own recordings. The constants of every controller were chosen on other simulated "
        "wearers by one criterion: the least strap torque with margins of 6 dB and 20 ms. The rig's own three wearers "
        "were known during the design; the held-out wearers were not."
    )
    if best is not None:
        text += f" The compensator leaves {100 * best.ours:.0f} % of the strap's torque in zero-impedance mode."
    return Section(
        "residual",
        "The thesis's further work: the strap's torque compensated",
        (text,),
        (
            number_table(heads, cells, "Medians and ranges over wearers and swings; margins are the smallest of all."),
        ),
        (
            draw(
                torque_ratios, lines, "residual", roles=GROUP_COLOUR_ROLES, wanted=TARGET_TORQUE_SHARE,
                caption="Strap torque of every controller, a dot for each wearer and swing, a bar their median; the "
                "line is half of zero-impedance mode's.",
            ),
        ),
    )  # fmt: skip


def main() -> None:
    """Compare controllers on every wearer, then under each perturbation, and print the rows."""
    rig = knee_orthosis()
    fresh = [f"D{seed}" for seed in TEST_WEARER_SEEDS]
    everyone = ordered_results([(evaluate_wearer, rig, name, SWING_SEEDS) for name in (*rig.subjects, *fresh)])
    for row in residual_rows([row for one in everyone for row in one]):
        between = "" if row.lower is None else f" ({row.lower:.4g} to {row.upper:.4g})"
        print(f"{row.id}: {row.ours:.4g}{between} {row.unit}")
    for row in change_rows(ordered_results([(evaluate_changes, rig, name) for name in fresh])):
        print(*row, sep="; ")


if __name__ == "__main__":
    main()
