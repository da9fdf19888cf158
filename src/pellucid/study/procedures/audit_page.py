"""Write the page of an audit: one verdict for each channel, the unsound ones drawn, the files."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from ..._printed_command import printed_command
from ...files.log import ALARM_LEVEL
from ..drawing.drawing import draw
from ..pages.page import Answer, Page, Section, Tile, write_page
from ..pages.quantities import typeset_quantities
from ..pages.tables import Row, Table
from .audit import SOUND_VERDICT, Audit
from .audit_figures import FIRST_PANELS, audit_figure, audited_channels, first_channels


def write_audit_page(found: Audit, folder: Path) -> Path:
    """Write index.html and its figure into a folder, and return the page's path."""
    unsound = audited_channels(found)
    readable = any(file.log is not None for file in found.files)
    sections = [Section("verdicts", "One verdict for each channel", tables=(_verdict_table(found),))]
    if len(unsound) > FIRST_PANELS:
        sections.append(Section("channels", "The unsound channels", drawings=(draw(audit_figure, found),)))
    sections.append(_file_section(found))
    study = printed_command("init", "my-study", "--from", *found.paths)
    page = Page(
        title="Audit of a log",
        kicker="pellucid audit",
        headline=found.headline,
        tiles=_tiles(found),
        sections=tuple(sections),
        footer=f"Written by pellucid {version('pellucid')}. What a channel holds is guessed from its name and unit.",
        answer=Answer(
            "May this log be used as it is?",
            "no" if found.alarms or not found.is_sound else "yes",
            draw(first_channels, found) if readable else None,
            (f"Make a study of it: `{study}`.",) if found.is_sound else (),
        ),
    )
    return write_page(folder, page)


def _tiles(found: Audit) -> tuple[Tile, ...]:
    sound = sum(v.level == SOUND_VERDICT for v in found.verdicts)
    return (
        Tile("unsound", f"{len(found.alarms)}", "", f"of {len(found.verdicts)} channels"),
        Tile("with a note", f"{len(found.verdicts) - len(found.alarms) - sound}", "", "usable, with care"),
        Tile("sound", f"{sound}", "", "nothing was found"),
        Tile("files", f"{len(found.files)}", "", f"{len(found.unread)} not read"),
    )


def _verdict_table(found: Audit) -> Table:
    heads = ("level", "channel", "what it probably holds", "verdict", "what was found")
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
