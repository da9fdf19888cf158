"""The thesis's experiments on the virtual orthosis, in memory: recordings as `simulate` writes them, and the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellucid.files.recording import Recording
from pellucid.numerics.gravity_holds import find_holds
from pellucid.orthosis.input_output import InputOutput, input_output
from pellucid.study.study_file import StudyFile

from ..study import record_in_memory
from .protocol import bench_trials, subject_trials
from .rig import KneeRig
from .trial import KneeTruth

STRAP_PROTOCOLS = ("imu_on_orthosis", "relaxed_holds", "free_swing")
"""Protocols that a strap takes; the thesis's others are for EMG."""


@dataclass(frozen=True, eq=False)
class KneeSession:
    """What was recorded, and what only the simulation knows."""

    config: StudyFile  # What study.toml would say
    recordings: tuple[Recording, ...]
    truth: dict[str, KneeTruth]  # Simulated truth by recording

    def of(self, protocol: str, use: str | None = None) -> list[Recording]:
        """Return the recordings of a `protocol`, and of a `use` if one is given."""
        return [r for r in self.recordings if r.protocol == protocol and use in (None, r.use)]

    def responses(self, protocol: str, use: str | None = None) -> list[InputOutput]:
        """The same as the spring's torque in and the orthosis's angle out."""
        return [input_output(r, ("torque", "position")) for r in self.of(protocol, use)]


def take(rig: KneeRig, seed: int, subjects: Sequence[str] = (), *, protocols: Sequence[str] = ()) -> KneeSession:
    """Simulate and record the orthosis alone, and some subjects."""
    made = bench_trials(rig)
    for name in subjects:
        own = subject_trials(rig, rig.subjects[name])
        made += [trial for trial in own if not protocols or trial.protocol in protocols]
    config, recordings, taken = record_in_memory(rig, made, seed=seed)
    return KneeSession(config, recordings, {one.trial.name: one.inside.truth for one in taken})


def hold_angles(responses: Sequence[InputOutput]) -> tuple[np.ndarray, np.ndarray]:
    """Return angles [rad] and torques [N m] of holds, (k,) each, as a plot of them shows."""
    holds = [h for r in responses for h in find_holds(r.time, r.output, r.input, recording=r.recording)]
    return np.array([h.angle for h in holds]), np.array([h.torque for h in holds])
