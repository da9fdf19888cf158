"""A virtual elbow exoskeleton with a free carriage: its rig file, and the plant's parameters for a carriage's place."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ...models.joint import GRAVITY
from ..known_rigs import shipped_rig
from ..recorded_table import MAIN_STREAM, MARKER_STREAM, Column, StoredTable, marker_columns
from ..rig import Outcome, Rig, Taken, Tell
from .instruments import ElbowReadings, frame, read_all
from .protocol import ElbowTrial, excitation, trials

NAMES: tuple[str, ...] = tuple(_core.GEARED_PARAMETER_NAMES)
"""The plant's parameters, in the core's order."""

CARRIAGE, RAIL = "C", ("R1", "R2", "R3")
"""Markers on the carriage and on the rail."""

WEIGHING_STEP = 0.005  # kg: of the scale the carriage is put on


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

COMMENTS = {
    "": "A virtual elbow exoskeleton, recorded like a real one. Nothing below tells its physics apart"
    "\nfrom a machine's.",
    "rig.moving_mass": "an upper limit: what the forearm with its carriage may weigh",
    "rig.slider": "a carriage on the forearm; clamped at one place during each recording",
    "rig.slider.mass": "taken off and weighed",
    "optical": "motion capture, on its own clock",
    "processing.lowpass": "both passes together: -3 dB at 4.5 Hz, as the moving mean of 100 samples had",
    "processing.dead_band": "slower, friction may be anything up to its level",
}
"""What its study.toml says beside a table or a key."""


@dataclass(frozen=True)
class ElbowRig(Rig):
    """The virtual elbow: the tables of a file like ``lab/rigs/able-elbow.toml``, or of a drawn one."""

    kind = "slider-elbow"
    needed = NEEDED
    comments = COMMENTS

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
        """The core's parameters of the geared plant, shape (23,), SI, with the carriage's marker at `slider` [m]."""
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
        return np.array([values.get(name, 0.0) for name in NAMES])

    def friction(self, velocity: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Friction of the rig itself at steady velocities [rad/s] under a load [N*m], without its swing along the
        travel [N*m]; any shapes that go together."""
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

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """The robot's file, and the cameras'."""
        own = (
            Column("time", "time", "s", text="%.3f"),
            Column("position", "counts", "rad", self.quantum),
            Column("current", "current", "mA"),
        )
        return {MAIN_STREAM: own, MARKER_STREAM: marker_columns((CARRIAGE, *RAIL))}

    def trials(self, seed: int = 1) -> tuple[ElbowTrial, ...]:
        """The full protocol, with an excitation optimised for this rig; no `seed` draws it."""
        return trials(self, excitation)

    def record(self, trial: ElbowTrial, rng: np.random.Generator, controller: None = None) -> Taken:
        """Do a `trial` under the robot's own loop; no `controller`; noise from `rng`."""
        return self._taken(*read_all(self, (trial,), rng))

    def record_all(
        self,
        trials: Sequence[ElbowTrial],
        seed: int,
        *,
        then: Callable[[Taken], Outcome] = lambda taken: taken,
        threads: int = 1,
        on_progress: Tell | None = None,
    ) -> Iterator[Outcome]:
        """As `Rig.record_all` of `trials`, `seed`, `then`, `threads` and `on_progress`, all noise from one generator:
        trials of one reference are moved at once."""
        tell = on_progress or (lambda text, share: None)
        tell("moving the virtual elbow", 0.05)
        for i, read in enumerate(read_all(self, trials, np.random.default_rng(seed), threads=threads)):
            tell("writing recordings", 0.2 + 0.8 * i / len(trials))
            yield then(self._taken(read))

    def _taken(self, read: ElbowReadings) -> Taken:
        columns = self.streams()
        own = StoredTable.of(columns[MAIN_STREAM], read.time, read.counts, read.milliamperes)
        seen = StoredTable.of(columns[MARKER_STREAM], read.optical_time, *read.markers.values())
        truth = {"slider": read.trial.slider, "clock_offset": read.clock_offset}
        return Taken(read.trial, {read.trial.name: {MAIN_STREAM: own, MARKER_STREAM: seen}}, truth=truth, inside=read)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        motor, slider, span = self["motor"], self["slider"], self["range"]
        mass = 1.5 * (self["link"]["mass"] + self["carriage"]["mass"])
        weighed = round(self["carriage"]["mass"] / WEIGHING_STEP) * WEIGHING_STEP
        rig = {
            "joint": "elbow",
            "motion": "rotary",
            "lifts": self["lifts"],
            "moving_mass": f"{mass:.1f} kg",
            "drive": {
                "kind": "current",
                "torque_constant": f"{motor['torque_constant']} N*m/A",
                "gear_ratio": motor["gear_ratio"],
                "limit": f"{motor['current_limit']} A",
            },
            "slider": {
                "low": f"{slider['low']} m",
                "high": f"{slider['high']} m",
                "marker": CARRIAGE,
                "mass": f"{weighed:.3f} kg",
            },
            "limits": {"position_min": f"{span['low'] - 0.1} rad", "position_max": f"{span['high'] + 0.1} rad"},
        }
        processing = {"lowpass": "5 Hz", "dead_band": "0.1 rad/s", "trim": 500}
        return {**super().study(made), "rig": rig, "processing": processing, "model": {"gravity": "sine+cosine"}}

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """The plant, SI, with the carriage at 0; no `seed` draws it."""
        link, carriage = self["link"], self["carriage"]
        return {
            "carriage_mass": carriage["mass"],
            "gravity": GRAVITY * (link["mass"] * link["centre"][0] + carriage["mass"] * carriage["centre"][0]),
            "gravity_cosine": self.gravity(0.0)[1],
            "inertia": self.inertia(0.0),
            "carriage_moment": carriage["mass"] * carriage["centre"][0],
            "axis": frame(self)[2].tolist(),
            "transmission": dict(self["transmission"]),
        }


def able_elbow() -> ElbowRig:
    """The rig of ``lab/rigs/able-elbow.toml``."""
    return ElbowRig.parse(shipped_rig("able-elbow"), "able-elbow")


def drawn_rigs(rig: ElbowRig, count: int = 5, seed: int = 20261121) -> tuple[ElbowRig, ...]:
    """As many further rigs as `count`, drawn with a `seed` from the ranges of a `rig` file's ``[drawn]``."""
    rng = np.random.default_rng(seed)
    ranges = rig["drawn"]
    return tuple(
        rig.changed({path: float(rng.uniform(*ends)) for path, ends in ranges.items()}, f"drawn-{i + 1}")
        for i in range(count)
    )
