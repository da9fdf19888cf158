"""Joints of MuJoCo and Pinocchio, plain or with one fault: is its cause named, is gravity covered, is a name false?

The faults are of the simulated mechanism or of its instruments, and none is written as Pellucid's columns are. A
parallel spring is MuJoCo's own joint stiffness, or a torque on Pinocchio's arm. Backlash is a rotor and a link, two
bodies that MuJoCo's soft limits hold together across a gap. A drift is a gain that changes as an amplifier warms up,
and an offset that wanders. A clipped sensor reads no more than a limit, before its noise or after it. Reference,
controller, encoder and torque sensor are those of `_foreign_joint.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import pellucid as pl
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

from ._foreign_joint import GRAVITY, ForeignJoint
from ._foreign_plants import STEP_S, Advance, Sines, advance_in_mujoco, drawn_plants, follow, plant

SEED = 20261129
"""Seed of every random draw. Thresholds were set on other seeds."""

SPRING_COUNT = sized(24, smallest=2)
"""Number of joints with a parallel spring."""

PLAIN_COUNT = sized(48, smallest=4)
"""Number of plain joints."""

SPOILT_COUNT = sized(48, smallest=4)
"""Number of joints with one fault."""

DURATION_S = 30.0
"""Duration of a recording [s]."""

LOWPASS_HZ = 10.0
"""Cut-off of the low-pass [Hz]."""

SPRING_SHARE = (0.04, 0.2)
"""Stiffness of drawn springs as a share of gravity per radian."""

FAULTS = ("drift", "backlash", "parallel_spring", "saturation")
"""Names of the faults, which joints have in turn."""

ALSO_NAMED = {"drift": ("drift", "warm_up")}
"""Names of causes that are right for a fault; the fault's own if there is no entry."""


@dataclass(frozen=True)
class Trial:
    """What a fit says of one joint."""

    fault: str  # name of the fault; empty for a plain joint
    named: tuple[str, ...]  # names of the causes that the fit names
    covers_gravity: bool  # whether the interval of gravity contains the true one

    @property
    def is_right(self) -> bool:
        """Whether the fault is among the names."""
        return bool(set(self.named) & set(ALSO_NAMED.get(self.fault, (self.fault,))))

    @property
    def false_names(self) -> tuple[str, ...]:
        """Names of causes that the joint does not have."""
        return tuple(name for name in self.named if name not in ALSO_NAMED.get(self.fault, (self.fault,)))


def cause_rows() -> Iterator[ResultRow]:
    """Every figure of the causes."""
    springs = [try_joint("parallel_spring", [SEED, 1, i]) for i in range(SPRING_COUNT)]
    plain = [try_joint("", [SEED, 2, i]) for i in range(PLAIN_COUNT)]
    spoilt = [try_joint(FAULTS[i % len(FAULTS)], [SEED, 3, i]) for i in range(SPOILT_COUNT)]

    def row(name: str, value: float, unit: str, note: str) -> ResultRow:
        return ResultRow(f"identification.{name}", float(value), unit, "evidence", "fitted", None, note)

    def share(of: list[bool]) -> float:
        return 100.0 * float(np.mean(of))

    covered = share([t.covers_gravity for t in springs])
    yield row("spring.gravity_covered", covered, "%", "joints with a parallel spring whose interval of gravity covers")
    yield row("spring.named", share([t.is_right for t in springs]), "%", "of them, those whose spring is named")
    falsely = share(["parallel_spring" in t.named for t in plain])
    yield row("spring.false", falsely, "%", "plain joints with a spring named")
    yield row("spring.joints", len(springs), "1", "joints with a parallel spring, of MuJoCo and Pinocchio in turn")
    yield row("spring.plain", len(plain), "1", "plain joints, of MuJoCo and Pinocchio in turn")
    of_plain = share([t.covers_gravity for t in plain])
    yield row("spring.plain_covered", of_plain, "%", "plain joints whose interval of gravity covers")
    by_fault = "; ".join(
        f"{fault} {sum(t.is_right for t in spoilt if t.fault == fault)} of {sum(t.fault == fault for t in spoilt)}"
        for fault in FAULTS
    )
    yield row("causes.named", share([t.is_right for t in spoilt]), "%", f"spoilt joints by fault: {by_fault}")
    names = [name for t in plain for name in t.named]
    said = ", ".join(f"{name} {names.count(name)}" for name in dict.fromkeys(names)) or "none"
    yield row("causes.false", share([bool(t.named) for t in plain]), "%", f"plain joints with any name: {said}")
    beside = [name for t in spoilt for name in t.false_names]
    said = ", ".join(f"{name} {beside.count(name)}" for name in dict.fromkeys(beside)) or "none"
    yield row("causes.beside", share([bool(t.false_names) for t in spoilt]), "%", f"spoilt joints with another: {said}")
    yield row("causes.joints", len(spoilt), "1", "joints with one fault")


