"""The pointing experiment's recordings: markers, encoder, targets and EMG, as files of a study or in memory."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ...recordings.optical import OpticalRecording
from ...recordings.recording import Channel, Recording
from ...recordings.study import Study, open_study
from ...recordings.study_file import StudyFile, rig_units
from ..emg_synthesis import Electrodes, EmgSynthesis
from .people import Person, PointingRig, draw_people
from .session import Law, Session, point_all

CONTROL = "Ctrl"
"""The condition without a robot."""

Conditions = Mapping[str, Callable[[Person, float], Law] | None]
"""By condition: a law for a person and the place of the carriage [m]; None where no robot is worn."""

HEAD = """\
# People who point with the forearm, free and strapped to an elbow robot. Nothing below tells them from real ones.
name = "{name}"

[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"

{people}
[channels]
time = {{ column = "time", unit = "s" }}
target = {{ column = "target", unit = "rad" }}

[streams.emg.channels]
time = {{ column = "time", unit = "s" }}
{muscles}

[optical]                       # motion capture, on its own clock
time = {{ column = "time", unit = "s" }}
unit = "mm"
markers = ["elbow", "wrist"]
down = [0, 0, -1]

[assessment]
control = "{control}"
segment = ["elbow", "wrist"]
agonists = {agonists}
antagonists = {antagonists}
interaction = "interaction"
"""

PERSON = """\
[participants.{name}]
mass = "{mass:.1f} kg"
height = "{height:.2f} m"
age = {age:.0f}
sex = "{sex}"
"""

ENTRY = """
[[recordings]]
name = "{name}"
file = "recordings/{name}.csv"
optical = "recordings/{name}_markers.csv"
streams = {{ emg = "recordings/{name}_emg.csv" }}
protocol = "pointing"
participant = "{participant}"
condition = "{condition}"
"""

ROBOT = """\
channels.position = { column = "position", unit = "rad" }
"""

SENSED = """\
channels.interaction = { column = "interaction", unit = "N*m" }
"""


@dataclass(frozen=True)
class Block:
    """One recording as its files will hold it.

    Attributes
    ----------
    name : str
    session : Session
        Of which it is a part.
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
    session: Session
    time: np.ndarray
    target: np.ndarray
    position: np.ndarray | None
    interaction: np.ndarray | None
    optical_time: np.ndarray
    markers: dict[str, np.ndarray]
    emg_time: np.ndarray
    emg: np.ndarray


def appointments(
    rig: PointingRig, conditions: Conditions, *, seed: int, people: Sequence[Person] | None = None
) -> list[tuple[PointingRig, Person, str, Law | None, np.random.Generator]]:
    """Who points when, under which law, with which draws: the arguments of `session.point` for each session.

    Parameters
    ----------
    rig : PointingRig
    conditions : mapping
        As `Conditions`.
    seed : int
        Of every random draw.
    people : sequence of Person, optional
        Six drawn with the seed if left out.

    Returns
    -------
    list of tuple
    """
    root = np.random.default_rng(seed)
    people = draw_people(rig, root) if people is None else people
    jobs = []
    for person in people:
        # Learning starts anew in each: two minutes' pause and another law lie in between, and nobody is told which.
        for name in root.permutation(list(conditions)):
            make = conditions[str(name)]
            law = None if make is None else make(person, person.slider(rig))
            jobs.append((rig, person, str(name), law, root.spawn(1)[0]))
    return jobs


def take_part(
    rig: PointingRig,
    conditions: Conditions,
    *,
    seed: int,
    people: Sequence[Person] | None = None,
    threads: int = 1,
) -> list[Session]:
    """Everybody in every condition; each in an order of conditions of their own, in which the sessions come back.

    Parameters
    ----------
    rig : PointingRig
    conditions : mapping
        As `Conditions`.
    seed : int
        Of every random draw.
    people : sequence of Person, optional
        Six drawn with the seed if left out.
    threads : int

    Returns
    -------
    list of Session
    """
    return point_all(appointments(rig, conditions, seed=seed, people=people), threads=threads)


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
    index = np.concatenate([np.full(lead, begin), np.arange(begin, end)])
    signal = {name: samples[index] for name, samples in session.signals.items()}
    time = np.arange(len(index)) / fs
    target = session.target[index].copy()
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
    name = f"{session.person.name}_{session.condition}_{number}"
    return Block(name, session, time, target, position, felt, optical_time, markers, emg_time, counts)


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


def study_text(rig: PointingRig, people: Sequence[Person], made: Sequence[Block], name: str) -> str:
    """The study.toml of the experiment.

    Parameters
    ----------
    rig : PointingRig
    people : sequence of Person
    made : sequence of Block
    name : str

    Returns
    -------
    str
    """
    emg = rig["emg"]
    muscles = "\n".join(f'emg.{m} = {{ column = "{m}", unit = "V" }}' for m in emg["muscles"])
    of = {
        group: [m for m, g in zip(emg["muscles"], emg["groups"], strict=True) if g == group] for group in emg["groups"]
    }
    head = HEAD.format(
        name=name,
        people="\n".join(PERSON.format(**asdict(person)) for person in people),
        muscles=muscles,
        control=CONTROL,
        agonists=json.dumps(of["flexor"]),
        antagonists=json.dumps(of["extensor"]),
    )
    entries = []
    for block in made:
        person, condition = block.session.person.name, block.session.condition
        entry = ENTRY.format(name=block.name, participant=person, condition=condition)
        entries.append(entry + (ROBOT + SENSED if block.position is not None else ""))
    return head + "".join(entries)


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
            "time": Channel("time", block.time, "s", "time"),
            "target": Channel("target", block.target, "rad", "target"),
        }
        if block.position is not None:
            channels["position"] = Channel("position", block.position, "rad", "position")
            channels["interaction"] = Channel("interaction", block.interaction, "N*m", "interaction")
        optical = OpticalRecording(
            Path(f"{block.name}_markers.csv"),
            digest,
            block.optical_time,
            {marker: 1e-3 * points for marker, points in block.markers.items()},
            np.array([0.0, 0.0, -1.0]),
            None,
        )
        sensed = {"time": Channel("time", block.emg_time, "s", "time")}
        for i, muscle in enumerate(emg["muscles"]):
            sensed[f"emg.{muscle}"] = Channel(f"emg.{muscle}", emg["quantum"] * block.emg[:, i], "V", muscle)
        stream = Recording(f"{block.name}.emg", Path(f"{block.name}_emg.csv"), digest, "fit", sensed)
        found.append(
            Recording(
                name=block.name,
                path=Path(f"{block.name}.csv"),
                checksum=digest,
                use="fit",
                channels=channels,
                protocol="pointing",
                participant=block.session.person.name,
                condition=block.session.condition,
                optical=optical,
                streams={"emg": stream},
            )
        )
    return tuple(found)


