"""What an engine is started with: conditions with their laws, a device, and the file of numbers that C++ reads.

Whether the process of a session still lives: its children end by themselves after its death, however it died.

A child knows its session by the number of the process that started it. The system gives a child whose parent died
another parent, so that a look is one call, and no pipe or signal has to be kept. After the session's death a child goes
on for `ORPHAN_S`: the engine stops its law meanwhile, as after any silence, and the recorder writes what there is.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from .._errors import PellucidError
from ..controllers.control_law import LAWS
from ..controllers.supervised import SupervisedLaw

DEFAULT_LATE_SHARE = 0.5
"""A cycle is late if it begins later after its deadline than this share of the period [1]."""

SESSION_TIMEOUT_S = 0.5
"""A law stops if its session gave no sign of life for this time."""


@dataclass(frozen=True)
class Condition:
    """One condition of a session.

    Attributes
    ----------
    name : str
        Without spaces.
    law : SupervisedLaw or None
        Law that runs; None for a robot without power.
    worn : bool
        Whether the robot is worn; a simulated wearer takes it off otherwise.
    """

    name: str
    law: SupervisedLaw | None = None
    worn: bool = True

    def __post_init__(self) -> None:
        if not self.name or any(c.isspace() for c in self.name):
            raise PellucidError(f'condition: found the name "{self.name}", expected one without spaces')

    def field_index(self, name: str) -> int:
        """Return the place of one of the law's numbers.

        Raises
        ------
        PellucidError
            If there is no law, or it has no such number.
        """
        names = [] if self.law is None else list(LAWS[self.law.kind].defaults)
        if name not in names:
            expected = f"one of {', '.join(names)}" if names else "none, since it runs no law"
            raise PellucidError(f'condition "{self.name}": found the parameter "{name}", expected {expected}')
        return names.index(name)


@dataclass(frozen=True)
class DeviceNumbers:
    """A device as the engine's file states it: its kind, its address and its numbers by name."""

    kind: str  # "virtual-elbow", "virtual-knee" or "udp"
    address: str = ""  # "host:port" at which a device behind a network is listened for
    numbers: Mapping[str, Sequence[float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """The next task of a simulated wearer, SI."""

    kind: str  # one of `layout.TASK_KINDS`
    target: float = 0.0  # [rad]
    amplitude: float = 0.0  # amplitude of the primary movement, or of a sine [rad]
    duration: float = 1.0  # duration of the primary movement [s]
    reaction: float = 0.0  # [s]
    frequency: float = 0.0  # frequency of a sine [Hz]
    share: float = 0.0  # share of the strength in a contraction, positive flexes [1]
    load: tuple[float, ...] = (0.0,) * 5  # what the wearer expects of the robot


class WearerPlan(Protocol):
    """Planner of a simulated wearer's movements."""

    def reach(self, target: float, position: float, felt: Mapping[str, np.ndarray], worn: bool) -> Task:
        """Return the movement to a target [rad] from a position [rad]; `felt` are the samples since the last one."""
        ...


@dataclass(frozen=True)
class StreamsProgram:
    """A program that sends a simulated wearer's streams; its arguments are the region's path and options as JSON."""

    module: str
    options: Mapping[str, Any]


@dataclass(frozen=True)
class EngineSetup:
    """Everything that an engine and its streams are started with.

    Attributes
    ----------
    conditions : tuple of Condition
    device : DeviceNumbers
    period : float
        Control period [s].
    seed : int
        Random seed of a simulated wearer.
    wearer : WearerPlan or None
        Planner of a simulated wearer's movements; None if a person moves.
    streams : StreamsProgram or None
        Program that sends a simulated wearer's EMG, markers and encoder; None without one.
    stream_types : tuple of str
        Types of the streams that are taken in, as the lab streaming layer names them.
    stream_names : tuple of str
        Names of the streams that are taken in, whatever their types; empty: all of these types.
    """

    conditions: tuple[Condition, ...]
    device: DeviceNumbers
    period: float = 1e-3
    seed: int = 1
    wearer: WearerPlan | None = None
    streams: StreamsProgram | None = None
    stream_types: tuple[str, ...] = ("EMG", "MoCap", "Encoder")
    stream_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [condition.name for condition in self.conditions]
        if not names or len(set(names)) != len(names):
            raise PellucidError(f"engine: found the conditions {names}, expected at least one, each name once")
        if not 1e-4 <= self.period <= 0.1:
            raise PellucidError(f"engine: found a period of {self.period} s, expected 0.0001 to 0.1")

    @property
    def period_ns(self) -> int:
        """Control period [ns]."""
        return round(1e9 * self.period)

    def condition_index(self, name: str | int) -> int:
        """Return the place of a condition, given by name or place.

        Raises
        ------
        PellucidError
            If there is no such condition.
        """
        names = [condition.name for condition in self.conditions]
        if isinstance(name, int) and 0 <= name < len(names):
            return name
        if name not in names:
            raise PellucidError(f'condition: found "{name}", expected one of {", ".join(names)}')
        return names.index(str(name))


def settings_text(setup: EngineSetup) -> str:
    """Return the engine's file of numbers; every number keeps its bits."""
    lines = [
        "pellucid-engine 1",
        f"period_ns {setup.period_ns}",
        f"late_ns {round(DEFAULT_LATE_SHARE * setup.period_ns)}",
        f"session_timeout_s {SESSION_TIMEOUT_S}",
        f"seed {setup.seed}",
        f"device {setup.device.kind} {setup.device.address}".rstrip(),
    ]
    lines += [_numbers(f"numbers {name}", values) for name, values in setup.device.numbers.items()]
    for condition in setup.conditions:
        law = condition.law
        lines.append(f"condition {condition.name} {'none' if law is None else law.kind} {int(condition.worn)}")
        if law is not None:
            lines += [_numbers("law", law.parameters), _numbers("supervisor", law.supervisor)]
    return "\n".join(lines) + "\n"


def _numbers(head: str, values: Sequence[float] | np.ndarray) -> str:
    numbers = [float(value) for value in np.atleast_1d(values)]
    return " ".join([head, str(len(numbers)), *(_exact(number) for number in numbers)])


def _exact(number: float) -> str:
    return number.hex() if math.isfinite(number) else ("nan" if math.isnan(number) else f"{number:+}")


SESSION_VARIABLE = "PELLUCID_SESSION_PROCESS"
"""Variable of the environment that tells a child the number of its session's process; the engine reads it, too."""

ORPHAN_S = 2.0
"""Time for which a child goes on after its session's death [s]: a law is stopped after 1 s of silence."""


class SessionProcess:
    """The process that started this one as a part of a session; there may be none."""

    def __init__(self) -> None:
        self._number = int(os.environ.get(SESSION_VARIABLE, "0"))
        self._gone_since: float | None = None

    def gone_for(self) -> float:
        """Return for how long the session's process has been seen to be dead [s]; 0 while it lives."""
        if self._number == 0 or os.getppid() == self._number:
            return 0.0
        if self._gone_since is None:
            self._gone_since = time.monotonic()
        return time.monotonic() - self._gone_since

    def is_over(self) -> bool:
        """Return whether a child should end now."""
        return self.gone_for() > ORPHAN_S