def try_joint(fault: str, seed: list[int]) -> Trial:
    """Record and identify one joint with a fault, or a plain one."""
    rng = np.random.default_rng(seed)
    engine, joint = drawn_plants(rng, 2)[seed[-1] // len(FAULTS) % 2 if fault in FAULTS else seed[-1] % 2]
    table = record_fault(engine, joint, fault, rng)
    try:
        fit = pl.fit_joint(*table.T, lowpass=LOWPASS_HZ, decimate=12, dead_band=0.02, thorough=False)
    except pl.PellucidError as error:
        # Much clipping is refused, and the message names it.
        return Trial(fault, ("saturation",) if "clipped" in str(error) else (), False)
    low, high = fit["gravity"].interval(0.95)
    return Trial(fault, tuple(cause.name for cause in fit.causes), bool(low <= joint.gravity <= high))


def record_fault(engine: str, joint: ForeignJoint, fault: str, rng: np.random.Generator) -> np.ndarray:
    """Return time, position and torque, (n, 3), of a joint with one fault."""
    sines = Sines.drawn(rng)
    start = sines.at(0.0)
    stiffness, slack = joint.gravity * float(rng.uniform(*SPRING_SHARE)), float(rng.uniform(-0.3, 0.3))
    beside: Callable[[float], float] = lambda q: 0.0  # noqa: E731
    if fault == "backlash":
        advance = _geared_link(joint, float(rng.uniform(0.01, 0.04)), *start)
    elif fault == "parallel_spring" and engine == "mujoco":
        advance = _sprung_joint(joint, stiffness, slack, *start)
    else:
        advance = plant(engine, joint, *start)
        if fault == "parallel_spring":
            beside = lambda q: stiffness * (q - slack)  # noqa: E731
    time, rows = follow(joint, sines, advance, DURATION_S, beside)
    n = len(time)
    noise = joint.torque_noise * max(joint.coulomb, 0.1 * joint.gravity)
    rows[:, 0] += joint.position_noise * rng.standard_normal(n)
    white = noise * rng.standard_normal(n)
    if fault == "drift":
        warmth = 1.0 - np.exp(-time / (DURATION_S * rng.uniform(0.3, 1.0)))
        gain = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.2) * warmth
        rows[:, 1] = gain * rows[:, 1] + rng.uniform(-0.1, 0.1) * joint.gravity * warmth
    if fault == "saturation":
        rows[:, 1] += white if rng.random() < 0.5 else 0.0
        limit = float(np.quantile(np.abs(rows[:, 1]), rng.uniform(0.85, 0.97)))
        rows[:, 1] = np.clip(rows[:, 1], -limit, limit)
    else:
        rows[:, 1] += white
    return np.column_stack([time, rows])


def _sprung_joint(joint: ForeignJoint, stiffness: float, slack: float, q: float, v: float) -> Advance:
    """Return MuJoCo's hinge with a spring of its own, slack at an angle."""
    return _mujoco_hinge(joint, q, v, f'stiffness="{stiffness}" springref="{np.degrees(slack)}"')


def _mujoco_hinge(joint: ForeignJoint, q: float, v: float, spring: str) -> Advance:
    mass, distance, left = _body(joint, joint.inertia)
    return advance_in_mujoco(f"""
<mujoco><option timestep="{STEP_S}" gravity="0 0 -{GRAVITY}" integrator="implicitfast"/>
<worldbody><body><joint name="hinge" axis="0 1 0" damping="{joint.viscous}" frictionloss="{joint.coulomb}" {spring}/>
<inertial pos="0 0 -{distance}" mass="{mass}" diaginertia="{left} {left} {left}"/></body></worldbody>
<actuator><motor joint="hinge"/></actuator></mujoco>""", q, v)


def _geared_link(joint: ForeignJoint, gap: float, q: float, v: float) -> Advance:
    """Return a rotor, which the encoder reads, and a link that a gap [rad] separates from it."""
    rotor = 0.3 * joint.inertia
    mass, distance, left = _body(joint, joint.inertia - rotor)
    return advance_in_mujoco(f"""
<mujoco><compiler angle="radian"/>
<option timestep="{STEP_S}" gravity="0 0 -{GRAVITY}" integrator="implicitfast"/>
<worldbody><body><joint name="rotor" axis="0 1 0" damping="{0.7 * joint.viscous}" frictionloss="{0.7 * joint.coulomb}"/>
<inertial pos="0 0 0" mass="0.1" diaginertia="{rotor} {rotor} {rotor}"/>
<body><joint name="link" axis="0 1 0" damping="{0.05 * joint.viscous}" limited="true" range="{-0.5 * gap} {0.5 * gap}"
  solreflimit="0.002 1"/>
<inertial pos="0 0 -{distance}" mass="{mass}" diaginertia="{left} {left} {left}"/></body></body></worldbody>
<actuator><motor joint="rotor"/></actuator></mujoco>""", q, v)


def _body(joint: ForeignJoint, inertia: float) -> tuple[float, float, float]:
    """Return mass, distance and inertia about the centre of a body with the joint's weight and an inertia [kg*m^2]."""
    weight = joint.gravity / GRAVITY
    distance = 0.5 * inertia / weight
    mass = weight / distance
    return mass, distance, inertia - mass * distance**2
