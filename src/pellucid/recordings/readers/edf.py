"""EDF and BDF files of amplifiers: signals with units, at rates of their own.

A signal keeps its name. Its times are the column ``time`` where all signals of the file have one rate, and NAME.time
otherwise; time 0 is the file's first sample.
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
    """Columns by name, in the file's own units, each shape (n,) with the n of its signal."""
    content = _content(path)
    together = len({signal.sampling_frequency for signal in content.signals}) == 1
    into: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for signal in content.signals:
        name = signal.label.strip()
        if name in into:
            raise RecordingError(f'{path.name}: found two signals named "{name}", expected each once')
        samples = np.ascontiguousarray(signal.data, dtype=np.float64)
        times = "time" if together else f"{name}.time"
        if times not in into:
            into[times] = np.arange(len(samples)) / float(signal.sampling_frequency)
        into[name] = samples
        if signal.physical_dimension.strip():
            units[name] = signal.physical_dimension.strip()
    return Columns(path, into, units=units)


def _content(path: Path) -> Any:
    import edfio

    opened = edfio.read_bdf if path.suffix.lower() == ".bdf" else edfio.read_edf
    with warnings.catch_warnings():
        # The library shortens a truncated file to what is whole of it, and only warns.
        warnings.simplefilter("error")
        try:
            content = opened(path)
        except MemoryError:
            raise
        except Exception as error:  # the library raises whatever parsing bytes raises
            kind = path.suffix[1:].upper()
            raise RecordingError(f"{path.name}: not readable as {kind}, truncated or damaged: {error}") from error
    if not content.is_continuous:
        raise RecordingError(f"{path.name}: found a recording with gaps (EDF+D), expected one without")
    return content
