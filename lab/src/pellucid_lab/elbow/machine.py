"""The mechanics of a virtual elbow exoskeleton with a sliding carriage: the plant for each place of the carriage."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pellucid import _core
from pellucid.controllers.instruments import Instruments
from pellucid.models.joint import GRAVITY

from ..rig import Rig
from ..stated_instruments import ENCODER_NOISE_FACTOR, stated_instruments
from .constants import ElbowConstants

NAMES: tuple[str, ...] = tuple(_core.GEARED_PARAMETER_NAMES)
"""Names of the plant's parameters, in the core's order."""


@dataclass(frozen=True)
class ElbowMachine(Rig):
    """A virtual elbow as a machine; `ElbowRig` adds its protocol, its instruments and its study."""

    constants: ElbowConstants

    @property
    def gain(self) -> float:
        """Return the torque at the joint per ampere [N*m/A]."""
        motor = self.constants.motor
        return motor.torque_constant * motor.gear_ratio

    @property
    def quantum(self) -> float:
        """Return the angle of the joint per count of the encoder [rad]."""
        return 2.0 * np.pi / (self.constants.encoder.counts_per_turn * self.constants.motor.gear_ratio)

    @property
    def drive_table(self) -> dict[str, Any]:
        """Return the table ``[rig.drive]`` of the robot's study.toml."""
        motor = self.constants.motor
        return {
            "kind": "current",
            "torque_constant": f"{motor.torque_constant} N*m/A",
            "gear_ratio": motor.gear_ratio,
            "limit": f"{motor.current_limit} A",
        }

    @property
    def instruments_table(self) -> dict[str, Any]:
        """Return the table ``[rig.instruments]`` of the robot's study.toml."""
        current, force = self.constants.current_sensor, self.constants.force_sensor
        stated: dict[str, Any] = {
            "encoder_resolution": f"{self.quantum + ENCODER_NOISE_FACTOR * self.constants.encoder.noise} rad",
            "drive_sensor": {"noise": f"{self.gain * current.noise} N*m", "lag": f"{current.noise_memory} s"},
        }
        return stated if force is None else {**stated, "force_sensor": {"range": f"{force.range} N*m"}}

    @cached_property
    def instruments(self) -> Instruments:
        """The robot's instruments, as its study.toml states them."""
        tables = {"drive": self.drive_table, "instruments": self.instruments_table}
        return stated_instruments({"motion": "rotary", **tables})

    @property
    def rotor(self) -> float:
        """Return the rotor's inertia at the joint [kg*m^2]."""
        return self.constants.motor.rotor_inertia * self.constants.motor.gear_ratio**2

    def gravity(self, slider: float) -> tuple[float, float]:
        """Return the gravity torque per sin q and per cos q [N*m] with the carriage's marker at `slider` [m]."""
        link, carriage = self.constants.link, self.constants.carriage
        along = link.mass * link.centre[0] + carriage.mass * (slider + carriage.centre[0])
        across = link.mass * link.centre[1] + carriage.mass * carriage.centre[1]
        return GRAVITY * along, GRAVITY * across

    def link_inertia(self, slider: float) -> float:
        """Return the inertia of forearm and carriage about the axis, without the rotor [kg*m^2]."""
        link, carriage = self.constants.link, self.constants.carriage
        total = link.inertia + link.mass * (link.centre[0] ** 2 + link.centre[1] ** 2)
        along, across = slider + carriage.centre[0], carriage.centre[1]
        return total + carriage.inertia + carriage.mass * (along**2 + across**2)

    def inertia(self, slider: float) -> float:
        """Return the inertia that an identification finds at the joint, rotor included [kg*m^2]."""
        return self.link_inertia(slider) + self.rotor

    def plant(self, slider: float) -> np.ndarray:
        """Return the core's parameters of the geared plant, shape (23,), SI, for a place of the carriage [m]."""
        sine, cosine = self.gravity(slider)
        values = {
            "link_inertia": self.link_inertia(slider),
            "gravity_sine": sine,
            "gravity_cosine": cosine,
            "motor_inertia": self.rotor,
            "bearing_coulomb": self.constants.bearing.coulomb,
            "bearing_viscous": self.constants.bearing.viscous,
            **self.constants.transmission.model_dump(),
        }
        return np.array([values.get(name, 0.0) for name in NAMES])

    def friction(self, velocity: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Return the friction of the machine [N*m] at steady velocities [rad/s] under a load [N*m].

        Velocities and loads have shapes that broadcast. The variation of friction along the travel is neglected.
        """
        transmission, bearing = self.constants.transmission, self.constants.bearing
        v, y = np.broadcast_arrays(np.asarray(velocity, float), np.asarray(load, float))
        direction = np.sign(v)
        rise = np.exp(-((v / transmission.stribeck_velocity) ** 2))
        coulomb = np.where(v > 0.0, transmission.coulomb_positive, transmission.coulomb_negative)
        viscous = np.where(v > 0.0, transmission.viscous_positive, transmission.viscous_negative) / (
            1.0 + np.abs(v) / transmission.viscous_decline
        )
        share = np.where(y * v > 0.0, transmission.load_motoring, transmission.load_generating) * (
            1.0 + transmission.load_rise * rise
        )
        level = coulomb + transmission.stribeck * rise + share * np.abs(y) + bearing.coulomb
        return direction * level + (viscous + bearing.viscous) * v
