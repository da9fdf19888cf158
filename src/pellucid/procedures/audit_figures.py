"""Draw the channels of a log that an audit found unsound, each over the file in which it is worst."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..drawing.drawing import Drawing, Head, heads, line, tidy
from ..drawing.style import FIGURE_WIDTH, colour
from ..pages.quantities import unit_text
from ..recordings.log import ALARM_LEVEL, Log, LogChannel
from .audit import Audit, ChannelVerdict, finding_size

PANEL_HEIGHT = 1.35
"""Height of a panel [in]."""

MAX_PANELS = 12
"""The figure shows at most this many channels."""


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


def audit_figure(audit: Audit) -> Drawing:
    """Draw each unsound channel against its row, one panel beneath another."""
    drawn = audited_channels(audit)
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
        heads([axis], [Head(verdict.channel, f"{verdict.verdict}, in {name}", colour("wrong"))])
    axes[-1].set_xlabel("Row")
    caption = "Each unsound channel over the rows of the file in which it is worst."
    return Drawing("channels", figure, caption)
