"""Draw the channels of a log that an audit found unsound, each over the file in which it is worst."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ...files.log import ALARM_LEVEL, Log, LogChannel
from ..drawing.drawing import Drawing, Head, heads, line, tidy
from ..drawing.style import FIGURE_WIDTH, colour
from ..pages.quantities import unit_text
from .audit import Audit, ChannelVerdict, finding_size

PANEL_HEIGHT = 1.35
"""Height of a panel [in]."""

MAX_PANELS = 12
"""The figure of all unsound channels shows at most this many."""

FIRST_PANELS = 3
"""The figure on the first screen shows at most this many channels."""


def audited_channels(audit: Audit) -> list[tuple[ChannelVerdict, str, Log, LogChannel]]:
    """Return the unsound channels that can be drawn, each with the file in which most was found."""
    logs = {file.name: file.log for file in audit.files if file.log is not None}
    drawn = []
    for verdict in audit.verdicts:
        for name, finding in sorted(verdict.findings, key=lambda each: finding_size(each[1]), reverse=True):
            channel = next((c for c in logs[name].channels if c.name == finding.channel), None)
            if channel is not None and finding.level == ALARM_LEVEL and np.isfinite(channel.samples).any():
                drawn.append((verdict, name, logs[name], channel))
                break
    return drawn[:MAX_PANELS]


def first_channels(audit: Audit) -> Drawing:
    """Draw the worst unsound channels, or the first ones of the first file that could be read if all are sound."""
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
    return _channels(sound[:FIRST_PANELS], "first_channels", "good")


def audit_figure(audit: Audit) -> Drawing:
    """Draw each unsound channel against its row, one panel beneath another."""
    return _channels(audited_channels(audit), "channels", "wrong")


def _channels(drawn: list[tuple[ChannelVerdict, str, Log, LogChannel]], name_of_figure: str, role: str) -> Drawing:
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
