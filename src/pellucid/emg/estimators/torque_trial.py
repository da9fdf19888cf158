"""One trial of a torque map: envelopes, joint angles and the reference torque on one clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import IdentificationError, RecordingError
from .muscle_source import MuscleSource


@dataclass(frozen=True, eq=False)
class TorqueTrial:
    """A trial that a torque map is fitted to or scored on."""

    name: str  # Name of the recording
    joint: str  # Joint of the torque
    time: np.ndarray  # Time, shape (n,) [s]
    envelopes: Mapping[str, np.ndarray] = field(repr=False)  # Envelopes by muscle, shape (n,) each: relative [1] or [V]
    # Angles by joint, shape (n,) each [rad]; the joint itself must be among them, the others are its neighbours
    angles: Mapping[str, np.ndarray] = field(repr=False)
    torque: np.ndarray = field(repr=False)  # Reference torque, shape (n,), in `unit`
    group: str = ""  # Repetition; trials of one repetition are left out together in cross-validation
    heldout: bool = False  # Whether the trial is held out and never fitted
    participant: str | None = None
    checksum: str = ""  # SHA-256 of the file
    # Source of the muscles' lengths, moment arms and constants; None if they are not known
    muscles: MuscleSource | None = field(default=None, repr=False)
    # Envelopes of the same muscles before the first sample, at the same rate, shape (k,) each; empty if there are none
    lead: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)
    unit: str = "N*m"  # Unit of the torque; "MVC": shares of a maximal contraction
    piece_of: str = ""  # Name of the recording that the trial is a piece of, between two cuts; "" for a whole one

    def __post_init__(self):
        if self.joint not in self.angles:
            raise RecordingError(
                f"recording {self.name}: found the angles {', '.join(self.angles) or 'of no joint'}, expected the "
                f"{self.joint}'s own among them"
            )
        named = {"torque": self.torque, **{f"emg.{m}": x for m, x in self.envelopes.items()}}
        for name, x in {**named, **{f"angle.{j}": x for j, x in self.angles.items()}}.items():
            if np.shape(x) != np.shape(self.time):
                raise RecordingError(
                    f"recording {self.name}, channel {name}: found shape {np.shape(x)}, expected "
                    f"{np.shape(self.time)} as in time"
                )
            if not np.isfinite(x).all():
                raise RecordingError(
                    f"recording {self.name}, channel {name}: found missing samples (NaN), the first at index "
                    f"{int(np.flatnonzero(~np.isfinite(x))[0])}, expected a number in every sample"
                )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def recording(self) -> str:
        """Name of the whole recording."""
        return self.piece_of or self.name

    @property
    def known_muscles(self) -> MuscleSource:
        """Source of the muscles' lengths, moment arms and constants, of a trial that must have one."""
        if self.muscles is None:
            raise IdentificationError(
                f"trial {self.name}: found no lengths of muscles across the {self.joint}, expected streams length, "
                "lengthening and moment_arm, or a joint of the leg's model"
            )
        return self.muscles

    @property
    def fs(self) -> float:
        """Sampling rate [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


def group_pieces(trials: Sequence[TorqueTrial]) -> dict[str, list[TorqueTrial]]:
    """Return the pieces of each recording in order, by the recording's name; a whole recording is its only piece."""
    found: dict[str, list[TorqueTrial]] = {}
    for trial in trials:
        found.setdefault(trial.recording, []).append(trial)
    return found


def join_pieces(trials: Sequence[TorqueTrial]) -> list[TorqueTrial]:
    """Return a trial of each recording, with the samples of its pieces one after another.

    It is for statistics of a recording's samples. A filter would run over the cuts between them.
    """
    return [pieces[0] if len(pieces) == 1 else _joined(name, pieces) for name, pieces in group_pieces(trials).items()]


def _joined(name: str, pieces: Sequence[TorqueTrial]) -> TorqueTrial:
    """Return one trial of several pieces; the source of its muscles is left out, since it may hold samples."""
    first = pieces[0]
    return replace(
        first, name=name, piece_of="", muscles=None, time=np.concatenate([p.time for p in pieces]),
        torque=np.concatenate([p.torque for p in pieces]),
        envelopes={m: np.concatenate([p.envelopes[m] for p in pieces]) for m in first.envelopes},
        angles={j: np.concatenate([p.angles[j] for p in pieces]) for j in first.angles},
    )  # fmt: skip
