"""Every colour, size and font of a report, in one place: figures and page draw from here.

Roles rather than colours: blue is what was fitted, orange what was held out, everywhere on the page; families have
colours of their own. Each role has a light and a dark value (in the page, figures follow the reader's setting). Any two
roles of series differ by a CIEDE2000 of at least 10 in protan, deutan and tritan sight, and each has a contrast of at
least 4.5 with the paper, because names of curves are written in their colours (`tests/unit/test_page_colours.py`).
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
        "measured": ("#293030", "#e9ece7"),
        "faint": ("#b4b9be", "#565e67"),
        "fitted": ("#3474be", "#aec2ff"),
        "heldout": ("#be5205", "#ed9a5c"),
        "good": ("#0b764f", "#3fa37d"),
        "wrong": ("#a81a0c", "#da6560"),
        "symmetric": ("#6a727c", "#b8b9ab"),
        "directional": ("#0f2f6d", "#3dc4c3"),
        "load": ("#4d3eb4", "#fbdeff"),
        "stribeck": ("#850046", "#bb7798"),
        "combined": ("#422200", "#fad559"),
        "root": ("#2c5472", "#7c96cd"),
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
