"""The tasks of a running session: the present request, whether it is completed, and the participant's screen.

A task receives the time and the measurements and returns the contents of the screen. It knows neither engine nor page,
so that tests can run it on made-up motion. A simulated wearer receives an `Ask`; a real participant sees the screen.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..._errors import PellucidError
from ...study.instruments_table import ContractionTask, HoldingTask, PointingTask, TrackingTask
from .trial_plan import PlannedTrial

LEAD_IN_S = 1.0
"""Time from the start of a recording to the first cue [s]."""

LEAD_OUT_S = 0.5
"""Time from the end of a task to the end of its recording [s]."""

RANGE_MARGIN = 0.15
"""The screen shows this share of the targets' span beyond the outermost targets."""

MIN_RANGE_RAD = 0.35
"""Smallest span of angles that a screen shows [rad]."""


@dataclass(frozen=True)
class Sensed:
    """What was measured last."""

    time: float  # host's monotonic clock [s]
    position: float  # [rad]; NaN if it is not known
    levels: Mapping[str, float] = field(default_factory=dict)  # EMG level by muscle, as a share of the largest


@dataclass(frozen=True)
class Ask:
    """A request to the participant, which a simulated wearer receives, and to the robot."""

    kind: str  # "target", "tracking", "contraction" or "torque": the engine's function is set_<kind>
    values: tuple[float, ...]  # arguments of the engine's function of that name


class RunningTask(ABC):
    """One trial's task between its first cue and its end."""

    def __init__(self, trial: PlannedTrial, lead_in: float = LEAD_IN_S):
        self.trial = trial
        self.lead_in = lead_in
        self.begun: float | None = None  # time of the start [s]
        self.finished: float | None = None  # time of the end [s]
        self.cues: list[dict[str, Any]] = []  # cues since they were last taken
        self.asks: list[Ask] = []  # asks since they were last taken

    def step(self, now: Sensed) -> None:
        """Go on to the time of what was measured."""
        if self.begun is None:
            self.begun = now.time
        elapsed = now.time - self.begun - self.lead_in
        if elapsed >= 0.0 and self.finished is None:
            self.advance(elapsed, now)

    @abstractmethod
    def advance(self, elapsed: float, now: Sensed) -> None:
        """Go on; `elapsed` is the time since the first cue [s]."""

    @abstractmethod
    def screen(self, now: Sensed) -> dict[str, Any]:
        """Return what the participant's page shows."""

    @property
    @abstractmethod
    def progress(self) -> float:
        """Share of the task that is done, 0 to 1."""

    def take(self) -> tuple[list[dict[str, Any]], list[Ask]]:
        """Return cues and asks since the last call."""
        taken = self.cues, self.asks
        self.cues, self.asks = [], []
        return taken

    def is_over(self, time: float) -> bool:
        """Return whether the recording may end."""
        return self.finished is not None and time >= self.finished + LEAD_OUT_S


class RunningPointing(RunningTask):
    """Targets one after another; each is held for a while."""

    def __init__(self, trial: PlannedTrial, lead_in: float = LEAD_IN_S):
        super().__init__(trial, lead_in)
        assert isinstance(trial.task, PointingTask)
        self.task = trial.task
        self.index = -1
        self.shown_at = 0.0
        self.entered: float | None = None
        self.missed = 0  # targets whose time ran out

    def advance(self, elapsed: float, now: Sensed) -> None:
        """Go on; `elapsed` is the time since the first cue [s]."""
        if self.index < 0:
            self._show_next(elapsed)
            return
        on = abs(now.position - self.target) <= self.task.tolerance
        self.entered = (elapsed if self.entered is None else self.entered) if on else None
        held = self.entered is not None and elapsed - self.entered >= self.task.hold
        late = elapsed - self.shown_at >= self.task.longest
        if held or late:
            self.missed += late and not held
            if self.index + 1 == len(self.trial.targets):
                self.finished = now.time
            else:
                self._show_next(elapsed)

    def _show_next(self, elapsed: float) -> None:
        self.index, self.shown_at, self.entered = self.index + 1, elapsed, None
        self.cues.append({"target": self.target, "number": self.index + 1})
        self.asks.append(Ask("target", (self.target,)))

    @property
    def target(self) -> float:
        """The angle of the target that is shown [rad]."""
        return self.trial.targets[self.index] if self.index >= 0 else self.task.start

    @property
    def progress(self) -> float:
        """Share of the task that is done, 0 to 1."""
        return (len(self.trial.targets) if self.finished is not None else max(self.index, 0)) / len(self.trial.targets)

    def screen(self, now: Sensed) -> dict[str, Any]:
        """Return what the participant's page shows."""
        elapsed = now.time - (self.begun or now.time) - self.lead_in
        held = 0.0 if self.entered is None else min((elapsed - self.entered) / self.task.hold, 1.0)
        return {
            "task": "pointing",
            "pointer": finite_number(now.position),
            "target": self.target,
            "tolerance": self.task.tolerance,
            "range": shown_range((self.task.start, *(self.task.start + a for a in self.task.amplitudes))),
            "held": held,
            "done": max(self.index, 0),
            "of": len(self.trial.targets),
        }


