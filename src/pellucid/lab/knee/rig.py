"""A virtual knee orthosis and the people who wear it: its rig file, and the coupled plant's parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ... import _core
from ...models.joint import GRAVITY
from ...protocols.random_phase_multisine import MULTISINE_NAME
from ..known_rigs import shipped_rig
from ..multisine import multisine_references, multisine_study
from ..recorded_table import MAIN_STREAM, Column, StoredTable, emg_columns, store_emg
from ..rig import Rig, Taken
from .instruments import Mounting, draw_mounting
from .protocol import KneeTrial, knee_trials
from .subject import KneeSubject
from .trial import Controller, KneeReadings, run_trial

NAMES: tuple[str, ...] = tuple(_core.COUPLED_PARAMETER_NAMES)
"""The plant's parameters, in the core's order."""

LOCKED = 1e9
"""Inertia of a limb that is clamped to a frame [kg*m^2]."""

TORQUE_QUANTUM = 1e-4
"""To which torques are written [N*m]."""

IMU_CHANNELS = ("acceleration", "angular_velocity", "magnetic_field")
"""In the order of the rig's quanta."""


NEEDED = {
    "orthosis": ("mass", "centre", "inertia", "bearing_coulomb", "bearing_viscous"),
    "actuator": ("inertia", "coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative",
                 "viscous_decline", "stribeck", "stribeck_velocity", "load_motoring", "load_generating", "load_rise",
                 "friction_swing", "friction_wave_number", "motor_limit", "torque_limit"),
    "spring": ("stiffness", "damping", "calibration_error"),
    "torque_loop": ("kp", "ki", "kd", "delay", "torque_span", "substeps"),
    "position_loop": ("bench", "worn", "velocity_span"),
    "encoders": ("motor", "output", "rate"),
    "strap": ("slack", "hold", "mobility"),
    "plate": ("stiffness", "damping"),
    "passive": ("torque", "angle", "scale"),
    "muscles": ("delay", "activation", "shape", "angle_slope", "best_angle", "slowing", "variability",
                "variability_memory", "unseen", "unseen_memory", "fatigue", "fatigue_emg"),
    "wearer": ("cocontraction", "bracing", "foresight", "reflex_delay", "stiffness", "damping", "integral",
               "resistance", "resistance_speed", "learning", "load_memory", "load_share", "drift", "drift_memory",
               "tremor", "tremor_frequency", "spontaneous", "spontaneous_memory", "not_relaxed"),
    "swing": ("centre", "amplitude", "frequency", "memory", "sharpness"),
    "emg": ("muscles", "rate", "band", "median_frequency", "baseline", "hum", "hum_frequency", "harmonics", "artefact",
            "artefact_band", "crosstalk", "gain_spread", "quantum", "full_range", "clock_drift"),
    "imu": ("rate", "jitter", "lever", "orthosis_lever", "mounting", "remounting", "heading", "magnetometer",
            "accelerometer_noise", "accelerometer_bias", "gyroscope_noise", "gyroscope_bias", "gyroscope_drift",
            "gyroscope_memory", "magnetometer_noise", "magnetometer_bias", "disturbance", "disturbance_memory",
            "field", "dip", "sway", "sway_memory", "quanta", "clock_offset", "clock_offset_spread", "clock_drift"),
    "subjects.*": ("sex", "age", "weight", "height", "shank_length", "limb", "strap", "strength", "emg_gain"),
}  # fmt: skip
"""What a rig file must say, table by table."""

COMMENTS = {
    "": "A virtual knee orthosis and its wearers, recorded like real ones. Nothing below tells their physics apart from"
    "\na machine's.",
    "rig.drive.kind": "of the spring, from its deflection",
    "streams.emg.channels": "raw, started by the orthosis's trigger",
    "streams.imu.channels": "on its own clock",
}
"""What its study.toml says beside a table or a key."""


