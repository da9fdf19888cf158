"""Make the test vector of an exported controller: a motion, then every fault. Every machine must give the same
outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, Protocol, TypeVar

import numpy as np

from ... import _core
from ..control_law import LAWS, LawSensor
from .controller_values import ControllerValues

NO_EVENT = 0
"""Code of a step without an event before it."""

STOP_EVENT = 1
"""Code of a stop before a step."""

INIT_EVENT = 2
"""Code of a repeated initialisation before a step."""

MEMORY_EVENT = 3
"""Code of a fault in the memory before a step."""

POWER_ON_EVENT = 16
"""Code of a power-on before a step. The index in `SUPERVISOR_VARIANTS` of the configuration to start with is added to
it."""

MOTION_STEPS = 400
"""Number of steps of the motion."""

FAULT_STEPS = 12
"""Number of steps of most faults. The first ten are motion, unless the first sample itself is faulty."""

_NO_LIMIT = float("inf")
"""Limit that nothing exceeds."""

# Configuration of the supervisor in which no check trips.
_UNCHECKED_LAW: Mapping[str, float] = {
    "test_effort": 0.0,
    "raw_speed_limit": _NO_LIMIT,
    "raw_acceleration_limit": _NO_LIMIT,
    "range_min": -_NO_LIMIT,
    "range_max": _NO_LIMIT,
    "freeze_speed": _NO_LIMIT,
    "body_inertia": 0.0,
    "wearer_torque": _NO_LIMIT,
    "wearer_push": _NO_LIMIT,
    "force_tolerance": _NO_LIMIT,
    "force_burst": _NO_LIMIT,
    "force_excess": _NO_LIMIT,
    "unexplained_limit": _NO_LIMIT,
    "shaking_limit": _NO_LIMIT,
    "rate_samples": 0.0,
    "still_samples": 0.0,
    "probe_travel": _NO_LIMIT,
    "probe_energy": _NO_LIMIT,
    "probe_evidence": 1e30,
    "force_expected": 0.0,
    "muscle_expected": 0.0,
    "drive_expected": 0.0,
    "joint_expected": 0.0,
    "budget_store": _NO_LIMIT,
    "push_limit": _NO_LIMIT,
    "power_limit": _NO_LIMIT,
    "ringing_limit": _NO_LIMIT,
    "drive_surplus": _NO_LIMIT,
    "drive_delay": _NO_LIMIT,
    "reset_delay": 0.02,
    "healthy_samples": 10.0,
    "rest_speed": _NO_LIMIT,
    "hold_damping": 0.0,
}
# Numbers of the body for variants in which the supervisor needs a model of it.
_BODY_NUMBERS: Mapping[str, float] = {
    "body_inertia": 0.05,
    "body_coulomb": 0.0,
    "body_load": 0.0,
    "residual_bandwidth": 40.0,
}

SUPERVISOR_VARIANTS: Mapping[str, Mapping[str, float]] = {
    "law": _UNCHECKED_LAW,
    "jump": {**_UNCHECKED_LAW, "raw_acceleration_limit": 2000.0},
    "raw": {
        **_UNCHECKED_LAW,
        "raw_speed_limit": 4.0,
        "range_min": -10.0,
        "range_max": 10.0,
        "freeze_speed": 0.5,
        "freeze_samples": 5.0,
    },
    "joint": {**_UNCHECKED_LAW, "joint_expected": 1.0, "joint_tolerance": 0.01},
    "drive": {**_UNCHECKED_LAW, "drive_expected": 1.0, "drive_tolerance": 6.0},
    "surplus": {**_UNCHECKED_LAW, "drive_expected": 1.0, "drive_tolerance": _NO_LIMIT, "drive_surplus": 1e-3},
    "late": {
        **_UNCHECKED_LAW,
        "drive_expected": 1.0,
        "drive_tolerance": _NO_LIMIT,
        "drive_delay": 1e-6,
        "drive_delay_rate": 1e-6,
        "drive_delay_smoothing": 20.0,
        "drive_delay_forget": 20.0,
        "drive_delay_share": 1e-6,
    },
    "unexplained": {**_UNCHECKED_LAW, **_BODY_NUMBERS, "wearer_torque": 0.01},
    "force": {
        **_UNCHECKED_LAW,
        **_BODY_NUMBERS,
        "force_expected": 1.0,
        "force_tolerance": 0.01,
        "force_quiet_samples": 1000.0,
        "force_range": _NO_LIMIT,
        "hold_damping": 1.0,
        "hold_limit": 1.0,
    },
    "unexplained_energy": {
        **_UNCHECKED_LAW,
        **_BODY_NUMBERS,
        "force_expected": 1.0,
        "force_quiet_samples": 1000.0,
        "force_range": _NO_LIMIT,
        "unexplained_limit": 1e-6,
        "unexplained_gain": 0.0,
        "unexplained_offset": 0.0,
    },
    "energy": {
        **_UNCHECKED_LAW,
        **_BODY_NUMBERS,
        "budget_store": 1e-6,
        "budget_power": 0.0,
        "hold_damping": 1.0,
        "hold_limit": 1.0,
    },
    "push": {**_UNCHECKED_LAW, "push_limit": 1e-6},
    "power": {**_UNCHECKED_LAW, "power_limit": 1e-6},
    "ringing": {**_UNCHECKED_LAW, "ringing_limit": 1e-4},
    "shaking": {**_UNCHECKED_LAW, "shaking_limit": 1e-4},
    "lost": {
        **_UNCHECKED_LAW,
        "force_expected": 1.0,
        "force_range": _NO_LIMIT,
        "force_quiet_samples": 3.0,
        "degrades": 1.0,
    },
    "muscle": {**_UNCHECKED_LAW, "muscle_expected": 1.0, "muscle_range": 1e-3},
    "test": {
        **_UNCHECKED_LAW,
        "test_effort": 0.5,
        "test_samples": 8.0,
        "test_rest": 4.0,
        "test_least": 1e-9,
        "test_most": 1e-6,
    },
    # All checks of a robot with encoder, force sensor and current sensor run here and none trips, to count a step's
    # instructions.
    "counted": {
        **_UNCHECKED_LAW,
        **_BODY_NUMBERS,
        "force_expected": 1.0,
        "force_range": _NO_LIMIT,
        "force_quiet_samples": 1e6,
        "unexplained_limit": 1e6,
        "drive_expected": 1.0,
        "drive_tolerance": _NO_LIMIT,
    },
}
"""Configurations of the supervisor that stretches of the test vector are played with, by name."""


@dataclass
class Reading:
    """One sensor's sample."""

    value: np.float32  # measured value
    sequence: int  # number of the sample
    time: int  # time of the sample [us]
    valid: int = 1  # 1 for a valid sample, else 0


