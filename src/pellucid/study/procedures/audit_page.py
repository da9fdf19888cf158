"""Write the page of an audit: one verdict for each channel, the unsound ones drawn, the files.

Draw the channels of a log that an audit found unsound, each over the file in which it is worst.
"""

from __future__ import annotations

from collections import Counter
from importlib.metadata import version
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...files.log import (
    ALARM_LEVEL,
    NOTE_LEVEL,
    REPAIRED_LEVEL,
    SOUND_LEVEL,
    VERDICT_WORDS,
    Log,
    LogChannel,
    LogFinding,
)
from ...files.quantity import EFFORT_QUANTITIES
from ..drawing.drawing import Drawing, Head, draw, heads, line, tidy
from ..drawing.style import FIGURE_WIDTH, colour
from ..pages.forest import Row, Table
from ..pages.page import Page, Section, Tile, write_page
from ..pages.quantities import typeset_quantities, unit_text
from .audit import Audit, ChannelVerdict, finding_size

PANEL_HEIGHT = 1.35
"""Height of a panel [in]."""

MAX_PANELS = 12
"""The figure of all unsound channels shows at most this many."""

DRAWN_FIRST = ("position", "velocity", *EFFORT_QUANTITIES, "emg")
"""Quantities that studies use; the figure on the first screen shows their sound channels first."""

FIRST_PANELS = 3
"""The figure on the first screen shows at most this many channels."""


def audited_channels(audit: Audit) -> list[tuple[ChannelVerdict, str, Log, LogChannel]]:
    """Return the unsound channels that can be drawn, each with the file in which most was found."""
    logs = {file.name: file.log for file in audit.files if file.log is not None}
    drawn = []
    for verdict in audit.verdicts:
        for name, finding in sorted(verdict.findings, key=lambda each: _severity(verdict, each[1]), reverse=True):
            channel = next((c for c in logs[name].channels if c.name == finding.channel), None)
            if channel is not None and finding.level == ALARM_LEVEL and np.isfinite(channel.samples).any():
                drawn.append((verdict, name, logs[name], channel))
                break
    return drawn[:MAX_PANELS]


def _severity(verdict: ChannelVerdict, finding: LogFinding) -> tuple[bool, float]:
    """Return a key that sorts findings: those of the verdict's kind last, and the larger of two later."""
    return VERDICT_WORDS[finding.kind] == verdict.verdict, finding_size(finding)


def first_channels(audit: Audit) -> Drawing:
    """Draw the worst unsound channels, or, if none is, the measured ones of the first file that could be read."""
    unsound = audited_channels(audit)
    if unsound:
        return _channels(unsound[:FIRST_PANELS], "first_channels", "wrong")
    logs = [(file.name, file.log) for file in audit.files if file.log is not None]
    by_name = {verdict.channel: verdict for verdict in audit.verdicts}
    sound = [
        (by_name[channel.name], name, log, channel)
        for name, log in logs[:1]
        for channel in log.channels
        if channel.name in by_name and np.isfinite(channel.samples).any()
    ]
    # Settings of one row, and the clock, show nothing of the log.
    longest = max((len(channel.samples) for *_, channel in sound), default=0)
    shown = [each for each in sound if len(each[3].samples) == longest and each[3].name != each[2].time]
    shown.sort(key=lambda each: (each[0].level == NOTE_LEVEL, _use(each[3])))
    # One channel of each quantity comes before the next ones.
    seen: Counter[str] = Counter()
    turns = []
    for each in shown:
        turns.append(seen[each[3].quantity.kind])
        seen[each[3].quantity.kind] += 1
    shown = [each for _, each in sorted(zip(turns, shown, strict=True), key=lambda pair: pair[0])]
    return _channels((shown or sound)[:FIRST_PANELS], "first_channels", "good")


def _use(channel: LogChannel) -> tuple[int, bool]:
    """Return a key that sorts channels: those that studies use first, a measurement before a command."""
    kind = channel.quantity.kind
    place = DRAWN_FIRST.index(kind) if kind in DRAWN_FIRST else len(DRAWN_FIRST) + (not channel.is_measurement)
    return place, not channel.quantity.can_be_measured


