"""Inputs that an exported controller must answer the same on every machine: a motion, then every fault."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .. import _core
from ..control.control_law import LAWS, LawSensor
from .controller_values import ControllerValues

NOTHING, STOP, INIT_AGAIN, MEMORY, POWER_ON = 0, 1, 2, 3, 16
"""What happens before a step; POWER_ON and more: a start as a variant, by its place in `VARIANTS`."""

MOTION = 400
"""Steps of the motion."""

FAULT = 12
"""Steps of most faults: ten of motion first, where it is not the first sample that is wrong."""

_ANY = float("inf")

_LAW: Mapping[str, float] = {
    "test_effort": 0.0, "raw_speed_limit": _ANY, "raw_acceleration_limit": _ANY, "range_min": -_ANY, "range_max": _ANY,
    "freeze_speed": _ANY, "body_inertia": 0.0, "wearer_torque": _ANY, "wearer_push": _ANY, "force_tolerance": _ANY,
    "force_burst": _ANY, "force_excess": _ANY,
    "force_expected": 0.0, "muscle_expected": 0.0, "drive_expected": 0.0, "joint_expected": 0.0, "budget_store": _ANY,
    "push_limit": _ANY, "power_limit": _ANY, "ringing_limit": _ANY, "drive_surplus": _ANY, "reset_delay": 0.02,
    "healthy_samples": 10.0, "rest_speed": _ANY, "hold_damping": 0.0,
}  # fmt: skip
_BODY: Mapping[str, float] = {"body_inertia": 0.05, "body_coulomb": 0.0, "body_load": 0.0, "residual_bandwidth": 40.0}

VARIANTS: Mapping[str, Mapping[str, float]] = {
    "law": _LAW,
    "jump": {**_LAW, "raw_acceleration_limit": 2000.0},
    "raw": {**_LAW, "raw_speed_limit": 4.0, "range_min": -10.0, "range_max": 10.0, "freeze_speed": 0.5,
            "freeze_samples": 5.0},
    "joint": {**_LAW, "joint_expected": 1.0, "joint_tolerance": 0.01},
    "drive": {**_LAW, "drive_expected": 1.0, "drive_tolerance": 6.0},
    "surplus": {**_LAW, "drive_expected": 1.0, "drive_tolerance": _ANY, "drive_surplus": 1e-3},
    "unexplained": {**_LAW, **_BODY, "wearer_torque": 0.01},
    "force": {**_LAW, **_BODY, "force_expected": 1.0, "force_tolerance": 0.01, "force_quiet_samples": 1000.0,
              "force_range": _ANY, "hold_damping": 1.0, "hold_limit": 1.0},
    "energy": {**_LAW, **_BODY, "budget_store": 1e-6, "budget_power": 0.0, "hold_damping": 1.0, "hold_limit": 1.0},
    "push": {**_LAW, "push_limit": 1e-6},
    "power": {**_LAW, "power_limit": 1e-6},
    "ringing": {**_LAW, "ringing_limit": 1e-4},
    "lost": {**_LAW, "force_expected": 1.0, "force_range": _ANY, "force_quiet_samples": 3.0, "degrades": 1.0},
    "muscle": {**_LAW, "muscle_expected": 1.0, "muscle_range": 1e-3},
    "test": {**_LAW, "test_effort": 0.5, "test_samples": 8.0, "test_rest": 4.0, "test_least": 1e-9, "test_most": 1e-6},
    # Every check of a robot with encoder, force and current sensor, and none that trips: what a step costs.
    "counted": {**_LAW, **_BODY, "force_expected": 1.0, "force_range": _ANY, "force_quiet_samples": 1e6,
                "drive_expected": 1.0, "drive_tolerance": _ANY},
}  # fmt: skip
# Every check of a robot with one encoder, force and current sensor, and none that trips: what a step costs.


@dataclass
class Reading:
    """One sensor's sample."""

    value: np.float32
    sequence: int
    time: int  # [us]
    valid: int = 1


@dataclass(frozen=True)
class Row:
    """What one step is given."""

    now: int  # [us]
    read: tuple[Reading, ...]  # Of the law's sensors
    before: int = NOTHING
    token: int = 0  # 1: the challenge is answered
    drive: float = 0.0  # By which the drive's measurement differs from the last effort [N m]

    @property
    def text(self) -> str:
        """As a C initialiser."""
        made = ", ".join(
            f"{{0x{int(s.value.view(np.uint32)):08x}u, {s.sequence & 0xFFFFFFFF}u, {s.time}, {s.valid}u}}"
            for s in self.read
        )
        drive = int(np.float32(self.drive).view(np.uint32))
        return f"{{{self.before}u, {self.token}u, 0x{drive:08x}u, {self.now}, {{{made}}}}}"


@dataclass(frozen=True)
class ReplayVector:
    """Rows, of which the first are the motion."""

    steps: tuple[Row, ...]
    motion: int  # How many of the first are the motion

    @property
    def rows(self) -> tuple[str, ...]:
        """As C initialisers, one a step."""
        return tuple(row.text for row in self.steps)


@dataclass(frozen=True)
class _Block:
    """A stretch after a power-on: `wrong` changes the row of a step, which it is given with its number."""

    variant: str
    wrong: Callable[[int, Row], Row] = field(default=lambda i, row: row)
    length: int = FAULT


