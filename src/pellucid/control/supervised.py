"""A law under the core's supervisor: limits of raw data, sensors, drive, energy and memory, by rules stated here.

Every threshold follows from the law's own numbers (the card's body, the limits) and the specification of the sensors.
The constants below were chosen on robots and wearers that the fault table is not judged on: those of false alarms are
what let all of these live without one, and a fifth more, but for the force sensor's gain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import _core
from .._errors import PellucidError
from ..models.fields import model_fields
from .control_law import ControlLaw
from .elbow_laws import LOOP_BANDWIDTH

ALONE = 0.1
"""Of the inertia, what the drive may speed up alone, behind its transmission [1]."""

RANGE_MARGIN = 0.15
"""Beyond a stop of the law, which a wearer may overrun where the machine has none [rad or m]."""

HARDEST_STOP = 500.0
"""Of a joint in somebody's grip [rad/s^2 or m/s^2]."""

FREEZE, QUIET, TEST, REST = 0.02, 0.05, 0.032, 0.1
"""How long a value must not change to be a frozen encoder's and a silent sensor's; half a wave of the test, and the
rest before it [s]."""

WEARER_TORQUE, WEARER_PUSH = 0.15, 0.8
"""The most that a wearer gives a robot that is carried, lastingly and at once, of the law's limit of effort [1]."""

FORCE_TOLERANCE, FORCE_BURST, FORCE_EXCESS, LEFT_SHARE = 0.066, 0.66, 0.022, 0.2
"""By which a force sensor may differ from model and motion: lastingly, at once, by its gain, of the
law's limit of effort; and of the weight that the wearer carries [1]."""

DRIVE_TOLERANCE = 0.05
"""Of what a drive gives, of the law's limit of effort [1]."""

DRIVE_SURPLUS = 0.005
"""That a drive may give beyond what it was asked for: a way, under the law's limit of effort [rad or m]."""

TEST_ACCELERATION = 30.0
"""Of the wave of the test, beyond friction [rad/s^2 or m/s^2]."""

TEST_LEAST, TEST_MOST = 0.1, 2.2
"""Of the work that a wave does by its middle on the robot alone: with an arm on it it moves less [1]."""

ANSWERS = (0.2, 1.8)
"""Of the work that the wave did when the robot was commissioned, on whomever wears it [1]."""

RINGING = 0.115
"""Mean size of what the effort may do faster than people move, of the law's limit of effort [1]."""

STORE_SPEED, STORE_LIFT = 0.575, 0.66
"""Of the velocity limit, whose kinetic energy in robot and limb is what a command may give beyond its due [1]; and by
how far it may lift what the wearer carries [rad or m]."""

BUDGET_POWER = 0.01
"""That a command may give beyond its due all the time, of effort times velocity at their limits [1]."""

HOLD = 0.05
"""Damping of a stop, of what would halve the velocity in two periods [1]."""

SUPERVISOR_NAMES: tuple[str, ...] = tuple(field.name for field in model_fields("supervisor"))
"""The supervisor's numbers, in the core's order."""


@dataclass(frozen=True)
class Instruments:
    """What a robot measures beside what its law reads, and how well."""

    encoder_resolution: float = 4e-4  # Error of one reading [rad or m]
    joint_encoder: bool = False  # Whether there is a second one, behind the transmission
    joint_tolerance: float = 0.05  # By which the two may differ while all is well: twist and backlash [rad or m]
    drive: bool = False  # Whether the drive measures its current or torque
    drive_limit: float = math.inf  # The most that it can give [N m or N]
    force_range: float = math.inf  # Of the force sensor [N m or N]
    emg_range: float = 40.0  # Largest torque that the EMG calibration knows [N m]


