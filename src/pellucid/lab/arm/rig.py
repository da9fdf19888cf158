"""A virtual arm exoskeleton of four joints and a carriage: its rig file, its plant, and its study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cached_property
from typing import Any

import numpy as np

from ... import _core
from ..._errors import StudyError
from ...models.kinematic_tree import Tree
from ...models.robot import Robot
from ..known_rigs import shipped_rig
from ..noise import draw_noise
from ..recorded_table import MAIN_STREAM, Column, StoredTable
from ..rig import Rig, Taken
from .bodies import CARRIAGE, built_gravity, built_tree, drawing, drive_rows, friction_rows, transmission_rows
from .human_motion import JOINTS
from .protocol import ArmTrial, gains_of, trials

LINK, JOINT = ("mass", "centre", "inertia", "product"), (
    "rotor_inertia", "torque_constant", "gear_ratio", "current_limit", "ripple_amplitude", "ripple_wave_number",
    "stiffness", "damping", "backlash", "coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative",
    "stribeck", "stribeck_velocity", "load_motoring", "load_generating", "bearing_coulomb", "bearing_viscous",
    "presliding_travel", "low", "high", "velocity", "acceleration",
)  # fmt: skip

NEEDED = {
    "body": ("upper_arm",),
    **{f"link.{name}": LINK for name in (*JOINTS, CARRIAGE)},
    "slider": ("low", "high", "clamped", "coulomb", "viscous"),
    "assembly": ("tilt", *(f"axis_{name}" for name in JOINTS)),
    "maker": ("mass", "centre", "inertia"),
    **{f"joint.{name}": JOINT for name in JOINTS},
    "drive": ("lag", "delay"),
    "encoder": ("counts_per_turn", "noise"),
    "current_sensor": ("noise", "noise_memory", "quantum"),
    "force_sensor": ("force_noise", "moment_noise"),
    **{f"loop.{name}": ("kp", "kv", "ki") for name in JOINTS},
    "sampling": ("rate", "velocity_span", "substeps"),
    "protocol": ("repetitions", "duration", "slow_share"),
}
"""What a rig file must say, table by table."""

COMMENTS = {
    "": "A virtual arm exoskeleton of four joints, recorded like a real one. Nothing below tells its physics apart"
    "\nfrom a machine's.",
    "tree": "all joints at once",
    "processing.dead_band": "slower, friction may be anything up to its level",
}
"""What its study.toml says beside a table or a key."""


@dataclass(frozen=True)
class ArmRig(Rig):
    """The virtual arm: the tables of a file like ``lab/rigs/able-arm.toml``, or of a drawn one."""

    kind = "serial-arm"
    comments = COMMENTS

    @classmethod
    def checked(cls, tables: dict, name: str) -> dict:
        """The tables of a rig's file, with nothing missing, those within tables too."""
        tables = super().checked(tables, name)
        for path, keys in NEEDED.items():
            found: Any = tables
            for part in path.split("."):
                found = found.get(part, {}) if isinstance(found, Mapping) else {}
            missing = [key for key in keys if key not in found]
            if missing:
                raise StudyError(f"rig {name}: [{path}] lacks {', '.join(missing)}")
        return tables

    @cached_property
    def drawing(self) -> Tree:
        """What identification is given."""
        return drawing(self.tables)

    @property
    def robot(self) -> Robot:
        """The same, with motors that turn with one joint each."""
        return Robot(self.drawing)

    @cached_property
    def built(self) -> Tree:
        """As it stands there, the carriage clamped where it is while it is identified, rotors in their joints."""
        return built_tree(self.tables, slider=self["slider"]["clamped"])

    @property
    def gains(self) -> np.ndarray:
        """Torque at each joint per ampere, shape (4,) [N m/A]."""
        return drive_rows(self.tables, free=False)[:, 0]

    @property
    def limits(self) -> np.ndarray:
        """Largest torque of each drive at its joint, shape (4,) [N m]."""
        return self.gains * [self["joint"][name]["current_limit"] for name in JOINTS]

    @property
    def quanta(self) -> np.ndarray:
        """Angle of each joint per count of its encoder, shape (4,) [rad]."""
        turn = 2.0 * np.pi / self["encoder"]["counts_per_turn"]
        return turn / np.array([self["joint"][name]["gear_ratio"] for name in JOINTS])

    def gravity(self, position: np.ndarray) -> np.ndarray:
        """Torque that holds the built robot, motors and all, `position` (n, 4) [rad]; gives (n, 4) [N m]."""
        return self.built.core.gravity(np.ascontiguousarray(position))

    def plant(self, *, slider: float | None = None, **worn: Any) -> _core.WornTree:
        """The plant of the core, in ampere; the carriage clamped at a `slider` [m] or free, the limb if any `worn`."""
        free, period = slider is None, 1.0 / self["sampling"]["rate"]
        tree = built_tree(self.tables, slider=slider, rotors=False)
        return _core.WornTree(
            tree.links_array,
            np.array(built_gravity(self.tables)),
            friction_rows(self.tables, free=free),
            period=period,
            substeps=self["sampling"]["substeps"],
            elastic=transmission_rows(self.tables, free=free),
            drives=drive_rows(self.tables, free=free),
            lag=self["drive"]["lag"],
            **worn,
        )

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
        sensor, fs = self["current_sensor"], self["sampling"]["rate"]
        reference = np.ascontiguousarray(trial.reference, float)
        plant = self.plant(slider=trial.slider)
        plant.reset(reference[0])
        command, measured, link, velocity = plant.follow(
            reference,
            np.array(gains_of(self)),
            loop="cascade",
            velocity_span=self["sampling"]["velocity_span"],
            quantum=self.quanta,
            noise=self["encoder"]["noise"] * rng.standard_normal(reference.shape),
        )
        # Sampled in the middle of a centre-aligned PWM period: half of what flowed before, half of what flows after.
        current = 0.5 * (command + np.concatenate([command[:1], command[:-1]]))
        current = current + draw_noise(current.T.shape, sensor["noise"], sensor["noise_memory"], fs, rng).T
        most = np.array([self["joint"][name]["current_limit"] for name in JOINTS])
        current = np.clip(current, -most, most)
        stored = StoredTable.of(
            self.streams()[MAIN_STREAM],
            np.arange(len(reference)) / fs,
            np.round(measured / self.quanta),
            np.round(current / sensor["quantum"]) * (1e3 * sensor["quantum"]),
        )
        inside = {"position": link, "velocity": velocity, "command": command}
        return Taken(trial, {trial.name: {MAIN_STREAM: stored}}, truth={"slider": trial.slider}, inside=inside)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        links = {link.name: link for link in self.drawing.links}
        joints = []
        for joint in self.drawing.joints:
            said, link = self["joint"][joint.name], links[joint.child]
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
                        "torque_constant": f"{said['torque_constant']} N*m/A",
                        "gear_ratio": said["gear_ratio"],
                        "limit": f"{said['current_limit']} A",
                    },
                    "limits": {
                        "position_min": f"{said['low']} rad",
                        "position_max": f"{said['high']} rad",
                        "velocity": f"{said['velocity']} rad/s",
                        "effort": f"{said['torque_constant'] * said['gear_ratio'] * said['current_limit']:g} N*m",
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
            "transmission": transmission_rows(self.tables, free=False).tolist(),
            "joints": friction_rows(self.tables, free=False).tolist(),
            "slider": self["slider"]["clamped"],
        }


