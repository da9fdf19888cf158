"""By how much torque that EMG tells leads torque that motion tells: causal, at equal rates of false alarms.

An event is where a joint's moment begins to rise, by inverse dynamics. Two detectors wait for it, each a linear map by
ridge regression with a threshold: one hears envelopes, the other angles and their velocities of the same limb, backward
differences, at the same instants. Map and threshold come from fitted events: the lowest threshold at which false alarms
number at most one in twenty events. Other events judge. The lead is the time by which EMG's detector is earlier.

The envelopes of walking were filtered by those who published them, and whether causally is not said. Those of lifting
come from software that runs in real time. Angles of both were filtered beforehand, which can only make motion look
earlier.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pellucid.recordings.readers import read_columns
from pellucid.studies.results import ResultRow

FALSE_ALARMS_PER_EVENT = 0.05
"""Largest number of false alarms over that of events on the fitted events [1]."""

EVENT_SHARE = 0.3
"""Share of the moment's range, 5 to 95 % quantile, at which an event begins [1]."""

BEFORE_S = 0.5
"""A detection up to this long before an event is of it; an earlier one is a false alarm [s]."""

AFTER_S = 0.5
"""A detection up to this long after an event's begin is of it; a later one is a miss [s]."""

RATE_HZ = 100.0
"""Rate at which detectors run [Hz]."""

VELOCITY_SPAN_S = 0.03
"""Span of the backward difference that gives velocities [s]."""

RIDGE_SHARE = 1e-2
"""Penalty of the ridge regression, as a share of the features' mean variance [1]."""

THRESHOLD_COUNT = 200
"""Number of thresholds that are tried."""

LIFTING_ANGLES = ("L5_S1_Flex_Ext", "pelvis_tilt")
"""Angles that motion's detector hears while a person lifts."""

BOOTSTRAP_DRAWS = 2000
"""Number of resampled sets of events for an interval."""

SEED = 20261127
"""Seed of the resampling."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of a recording at `RATE_HZ`."""

    moment: np.ndarray  # (n,) rising at events [N*m]
    emg: np.ndarray  # (n, channels) envelopes [1]
    motion: np.ndarray  # (n, 2 joints) angles and velocities


@dataclass(frozen=True)
class Leads:
    """What two detectors found on the same judged events."""

    emg: np.ndarray  # (k,) time of EMG's detection against the event's begin [s]; NaN for a miss
    motion: np.ndarray  # (k,) time of motion's detection against it [s]; NaN for a miss
    false_alarms: tuple[int, int]  # by EMG's detector and by motion's
    seconds: float  # duration of the judged stretches


def lead_rows() -> Iterator[ResultRow]:
    """Every figure of leads."""
    data = Path(os.environ.get("PELLUCID_DATA", Path(__file__).parents[2] / "shared" / "data"))
    for name, folder, read in (("walking", "lower_limb_walking", walking), ("lifting", "lumbar_lifting", lifting)):
        if not (data / folder).is_dir():
            print(f"mission.lead.{name}: not measured, for {folder} is not on this machine")
            continue
        yield from rows_of(name, [compare_detectors(*fold) for fold in read(data)])


def rows_of(name: str, found: list[Leads]) -> Iterator[ResultRow]:
    """Return the rows of one task, whose judged parts were fitted by none of the detectors that they judge."""
    emg, motion = (np.concatenate([getattr(one, kind) for one in found]) for kind in ("emg", "motion"))
    alarms = [sum(one.false_alarms[i] for one in found) for i in (0, 1)]
    seconds = sum(one.seconds for one in found)
    note = (
        f"{len(emg)} judged events in {seconds:.0f} s; missed {np.isnan(emg).sum()} by EMG, {np.isnan(motion).sum()} "
        f"by motion; false alarms {alarms[0]} and {alarms[1]}; thresholds fitted at {FALSE_ALARMS_PER_EVENT:g} an "
        "event or less"
    )
    rivals = {
        "motion": (motion - emg, f"torque told by EMG before torque told by motion, median; {note}"),
        "torque": (-emg, "torque told by EMG before inverse dynamics' own rise, median"),
    }
    for rival, (leads, words) in rivals.items():
        leads = leads[np.isfinite(leads)]
        if not len(leads):
            yield ResultRow(f"mission.lead.{name}.{rival}", None, "ms", "evidence", "heldout", None, words)
            continue
        draws = np.median(np.random.default_rng(SEED).choice(leads, (BOOTSTRAP_DRAWS, len(leads))), axis=1)
        ends = "end of the 95 % interval over resampled events"
        figures = {"": (np.median(leads), words), ".low": (np.quantile(draws, 0.025), ends)}
        for end, (value, text) in {**figures, ".high": (np.quantile(draws, 0.975), ends)}.items():
            row_id = f"mission.lead.{name}.{rival}{end}"
            yield ResultRow(row_id, 1e3 * float(value), "ms", "evidence", "heldout", None, text)


def walking(data: Path) -> list[tuple[list[Stretch], list[Stretch]]]:
    """Return both halves of a minute on a treadmill, each judged by detectors of the other: the ankle's push-off."""
    folder = data / "lower_limb_walking"
    angles = ("hip_flexion_r", "knee_angle_r", "ankle_angle_r")
    whole = _stretch(folder, "ankle_angle_r_moment", -1.0, angles, zero=())
    middle = len(whole.moment) // 2
    halves = [_part(whole, slice(0, middle)), _part(whole, slice(middle, None))]
    return [([halves[0]], [halves[1]]), ([halves[1]], [halves[0]])]


