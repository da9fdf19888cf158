"""A virtual knee orthosis and the people who wear it: its rig file, and the coupled plant's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ... import _core
from ...models.joint import GRAVITY
from ..rig_file import Rig, checked_tables, shipped_rig

NAMES: tuple[str, ...] = tuple(_core.COUPLED_PARAMETER_NAMES)
"""The plant's parameters, in the core's order."""

KIND = "knee-orthosis"

FLEXOR, EXTENSOR = "lateral_hamstring", "rectus_femoris"
"""The muscle that pulls towards positive angles, and the one that pulls back."""

LOCKED = 1e9
"""Inertia of a limb that is clamped to a frame [kg*m^2]."""

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
"""What a rig file must say, table by table, and of each of its subjects."""


@dataclass(frozen=True)
class Subject:
    """Somebody who wears the orthosis: an entry of the rig file's ``[subjects]``, SI.

    Parameters
    ----------
    name, sex : str
    age, weight, height, shank_length : float
        [years], [kg], [m], [m]
    limb, strap : mapping of str to float
        As in the rig file.
    strength, emg_gain : mapping of str to float
        Of each muscle [N*m], [V].
    """

    name: str
    sex: str
    age: float
    weight: float
    height: float
    shank_length: float
    limb: Mapping[str, float]
    strap: Mapping[str, float]
    strength: Mapping[str, float]
    emg_gain: Mapping[str, float]

    @property
    def gravity(self) -> float:
        """Of shank and foot about the knee, m g l [N*m]."""
        return GRAVITY * self.limb["mass"] * self.limb["centre"]

    @property
    def inertia(self) -> float:
        """Of shank and foot about the knee [kg*m^2]."""
        return self.limb["mass"] * (self.limb["centre"] ** 2 + self.limb["gyration"] ** 2)


@dataclass(frozen=True)
class KneeRig(Rig):
    """The virtual orthosis and its wearers: the tables of a file like ``lab/rigs/knee-orthosis.toml``."""

    @property
    def period(self) -> float:
        """Of control and recording [s]."""
        return 1.0 / self["encoders"]["rate"]

    @property
    def subjects(self) -> dict[str, Subject]:
        """By name, in the file's order."""
        return {name: Subject(name=name, **values) for name, values in self["subjects"].items()}

    @property
    def orthosis_gravity(self) -> tuple[float, float]:
        """Of the orthosis per sin q and per cos q: two values [N*m]."""
        along, across = self["orthosis"]["centre"]
        weight = GRAVITY * self["orthosis"]["mass"]
        return weight * along, weight * across

    def orthosis_load(self, position: float) -> float:
        """Torque that holds the orthosis alone at an angle [rad], without friction [N*m]."""
        sine, cosine = self.orthosis_gravity
        return sine * float(np.sin(position)) + cosine * float(np.cos(position))

    def plant(self, subject: Subject | None, link: str = "strap", *, locked: bool = False) -> np.ndarray:
        """The core's parameters of the coupled plant, shape (40,), SI.

        Parameters
        ----------
        subject : Subject or None
            None: nobody is in it.
        link : {"strap", "plate"}
            What couples the subject's limb.
        locked : bool
            Whether the limb is clamped to a frame.

        Returns
        -------
        ndarray, shape (40,)
        """
        sine, cosine = self.orthosis_gravity
        orthosis, actuator, spring, loop = self["orthosis"], self["actuator"], self["spring"], self["torque_loop"]
        values = dict.fromkeys(NAMES, 0.0) | {
            **{name: actuator[name] for name in NEEDED["actuator"] if name in NAMES},
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
            coupling = self["plate"] if link == "plate" else {**self["strap"], **subject.strap}
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


def knee_orthosis() -> KneeRig:
    """The rig of ``lab/rigs/knee-orthosis.toml``."""
    return parse_knee_rig(shipped_rig("knee-orthosis"), "knee-orthosis")


def parse_knee_rig(text: str, name: str) -> KneeRig:
    """A virtual knee orthosis from the text of a rig file.

    Parameters
    ----------
    text : str
        TOML, SI.
    name : str
        Of the rig.

    Returns
    -------
    KneeRig

    Raises
    ------
    StudyError
        If the file is not TOML, is of another kind, or lacks a table, a subject or a constant.
    """
    return KneeRig(name, checked_tables(text, name, KIND, NEEDED))
