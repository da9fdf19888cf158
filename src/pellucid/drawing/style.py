"""Every colour, size and font of a report, in one place: figures and page draw from here.

Roles rather than colours: blue is what was fitted, orange what was held out, everywhere on the page; families have
colours of their own. Each role has a light and a dark value (in the page, figures follow the reader's setting), picked
to stay apart under the common colour-vision deficiencies and in grey.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

COLOURS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        # role: (light, dark)
        "paper": ("#fdfdfc", "#15181c"),
        "panel": ("#f5f5f2", "#1d2126"),
        "ink": ("#1c2126", "#e7e9ec"),
        "muted": ("#616a74", "#9ca5af"),
        "rule": ("#dadcd9", "#343a41"),
        "measured": ("#3d444b", "#c6cbd1"),
        "faint": ("#b4b9be", "#565e67"),
        "fitted": ("#1f66ad", "#6eb1f2"),
        "heldout": ("#c4570e", "#f2a05f"),
        "good": ("#1b7f5c", "#5cc79f"),
        "wrong": ("#b3261e", "#ff8f85"),
        "symmetric": ("#6f7780", "#a9b1ba"),
        "directional": ("#0b7f83", "#4cc4c4"),
        "load": ("#7848a8", "#b894e6"),
        "stribeck": ("#b23a6b", "#ee8fb4"),
        "combined": ("#8a6a00", "#d9b93f"),
        "root": ("#3f5f9f", "#8fa9e0"),
    }
)

FIGURE_WIDTH = 10.4
"""Inches; shown about 1,040 px wide on a desktop, so that 9 pt becomes 12.5 px."""

SANS_SERIF_FONTS = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, 'DejaVu Sans', sans-serif"

MATPLOTLIB_SETTINGS: Mapping[str, object] = MappingProxyType(
    {
        "font.family": "DejaVu Sans",  # ships with Matplotlib: the same layout on every machine
        "font.size": 9.0,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titlepad": 7.0,
        "axes.labelsize": 9.0,
        "axes.labelcolor": COLOURS["muted"][0],
        "axes.edgecolor": COLOURS["faint"][0],
        "axes.facecolor": "none",
        "axes.linewidth": 0.8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.unicode_minus": True,
        "text.parse_math": False,  # a dollar in somebody's name is a dollar
        "axes.formatter.useoffset": False,
        "axes.formatter.limits": (-4, 5),
        "grid.color": COLOURS["rule"][0],
        "grid.linewidth": 0.6,
        "xtick.color": COLOURS["faint"][0],
        "ytick.color": COLOURS["faint"][0],
        "xtick.labelcolor": COLOURS["muted"][0],
        "ytick.labelcolor": COLOURS["muted"][0],
        "xtick.labelsize": 8.5,
        "ytick.labelsize": 8.5,
        "text.color": COLOURS["ink"][0],
        "lines.linewidth": 1.4,
        "lines.solid_capstyle": "round",
        "lines.solid_joinstyle": "round",
        "figure.facecolor": "none",
        "savefig.facecolor": "none",
        "svg.fonttype": "none",  # text stays text: small, selectable, in the reader's font
        "svg.hashsalt": "pellucid",  # ids by content: the same fit gives the same file
        "pdf.fonttype": 42,
        "path.simplify_threshold": 0.3,
    }
)


def colour(role: str) -> str:
    """Light value of a role, as #rrggbb: what figures are drawn with."""
    return COLOURS[role][0]


def css_variables(dark: bool = False) -> str:
    """The roles as CSS custom properties, one declaration each."""
    return " ".join(f"--{role}: {pair[dark]};" for role, pair in COLOURS.items())
