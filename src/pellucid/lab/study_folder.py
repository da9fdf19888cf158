"""What every virtual study's folder has: study.toml, the truth apart from it, and entries of recordings."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

from .._atomic import write_text_atomically
from ..procedures.registry import open_study, study_model
from ..recordings.study import STUDY_FILE, Study
from ..recordings.study_file import StudyFile, rig_units

TRUTH_FILE = "lab/truth.json"
"""What only tests, benchmarks and reproductions may read."""


def study_config(text: str) -> StudyFile:
    """What a study.toml says, from its text."""
    raw = tomllib.loads(text)
    return study_model().model_validate(raw, context=rig_units(raw))


def write_study_folder(folder: Path, text: str, truth: Mapping) -> Study:
    """Write study.toml and the truth, once the recordings are there.

    Parameters
    ----------
    folder : Path
    text : str
        Of study.toml.
    truth : mapping
        SI.

    Returns
    -------
    Study
    """
    write_text_atomically(folder / TRUTH_FILE, json.dumps(truth, indent=1) + "\n")
    write_text_atomically(folder / STUDY_FILE, text)
    return open_study(folder)


def entry_text(name: str, protocol: str, use: str, more: Iterable[str] = ()) -> str:
    """A recording's entry in study.toml.

    Parameters
    ----------
    name, protocol, use : str
    more : iterable of str
        Further lines.

    Returns
    -------
    str
    """
    own = (f'name = "{name}"', f'file = "recordings/{name}.csv"', f'protocol = "{protocol}"', f'use = "{use}"')
    return "\n".join(("\n[[recordings]]", *own, *more, ""))


def emg_channels(emg: Mapping) -> str:
    """Channels of raw EMG in study.toml.

    Parameters
    ----------
    emg : mapping
        A rig's table of that name: its ``muscles`` and its ``quantum`` [V].

    Returns
    -------
    str
    """
    return "\n".join(
        f'emg.{muscle} = {{ column = "{muscle}", unit = "V", scale = {emg["quantum"]!r} }}' for muscle in emg["muscles"]
    )
