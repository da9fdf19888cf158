"""What instruments make of the pointing experiment: cameras, encoder, force sensor and electrodes, as recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...recordings.optical import OpticalRecording
from ...recordings.recording import Channel, Recording
from ..emg_synthesis import Electrodes, EmgSynthesis
from .people import Person, PointingRig
from .session import Session


@dataclass(frozen=True)
class Block:
    """One recording as its files will hold it.

    Attributes
    ----------
    name, participant, condition : str
    time, target : ndarray, shape (n,)
        [s], [rad]
    position, interaction : ndarray, shape (n,), or None
        The encoder [rad] and the torque of the robot on the person [N*m]; None without a robot.
    optical_time : ndarray, shape (k,)
        [s]
    markers : dict of str to ndarray, shape (k, 3)
        [mm]
    emg_time : ndarray, shape (j,)
        [s]
    emg : ndarray, shape (j, muscles)
        Counts of the converter.
    """

    name: str
    participant: str
    condition: str
    time: np.ndarray
    target: np.ndarray
    position: np.ndarray | None
    interaction: np.ndarray | None
    optical_time: np.ndarray
    markers: dict[str, np.ndarray]
    emg_time: np.ndarray
    emg: np.ndarray


def blocks(rig: PointingRig, session: Session, rng: np.random.Generator) -> list[Block]:
    """What the instruments wrote of a session, a recording between each two pauses.

    Parameters
    ----------
    rig : PointingRig
    session : Session
    rng : numpy.random.Generator
        Draws the instruments' noise.

    Returns
    -------
    list of Block
    """
    size = int(rig["pointing"]["block"])
    made = []
    for i, first in enumerate(range(0, len(session.movements), size)):
        part = session.movements[first : first + size]
        made.append(_block(rig, session, i + 1, part[0].begin, part[-1].end, rng))
    return made


def _block(rig: PointingRig, session: Session, number: int, begin: int, end: int, rng: np.random.Generator) -> Block:
    fs = session.fs
    # Half a second of the target held before: whatever came before a pause, the arm was there.
    lead = round(0.5 * fs)

    def cut(samples: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full(lead, samples[begin]), samples[begin:end]])

    names = ("position", "acceleration", "encoder", "interaction", "flexor", "extensor")
    signal = {name: cut(session.signals[name]) for name in names}
    target = cut(session.target)
    time = np.arange(len(target)) / fs
    here = session.movements[[m.begin for m in session.movements].index(begin)]
    target[:lead] = here.target - here.amplitude
    worn = bool(np.any(session.signals["link"]))
    optical_time, markers = film_forearm(rig, session.person, time, signal["position"], rng)
    emg_time, counts = electrodes(rig, session.person, signal, 1.0 / fs, rng)
    sensor = rig["force_sensor"]
    felt = None
    if worn:
        # The robot's torque on the person is against the person's on the robot.
        felt = -signal["interaction"] + sensor["noise"] * rng.standard_normal(len(time))
    position = signal["encoder"] if worn else None
    who, condition = session.person.name, session.condition
    name = f"{who}_{condition}_{number}"
    return Block(name, who, condition, time, target, position, felt, optical_time, markers, emg_time, counts)


def film_forearm(
    rig: PointingRig, person: Person, time: np.ndarray, angle: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Markers at elbow and wrist while the forearm moves.

    Parameters
    ----------
    rig : PointingRig
    person : Person
    time, angle : ndarray, shape (n,)
        [s], [rad]
    rng : numpy.random.Generator

    Returns
    -------
    time : ndarray, shape (k,)
        On the cameras' clock [s].
    markers : dict of str to ndarray, shape (k, 3)
        [mm]
    """
    camera = rig["cameras"]
    k = int(time[-1] * camera["rate"])
    own = np.arange(k) / camera["rate"]
    q = np.interp(own * (1.0 + camera["clock_drift"]), time, angle)
    along = np.column_stack([np.sin(q), np.zeros(k), -np.cos(q)])
    elbow = np.tile(np.array(camera["elbow"], float), (k, 1))
    points = {"elbow": elbow, "wrist": elbow + person.forearm_length * along}
    markers = {}
    for name, place in points.items():
        seen = place + camera["noise"] * rng.standard_normal((k, 3))
        markers[name] = np.round(seen / camera["quantum"]) * camera["quantum"] * 1e3
    return own, markers


def electrodes(
    rig: PointingRig, person: Person, signal: Mapping[str, np.ndarray], period: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """EMG of the four muscles from the excitation of both groups.

    Parameters
    ----------
    rig : PointingRig
    person : Person
    signal : mapping of str to ndarray, shape (n,)
        flexor, extensor [1] and acceleration [rad/s^2].
    period : float
        [s]
    rng : numpy.random.Generator

    Returns
    -------
    time : ndarray, shape (j,)
        On the amplifier's clock [s].
    counts : ndarray, shape (j, muscles)
        Of the converter.
    """
    table = rig["emg"]
    amplitude = np.column_stack(
        [share * signal[group] for share, group in zip(table["share"], table["groups"], strict=True)]
    )
    made = EmgSynthesis(Electrodes(person.emg_gains, table), len(amplitude), period, rng)
    return made.time, made.whole(amplitude, signal["acceleration"])


def recordings_of(rig: PointingRig, made: Sequence[Block]) -> tuple[Recording, ...]:
    """Recordings as reading the files would give them, without files.

    Parameters
    ----------
    rig : PointingRig
    made : sequence of Block

    Returns
    -------
    tuple of Recording
    """
    emg = rig["emg"]
    found = []
    for block in made:
        digest = hashlib.sha256(block.target.tobytes() + block.markers["wrist"].tobytes()).hexdigest()
        channels = {
            "time": _channel("time", block.time, "s", "time"),
            "target": _channel("target", block.target, "rad", "target"),
        }
        if block.position is not None:
            channels["position"] = _channel("position", block.position, "rad", "position")
            channels["interaction"] = _channel("interaction", block.interaction, "N*m", "interaction")
        optical = OpticalRecording(
            Path(f"{block.name}_markers.csv"),
            digest,
            block.optical_time,
            {marker: 1e-3 * points for marker, points in block.markers.items()},
            np.array([0.0, 0.0, -1.0]),
            None,
        )
        sensed = {"time": _channel("time", block.emg_time, "s", "time")}
        for i, muscle in enumerate(emg["muscles"]):
            sensed[f"emg.{muscle}"] = _channel(f"emg.{muscle}", emg["quantum"] * block.emg[:, i], "V", muscle)
        stream = Recording(f"{block.name}.emg", Path(f"{block.name}_emg.csv"), digest, "fit", sensed)
        found.append(
            Recording(
                name=block.name,
                path=Path(f"{block.name}.csv"),
                checksum=digest,
                use="fit",
                channels=channels,
                protocol="pointing",
                participant=block.participant,
                condition=block.condition,
                optical=optical,
                streams={"emg": stream},
            )
        )
    return tuple(found)


def _channel(name: str, samples: np.ndarray, unit: str, column: str) -> Channel:
    """A channel that keeps these samples themselves: nobody writes into them any more."""
    samples.flags.writeable = False
    return Channel(name, samples, unit, column)