def record_pointing(
    rig: PointingRig, conditions: Conditions, *, seed: int, threads: int = 1
) -> tuple[tuple[Recording, ...], list[Session]]:
    """The whole experiment in memory.

    Parameters
    ----------
    rig : PointingRig
    conditions : mapping
        As `Conditions`.
    seed : int
    threads : int

    Returns
    -------
    recordings : tuple of Recording
    sessions : list of Session
        What was true.
    """
    sessions = take_part(rig, conditions, seed=seed, threads=threads)
    return recordings_of(rig, all_blocks(rig, sessions, seed=seed, threads=threads)), sessions


def all_blocks(rig: PointingRig, sessions: Sequence[Session], *, seed: int, threads: int = 1) -> list[Block]:
    """What the instruments wrote of all sessions.

    Parameters
    ----------
    rig : PointingRig
    sessions : sequence of Session
    seed : int
    threads : int

    Returns
    -------
    list of Block
    """
    from concurrent.futures import ThreadPoolExecutor

    generators = np.random.default_rng([seed, 1]).spawn(len(sessions))
    with ThreadPoolExecutor(max(threads, 1)) as pool:
        made = pool.map(lambda pair: blocks(rig, *pair), zip(sessions, generators, strict=True))
        return [block for each in made for block in each]


def pointing_config(text: str) -> StudyFile:
    """What a study.toml says, from its text."""
    raw = tomllib.loads(text)
    return StudyFile.model_validate(raw, context=rig_units(raw))


def write_pointing_study(
    folder: Path,
    rig: PointingRig,
    conditions: Conditions,
    *,
    name: str,
    seed: int,
    threads: int = 1,
    on_progress: Callable[[str, float], None] | None = None,
) -> Study:
    """Hold the experiment and write it as a lab would; the truth stands apart, in ``lab/truth.json``.

    Parameters
    ----------
    folder : Path
    rig : PointingRig
    conditions : mapping
        As `Conditions`.
    name : str
        The study's.
    seed : int
        Of every random draw.
    threads : int
    on_progress : callable, optional

    Returns
    -------
    Study
    """
    tell = on_progress or (lambda text, share: None)
    tell("people point", 0.0)
    sessions = take_part(rig, conditions, seed=seed, threads=threads)
    made = all_blocks(rig, sessions, seed=seed, threads=threads)
    people = {s.person.name: s.person for s in sessions}
    for sub in ("recordings", "lab"):
        (folder / sub).mkdir(parents=True, exist_ok=True)
    for i, block in enumerate(made):
        tell("writing recordings", 0.3 + 0.7 * i / len(made))
        _write(folder / "recordings", block, rig)
    truth = {
        "seed": seed,
        "robot": rig.robot.name,
        "people": [asdict(person) for person in people.values()],
        "order": {name: [s.condition for s in sessions if s.person.name == name] for name in people},
        "faults": {f"{s.person.name}_{s.condition}": s.fault for s in sessions},
    }
    # As they were named, not as each person met them: tables and figures follow study.toml.
    named = sorted(made, key=lambda block: list(conditions).index(block.session.condition))
    write_text_atomically(folder / "lab" / "truth.json", json.dumps(truth, indent=1) + "\n")
    write_text_atomically(folder / "study.toml", study_text(rig, list(people.values()), named, name))
    return open_study(folder)


def _write(folder: Path, block: Block, rig: PointingRig) -> None:
    heads, columns, pattern = ["time", "target"], [block.time, block.target], "%.3f,%.6f"
    if block.position is not None:
        heads, columns = [*heads, "position", "interaction"], [*columns, block.position, block.interaction]
        pattern += ",%.6f,%.4f"
    _table(folder / f"{block.name}.csv", heads, np.column_stack(columns), pattern)
    heads = ["time", *(f"{marker}_{axis}" for marker in block.markers for axis in "xyz")]
    table = np.column_stack([block.optical_time, *block.markers.values()])
    _table(folder / f"{block.name}_markers.csv", heads, table, "%.5f" + ",%.1f" * (len(heads) - 1))
    emg = rig["emg"]
    table = np.column_stack([block.emg_time, emg["quantum"] * block.emg])
    _table(folder / f"{block.name}_emg.csv", ["time", *emg["muscles"]], table, "%.5f" + ",%.3e" * len(emg["muscles"]))


def _table(path: Path, heads: list[str], table: np.ndarray, pattern: str) -> None:
    text = "\n".join(pattern % tuple(row) for row in table.tolist())
    write_text_atomically(path, f"{','.join(heads)}\n{text}\n")
