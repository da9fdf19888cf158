"""A virtual arm exoskeleton of four joints and a carriage: its rig file, its plant, and its study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from typing import Any

import numpy as np

from ..noise import draw_noise
from ..recorded_table import MAIN_STREAM, Column, StoredTable
from ..rig import Taken
from ..shipped_rigs import shipped_rig
from .bodies import friction_rows, transmission_rows
from .constants import ArmConstants
from .human_motion import JOINTS
from .machine import ArmMachine
from .protocol import ArmTrial, gains_of, trials

COMMENTS = {
    "": "A virtual arm exoskeleton of four joints, recorded like a real one. Nothing below tells its physics apart"
    "\nfrom a machine's.",
    "tree": "all joints at once",
    "processing.dead_band": "slower, friction may be anything up to its level",
}
"""Comments of study.toml on tables and keys."""


@dataclass(frozen=True)
class ArmRig(ArmMachine):
    """The virtual arm with its protocol and instruments, of a file like ``rigs/able-arm.toml``."""

    kind = "serial-arm"
    constants_type = ArmConstants
    comments = COMMENTS

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """The robot's file."""
        counts = (
            Column(f"position.{n}", f"counts_{n}", "rad", float(q)) for n, q in zip(JOINTS, self.quanta, strict=True)
        )
        currents = (Column(f"current.{name}", f"current_{name}", "mA") for name in JOINTS)
        return {MAIN_STREAM: (Column("time", "time", "s", text="%.3f"), *counts, *currents)}

    def trials(self, seed: int = 1) -> tuple[ArmTrial, ...]:
        """The full protocol; `seed` draws its Fourier motions and what is reached for."""
        return trials(self, seed)

    def record(self, trial: ArmTrial, rng: np.random.Generator, controller: None = None) -> Taken:
        """Do a `trial` under the robot's own loops; no `controller`; noise from `rng`."""
        sensor, fs = self.constants.current_sensor, self.constants.sampling.rate
        reference = np.ascontiguousarray(trial.reference, float)
        plant = self.plant(slider=trial.slider)
        plant.reset(reference[0])
        command, measured, link, velocity = plant.follow(
            reference,
            np.array(gains_of(self)),
            loop="cascade",
            velocity_span=self.constants.sampling.velocity_span,
            quantum=self.quanta,
            noise=self.constants.encoder.noise * rng.standard_normal(reference.shape),
        )
        # Sampled in the middle of a centre-aligned PWM period: half of what flowed before, half of what flows after.
        current = 0.5 * (command + np.concatenate([command[:1], command[:-1]]))
        current = current + draw_noise(current.T.shape, sensor.noise, sensor.noise_memory, fs, rng).T
        most = np.array([self.constants.joint[name].current_limit for name in JOINTS])
        current = np.clip(current, -most, most)
        stored = StoredTable.of(
            self.streams()[MAIN_STREAM],
            np.arange(len(reference)) / fs,
            np.round(measured / self.quanta),
            np.round(current / sensor.quantum) * (1e3 * sensor.quantum),
        )
        inside = {"position": link, "velocity": velocity, "command": command}
        return Taken(trial, {trial.name: {MAIN_STREAM: stored}}, truth={"slider": trial.slider}, inside=inside)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        links = {link.name: link for link in self.drawing.links}
        joints = []
        for joint in self.drawing.joints:
            said, link = self.constants.joint[joint.name], links[joint.child]
            centre = np.array(link.moment) / link.mass
            joints.append(
                {
                    "name": joint.name,
                    "motion": "rotary",
                    "lifts": joint.name.replace("_", " "),
                    "parent": "base" if joint.parent == self.drawing.base else joint.parent,
                    "place": [f"{x:g} m" for x in joint.place],
                    "axis": [float(x) for x in joint.axis],
                    "rotor_inertia": f"{joint.rotor_inertia:.4g} kg*m^2",
                    "body": {
                        "mass": f"{link.mass:.4g} kg",
                        "centre": [f"{x:.4g} m" for x in centre],
                        "inertia": [f"{x:.4g} kg*m^2" for x in _about_centre(link, centre)],
                    },
                    "drive": {
                        "kind": "current",
                        "torque_constant": f"{said.torque_constant} N*m/A",
                        "gear_ratio": said.gear_ratio,
                        "limit": f"{said.current_limit} A",
                    },
                    "limits": {
                        "position_min": f"{said.low} rad",
                        "position_max": f"{said.high} rad",
                        "velocity": f"{said.velocity} rad/s",
                        "effort": f"{said.torque_constant * said.gear_ratio * said.current_limit:g} N*m",
                    },
                }
            )
        processing = {"lowpass": "8 Hz", "decimate": 20, "dead_band": "0.05 rad/s", "trim": 500}
        return {**super().study(made), "rig": {"joints": joints}, "processing": processing, "tree": {}}

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """The robot as it was built, SI, the carriage clamped; no `seed` draws it."""
        tree = self.built
        return {
            "names": list(JOINTS),
            "bodies": [joint.child for joint in tree.order],
            "links": tree.links_array.tolist(),
            "gravity": list(tree.gravity),
            "transmission": transmission_rows(self.constants, free=False).tolist(),
            "joints": friction_rows(self.constants, free=False).tolist(),
            "slider": self.constants.slider.clamped,
        }


def _about_centre(link: Any, centre: np.ndarray) -> np.ndarray:
    """I_xx I_xy I_xz I_yy I_yz I_zz of a link about its centre of mass, in its frame's axes."""
    shift = link.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.array(link.inertia) - shift[np.triu_indices(3)]


def able_arm() -> ArmRig:
    """The rig of ``rigs/able-arm.toml``."""
    return ArmRig.parse(shipped_rig("able-arm"), "able-arm")


def drawn_arms(rig: ArmRig, count: int = 5, seed: int = 20261122) -> tuple[ArmRig, ...]:
    """Return `count` further arms, drawn with a `seed` by the factors of ``[drawn]`` in the file of a `rig`.

    Each constant that a path of ``[drawn]`` matches has a factor of its own.
    """
    rng = np.random.default_rng(seed)
    constants = dict(_numbers(rig.tables))
    made = []
    for i in range(count):
        values: dict[str, object] = {
            path: constants[path] * float(rng.uniform(*ends))
            for pattern, ends in rig.constants.drawn.items()
            for path in constants
            if fnmatch(path, pattern)
        }
        # The errors of the assembly are another machine's, of the same size as this one's.
        for path, value in rig.constants.assembly.items():
            values[f"assembly.{path}"] = (
                np.array(value)[rng.permutation(len(value))] * rng.uniform(-1.5, 1.5)
            ).tolist()
        made.append(rig.changed(values, f"drawn-arm-{i + 1}"))
    return tuple(made)


def _numbers(tables: Mapping, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number of nested tables with its dotted path."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{path}{key}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield f"{path}{key}", value
