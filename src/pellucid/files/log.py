"""Inspect a log without a study: quantities of its columns, and their faults.

Arrays in, findings out. The quantity of a column is guessed from its name and its unit (`quantity.py`); no
finding requires more than that.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from .clock import find_clock_period, first_deliveries, unwrap_clock
from .cut import DEFAULT_CUT_SHARE, MAX_EVEN_JITTER, MAX_MISSING_SHARE, MIN_GAP_STEP_RATIO
from .defects import constant, echoed, frozen, garbage, held, limited, magnitude, missing, sensor_range, spikes
from .defects.clipped import flat_tops
from .defects.watched import INERTIAL_CHANNELS, find_runs
from .file_facts import NOMINAL_RATE_FACT, find_rate, states_simulation
from .name_evidence import is_emg_by_unit, motor_voltages
from .personal_fields import PersonalField, find_personal_columns, find_personal_lines
from .quantity import EFFORT_QUANTITIES, Quantity, is_setting, joint_words, quantity_of
from .readers._columns import Columns
from .readers.csv import ENDINGS, MAX_HEADER_LINES
from .recording import Channel

ALARM_LEVEL = "alarm"
"""Level of a finding without whose cause the channel must not be used as it is."""

REPAIRED_LEVEL = "repaired"
"""Level of a finding that reading repairs: wrong samples are excluded or interpolated, and the channel may be used."""

NOTE_LEVEL = "note"
"""Level of a finding that a user should know and that needs no repair."""

SOUND_LEVEL = "sound"
"""Level of a finding that describes a sound channel."""

LEVELS = (ALARM_LEVEL, REPAIRED_LEVEL, NOTE_LEVEL, SOUND_LEVEL)
"""Levels of findings, the gravest first."""

MAX_HEADER_BYTES = 1 << 16
"""Everything above the numbers of a text file lies within this many bytes."""


@dataclass(frozen=True)
class LogLimits:
    """What an inspection of a log calls a finding. Chosen by judgement where no reason is given."""

    # Shorter columns are settings, not channels.
    min_log_samples: int = 20
    # A time step of this many usual steps is a gap of the log, if it is also longer than its jitter.
    min_gap_steps: float = 3.0
    # A column without a name that tells is the time if at least this share of its steps are upwards and alike.
    min_time_column_rise_share: float = 0.98
    # Steps of a column that counts as time differ from the usual one by at most this share, in nine of ten samples.
    max_time_step_spread: float = 0.2
    # A time step that differs from the usual one by more than this share is out of step.
    max_steady_jitter: float = 0.5
    # Steps out of step in more than this share of the rows are an alarm; smaller jitter is a note.
    max_jittering_share: float = 0.2
    # A column with at most this many values switches, and is at no limit.
    max_switch_levels: int = 3
    # A position that stays at one end for more than this share of the log rests there.
    max_dwell_share: float = 0.2
    # A channel that is at its extremes for more than this share of the log switches between them.
    max_limited_share: float = 0.6
    # Flat tops in more than this share of the samples are part of the motion.
    max_flat_top_share: float = 0.1
    # A column that runs further apart than this share is no clock of the same log.
    max_clock_drift_share: float = 0.05
    # Two time columns are on different clocks if they drift apart by this share.
    min_clock_drift_share: float = 1e-3
    # Rows that repeat the row before are told if they are more than this share.
    min_repeated_share: float = 0.02
    # More rows than this that repeat one row are a rest of everything that is logged.
    max_repeated_rows: int = 5
    # A channel with at most this many values that keeps each for at least this many rows in half of its stretches is
    # switched: it is a pulse, a marker or a load that somebody places. The last digit of a dead channel flickers.
    max_switched_levels: int = 8
    min_switched_rows: int = 20
    # In a channel that may jump, a spike is this many times as high as the range of nearly all samples.
    min_peak_ratio: float = 30.0
    # A channel with more spikes than this is spiky by itself.
    max_spike_count: int = 50
    # A channel is the velocity of a position if it correlates at least this much with the position's derivative.
    min_velocity_correlation: float = 0.9
    # A value this many times as large as nearly all others of its channel is impossible in any unit.
    wild_ratio: float = 1e4
    # A silent stretch is compared with at most this many other channels, spread over the file.
    max_compared_channels: int = 64
    # A measurement is compared with at most this many commands, those of its own joint first.
    max_compared_commands: int = 16
    # Commands are compared in about this many samples of a file, which takes half a minute, and with one at least.
    max_echo_samples: float = 100e6


LOG_LIMITS = LogLimits()

SETTING_QUANTITIES = (
    "", "enabled", "state", "counter", "stiffness", "damping", "length", "moment_arm", "lengthening", "orientation",
    "magnetic_field",
)  # fmt: skip
"""Quantities that no sensor of a machine measures or that may rest, and columns of which nothing is known."""

STEADY_QUANTITIES = ("temperature", "supply")
"""Quantities that a sensor may measure as one value throughout."""

REGRESSED_QUANTITIES = ("position", "velocity", *EFFORT_QUANTITIES)
"""Quantities that a joint is identified from: the processing that `init` proposes leaves out many missing samples."""

SWITCHED_QUANTITIES = ("", "temperature", "supply", *EFFORT_QUANTITIES)
"""Quantities that a switch may set. A joint and a muscle take values between any two."""

UNLIMITED_QUANTITIES = (*STEADY_QUANTITIES, "enabled", "state", "counter", "stiffness", "damping")
"""Quantities whose extremes are no limits of a drive or of a sensor."""

VERDICT_WORDS = {
    garbage.KIND: "garbage rows",
    "impossible": "impossible values",
    constant.KIND: "dead",
    echoed.KIND: "echoed",
    limited.KIND: "saturated",
    "clipped": "clipped",
    "unit": "in another unit",
    "dropout": "dropouts",
    "envelope": "envelope, not raw EMG",
    "exchanged": "exchanged",
    "saturation": "clipped",
    "normalised_per_trial": "normalised per trial",
    "motion": "motion artefacts",
    "heartbeat": "heartbeat",
    "mains": "mains hum",
    "mvc_artefact": "short peaks",
    "clock": "uneven clock",
    "spike": "glitches",
    "repeated": "repeated packets",
    "rollover": "clock starts again",
    missing.KIND: "missing samples",
    held.KIND: "another clock",
    "uneven": "uneven clock",
    "no_time": "no time base",
    "not_measured": "not measured",
    "personal": "personal",
    "computed": "computed",
    "constant": "constant",
    "switched": "sound",
    "text": "text",
    "truncated": "truncated",
    "damaged_rows": "damaged rows",
    "short": "too short",
}
"""Words for each kind of finding, the one that decides a channel's verdict first."""


