"""A virtual shank exoskeleton on a frame and those who sit in it: its rig file, its study, and its truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..recorded_table import MAIN_STREAM, Column, StoredTable, emg_columns, store_emg
from ..rig import Taken
from ..shipped_rigs import shipped_rig
from .constants import SeatedConstants
from .machine import SeatedMachine
from .protocol import SeatedTrial, seated_trials
from .subject import subject_truth, subjects
from .trial import run_seated_trial

TORQUE_QUANTUM = 1e-3
"""Resolution of the written torques [N*m]."""


COMMENTS = {
    "": "A virtual shank exoskeleton on a frame and people who sit in it, recorded like real ones. Nothing below tells"
    "\ntheir physics apart from a machine's. Position is 0 where a shank hangs; the knee's own angle is 0 where the leg"
    "\nis straight.",
    "rig.drive.kind": "behind the gear, from the motor's current",
    "streams.emg.channels": "raw, started by the exoskeleton's trigger",
    "loaded_swing": "the motor swings alone, and with relaxed legs in it",
}
"""Comments of study.toml on tables and keys."""


@dataclass(frozen=True)
class SeatedRig(SeatedMachine):
    """The virtual exoskeleton with its subjects' trials, of a file like ``rigs/knee-seated.toml``."""

    kind = "knee-seated"
    constants_type = SeatedConstants
    comments = COMMENTS

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """The exoskeleton's file, and the EMG amplifier's."""
        own = (
            Column("time", "time", "ms"),
            Column("position", "output", "rad", self.constants.instruments.encoder),
            Column("torque", "torque", "N*m", TORQUE_QUANTUM),
            Column("command", "command", "N*m", TORQUE_QUANTUM),
        )
        return {MAIN_STREAM: own, "emg": emg_columns(self.constants.emg)}

    def trials(self, seed: int = 1) -> list[SeatedTrial]:
        """The full protocol; no `seed` draws it."""
        return seated_trials(self)

    def record(self, trial: SeatedTrial, rng: np.random.Generator, controller: None = None) -> Taken:
        """Do a `trial` under the motor's own loop; no `controller`; noise from `rng`."""
        read = run_seated_trial(self, trial, rng=rng)
        columns = self.streams()
        values = (read.time, read.position, read.torque, read.command)
        scales = (1e-3, *(column.scale for column in columns[MAIN_STREAM][1:]))
        counts = [np.round(value / scale) for value, scale in zip(values, scales, strict=True)]
        streams, entry = {MAIN_STREAM: StoredTable.of(columns[MAIN_STREAM], *counts)}, {}
        if read.emg is not None:
            streams["emg"] = store_emg(read.emg_time, read.emg, self.constants.emg)
            knee = {**columns[MAIN_STREAM][1].spec, "offset": round(read.knee, 4)}
            entry = {"channels": {"angle.knee": knee}}
        torque = read.truth.muscle_torque
        truth = {
            "muscle_torque_mean": float(torque.mean()),
            "muscle_torque_sd": float(torque.std()),
            "muscle_torque_range": [float(torque.min()), float(torque.max())],
        }
        return Taken(trial, {trial.name: streams}, entry, truth, read)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        people = {t.trial.participant: t.trial.subject for t in made if t.trial.subject is not None}
        return {
            **super().study(made),
            "rig": {
                "joint": "knee",
                "motion": "rotary",
                "lifts": self.constants.lifts,
                "drive": {"kind": "torque", "limit": f"{self.constants.actuator.torque_limit} N*m"},
            },
            "participants": {
                name: {"sex": s.sex, "age": s.age, "mass": f"{s.weight} kg", "height": f"{s.height} m"}
                for name, s in people.items()
            },
            "loaded_swing": {},
            "emg_torque": {
                "joints": ["knee"],
                "muscles": list(self.constants.emg.muscles),
                "emg": "emg",
                "chain": "hill",
            },
        }

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """The exoskeleton and everybody who sits in it; no `seed` draws them."""
        sine, cosine = self.exoskeleton_gravity
        return {
            "exoskeleton": {"inertia": self.exoskeleton_inertia, "gravity_sine": sine, "gravity_cosine": cosine},
            "subjects": {name: subject_truth(s) for name, s in subjects(self).items()},
        }


def load_seated_rig(name: str = SeatedRig.kind) -> SeatedRig:
    """The rig of a `name` that comes with the package."""
    return SeatedRig.parse(shipped_rig(name), name)