def _about_centre(link: Any, centre: np.ndarray) -> np.ndarray:
    """I_xx I_xy I_xz I_yy I_yz I_zz of a link about its centre of mass, in its frame's axes."""
    shift = link.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.array(link.inertia) - shift[np.triu_indices(3)]


def able_arm() -> ArmRig:
    """The rig of ``lab/rigs/able-arm.toml``."""
    return ArmRig.parse(shipped_rig("able-arm"), "able-arm")


def drawn_arms(rig: ArmRig, count: int = 5, seed: int = 20261122) -> tuple[ArmRig, ...]:
    """As many further arms as `count`, drawn with a `seed` by the factors of a `rig` file's ``[drawn]``: each constant
    that a path matches by its own factor."""
    rng = np.random.default_rng(seed)
    constants = dict(_numbers(rig.tables))
    made = []
    for i in range(count):
        values = {
            path: constants[path] * float(rng.uniform(*ends))
            for pattern, ends in rig["drawn"].items()
            for path in constants
            if fnmatch(path, pattern)
        }
        # Where the axes ended up is another machine's, as large as this one's.
        for path, value in rig["assembly"].items():
            values[f"assembly.{path}"] = (
                np.array(value)[rng.permutation(len(value))] * rng.uniform(-1.5, 1.5)
            ).tolist()
        made.append(rig.changed(values, f"drawn-arm-{i + 1}"))
    return tuple(made)


def _numbers(tables: Mapping, path: str = ""):
    """Every number of nested tables with its dotted path."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{path}{key}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield f"{path}{key}", value