LEFT_OUT_WORDS = "excluded when the log is read"
"""What reading does with samples that it repairs."""

_QUOTED_TEXT = re.compile(r'"([^"]*)"')

_NUMBERS_LINE = re.compile(r"[\s\d.,;:+\-eE\"]*\d[\s\d.,;:+\-eE\"]*")
"""A line of numbers alone, with which the head of a text file ends."""


@dataclass(frozen=True)
class LogFinding:
    """One thing that is wrong with, or remarkable about, a channel of a log.

    Attributes
    ----------
    kind : str
        A key of `VERDICT_WORDS`.
    channel : str
        Column of the file; ``"time"`` if the file has no time column.
    found : str
        Description of what was found, without channel and file.
    level : str
        ``"alarm"``, ``"repaired"``, ``"note"`` or ``"sound"``.
    first, last : int
        First and last sample concerned; -1 where the whole channel is concerned.
    size : float
        Largest value, limit or share behind the finding, in SI where the unit is known; NaN without one.
    excluded : int
        Number of rows that reading excludes because of it.
    gaps : tuple of float
        Lengths of the gaps that reading cuts out [s]; NaN where the unit of time is not known.
    partner : str
        Channel whose signal this one has, and the other way round; "" of all other findings.
    """

    kind: str
    channel: str
    found: str
    level: str = ALARM_LEVEL
    first: int = -1
    last: int = -1
    size: float = float("nan")
    excluded: int = 0
    gaps: tuple[float, ...] = ()
    partner: str = ""


@dataclass(frozen=True, eq=False)
class LogChannel:
    """A column of a log with its probable quantity.

    Attributes
    ----------
    name : str
        Name of the column.
    samples : ndarray, shape (n,)
        Values; in SI if the unit is known, else in the file's own numbers.
    quantity : Quantity
        What the column probably holds.
    """

    name: str
    samples: np.ndarray
    quantity: Quantity

    @property
    def unit(self) -> str:
        """Unit of the samples for a sentence, with a blank before it; "" without one."""
        return f" {self.quantity.unit}" if self.quantity.unit not in ("", "1") else ""

    @cached_property
    def levels(self) -> np.ndarray | None:
        """The few values that the channel takes; None if it takes more."""
        return constant.few_levels([self.samples])

    @property
    def is_constant(self) -> bool:
        """Whether it has one value, or none."""
        return self.levels is not None and self.levels.size <= 1

    @property
    def is_measurement(self) -> bool:
        """Whether a sensor of a machine or of a person measures it."""
        return self.quantity.can_be_measured and self.quantity.kind not in SETTING_QUANTITIES

    @cached_property
    def spread(self) -> float:
        """Width that holds 98 % of the values."""
        return _spread(self.samples)

    @cached_property
    def joint(self) -> str:
        """Return the channel's joint: the words of its name other than those for quantities, roles and units."""
        return joint_words(self.name)


@dataclass(frozen=True, eq=False)
class Log:
    """One file of a log: its channels, of which some share their length."""

    file: str
    channels: tuple[LogChannel, ...]
    texts: tuple[str, ...] = ()  # names of columns of text
    personal: tuple[PersonalField, ...] = ()  # fields that tell who was recorded
    time: str = ""  # name of the time column; "" without one
    rate: float | None = None  # rate that the user states, or else the file [Hz]
    nominal: Mapping[str, float] = field(default_factory=dict)  # rate that the file states, by clock; "" for any [Hz]
    lost: str = ""  # what the file lacks at its end; "" for a whole file
    damaged: str = ""  # rows that were left out; "" without any
    is_simulated: bool = False  # whether the file says that its numbers are simulated


