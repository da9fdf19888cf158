"""A virtual knee orthosis and the people who wear it: its rig file, and the coupled plant's parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellucid.numerics.protocols.excitation import MULTISINE_NAME

from ..multisine import multisine_references, multisine_study
from ..recorded_table import MAIN_STREAM, Column, StoredTable, emg_columns, store_emg
from ..rig import Taken
from ..shipped_rigs import shipped_rig
from .constants import KneeConstants
from .instruments import Mounting, draw_mounting
from .machine import NAMES as NAMES
from .machine import KneeMachine
from .protocol import KneeTrial, knee_trials
from .trial import Controller, KneeReadings, run_trial

TORQUE_QUANTUM = 1e-4
"""Resolution of the written torques [N*m]."""

IMU_CHANNELS = ("acceleration", "angular_velocity", "magnetic_field")
"""In the order of the rig's quanta."""


COMMENTS = {
    "": "A virtual knee orthosis and its wearers, recorded like real ones. Nothing below tells their physics apart from"
    "\na machine's.",
    "rig.drive.kind": "of the spring, from its deflection",
    "rig.instruments": "what the supervisor of an exported controller may rely on",
    "streams.emg.channels": "raw, started by the orthosis's trigger",
    "streams.imu.channels": "on its own clock",
}
"""Comments of study.toml on tables and keys."""


