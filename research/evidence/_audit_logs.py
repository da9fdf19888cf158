"""What `pellucid audit` finds in logs with sealed faults, and whether it says anything of sound ones.

A seed draws a machine, its sensors, the names and units of its columns, and one fault or none. The machines are
integrated here, with bristle friction and controllers that nothing in the package knows; EMG is filtered noise, gait a
sum of harmonics. The detectors' thresholds were set on the seeds of `TUNED_SEEDS` and on public recordings; the figures
are of `JUDGED_SEEDS`, which nothing was set on.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfilt

import pellucid as pl
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

TUNED_SEEDS = range(0, 200)
"""Seeds on which thresholds were set."""

JUDGED_SEEDS = range(70_000, 70_000 + sized(200, smallest=26))
"""Seeds whose figures are reported."""

CLEAN_SHARE = 0.25
"""Share of the logs without a fault."""


@dataclass
class DrawnChannel:
    """A column of a drawn log."""

    name: str  # name and unit, as the file writes them
    samples: np.ndarray
    tag: str  # "time", "position", "velocity", "effort", "command", "emg", "stiffness" or "other"


@dataclass
class DrawnLog:
    """A drawn log before it is written."""

    channels: list[DrawnChannel]
    rate: float
    preamble: str = ""
    delimiter: str = ","
    digits: int = 7
    sealed: tuple[str, frozenset[str]] = field(default=("", frozenset()))  # column with the fault, kinds that name it

    def of(self, *tags: str) -> list[DrawnChannel]:
        """Return the columns with one of the tags."""
        return [channel for channel in self.channels if channel.tag in tags]


def _smooth_noise(rng: np.random.Generator, n: int, rate: float, cutoff: float) -> np.ndarray:
    """Noise below a frequency [Hz], of unit size."""
    x = sosfilt(butter(2, min(cutoff, 0.4 * rate), fs=rate, output="sos"), rng.standard_normal(n + 2000))[2000:]
    return x / x.std()


def _path(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """A path to follow: sines, strokes with pauses, or a swept sine."""
    kind = rng.integers(3)
    size = rng.uniform(0.3, 0.9)
    if kind == 0:
        parts = zip((0.6, 0.3, 0.1), rng.uniform(0.2, 1.4, 3), strict=True)
        return size * sum(a * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for a, f in parts)
    if kind == 1:
        period, ramp = rng.uniform(2.0, 4.0), rng.uniform(0.4, 0.9)
        places = size * rng.uniform(-1.0, 1.0, int(t[-1] / period) + 2)
        k = (t / period).astype(int)
        s = np.clip((t - k * period) / ramp, 0.0, 1.0)
        return places[k] + (places[k + 1] - places[k]) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    return size * np.sin(2 * np.pi * (0.1 * t + (rng.uniform(0.6, 1.4) - 0.1) * t**2 / (2 * t[-1])))


def _servo(rng: np.random.Generator, t: np.ndarray, rate: float) -> tuple[np.ndarray, ...]:
    """Position, velocity, asked and acting torque of a joint under a position loop, with bristle friction."""
    path = _path(rng, t)
    inertia, weight = rng.uniform(0.02, 0.4), rng.uniform(0.0, 6.0)
    level, viscous = rng.uniform(0.05, 0.6), rng.uniform(0.01, 0.3)
    stiff, damp = 300.0 * inertia * rng.uniform(1.0, 3.0), 25.0 * inertia * rng.uniform(0.8, 1.5)
    bristle, lag = 400.0 * level, rng.uniform(0.002, 0.01)
    substeps = max(4, int(np.ceil(4000.0 / rate)))
    step = 1.0 / (rate * substeps)
    q, v, z, torque = path[0], 0.0, 0.0, 0.0
    made = np.empty((len(t), 4))
    previous = path[0]
    for k, wanted in enumerate(path):
        speed = (wanted - previous) * rate
        previous = wanted
        asked = stiff * (wanted - q) + damp * (speed - v) + weight * np.sin(q)
        made[k] = q, v, asked, torque
        for _ in range(substeps):
            torque += step / lag * (asked - torque)
            z += step * (v - bristle * abs(v) / level * z)
            v += step * (torque - bristle * z - viscous * v - weight * np.sin(q)) / inertia
            q += step * v
    return (path, *made.T)


def _quantised(x: np.ndarray, step: float) -> np.ndarray:
    return np.round(x / step) * step


def _joint_log(rng: np.random.Generator) -> DrawnLog:
    """A joint with an encoder, a velocity, a command and a measured torque or current."""
    rate = float(rng.choice([200.0, 250.0, 500.0]))
    t = np.arange(int(rng.uniform(10.0, 16.0) * rate)) / rate
    path, q, v, asked, torque = _servo(rng, t, rate)
    q = _quantised(q, 2 * np.pi / 2.0 ** rng.integers(12, 18))
    v = v + rng.uniform(0.005, 0.03) * np.abs(v).max() * rng.standard_normal(len(t))
    drift = 1.0 + 0.04 * _smooth_noise(rng, len(t), rate, 3.0)
    torque = torque * drift + 0.02 * np.abs(torque).max() * rng.standard_normal(len(t))
    degrees = rng.random() < 0.4
    factor, angle = (180 / np.pi, "deg") if degrees else (1.0, "rad")
    current = rng.random() < 0.4
    effort, unit = ("current", "A") if current else ("torque", "N*m")
    dialect = rng.integers(3)
    names = {
        0: ("time [s]", f"position [{angle}]", f"position_ref [{angle}]", f"velocity [{angle}/s]",
            f"{effort}_cmd [{unit}]", f"{effort} [{unit}]"),
        1: ("t_s", f"q_{angle}", f"q_des_{angle}", f"qd_{angle}/s",
            f"{effort}_desired_{unit.replace('*', '')}", f"{effort}_measured_{unit.replace('*', '')}"),
        2: ("Time (s)", f"Joint Angle ({angle})", f"Target Angle ({angle})", f"Joint Velocity ({angle}/s)",
            f"Commanded {effort.title()} ({unit})", f"Measured {effort.title()} ({unit})"),
    }[int(dialect)]  # fmt: skip
    values = (t, factor * q, factor * path, factor * v, asked, torque)
    tags = ("time", "position", "command", "velocity", "command effort", "effort")
    channels = [DrawnChannel(n, np.array(x), tag) for n, x, tag in zip(names, values, tags, strict=True)]
    if rng.random() < 0.5:
        channels.append(DrawnChannel("enabled", np.ones(len(t)), "other"))
    if rng.random() < 0.4:
        warm = 30.0 + 4.0 * (1.0 - np.exp(-t / 8.0)) + 0.05 * rng.standard_normal(len(t))
        channels.append(DrawnChannel("temperature [degC]", _quantised(warm, 0.1), "other"))
    if rng.random() < 0.4:
        state = (np.arange(len(t)) // int(rng.uniform(1.0, 3.0) * rate)) % 3
        channels.append(DrawnChannel("state", state.astype(float), "other"))
    return DrawnLog(channels, rate, delimiter=str(rng.choice([",", ";", "\t"])))


def _emg_log(rng: np.random.Generator) -> DrawnLog:
    """Raw EMG of some muscles and a dynamometer's torque."""
    rate = float(rng.choice([1000.0, 2000.0]))
    t = np.arange(int(rng.uniform(6.0, 9.0) * rate)) / rate
    effort = np.clip(_smooth_noise(rng, len(t), rate, 0.4), 0.0, None)
    muscles = rng.choice(["biceps", "triceps", "vastus", "soleus", "gastroc"], int(rng.integers(2, 5)), replace=False)
    millivolts = rng.random() < 0.5
    channels = [DrawnChannel("time [s]", t, "time")]
    band = butter(2, (20.0, 0.4 * rate if rate < 1200 else 450.0), "bandpass", fs=rate, output="sos")
    for muscle in muscles:
        noise = sosfilt(band, rng.standard_normal(len(t)))
        x = rng.uniform(0.1, 0.5) * (0.06 + effort * rng.uniform(0.5, 1.0)) * noise + 0.003 * rng.standard_normal(
            len(t)
        )
        scale, unit = (1.0, "mV") if millivolts else (1e-3, "V")
        grid = scale * 10.0 / 2.0**16
        channels.append(DrawnChannel(f"EMG {muscle} [{unit}]", _quantised(scale * x, grid), "emg"))
    torque = 40.0 * sosfilt(butter(2, 3.0, fs=rate, output="sos"), effort) + 0.15 * rng.standard_normal(len(t))
    channels.append(DrawnChannel("torque [N*m]", torque, "effort"))
    if rng.random() < 0.5:
        channels.append(DrawnChannel("angle [deg]", 60.0 + 0.05 * rng.standard_normal(len(t)), "other"))
    return DrawnLog(channels, rate, digits=8)


