"""EMG in logs of which no study tells anything: the checks of `emg_findings` on their columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...files.log import ALARM_LEVEL, Log, LogChannel, LogFinding
from .emg_findings import (
    RELATIVE_UNITS,
    EmgFinding,
    clock_findings,
    emg_quality,
    exchanged_findings,
    own_maximum_channels,
    own_maximum_finding,
)
from .exchanged import exchanged_recordings

MIN_SECONDS = 1.0
"""Shortest stretch of EMG that is examined [s]."""


OWN_MAXIMUM_KIND = "normalised_per_trial"
"""Kind of the finding that depends on the other recordings."""


@dataclass(frozen=True, eq=False)
class _EmgColumns:
    """Columns of EMG with one clock and one unit."""

    names: tuple[str, ...]
    samples: np.ndarray  # (n, channels)
    rate: float  # Hz
    unit: str
    clock: LogChannel | None


def emg_log_findings(log: Log) -> list[LogFinding]:
    """Return what is wrong with the columns of EMG of a log whose clock or rate is known."""
    found, clocks = [], set()
    for own in _emg_columns(log):
        if own.clock is not None and own.clock.name not in clocks:
            clocks.add(own.clock.name)
            nominal = log.nominal.get(own.clock.name, log.nominal.get(""))
            found += [_finding(one, own.rate) for one in clock_findings(own.clock.name, own.clock.samples, nominal)]
        named = emg_quality(own.samples, rate=own.rate, channels=own.names, unit=own.unit)
        found += [_finding(one, own.rate) for one in named if one.kind != OWN_MAXIMUM_KIND]
    return found


def own_maximum_log_findings(logs: Sequence[Log]) -> list[list[LogFinding]]:
    """Return, for each log, which of its relative envelopes are divided by their own maximum."""
    members: list[tuple[list[str], dict[str, LogFinding]]] = []
    for log in logs:
        relative = [own for own in _emg_columns(log) if own.unit in RELATIVE_UNITS]
        found = [
            _finding(one, own.rate)
            for own in relative
            for name, x in zip(own.names, own.samples.T, strict=True)
            if (one := own_maximum_finding(name, x, own.rate, own.unit)) is not None
        ]
        members.append(([name for own in relative for name in own.names], {one.channel: one for one in found}))
    kept = own_maximum_channels(members)
    return [
        [one for name, one in reached.items() if name in channels]
        for (_, reached), channels in zip(members, kept, strict=True)
    ]


def exchanged_log_findings(logs: Sequence[Log]) -> list[list[LogFinding]]:
    """Return, for each of several logs, which of its channels of EMG are exchanged against those of the same names.

    A log is compared with the first one that has its channels; where most others differ from that one, it is the one
    with exchanged channels.
    """
    found: list[list[LogFinding]] = [[] for _ in logs]
    groups: dict[tuple[tuple[str, ...], int], list[tuple[int, _EmgColumns]]] = {}
    for i, log in enumerate(logs):
        for own in _emg_columns(log):
            if own.unit not in RELATIVE_UNITS and len(own.names) > 1:
                groups.setdefault((own.names, round(own.rate)), []).append((i, own))
    for group in groups.values():
        for each in exchanged_recordings([own.samples for _, own in group], group[0][1].rate):
            (i, own), (j, _) = group[each.place], group[each.reference]
            by_channel = exchanged_findings(each.pairs, own.names, len(own.samples) / own.rate, logs[j].file)
            partners = {own.names[a]: own.names[b] for pair in each.pairs for a, b in (pair, pair[::-1])}
            found[i] += [
                replace(_finding(one, own.rate), partner=partners[name]) for name, one in by_channel.items()
            ]
    return found


def _emg_columns(log: Log) -> Iterator[_EmgColumns]:
    """Yield the columns of EMG of a log that are long enough, those with one clock and one unit together."""
    emg = [c for c in log.channels if c.quantity.kind == "emg"]
    clock = next((c for c in log.channels if c.name == log.time), None)
    for length in dict.fromkeys(len(c.samples) for c in emg):
        own_clock = _clock(log, clock, length)
        rate = (log.rate or 0.0) if own_clock is None else 1.0 / _step(own_clock)
        if rate * MIN_SECONDS > length or rate <= 0.0:
            continue
        own = [c for c in emg if len(c.samples) == length]
        for unit in dict.fromkeys(_unit(c) for c in own):
            alike = [c for c in own if _unit(c) == unit]
            samples = np.column_stack([c.samples for c in alike])
            yield _EmgColumns(tuple(c.name for c in alike), samples, rate, unit, own_clock)


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