def float_bits(value: float | np.float32) -> str:
    """Return the bits of a number in single precision as a C literal."""
    return f"0x{int(np.float32(value).view(np.uint32)):08x}u"


@dataclass(frozen=True)
class StepInputs:
    """Inputs of one step of the controller."""

    now: int  # time of the step [us]
    read: tuple[Reading, ...]  # samples of the law's sensors
    before: int = NO_EVENT  # code of the event before the step
    token: int = 0  # 1 if the challenge is answered
    drive: float = 0.0  # difference between the drive's measurement and the last effort [N m]

    @property
    def numbers(self) -> tuple[float, ...]:
        """Numbers beside the samples."""
        return (self.drive,)

    @property
    def text(self) -> str:
        """The inputs as a C initialiser."""
        numbers = "".join(f"{float_bits(number)}, " for number in self.numbers)
        made = ", ".join(
            f"{{{float_bits(s.value)}, {s.sequence & 0xFFFFFFFF}u, {s.time}, {s.valid}u}}" for s in self.read
        )
        return f"{{{self.before}u, {self.token}u, {numbers}{self.now}, {{{made}}}}}"


class InputsOfStep(Protocol):
    """Inputs of one step of any controller."""

    @property
    def text(self) -> str:
        """The inputs as a C initialiser."""


