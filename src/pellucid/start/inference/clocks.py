"""Find the column that is time among columns of numbers, and its unit by its increments."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...files.clock import CLOCK_LIMITS, MAX_RESTART_SHARE, find_clock_period, unwrap_clock
from ...files.name_evidence import NameEvidence

UNIT_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""Units of time columns, in seconds."""


@dataclass(frozen=True)
class TimeLimits:
    """When a column is a clock."""

    # Range of sampling rates that loggers of joints and muscles have. A unit that gives a rate in it is likely
    # [Hz].
    usual_rates_hz: tuple[float, ...] = (5.0, 5000.0)
    # Range of sampling rates that are possible [Hz].
    possible_rates_hz: tuple[float, ...] = (0.5, 60000.0)
    # Seconds since 1970 between 1979 and 2065. A column within this range is a wall clock, and its unit is certain.
    epoch_range_s: tuple[float, ...] = (3.0e8, 3.0e9)
    # Days since 1900, as spreadsheets count them, and since the year 0, as MATLAB does, between 1979 and 2065. A column
    # within one of these ranges whose steps are usual ones of days is a wall clock.
    serial_days: tuple[tuple[float, ...], ...] = ((28_900.0, 60_300.0), (722_900.0, 754_300.0))
    # Time may stand still or fall in at most the remaining share of steps, as stale packets and restarts make it
    # do.
    min_rising_share: float = CLOCK_LIMITS.min_rising_share
    # A clock that stands still in more than this share of steps is coarser than the samples: only its mean rate is
    # used.
    max_repeated_share: float = 0.5
    # A column that is named as time may fall behind its own maximum by at most this share of its span: stamps of
    # arrival come out of order, and a clock that starts again is none for the whole table.
    max_fall_share: float = 0.05
    # Stamps of arrival have one rate if 98 of 100 lie within this many steps of a straight line. The delays of a
    # loaded bus or radio are some steps; a pause makes a kink.
    max_line_deviation_steps: float = 20.0
    # Stamps jitter if more than this share of their steps is shorter than half the usual one, and as many are
    # longer by half: lost samples make long steps only, packets that came twice short ones only.
    max_off_step_share: float = 0.02
    # The usual step of stamps that jitter is the median advance over this many rows.
    lag_rows: int = 50
    # A clock starts again with each trial only if each has so many rows.
    min_trial_rows: int = 50
    # Trials are parted by so many usual steps, which no interpolation bridges.
    trial_gap_steps: float = 200.0
    # A column moves smoothly if no step is larger than this share of its standard deviation. It jumps where it
    # changes by more than so many times its largest other step.
    max_smooth_step_share: float = 0.2
    min_jump_ratio: float = 1.5
    # Even steps replace stamps that jitter if a column is predicted with this share of the error, in most of so many
    # columns whose error is below this share of their spread.
    max_smoother_ratio: float = 0.7
    max_smooth_columns: int = 12
    max_unpredicted_share: float = 0.2
    # Score of a column that only its name tells as time: any evener one comes first.
    named_score: float = 0.05
    # A column whose name says no time has to advance so evenly: a slow movement also rises throughout.
    min_unnamed_score: float = 0.7


TIME_LIMITS = TimeLimits()


@dataclass(frozen=True)
class FoundClock:
    """The time of a table's rows."""

    column: str | None  # name of the column; None if there is none or if only its mean rate is used
    unit: str  # unit of the column
    rate: float | None  # sampling rate by the column [Hz]; None if it is not known
    why: str  # reason, for a comment in study.toml
    is_certain: bool  # whether the unit follows from the column or its name, and not from what is usual
    coarse_column: str | None = None  # column that is a clock, but stands still for several samples
    others: tuple[str, ...] = ()  # further columns that advance like a clock
    first_sound: int = 0  # index of the first row after which the clock advances without falling back
    period: float | None = None  # number after which the column starts again at 0, in its unit; None if it does not

    def seconds(self, values: np.ndarray) -> np.ndarray:
        """Return the clock's column, shape (n,), in seconds, without the jumps of a clock that starts again."""
        times = np.array(values, float) if self.period is None else unwrap_clock(values, self.period)
        return times * UNIT_SECONDS[self.unit]

    def in_unit(self, unit: str, why: str) -> FoundClock:
        """Return the clock with its numbers in another unit, and the reason for it."""
        rate = None if self.rate is None else self.rate * UNIT_SECONDS[self.unit] / UNIT_SECONDS[unit]
        return replace(self, unit=unit, rate=rate, why=why, is_certain=True)

    @property
    def is_impossible(self) -> bool:
        """Whether no logger has the rate that the clock tells, so that its unit is another one."""
        return self.rate is not None and self.column is not None and self.rate > TIME_LIMITS.possible_rates_hz[1]

    def would_be_usual(self, unit: str) -> bool:
        """Whether the clock has an unusual rate, and a usual one with its numbers in another unit."""
        if self.rate is None or _is_usual(self.rate):
            return False
        return _is_usual(self.rate * UNIT_SECONDS[self.unit] / UNIT_SECONDS[unit])


