"""A control law of the core with its numbers: stepped here as it is worn in the lab and exported to a robot.

What a controller may ask for.

A law among nonsense, and how long a step of it takes.

Faults of a drive that a supervisor does not find if the drive does not measure its own effort.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import _core
from .._errors import PellucidError
from ..models.anthropometry import Segment
from ..models.fields import Field, fields_from_core, model_fields, unit_of

SPRING_SENSOR = "torque"
"""Name of the sensor of a spring's torque on the robot, in the core's ``law.hpp``."""


@dataclass(frozen=True)
class LawSensor:
    """What a law reads each period: `required` or the law goes on with less; `swing`, `noise` are what tests play."""

    name: str
    dimension: tuple[int, int, int]
    meaning: str
    required: bool
    swing: float
    noise: float

    def unit(self, motion: str = "rotary", effort_unit: str = "N*m") -> str:
        """SI unit as plain text."""
        return unit_of(self.dimension, motion, effort_unit)


@dataclass(frozen=True)
class LawKind:
    """A law of the core's list as the core describes it: `type` in C++, `storage` [bytes] in float on any machine."""

    name: str
    type: str
    title: str
    sensors: tuple[LawSensor, ...]
    fields: tuple[Field, ...]
    storage: int

    @property
    def header(self) -> str:
        """File name of the core's header that has it."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", self.type).lower() + ".hpp"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its numbers, in the core's order."""
        return tuple(field.name for field in self.fields)

    @property
    def defaults(self) -> dict[str, float]:
        """By name, SI: what holds where nothing else is said; 0 where something must be."""
        return {field.name: field.default for field in self.fields}

    @property
    def optional_sensors(self) -> tuple[str, ...]:
        """Names of the sensors that it can do without, in order."""
        return tuple(sensor.name for sensor in self.sensors if not sensor.required)

    @property
    def drives_spring(self) -> bool:
        """Whether its effort is the torque of a spring on what is worn, which it then measures."""
        return any(sensor.name == SPRING_SENSOR for sensor in self.sensors)

    @property
    def carries_body(self) -> bool:
        """Whether its numbers include those of the core's joint, so that it carries one coherent body."""
        return {field.name for field in model_fields("joint")} <= set(self.parameters)


LAWS: Mapping[str, LawKind] = {
    law["name"]: LawKind(
        **law
        | {
            "sensors": tuple(LawSensor(**sensor) for sensor in law["sensors"]),
            "fields": fields_from_core(law["fields"]),
        }
    )
    for law in _core.laws()
}
"""Every law of the core, by name."""

JOINT_LAW = LAWS["joint"]
WORN_LAW = LAWS["worn"]
POSITION_PREDICTION_LAW = LAWS["position_prediction"]
DIRECTIONAL_LAW = LAWS["directional"]
RULES_LAW = LAWS["rules"]
TRANSPARENT_LAW = LAWS["transparent"]


