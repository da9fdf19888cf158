"""What a session needs of an engine. `pellucid.live.LiveEngine` has it; tests have one whose clock runs faster."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np


class EngineSamples(Protocol):
    """Samples since a cursor."""

    cursor: int
    lost: int
    time: np.ndarray  # (n,) host's monotonic clock [s]
    channels: Mapping[str, np.ndarray]  # (n,) each, SI


class EmgRing(Protocol):
    """A stream of EMG that is read as it grows."""

    labels: Sequence[str]
    nominal_rate: float  # [Hz]

    def read_since(self, cursor: int) -> Any:
        """Return cursor, times (n,) [s] and values (n, channels) [V] since a cursor; 0 begins with the oldest."""


class HeardStream(Protocol):
    """A stream that is taken in."""

    silent_s: float  # time since something arrived [s]
    clock: Any  # offset, drift, jumps, batches, lost samples and measured rate


class EngineStatus(Protocol):
    """What the engine does now."""

    state: str  # "idle", "running", "changing", "stopped", "silent" (no cycles) or "ended"
    condition: str
    fault: str  # "none" while all is well
    effort_limit: float  # largest effort of the law that runs [N*m]
    velocity_limit: float  # [rad/s]
    position_limits: Sequence[float]  # [rad]


class RecorderHealth(Protocol):
    """Whether the recorder records."""

    problem: str  # why it does not, after the words "the recorder"; empty while it records
    is_starting: bool


class SessionEngine(Protocol):
    """The engine of a session: the robot or its virtual twin, the recorder and the streams."""

    @property
    def emg(self) -> EmgRing | None:
        """The stream of EMG; None while there is none."""

    @property
    def alive(self) -> Mapping[str, bool]:
        """Whether each process lives."""

    def beat(self) -> None:
        """Say that the server is alive; without it for 1 s the engine stops the law."""

    def status(self) -> EngineStatus:
        """Return what the engine does now."""

    def set_condition(self, name: str) -> None:
        """Change to the law of a condition."""

    def arm(self) -> None:
        """Let the law run."""

    def disarm(self) -> None:
        """Take the effort to 0 and the power off."""

    def stop(self) -> None:
        """Stop as an operator does: latched."""

    def reset(self) -> None:
        """Answer the supervisor's challenge after a stop."""

    def read_since(self, cursor: int, *, every: int = 1, limit: int | None = None) -> EngineSamples:
        """Return the samples since a cursor."""

    def set_target(self, angle: float) -> None:
        """Ask for an angle [rad]."""

    def set_tracking(self, centre: float, amplitude: float, frequency: float) -> None:
        """Ask for a sine [rad, Hz]."""

    def set_contraction(self, share: float) -> None:
        """Ask for a contraction, as a share of the strength; positive flexes."""

    def set_torque(self, torque: float) -> None:
        """Add a torque to the law's [N*m]."""

    def set_estimate(self, torque: float, half_width: float) -> None:
        """Record an estimate of the torque on the person and half of its interval [N*m]; NaN for none."""

    def heard_streams(self) -> Mapping[str, HeardStream]:
        """Return the streams that were taken in so far, by name."""

    def begin_recording(self, path: Path, about: Mapping[str, Any]) -> None:
        """Begin a file."""

    def recorder_health(self) -> RecorderHealth:
        """Return whether the recorder records, and why not."""

    def restart_recorder(self) -> None:
        """Start the recorder again; it goes on with the file that it was writing."""

    def give_up_recording(self, path: Path) -> None:
        """End a recorder that does not complete a file, and leave the file as it is."""

    def end_recording(self, *, wait: bool = True) -> Path:
        """End the file."""

    def recorded(self, path: Path) -> bool:
        """Return whether a file is whole."""

    def mark(self, kind: str, data: Mapping[str, Any] | None = None) -> None:
        """Record an event."""

    def health(self) -> Any:
        """Return cycles, late ones, their histogram, faults and clocks."""