def _gait_log(rng: np.random.Generator) -> DrawnLog:
    """A worn robot of two joints: gait, assistance by impedance, sensors of torque."""
    rate = float(rng.choice([100.0, 200.0, 333.0]))
    t = np.arange(int(rng.uniform(18.0, 28.0) * rate)) / rate
    phase = 2 * np.pi * np.cumsum(0.9 + 0.08 * _smooth_noise(rng, len(t), rate, 0.3)) / rate
    channels = [DrawnChannel("time [s]", t, "time")]
    for joint in ("hip", "knee"):
        sizes, lags = rng.uniform(0.05, 0.5, 3), rng.uniform(0, 6, 3)
        q = sum(a * np.sin((k + 1) * phase + p) for k, (a, p) in enumerate(zip(sizes, lags, strict=True)))
        q = q + 0.01 * _smooth_noise(rng, len(t), rate, 2.0)
        stiffness = 8.0 + 4.0 * np.sin(phase + rng.uniform(0, 6))
        asked = stiffness * (0.3 * np.sin(phase + rng.uniform(0, 6)) - q)
        moved = sosfilt(butter(1, rng.uniform(4.0, 9.0), fs=rate, output="sos"), asked)
        measured = moved + 0.15 * np.std(asked) * _smooth_noise(rng, len(t), rate, 5.0)
        measured = measured + 0.02 * np.std(asked) * rng.standard_normal(len(t))
        channels += [
            DrawnChannel(f"{joint}_angle [rad]", _quantised(q, 2 * np.pi / 16384), "position"),
            DrawnChannel(f"{joint}_stiffness [N*m/rad]", stiffness, "stiffness"),
            DrawnChannel(f"{joint}_torque_cmd [N*m]", asked, "command effort"),
            DrawnChannel(f"{joint}_torque_meas [N*m]", measured, "effort"),
        ]
    if rng.random() < 0.5:
        channels.append(DrawnChannel("mode", np.full(len(t), 2.0), "other"))
    return DrawnLog(channels, rate)