def log_of(columns: Columns, rate: float | None = None) -> Log:
    """Return a file's columns as a log; `rate` [Hz] is the sampling rate if the user states it."""
    channels, texts = [], {}
    voltages = motor_voltages(map(str, columns.values))
    for name, values in columns.values.items():
        if isinstance(values, str):
            quoted = _QUOTED_TEXT.search(values)
            texts[name] = quoted[1] if quoted else ""
            continue
        quantity = quantity_of(name, columns.units.get(name, ""))
        if name in voltages and not quantity.unit:
            quantity = replace(quantity, kind="voltage")
        samples = np.asarray(values, float)
        channels.append(LogChannel(name, samples * quantity.factor if quantity.factor != 1.0 else samples, quantity))
    channels = _with_short_muscles(channels)
    time = _time_column(channels)
    personal = find_personal_columns([*texts.items(), *((c.name, "") for c in channels)])
    personal += find_personal_lines(head_of_text(columns.path))
    nominal = nominal_rates(columns.facts)
    return Log(
        columns.path.name, tuple(channels), tuple(texts), tuple(personal), time, rate or nominal.get(""), nominal,
        columns.lost, columns.damaged, is_stated_simulated(columns.path, columns.facts, map(str, columns.values)),
    )  # fmt: skip


def _with_short_muscles(channels: Sequence[LogChannel]) -> list[LogChannel]:
    """Return channels in which those with a muscle's abbreviation and the unit of the EMG channels count as EMG."""
    units = [c.quantity.unit for c in channels if c.quantity.kind == "emg"]
    return [
        replace(c, quantity=replace(c.quantity, kind="emg"))
        if c.quantity.kind in ("voltage", "") and is_emg_by_unit(c.name, c.quantity.unit, units)
        else c
        for c in channels
    ]


def nominal_rates(facts: Mapping[str, str]) -> dict[str, float]:
    """Return the sampling rates that a file states [Hz]: a stream's by its column of times, the whole file's by ""."""
    ending = f".{NOMINAL_RATE_FACT}"
    found = {f"{name.removesuffix(ending)}.time": float(text) for name, text in facts.items() if name.endswith(ending)}
    stated = None if found else find_rate(facts)
    return found if stated is None else {"": stated.value}


def head_of_text(path: Path) -> list[str]:
    """Return the lines above the numbers of a text file; none of a file of another kind."""
    if path.suffix.lower() not in ENDINGS:
        return []
    with path.open("rb") as file:
        lines = file.read(MAX_HEADER_BYTES).decode("utf-8-sig", errors="replace").splitlines()
    first = next((i for i, line in enumerate(lines) if _NUMBERS_LINE.fullmatch(line)), len(lines))
    return lines[: min(first, MAX_HEADER_LINES)]


def is_stated_simulated(path: Path, facts: Mapping[str, str], names: Iterable[str]) -> bool:
    """Return whether a file says that its numbers are simulated, above them or in its name; `names` are its columns."""
    names = tuple(names)
    above = [line for line in head_of_text(path) if not any(name in line for name in names)] if path.is_file() else []
    return states_simulation([path.stem, *above, *(f"{label}: {text}" for label, text in facts.items())])


def _time_column(channels: Sequence[LogChannel]) -> str:
    """Return the name of the column that holds time: one whose name says so, else one that rises evenly."""
    longest = max((len(c.samples) for c in channels), default=0)
    named = [c for c in channels if c.quantity.kind == "time" and len(c.samples) == longest]
    rising = [c for c in named if _rises(c.samples, 0.5)]
    if rising or named:
        return (rising or named)[0].name
    for channel in channels:
        if not channel.quantity.kind and len(channel.samples) == longest and _is_even_clock(channel.samples):
            return channel.name
    return ""


def _rises(x: np.ndarray, share: float) -> bool:
    return len(x) > 1 and float(np.mean(np.diff(x) > 0.0)) >= share


def _is_even_clock(x: np.ndarray) -> bool:
    """Whether a column rises by nearly the same step throughout, as time in seconds does and a row number does not."""
    if (
        len(x) < LOG_LIMITS.min_log_samples
        or not np.isfinite(x).all()
        or not _rises(x, LOG_LIMITS.min_time_column_rise_share)
    ):
        return False
    steps = np.diff(x)
    usual = float(np.median(steps))
    even = float(np.mean(np.abs(steps - usual) <= LOG_LIMITS.max_time_step_spread * usual))
    return usual > 0.0 and usual != 1.0 and even >= 0.9