def find_clock(columns: Mapping[str, np.ndarray], names: Sequence[NameEvidence]) -> FoundClock:
    """Return the clock among columns of one length, shape (n,) each.

    A clock advances in nearly all steps and by nearly equal ones. Its unit is that of its name. Without one it follows
    from the years since 1970, or from the sampling rate, which is usually 5 to 5000 Hz.
    """
    candidates = []
    periods: dict[str, float] = {}
    restarts: set[str] = set()
    columns = dict(columns)
    # Another clock starts again in the same rows, whether or not the motion goes on.
    signals = [columns[evidence.name] for evidence in names if evidence.quantity not in ("time", "counter")]
    for evidence in names:
        values = columns[evidence.name]
        period = find_clock_period(values) if evidence.quantity in (None, "time", "counter") else None
        if evidence.quantity == "time" and (span := _trial_period(values, period, signals)) is not None:
            period = span
            restarts.add(evidence.name)
        if period is not None:
            values = columns[evidence.name] = unwrap_clock(values, period)
            periods[evidence.name] = period
        score = _clock_score(values)
        by_name = evidence.quantity == "time" or (score is not None and _ends_in_time(evidence))
        if score is None and by_name and _advances_overall(values):
            score = TIME_LIMITS.named_score
        if score is None or (evidence.quantity not in (None, "time", "counter") and not by_name):
            continue
        if not by_name and score < TIME_LIMITS.min_unnamed_score:
            continue
        is_counter = _counts_rows(values) and not by_name
        # The times of one signal are of that signal, if there are others.
        is_shared = evidence.name.rpartition(".")[0] not in columns
        candidates.append((by_name, not is_counter, is_shared, score, evidence))
    candidates = [c for c in candidates if c[0] or c[1]]
    if not candidates:
        return FoundClock(None, "s", None, "no column advances like a clock", False)
    best = max(candidates, key=lambda c: c[:4])[4]
    others = tuple(c[4].name for c in candidates if c[4] is not best)
    clocks = {best.name, *others}
    beside = [x for name, x in columns.items() if name not in clocks and len(x) == len(columns[best.name])]
    found = _clock_of(columns[best.name], best, others, beside)
    period = periods.get(best.name)
    if period is None:
        return found
    if best.name in restarts:
        why = f"{found.why}; it starts again with each trial, and a gap is put between trials"
        return replace(found, period=period, why=why)
    return replace(found, period=period, why=f"{found.why}; it starts again at 0 after {period:.12g}")


def _ends_in_time(evidence: NameEvidence) -> bool:
    """Whether a name ends in the symbol of time, as in ``encoder.t``: of a column that advances, it means no torque."""
    return re.split(r"[./\\:]", evidence.bare)[-1].casefold() in ("t", "ts")