@dataclass(frozen=True)
class ControlLaw:
    """A law of the core with its numbers; what `controller` gives.

    What goes out has passed the safety gate: finite and within its limits, whatever comes in. A fault latches, and the
    effort ramps to 0 until `reset`.

    Attributes
    ----------
    kind : str
        One of `LAWS`.
    values : mapping of str to float
        Every number by name, SI.
    uses : frozenset of str
        Of its optional sensors, those that these numbers make use of.
    load : Segment or None
        Load that is fastened to the robot and contained in the numbers, so that the supervisor expects it, too.
    supported : float
        Weight of limb and held load that the numbers carry beyond the robot's own, held out horizontally [N m]. The
        wearer leans on the robot with it.
    unstated : float
        Largest weight that may be fastened to the robot beyond what the numbers contain, held out horizontally [N m].
        The supervisor allows the force sensor as much contradiction.

    Examples
    --------
    >>> from pellucid.controllers.control_law import LAWS, ControlLaw
    >>> law = ControlLaw("joint", LAWS["joint"].defaults | {
    ...     "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0,
    ...     "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": 0.001})
    >>> effort = [law.step(0.001 * i, 0.5) for i in range(100)]
    >>> round(effort[-1], 3)
    0.719
    >>> law.fault
    'none'
    """

    kind: str
    values: Mapping[str, float]
    uses: frozenset[str] = frozenset()
    load: Segment | None = None
    supported: float = 0.0
    unstated: float = 0.0

    def __post_init__(self):
        known = LAWS[self.kind].parameters
        if set(self.values) != set(known):
            wrong = sorted(set(self.values) ^ set(known))
            raise PellucidError(
                f"law {self.kind}: found no number, or one too many, for {', '.join(wrong)}, expected one for "
                "each of its parameters"
            )

    @property
    def parameters(self) -> np.ndarray:
        """Shape (k,), in the core's order."""
        return np.array([self.values[name] for name in LAWS[self.kind].parameters])

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of what `step` takes after the time, in order."""
        return tuple(sensor.name for sensor in LAWS[self.kind].sensors)

    @property
    def sensed(self) -> bool:
        """Whether it makes use of a force sensor."""
        return "interaction" in self.uses

    @property
    def emg(self) -> bool:
        """Whether it makes use of EMG."""
        return "muscle" in self.uses

    def changed(self, **values: float) -> ControlLaw:
        """The same law with some of its numbers changed, at rest.

        Parameters
        ----------
        **values : float
            By name, SI.

        Returns
        -------
        ControlLaw

        Raises
        ------
        PellucidError
            If the law has no such number.
        """
        unknown = [name for name in values if name not in self.values]
        if unknown:
            raise PellucidError(
                f"law {self.kind}: found no parameter {', '.join(unknown)}, expected any of {', '.join(self.values)}"
            )
        return replace(self, values={**self.values, **values})

    def using(self, *sensors: str) -> ControlLaw:
        """The same law, which makes use of more of its optional sensors."""
        return replace(self, uses=self.uses | set(sensors))

    def start(self, *, single: bool = False) -> _core.Law:
        """Return another instance at rest, to be stepped separately; `single` in float32, as on a microcontroller."""
        return _core.law(self.kind, self.parameters, single)

    @cached_property
    def _running(self) -> _core.Law:
        return self.start()

    def step(self, time: float, *samples: float | None) -> float:
        """Run one control period.

        Parameters
        ----------
        time : float
            When everything was measured [s].
        *samples : float or None
            In the order of `sensors`, SI; None, NaN or missing: the sensor has no valid reading.

        Returns
        -------
        float
            Effort for the drive [N m, or N].
        """
        return self._running.step(time, *samples)

    def run(self, time: np.ndarray, *samples: np.ndarray) -> np.ndarray:
        """`step`, one period after another.

        Parameters
        ----------
        time : ndarray, shape (n,)
            [s]
        *samples : ndarray, shape (n,)
            In the order of `sensors`, SI; NaN where a sensor says nothing.

        Returns
        -------
        ndarray, shape (n,)
            Efforts for the drive [N m, or N].
        """
        return self._running.run(time, *samples)

    def reset(self) -> None:
        """Open the gate again and start from the next sample; the effort goes on from where it is."""
        self._running.reset()

    @property
    def fault(self) -> str:
        """Why the effort is 0, or on its way there; "none" while all is well."""
        return self._running.fault


def gate_values(limits, period: float) -> dict[str, float]:
    """The numbers of the safety gate with which every law ends, by name, from `Limits` and the period [s]."""
    return {
        "effort_limit": limits.effort,
        "rate_limit": limits.rate,
        "velocity_limit": limits.velocity,
        "position_min": limits.position[0],
        "position_max": limits.position[1],
        "stop_margin": limits.stop_margin,
        "max_age": 5.0 * period,
        "max_repeats": 2.0,
        "period": period,
    }


@dataclass(frozen=True)
class Limits:
    """What the safety gate of a control law lets through, and what an EMG torque may be.

    Attributes
    ----------
    effort, rate : float
        Of the command [N m], [N m/s]; N and N/s where a joint is prismatic.
    velocity : float
        Of the joint; beyond is a fault [rad/s].
    position : tuple of float
        The stops [rad].
    stop_margin : float
        Over which the effort into a stop falls to 0 [rad].
    emg_torque : float
        Largest believable muscle torque [N m].

    Examples
    --------
    >>> import pellucid as pl
    >>> pl.Limits(effort=5.0, velocity=10.0).rate
    300.0
    """

    effort: float = 10.0
    rate: float = 300.0
    velocity: float = 15.0
    position: tuple[float, float] = (-0.6, 2.2)
    stop_margin: float = 0.1
    emg_torque: float = 40.0


@dataclass(frozen=True)
class Fuzzed:
    """What came out of a law that was given NaN, infinities, jumps, frozen and repeated samples, and clock jumps."""

    cycles: int
    unsafe: int  # Commands outside the limits of torque or rate, or that grew after a fault
    faults: int  # How often the gate shut
    slowest: int  # Most cycles from a fault to a safe output; the fault's own is the first
    moving: int  # Cycles with a torque: a law that gives none is safe and useless


def fuzz(law: ControlLaw, cycles: int, *, seed: int = 1, single: bool = False) -> Fuzzed:
    """Give a law nonsense."""
    return Fuzzed(cycles, *_core.fuzz_law(law.kind, law.parameters, cycles, seed, single))


def step_times(law: ControlLaw, cycles: int = 200_000) -> np.ndarray:
    """How long single steps of a law take here. Gives (cycles,) [s]."""
    return 1e-9 * _core.time_law(law.kind, law.parameters, cycles)