def inspect_log(log: Log) -> tuple[LogFinding, ...]:
    """Return the faults and peculiarities of a log's channels, in the file's order.

    One cause gives one finding: rows of garbage are excluded before any other check, and a channel that is
    dead is not also called constant.
    """
    found: list[LogFinding] = []
    if log.lost:
        found.append(LogFinding("truncated", log.time or "time", f"the file ends with {log.lost}", NOTE_LEVEL))
    if log.damaged:
        found.append(LogFinding("damaged_rows", log.time or "time", f"excluded {log.damaged}", NOTE_LEVEL))
    channels = {c.name: c for c in log.channels if len(c.samples) >= LOG_LIMITS.min_log_samples}
    if not channels:
        count = max((len(c.samples) for c in log.channels), default=0)
        text = f"{count} rows: at least {LOG_LIMITS.min_log_samples} are needed to examine a log"
        return (*found, LogFinding("short", log.time or "time", text, NOTE_LEVEL))
    longest = max((len(c.samples) for c in channels.values()), default=0)
    table = {n: c for n, c in channels.items() if len(c.samples) == longest}
    # Rows are excluded as by reading, and in the same order.
    for find in (_garbage_rows, _zeroed_rows, _repeated_packets):
        told = find(log, table)
        if told is not None:
            rows, finding = told
            text, excluded = f"{finding.found}; {LEFT_OUT_WORDS}", int(rows.sum())
            found.append(replace(finding, found=text, level=REPAIRED_LEVEL, excluded=excluded))
            table = {n: replace(c, samples=c.samples[~rows]) for n, c in table.items()}
            channels |= table
            longest -= excluded
    found += _time_findings(log, channels)
    moving = {n: c for n, c in channels.items() if c.quantity.kind != "time" and n != log.time}
    repeats = _repeated_rows([c.samples for c in moving.values() if len(c.samples) == longest])
    short = _in_short_runs(repeats)
    if short.sum() > LOG_LIMITS.min_repeated_share * len(short):
        text = f"{int(short.sum())} of {len(short)} rows repeat the row before: the log is written faster than it fills"
        found.append(LogFinding("uneven", log.time or "time", text, NOTE_LEVEL))
    if repeats.any():
        # While everything rests, no channel tells anything.
        moving = {n: replace(c, samples=c.samples[~repeats]) if n in table else c for n, c in moving.items()}
    for channel in moving.values():
        found += _channel_findings(channel, moving)
    found = _told_from_clipping(found, moving, _rate(table, log.time, ~repeats if repeats.any() else None))
    constants = {f.channel for f in found if f.kind == constant.KIND}
    found += [f for f in _frozen_findings(moving) if f.channel not in constants]
    found += _relation_findings(moving, {f.channel for f in found if f.kind == constant.KIND})
    personal = {each.label for each in log.personal}
    texts = [name for name in log.texts if name not in personal]
    found += [LogFinding("text", name, "text, which is not read", NOTE_LEVEL) for name in texts]
    found += [LogFinding("personal", p.label, f"a {p.kind} at {p.place}: remove it", ALARM_LEVEL) for p in log.personal]
    return tuple(found)


def _garbage_rows(log: Log, table: Mapping[str, LogChannel]) -> tuple[np.ndarray, LogFinding] | None:
    """Return a mask of the rows of garbage at both ends of a table, with their finding; None without any.

    Garbage is a matter of rows, so that only columns of one length are examined together.
    """
    others = {n: c.samples for n, c in table.items() if n != log.time and c.quantity.kind != "time"}
    found = garbage.find_garbage(table[log.time].samples if log.time in table else None, others)
    if found is None:
        return None
    count = max(len(c.samples) for c in table.values())
    rows = np.ones(count, bool)
    rows[found.between(count)] = False
    text = f"{found.where} of {count} rows are garbage: {found.cause}"
    return rows, LogFinding(garbage.KIND, log.time or "time", text, first=0, last=found.head - 1)


def _zeroed_rows(log: Log, table: Mapping[str, LogChannel]) -> tuple[np.ndarray, LogFinding] | None:
    """Return a mask of the rows of packets that were filled with zeros, with their finding; None without any."""
    rows = garbage.zeroed_rows({n: c.samples for n, c in table.items()})
    return (rows, LogFinding(garbage.KIND, log.time or "time", garbage.zeroed_text(rows))) if rows.any() else None


def _repeated_packets(log: Log, table: Mapping[str, LogChannel]) -> tuple[np.ndarray, LogFinding] | None:
    """Return a mask of the rows that repeat the packet before, with their finding; None without any."""
    if log.time not in table:
        return None
    beside = {n: c.samples for n, c in table.items() if c.quantity.kind != "time" and n != log.time}
    rows = ~first_deliveries(table[log.time].samples, beside)
    if not rows.any():
        return None
    text = f"{int(rows.sum())} repeated packets ({int(rows.sum())} of {len(rows)} rows)"
    return rows, LogFinding("repeated", log.time, text, size=float(np.mean(rows)))