@dataclass(frozen=True)
class SupervisedLaw:
    """A law with a supervisor; what `supervised` gives, virtual people wear and `export` writes.

    Attributes
    ----------
    law : ControlLaw
        What it watches.
    supervision : mapping of str to float
        The supervisor's numbers by name, SI.

    Examples
    --------
    >>> import pellucid as pl
    >>> from pellucid.control.control_law import LAWS, ControlLaw
    >>> law = ControlLaw("joint", LAWS["joint"].defaults | {
    ...     "inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0,
    ...     "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": 0.001})
    >>> safe = pl.supervised(law, start_up=False)
    >>> efforts = [safe.step(0.001 * i, 0.5) for i in range(100)]
    >>> round(efforts[-1], 3), safe.mode
    (0.719, 'running')
    >>> _ = safe.step(0.1, 2.5)
    >>> safe.fault, safe.enable
    ('jump', False)
    """

    law: ControlLaw
    supervision: Mapping[str, float]

    def __post_init__(self):
        if set(self.supervision) != set(SUPERVISOR_NAMES):
            wrong = sorted(set(self.supervision) ^ set(SUPERVISOR_NAMES))
            raise PellucidError(f"supervisor: found no number, or one too many, for {', '.join(wrong)}")

    @property
    def kind(self) -> str:
        """Of the law, one of `LAWS`."""
        return self.law.kind

    @property
    def parameters(self) -> np.ndarray:
        """Of the law, shape (k,), in the core's order."""
        return self.law.parameters

    @property
    def supervisor(self) -> np.ndarray:
        """The supervisor's numbers, shape (m,), in the core's order."""
        return np.array([self.supervision[name] for name in SUPERVISOR_NAMES])

    @property
    def values(self) -> Mapping[str, float]:
        """The law's numbers by name, SI."""
        return self.law.values

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of what `step` takes after the time, in order."""
        return self.law.sensors

    @property
    def sensed(self) -> bool:
        """Whether the law makes use of a force sensor."""
        return self.law.sensed

    @property
    def emg(self) -> bool:
        """Whether the law makes use of EMG."""
        return self.law.emg

    def changed(self, **supervision: float) -> SupervisedLaw:
        """The same law under a supervisor some of whose numbers are others, at rest.

        Parameters
        ----------
        **supervision : float
            By name, SI.

        Returns
        -------
        SupervisedLaw

        Raises
        ------
        PellucidError
            If the supervisor has no such number.
        """
        return replace(self, supervision={**self.supervision, **supervision})

    def start(self, *, single: bool = False) -> _core.Supervised:
        """One more of it at rest, to be stepped by itself; `single` in float32, as on a microcontroller."""
        return _core.supervised(self.kind, self.parameters, self.supervisor, single)

    @cached_property
    def _running(self) -> _core.Supervised:
        return self.start()

    def step(
        self,
        time: float,
        *samples: float | None,
        drive: float | None = None,
        joint: float | None = None,
        token: int = 0,
    ) -> float:
        """One control period.

        Parameters
        ----------
        time : float
            When everything was measured [s].
        *samples : float or None
            In the order of `sensors`, SI; None, NaN or left out: the sensor says nothing.
        drive, joint : float or None
            The effort that the drive measures [N m, or N], and a second encoder at the joint [rad, or m].
        token : int
            The `challenge`, from an operator who asks for a reset; 0: nobody asks.

        Returns
        -------
        float
            Effort for the drive [N m, or N]; it must have no power unless `enable`.
        """
        return self._running.step(time, *samples, drive=drive, joint=joint, token=token)

    def stop(self) -> None:
        """From the next step on it stops, and stays stopped until a reset."""
        self._running.stop()

    @property
    def fault(self) -> str:
        """Why it stopped or goes on with less; "none" while all is well."""
        return self._running.fault

    @property
    def mode(self) -> str:
        """What it does: "start_up", "running", "degraded", "damped_stop", "zero" or "latched"."""
        return self._running.mode

    @property
    def enable(self) -> bool:
        """Whether the drive may have power."""
        return self._running.enable

    @property
    def challenge(self) -> int:
        """What a reset needs as its token; 0 while all is well."""
        return self._running.challenge

    @property
    def log(self) -> list[tuple[int, str, str]]:
        """The last faults, the latest first: period, fault, and what was then done."""
        return self._running.log


def supervised(
    law: ControlLaw,
    *,
    instruments: Instruments | None = None,
    body: Mapping[str, float] | None = None,
    start_up: bool = True,
    answer: float | None = None,
    **supervision: float,
) -> SupervisedLaw:
    """A law under a supervisor whose thresholds follow from the law's body and limits, and from its sensors.

    While all is well the law's effort passes to the bit. A single fault of sensor, drive, wearer, clock or memory is
    answered by a law without the lost sensor, by a damped stop, or by no effort and no power (see docs/safety.md).

    Parameters
    ----------
    law : ControlLaw
        Of `controller`.
    instruments : Instruments or None
        What the robot measures beside; None: nothing, and encoders of ordinary resolution.
    body : mapping of str to float or None
        The robot alone: inertia, gravity_sine, gravity_cosine, offset, coulomb, load, viscous, SI; None: what the law's
        own numbers say of it. An inertia of 0 leaves out what needs a model.
    start_up : bool
        Whether polarity and gain are tested at first, by a small wave of effort.
    answer : float or None
        The work of that wave when the robot was commissioned, with a drive known to be right [J]; None: bounds that
        any robot keeps, between which a gain may be wrong by up to three.
    **supervision : float
        Numbers of the supervisor to be others than the rules make them, by name, SI.

    Returns
    -------
    SupervisedLaw
        At rest.

    Raises
    ------
    PellucidError
        If the supervisor has no such number.

    Examples
    --------
    >>> import pellucid as pl
    >>> from pellucid.control.control_law import LAWS, ControlLaw
    >>> law = ControlLaw("joint", LAWS["joint"].defaults | {
    ...     "inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0,
    ...     "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": 0.001})
    >>> safe = pl.supervised(law)
    >>> safe.supervision["raw_speed_limit"]
    10.0
    """
    made = supervision_of(law, instruments or Instruments(), dict(body_of(law) if body is None else body), start_up)
    if answer is not None:
        made |= {"test_least": ANSWERS[0] * answer, "test_most": ANSWERS[1] * answer}
    return SupervisedLaw(law, made).changed(**supervision)


def body_of(law: ControlLaw) -> dict[str, float]:
    """The robot alone as a law's numbers have it, SI: inertia, gravity_sine, gravity_cosine, offset, coulomb, load,
    viscous; what they do not say is 0."""
    v = law.values

    def largest(*names: str) -> float:
        return max((abs(v[name]) for name in names if name in v), default=0.0)

    def mean(name: str) -> float:
        both = [v[n] for n in (name, f"{name}_up", f"{name}_down", f"orthosis_{name}") if n in v]
        return sum(both) / len(both) if both else 0.0

    gravity = "orthosis_gravity" if "orthosis_gravity" in v else None
    # A loop's stiffness is inertia times bandwidth squared where there is nothing else that tells of the inertia.
    inertia = max(mean("inertia"), 0.0) or v.get("stiffness", 0.0) / LOOP_BANDWIDTH**2
    return {
        "inertia": inertia + v.get("actuator_inertia", 0.0),
        "gravity_sine": v[gravity] if gravity else mean("gravity_sine"),
        "gravity_cosine": mean("gravity_cosine"),
        "offset": v.get("offset", 0.0),
        "coulomb": largest("coulomb", "coulomb_positive", "coulomb_negative", "coulomb_up", "coulomb_down")
        + v.get("stribeck", 0.0) + v.get("actuator_coulomb", 0.0),
        "load": min(largest("load_motoring", "load_generating"), 1.0),
        "viscous": largest("viscous_positive", "viscous_negative", "viscous_up", "viscous_down", "orthosis_viscous")
        + v.get("actuator_viscous", 0.0),
    }  # fmt: skip


def supervision_of(
    law: ControlLaw, instruments: Instruments, body: Mapping[str, float], start_up: bool
) -> dict[str, float]:
    """The supervisor's numbers by name, SI, by the rules of this file."""
    v, known = law.values, {field.name: field.default for field in model_fields("supervisor")}
    period, effort, speed = v["period"], v["effort_limit"], v["velocity_limit"]
    inertia = body["inertia"]
    weight = math.hypot(body["gravity_sine"], body["gravity_cosine"]) + abs(body["offset"])
    friction = body["coulomb"] + body["load"] * weight
    left = (1.0 - v.get("gravity_share", 1.0)) * weight  # of the weight, which the wearer carries
    samples = max(8, min(200, round(TEST / period)))
    made = {
        "raw_speed_limit": speed,
        "range_min": v["position_min"] - RANGE_MARGIN,
        "range_max": v["position_max"] + RANGE_MARGIN,
        "encoder_resolution": instruments.encoder_resolution,
        "freeze_speed": HARDEST_STOP * period,
        "freeze_samples": max(2.0, round(FREEZE / period)),
        "joint_expected": float(instruments.joint_encoder),
        "joint_tolerance": instruments.joint_tolerance,
        **{f"body_{name}": value for name, value in body.items()},
        "residual_bandwidth": min(known["residual_bandwidth"], 0.2 / period),
        "residual_slow": min(known["residual_slow"], 0.05 / period),
        "force_expected": float(law.sensed),
        "force_range": instruments.force_range,
        "force_quiet_samples": max(2.0, round(QUIET / period)),
        "muscle_expected": float(law.emg),
        "muscle_range": instruments.emg_range,
        "muscle_quiet_samples": max(2.0, round(QUIET / period)),
        "drive_expected": float(instruments.drive),
        "drive_tolerance": DRIVE_TOLERANCE * effort,
        "drive_limit": instruments.drive_limit,
        "drive_surplus": DRIVE_SURPLUS * effort,
        "push_limit": effort,
        "ringing_limit": RINGING * effort,
        **{f"ringing_{name}": min(known[f"ringing_{name}"], 0.2 / period) for name in ("slowest", "fastest", "memory")},
        "power_limit": effort * speed / 2.0,
        "budget_power": BUDGET_POWER * effort * speed if math.isfinite(speed) else 0.0,
        "test_rest": max(2.0, round(REST / period)),
        "degrades": float(v.get("gravity_share", 1.0) > 0.5),
    }
    if inertia > 0.0:
        pushed = friction + TEST_ACCELERATION * inertia
        answer = 2.0 * (pushed * samples * period / math.pi) ** 2 / inertia
        made |= {
            "raw_acceleration_limit": effort / (ALONE * inertia),
            "wearer_torque": WEARER_TORQUE * effort + left,
            "wearer_push": WEARER_PUSH * effort + left,
            "force_tolerance": FORCE_TOLERANCE * effort + LEFT_SHARE * left,
            "budget_store": inertia * (STORE_SPEED * speed) ** 2 + STORE_LIFT * left
            if math.isfinite(speed)
            else math.inf,
            "force_burst": FORCE_BURST * effort + LEFT_SHARE * left,
            "force_excess": FORCE_EXCESS * effort,
            "hold_damping": HOLD * inertia / period,
            "hold_limit": min(effort, 1.5 * weight + friction),
            "test_effort": min(pushed, effort) if start_up else 0.0,
            "test_samples": float(samples),
            "test_least": TEST_LEAST * answer,
            "test_most": TEST_MOST * answer,
        }
    return known | {name: float(value) for name, value in made.items()}