@dataclass(frozen=True)
class KneeRig(KneeMachine):
    """The virtual orthosis with its wearers' trials, of a file like ``rigs/knee-orthosis.toml``."""

    kind = "knee-orthosis"
    constants_type = KneeConstants
    comments = COMMENTS

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """The orthosis's file, the EMG amplifier's, and the IMU's."""
        encoders, imu = self.constants.encoders, self.constants.imu
        own = (
            Column("time", "time", "ms"),
            Column("position", "output", "rad", encoders.output),
            Column("motor_position", "motor", "rad", encoders.motor),
            Column("torque", "torque", "N*m", TORQUE_QUANTUM),
            Column("command", "command", "N*m", TORQUE_QUANTUM),
        )
        senses = zip(IMU_CHANNELS, ("m/s^2", "rad/s", "T"), imu.quanta, strict=True)
        sensed = tuple(
            Column(f"imu.{channel}.{axis}", f"{channel}_{axis}", unit, quantum)
            for channel, unit, quantum in tuple(senses)[: 3 if imu.magnetometer else 2]
            for axis in "xyz"
        )
        clock = Column("time", "time", "s", text="%.4f")
        return {MAIN_STREAM: own, "emg": emg_columns(self.constants.emg), "imu": (clock, *sensed)}

    def trials(self, seed: int = 1) -> tuple[KneeTrial, ...]:
        """The full protocol: the orthosis alone, then every subject; or a first look, drawn from `seed`."""
        looks = multisine_references(self.constants.multisine, 1.0 / self.period, seed)
        return tuple(KneeTrial(name, MULTISINE_NAME, use, reference=r) for name, use, r in looks) or knee_trials(self)

    def mountings(self, seed: int) -> dict[str, Mounting]:
        """How the instruments sit on each subject, by name, as drawn with a `seed`."""
        return {n: draw_mounting(self, np.random.default_rng([seed, 1, i])) for i, n in enumerate(self.subjects)}

    def draws(self, trials: Sequence[KneeTrial], seed: int) -> Iterator[dict[str, Any]]:
        """As `Rig.draws` of `trials` and `seed`, and how the instruments sit on the participant."""
        mountings = self.mountings(seed)
        for trial, drawn in zip(trials, super().draws(trials, seed), strict=True):
            yield {**drawn, "mounting": mountings.get(trial.participant)}

    def record(
        self,
        trial: KneeTrial,
        rng: np.random.Generator,
        controller: Controller | None = None,
        *,
        mounting: Mounting | None = None,
    ) -> Taken:
        """Record one trial; a `controller` replaces the trial's own mode. `Taken.inside` is `KneeReadings`."""
        read = run_trial(self, trial, rng=rng, controller=controller, mounting=mounting)
        columns = self.streams()
        values = (read.time, read.position, read.motor_position, read.torque, read.command)
        scales = (1e-3, *(column.scale for column in columns[MAIN_STREAM][1:]))
        counts = [np.round(value / scale) for value, scale in zip(values, scales, strict=True)]
        own = columns[MAIN_STREAM]
        if trial.protocol == MULTISINE_NAME:
            own = (*own, Column("reference", "reference", "rad", text="%.9g"))
            counts.append(trial.reference)
        streams = {MAIN_STREAM: StoredTable.of(own, *counts)}
        if read.emg is not None:
            streams["emg"] = store_emg(read.emg_time, read.emg, self.constants.emg)
        if read.imu is not None:
            senses = [getattr(read.imu, channel) for channel in IMU_CHANNELS[: len(columns["imu"]) // 3]]
            quanta = self.constants.imu.quanta
            counts = [np.round(value / quantum) for value, quantum in zip(senses, quanta, strict=False)]
            streams["imu"] = StoredTable.of(columns["imu"], read.imu.time, *counts)
        return Taken(trial, {trial.name: streams}, truth=trial_truth(read), inside=read)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        common = super().study(made) | {
            "rig": {
                "joint": "knee",
                "motion": "rotary",
                "lifts": self.constants.lifts,
                "drive": self.drive_table,
                "instruments": self.instruments_table,
            }
        }
        look = multisine_study(self.constants.multisine, made, ("torque", "position"))
        if look:
            del common["streams"]
            return common | look
        return {
            **common,
            "participants": {
                s.name: {
                    "sex": s.sex,
                    "age": s.age,
                    "mass": f"{s.weight} kg",
                    "height": f"{s.height} m",
                    "shank_length": f"{s.shank_length} m",
                }
                for s in self.subjects.values()
            },
            "coupling": {
                "imu": "imu",
                "emg": "emg",
                "orientation": "vqf",
                "magnetometer": self.constants.imu.magnetometer,
            },
            "emg_torque": {
                "joints": ["knee"],
                "muscles": list(self.constants.emg.muscles),
                "emg": "emg",
                "chain": "knee",
            },
        }

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """The orthosis, its wearers, and how instruments sit on them, which a `seed` draws."""
        sine, cosine = self.orthosis_gravity
        orthosis, mountings = self.constants.orthosis, self.mountings(seed)
        return {
            "orthosis": {
                "gravity": float(np.hypot(sine, cosine)),
                "gravity_sine": sine,
                "gravity_cosine": cosine,
                "inertia": orthosis.inertia,
                "damping": orthosis.bearing_viscous,
                "coulomb": orthosis.bearing_coulomb,
            },
            "actuator": self.constants.actuator.model_dump(exclude_unset=True),
            "subjects": {
                s.name: {
                    "gravity": s.gravity,
                    "gravity_centre": s.limb.ahead,
                    "inertia": s.inertia,
                    "damping": s.limb.viscous,
                    "strap_stiffness": s.strap.stiffness,
                    "strap_damping": s.strap.damping,
                    "strap": self.strap_of(s),
                    "imu_remounting": mountings[s.name].remounting.tolist(),
                    "emg_gain": list(mountings[s.name].emg_gain),
                }
                for s in self.subjects.values()
            },
        }


def trial_truth(read: KneeReadings) -> dict[str, float]:
    """What is true of one trial in few numbers; `KneeReadings.truth` has every sample."""
    truth = read.truth
    clock = {} if read.imu is None else {"imu_clock_offset": read.imu.clock_offset}
    if read.trial.wearer is None:
        return clock
    settled = slice(min(round(2.0 / (read.time[1] - read.time[0])), len(read.time) // 2), None)
    return {
        "mismatch_mean": float(np.mean(truth.mismatch[settled])),
        "mismatch_sd": float(np.std(truth.mismatch[settled])),
        "strap_torque_rms": float(np.sqrt(np.mean(truth.strap_torque[settled] ** 2))),
        "muscle_torque_mean": float(np.mean(truth.muscle_torque[settled])),
        "muscle_torque_sd": float(np.std(truth.muscle_torque[settled])),
        **clock,
    }


def knee_orthosis() -> KneeRig:
    """The rig of ``rigs/knee-orthosis.toml``."""
    return KneeRig.parse(shipped_rig("knee-orthosis"), "knee-orthosis")