def replay_vector(values: ControllerValues, seed: int = 1) -> ReplayVector:
    """A motion with a repeated and a lost sample and optional sensors that come and go; then every fault."""
    sensors = LAWS[values.law].sensors
    period = round(1e6 * values.numbers["period"])
    rng = np.random.default_rng(seed)
    signals = [_signal(s, values, MOTION, rng) for s in sensors]

    def row(i: int, start: int = 1_000_000) -> Row:
        now = start + i * period
        return Row(now, tuple(Reading(x[i], 0xFFFFFF00 + i & 0xFFFFFFFF, now - period // 10) for x in signals))

    steps = []
    for i in range(MOTION):
        made = row(i)
        if i == MOTION // 4:  # seen again
            made = replace(made, read=row(i - 1).read)
        for s, sensor in zip(made.read, sensors, strict=True):
            if not sensor.required and MOTION // 2 <= i < 3 * MOTION // 4:
                s.valid = 0
        if i == MOTION // 3:  # a control period was missed: neither its sample nor its step
            continue
        steps.append(replace(made, before=POWER_ON) if i == 0 else made)
    motion = len(steps)
    for block in _blocks(sensors, values, period):
        at = POWER_ON + list(VARIANTS).index(block.variant)
        for i in range(block.length):
            made = block.wrong(i, row(i))
            steps.append(replace(made, before=at) if i == 0 else made)
    return ReplayVector(tuple(steps), motion)


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


def _blocks(sensors: tuple[LawSensor, ...], values: ControllerValues, period: int) -> Iterator[_Block]:
    """Every fault of the law's front and gate, of the supervisor, and what ends a fault and what does not."""
    too_long = round(1e6 * values.numbers["max_age"]) + 10 * period

    def at_end(change: Callable[[Row], Row]) -> _Block:
        return _Block("law", lambda i, row: change(row) if i == FAULT - 2 else row)

    def value(x: float) -> _Block:
        def wrong(row: Row) -> Row:
            for s, sensor in zip(row.read, sensors, strict=True):
                if sensor.required:
                    s.value = np.float32(x)
            return row

        return at_end(wrong)

    def first(**change: int) -> _Block:
        def wrong(row: Row) -> Row:
            for name, by in change.items():
                setattr(row.read[0], name, getattr(row.read[0], name) + by)
            return row

        return at_end(wrong)

    def placed(variant: str, place: Callable[[int], float], length: int = FAULT) -> _Block:
        """The position is where a function of the step says."""

        def wrong(i: int, row: Row) -> Row:
            row.read[0].value = np.float32(place(i))
            return row

        return _Block(variant, wrong, length)

    def driven(by: Callable[[int], float]) -> _Block:
        return _Block("drive", lambda i, row: replace(row, drive=by(i)) if i > 12 else row, 24)

    h = 1e-6 * period
    jump = 2e3 * values.numbers["velocity_limit"] * values.numbers["period"]
    yield from (value(np.nan), value(np.inf), value(-np.inf), value(float(np.float32(jump))))
    yield from (first(valid=-1), first(time=-(10**6)), first(time=10**6), first(sequence=-20))
    yield at_end(lambda row: replace(row, now=row.now + too_long))
    yield at_end(lambda row: replace(row, before=STOP))
    yield placed("jump", lambda i: 0.5 + (0.1 if i > 8 else 0.0))
    yield placed("raw", lambda i: 8.0 * h * i)
    yield placed("raw", lambda i: 12.0)
    yield placed("raw", lambda i: 2.0 * h * min(i, 6), 24)
    yield placed("joint", lambda i: 2.0 * h * i, 24)
    yield from (
        driven(lambda i: 15.0),
        driven(lambda i: 15.0 + i),
        driven(lambda i: -15.0 - i),
        driven(lambda i: np.nan),
    )
    yield _Block("surplus", lambda i, row: replace(row, drive=4.0), 60)
    yield _Block("unexplained", length=60)
    yield _Block("force", length=60)
    yield _Block("energy", length=60)
    yield _Block("push", length=24)
    yield _Block("ringing", length=60)
    yield placed("power", lambda i: 0.3 + 1.0 * h * i, 24)

    def silent(i: int, row: Row) -> Row:
        for s in row.read[1:]:
            s.valid = int(i < 6)
        return row

    yield _Block("lost", silent, 24)
    yield _Block("muscle", length=24)
    yield placed("test", lambda i: 0.5, 32)
    yield placed("test", lambda i: 0.5 + 0.2 * h * max(i - 6, 0), 32)
    # Eight words every fourth period: long enough for the law's numbers to be gone through twice.
    through = 4 * -(-_core.supervised_storage(values.law) // (4 * 8))
    yield _Block("law", lambda i, row: replace(row, before=MEMORY) if i == 4 else row, 4 + through)
    # Stopped; started again, which does not help; then a token that does.
    late = max(30, round(0.02 / h) + 14)

    def mended(i: int, row: Row) -> Row:
        what = {4: STOP, 8: INIT_AGAIN}.get(i, NOTHING)
        return replace(row, before=what, token=int(i >= 12))

    yield _Block("law", mended, late + 20)
