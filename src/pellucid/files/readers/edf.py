"""Read EDF and BDF files of amplifiers, whose signals have units and each its own sampling rate.

A signal keeps its name. Its times are the column ``time`` if all signals of the file have one rate, and NAME.time
otherwise. Time 0 is the file's first sample. A recording with gaps (EDF+D) keeps them: each of its records states when
it began.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ..file_facts import MUSCLE_FACT
from ._bids import channel_muscles, read_channel_rows
from ._columns import Columns

ENDINGS = (".edf", ".bdf")
APART = ("edfio",)


_START = re.compile(rb"([+-]\d+(?:\.\d*)?)(?:\x15\d+(?:\.\d*)?)?\x14")
"""What an annotation begins with: when it was, in seconds after the file's start."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its signal."""
    content = _load(path)
    starts = np.zeros(1) if content.is_continuous else _record_starts(path)
    have_one_rate = len({signal.sampling_frequency for signal in content.signals}) == 1
    into: dict[str, np.ndarray] = {}
    units: dict[str | int, str] = {}
    for signal in content.signals:
        name = signal.label.strip()
        if name in into:
            raise RecordingError(f'{path.name}: found two signals named "{name}", expected each once')
        samples = np.ascontiguousarray(signal.data, dtype=np.float64)
        times = "time" if have_one_rate else f"{name}.time"
        if times not in into:
            into[times] = _times(starts, len(samples), float(signal.sampling_frequency))
        into[name] = samples
        if signal.physical_dimension.strip():
            units[name] = signal.physical_dimension.strip()
    return Columns(path, into, units=units, facts=_muscle_facts(path))


def _muscle_facts(path: Path) -> dict[str, str]:
    """Return the muscle of each channel, from the files that accompany a recording in a BIDS data set."""
    if not path.stem.endswith("_emg"):
        return {}
    return {f"{name}.{MUSCLE_FACT}": muscle for name, muscle in channel_muscles(read_channel_rows(path)).items()}


def _load(path: Path) -> Any:
    import edfio

    read_content = edfio.read_bdf if path.suffix.lower() == ".bdf" else edfio.read_edf
    with warnings.catch_warnings():
        # The library drops the incomplete end of a truncated file, and only warns.
        warnings.simplefilter("error")
        try:
            content = read_content(path)
        except MemoryError:
            raise
        except Exception as error:  # parsing unexpected bytes may raise anything
            kind = path.suffix[1:].upper()
            raise RecordingError(f"{path.name}: not readable as {kind}, truncated or damaged: {error}") from error
    return content


def _times(starts: np.ndarray, n: int, rate: float) -> np.ndarray:
    """Return the times of a signal of n samples, whose records began at `starts` [s]."""
    each = n // len(starts)
    return (starts[:, None] + np.arange(each) / rate).ravel()


def _record_starts(path: Path) -> np.ndarray:
    """Return when each record of a file with gaps began, after the first one [s].

    The first annotation of each record states it; the library only says whether there are gaps.
    """
    width = 3 if path.suffix.lower() == ".bdf" else 2
    content = path.read_bytes()
    signal_count = int(content[252:256])
    labels = [content[at : at + 16].decode("latin-1").strip() for at in range(256, 256 + 16 * signal_count, 16)]
    first_count = 256 + 216 * signal_count
    counts = [int(content[at : at + 8]) for at in range(first_count, first_count + 8 * signal_count, 8)]
    begin, size = int(content[184:192]), width * sum(counts)
    annotations = [i for i, label in enumerate(labels) if label.endswith(" Annotations")]
    offset = width * sum(counts[: annotations[0]]) if annotations else 0
    places = range(begin + offset, len(content) - size + offset + 1, size) if annotations else ()
    found = [_START.match(content, at) for at in places]
    starts = [float(match[1]) for match in found if match is not None]
    if len(starts) < max(len(found), 1):
        raise RecordingError(f"{path.name}: record {len(starts) + 1} has no start time, expected one in each record")
    return np.array(starts) - starts[0]
