"""Inputs that an exported controller must answer the same on every machine: a motion, then every fault."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..control.control_law import LAWS, LawSensor
from .controller_values import ControllerValues

NOTHING, INIT, STOP = 0, 1, 2
"""What happens before a step."""

MOTION = 400
"""Steps of the motion."""

FAULT = 12
"""Steps of each fault: ten of motion first, where it is not the first sample that is wrong."""


@dataclass(frozen=True)
class ReplayVector:
    """Rows as C initialisers."""

    rows: tuple[str, ...]  # One a step
    motion: int  # How many of the first are the motion


@dataclass
class _Sample:
    value: np.float32
    sequence: int
    time: int
    valid: int = 1


def replay_vector(values: ControllerValues, seed: int = 1) -> ReplayVector:
    """A motion with a repeated and a lost sample and optional sensors that come and go; then every fault."""
    sensors = LAWS[values.law].sensors
    period = round(1e6 * values.numbers["period"])
    rng = np.random.default_rng(seed)
    signals = [_signal(s, values, MOTION, rng) for s in sensors]

    def samples(i: int, start: int = 1_000_000) -> tuple[int, list[_Sample]]:
        now = start + i * period
        return now, [_Sample(x[i], 0xFFFFFF00 + i & 0xFFFFFFFF, now - period // 10) for x in signals]

    rows = []
    for i in range(MOTION):
        now, read = samples(i)
        for s, sensor in zip(read, sensors, strict=True):
            if i == MOTION // 4:  # seen again
                before = samples(i - 1)[1][read.index(s)]
                s.value, s.sequence, s.time = before.value, before.sequence, before.time
            if not sensor.required and MOTION // 2 <= i < 3 * MOTION // 4:
                s.valid = 0
        if i == MOTION // 3:  # a control period was missed: neither its sample nor its step
            continue
        rows.append(_row(INIT if i == 0 else NOTHING, now, read))
    motion = len(rows)
    for wrong in _faults(sensors, values, period):
        for i in range(FAULT):
            now, read = samples(i)
            before = INIT if i == 0 else NOTHING
            if i == FAULT - 2:
                before, now = wrong(read, now, before)
            rows.append(_row(before, now, read))
    return ReplayVector(tuple(rows), motion)


def _signal(sensor: LawSensor, values: ControllerValues, n: int, rng: np.random.Generator) -> np.ndarray:
    """Two sines and noise, shape (n,), no faster than the model knows, as float."""
    t = np.arange(n) * values.numbers["period"]
    # The motion's angular frequency, and the swing that goes with it.
    rate = 2 * np.pi * 4.0 / t[-1]
    swing = sensor.swing
    if sensor.name == "position":
        limit = min(values.speed, values.numbers["velocity_limit"])
        swing = min(sensor.swing, 0.4 * limit / rate)
    x = swing * (np.sin(rate * t + 0.3) + 0.2 * np.sin(2.3 * rate * t))
    noise = sensor.noise * swing / sensor.swing
    return (np.round((x + noise * rng.standard_normal(n)) / noise) * noise).astype(np.float32)


def _faults(sensors: tuple[LawSensor, ...], values: ControllerValues, period: int):
    """Each takes the samples of one step and makes one thing wrong; returns what happens before it, and its time."""
    too_long = round(1e6 * values.numbers["max_age"]) + 10 * period

    def value(x: float):
        def wrong(read, now, before):
            for s, sensor in zip(read, sensors, strict=True):
                if sensor.required:
                    s.value = np.float32(x)
            return before, now

        return wrong

    def first(**change: int):
        def wrong(read, now, before):
            for name, by in change.items():
                setattr(read[0], name, getattr(read[0], name) + by)
            return before, now

        return wrong

    def late(read, now, before):
        return before, now + too_long

    def stopped(read, now, before):
        return STOP, now

    fast = 2.0 * values.numbers["velocity_limit"]
    jump = 1e3 * fast * values.numbers["period"]
    yield from (value(np.nan), value(np.inf), value(-np.inf), value(float(np.float32(jump))))
    yield from (first(valid=-1), first(time=-(10**6)), first(time=10**6), first(sequence=-20), late, stopped)


def _row(before: int, now: int, read: list[_Sample]) -> str:
    """As a C initialiser."""
    made = ", ".join(
        f"{{0x{int(s.value.view(np.uint32)):08x}u, {s.sequence & 0xFFFFFFFF}u, {s.time}, {s.valid}u}}" for s in read
    )
    return f"{{{before}u, {now}, {{{made}}}}}"