def _trial_period(values: np.ndarray, period: float | None, signals: Sequence[np.ndarray]) -> float | None:
    """Return a period that puts a gap between the trials of a clock, shape (n,), which starts again with each of them.

    None for a clock that does not, and for one whose `period` rolls over: there, the motion goes on, which `signals`,
    (n,) each, show.
    """
    known = np.flatnonzero(np.isfinite(values))
    x = values[known]
    if len(x) < 2 * TIME_LIMITS.min_trial_rows:
        return None
    steps, near = np.diff(x), MAX_RESTART_SHARE * float(np.ptp(x))
    starts = np.flatnonzero(steps < -near) + 1
    rest = np.delete(steps, starts - 1)
    if not starts.size or np.any(rest < 0.0) or np.any(np.diff([0, *starts, len(x)]) < TIME_LIMITS.min_trial_rows):
        return None
    if np.any(x[[0, *starts]] > x.min() + near):
        return None
    if period is not None and not _has_jumps(signals, known[starts]):
        return None
    usual = float(np.median(rest[rest > 0.0])) if np.any(rest > 0.0) else 0.0
    return float(f"{float(np.ptp(x)) + TIME_LIMITS.trial_gap_steps * usual:.6g}") if usual else None


def _has_jumps(columns: Sequence[np.ndarray], rows: np.ndarray) -> bool:
    """Whether one of some columns that moves smoothly jumps at most of some rows."""
    for x in columns:
        if len(x) <= rows[-1]:
            continue
        steps = np.abs(np.diff(x))
        others = np.delete(steps, rows - 1)
        others = others[np.isfinite(others)]
        is_smooth = others.size and 0.0 < others.max() < TIME_LIMITS.max_smooth_step_share * float(np.nanstd(x))
        if is_smooth and np.mean(steps[rows - 1] > TIME_LIMITS.min_jump_ratio * others.max()) > 0.5:
            return True
    return False


