"""A virtual elbow exoskeleton with a free carriage: its rig file, and the plant's parameters for a carriage's place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import _core
from ...models.joint import GRAVITY
from ..rig_file import Rig, checked_tables, shipped_rig

NAMES: tuple[str, ...] = tuple(_core.GEARED_PARAMETER_NAMES)
"""The plant's parameters, in the core's order."""

KIND = "slider-elbow"

NEEDED = {
    "link": ("mass", "centre", "inertia"),
    "carriage": ("mass", "centre", "inertia"),
    "slider": ("low", "high", "marker_height"),
    "motor": ("rotor_inertia", "torque_constant", "gear_ratio", "current_limit", "ripple_amplitude",
              "ripple_wave_number"),
    "transmission": ("stiffness", "damping", "backlash", "coulomb_positive", "coulomb_negative", "viscous_positive",
                     "viscous_negative", "viscous_decline", "stribeck", "stribeck_velocity", "load_motoring",
                     "load_generating", "load_rise", "friction_swing", "friction_wave_number"),
    "bearing": ("coulomb", "viscous"),
    "encoder": ("counts_per_turn", "noise"),
    "current_sensor": ("noise", "noise_memory", "quantum"),
    "optical": ("rate", "noise", "quantum", "clock_offset", "clock_offset_spread", "clock_drift", "lost_share",
                "lost_length", "origin", "axis", "rail_markers", "rail_offset"),
    "range": ("low", "high", "velocity", "acceleration"),
    "loop": ("position", "velocity"),
    "sampling": ("rate",),
}  # fmt: skip
"""What a rig file must say, table by table."""


@dataclass(frozen=True)
class ElbowRig(Rig):
    """The virtual elbow: the tables of a file like ``lab/rigs/able-elbow.toml``, or of a drawn one."""

    @property
    def gain(self) -> float:
        """Torque at the joint per ampere [N*m/A]."""
        return self["motor"]["torque_constant"] * self["motor"]["gear_ratio"]

    @property
    def quantum(self) -> float:
        """Angle of the joint per count of the encoder [rad]."""
        return 2.0 * np.pi / (self["encoder"]["counts_per_turn"] * self["motor"]["gear_ratio"])

    @property
    def rotor(self) -> float:
        """Rotor inertia at the joint [kg*m^2]."""
        return self["motor"]["rotor_inertia"] * self["motor"]["gear_ratio"] ** 2

    def gravity(self, slider: float) -> tuple[float, float]:
        """Gravity torque per sin q and per cos q with the carriage's marker at `slider` [m]: two values [N*m]."""
        link, carriage = self["link"], self["carriage"]
        along = link["mass"] * link["centre"][0] + carriage["mass"] * (slider + carriage["centre"][0])
        across = link["mass"] * link["centre"][1] + carriage["mass"] * carriage["centre"][1]
        return GRAVITY * along, GRAVITY * across

    def link_inertia(self, slider: float) -> float:
        """Inertia of forearm and carriage about the axis, without the rotor [kg*m^2]."""
        link, carriage = self["link"], self["carriage"]
        total = link["inertia"] + link["mass"] * (link["centre"][0] ** 2 + link["centre"][1] ** 2)
        along, across = slider + carriage["centre"][0], carriage["centre"][1]
        return total + carriage["inertia"] + carriage["mass"] * (along**2 + across**2)

    def inertia(self, slider: float) -> float:
        """Inertia that an identification sees at the joint, rotor included [kg*m^2]."""
        return self.link_inertia(slider) + self.rotor

    def plant(self, slider: float) -> np.ndarray:
        """The core's parameters of the geared plant, shape (21,), SI, with the carriage's marker at `slider` [m]."""
        sine, cosine = self.gravity(slider)
        values = {
            "link_inertia": self.link_inertia(slider),
            "gravity_sine": sine,
            "gravity_cosine": cosine,
            "motor_inertia": self.rotor,
            "bearing_coulomb": self["bearing"]["coulomb"],
            "bearing_viscous": self["bearing"]["viscous"],
            **self["transmission"],
        }
        return np.array([values[name] for name in NAMES])

    def friction(self, velocity: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Friction of the rig itself at steady velocities under a load, without its swing along the travel [N*m].

        Parameters
        ----------
        velocity, load : ndarray, any shapes that go together
            [rad/s], [N*m].

        Returns
        -------
        ndarray, the common shape
        """
        t, b = self["transmission"], self["bearing"]
        v, y = np.broadcast_arrays(np.asarray(velocity, float), np.asarray(load, float))
        direction = np.sign(v)
        rise = np.exp(-((v / t["stribeck_velocity"]) ** 2))
        coulomb = np.where(v > 0.0, t["coulomb_positive"], t["coulomb_negative"])
        viscous = np.where(v > 0.0, t["viscous_positive"], t["viscous_negative"]) / (
            1.0 + np.abs(v) / t["viscous_decline"]
        )
        share = np.where(y * v > 0.0, t["load_motoring"], t["load_generating"]) * (1.0 + t["load_rise"] * rise)
        level = coulomb + t["stribeck"] * rise + share * np.abs(y) + b["coulomb"]
        return direction * level + (viscous + b["viscous"]) * v


def able_elbow() -> ElbowRig:
    """The rig of ``lab/rigs/able-elbow.toml``."""
    return parse_elbow_rig(shipped_rig("able-elbow"), "able-elbow")


def parse_elbow_rig(text: str, name: str) -> ElbowRig:
    """A virtual elbow from the text of a rig file.

    Parameters
    ----------
    text : str
        TOML, SI.
    name : str
        Of the rig.

    Returns
    -------
    ElbowRig

    Raises
    ------
    StudyError
        If the file is not TOML, is of another kind, or lacks a table or a constant.
    """
    return ElbowRig(name, checked_tables(text, name, KIND, NEEDED))


def drawn_rigs(rig: ElbowRig, count: int = 5, seed: int = 20261121) -> tuple[ElbowRig, ...]:
    """Further rigs, drawn uniformly from the ranges of the rig file's ``[drawn]``.

    Parameters
    ----------
    rig : ElbowRig
    count : int
    seed : int

    Returns
    -------
    tuple of ElbowRig
    """
    rng = np.random.default_rng(seed)
    ranges = rig["drawn"]
    return tuple(
        rig.changed({path: float(rng.uniform(*ends)) for path, ends in ranges.items()}, f"drawn-{i + 1}")
        for i in range(count)
    )
