"""A virtual shank exoskeleton on a frame and those who sit in it: its rig file, its study, and its truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._errors import StudyError
from ...models.joint import GRAVITY
from ...models.muscle_geometry import muscle_table
from ..known_rigs import shipped_rig
from ..recorded_table import MAIN_STREAM, Column, StoredTable, emg_columns, store_emg
from ..rig import Rig, Taken
from .protocol import SeatedTrial, seated_trials
from .subject import subject_truth, subjects
from .trial import run_seated_trial

TORQUE_QUANTUM = 1e-3
"""To which torques are written [N*m]."""


NEEDED = {
    "exoskeleton": ("mass", "centre", "inertia"),
    "actuator": ("inertia", "torque_limit", "coulomb_positive", "coulomb_negative", "viscous", "rest_speed",
                 "load_loss", "cogging", "cogging_wave_number", "constant_error"),
    "position_loop": ("kp", "kd", "velocity_span"),
    "instruments": ("rate", "encoder", "torque_noise", "substeps"),
    "shells": ("stiffness", "damping"),
    "limb": ("spread", "ahead", "viscous"),
    "posture": ("rest", "hip", "goniometer"),
    "difference": ("low", "high", "seed"),
    "muscles": ("model_height", "model_mass", "extensors", "flexors", "sharing", "unseen", "unseen_memory",
                "tendon_strain", "passive_strain", "passive_at_rest", "passive_flexors", "fibre_damping",
                "length_shift", "activation_time", "deactivation_time", "delay", "shape", "variability",
                "variability_memory"),
    "wearer": ("cocontraction", "belief", "friction_belief", "reflex_delay", "activation_foresight", "weakening",
               "stiffness", "damping", "spontaneous", "spontaneous_memory", "maximal"),
    "swing": ("forward", "backward", "pace", "memory", "duration"),
    "loaded": ("amplitude", "duration", "reach", "peak_torque", "excitation_seed"),
    "mvc": ("angle", "yield", "duration"),
    "emg": ("muscles", "leaking", "leak_gain", "rate", "band", "median_frequency", "baseline", "hum", "hum_frequency",
            "harmonics", "artefact", "artefact_band", "crosstalk", "gain_spread", "gain", "quantum", "full_range",
            "clock_drift"),
    "subjects.*": ("sex", "age", "height", "weight", "frequency"),
}  # fmt: skip
"""What a rig file must say, table by table."""

COMMENTS = {
    "": "A virtual shank exoskeleton on a frame and people who sit in it, recorded like real ones. Nothing below tells"
    "\ntheir physics apart from a machine's. Position is 0 where a shank hangs; the knee's own angle is 0 where the leg"
    "\nis straight.",
    "rig.drive.kind": "behind the gear, from the motor's current",
    "streams.emg.channels": "raw, started by the exoskeleton's trigger",
    "loaded_swing": "the motor swings alone, and with relaxed legs in it",
}
"""What its study.toml says beside a table or a key."""


@dataclass(frozen=True)
class SeatedRig(Rig):
    """The virtual exoskeleton and its wearers: the tables of a file like ``lab/rigs/knee-seated.toml``."""

    kind = "knee-seated"
    needed = NEEDED
    comments = COMMENTS

    @classmethod
    def checked(cls, tables: dict, name: str) -> dict:
        """The tables, with muscles that the anatomical model has."""
        tables, known = super().checked(tables, name), muscle_table().geometry
        every = (*tables["muscles"]["extensors"], *tables["muscles"]["flexors"])
        strange = [muscle for muscle in every if muscle not in known]
        if strange:
            found, expected = ", ".join(strange), ", ".join(known)
            raise StudyError(f"rig {name}: [muscles] found {found}, expected muscles of {expected}")
        return tables

    @property
    def period(self) -> float:
        """Of controller and recording [s]."""
        return 1.0 / self["instruments"]["rate"]

    @property
    def exoskeleton_gravity(self) -> tuple[float, float]:
        """Factors of sine and cosine of the position [N m]."""
        part = self["exoskeleton"]
        return GRAVITY * part["mass"] * part["centre"][0], GRAVITY * part["mass"] * part["centre"][1]

    @property
    def exoskeleton_inertia(self) -> float:
        """Of shank part and rotor about the joint [kg m^2]."""
        return self["exoskeleton"]["inertia"] + self["actuator"]["inertia"]

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """The exoskeleton's file, and the EMG amplifier's."""
        own = (
            Column("time", "time", "ms"),
            Column("position", "output", "rad", self["instruments"]["encoder"]),
            Column("torque", "torque", "N*m", TORQUE_QUANTUM),
            Column("command", "command", "N*m", TORQUE_QUANTUM),
        )
        return {MAIN_STREAM: own, "emg": emg_columns(self["emg"])}

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
            streams["emg"] = store_emg(read.emg_time, read.emg, self["emg"])
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
                "lifts": self["lifts"],
                "drive": {"kind": "torque", "limit": f"{self['actuator']['torque_limit']} N*m"},
            },
            "participants": {
                name: {"sex": s.sex, "age": s.age, "mass": f"{s.weight} kg", "height": f"{s.height} m"}
                for name, s in people.items()
            },
            "loaded_swing": {},
            "emg_torque": {
                "joints": ["knee"],
                "muscles": list(self["emg"]["muscles"]),
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