def _one(rng: np.random.Generator, channels: list[DrawnChannel]) -> DrawnChannel:
    return channels[int(rng.integers(len(channels)))]


def _dead(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    channel = _one(rng, log.of("effort", "emg", "position"))
    channel.samples[:] = rng.choice([0.0, float(channel.samples[0])])
    return channel.name, {"dead"}


def _dies(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    channel = _one(rng, log.of("effort", "emg", "velocity"))
    n = len(channel.samples)
    first = int(rng.uniform(0.3, 0.8) * n)
    last = n if rng.random() < 0.6 else min(n, first + int(rng.uniform(0.1, 0.3) * n))
    channel.samples[first:last] = rng.choice([0.0, float(channel.samples[first])])
    return channel.name, {"dead", "dropout"}


def _last_digit(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    channel = _one(rng, log.of("effort", "emg"))
    step = 10.0 ** np.floor(np.log10(channel.samples.std() / 100.0))
    channel.samples[:] = step * rng.integers(0, 2, len(channel.samples))
    return channel.name, {"dead"}


def _impossible(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    if log.of("stiffness") and rng.random() < 0.5:
        channel = _one(rng, log.of("stiffness"))
        channel.samples -= 1.1 * channel.samples.mean()
        return channel.name, {"impossible"}
    channel = _one(rng, log.of("effort"))
    k = int(rng.integers(len(channel.samples)))
    channel.samples[k : k + int(rng.integers(1, 4))] = 10.0 ** rng.uniform(4.0, 7.0) * rng.choice([-1.0, 1.0])
    return channel.name, {"impossible", "spike"}


def _cut_off(tags: tuple[str, ...]) -> Callable[[np.random.Generator, DrawnLog], tuple[str, set[str]]]:
    def spoil(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
        channel = _one(rng, log.of(*tags) or log.of("effort", "emg"))
        x = channel.samples
        level = float(np.quantile(np.abs(x - np.median(x)), rng.uniform(0.8, 0.97)))
        middle = float(np.median(x))
        channel.samples = np.clip(x, middle - level, middle + level)
        if rng.random() < 0.3:
            channel.samples = np.minimum(x, middle + level)
        return channel.name, {"saturated", "clipped"}

    return spoil


def _echoed(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    measured = log.of("effort")
    commands = log.of("command effort")
    if not commands:
        return _dead(rng, log)
    k = int(rng.integers(len(measured)))
    late = int(rng.uniform(0.0, 0.1) * log.rate)
    echo = np.roll(commands[k].samples, late)
    echo[:late] = echo[late]
    digits = 0.001 * np.abs(echo).max()
    measured[k].samples = _quantised(echo, digits) if rng.random() < 0.5 else echo
    return measured[k].name, {"echoed"}


def _held(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    channel = _one(rng, log.of("effort", "velocity", "emg"))
    rows = int(rng.integers(3, 11))
    start = int(rng.integers(rows))
    channel.samples = channel.samples[np.maximum((np.arange(len(channel.samples)) - start) // rows * rows + start, 0)]
    return channel.name, {"another_clock"}


def _packets(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    time = log.of("time")[0]
    size = int(rng.integers(4, 17))
    k = np.arange(len(time.samples))
    arrival = (k // size + 1) * size / log.rate + np.repeat(
        rng.uniform(0, 0.3 * size / log.rate, len(k) // size + 1), size
    )[: len(k)]
    time.samples = arrival + 1e-5 * (k % size)
    return time.name, {"uneven"}


def _gap(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    n = len(log.channels[0].samples)
    first = int(rng.uniform(0.2, 0.8) * n)
    kept = np.delete(np.arange(n), slice(first, first + int(rng.uniform(0.1, 1.0) * log.rate)))
    for channel in log.channels:
        channel.samples = channel.samples[kept]
    return log.of("time")[0].name, {"uneven"}


def _repeated(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    n = len(log.channels[0].samples)
    rows = np.sort(np.append(np.arange(n), rng.choice(n, int(rng.uniform(0.02, 0.1) * n), replace=False)))
    for channel in log.channels:
        channel.samples = channel.samples[rows]
    return log.of("time")[0].name, {"repeated"}


def _runs_back(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    time = log.of("time")[0]
    first = int(rng.uniform(0.3, 0.7) * len(time.samples))
    time.samples[first:] -= rng.uniform(0.2, 1.0) * time.samples[first]
    return time.name, {"uneven"}


def _drifts(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    time = log.of("time")[0].samples
    other = 12.0 + time * (1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.003, 0.03))
    log.channels.append(DrawnChannel("device time [s]", other, "time"))
    return "device time [s]", {"another_clock"}


def _no_time(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    log.channels = [channel for channel in log.channels if channel.tag != "time"]
    return "time", {"no_time"}


def _garbage(head: bool) -> Callable[[np.random.Generator, DrawnLog], tuple[str, set[str]]]:
    def spoil(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
        count = int(rng.integers(1, 40))
        rows = slice(0, count) if head else slice(-count, None)
        old_buffer = rng.random() < 0.3
        for channel in log.channels:
            if channel.tag == "time":
                later = float(channel.samples[-1]) * rng.uniform(2.0, 900.0)
                channel.samples[rows] = (
                    later - np.arange(count)[::-1] / log.rate if head else np.arange(count) / log.rate
                )
            elif not old_buffer:
                wild = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-300.0, 300.0, count)
                wild[0] = 10.0 ** rng.uniform(12.0, 300.0)
                channel.samples[rows] = wild
        return log.of("time")[0].name, {"garbage"}

    return spoil


def _spike(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    channel = _one(rng, log.of("position"))
    x = channel.samples
    for k in rng.integers(100, len(x) - 100, int(rng.integers(1, 5))):
        x[k] += rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 3.0) * np.ptp(x)
    return channel.name, {"spike"}


def _lost(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    channel = _one(rng, log.of("effort", "position", "emg", "velocity"))
    n = len(channel.samples)
    for k in rng.integers(0, n - 60, int(rng.integers(2, 10))):
        channel.samples[k : k + int(rng.integers(10, 60))] = np.nan
    return channel.name, {"missing_samples"}


def _personal(rng: np.random.Generator, log: DrawnLog) -> tuple[str, set[str]]:
    lines = {"Patient Name": "Jane Q. Doe", "Date of birth": "1970-01-02", "Last name": "Doe"}
    label = str(rng.choice(list(lines)))
    log.preamble = f"Sampling: {log.rate:g} Hz\n{label}: {lines[label]}\n"
    return label, {"personal"}


JOINT, EMG, GAIT = _joint_log, _emg_log, _gait_log

SEALED_FAULTS: dict[str, tuple[Callable, tuple[Callable, ...]]] = {
    "dead": (_dead, (JOINT, EMG, GAIT)),
    "dies": (_dies, (JOINT, EMG, GAIT)),
    "last_digit": (_last_digit, (JOINT, EMG, GAIT)),
    "impossible": (_impossible, (JOINT, GAIT)),
    "saturated": (_cut_off(("command effort",)), (JOINT, GAIT)),
    "clipped": (_cut_off(("emg", "effort")), (JOINT, EMG, GAIT)),
    "echoed": (_echoed, (JOINT, GAIT)),
    "slower_clock": (_held, (JOINT, EMG, GAIT)),
    "packets": (_packets, (JOINT, EMG, GAIT)),
    "gap": (_gap, (JOINT, EMG, GAIT)),
    "repeated_rows": (_repeated, (JOINT, GAIT)),
    "time_runs_back": (_runs_back, (JOINT, EMG, GAIT)),
    "drifting_clock": (_drifts, (JOINT, EMG, GAIT)),
    "no_time": (_no_time, (JOINT, EMG, GAIT)),
    "garbage_head": (_garbage(head=True), (JOINT, EMG, GAIT)),
    "garbage_tail": (_garbage(head=False), (JOINT, EMG, GAIT)),
    "spike": (_spike, (JOINT, GAIT)),
    "lost_samples": (_lost, (JOINT, EMG, GAIT)),
    "personal": (_personal, (JOINT, EMG, GAIT)),
}
"""Sealed faults: how a log is spoilt, and the machines whose logs can have the fault."""


def draw_log(seed: int) -> tuple[str, DrawnLog]:
    """Return the kind of the sealed fault, "" for none, and the log of a seed."""
    rng = np.random.default_rng([seed, 26])
    if rng.random() < CLEAN_SHARE:
        machine = (JOINT, EMG, GAIT)[int(rng.integers(3))]
        return "", machine(rng)
    # Faults take turns, so that each occurs as often.
    kind = list(SEALED_FAULTS)[seed % len(SEALED_FAULTS)]
    spoil, machines = SEALED_FAULTS[kind]
    log = machines[int(rng.integers(len(machines)))](rng)
    channel, kinds = spoil(rng, log)
    log.sealed = (channel, frozenset(kinds))
    return kind, log


def write_log(log: DrawnLog, path: Path) -> Path:
    """Write a log as text, and return its path."""
    table = np.column_stack([channel.samples for channel in log.channels])
    lines = [log.delimiter.join(channel.name for channel in log.channels)]
    lines += [log.delimiter.join(f"{x:.{log.digits}g}" for x in row) for row in table.tolist()]
    path.write_text(log.preamble + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@dataclass
class Score:
    """Counts over many logs."""

    faulty: Counter = field(default_factory=Counter)
    found: Counter = field(default_factory=Counter)
    misplaced: int = 0
    clean: int = 0
    false_alarms: int = 0
    said: list[str] = field(default_factory=list)


def score_logs(seeds: range) -> Score:
    """Audit the log of each seed, and count what is found, missed and alleged."""
    score = Score()
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            kind, log = draw_log(seed)
            found = pl.audit(write_log(log, Path(folder, "log.csv")))
            told = {
                (v.channel, f.kind) for v in found.verdicts for _, f in v.findings if f.level in ("alarm", "repaired")
            }
            if not kind:
                score.clean += 1
                score.false_alarms += bool(told)
                if told:
                    score.said.append(f"{seed} clean: {sorted(told)}")
                continue
            channel, kinds = log.sealed
            score.faulty[kind] += 1
            hit = any(name == channel and each in kinds for name, each in told)
            score.found[kind] += hit
            others = {name for name, _ in told} - {channel}
            score.misplaced += bool(others)
            if not hit or others:
                score.said.append(f"{seed} {kind} in {channel}: {'hit' if hit else 'MISSED'}, {sorted(told)}")
    return score


def rows() -> Iterator[ResultRow]:
    """Recall of sealed faults, false alarms on sound logs, and recall by kind of fault."""
    score = score_logs(JUDGED_SEEDS)
    seeds = f"seeds {JUDGED_SEEDS.start} to {JUDGED_SEEDS.stop - 1}; thresholds were set on {TUNED_SEEDS.start} to "
    seeds += f"{TUNED_SEEDS.stop - 1}"

    def row(name: str, value: float, unit: str, note: str) -> ResultRow:
        return ResultRow(f"formats.audit.{name}", value, unit, "evidence", "heldout", None, note)

    count = sum(score.faulty.values())
    yield row("recall", 100.0 * sum(score.found.values()) / count, "%", f"of {count} logs with a sealed fault; {seeds}")
    yield row("false_alarms", float(score.false_alarms), "1", f"of {score.clean} logs without a fault; {seeds}")
    yield row("misplaced", float(score.misplaced), "1", f"of {count}: an alarm on another channel than the sealed one")
    yield row("logs", float(count + score.clean), "1", "drawn logs of joints, EMG and worn robots")
    for kind in SEALED_FAULTS:
        if score.faulty[kind]:
            share = 100.0 * score.found[kind] / score.faulty[kind]
            yield row(f"recall.{kind}", share, "%", f"of {score.faulty[kind]} logs")
