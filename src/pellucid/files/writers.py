"""Write recordings to files that the readers restore exactly."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from .._atomic import write_text_atomically
from .._errors import RecordingError
from .._given import csv_cell, visible_text
from .recording import Channel


def write_csv(path: str | os.PathLike, channels: Mapping[str, Channel]) -> Path:
    """Write channels as a comma-separated table, one column each under the channel's name. `channels` [str,
    Channel]."""
    if "time" not in channels:
        raise RecordingError(f"{path}: found the channels {', '.join(channels) or 'none'}, expected time among them")
    names = ["time", *(name for name in channels if name != "time")]
    lengths = {name: len(channels[name]) for name in names}
    if len(set(lengths.values())) > 1:
        raise RecordingError(f"{path}: found channels of different lengths {lengths}, expected one length")
    strange = [
        name for name in names if csv_cell(name) != name or visible_text(name) != name or set(name) & set(',\n"')
    ]
    if strange:
        raise RecordingError(f"{path}: found the channel {strange[0]!r}, expected a name that a table can hold")
    units = ", ".join(f"{name} [{channels[name].unit}]" for name in names)
    # repr gives the shortest text that is read back as the same float.
    columns = [map(repr, channels[name].samples.tolist()) for name in names]
    rows = "\n".join(map(",".join, zip(*columns, strict=True)))
    return write_text_atomically(path, f"# units: {units}\n{','.join(names)}\n{rows}\n")


def channels_toml(channels: Mapping[str, Channel]) -> str:
    """Return the ``[channels]`` table of a study.toml for files that `write_csv` wrote from these channels."""
    entries = (f'{name} = {{ column = "{name}", unit = "{channel.unit}" }}' for name, channel in channels.items())
    return "[channels]\n" + "\n".join(entries) + "\n"
