"""A made-up pointing study: movements of minimum jerk with corrective submovements, EMG bursts that lead them, markers,
and a robot that slows people down by known shares."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow
from pyarrow import csv

from pellucid.study.procedures.registry import open_study
from pellucid.study.study import Study

SLOWER = {"Ctrl": 1.0, "FC": 1.03, "PCFr": 1.2, "CLPC": 1.18}
"""By how much longer movements take."""

YIELD = {"Ctrl": 1.0, "FC": 1.1, "PCFr": 1.4, "CLPC": 1.6}
"""EMG over acceleration, relative to control."""

AMPLITUDES = (12.0, 24.0, 36.0, 48.0, 60.0)
REST = np.radians(60.0)  # the lowest target: 30 degrees below the horizontal
HOLD = 1.0


def minimum_jerk(s: np.ndarray) -> np.ndarray:
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def angle_and_target(rng: np.random.Generator, fs: float, condition: str, pace: float, repetitions: int):
    """Time [s], angle, target [rad], and the movements' true starts and durations [s]."""
    steps = np.repeat(np.radians(AMPLITUDES), repetitions)
    rng.shuffle(steps)
    parts, goals, at, truth = [], [], REST, []
    now = HOLD
    for amplitude in steps:
        for sign in (1.0, -1.0):
            duration = (0.45 + 0.45 * amplitude) * pace * SLOWER[condition] * np.exp(0.05 * rng.standard_normal())
            truth.append((now + 0.3, duration, sign * amplitude))
            parts.append((now + 0.3, duration, sign * 0.94 * amplitude))
            parts.append((now + 0.3 + 0.6 * duration, 0.7 * duration, sign * 0.06 * amplitude))
            goals.append((now, sign * amplitude))
            now += 0.3 + 1.3 * duration + HOLD
    time = np.arange(int(now * fs)) / fs
    angle = np.full(len(time), at)
    for start, duration, height in parts:
        angle += height * minimum_jerk((time - start) / duration)
    target = np.full(len(time), at)
    for start, height in goals:
        target[time >= start] += height
    return time, angle, target, truth


def emg(rng: np.random.Generator, fs: float, truth, length: float, condition: str) -> np.ndarray:
    """Four muscles [V], shape (n, 4): noise carried by bursts that begin 80 ms before the motion."""
    time = np.arange(int(length * fs)) / fs
    drive = np.full((len(time), 4), 0.02)
    for start, duration, amplitude in truth:
        height = 5.8 * abs(amplitude) / duration**2 / 10.0 * YIELD[condition]
        burst = height * np.exp(-0.5 * ((time - (start - 0.08 + 0.22 * duration)) / (0.12 * duration)) ** 2)
        brake = 0.5 * height * np.exp(-0.5 * ((time - (start - 0.08 + 0.7 * duration)) / (0.12 * duration)) ** 2)
        up = amplitude > 0.0
        drive[:, :2] += (burst if up else brake)[:, None]
        drive[:, 2:] += (brake if up else burst)[:, None]
    return 1e-3 * drive * rng.standard_normal(drive.shape)


def study(
    folder: Path,
    *,
    participants: int = 6,
    conditions: tuple[str, ...] = tuple(SLOWER),
    seed: int = 1,
    fs: float = 100.0,
    with_emg: bool = False,
    markers: bool = False,
    missing: tuple[tuple[str, str], ...] = (),
    repetitions: int = 2,
    more: str = "",
    change=None,
) -> Study:
    """A study on disk.

    `missing` names participants and conditions that were not recorded; `change` may spoil (participant, condition,
    time, angle, target, emg time) before they are written and returns them.
    """
    folder = Path(folder)
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    lines = ['name = "pointing"', "[rig]", 'joint = "elbow"', 'motion = "rotary"', 'lifts = "flexion"']
    people = [f"P{i + 1}" for i in range(participants)]
    for person in people:
        lines += [f"[participants.{person}]", 'mass = "63 kg"']
    lines += ["[channels]", 'time = { column = "time", unit = "s" }', 'target = { column = "target", unit = "deg" }']
    if not markers:
        lines += ['position = { column = "angle", unit = "deg" }']
    muscles = ("biceps", "brachioradialis", "triceps_lateral", "triceps_long")
    if with_emg:
        lines += ["[streams.emg.channels]", 'time = { column = "time", unit = "s" }']
        lines += [f'emg.{m} = {{ column = "{m}", unit = "mV" }}' for m in muscles]
    if markers:
        lines += ["[optical]", 'time = { column = "time", unit = "s" }', 'unit = "mm"', 'markers = ["elbow", "wrist"]']
        lines += ["down = [0, 0, -1]"]
    lines += ["[assessment]", f'control = "{conditions[0]}"']
    if markers:
        lines += ['segment = ["elbow", "wrist"]']
    if with_emg:
        lines += ['agonists = ["biceps", "brachioradialis"]', 'antagonists = ["triceps_lateral", "triceps_long"]']
    lines += [more] if more else []
    for i, person in enumerate(people):
        rng = np.random.default_rng([seed, i])
        pace = np.exp(0.18 * rng.standard_normal())
        for condition in conditions:
            own = pace * np.exp(0.03 * rng.standard_normal())
            time, angle, target, truth = angle_and_target(rng, fs, condition, own, repetitions)
            muscle_time = np.arange(int(time[-1] * 1000.0)) / 1000.0
            activity = emg(rng, 1000.0, truth, time[-1], condition) if with_emg else None
            if change is not None:
                time, angle, target, muscle_time = change(person, condition, time, angle, target, muscle_time)
            if (person, condition) in missing:
                continue
            name = f"{person}_{condition}"
            lines += ["[[recordings]]", f'name = "{name}"', f'file = "recordings/{name}.csv"', 'protocol = "pointing"']
            lines += [f'participant = "{person}"', f'condition = "{condition}"']
            columns, head = [time, np.degrees(target)], "time,target"
            if not markers:
                columns, head = [*columns, np.degrees(angle)], head + ",angle"
            if condition != conditions[0]:
                columns, head = [*columns, 0.4 * np.tanh(np.gradient(angle, time) / -0.1)], head + ",interaction"
                lines += ['channels.interaction = { column = "interaction", unit = "N*m" }']
            write(folder / "recordings" / f"{name}.csv", head, columns)
            if with_emg:
                write(
                    folder / "recordings" / f"{name}_emg.csv",
                    "time," + ",".join(muscles),
                    [muscle_time, *(1e3 * activity.T)],
                )
                lines += [f'streams = {{ emg = "recordings/{name}_emg.csv" }}']
            if markers:
                elbow = np.array([100.0, 50.0, 1000.0]) + 0.1 * rng.standard_normal((len(time), 3))
                along = np.c_[0.0 * angle, np.sin(angle), -np.cos(angle)]
                wrist = elbow + 250.0 * along + 0.1 * rng.standard_normal((len(time), 3))
                wrist[~np.isfinite(angle)] = np.nan
                head = "time,elbow_x,elbow_y,elbow_z,wrist_x,wrist_y,wrist_z"
                write(folder / "recordings" / f"{name}_markers.csv", head, [time, *elbow.T, *wrist.T])
                lines += [f'optical = "recordings/{name}_markers.csv"']
    (folder / "study.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return open_study(folder)


def write(path: Path, head: str, columns) -> None:
    """Write columns with the seven digits of single precision, by Arrow, which is ten times as fast as NumPy."""
    table = pyarrow.table(dict(zip(head.split(","), (np.asarray(each, np.float32) for each in columns), strict=True)))
    csv.write_csv(table, path, csv.WriteOptions(quoting_style="none"))
