"""Write the page of an incident: what happened, position, effort and the acting watch over time, every watch."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import numpy as np

from ...study.drawing.drawing import Drawing, draw
from ...study.drawing.style import colour
from ...study.pages.forest import Row, Table, number_table
from ...study.pages.moving import Traces, over_time
from ...study.pages.page import Page, Section, Tile, write_page
from ...study.pages.quantities import MINUS_SIGN, MOTION_READINGS
from .incident import STOPPED_MODES, IncidentAccount, quantity, share_text

PANEL_HEIGHT = 1.08
"""Height of a panel of the figure [in]; three of them fill the first screen without being drawn smaller."""

SHOWN_SHARES = 4.0
"""Shares of a threshold above this one are drawn at it, so that a watch's approach stays visible [1]."""


def write_incident_page(account: IncidentAccount, folder: Path) -> Path:
    """Write index.html and its figure into a folder, and return the page's path."""
    answer = account.answer
    others = [each for each in account.sentences if each[1] != answer.said]
    figure = draw(incident_figure, account) if len(account.time) else None
    page = Page(
        title="After an incident",
        kicker="pellucid incident",
        tiles=_tiles(account),
        verdicts=tuple(others),
        sections=(
            Section("course", "What happened", tables=(_course_table(account),)),
            _watch_section(account),
            _log_section(account),
        ),
        footer=f"Written by pellucid {version('pellucid')} from the record of the law {account.record.law}.",
        answer=answer,
        figure=figure,
    )
    return write_page(folder, page)


def _tiles(account: IncidentAccount) -> tuple[Tile, ...]:
    record, acting = account.record, account.acting
    period = record.decimation * record.period
    made = [Tile("fault", account.fault.replace("_", " "))]
    if acting is not None:
        made.append(
            Tile(acting.name.replace("_", " "), share_text(acting.share).removesuffix(" of"), "", "of its threshold")
        )
    if np.isfinite(account.seconds_until_powerless):
        made.append(Tile("until the drive had no power", f"{1e3 * account.seconds_until_powerless:.3g}", "ms"))
    return (*made, Tile("recorded", f"{len(record.time)}", "records", f"of {1e3 * period:g} ms"))


def incident_figure(account: IncidentAccount) -> Drawing:
    """Draw position, effort and the acting watch's value over its threshold against time, one beneath another."""
    record, time = account.record, account.time
    reading = MOTION_READINGS["prismatic" if record.prismatic else "rotary"]
    effort_name, effort_unit = ("Force", "N") if record.prismatic else ("Torque", "N·m")
    watches = account.beyond[:2] or account.watches[:1]
    position = {"position": reading.scale * record.samples.get("position", np.full(len(time), np.nan))}
    efforts = {"command": record.effort}
    if np.any(np.isfinite(record.samples.get("drive", np.nan))):
        efforts["drive's measurement"] = record.samples["drive"]
    panels = [
        Traces("Position", "of the encoder", time, position, f"Position ({reading.position})"),
        Traces(effort_name, "what the drive was asked for", time, efforts, f"{effort_name} ({effort_unit})"),
    ]
    if watches:
        shares = {one.name: np.minimum(record.watches[one.name].share, SHOWN_SHARES) for one in watches}
        name = f"Watch {watches[0].name}"
        shares["threshold"] = np.ones(len(time))
        panels.append(Traces(name, watches[0].sentence, time, shares, "Value over threshold"))
    roles = {"position": "measured", "command": "fitted", "drive's measurement": "heldout", "threshold": "wrong"}
    roles |= dict(zip((one.name for one in watches), ("fitted", "heldout"), strict=False))
    began = "the stop" if record.stop is not None else "the last record"
    caption = (
        f"The last seconds; time 0 is {began}. For the supervisor check, each record shows the period nearest to the "
        f"threshold. Values beyond {SHOWN_SHARES:g} times the threshold are drawn at that limit."
    )
    drawing = over_time(panels, "incident", roles=roles, caption=caption, height=PANEL_HEIGHT)
    for axis in drawing.figure.axes:
        axis.axvline(0.0, color=colour("wrong"), linewidth=0.9, linestyle=(0, (3, 3)), zorder=1)
    return drawing


def _course_table(account: IncidentAccount) -> Table:
    record, rows = account.record, []
    states = list(zip(record.mode, record.fault, record.enable.tolist(), strict=True))
    for i, (mode, fault, enable) in enumerate(states):
        if i == 0 or states[i] != states[i - 1]:
            effort = quantity(float(record.effort[i]), "N" if record.prismatic else "N*m")
            cells = (mode.replace("_", " "), fault.replace("_", " "), "on" if enable else "off", effort)
            rows.append(
                Row((f"{1e3 * account.time[i]:.4g} ms".replace("-", MINUS_SIGN), *cells), strong=i == record.stop)
            )
    heads = ("after the stop", "the supervisor", "fault", "power", "effort")
    return number_table(heads, rows, "Every change of the supervisor's state.", words=4)


def _watch_section(account: IncidentAccount) -> Section:
    acting = account.acting.name if account.acting else ""
    heads, rows = account.watch_table()
    sentences = {one.name: one.sentence for one in account.watches}
    made = [Row((row[0], sentences[row[0]], *row[1:]), strong=row[0] == acting) for row in rows]
    caption = (
        "For each supervisor check, the value nearest to its threshold up to the stop. Bold: the check that caused the "
        "stop."
    )
    plain = (heads[0], "checked condition", *(head.removeprefix(">") for head in heads[1:]))
    return Section("watches", "Values and thresholds", tables=(number_table(plain, made, caption, words=2),))


def _log_section(account: IncidentAccount) -> Section:
    rows = [(f"{step}", fault.replace("_", " "), mode.replace("_", " ")) for step, fault, mode in account.record.log]
    caption = "The supervisor's own log, the latest fault first."
    stopped = sum(mode in STOPPED_MODES for mode in account.record.mode)
    note = f"The controller was stopped in {stopped} of {len(account.record.mode)} records."
    return Section(
        "log", "Log", tables=(number_table(("period", "fault", "response"), rows, caption),), notes=(note,)
    )
