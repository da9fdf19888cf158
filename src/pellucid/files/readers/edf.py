"""Read EDF and BDF files of amplifiers, whose signals have units and each its own sampling rate.

A signal keeps its name. Its times are the column ``time`` if all signals of the file have one rate, and NAME.time
otherwise. Time 0 is the file's first sample.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._columns import Columns

ENDINGS = (".edf", ".bdf")
APART = ("edfio",)


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its signal."""
    content = _load(path)
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
            into[times] = np.arange(len(samples)) / float(signal.sampling_frequency)
        into[name] = samples
        if signal.physical_dimension.strip():
            units[name] = signal.physical_dimension.strip()
    return Columns(path, into, units=units)


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
    if not content.is_continuous:
        raise RecordingError(f"{path.name}: found a recording with gaps (EDF+D), expected one without")
    return content