class RunningTracking(RunningTask):
    """A target that moves as a sine."""

    def __init__(self, trial: PlannedTrial, lead_in: float = LEAD_IN_S):
        super().__init__(trial, lead_in)
        assert isinstance(trial.task, TrackingTask)
        self.task = trial.task
        self.elapsed = 0.0
        self._asked = False

    def advance(self, elapsed: float, now: Sensed) -> None:
        """Go on; `elapsed` is the time since the first cue [s]."""
        if not self._asked:
            self._asked = True
            self.cues.append({"centre": self.task.centre, "amplitude": self.task.amplitude})
            self.asks.append(Ask("tracking", (self.task.centre, self.task.amplitude, self.task.frequency)))
        self.elapsed = elapsed
        if elapsed >= self.task.duration:
            self.finished = now.time

    @property
    def progress(self) -> float:
        """Share of the task that is done, 0 to 1."""
        return min(self.elapsed / self.task.duration, 1.0)

    def screen(self, now: Sensed) -> dict[str, Any]:
        """Return what the participant's page shows."""
        task = self.task
        elapsed = max(now.time - (self.begun or now.time) - self.lead_in, 0.0)
        return {
            "task": "tracking",
            "pointer": finite_number(now.position),
            "target": task.centre + task.amplitude * math.sin(2.0 * math.pi * task.frequency * elapsed),
            "range": shown_range((task.centre - task.amplitude, task.centre + task.amplitude)),
            "left": max(task.duration - elapsed, 0.0),
        }


class RunningHolding(RunningTask):
    """A task to hold an angle under one torque after another."""

    def __init__(self, trial: PlannedTrial, lead_in: float = LEAD_IN_S):
        super().__init__(trial, lead_in)
        assert isinstance(trial.task, HoldingTask)
        self.task = trial.task
        self.index = -1
        self.torque = 0.0
        self.by_hand: float | None = None  # torque of the operator's slider for this step [N*m]
        self.hand_rate = 0.0  # rate at which the torque follows the slider or goes back to the plan [N*m/s]; 0: on plan
        self.elapsed = 0.0

    @property
    def duration(self) -> float:
        """Duration of all torques together [s]."""
        return self.task.duration * len(self.task.torques)

    def set_by_hand(self, torque: float, rate: float) -> None:
        """Go to the torque of the operator's slider [N*m] at a rate [N*m/s], and back to the plan at the next step."""
        self.by_hand, self.hand_rate = torque, rate

    def advance(self, elapsed: float, now: Sensed) -> None:
        """Go on; `elapsed` is the time since the first cue [s]."""
        since, self.elapsed = elapsed - self.elapsed, elapsed
        if elapsed >= self.duration:
            self.finished, self.torque = now.time, 0.0
            self.asks.append(Ask("torque", (0.0,)))
            return
        index = min(int(elapsed / self.task.duration), len(self.task.torques) - 1)
        if index != self.index:
            if self.index < 0:
                self.asks.append(Ask("target", self.trial.targets))
            self.index, self.by_hand = index, None
            self.cues.append({"angle": self.trial.targets[0], "torque": self.task.torques[index]})
        torque = self._planned(elapsed) if self.by_hand is None else self.by_hand
        if self.hand_rate > 0.0:
            change = self.hand_rate * since
            reached = min(max(torque, self.torque - change), self.torque + change)
            self.hand_rate = 0.0 if self.by_hand is None and reached == torque else self.hand_rate
            torque = reached
        if torque != self.torque:
            self.torque = torque
            self.asks.append(Ask("torque", (torque,)))

    def _planned(self, elapsed: float) -> float:
        """Return the torque of the plan, which ramps from the step before [N*m]."""
        before = self.task.torques[self.index - 1] if self.index > 0 else 0.0
        part = (elapsed - self.index * self.task.duration) / self.task.ramp if self.task.ramp > 0.0 else 1.0
        return before + (self.task.torques[self.index] - before) * min(part, 1.0)

    @property
    def progress(self) -> float:
        """Share of the task that is done, 0 to 1."""
        return min(self.elapsed / self.duration, 1.0)

    def screen(self, now: Sensed) -> dict[str, Any]:
        """Return what the participant's page shows."""
        target = self.trial.targets[0]
        return {
            "task": "holding",
            "pointer": finite_number(now.position),
            "target": target,
            "tolerance": self.task.tolerance,
            "range": shown_range((*self.task.angles, target)),
            "left": max(self.duration - self.elapsed, 0.0),
        }


