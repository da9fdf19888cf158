"""A virtual joint on a bench: its rig file, the motions it is asked for, and what its instruments write."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ..._errors import StudyError
from ...models.joint import NAMES
from ...models.simulate import substeps_for
from ...protocols.excitation import multisine, point_to_point
from ...protocols.random_phase_multisine import MULTISINE_NAME
from ...protocols.reversals import reversals
from ..known_rigs import shipped_rig
from ..multisine import multisine_references, multisine_study
from ..noise import draw_noise
from ..recorded_table import MAIN_STREAM, Column, StoredTable
from ..rig import BENCH, Rig, Taken, Trial

COLUMNS = tuple(
    Column(name, name, unit, text="%r")
    for name, unit in (("time", "s"), ("position", "rad"), ("reference", "rad"), ("current", "A"))
)


NEEDED = {
    "": ("motion", "lifts"),
    "joint": (),
    "drive": ("torque_constant", "gear_ratio", "ripple_amplitude", "ripple_wave_number", "current_limit",
              "current_noise", "current_noise_memory"),
    "encoder": ("counts_per_turn", "noise"),
    "loop": ("kind", "kp", "kv", "velocity_span"),
    "motion_range": ("low", "high", "velocity", "acceleration"),
    "sampling": ("rate", "duration"),
}  # fmt: skip
"""What a rig file must say, table by table."""

TRAVEL = "presliding_travel"
STROKES = {"smallest": 2e-3, "largest": 0.08, "frequency": 1.0}  # rad, rad, Hz: its loop is soft

COMMENTS = {
    "": "A virtual joint, recorded like a real one. Nothing below tells the physics apart from a machine's.",
    "processing.lowpass": "well above the motion (below 3 Hz); decimation then takes both sides to 20 Hz",
    "processing.dead_band": "around reversals the joint sticks: friction is then anything up to its level",
}
"""What its study.toml says beside a table or a key."""


@dataclass(frozen=True)
class BenchRig(Rig):
    """A virtual joint: the tables of a file like ``lab/rigs/bench-joint.toml``; a constant of ``[joint]`` that it
    leaves out is zero."""

    kind = BENCH
    needed = NEEDED
    free = ("joint",)
    comments = COMMENTS

    @classmethod
    def checked(cls, tables: dict, name: str) -> dict:
        """The tables, with zeros for what the joint lacks."""
        tables = super().checked(tables, name)
        strange = [key for key in tables["joint"] if key not in (*NAMES, TRAVEL)]
        if strange:
            raise StudyError(
                f"rig {name}: [joint] found {', '.join(strange)}, expected some of {', '.join([*NAMES, TRAVEL])}"
            )
        joint = dict.fromkeys((*NAMES, TRAVEL), 0.0) | tables["joint"]
        return {**tables, "joint": joint, "sampling": {"reversals": 0} | tables["sampling"]}

    @property
    def vector(self) -> np.ndarray:
        """The core's joint parameters, shape (14,), SI."""
        return np.array([self["joint"][name] for name in NAMES], float)

    @property
    def gain(self) -> float:
        """Effort at the joint per ampere [N*m/A]."""
        return self["drive"]["torque_constant"] * self["drive"]["gear_ratio"]

    @property
    def rate(self) -> float:
        """Of controller and recording [Hz]."""
        return self["sampling"]["rate"]

    @property
    def duration(self) -> float:
        """Of each recording [s]."""
        return self["sampling"]["duration"]

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """One file: time, position, reference, current."""
        return {MAIN_STREAM: COLUMNS}

    def trials(self, seed: int = 1) -> tuple[Trial, ...]:
        """The motions a lab would ask for, drawn from `seed`: two to fit and two to hold out, or a first look."""
        looks = multisine_references(self, self.rate, seed)
        if looks:
            return tuple(Trial(name, MULTISINE_NAME, use, reference=reference) for name, use, reference in looks)
        return self._trials(np.random.default_rng(seed))

    def _trials(self, rng: np.random.Generator) -> tuple[Trial, ...]:
        """References [rad], drawn one after another."""
        span, duration, rate = self["motion_range"], self.duration, self.rate
        centre, half = 0.5 * (span["low"] + span["high"]), 0.5 * (span["high"] - span["low"])

        def steps() -> np.ndarray:
            return point_to_point(duration, rate, dwell=0.2, rng=rng, **span)

        def waves(fundamental: float, harmonics: int, amplitude: float) -> np.ndarray:
            shape = {"fundamental": fundamental, "harmonics": harmonics, "amplitude": amplitude, "centre": centre}
            return multisine(duration, rate, rng=rng, **shape)

        made = (
            Trial("point_to_point", reference=steps()),
            Trial("multisine", reference=waves(0.1, 12, half)),
            Trial("heldout_point_to_point", use="validate", reference=steps()),
            Trial("heldout_multisine", use="validate", reference=waves(0.13, 8, 0.8 * half)),
        )
        return made + tuple(
            Trial(name, use=use, reference=reversals(duration, rate, centres=angles, **STROKES))
            for name, use in (("reversals", "fit"), ("heldout_reversals", "validate"))
            for angles in [centre + half * rng.uniform(-0.7, 0.7, max(0, self["sampling"]["reversals"]))]
            if len(angles)
        )

    def draws(self, trials: Sequence[Trial], seed: int) -> Iterator[dict[str, Any]]:
        """One generator for all of `trials`, which has drawn their motions from `seed` before."""
        rng = np.random.default_rng(seed)
        self._trials(rng)
        return ({"rng": rng} for _ in trials)

    def record(self, trial: Trial, rng: np.random.Generator, controller: None = None) -> Taken:
        """Follow the reference of a `trial` [rad] under the joint's own loop; no `controller`; noise from `rng`."""
        read = self.play(trial.reference, 1, rng)
        units = ", ".join(f"{c.channel} [{c.unit}]" for c in COLUMNS)
        values = (read["time"], read["position"][0], trial.reference, read["current"][0])
        return Taken(
            trial, {trial.name: {MAIN_STREAM: StoredTable.of(COLUMNS, *values, comment=f"# units: {units}\n")}}
        )

    def play(self, reference: np.ndarray, repetitions: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """What instruments read while the joint follows a reference, again and again with new noise: "time", shape
        (n,) [s]; "position" and "current", shape (repetitions, n), [rad], [A]."""
        n, drive, encoder, loop = len(reference), self["drive"], self["encoder"], self["loop"]
        encoder_noise = encoder["noise"] * rng.standard_normal((repetitions, n))
        _, _, _, command, _, measured = _core.simulate_batch(
            np.tile(self.vector, (repetitions, 1)),
            reference=np.ascontiguousarray(reference),
            period=1.0 / self.rate,
            substeps=substeps_for(1.0 / self.rate),
            limit=drive["current_limit"],
            gain=self.gain,
            encoder_quantum=2.0 * np.pi / encoder["counts_per_turn"],
            encoder_noise=encoder_noise,
            ripple_amplitude=drive["ripple_amplitude"],
            ripple_wave_number=drive["ripple_wave_number"],
            position0=float(reference[0]),
            presliding_travel=self["joint"][TRAVEL],
            stiction=True,
            loop=loop["kind"],
            kp=loop["kp"],
            kv=loop["kv"],
            velocity_span=loop["velocity_span"],
        )
        # Sampled in the middle of a centre-aligned PWM period: half of what flowed before, half of what flows after.
        current = 0.5 * (command + np.concatenate([command[:, :1], command[:, :-1]], axis=1))
        sensed = draw_noise((repetitions, n), drive["current_noise"], drive["current_noise_memory"], self.rate, rng)
        return {"time": np.arange(n) / self.rate, "position": measured, "current": current + sensed}

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        look = multisine_study(self, made, ("current", "position"))
        if look:
            rig = {"joint": "elbow", "motion": self["motion"], "lifts": self["lifts"]}
            return {**super().study(made), "rig": rig, **look}
        drive, loop = self["drive"], self["loop"]
        limit = f"{drive['current_limit']} A"
        rig = {
            "joint": "elbow",
            "motion": self["motion"],
            "lifts": self["lifts"],
            "drive": {
                "kind": "current",
                "torque_constant": f"{drive['torque_constant']} N*m/A",
                "gear_ratio": drive["gear_ratio"],
                "limit": limit,
            },
            "loop": {**{key: loop[key] for key in ("kind", "kp", "kv", "velocity_span")}, "limit": limit},
        }
        processing = {"lowpass": "60 Hz", "decimate": 20, "dead_band": "0.2 rad/s", "trim": 100}
        return {**super().study(made), "rig": rig, "processing": processing, "model": {"gravity": "sine"}}

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """Its joint's parameters; no `seed` draws them."""
        return {"parameters": {name: float(value) for name, value in self["joint"].items()}}


def bench_joint() -> BenchRig:
    """The joint of ``lab/rigs/bench-joint.toml``."""
    return BenchRig.parse(shipped_rig("bench-joint"), "bench-joint")


def matched(joint: BenchRig) -> BenchRig:
    """The same joint without anything the symmetric model lacks: to test intervals, plant must equal model."""
    lacks = ("gravity_cosine", "stribeck", "stribeck_velocity", "load_motoring", "load_generating")
    values = {f"joint.{name}": 0.0 for name in lacks} | {"drive.ripple_amplitude": 0.0}
    for kind in ("coulomb", "viscous"):
        mean = 0.5 * (joint["joint"][f"{kind}_positive"] + joint["joint"][f"{kind}_negative"])
        values |= {f"joint.{kind}_{side}": mean for side in ("positive", "negative")}
    return joint.changed(values)
