"""Instruments of the pointing experiment: recordings of cameras, encoder, force sensor and electrodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..constants import RigTable
from ..emg_synthesis import Electrodes, EmgSynthesis
from ..recorded_table import MAIN_STREAM, MARKER_STREAM, Column, StoredTable, marker_columns, store_emg
from .people import Person
from .session import PointingSession

if TYPE_CHECKING:
    from .plant import PointingPlant

COMMON_COLUMNS = (Column("time", "time", "s", text="%.3f"), Column("target", "target", "rad", text="%.6f"))
"""Columns of every recording, with and without a robot."""

ROBOT_COLUMNS = (
    Column("position", "position", "rad", text="%.6f"),
    Column("interaction", "interaction", "N*m", text="%.4f"),
)
"""Additional columns of recordings with a robot."""

FOREARM_MARKERS = ("elbow", "wrist")
"""Names of the markers on the forearm."""


def record_blocks(
    rig: PointingPlant, session: PointingSession, rng: np.random.Generator
) -> Iterator[tuple[str, dict[str, StoredTable]]]:
    """Yield the name of each recording of a session and its files by stream; pauses divide the session.

    `rng` draws the instruments' noise.
    """
    size = int(rig["pointing"]["block"])
    who = f"{session.person.name}_{session.condition}"
    for i, first in enumerate(range(0, len(session.movements), size)):
        part = session.movements[first : first + size]
        yield f"{who}_{i + 1}", _block(rig, session, part[0].begin, part[-1].end, rng)


def _block(
    rig: PointingPlant, session: PointingSession, begin: int, end: int, rng: np.random.Generator
) -> dict[str, StoredTable]:
    """Return the files of the samples from `begin` to `end` of a session, by stream."""
    fs = session.fs
    # The recording begins half a second earlier, with the arm at rest on the previous target.
    lead = round(0.5 * fs)

    def cut(samples: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full(lead, samples[begin]), samples[begin:end]])

    names = ("position", "acceleration", "encoder", "interaction", "flexor", "extensor")
    signal = {name: cut(session.signals[name]) for name in names}
    target = cut(session.target)
    time = np.arange(len(target)) / fs
    first = session.movements[[m.begin for m in session.movements].index(begin)]
    target[:lead] = first.target - first.amplitude
    optical_time, markers = film_forearm(rig, session.person, time, signal["position"], rng)
    emg_time, counts = record_emg(rig, session.person, signal, 1.0 / fs, rng)
    main = StoredTable.of(COMMON_COLUMNS, time, target)
    if np.any(session.signals["link"]):
        # The sensor measures the torque of the robot on the person; the signal is the torque of the person on the
        # robot.
        measured = -signal["interaction"] + rig["force_sensor"]["noise"] * rng.standard_normal(len(time))
        main = StoredTable.of((*COMMON_COLUMNS, *ROBOT_COLUMNS), time, target, signal["encoder"], measured)
    optical = StoredTable.of(
        marker_columns(FOREARM_MARKERS), optical_time, *(markers[name] for name in FOREARM_MARKERS)
    )
    return {MAIN_STREAM: main, MARKER_STREAM: optical, "emg": store_emg(emg_time, counts, rig["emg"])}


def film_forearm(
    rig: PointingPlant, person: Person, time: np.ndarray, angle: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the cameras' clock, shape (k,) [s], and the place of each marker by name, shape (k, 3) [mm].

    `time` [s] and the forearm's `angle` [rad] have shape (n,).
    """
    camera = rig["cameras"]
    elbow = np.array(camera["elbow"], float)
    return film_segment(camera, elbow, person.forearm_length, FOREARM_MARKERS, time, angle, rng)


def film_segment(
    camera: Mapping | RigTable, joint: np.ndarray, length: float, names: tuple[str, str], time: np.ndarray,
    angle: np.ndarray, rng: np.random.Generator,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:  # fmt: skip
    """Return the cameras' clock, shape (k,) [s], and the place of two markers by name, shape (k, 3) [mm].

    One marker is at the joint, whose place is `joint`, shape (3,) [m], and one at the end of a segment of a `length`
    [m]. `camera` is a rig's table of cameras; `time` [s] and the segment's `angle` [rad] have shape (n,).
    """
    k = int(time[-1] * camera["rate"])
    clock = np.arange(k) / camera["rate"]
    q = np.interp(clock * (1.0 + camera["clock_drift"]), time, angle)
    along = np.column_stack([np.sin(q), np.zeros(k), -np.cos(q)])
    at = np.tile(joint, (k, 1))
    markers = {}
    for name, place in zip(names, (at, at + length * along), strict=True):
        noisy = place + camera["noise"] * rng.standard_normal((k, 3))
        markers[name] = np.round(noisy / camera["quantum"]) * camera["quantum"] * 1e3
    return clock, markers


def record_emg(
    rig: PointingPlant, person: Person, signal: Mapping[str, np.ndarray], period: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the EMG amplifier's clock, shape (j,) [s], and the counts of its converter, shape (j, muscles)."""
    table = rig["emg"]
    amplitude = np.column_stack(
        [share * signal[group] for share, group in zip(table["share"], table["groups"], strict=True)]
    )
    made = EmgSynthesis(Electrodes(person.emg_gains, table), len(amplitude), period, rng)
    return made.time, made.whole(amplitude, signal["acceleration"])