class RunningContraction(RunningTask):
    """Contractions to one level after another, with rests."""

    def __init__(self, trial: PlannedTrial, lead_in: float = LEAD_IN_S):
        super().__init__(trial, lead_in)
        assert isinstance(trial.task, ContractionTask)
        self.task = trial.task
        self.index, self.resting, self.elapsed = -1, True, 0.0

    def advance(self, elapsed: float, now: Sensed) -> None:
        """Go on; `elapsed` is the time since the first cue [s]."""
        self.elapsed = elapsed
        each = self.task.duration + self.task.rest
        index = int(elapsed / each)
        if index >= len(self.task.levels):
            self.finished = now.time
            return
        resting = elapsed - index * each >= self.task.duration
        if index != self.index:
            self._ask(self.task.levels[index])
        elif resting and not self.resting:
            self._ask(0.0)
        self.index, self.resting = index, resting

    def _ask(self, level: float) -> None:
        sign = 1.0 if self.task.direction == "flexion" else -1.0
        self.cues.append({"level": level, "direction": self.task.direction})
        self.asks.append(Ask("contraction", (sign * level,)))

    @property
    def progress(self) -> float:
        """Share of the task that is done, 0 to 1."""
        return min(self.elapsed / (len(self.task.levels) * (self.task.duration + self.task.rest)), 1.0)

    def screen(self, now: Sensed) -> dict[str, Any]:
        """Return what the participant's page shows."""
        level = self.task.levels[max(self.index, 0)]
        each = self.task.duration + self.task.rest
        into = self.elapsed % each
        seen = [now.levels[muscle] for muscle in self.task.muscles if math.isfinite(now.levels.get(muscle, math.nan))]
        return {
            "task": "contraction",
            "muscles": list(self.task.muscles),
            "direction": self.task.direction,
            "level": sum(seen) / len(seen) if seen else None,
            "target": 0.0 if self.resting else level,
            "next": level,
            "tolerance": self.task.tolerance,
            "resting": self.resting,
            "left": max((each if self.resting else self.task.duration) - into, 0.0),
        }


RUNNING_TASKS: Mapping[type, type[RunningTask]] = {
    PointingTask: RunningPointing,
    TrackingTask: RunningTracking,
    HoldingTask: RunningHolding,
    ContractionTask: RunningContraction,
}
"""The class that runs a task, by the class of its table."""


def running_task(trial: PlannedTrial, lead_in: float = LEAD_IN_S) -> RunningTask:
    """Return the task of a trial, ready to begin."""
    for kind, running in RUNNING_TASKS.items():
        if isinstance(trial.task, kind):
            return running(trial, lead_in)
    raise PellucidError(f"session: found a task of {type(trial.task).__name__}, expected a known kind")


def first_angle(trial: PlannedTrial) -> float | None:
    """Return the angle at which the person waits before a trial [rad]; None where any will do."""
    task = trial.task
    if isinstance(task, PointingTask):
        return task.start
    if isinstance(task, TrackingTask):
        return task.centre
    return trial.targets[0] if trial.targets else None


def shown_range(angles: tuple[float, ...]) -> tuple[float, float]:
    """Return the lowest and the highest angle that a screen shows for targets at `angles` [rad]."""
    low, high = min(angles), max(angles)
    margin = max(RANGE_MARGIN * (high - low), 0.5 * (MIN_RANGE_RAD - (high - low)))
    return low - margin, high + margin


def finite_number(value: float) -> float | None:
    """Return a number as JSON has it: None for one that is not finite."""
    return float(value) if math.isfinite(value) else None
