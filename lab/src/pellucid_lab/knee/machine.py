"""The mechanics of a virtual knee orthosis on its wearers: the plant of the orthosis, the strap and the limb."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from pellucid import _core
from pellucid.controllers.instruments import Instruments
from pellucid.models.joint import GRAVITY

from ..rig import Rig
from ..stated_instruments import stated_instruments
from .constants import KneeConstants, StrapTable
from .subject import KneeSubject

NAMES: tuple[str, ...] = tuple(_core.COUPLED_PARAMETER_NAMES)
"""Names of the plant's parameters, in the core's order."""

LOCKED_LIMB_INERTIA = 1e9
"""Inertia that stands for a limb that is clamped to a frame [kg*m^2]."""


@dataclass(frozen=True)
class KneeMachine(Rig):
    """A virtual orthosis and its wearers as bodies; `KneeRig` adds protocol, instruments and study."""

    constants: KneeConstants

    @property
    def period(self) -> float:
        """Return the period of control and recording [s]."""
        return 1.0 / self.constants.encoders.rate

    @property
    def drive_table(self) -> dict[str, Any]:
        """Return the table ``[rig.drive]`` of the orthosis's study.toml."""
        return {"kind": "torque", "limit": f"{self.constants.actuator.torque_limit} N*m"}

    @property
    def instruments_table(self) -> dict[str, Any]:
        """Return the table ``[rig.instruments]`` of the orthosis's study.toml: encoders on both sides of its spring."""
        return {"second_encoder": True, "spring_stiffness": f"{self.constants.spring.stiffness} N*m/rad"}

    @cached_property
    def instruments(self) -> Instruments:
        """The orthosis's instruments, as its study.toml states them."""
        tables = {"drive": self.drive_table, "instruments": self.instruments_table}
        return stated_instruments({"motion": "rotary", **tables})

    @property
    def subjects(self) -> dict[str, KneeSubject]:
        """Return the wearers by name, in the file's order."""
        return {name: KneeSubject(name=name, **values) for name, values in self.constants.subjects.items()}

    @property
    def orthosis_gravity(self) -> tuple[float, float]:
        """Return the orthosis's gravity torque per sin q and per cos q [N*m]."""
        along, across = self.constants.orthosis.centre
        weight = GRAVITY * self.constants.orthosis.mass
        return weight * along, weight * across

    def strapped(self, values: Mapping[str, float]) -> Self:
        """Return the rig with some constants of every wearer's strap changed, as `without_strap_options` gives them."""
        known = StrapTable.key_names()
        changes = {f"strap.{key}": value for key, value in values.items() if key in known}
        for name, subject in self.constants.subjects.items():
            stated = [key for key, _ in subject.strap.items() if key in values]
            changes |= {f"subjects.{name}.strap.{key}": values[key] for key in stated}
        return self.changed(changes)

    def strap_of(self, subject: KneeSubject) -> dict[str, float]:
        """Return all constants of a subject's strap, SI."""
        return dict(self.constants.strap.items()) | dict(subject.strap.items())

    def orthosis_load(self, position: float) -> float:
        """Return the torque that holds the orthosis alone at an angle [rad], without friction [N*m]."""
        sine, cosine = self.orthosis_gravity
        return sine * float(np.sin(position)) + cosine * float(np.cos(position))

    def plant(self, subject: KneeSubject | None, link: str = "strap", *, locked: bool = False) -> np.ndarray:
        """Return the core's parameters of the coupled plant, shape (48,), SI.

        Without a `subject`, nobody wears the orthosis. The `link`, "strap" or "plate", couples the subject's limb; a
        `locked` limb is clamped to a frame.
        """
        sine, cosine = self.orthosis_gravity
        constants = self.constants
        orthosis, actuator = constants.orthosis, constants.actuator
        spring, loop = constants.spring, constants.torque_loop
        values = dict.fromkeys(NAMES, 0.0) | {
            **{name: value for name, value in actuator.items() if name in NAMES},
            "motor_inertia": actuator.inertia,
            "spring_stiffness": spring.stiffness,
            "spring_damping": spring.damping,
            "calibrated_stiffness": spring.stiffness * (1.0 + spring.calibration_error),
            "orthosis_inertia": orthosis.inertia,
            "gravity_sine": sine,
            "gravity_cosine": cosine,
            "bearing_coulomb": orthosis.bearing_coulomb,
            "bearing_viscous": orthosis.bearing_viscous,
            "torque_kp": loop.kp,
            "torque_ki": loop.ki,
            "torque_kd": loop.kd,
            "motor_quantum": self.constants.encoders.motor,
            "output_quantum": self.constants.encoders.output,
            "limb_inertia": LOCKED_LIMB_INERTIA,
        }
        if subject is not None:
            coupling = self.constants.plate if link == "plate" else self.strap_of(subject)
            values |= {f"strap_{name}": value for name, value in coupling.items()}
        if subject is not None and not locked:
            values |= {
                "limb_inertia": subject.inertia,
                "limb_gravity": subject.gravity,
                "limb_centre": subject.limb.ahead,
                "limb_viscous": subject.limb.viscous,
                **{f"passive_{name}": value for name, value in self.constants.passive.items()},
            }
        return np.array([values[name] for name in NAMES], float)
