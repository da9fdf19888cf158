"""EMG in a log of which no study tells anything: the checks of `emg_findings` on its columns."""

from __future__ import annotations

import numpy as np

from ...files.log import ALARM_LEVEL, Log, LogChannel, LogFinding
from .emg_findings import EmgFinding, clock_findings, emg_quality

MIN_SECONDS = 1.0
"""Shortest stretch of EMG that is examined [s]."""


def emg_log_findings(log: Log) -> list[LogFinding]:
    """Return what is wrong with the columns of EMG of a log whose clock is known."""
    found = []
    clock = next((c for c in log.channels if c.name == log.time), None)
    lengths = dict.fromkeys(len(c.samples) for c in log.channels if c.quantity.kind == "emg")
    for length in lengths:
        own = [c for c in log.channels if c.quantity.kind == "emg" and len(c.samples) == length]
        own_clock = _clock(log, clock, length)
        rate = (log.rate or 0.0) if own_clock is None else 1.0 / _step(own_clock)
        if rate * MIN_SECONDS > length or rate <= 0.0:
            continue
        if own_clock is not None:
            found += [_finding(one, rate) for one in clock_findings(own_clock.name, own_clock.samples)]
        for unit in dict.fromkeys(_unit(c) for c in own):
            alike = [c for c in own if _unit(c) == unit]
            samples = np.column_stack([c.samples for c in alike])
            for one in emg_quality(samples, rate=rate, channels=[c.name for c in alike], unit=unit):
                found.append(_finding(one, rate))
    return found


def _clock(log: Log, clock: LogChannel | None, length: int) -> LogChannel | None:
    """Return the clock of columns of a length; None without one in seconds."""
    tried = [clock, *(c for c in log.channels if c.quantity.kind == "time" and c.quantity.unit in ("s", ""))]
    return next((c for c in tried if c is not None and len(c.samples) == length > 2 and _step(c) > 0.0), None)


def _step(clock: LogChannel) -> float:
    """Return the usual step of a clock [s]."""
    return float(np.nanmedian(np.diff(clock.samples)))


def _unit(channel: LogChannel) -> str:
    """Return the unit of the samples: volts, maxima, or "" if it is not known."""
    return {"V": "V", "MVC": "1", "%": "1", "1": "1"}.get(channel.quantity.unit, "")


def _finding(one: EmgFinding, rate: float) -> LogFinding:
    first, last = round(one.start * rate), round(one.end * rate) - 1
    said = f"{one.found} ({one.start:.2f} to {one.end:.2f} s)"
    return LogFinding(one.kind, str(one.channel), said, ALARM_LEVEL, first, last, float(one.size))