def lifting(data: Path) -> list[tuple[list[Stretch], list[Stretch]]]:
    """Return trials of a person who lifts a box, each judged by detectors of the two others."""
    made = [
        _stretch(data / "lumbar_lifting" / trial, "L5_S1_Flex_Ext", 1.0, LIFTING_ANGLES, zero=("zeroEMG",))
        for trial in ("squat5kg", "stoop5kg", "squat15kg")
    ]
    return [([other for other in made if other is not one], [one]) for one in made]


def _stretch(folder: Path, moment: str, sign: float, angles: tuple[str, ...], zero: tuple[str, ...]) -> Stretch:
    emg, ik, known = (read_columns(folder / f"{name}.sto") for name in ("emgFilt", "ik", "id"))
    begin = max(columns["time"][0] for columns in (emg, ik, known))
    end = min(columns["time"][-1] for columns in (emg, ik, known))
    time = np.arange(begin, end, 1.0 / RATE_HZ)

    def at(columns, name: str) -> np.ndarray:
        # The last sample that was there: a detector does not look ahead.
        found = np.searchsorted(columns["time"], time, side="right") - 1
        return np.asarray(columns[name], float)[found]

    held = np.column_stack([at(ik, name) for name in angles])
    span = round(VELOCITY_SPAN_S * RATE_HZ)
    late = np.vstack([np.repeat(held[:1], span, axis=0), held[:-span]])
    channels = [name for name in emg if name not in ("time", *zero)]
    return Stretch(
        sign * np.interp(time, known["time"], known[moment]),
        np.column_stack([at(emg, name) for name in channels]),
        np.column_stack([held, (held - late) / VELOCITY_SPAN_S]),
    )


def _part(whole: Stretch, part: slice) -> Stretch:
    return Stretch(whole.moment[part], whole.emg[part], whole.motion[part])


def compare_detectors(fitted: list[Stretch], judged: list[Stretch]) -> Leads:
    """Fit both detectors on the `fitted` stretches, and hold them against each other on the `judged` ones."""
    low, high = np.quantile(np.concatenate([s.moment for s in fitted]), (0.05, 0.95))
    level = low + EVENT_SHARE * (high - low)
    told, alarms = {}, {}
    for kind in ("emg", "motion"):
        predict = _ridge(np.vstack([getattr(s, kind) for s in fitted]), np.concatenate([s.moment for s in fitted]))
        threshold = _threshold([predict(getattr(s, kind)) for s in fitted], [_rises(s.moment, level) for s in fitted])
        times: list[float] = []
        false = 0
        for stretch in judged:
            found, wrong = _detect(_rises(predict(getattr(stretch, kind)), threshold), _rises(stretch.moment, level))
            times += found
            false += wrong
        told[kind], alarms[kind] = np.array(times), false
    seconds = sum(len(s.moment) for s in judged) / RATE_HZ
    return Leads(told["emg"], told["motion"], (alarms["emg"], alarms["motion"]), seconds)


def _ridge(features: np.ndarray, moment: np.ndarray):
    mean, deviation = features.mean(axis=0), features.std(axis=0)
    deviation = np.where(deviation > 0.0, deviation, 1.0)
    z = (features - mean) / deviation
    weights = np.linalg.solve(z.T @ z + RIDGE_SHARE * len(z) * np.eye(z.shape[1]), z.T @ (moment - moment.mean()))
    return lambda more: (more - mean) / deviation @ weights + moment.mean()


def _rises(samples: np.ndarray, level: float) -> np.ndarray:
    """Return where samples come above a level after a quarter of a second below it, (k,)."""
    above = samples > level
    rises = np.flatnonzero(above[1:] & ~above[:-1]) + 1
    quiet = round(0.25 * RATE_HZ)
    return np.array([i for i in rises if i >= quiet and not above[i - quiet : i].any()], int)


def _detect(crossings: np.ndarray, events: np.ndarray) -> tuple[list[float], int]:
    """Return the time of the first crossing of each event against its begin [s], NaN for a miss, and false alarms."""
    before, after = round(BEFORE_S * RATE_HZ), round(AFTER_S * RATE_HZ)
    near = np.array([(crossings >= e - before) & (crossings <= e + after) for e in events]).reshape(len(events), -1)
    firsts = [crossings[row][0] if row.any() else float("nan") for row in near]
    times = [float(first - e) / RATE_HZ for first, e in zip(firsts, events, strict=True)]
    return times, int(np.sum(~near.any(axis=0))) if len(events) else len(crossings)


def _threshold(told: list[np.ndarray], events: list[np.ndarray]) -> float:
    """Return the threshold with the earliest mean detection among those with few enough false alarms and no miss."""
    everything = np.concatenate(told)
    best = (np.inf, np.inf, float(np.median(everything)))
    for level in np.quantile(everything, np.linspace(0.05, 0.95, THRESHOLD_COUNT)):
        found = [_detect(_rises(x, level), e) for x, e in zip(told, events, strict=True)]
        times = np.array([time for each, _ in found for time in each])
        wrong = sum(false for _, false in found)
        if wrong > FALSE_ALARMS_PER_EVENT * len(times) or np.isnan(times).all():
            continue
        best = min(best, (float(np.isnan(times).mean()), float(np.nanmean(times)), float(level)))
    return best[2]
