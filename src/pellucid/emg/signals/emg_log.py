"""EMG in a log of which no study tells anything: the checks of `emg_findings` on its columns."""

from __future__ import annotations

import numpy as np

from ...files.log import ALARM_LEVEL, Log, LogChannel, LogFinding
from .emg_findings import EmgFinding, emg_quality

MIN_SECONDS = 1.0
"""Shortest stretch of EMG that is examined [s]."""


def emg_log_findings(log: Log) -> list[LogFinding]:
    """Return what is wrong with the columns of EMG of a log whose clock is known."""
    found = []
    clock = next((c for c in log.channels if c.name == log.time), None)
    lengths = dict.fromkeys(len(c.samples) for c in log.channels if c.quantity.kind == "emg")
    for length in lengths:
        own = [c for c in log.channels if c.quantity.kind == "emg" and len(c.samples) == length]
        rate = _rate(log, clock, length)
        if rate * MIN_SECONDS > length or rate <= 0.0:
            continue
        for unit in dict.fromkeys(_unit(c) for c in own):
            alike = [c for c in own if _unit(c) == unit]
            samples = np.column_stack([c.samples for c in alike])
            for one in emg_quality(samples, rate=rate, channels=[c.name for c in alike], unit=unit):
                found.append(_finding(one, rate))
    return found


def _rate(log: Log, clock: LogChannel | None, length: int) -> float:
    """Return the sampling rate of columns of a length [Hz]; 0 where nothing tells it."""
    if clock is not None and len(clock.samples) == length and clock.quantity.unit == "s" and length > 2:
        step = float(np.nanmedian(np.diff(clock.samples)))
        return 1.0 / step if step > 0.0 else 0.0
    return log.rate or 0.0


def _unit(channel: LogChannel) -> str:
    """Return the unit of the samples: volts, maxima, or "" if it is not known."""
    return {"V": "V", "MVC": "1", "%": "1", "1": "1"}.get(channel.quantity.unit, "")


def _finding(one: EmgFinding, rate: float) -> LogFinding:
    first, last = round(one.start * rate), round(one.end * rate) - 1
    said = f"{one.found} ({one.start:.2f} to {one.end:.2f} s)"
    return LogFinding(one.kind, str(one.channel), said, ALARM_LEVEL, first, last, float(one.size))
