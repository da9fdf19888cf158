"""A virtual joint on a bench: its rig file, the motions it is asked for, and what its instruments write."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellucid import _core
from pellucid.models.joint import NAMES
from pellucid.models.simulate import substeps_for
from pellucid.numerics.protocols.excitation import MULTISINE_NAME, multisine, point_to_point, reversals

from ..multisine import multisine_references, multisine_study
from ..noise import draw_noise
from ..recorded_table import MAIN_STREAM, Column, StoredTable
from ..rig import DEFAULT_KIND, Rig, Taken, Trial
from ..shipped_rigs import shipped_rig
from ..stated_instruments import ENCODER_NOISE_FACTOR
from .constants import BenchConstants

COLUMNS = tuple(
    Column(name, name, unit, text="%r")
    for name, unit in (("time", "s"), ("position", "rad"), ("reference", "rad"), ("current", "A"))
)


REVERSAL_STROKES = {"smallest": 2e-3, "largest": 0.08, "frequency": 1.0}
"""Strokes about each angle of a reversal recording: smallest and largest amplitude [rad], frequency [Hz].

The frequency is low because the joint's loop is soft.
"""

COMMENTS = {
    "": "A virtual joint, recorded like a real one. Nothing below tells the physics apart from a machine's.",
    "rig.instruments": "what the supervisor of an exported controller may rely on",
    "rig.instruments.encoder_resolution": "one count, and four standard deviations of noise",
    "processing.lowpass": "well above the motion (below 3 Hz); decimation then takes both sides to 20 Hz",
    "processing.dead_band": "around reversals the joint sticks: friction is then anything up to its level",
}
"""Comments of study.toml on tables and keys."""


@dataclass(frozen=True)
class BenchRig(Rig):
    """A virtual joint, with the constants of a file like ``rigs/bench-joint.toml``."""

    constants: BenchConstants

    kind = DEFAULT_KIND
    constants_type = BenchConstants
    comments = COMMENTS

    @property
    def vector(self) -> np.ndarray:
        """Return the core's joint parameters, in the core's order, SI."""
        values = self.constants.joint.model_dump()
        return np.array([values.get(name, 0.0) for name in NAMES])

    @property
    def gain(self) -> float:
        """Return the torque at the joint per ampere [N*m/A]."""
        return self.constants.drive.torque_constant * self.constants.drive.gear_ratio

    @property
    def rate(self) -> float:
        """Return the rate of controller and recording [Hz]."""
        return self.constants.sampling.rate

    @property
    def duration(self) -> float:
        """Return the duration of each recording [s]."""
        return self.constants.sampling.duration

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """Return the columns of the one file: time, position, reference, current."""
        return {MAIN_STREAM: COLUMNS}

    def trials(self, seed: int = 1) -> tuple[Trial, ...]:
        """Return two trials to fit and two to hold out, or multisines; `seed` draws their motions."""
        looks = multisine_references(self.constants.multisine, self.rate, seed)
        if looks:
            return tuple(Trial(name, MULTISINE_NAME, use, reference=reference) for name, use, reference in looks)
        return self._trials(np.random.default_rng(seed))

    def _trials(self, rng: np.random.Generator) -> tuple[Trial, ...]:
        """Return the trials with their references [rad], which are drawn one after another."""
        span, duration, rate = self.constants.motion_range, self.duration, self.rate
        centre, half = 0.5 * (span.low + span.high), 0.5 * (span.high - span.low)

        def steps() -> np.ndarray:
            return point_to_point(duration, rate, dwell=0.2, rng=rng, **span.model_dump())

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
            Trial(name, use=use, reference=reversals(duration, rate, centres=angles, **REVERSAL_STROKES))
            for name, use in (("reversals", "fit"), ("heldout_reversals", "validate"))
            for angles in [centre + half * rng.uniform(-0.7, 0.7, self.constants.sampling.reversals)]
            if len(angles)
        )

    def draws(self, trials: Sequence[Trial], seed: int) -> Iterator[dict[str, Any]]:
        """Return one generator for all of `trials`, which has drawn their motions from `seed` before."""
        rng = np.random.default_rng(seed)
        self._trials(rng)
        return ({"rng": rng} for _ in trials)

    def record(self, trial: Trial, rng: np.random.Generator, controller: None = None) -> Taken:
        """Record a `trial` under the joint's own controller; `rng` draws noise, `controller` is unused."""
        read = self.play(trial.reference, 1, rng)
        units = ", ".join(f"{c.channel} [{c.unit}]" for c in COLUMNS)
        values = (read["time"], read["position"][0], trial.reference, read["current"][0])
        return Taken(
            trial, {trial.name: {MAIN_STREAM: StoredTable.of(COLUMNS, *values, comment=f"# units: {units}\n")}}
        )

    def play(self, reference: np.ndarray, repetitions: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the readings while the joint follows a reference [rad] repeatedly, each time with new noise.

        The keys are "time", shape (n,) [s], and "position" and "current", shape (repetitions, n) [rad], [A].
        """
        n, constants = len(reference), self.constants
        drive, encoder, loop = constants.drive, constants.encoder, constants.loop
        encoder_noise = encoder.noise * rng.standard_normal((repetitions, n))
        _, _, _, command, _, measured = _core.simulate_batch(
            np.tile(self.vector, (repetitions, 1)),
            reference=np.ascontiguousarray(reference),
            period=1.0 / self.rate,
            substeps=substeps_for(1.0 / self.rate),
            limit=drive.current_limit,
            gain=self.gain,
            encoder_quantum=2.0 * np.pi / encoder.counts_per_turn,
            encoder_noise=encoder_noise,
            ripple_amplitude=drive.ripple_amplitude,
            ripple_wave_number=drive.ripple_wave_number,
            position0=float(reference[0]),
            presliding_travel=constants.joint.presliding_travel,
            stiction=True,
            loop=loop.kind,
            kp=loop.kp,
            kv=loop.kv,
            velocity_span=loop.velocity_span,
        )
        # Sampled in the middle of a centre-aligned PWM period: half of what flowed before, half of what flows after.
        current = 0.5 * (command + np.concatenate([command[:, :1], command[:, :-1]], axis=1))
        sensed = draw_noise((repetitions, n), drive.current_noise, drive.current_noise_memory, self.rate, rng)
        return {"time": np.arange(n) / self.rate, "position": measured, "current": current + sensed}

    @property
    def drive_table(self) -> dict[str, Any]:
        """Return the table ``[rig.drive]`` of the joint's study.toml."""
        drive = self.constants.drive
        return {
            "kind": "current",
            "torque_constant": f"{drive.torque_constant} N*m/A",
            "gear_ratio": drive.gear_ratio,
            "limit": f"{drive.current_limit} A",
        }

    @property
    def instruments_table(self) -> dict[str, Any]:
        """Return the table ``[rig.instruments]`` of the joint's study.toml."""
        drive, encoder = self.constants.drive, self.constants.encoder
        quantum = 2.0 * np.pi / encoder.counts_per_turn
        return {
            "encoder_resolution": f"{quantum + ENCODER_NOISE_FACTOR * encoder.noise} rad",
            "drive_sensor": {
                "noise": f"{self.gain * drive.current_noise} N*m",
                "lag": f"{drive.current_noise_memory} s",
            },
        }

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """Return the contents of study.toml for the recordings that were `made`."""
        look = multisine_study(self.constants.multisine, made, ("current", "position"))
        if look:
            rig = {"joint": "elbow", "motion": self.constants.motion, "lifts": self.constants.lifts}
            return {**super().study(made), "rig": rig, **look}
        loop = self.constants.loop
        rig: dict[str, Any] = {
            "joint": "elbow",
            "motion": self.constants.motion,
            "lifts": self.constants.lifts,
            "drive": self.drive_table,
            "loop": {**loop.model_dump(), "limit": self.drive_table["limit"]},
            "instruments": self.instruments_table,
        }
        processing = {"lowpass": "60 Hz", "decimate": 20, "dead_band": "0.2 rad/s", "trim": 100}
        return {**super().study(made), "rig": rig, "processing": processing, "model": {"gravity": "sine"}}

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """Return the parameters of the joint, SI; they do not depend on `seed`."""
        return {"parameters": self.constants.joint.model_dump()}


def bench_joint() -> BenchRig:
    """Return the joint of ``rigs/bench-joint.toml``."""
    return BenchRig.parse(shipped_rig("bench-joint"), "bench-joint")


def matched(joint: BenchRig) -> BenchRig:
    """Return the joint without any effect that the symmetric model lacks, so that plant and model are the same.

    Tests of intervals need such a plant.
    """
    made = joint.constants.joint
    coulomb = 0.5 * (made.coulomb_positive + made.coulomb_negative)
    viscous = 0.5 * (made.viscous_positive + made.viscous_negative)
    symmetric = made.model_copy(
        update={
            "gravity_cosine": 0.0,
            "stribeck": 0.0,
            "stribeck_velocity": 0.0,
            "load_motoring": 0.0,
            "load_generating": 0.0,
            "coulomb_positive": coulomb,
            "coulomb_negative": coulomb,
            "viscous_positive": viscous,
            "viscous_negative": viscous,
        }
    )
    values = {f"joint.{name}": value for name, value in symmetric.items()}
    return joint.changed(values | {"drive.ripple_amplitude": 0.0})
