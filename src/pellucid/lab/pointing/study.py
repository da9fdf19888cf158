"""The pointing experiment's recordings: markers, encoder, targets and EMG, as files of a study or in memory."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..._atomic import write_text_atomically
from ...recordings.recording import Recording
from ...recordings.study import Study
from ..recorded_table import emg_table, write_tables
from ..study_folder import emg_channels, write_study_folder
from .instruments import Block, blocks, recordings_of
from .people import Person, PointingRig, draw_people
from .session import Law, Session, point, point_all

CONTROL = "Ctrl"
"""The condition without a robot."""

Conditions = Mapping[str, Callable[[Person, float], Law] | None]
"""By condition: a law for a person and the place of the carriage [m]; None where no robot is worn."""

Outcome = TypeVar("Outcome")

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

[streams.emg.channels]          # raw, as the converter counts
time = {{ column = "sample", unit = "s", scale = {tick!r} }}
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


def study_text(rig: PointingRig, people: Sequence[Person], entries: Sequence[str], name: str) -> str:
    """The study.toml of the experiment.

    Parameters
    ----------
    rig : PointingRig
    people : sequence of Person
    entries : sequence of str
        Of its recordings.
    name : str

    Returns
    -------
    str
    """
    emg = rig["emg"]
    of = {
        group: [m for m, g in zip(emg["muscles"], emg["groups"], strict=True) if g == group] for group in emg["groups"]
    }
    head = HEAD.format(
        name=name,
        people="\n".join(PERSON.format(**asdict(person)) for person in people),
        tick=1.0 / emg["rate"],
        muscles=emg_channels(emg),
        control=CONTROL,
        agonists=json.dumps(of["flexor"]),
        antagonists=json.dumps(of["extensor"]),
    )
    return head + "".join(entries)


def _entry(block: Block) -> str:
    entry = ENTRY.format(name=block.name, participant=block.participant, condition=block.condition)
    return entry + (ROBOT + SENSED if block.position is not None else "")


def held(
    rig: PointingRig,
    conditions: Conditions,
    then: Callable[[Session, list[Block]], Outcome],
    *,
    seed: int,
    threads: int = 1,
) -> Iterator[Outcome]:
    """Hold the experiment session by session; of each stays what is made of it, for all of them are gigabytes.

    Parameters
    ----------
    rig : PointingRig
    conditions : mapping
        As `Conditions`.
    then : callable
        Takes a session and what the instruments wrote of it, in one of the threads.
    seed : int
        Of every random draw.
    threads : int

    Yields
    ------
    object
        What `then` returned, in the order of `appointments`.
    """
    jobs = appointments(rig, conditions, seed=seed)
    generators = np.random.default_rng([seed, 1]).spawn(len(jobs))

    def hold(job: tuple, rng: np.random.Generator) -> Outcome:
        session = point(*job)
        return then(session, blocks(rig, session, rng))

    with ThreadPoolExecutor(max(threads, 1)) as pool:
        yield from pool.map(hold, jobs, generators)


def record_pointing(
    rig: PointingRig,
    conditions: Conditions,
    *,
    seed: int,
    threads: int = 1,
    truth: Callable[[Session], Outcome] = lambda session: session,
) -> tuple[tuple[Recording, ...], list[Outcome]]:
    """The whole experiment in memory.

    Parameters
    ----------
    rig : PointingRig
    conditions : mapping
        As `Conditions`.
    seed : int
    threads : int
    truth : callable
        What to keep of a session; all of it if left out, which is most of the memory.

    Returns
    -------
    recordings : tuple of Recording
    truths : list of Session, or of what `truth` returns
        What was true.
    """
    made = list(held(rig, conditions, lambda s, b: (recordings_of(rig, b), truth(s)), seed=seed, threads=threads))
    return tuple(recording for own, _ in made for recording in own), [known for _, known in made]


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
    for sub in ("recordings", "lab"):
        (folder / sub).mkdir(parents=True, exist_ok=True)

    def write(session: Session, made: list[Block]) -> tuple[Person, str, str, list[str]]:
        for block in made:
            _write(folder, block, rig)
        return session.person, session.condition, session.fault, [_entry(block) for block in made]

    people, faults, entries = {}, {}, {condition: [] for condition in conditions}
    for person, condition, fault, own in held(rig, conditions, write, seed=seed, threads=threads):
        people[person.name] = person
        faults[f"{person.name}_{condition}"] = fault
        entries[condition] += own
        tell("people point", len(faults) / (rig["people"]["count"] * len(conditions)))
    truth = {
        "seed": seed,
        "robot": rig.robot.name,
        "people": [asdict(person) for person in people.values()],
        "faults": faults,
    }
    # As they were named, not as each person met them: tables and figures follow study.toml.
    named = [entry for own in entries.values() for entry in own]
    return write_study_folder(folder, study_text(rig, list(people.values()), named, name), truth)


def _write(folder: Path, block: Block, rig: PointingRig) -> None:
    heads, columns, pattern = ["time", "target"], [block.time, block.target], "%.3f,%.6f"
    if block.position is not None:
        heads, columns = [*heads, "position", "interaction"], [*columns, block.position, block.interaction]
        pattern += ",%.6f,%.4f"
    _table(folder / "recordings" / f"{block.name}.csv", heads, np.column_stack(columns), pattern)
    heads = ["time", *(f"{marker}_{axis}" for marker in block.markers for axis in "xyz")]
    table = np.column_stack([block.optical_time, *block.markers.values()])
    _table(folder / "recordings" / f"{block.name}_markers.csv", heads, table, "%.5f" + ",%.1f" * (len(heads) - 1))
    write_tables(folder, block.name, {"emg": emg_table(block.emg_time, block.emg, rig["emg"])})


def _table(path: Path, heads: list[str], table: np.ndarray, pattern: str) -> None:
    # Formatted in one go: a row of text then costs a microsecond.
    text = (f"{pattern}\n" * len(table)) % tuple(table.ravel().tolist())
    write_text_atomically(path, f"{','.join(heads)}\n{text}")