def _clock_of(
    values: np.ndarray, evidence: NameEvidence, others: tuple[str, ...], beside: Sequence[np.ndarray]
) -> FoundClock:
    known = values[np.isfinite(values)]
    first = _first_sound_row(values)
    steps = np.diff(known[first:] if np.isfinite(values).all() else known)
    positive = steps[steps > 0.0]
    repeated = float(np.mean(steps == 0.0))
    usual = float(np.median(positive))
    shorter, longer = np.mean(positive < 0.5 * usual), np.mean(positive > 1.5 * usual)
    jitters = bool(min(shorter, longer) > TIME_LIMITS.max_off_step_share)
    if jitters or repeated > TIME_LIMITS.max_repeated_share:
        usual = _usual_advance(known[first:]) or usual
    unit, why, certain = _unit(known[len(known) // 2], usual, evidence)
    stopped = _stops_between_samples(values, first, beside)
    slope = _line_step(known[first:], usual) if stopped or jitters else None
    if slope is not None and not stopped and jitters and np.isfinite(values).all():
        if is_smoother_evenly([x[first:] for x in beside], known[first:]):
            why = (
                f'"{evidence.name}" is the clock, but its stamps were taken on arrival: the recorded motion is '
                "smoother at the mean rate, which is used"
            )
            return FoundClock(None, "s", 1.0 / (slope * UNIT_SECONDS[unit]), why, certain, evidence.name, others)
        slope = None
    if slope is not None and (repeated <= TIME_LIMITS.max_repeated_share or jitters):
        why = (
            f'"{evidence.name}" is the clock, but its stamps were taken on arrival: in {stopped} rows they do not '
            "advance although the samples do; the mean rate is used"
        )
        return FoundClock(None, "s", 1.0 / (slope * UNIT_SECONDS[unit]), why, certain, evidence.name, others)
    span = (known[-1] - known[first if first < len(known) else 0]) * UNIT_SECONDS[unit]
    if repeated > TIME_LIMITS.max_repeated_share and not jitters:
        advances = np.flatnonzero(np.diff(known) > 0.0)
        whole = (known[advances[-1] + 1] - known[advances[0] + 1]) * UNIT_SECONDS[unit]
        # Between its first and its last advance a coarse clock shows whole steps.
        rate = float((advances[-1] - advances[0]) / whole) if whole > 0.0 else len(steps) / span if span > 0.0 else None
        why = (
            f'"{evidence.name}" is the clock, but it is coarser than the sampling interval: {100 * repeated:.0f} % of '
            "its steps are 0; the mean rate is used"
        )
        return FoundClock(None, "s", rate, why, False, evidence.name, others)
    inner = positive[positive < 1.5 * np.median(positive)]
    step = usual if jitters or not len(inner) else float(np.mean(inner))
    return FoundClock(evidence.name, unit, 1.0 / (step * UNIT_SECONDS[unit]), why, certain, None, others, first)


def _clock_score(values: np.ndarray) -> float | None:
    """Return how evenly a column advances, in (0, 1]; None if it does not advance like a clock."""
    known = values[np.isfinite(values)]
    if len(known) < 8 or len(known) < 0.9 * len(values):
        return None
    steps = np.diff(known)
    rising, standing = np.mean(steps > 0.0), np.mean(steps == 0.0)
    if rising == 0.0 or rising + standing < TIME_LIMITS.min_rising_share:
        return None
    positive = steps[steps > 0.0]
    median = np.median(positive)
    if standing > TIME_LIMITS.max_repeated_share:
        # A coarse clock has equal steps wherever it advances.
        even = np.mean(np.abs(positive - median) <= 0.5 * median)
        return 0.3 * float(even) if even > 0.5 and len(positive) >= 2 else None
    near = np.mean((positive > 0.2 * median) & (positive < 5.0 * median))
    # A column that rises by chance, such as a slow ramp, has steps of very different sizes.
    if near < 0.8:
        return None
    spread = float(np.mean(np.abs(positive - median)) / median)
    return float(near) / (1.0 + spread)


def _advances_overall(values: np.ndarray) -> bool:
    """Whether a column that is named as time rises from its first row to its last, apart from jitter."""
    known = values[np.isfinite(values)]
    if len(known) < 8 or len(known) < 0.9 * len(values):
        return False
    # Stale packets stand at the beginning, and their times count nowhere.
    sound = known[_first_sound_row(known) if np.isfinite(values).all() else 0 :]
    sound = sound if len(sound) >= 0.9 * len(known) else known
    span = float(sound[-1] - sound[0])
    return span > 0.0 and float(np.max(np.maximum.accumulate(sound) - sound)) <= TIME_LIMITS.max_fall_share * span


def _usual_advance(values: np.ndarray) -> float | None:
    """Return the usual advance of stamps from row to row, by rows so far apart that jitter hardly counts; None if there
    is none."""
    lag = max(1, min(TIME_LIMITS.lag_rows, len(values) // 4))
    advance = float(np.median(values[lag:] - values[:-lag])) / lag
    return advance if advance > 0.0 else None


def _stops_between_samples(values: np.ndarray, first: int, beside: Sequence[np.ndarray]) -> int:
    """Return the number of stamps that do not advance although another column does (not a repeated packet)."""
    if not np.isfinite(values).all():
        return 0
    stops = np.diff(values[first:]) <= 0.0
    if not stops.any():
        return 0
    moves = np.zeros(len(stops), dtype=bool)
    for x in beside:
        moves |= np.diff(x[first:]) != 0.0
    return int(np.sum(stops & moves))


def _line_step(values: np.ndarray, usual: float) -> float | None:
    """Return the step of stamps that have one rate throughout; None if pauses or changes bend their line."""
    rows = np.arange(len(values))
    if len(values) < 8:
        return None
    slope, start = np.polyfit(rows, values - values[0], 1)
    off = values - values[0] - start - slope * rows
    low, high = np.quantile(off, (0.01, 0.99))
    return float(slope) if slope > 0.0 and high - low <= 2.0 * TIME_LIMITS.max_line_deviation_steps * usual else None


def is_smoother_evenly(columns: Sequence[np.ndarray], stamps: np.ndarray) -> bool:
    """Whether columns, shape (n,) each, are smoother in even steps than at their stamps, shape (n,).

    Each sample is predicted from the two before and the two after it, by the cubic through them, on both axes of time.
    Samples of a device with an even clock, stamped on arrival, are predicted better in even steps.
    """
    n = len(stamps)
    if n < 50:
        return False
    even = np.arange(n, dtype=float)
    wins = losses = 0
    for x in columns[: TIME_LIMITS.max_smooth_columns]:
        if len(x) != n or not np.isfinite(x).all() or np.ptp(x) == 0.0:
            continue
        spread = float(np.std(x))
        by_even, by_stamp = (_prediction_error(x, axis) for axis in (even, stamps))
        # A column that neither axis predicts shows noise, and not the clock.
        if min(by_even, by_stamp) > TIME_LIMITS.max_unpredicted_share * spread:
            continue
        wins += by_even < TIME_LIMITS.max_smoother_ratio * by_stamp
        losses += by_stamp < TIME_LIMITS.max_smoother_ratio * by_even
    return wins > losses


def _prediction_error(x: np.ndarray, axis: np.ndarray) -> float:
    """Return the median error with which the cubic through four neighbours predicts the sample between them."""
    at, around = axis[2:-2], (axis[:-4], axis[1:-3], axis[3:-1], axis[4:])
    near = (x[:-4], x[1:-3], x[3:-1], x[4:])
    predicted = np.zeros(len(at))
    with np.errstate(divide="ignore", invalid="ignore"):
        for i, own in enumerate(around):
            weight = np.ones(len(at))
            for j, other in enumerate(around):
                if i != j:
                    weight *= (at - other) / (own - other)
            predicted += weight * near[i]
    errors = np.abs(predicted - x[2:-2])
    errors = errors[np.isfinite(errors)]
    return float(np.median(errors)) if errors.size else float("inf")


def _counts_rows(values: np.ndarray) -> bool:
    """Whether a column is the number of its row: whole numbers in steps of exactly 1 from 0 or 1."""
    return bool(values[0] in (0.0, 1.0) and np.all(np.diff(values) == 1.0))


def _first_sound_row(values: np.ndarray) -> int:
    """Return the index after the last fall of time within the first tenth; stale packets stand at the beginning."""
    head = np.diff(values[: max(10, len(values) // 10)])
    with np.errstate(invalid="ignore"):
        falls = np.flatnonzero(head < 0.0)
    return int(falls[-1]) + 1 if falls.size else 0


def _unit(middle: float, step: float, evidence: NameEvidence) -> tuple[str, str, bool]:
    if evidence.quantity == "time" and evidence.unit in UNIT_SECONDS:
        rate = 1.0 / (step * UNIT_SECONDS[evidence.unit])
        is_possible = TIME_LIMITS.possible_rates_hz[0] / 50.0 <= rate <= 10.0 * TIME_LIMITS.possible_rates_hz[1]
        return evidence.unit, f"the header says {evidence.unit}; steps of {step:.4g} give {rate:.4g} Hz", is_possible
    for unit, seconds in UNIT_SECONDS.items():
        is_wall_clock = unit not in ("min", "h", "d") and _is_within(middle * seconds, TIME_LIMITS.epoch_range_s)
        if is_wall_clock and (unit == "s" or _is_usual(1.0 / (step * seconds))):
            return unit, f"the numbers count {unit} since 1970, in steps of {step:.4g}", True
    is_date = any(_is_within(middle, ends) for ends in TIME_LIMITS.serial_days)
    if is_date and _is_usual(1.0 / (step * UNIT_SECONDS["d"])):
        return "d", f"the numbers are dates in days, in steps of {step * UNIT_SECONDS['d']:.4g} s", True
    usual = [u for u in ("s", "ms", "us", "ns") if _is_usual(1.0 / (step * UNIT_SECONDS[u]))]
    rates = {u: 1.0 / (step * UNIT_SECONDS[u]) for u in ("s", "ms", "us", "ns")}
    possible = [u for u, rate in rates.items() if _is_within(rate, TIME_LIMITS.possible_rates_hz)]
    unit = (usual or possible or ["s"])[0]
    rate = 1.0 / (step * UNIT_SECONDS[unit])
    why = f"steps of {step:.4g} {unit} give {rate:.4g} Hz"
    if len(usual) == 1:
        return unit, why, True
    rest = " or ".join(u for u in (usual or possible) if u != unit)
    doubt = f"but {rest} would give a usual rate too" if rest in usual or " or " in rest else "which is unusual"
    return unit, f"{why}, {doubt}", False


def _is_usual(rate: float) -> bool:
    return _is_within(rate, TIME_LIMITS.usual_rates_hz)


def _is_within(x: float, ends: tuple[float, ...]) -> bool:
    return ends[0] <= x <= ends[1]
