"""Read the record of an incident: measurements, commands and supervisor checks before and after a stop.

The file is little-endian words of 32 bits, as include/pellucid/incident_recorder.hpp writes them: 32 words of head,
text with the names of everything, the supervisor's numbers, the records, and a checksum of all words before it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._errors import PellucidError
from .._given import read_given, visible_text
from .._tabular import data_frame
from ..models.fields import unit_of

if TYPE_CHECKING:
    import pandas

MAGIC_BYTES = b"PELLINCI"
"""First eight bytes of the file."""

NEWEST_VERSION = 1
"""Newest version of the file that is read."""

MAX_FILE_BYTES = 256_000_000
"""A file of an incident is at most as large."""

HEAD_WORDS = 32
"""Number of words before the text."""

RECORD_HEAD_WORDS = 6
"""Number of words in a record before its samples."""

SAMPLE_WORDS = 3
"""Number of words of one sample."""

NO_STOP = 0xFFFFFFFF
"""Index of the stop in a file without a stop."""

NO_THRESHOLD = float(np.finfo(np.float32).max)
"""A threshold of at least this size stands for none: exported constants have no infinity."""

CHECKSUM_START = 2166136261
"""Checksum of nothing (FNV-1a over words)."""

CHECKSUM_FACTOR = 16777619
"""Factor of the checksum."""

WATCH_BOUNDS = ("size", "above", "below")
"""Ways in which a watch compares its value with its threshold."""


@dataclass(frozen=True)
class WatchRecord:
    """Values of one monitor in each record."""

    bound: str  # "size", "above" or "below": how the value is compared with the threshold
    fault: str  # fault that the watch finds
    unit: str  # SI unit of value and threshold as plain text, "1" for none
    sentence: str  # what the value is
    value: np.ndarray  # shape (n,), SI
    threshold: np.ndarray  # shape (n,), SI; infinite or `NO_THRESHOLD` where the watch did not watch

    @property
    def share(self) -> np.ndarray:
        """Value over threshold, shape (n,): 1 or more is a fault; NaN where the watch did not watch."""
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.abs(self.value) if self.bound == "size" else self.value
            share = self.threshold / size if self.bound == "below" else size / self.threshold
            if self.bound == "below":  # a value of the wrong sign is as far beyond the threshold as can be
                share = np.where((size <= 0.0) & (self.threshold > 0.0), np.inf, share)
        return np.where(np.abs(self.threshold) < NO_THRESHOLD, share, np.nan)


@dataclass(frozen=True)
class Incident:
    """The record of an incident: n records, the oldest first. Times are in s, the rest in SI."""

    law: str  # name of the control law
    period: float  # control period of the law [s]
    decimation: int  # periods of one record
    effort_limit: float  # effort limit of the law [N m or N]
    prismatic: bool  # whether the joint slides
    stop: int | None  # index of the record in which the supervisor stopped
    damages: int  # how often the recorder found its own memory damaged and began anew
    time: np.ndarray  # shape (n,) [s]
    step: np.ndarray  # number of the last period of each record, shape (n,)
    effort: np.ndarray  # what the drive was asked for, shape (n,)
    mode: tuple[str, ...]  # what the supervisor was doing
    fault: tuple[str, ...]  # its latched fault
    enable: np.ndarray  # whether power was on, shape (n,)
    samples: Mapping[str, np.ndarray]  # by sensor, shape (n,); NaN where the sensor says that it is no measurement
    ages: Mapping[str, np.ndarray]  # ages of the samples, shape (n,) [s]
    watches: Mapping[str, WatchRecord]  # by name
    thresholds: Mapping[str, float]  # the supervisor's numbers by name
    log: tuple[tuple[int, str, str], ...]  # period, fault and mode of the last faults, the latest first

    def __repr__(self) -> str:
        found = "no stop" if self.stop is None else f'stopped by "{self.fault[self.stop]}"'
        return f"Incident({self.law}, {len(self.time)} records of {self.decimation * self.period:g} s, {found})"

    def to_frame(self) -> pandas.DataFrame:
        """Return the records as a data frame with one row each, in SI units.

        Returns
        -------
        pandas.DataFrame
            Columns ``time``, ``step``, ``effort``, ``mode``, ``fault`` and ``enable``; of each sensor its name and
            ``<name>_age``; of each watch ``<name>_value``, ``<name>_threshold`` and ``<name>_share``.

        Raises
        ------
        PellucidError
            If pandas is not installed.
        """
        columns = {name: getattr(self, name) for name in ("time", "step", "effort", "mode", "fault", "enable")}
        for name, values in self.samples.items():
            columns |= {name: values, f"{name}_age": self.ages[name]}
        for name, watch in self.watches.items():
            shown = {"value": watch.value, "threshold": watch.threshold, "share": watch.share}
            columns |= {f"{name}_{what}": values for what, values in shown.items()}
        return data_frame(columns)


def read_incident(path: str | Path) -> Incident:
    """Read a file that a recorder of incidents wrote.

    Parameters
    ----------
    path : path
        File with the bytes that the core's `write` gives.

    Returns
    -------
    Incident

    Raises
    ------
    PellucidError
        If the file is missing, truncated, damaged, newer than this version of Pellucid, or something else.
    """
    path = Path(path)
    try:
        return parse_incident(read_given(path, MAX_FILE_BYTES), str(path))
    except OSError as error:
        raise PellucidError(f"{path}: {error.strerror or error}") from None


def parse_incident(data: bytes, name: str = "incident") -> Incident:
    """Return the incident in the bytes of a file, which errors call `name`."""

    def refuse(found: str, expected: str) -> PellucidError:
        return PellucidError(f"{name}: found {found}, expected {expected}")

    if data[:8] != MAGIC_BYTES:
        raise refuse(f"the first bytes {data[:8]!r}", f"the record of an incident, which begins with {MAGIC_BYTES!r}")
    if len(data) < 4 * (HEAD_WORDS + 1) or len(data) % 4:
        raise refuse(f"{len(data)} bytes", f"a multiple of 4, at least {4 * (HEAD_WORDS + 1)}: the file is truncated")
    words = np.frombuffer(data, "<u4")
    version, total, text_words, numbers, width, count, stop, decimation, _, damages, slides = map(int, words[2:13])
    if version > NEWEST_VERSION or version < 1:
        raise refuse(f"version {version}", f"1 to {NEWEST_VERSION}: a newer Pellucid wrote it, install that one")
    if total != len(words):
        raise refuse(f"{len(words)} words", f"{total}: the file is truncated or has something behind it")
    checksum = CHECKSUM_START
    for word in words[:-1].tolist():
        checksum = ((checksum ^ word) * CHECKSUM_FACTOR) & 0xFFFFFFFF
    if checksum != int(words[-1]):
        raise refuse(f"the checksum {checksum:08x}", f"{int(words[-1]):08x}: the file is damaged")
    if HEAD_WORDS + text_words + numbers + width * count + 1 != total:
        raise refuse("parts that do not add up to the file", "text, numbers and records of the stated sizes")
    text = words[HEAD_WORDS : HEAD_WORDS + text_words].tobytes().decode("utf-8", "replace")
    lines = [line.split(" ") for line in text.split("\n") if line]
    said: dict[str, list[list[str]]] = {}
    for line in lines:
        said.setdefault(line[0], []).append(line[1:])
    fewest = {"law": 1, "sensor": 4, "mode": 1, "fault": 1, "watch": 7, "number": 4}
    for kind, least in fewest.items():
        if kind not in said or any(len(row) < least for row in said[kind]):
            raise refuse(f'no sound lines "{kind}" in its text', "at least one, with its name and unit")
    modes, faults = [row[0] for row in said["mode"]], [row[0] for row in said["fault"]]
    sensors, watches = [row[0] for row in said["sensor"]], said["watch"]
    wrong = next((row for row in watches if row[1] not in WATCH_BOUNDS), None)
    if wrong is not None:
        raise refuse(f'the bound "{visible_text(wrong[1])[:40]}" of a watch', " or ".join(WATCH_BOUNDS))
    if width != RECORD_HEAD_WORDS + SAMPLE_WORDS * len(sensors) + 2 * len(watches) or len(said["number"]) != numbers:
        raise refuse(f"records of {width} words and {numbers} numbers", "as many as its text names")
    start = HEAD_WORDS + text_words
    with np.errstate(invalid="ignore"):  # words that are no float may be a signalling NaN
        values = words[start : start + numbers].view("<f4").astype(float)
    records = words[start + numbers : -1].reshape(count, width)
    state = records[:, 3].astype(int)

    def names(known: list[str], codes: np.ndarray) -> tuple[str, ...]:
        return tuple(known[code] if code < len(known) else f"number {code}" for code in codes.tolist())

    end = RECORD_HEAD_WORDS + SAMPLE_WORDS * len(sensors)
    with np.errstate(invalid="ignore"):
        floats = np.ascontiguousarray(records).view("<f4").astype(float)
    valid = records[:, 5][:, None] >> np.arange(len(sensors), dtype=np.uint32) & 1
    now = np.ascontiguousarray(records[:, :2]).view("<i8")[:, 0] if count else np.zeros(0, np.int64)
    ages = np.ascontiguousarray(records).view("<i4")
    period, limit = words[13:15].view("<f4").astype(float).tolist()
    entries = words[16:HEAD_WORDS].reshape(-1, 2).astype(int)[: int(words[15])]
    logged = zip(
        entries[:, 0].tolist(),
        names(faults, entries[:, 1] >> 8 & 255),
        names(modes, entries[:, 1] & 255),
        strict=True,
    )
    return Incident(
        law=said["law"][0][0],
        period=period,
        decimation=decimation,
        effort_limit=limit,
        prismatic=bool(slides),
        stop=stop if stop != NO_STOP and stop < count else None,
        damages=damages,
        time=1e-6 * now,
        step=records[:, 2].astype(int),
        effort=floats[:, 4],
        mode=names(modes, state & 255),
        fault=names(faults, state >> 8 & 255),
        enable=(state >> 16 & 1).astype(bool),
        samples={
            s: np.where(valid[:, i] != 0, floats[:, RECORD_HEAD_WORDS + SAMPLE_WORDS * i], np.nan)
            for i, s in enumerate(sensors)
        },
        ages={s: 1e-6 * ages[:, RECORD_HEAD_WORDS + 1 + SAMPLE_WORDS * i] for i, s in enumerate(sensors)},
        watches={
            row[0]: WatchRecord(
                bound=row[1],
                fault=row[2],
                unit=unit_of_powers(row[3:6], "prismatic" if slides else "rotary"),
                sentence=" ".join(row[6:]),
                value=floats[:, end + 2 * i],
                threshold=floats[:, end + 2 * i + 1],
            )
            for i, row in enumerate(watches)
        },
        thresholds=dict(zip((row[0] for row in said["number"]), values.tolist(), strict=True)),
        log=tuple(logged),
    )


def unit_of_powers(doubled: Sequence[str], motion: str) -> str:
    """Return the SI unit, as plain text, that a file states as twice its powers of effort, coordinate and time."""
    try:
        effort, coordinate, time = (0.5 * int(power) for power in doubled)
    except ValueError:
        return "?"
    if (effort, coordinate, time) == (1.0, 1.0, -1.0):
        return "W"
    return unit_of((effort, coordinate, time), motion, "N" if motion == "prismatic" else "N*m")
