"""What the virtual elbow's instruments write while it follows a protocol: encoder counts, current, marker frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellucid import _core
from pellucid.models.simulate import substeps_for

from ..noise import draw_noise
from .machine import ElbowMachine
from .protocol import ElbowTrial

BATCH_TRIAL_COUNT = 4
"""Number of trials that are simulated at a time, so that a long protocol needs no more memory."""


@dataclass(frozen=True)
class ElbowReadings:
    """What the instruments read of one trial."""

    trial: ElbowTrial
    time: np.ndarray  # (n,) [s]
    counts: np.ndarray  # (n,) Of the encoder
    milliamperes: np.ndarray  # (n,)
    optical_time: np.ndarray  # (k,) On the cameras' own clock [s]
    markers: dict[str, np.ndarray]  # (k, 3) [mm] in the laboratory's frame; NaN where a frame lost the marker
    clock_offset: float  # Robot time less camera time at its start [s]: the truth


def read_all(
    rig: ElbowMachine, trials: Sequence[ElbowTrial], rng: np.random.Generator, *, threads: int = 1
) -> list[ElbowReadings]:
    """Play every trial, those of one reference at once, and read the instruments."""
    groups: dict[tuple, list[int]] = {}
    for i, trial in enumerate(trials):
        groups.setdefault((trial.loop, id(trial.reference)), []).append(i)
    made: dict[int, ElbowReadings] = {}
    for (loop, _), members in groups.items():
        time = np.arange(len(trials[members[0]].reference)) / rig.constants.sampling.rate
        noise = rng.standard_normal((len(members), len(time)))
        for first in range(0, len(members), BATCH_TRIAL_COUNT):
            part = slice(first, first + BATCH_TRIAL_COUNT)
            command, measured, link = play(rig, loop, [trials[i] for i in members[part]], noise[part], threads=threads)
            for row, i in enumerate(members[part]):
                made[i] = _read(rig, trials[i], time, command[row], measured[row], link[row], rng)
    return [made[i] for i in range(len(trials))]


def play(
    rig: ElbowMachine, loop: str, batch: Sequence[ElbowTrial], noise: np.ndarray, *, threads: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Simulate trials of one reference in the core; `noise` of unit variance, shape (m, n), disturbs their encoder.

    Returns command [A], encoder reading [rad] and true position of the link [rad], each shape (m, n).
    """
    period = 1.0 / rig.constants.sampling.rate
    reference = np.ascontiguousarray(batch[0].reference, float)
    motor, gains = rig.constants.motor, getattr(rig.constants.loop, loop)
    _, _, link, _, command, measured, _ = _core.simulate_geared(
        np.array([rig.plant(trial.slider) for trial in batch]),
        reference=reference,
        period=period,
        substeps=substeps_for(period),
        threads=threads,
        loop="cascade" if loop == "position" else "velocity_pi",
        limit=motor.current_limit,
        gain=rig.gain,
        ripple_amplitude=motor.ripple_amplitude,
        ripple_wave_number=motor.ripple_wave_number,
        encoder_quantum=rig.quantum,
        encoder_noise=rig.constants.encoder.noise * noise,
        position0=np.array([trial.start for trial in batch]),
        **gains.model_dump(),
    )
    return command, measured, link


def _read(
    rig: ElbowMachine,
    trial: ElbowTrial,
    time: np.ndarray,
    command: np.ndarray,
    measured: np.ndarray,
    link: np.ndarray,
    rng: np.random.Generator,
) -> ElbowReadings:
    sensor, fs = rig.constants.current_sensor, rig.constants.sampling.rate
    # Sampled in the middle of a centre-aligned PWM period: half of what flowed before, half of what flows after.
    current = 0.5 * (command + np.concatenate([command[:1], command[:-1]]))
    current = current + draw_noise(current.shape, sensor.noise, sensor.noise_memory, fs, rng)
    current = np.clip(current, -rig.constants.motor.current_limit, rig.constants.motor.current_limit)
    optical_time, markers, offset = film(rig, trial.slider, time, link, rng)
    return ElbowReadings(
        trial,
        time,
        np.round(measured / rig.quantum),
        np.round(current / sensor.quantum) * (1e3 * sensor.quantum),
        optical_time,
        markers,
        offset,
    )


def frame(rig: ElbowMachine) -> np.ndarray:
    """Rows: down within the plane of rotation, where a lifted link goes, and the axis; shape (3, 3)."""
    axis = np.array(rig.constants.optical.axis, float)
    axis /= np.linalg.norm(axis)
    down = np.array([0.0, 0.0, -1.0])
    down -= (down @ axis) * axis
    down /= np.linalg.norm(down)
    return np.array([down, np.cross(axis, down), axis])


def film(
    rig: ElbowMachine, slider: float, time: np.ndarray, link: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, dict[str, np.ndarray], float]:
    """Frames of the markers while the link moves: the cameras' own clock, shape (k,) [s], markers, each shape (k, 3)
    [mm], and robot time less camera time [s]."""
    camera = rig.constants.optical
    offset = camera.clock_offset + camera.clock_offset_spread * rng.standard_normal()
    k = int((time[-1] - max(offset, 0.0)) * camera.rate) - 1
    own = np.arange(k) / camera.rate
    angle = np.interp(offset + own * (1.0 + camera.clock_drift), time, link)
    basis, origin = frame(rig), np.array(camera.origin, float)
    points = {"C": (slider, rig.constants.slider.marker_height, 0.0)}
    for i, (place, along_axis) in enumerate(zip(camera.rail_markers, camera.rail_offset, strict=True)):
        points[f"R{i + 1}"] = (*place, along_axis)
    cos, sin = np.cos(angle), np.sin(angle)
    markers = {}
    for name, (along, across, aside) in points.items():
        plane = np.column_stack([along * cos - across * sin, along * sin + across * cos, np.full(k, aside)])
        seen = origin + plane @ basis + camera.noise * rng.standard_normal((k, 3))
        markers[name] = np.round(seen / camera.quantum) * camera.quantum * 1e3
    length = max(round(camera.lost_length * camera.rate), 1)
    for start in rng.integers(0, k, rng.poisson(camera.lost_share * k / length)):
        markers["C"][start : start + length] = np.nan
    return own, markers, float(offset)
