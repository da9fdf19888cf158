"""Read the files that accompany a recording in a BIDS data set and describe its channels."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..._errors import RecordingError

NOT_KNOWN = "n/a"
"""Text that stands in BIDS for what is not known."""


def read_channel_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a recording's nearest ``channels.tsv``; none without one."""
    for file in sidecar_files(path, "_channels.tsv"):
        try:
            rows = list(csv.DictReader(io.StringIO(file.read_text(encoding="utf-8-sig")), delimiter="\t"))
        except (OSError, ValueError) as error:
            raise RecordingError(f"{file.name}: not readable as a table: {error}") from None
        if any(not row.get("name") or not row.get("type") for row in rows):
            raise RecordingError(f"{file.name}: found a row without name or type, expected both in each")
        return rows
    return []


def channel_muscles(rows: Iterable[Mapping[str, str]]) -> dict[str, str]:
    """Return the muscle of each channel that has one, by the channel's name, from rows of ``channels.tsv``."""
    muscles = {row["name"]: row.get("target_muscle") or NOT_KNOWN for row in rows}
    return {name: muscle for name, muscle in muscles.items() if muscle != NOT_KNOWN}


def sidecar_files(path: Path, ending: str) -> list[Path]:
    """Return the files with an ending that apply to a recording, the nearest first.

    They stand in its folder or above it within the data set, and have no entity that its own name has not.
    """
    own, found = set(path.stem.removesuffix("_emg").split("_")), []
    for folder in path.resolve().parents:
        fitting = [f for f in sorted(folder.glob(f"*{ending}")) if set(f.name.removesuffix(ending).split("_")) <= own]
        found += sorted(fitting, key=lambda f: -len(f.name))
        top = folder / f"{ending.lstrip('_')}"
        found += [top] if top.is_file() else []
        if (folder / "dataset_description.json").is_file() or len(folder.parents) < 1:
            break
        if not folder.name.startswith(("sub-", "ses-")) and folder.name != "emg":
            break
    return found