@dataclass(frozen=True)
class ReplayVector:
    """Inputs of all steps; the motion comes first."""

    steps: tuple[InputsOfStep, ...]
    motion: int  # number of steps of the motion

    @property
    def rows(self) -> tuple[str, ...]:
        """One C initialiser for each step."""
        return tuple(row.text for row in self.steps)


Inputs = TypeVar("Inputs", bound=StepInputs)


@dataclass(frozen=True)
class Block(Generic[Inputs]):
    """A stretch of steps after a power-on."""

    variant: str  # configuration among those that the vector is played with
    # Function that returns the faulty inputs of a step, from its number and its sound inputs
    wrong: Callable[[int, Inputs], Inputs] = field(default=lambda i, row: row)
    length: int = FAULT_STEPS  # number of steps


def assembled(
    row: Callable[[int], Inputs], blocks: Iterable[Block[Inputs]], variants: Iterable[str],
    optional: Sequence[int] = (),
) -> ReplayVector:  # fmt: skip
    """Return a motion, then each block of faults.

    `row` gives the sound inputs of a step by its number. In the motion one sample is repeated, one is lost, and the
    samples with the indices `optional` are not valid for a quarter of it. `variants` are the configurations, in order.
    """
    steps = []
    for i in range(MOTION_STEPS):
        made = row(i)
        if i == MOTION_STEPS // 4:  # the sample before is repeated
            made = replace(made, read=row(i - 1).read)
        if MOTION_STEPS // 2 <= i < 3 * MOTION_STEPS // 4:
            for k in optional:
                made.read[k].valid = 0
        if i == MOTION_STEPS // 3:  # a control period is missed, with its sample and its step
            continue
        steps.append(replace(made, before=POWER_ON_EVENT) if i == 0 else made)
    motion, places = len(steps), list(variants)
    for block in blocks:
        at = POWER_ON_EVENT + places.index(block.variant)
        for i in range(block.length):
            made = block.wrong(i, row(i))
            steps.append(replace(made, before=at) if i == 0 else made)
    return ReplayVector(tuple(steps), motion)