def _repeated_rows(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Return a mask of the rows that repeat the row before in all of `columns`, (n,) each, of which there are two."""
    repeats = np.zeros(len(columns[0]) if columns else 0, bool)
    if len(columns) > 1:
        repeats[1:] = np.all([x[1:] == x[:-1] for x in columns], axis=0)
    return repeats


def _in_short_runs(repeats: np.ndarray) -> np.ndarray:
    """Return the mask `repeats`, (n,), without its long runs: there everything rests."""
    short = repeats.copy()
    for first, length in zip(*find_runs(repeats), strict=True):
        short[first : first + length] = length <= LOG_LIMITS.max_repeated_rows
    return short


def _time_findings(log: Log, channels: Mapping[str, LogChannel]) -> Iterator[LogFinding]:
    """Yield what is wrong with the clock, and columns of time that run apart."""
    if not log.time:
        if log.rate is None:
            text = "no column of time, and no rate is stated: nothing that needs velocities can be computed"
            yield LogFinding("no_time", "time", text)
        return
    channel = channels[log.time]  # the longest column
    time = channel.samples
    period = find_clock_period(time / channel.quantity.factor)
    if period is not None:
        period *= channel.quantity.factor
        time = unwrap_clock(time, period)
        text = f"the clock starts again after {period:.6g}{channel.unit}; its parts are joined"
        yield LogFinding("rollover", log.time, f"{text} when the log is read", REPAIRED_LEVEL)
    known = np.isfinite(time)
    steps = np.diff(time[known])
    if not np.all(known):
        yield LogFinding(missing.KIND, log.time, f"{int((~known).sum())} missing times")
    positive = steps[steps > 0.0]
    if not positive.size:
        yield LogFinding("uneven", log.time, "time does not advance")
        return
    usual, unit = float(np.median(positive)), channel.unit
    back = np.flatnonzero(steps < 0.0)
    if back.size:
        text = f"time runs back {back.size} times, first after {time[known][back[0]]:.6g}{unit}"
        yield LogFinding("uneven", log.time, text, first=int(back[0]))
    elif np.any(steps == 0.0) and np.mean(steps == 0.0) < 0.9:
        share = float(np.mean(steps == 0.0))
        text = f"{100 * share:.3g} % of the rows have the time of the row before: the clock is coarser than the rows"
        yield LogFinding("uneven", log.time, text, size=share)
    near = positive[positive < MIN_GAP_STEP_RATIO * usual]
    jitter = float(np.quantile(np.abs(near / usual - 1.0), 0.99)) if near.size else 0.0
    mean = float(np.mean(positive[positive <= float(np.quantile(positive, 0.999))]))
    share = float(np.mean(np.abs(positive / mean - 1.0) > LOG_LIMITS.max_steady_jitter))
    if mean > MIN_GAP_STEP_RATIO * usual and share > LOG_LIMITS.max_jittering_share and not back.size:
        text = f"rows come in packets: most steps are {usual:.3g}{unit}, the mean step is {mean:.4g}{unit}"
        yield LogFinding("uneven", log.time, text, size=share)
    long = positive[positive > max(LOG_LIMITS.min_gap_steps, 1.3 * float(np.quantile(positive, 0.98)) / usual) * usual]
    if long.size:
        many = "a gap" if long.size == 1 else f"{long.size} gaps"
        text = f"{many} of up to {long.max():.4g}{unit}, {usual:.4g}{unit} is usual: cut out when the log is read"
        gaps = tuple(long.tolist() if channel.quantity.unit == "s" else [float("nan")] * long.size)
        yield LogFinding("uneven", log.time, text, REPAIRED_LEVEL, gaps=gaps)
    if jitter > MAX_EVEN_JITTER:
        text = f"steps differ from {usual:.4g}{unit} by {100 * jitter:.3g} % in 1 of 100 rows: stamped on arrival"
        out = float(np.mean(np.abs(positive / usual - 1.0) > LOG_LIMITS.max_steady_jitter))
        level = ALARM_LEVEL if out > LOG_LIMITS.max_jittering_share else NOTE_LEVEL
        yield LogFinding("uneven", log.time, text, level, size=jitter)
    for other in channels.values():
        if other.name != log.time and other.quantity.kind == "time" and len(other.samples) == len(time):
            yield from _second_clock(channel, other)


def _second_clock(one: LogChannel, other: LogChannel) -> Iterator[LogFinding]:
    known = np.isfinite(one.samples) & np.isfinite(other.samples)
    span, again = (float(c.samples[known][-1] - c.samples[known][0]) for c in (one, other))
    if span <= 0.0 or again <= 0.0:
        return
    ratio = again / span
    # Clocks in different units differ by a power of ten.
    ratio /= 10.0 ** round(float(np.log10(ratio)))
    if LOG_LIMITS.min_clock_drift_share < abs(ratio - 1.0) < LOG_LIMITS.max_clock_drift_share:
        way = "faster" if ratio > 1.0 else "slower"
        text = f"it runs {abs(ratio - 1.0) * 1e6:.3g} millionths {way} than {one.name}"
        yield LogFinding(held.KIND, other.name, text, size=ratio - 1.0)


def _channel_findings(channel: LogChannel, others: Mapping[str, LogChannel]) -> Iterator[LogFinding]:
    """Yield what is wrong with one channel."""
    x, quantity, name, unit = channel.samples, channel.quantity, channel.name, channel.unit
    known = np.isfinite(x)
    gone = int((~known).sum())
    if gone == len(x):
        yield LogFinding(constant.KIND, name, "no number in any row")
        return
    if gone:
        first = int(np.flatnonzero(~known)[0])
        runs = find_runs(~known)[0].size
        many = f"{gone} of {len(x)} samples are missing, in {runs} stretch{'es' if runs > 1 else ''}"
        most = MAX_MISSING_SHARE if quantity.kind in REGRESSED_QUANTITIES else DEFAULT_CUT_SHARE
        if gone > most * len(x):
            yield LogFinding(missing.KIND, name, f"{many}: more than {100 * most:.3g} %", ALARM_LEVEL, first)
        else:
            yield LogFinding(missing.KIND, name, f"{many}; {LEFT_OUT_WORDS}", REPAIRED_LEVEL, first)
    levels = channel.levels
    measures = channel.is_measurement
    if channel.is_constant:
        value = float(levels[0]) if levels is not None and levels.size else 0.0
        text, why = f"the one value {value:z.6g}{unit} in every row", _why_constant(channel, others)
        if why:
            yield LogFinding("constant", name, f"{text}: {why}", NOTE_LEVEL, size=value)
        else:
            yield LogFinding(constant.KIND, name, text, size=value)
        return
    switched = _switched_levels(channel)
    if switched is not None:
        values = f"{', '.join(f'{level:.6g}' for level in switched[:-1])} and {switched[-1]:.6g}"
        text = f"a switched signal or marker: {values}{unit}; it keeps each for many rows"
        yield LogFinding("switched", name, text, SOUND_LEVEL)
        return
    if levels is not None and measures and quantity.kind in (*EFFORT_QUANTITIES, "emg", "acceleration"):
        values = ", ".join(f"{level:.6g}" for level in levels)
        yield LogFinding(constant.KIND, name, f"only the values {values}{unit}: the last digit flickers, nothing moves")
        return
    impossible = list(_impossible(channel))
    yield from impossible
    if measures:
        stretch = constant.silent_stretch(x)
        if stretch is not None and not _rests_with_others(channel, others, *stretch):
            first, last = stretch
            where = "to the end" if last >= len(x) - 2 else f"to row {last}"
            text = f"the one value {x[first]:z.6g}{unit} from row {first} {where}, while other channels move"
            yield LogFinding(constant.KIND, name, text, ALARM_LEVEL, first, last, float(x[first]))
            x = np.array(x)
            x[first : last + 1] = np.nan
    slower = held.find_held(x)
    if slower is not None and quantity.role != "command":
        text = f"each value stays for {slower.rows:.3g} rows ({100 * slower.regular:.3g} % regular): a slower clock"
        yield LogFinding(held.KIND, name, text, size=slower.rows)
    yield from _cut_off(channel, x)
    if measures and slower is None and not impossible:
        glitches = spikes.find_spikes(x, spikes.SPIKE_LIMITS.max_spike_samples)
        if quantity.kind not in INERTIAL_CHANNELS:
            # A drive, a knock or a muscle makes peaks of its own.
            glitches = [g for g in glitches if g[2] > LOG_LIMITS.min_peak_ratio * _spread(x)]
        if 0 < len(glitches) <= LOG_LIMITS.max_spike_count:
            largest = max(glitches, key=lambda g: g[2])
            many = "a spike" if len(glitches) == 1 else f"{len(glitches)} spikes, the largest"
            text = f"{many} of {largest[2]:.4g}{unit} at row {largest[0]}"
            yield LogFinding("spike", name, text, ALARM_LEVEL, largest[0], largest[1], largest[2])


def _why_constant(channel: LogChannel, others: Mapping[str, LogChannel]) -> str:
    """Return why a channel of one value need not be recorded again; "" for a measurement that is dead."""
    quantity = channel.quantity
    if is_setting(channel.name):
        return "a setting"
    if not channel.is_measurement or quantity.kind in STEADY_QUANTITIES or not _something_moves(channel, others):
        return "a setting, or not connected"
    own = [c for c in others.values() if c.joint == channel.joint and c.quantity.can_be_measured]
    if quantity.kind == "voltage" and any(c.quantity.kind in EFFORT_QUANTITIES and c.levels is None for c in own):
        return "a supply voltage, because another channel holds the measured effort of the same drive"
    is_joint_still = all(c.is_constant for c in own if c.quantity.kind != "")
    if channel.joint and is_joint_still and len({c.quantity.kind for c in own}) > 2:
        return "no channel of this joint changes: it was at rest, or not connected"
    return ""


def _switched_levels(channel: LogChannel) -> np.ndarray | None:
    """Return the few values between which a channel is switched, each kept for long; None for any other channel."""
    if channel.quantity.kind not in SWITCHED_QUANTITIES:
        return None
    x = channel.samples[np.isfinite(channel.samples)]
    # A few hundred samples are enough to tell that most channels take many values.
    if np.unique(x[:: max(1, len(x) // 300)]).size > LOG_LIMITS.max_switched_levels:
        return None
    levels = np.unique(x)
    if not 2 <= levels.size <= LOG_LIMITS.max_switched_levels:
        return None
    edges = np.concatenate(([0], np.flatnonzero(np.diff(x)) + 1, [len(x)]))
    kept, lengths = x[edges[:-1]], np.diff(edges)
    shortest = min(float(np.median(lengths[kept == level])) for level in levels)
    return levels if shortest >= LOG_LIMITS.min_switched_rows else None


def _spread(x: np.ndarray) -> float:
    """Return the width that holds 98 % of the values."""
    known = x[np.isfinite(x)]
    return float(np.subtract(*np.quantile(known, (0.99, 0.01)))) if known.size else 0.0


def _something_moves(channel: LogChannel, others: Mapping[str, LogChannel]) -> bool:
    return any(c.quantity.kind not in ("", "time") and c is not channel and c.levels is None for c in others.values())


def _rests_with_others(channel: LogChannel, others: Mapping[str, LogChannel], first: int, last: int) -> bool:
    """Return whether a stretch in which a channel is constant may be rest, because no related channel moves there.

    A joint may rest under a changing effort and away from its command, for friction holds it. Only a recorded velocity
    contradicts the rest of a position, and a recorded position that of a velocity. Everything else is measured with
    noise, and never rests as long as anything moves.
    """
    contradicting = {"position": ("velocity",), "velocity": ("position",)}.get(channel.quantity.kind)
    beside = [c for c in others.values() if c is not channel and len(c.samples) == len(channel.samples)]
    measured = [c for c in beside if c.quantity.role != "command" and c.levels is None]
    telling = [c for c in measured if not contradicting or c.quantity.kind in contradicting]
    for other in telling[:: -(-len(telling) // LOG_LIMITS.max_compared_channels) or 1]:
        whole, inside = other.spread, _spread(other.samples[first : last + 1])
        if inside > 0.1 * whole and (not contradicting or _moves_with(channel, other, first, last)):
            return False
    return True


def _moves_with(channel: LogChannel, other: LogChannel, first: int, last: int) -> bool:
    """Whether a velocity elsewhere is that of a position: what two joints do is no matter of each other."""
    position, velocity = (channel, other) if channel.quantity.kind == "position" else (other, channel)
    x = np.delete(np.gradient(position.samples), slice(max(first - 2, 0), last + 3))
    y = np.delete(velocity.samples, slice(max(first - 2, 0), last + 3))
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < LOG_LIMITS.min_log_samples or x[known].std() == 0.0 or y[known].std() == 0.0:
        return False
    return abs(float(np.corrcoef(x[known], y[known])[0, 1])) > LOG_LIMITS.min_velocity_correlation


def _frozen_findings(channels: Mapping[str, LogChannel]) -> Iterator[LogFinding]:
    """Yield positions that repeat one value while their joint must have moved, by the effort of the same joint."""
    positions = [c for c in channels.values() if c.quantity.kind == "position" and c.quantity.can_be_measured]
    efforts: dict[tuple[str, int], LogChannel] = {}
    commands: dict[str, LogChannel] = {}
    for c in channels.values():
        if c.quantity.kind in EFFORT_QUANTITIES:
            efforts.setdefault((c.joint, len(c.samples)), c)
        if c.quantity.kind == "position" and c.quantity.role == "command":
            commands.setdefault(c.joint, c)
    for position in positions:
        own = efforts.get((position.joint, len(position.samples)))
        if own is None or position.levels is not None:
            continue
        asked = commands.get(position.joint)
        reference = asked.samples if asked and len(asked.samples) == len(position.samples) else None
        least = constant.SILENCE_LIMITS.min_silent_samples
        rests = frozen.frozen_rests(position.samples, own.samples, reference, least)
        longest = max(rests, key=lambda rest: rest[1] - rest[0], default=None)
        if longest is not None:
            first, last, why = longest
            text = f"the one value {position.samples[first]:z.6g}{position.unit} in rows {first} to {last} while {why}"
            yield LogFinding(constant.KIND, position.name, text, ALARM_LEVEL, first, last)


def _impossible(channel: LogChannel) -> Iterator[LogFinding]:
    """Yield values that no wearable machine has."""
    x, quantity, name, unit = channel.samples, channel.quantity, channel.name, channel.unit
    finite = np.isfinite(x)
    if quantity.kind in ("stiffness", "damping") and np.any(x[finite] < 0.0):
        count, least = int(np.sum(x[finite] < 0.0)), float(x[finite].min())
        where = f"in {count} of {len(x)} rows, down to {least:.4g}{unit}"
        text = f"a negative {quantity.kind} {where}, which drives the joint"
        yield LogFinding("impossible", name, text, size=least)
        return
    wrong = magnitude.find_implausible(Channel(quantity.kind or name, x, quantity.unit or "1", name))
    if quantity.kind == "emg" and quantity.unit == "V":
        wrong = magnitude.find_implausible(Channel(f"emg.{name}", x, "V", name))
    # A motor's position, and one that turns on and on, has no bound.
    is_bounded = quantity.kind != "position"
    if wrong is not None and (is_bounded or wrong.largest > magnitude.MAGNITUDE_LIMITS.max_guessed_magnitude):
        count = int(np.sum(np.abs(x[finite]) > wrong.limit))
        text = f"up to {wrong.largest:.4g}{unit} in {count} of {len(x)} rows, plausible are {wrong.limit:.4g}{unit}"
        if wrong.probable_unit and wrong.is_typical:
            text += f", or the numbers are {wrong.probable_unit}"
        yield LogFinding("impossible", name, text, size=wrong.largest)
        return
    sizes = np.abs(x[finite] - np.median(x[finite]))
    usual = float(np.quantile(sizes, 0.99))
    if usual > 0.0 and sizes.max() > LOG_LIMITS.wild_ratio * usual:
        count = int(np.sum(sizes > LOG_LIMITS.wild_ratio * usual))
        text = f"up to {sizes.max():.4g}{unit} in {count} of {len(x)} rows, elsewhere at most {usual:.4g}{unit}"
        yield LogFinding("impossible", name, text, size=float(sizes.max()))


def _cut_off(channel: LogChannel, x: np.ndarray) -> Iterator[LogFinding]:
    """Yield the limits at which a channel is cut: saturated where it drives, clipped where it is measured."""
    quantity = channel.quantity
    if quantity.kind in UNLIMITED_QUANTITIES or len(np.unique(x)) <= LOG_LIMITS.max_switch_levels:
        return
    if quantity.kind in INERTIAL_CHANNELS and quantity.role == "command":
        return
    limits = limited.find_limits(x)
    if sum(limit.samples for limit in limits) > LOG_LIMITS.max_limited_share * len(x):
        limits = ()
    if quantity.kind in INERTIAL_CHANNELS:
        # A joint that rests at one end does so once. A sensor that ends there does so whenever it is reached.
        limits = tuple(
            limit for limit in limits if limit.stretches > 1 and limit.longest < LOG_LIMITS.max_dwell_share * len(x)
        )
    if limits:
        drives = quantity.kind in EFFORT_QUANTITIES
        values = " and ".join(f"{limit.value:.4g}" for limit in limits)
        count = sum(limit.samples for limit in limits)
        longest = max(limit.longest for limit in limits)
        text = (
            f"cut at {values}{channel.unit} in {count} of {len(x)} rows ({100 * count / len(x):.3g} %), for up to "
            f"{longest} rows on end"
        )
        yield LogFinding(
            limited.KIND if drives else "clipped", channel.name, text, size=max(abs(limit.value) for limit in limits)
        )
        return
    for sign in (1.0, -1.0):
        first, length = flat_tops(sign * x)
        if first.size and length.sum() <= LOG_LIMITS.max_flat_top_share * len(x):
            value, count = float(x[first[0]]), int(length.sum())
            text = f"clipped at {value:.4g}{channel.unit} in {count} of {len(x)} rows"
            yield LogFinding("clipped", channel.name, text, size=abs(value))


def _rate(table: Mapping[str, LogChannel], time: str | None, kept: np.ndarray | None) -> float:
    """Return the rate of the rows [Hz], 0 where no clock in seconds tells it."""
    if time is None or time not in table or table[time].quantity.unit != "s":
        return 0.0
    stamps = table[time].samples if kept is None else table[time].samples[kept]
    step = float(np.nanmedian(np.diff(stamps))) if len(stamps) > 2 else 0.0
    return 1.0 / step if step > 0.0 else 0.0


def _told_from_clipping(
    found: Sequence[LogFinding], channels: Mapping[str, LogChannel], rate: float
) -> list[LogFinding]:
    """Return findings in which an effort that is cut where the motion shows more is clipped, and not saturated."""
    positions = [c.samples for c in channels.values() if c.quantity.kind == "position" and c.quantity.role != "command"]
    told = []
    for finding in found:
        own = channels.get(finding.channel)
        if finding.kind == limited.KIND and own is not None and own.quantity.can_be_measured and rate > 0.0:
            alike = [q for q in positions if len(q) == len(own.samples)]
            ends = sensor_range.sensor_ends(own.samples, alike, rate) if alike else ()
            if ends:
                said = "; ".join(f"{end.samples} rows {sensor_range.describe_end(end, own.unit)}" for end in ends)
                finding = replace(finding, kind="clipped", found=f"{said}; {LEFT_OUT_WORDS}", level=REPAIRED_LEVEL)
        told.append(finding)
    return told


def _relation_findings(channels: Mapping[str, LogChannel], dead: set[str]) -> Iterator[LogFinding]:
    """Yield channels that repeat or are computed from others, and efforts that nobody measured."""
    groups: dict[tuple[str, str, int], list[LogChannel]] = {}
    for channel in channels.values():
        if channel.name not in dead and channel.quantity.kind and channel.levels is None:
            key = (channel.quantity.kind, channel.quantity.unit, len(channel.samples))
            groups.setdefault(key, []).append(channel)
    found = {f.channel: f for group in groups.values() for f in _computed_findings(group)}
    yield from (found[name] for name in channels if name in found)
    for kind in EFFORT_QUANTITIES:
        of_kind = [c for c in channels.values() if c.quantity.kind == kind]
        asked = [c for c in of_kind if c.quantity.role in ("command", "computed")]
        if asked and len(asked) == len(of_kind):
            listed = ", ".join(c.name for c in asked)
            text = f"no {kind} is measured: {listed} {'is' if len(asked) == 1 else 'are'} asked for or computed"
            yield LogFinding("not_measured", asked[0].name, text, NOTE_LEVEL)


def _computed_findings(alike: Sequence[LogChannel]) -> Iterator[LogFinding]:
    """Yield channels that repeat or are computed from others, of channels of one quantity, unit and length."""
    table = np.stack([c.samples for c in alike])
    commands = [c for c in alike if c.quantity.role == "command"]
    most = int(np.clip(LOG_LIMITS.max_echo_samples / table.size, 1, LOG_LIMITS.max_compared_commands))
    told: set[str] = set()
    for i, channel in enumerate(alike):
        if channel.name in told:
            continue
        computed = echoed.find_computed(table, i)
        if computed is not None:
            names = [alike[k].name for k in computed.sources]
            told.add(names[0])
            text = f"it equals {' plus '.join(names)} in every row that is not at a limit: computed, not measured"
            level = ALARM_LEVEL if channel.quantity.role == "measured" else NOTE_LEVEL
            yield LogFinding(echoed.KIND if level == ALARM_LEVEL else "computed", channel.name, text, level)
            continue
        if channel.quantity.role in ("command", "computed"):
            continue
        own = sorted(commands, key=lambda c: c.joint != channel.joint)
        for command in own[:most]:
            echo = echoed.find_echo(channel.samples, command.samples)
            if echo is not None and (channel.quantity.kind in EFFORT_QUANTITIES or echo.correlation > 0.999999):
                told.add(command.name)
                late = f"{echo.delay} rows late (r = {echo.correlation:.5f})"
                text = f"it repeats the command {command.name}, {late}: it is not a measurement"
                yield LogFinding(echoed.KIND, channel.name, text, size=echo.correlation)
                break