def _channels(drawn: list[tuple[ChannelVerdict, str, Log, LogChannel]], name_of_figure: str, role: str) -> Drawing:
    """Draw channels against their rows, one panel beneath another; `role` is the colour of what is said of each."""
    figure = Figure(figsize=(FIGURE_WIDTH, PANEL_HEIGHT * len(drawn) + 0.4), layout="constrained")
    axes = figure.subplots(len(drawn), 1, squeeze=False)[:, 0]
    for axis, (verdict, name, _, channel) in zip(axes, drawn, strict=True):
        rows = np.arange(len(channel.samples), dtype=float)
        line(axis, rows, channel.samples, color=colour("measured"), linewidth=1.1)
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        unit = unit_text(channel.quantity.unit) if channel.quantity.unit else "as filed"
        tidy(axis, first=True, text=unit, ticks=3)
        axis.ticklabel_format(axis="y", style="plain", useOffset=False)
        axis.set_title(" ", fontsize=9.5)
        heads([axis], [Head(verdict.channel, f"{verdict.verdict}, in {name}", colour(role))])
    axes[-1].set_xlabel("Row")
    what = "Each unsound channel over the rows of the file in which it is worst."
    return Drawing(name_of_figure, figure, what if role == "wrong" else "Channels of the first file over its rows.")


def write_audit_page(found: Audit, folder: Path) -> Path:
    """Write index.html and its figure into a folder, and return the page's path."""
    unsound = audited_channels(found)
    readable = any(file.log is not None for file in found.files)
    sections = [Section("verdicts", "One verdict for each channel", tables=(_verdict_table(found),))]
    if len(unsound) > FIRST_PANELS:
        drawing = draw(_channels, unsound, "channels", "wrong")
        sections.append(Section("channels", "The unsound channels", drawings=(drawing,)))
    sections.append(_file_section(found))
    page = Page(
        title="Audit of a log",
        kicker=f"Pellucid {found.command}",
        tiles=_tiles(found),
        sections=tuple(sections),
        footer=f"Written by pellucid {version('pellucid')}. Quantities of channels are guessed from names and units.",
        answer=found.answer,
        figure=draw(first_channels, found) if readable else None,
    )
    return write_page(folder, page)


def _tiles(found: Audit) -> tuple[Tile, ...]:
    counts = Counter(v.level for v in found.verdicts)
    noted = ", ".join(f"{len(names)} {word}" for word, names in found.noted.items())
    return (
        Tile("unsound", f"{len(found.alarms)}", "", f"of {len(found.verdicts)} channels"),
        Tile("repaired", f"{counts[REPAIRED_LEVEL]}", "", "when the log is read"),
        Tile("with a note", f"{counts[NOTE_LEVEL]}", "", noted or "none"),
        Tile("sound", f"{counts[SOUND_LEVEL]}", "", "nothing was found"),
        Tile("files", f"{len(found.files)}", "", f"{len(found.unread)} not read"),
    )


def _verdict_table(found: Audit) -> Table:
    heads = ("level", "channel", "probable content", "verdict", "findings")
    rows = (
        Row((v.level, v.channel, v.holds, v.verdict, typeset_quantities("; ".join(v.sentences))))
        for v in found.verdicts
    )
    caption = "A channel with an alarm must not be used as it is."
    return Table(heads, tuple(rows), caption=caption, wide=True)


def _file_section(found: Audit) -> Section:
    rows = []
    for file in found.files:
        alarms = len({f.channel for f in file.findings if f.level == ALARM_LEVEL})
        count = len(file.log.channels) if file.log is not None else 0
        rows.append(Row((file.name, f"{count}" if file.log is not None else "", file.unread or f"{alarms} unsound")))
    table = Table(("file", "columns", "what was found"), tuple(rows), numeric=frozenset({1}), wide=True)
    return Section("files", "Files", tables=(table,))