def replay_vector(values: ControllerValues, seed: int = 1) -> ReplayVector:
    """Return a motion with a repeated sample, a lost one and optional sensors that come and go, then every fault."""
    sensors = LAWS[values.law].sensors
    period = round(1e6 * values.numbers["period"])
    rng = np.random.default_rng(seed)
    blocks = list(_blocks(sensors, values, period))
    steps = max(MOTION_STEPS, *(block.length for block in blocks))
    signals = [_signal(s, values, steps, rng) for s in sensors]

    def row(i: int, start: int = 1_000_000) -> StepInputs:
        now = start + i * period
        return StepInputs(now, tuple(Reading(x[i], 0xFFFFFF00 + i & 0xFFFFFFFF, now - period // 10) for x in signals))

    optional = [k for k, sensor in enumerate(sensors) if not sensor.required]
    return assembled(row, blocks, SUPERVISOR_VARIANTS, optional)


def _signal(sensor: LawSensor, values: ControllerValues, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return two sines with noise, shape (n,) float32, no faster than the recordings of the model."""
    t = np.arange(n) * values.numbers["period"]
    # The amplitude follows from the motion's angular frequency and the largest speed.
    rate = 2 * np.pi * 4.0 / t[-1]
    swing = sensor.swing
    if sensor.name == "position":
        limit = min(values.speed, values.numbers["velocity_limit"])
        swing = min(sensor.swing, 0.4 * limit / rate)
    x = swing * (np.sin(rate * t + 0.3) + 0.2 * np.sin(2.3 * rate * t))
    noise = sensor.noise * swing / sensor.swing
    return (np.round((x + noise * rng.standard_normal(n)) / noise) * noise).astype(np.float32)


def _blocks(sensors: tuple[LawSensor, ...], values: ControllerValues, period: int) -> Iterator[Block]:
    """Yield every fault of the law's inputs, of its safety gate and of the supervisor, and attempts to end a fault."""
    too_long = round(1e6 * values.numbers["max_age"]) + 10 * period

    def at_end(change: Callable[[StepInputs], StepInputs]) -> Block:
        return Block("law", lambda i, row: change(row) if i == FAULT_STEPS - 2 else row)

    def value(x: float) -> Block:
        def wrong(row: StepInputs) -> StepInputs:
            for s, sensor in zip(row.read, sensors, strict=True):
                if sensor.required:
                    s.value = np.float32(x)
            return row

        return at_end(wrong)

    def first(**change: int) -> Block:
        def wrong(row: StepInputs) -> StepInputs:
            for name, by in change.items():
                setattr(row.read[0], name, getattr(row.read[0], name) + by)
            return row

        return at_end(wrong)

    def placed(variant: str, place: Callable[[int], float], length: int = FAULT_STEPS) -> Block:
        """Return a block in which the position is a function of the step's number."""

        def wrong(i: int, row: StepInputs) -> StepInputs:
            row.read[0].value = np.float32(place(i))
            return row

        return Block(variant, wrong, length)

    def driven(by: Callable[[int], float]) -> Block:
        return Block("drive", lambda i, row: replace(row, drive=by(i)) if i > 12 else row, 24)

    def answered(size: float) -> Block:
        return Block("late", lambda i, row: replace(row, drive=size * float(np.sin(0.4 * i))), 60)

    h = 1e-6 * period
    jump = 2e3 * values.numbers["velocity_limit"] * values.numbers["period"]
    yield from (value(np.nan), value(np.inf), value(-np.inf), value(float(np.float32(jump))))
    yield from (first(valid=-1), first(time=-(10**6)), first(time=10**6), first(sequence=-20))
    yield at_end(lambda row: replace(row, now=row.now + too_long))
    yield at_end(lambda row: replace(row, before=STOP_EVENT))
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
    yield Block("surplus", lambda i, row: replace(row, drive=4.0), 60)
    # One of the two answers seems late, its opposite seems early.
    yield from (answered(4.0), answered(-4.0))
    yield Block("unexplained", length=60)
    yield Block("force", length=60)
    yield Block("unexplained_energy", length=60)
    yield Block("energy", length=60)
    yield Block("push", length=24)
    yield Block("ringing", length=60)
    yield placed("power", lambda i: 0.3 + 1.0 * h * i, 24)
    yield placed("shaking", lambda i: 0.5 + 5e-4 * float(np.sin(0.4 * i)), 60)

    def silent(i: int, row: StepInputs) -> StepInputs:
        for s in row.read[1:]:
            s.valid = int(i < 6)
        return row

    yield Block("lost", silent, 24)
    yield Block("muscle", length=24)
    yield placed("test", lambda i: 0.5, 32)
    yield placed("test", lambda i: 0.5 + 0.2 * h * max(i - 6, 0), 96)  # three waves
    # The supervisor checks twelve words of memory in every fourth period: this is enough to check all of them twice.
    through = 4 * -(-_core.supervised_storage(values.law) // (4 * 8))
    yield Block("law", lambda i, row: replace(row, before=MEMORY_EVENT) if i == 4 else row, 4 + through)
    # The controller is stopped. Initialising it again does not end the stop, but a token does.
    late = max(30, round(0.02 / h) + 14)

    def mended(i: int, row: StepInputs) -> StepInputs:
        what = {4: STOP_EVENT, 8: INIT_EVENT}.get(i, NO_EVENT)
        return replace(row, before=what, token=int(i >= 12))

    yield Block("law", mended, late + 20)