@dataclass(frozen=True)
class KneeRig(Rig):
    """The virtual orthosis and its wearers: the tables of a file like ``lab/rigs/knee-orthosis.toml``."""

    kind = "knee-orthosis"
    needed = NEEDED
    comments = COMMENTS

    @property
    def period(self) -> float:
        """Of control and recording [s]."""
        return 1.0 / self["encoders"]["rate"]

    @property
    def subjects(self) -> dict[str, KneeSubject]:
        """By name, in the file's order."""
        return {name: KneeSubject(name=name, **values) for name, values in self["subjects"].items()}

    @property
    def orthosis_gravity(self) -> tuple[float, float]:
        """Of the orthosis per sin q and per cos q: two values [N*m]."""
        along, across = self["orthosis"]["centre"]
        weight = GRAVITY * self["orthosis"]["mass"]
        return weight * along, weight * across

    def strapped(self, values: Mapping[str, float]) -> KneeRig:
        """Return the rig with some constants of every wearer's strap changed, as `without_strap_options` gives them."""
        subjects = {
            name: {**one, "strap": {key: values.get(key, value) for key, value in one["strap"].items()}}
            for name, one in self["subjects"].items()
        }
        return replace(self, tables={**self.tables, "strap": {**self["strap"], **values}, "subjects": subjects})

    def strap_of(self, subject: KneeSubject) -> dict[str, float]:
        """Every constant of a subject's strap, SI."""
        return {**self["strap"], **subject.strap}

    def orthosis_load(self, position: float) -> float:
        """Torque that holds the orthosis alone at an angle [rad], without friction [N*m]."""
        sine, cosine = self.orthosis_gravity
        return sine * float(np.sin(position)) + cosine * float(np.cos(position))

    def plant(self, subject: KneeSubject | None, link: str = "strap", *, locked: bool = False) -> np.ndarray:
        """The core's parameters of the coupled plant, shape (47,), SI: of a subject, or of nobody, whose limb a link
        couples, "strap" or "plate", or who is locked to a frame."""
        sine, cosine = self.orthosis_gravity
        orthosis, actuator, spring, loop = self["orthosis"], self["actuator"], self["spring"], self["torque_loop"]
        values = dict.fromkeys(NAMES, 0.0) | {
            **{name: actuator[name] for name in NEEDED["actuator"] if name in NAMES},
            "presliding_travel": actuator.get("presliding_travel", 0.0),
            "motor_inertia": actuator["inertia"],
            "spring_stiffness": spring["stiffness"],
            "spring_damping": spring["damping"],
            "calibrated_stiffness": spring["stiffness"] * (1.0 + spring["calibration_error"]),
            "orthosis_inertia": orthosis["inertia"],
            "gravity_sine": sine,
            "gravity_cosine": cosine,
            "bearing_coulomb": orthosis["bearing_coulomb"],
            "bearing_viscous": orthosis["bearing_viscous"],
            "torque_kp": loop["kp"],
            "torque_ki": loop["ki"],
            "torque_kd": loop["kd"],
            "motor_quantum": self["encoders"]["motor"],
            "output_quantum": self["encoders"]["output"],
            "limb_inertia": LOCKED,
        }
        if subject is not None:
            coupling = self["plate"] if link == "plate" else self.strap_of(subject)
            values |= {f"strap_{name}": value for name, value in coupling.items()}
        if subject is not None and not locked:
            values |= {
                "limb_inertia": subject.inertia,
                "limb_gravity": subject.gravity,
                "limb_centre": subject.limb["ahead"],
                "limb_viscous": subject.limb["viscous"],
                **{f"passive_{name}": value for name, value in self["passive"].items()},
            }
        return np.array([values[name] for name in NAMES], float)

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """The orthosis's file, the EMG amplifier's, and the IMU's."""
        encoders, imu = self["encoders"], self["imu"]
        own = (
            Column("time", "time", "ms"),
            Column("position", "output", "rad", encoders["output"]),
            Column("motor_position", "motor", "rad", encoders["motor"]),
            Column("torque", "torque", "N*m", TORQUE_QUANTUM),
            Column("command", "command", "N*m", TORQUE_QUANTUM),
        )
        senses = zip(IMU_CHANNELS, ("m/s^2", "rad/s", "T"), imu["quanta"], strict=True)
        sensed = tuple(
            Column(f"imu.{channel}.{axis}", f"{channel}_{axis}", unit, quantum)
            for channel, unit, quantum in tuple(senses)[: 3 if imu["magnetometer"] else 2]
            for axis in "xyz"
        )
        clock = Column("time", "time", "s", text="%.4f")
        return {MAIN_STREAM: own, "emg": emg_columns(self["emg"]), "imu": (clock, *sensed)}

    def trials(self, seed: int = 1) -> tuple[KneeTrial, ...]:
        """The full protocol: the orthosis alone, then every subject; or a first look, drawn from `seed`."""
        looks = multisine_references(self, 1.0 / self.period, seed)
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
        """Do one trial, under a controller in place of its own mode if given; `Taken.inside` is `KneeReadings`."""
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
            streams["emg"] = store_emg(read.emg_time, read.emg, self["emg"])
        if read.imu is not None:
            senses = [getattr(read.imu, channel) for channel in IMU_CHANNELS[: len(columns["imu"]) // 3]]
            quanta = self["imu"]["quanta"]
            counts = [np.round(value / quantum) for value, quantum in zip(senses, quanta, strict=False)]
            streams["imu"] = StoredTable.of(columns["imu"], read.imu.time, *counts)
        return Taken(trial, {trial.name: streams}, truth=trial_truth(read), inside=read)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        drive = {"kind": "torque", "limit": f"{self['actuator']['torque_limit']} N*m"}
        common = super().study(made) | {
            "rig": {"joint": "knee", "motion": "rotary", "lifts": self["lifts"], "drive": drive}
        }
        look = multisine_study(self, made, ("torque", "position"))
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
                "magnetometer": self["imu"]["magnetometer"],
            },
            "emg_torque": {
                "joints": ["knee"],
                "muscles": list(self["emg"]["muscles"]),
                "emg": "emg",
                "chain": "knee",
            },
        }

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """The orthosis, its wearers, and how instruments sit on them, which a `seed` draws."""
        sine, cosine = self.orthosis_gravity
        orthosis, mountings = self["orthosis"], self.mountings(seed)
        return {
            "orthosis": {
                "gravity": float(np.hypot(sine, cosine)),
                "gravity_sine": sine,
                "gravity_cosine": cosine,
                "inertia": orthosis["inertia"],
                "damping": orthosis["bearing_viscous"],
                "coulomb": orthosis["bearing_coulomb"],
            },
            "actuator": dict(self["actuator"]),
            "subjects": {
                s.name: {
                    "gravity": s.gravity,
                    "gravity_centre": s.limb["ahead"],
                    "inertia": s.inertia,
                    "damping": s.limb["viscous"],
                    "strap_stiffness": s.strap["stiffness"],
                    "strap_damping": s.strap["damping"],
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
    """The rig of ``lab/rigs/knee-orthosis.toml``."""
    return KneeRig.parse(shipped_rig("knee-orthosis"), "knee-orthosis")
