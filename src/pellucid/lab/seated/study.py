"""A virtual shank exoskeleton's recordings: as files of a study, or straight to recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...recordings.recording import Channel, Recording
from ...recordings.study import Study
from ...recordings.study_file import StudyFile
from ..recorded_table import Tables, emg_table, tables_recording, write_tables
from ..study_folder import emg_channels, entry_text, study_config, write_study_folder
from .protocol import SeatedTrial, seated_trials
from .rig import SeatedRig
from .subject import SeatedSubject, subjects
from .trial import SeatedTaken, run_seated_trial

HEAD = """\
# A virtual shank exoskeleton on a frame and people who sit in it, recorded like real ones. Nothing below tells their
# physics apart from a machine's. Position is 0 where a shank hangs; the knee's own angle is 0 where the leg is
# straight.
name = "{name}"

[rig]
joint = "knee"
motion = "rotary"
lifts = "{lifts}"

[rig.drive]
kind = "torque"                 # behind the gear, from the motor's current
limit = "{limit} N*m"

[channels]
time = {{ column = "time", unit = "ms" }}
position = {{ column = "output", unit = "rad", scale = {encoder!r} }}
torque = {{ column = "torque", unit = "N*m", scale = {torque!r} }}
command = {{ column = "command", unit = "N*m", scale = {torque!r} }}

[streams.emg.channels]          # raw, started by the exoskeleton's trigger
time = {{ column = "sample", unit = "s", scale = {tick!r} }}
{emg}

[loaded_swing]                  # the motor swings alone, and with relaxed legs in it

[emg_torque]
joints = ["knee"]
muscles = [{muscles}]
emg = "emg"
chain = "hill"
"""

PARTICIPANT = """
[participants.{name}]
sex = "{sex}"
age = {age}
mass = "{weight} kg"
height = "{height} m"
"""

TORQUE_QUANTUM = 1e-3
"""To which torques are written [N*m]."""


def study_text(rig: SeatedRig, made: Sequence[SeatedTrial], name: str, knees: dict[str, float]) -> str:
    """The study.toml of a virtual shank exoskeleton.

    Parameters
    ----------
    rig : SeatedRig
    made : sequence of SeatedTrial
    name : str
    knees : dict of str to float
        Angle of each subject's knee where the shank hangs, as written down [rad].

    Returns
    -------
    str
    """
    emg = rig["emg"]
    head = HEAD.format(
        name=name,
        lifts=rig["lifts"],
        limit=rig["actuator"]["torque_limit"],
        encoder=rig["instruments"]["encoder"],
        torque=TORQUE_QUANTUM,
        tick=1.0 / emg["rate"],
        emg=emg_channels(emg),
        muscles=", ".join(f'"{muscle}"' for muscle in emg["muscles"]),
    )
    people = {t.subject.name: t.subject for t in made if t.subject is not None}
    said = "".join(
        PARTICIPANT.format(name=s.name, sex=s.sex, age=s.age, weight=s.weight, height=s.height) for s in people.values()
    )
    return head + said + "".join(_entry(rig, trial, knees) for trial in made)


def _entry(rig: SeatedRig, trial: SeatedTrial, knees: dict[str, float]) -> str:
    lines = []
    if trial.subject is not None:
        knee, encoder = knees[trial.subject.name], rig["instruments"]["encoder"]
        lines = [
            f'participant = "{trial.subject.name}"',
            f'streams = {{ emg = "recordings/{trial.name}_emg.csv" }}',
            'channels."angle.knee" = '
            f'{{ column = "output", unit = "rad", scale = {encoder!r}, offset = {round(knee, 4)!r} }}',
        ]
    return entry_text(trial.name, trial.protocol, trial.use, lines)


def record_seated(
    rig: SeatedRig,
    made: Sequence[SeatedTrial],
    seed: int,
    *,
    on_progress: Callable[[str, float], None] | None = None,
) -> Iterable[SeatedTaken]:
    """Do trials one after another; a trial's noise depends on the seed and its name alone.

    Parameters
    ----------
    rig : SeatedRig
    made : sequence of SeatedTrial
    seed : int
    on_progress : callable, optional

    Yields
    ------
    SeatedTaken
    """
    tell = on_progress or (lambda text, share: None)
    for i, trial in enumerate(made):
        tell(f"recording {trial.name}", i / len(made))
        yield run_seated_trial(rig, trial, rng=np.random.default_rng([seed, 0, *trial.name.encode()]))


def seated_recording(rig: SeatedRig, taken: SeatedTaken) -> Recording:
    """A recording as reading its files would give it, without files.

    Parameters
    ----------
    rig : SeatedRig
    taken : SeatedTaken

    Returns
    -------
    Recording
    """
    trial = taken.trial
    participant = None if trial.subject is None else trial.subject.name
    made = tables_recording(trial.name, trial.use, trial.protocol, participant, _tables(rig, taken))
    if taken.knee is None:
        return made
    knee = Channel("angle.knee", made["position"] + round(taken.knee, 4), "rad", "output")
    return replace(made, channels={**made.channels, "angle.knee": knee})


def record_seated_in_memory(
    rig: SeatedRig, made: Sequence[SeatedTrial], *, seed: int
) -> tuple[StudyFile, tuple[Recording, ...], list[SeatedTaken]]:
    """What the study of a rig and a seed would hold, without writing it.

    Parameters
    ----------
    rig : SeatedRig
    made : sequence of SeatedTrial
        Of one `seated_trials`, or a part of it: each recording is the same either way.
    seed : int

    Returns
    -------
    config, recordings, taken
        `taken` also knows the truth.
    """
    taken = list(record_seated(rig, made, seed))
    config = study_config(study_text(rig, made, rig.name, _knees(taken)))
    return config, tuple(seated_recording(rig, one) for one in taken), taken


def write_seated_study(
    folder: Path,
    rig: SeatedRig,
    *,
    name: str,
    seed: int,
    made: Sequence[SeatedTrial] | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Study:
    """Record the full protocol and write it as a lab would: study.toml and CSV files; the truth stands apart, in
    ``lab/truth.json``.

    Parameters
    ----------
    folder : Path
    rig : SeatedRig
    name : str
        The study's name.
    seed : int
        Of every random draw.
    made : sequence of SeatedTrial, optional
        What to record; the full protocol if left out.
    on_progress : callable, optional

    Returns
    -------
    Study
    """
    made = seated_trials(rig) if made is None else made
    trials, knees = {}, {}
    for taken in record_seated(rig, made, seed, on_progress=on_progress):
        write_tables(folder, taken.trial.name, _tables(rig, taken))
        trials[taken.trial.name] = _trial_truth(taken)
        knees |= _knees([taken])
    truth = seated_truth(rig, seed) | {"trials": trials}
    return write_study_folder(folder, study_text(rig, made, name, knees), truth)


def seated_truth(rig: SeatedRig, seed: int) -> dict:
    """What only tests, benchmarks and reproductions may read: the exoskeleton and everybody who sat in it; SI."""
    sine, cosine = rig.exoskeleton_gravity
    return {
        "seed": seed,
        "rig": rig.name,
        "exoskeleton": {"inertia": rig.exoskeleton_inertia, "gravity_sine": sine, "gravity_cosine": cosine},
        "subjects": {name: _subject_truth(s) for name, s in subjects(rig).items()},
    }


def _subject_truth(s: SeatedSubject) -> dict:
    return {
        "moment": s.moment,
        "inertia": s.inertia,
        "rest": s.rest,
        "hip": s.hip,
        "delay": s.delay,
        "activation_time": s.activation_time,
        "deactivation_time": s.deactivation_time,
        "shape": s.shape,
        "muscles": {
            m.name: {
                "optimal_fibre_length": m.constants.optimal_fibre_length,
                "tendon_slack_length": m.constants.tendon_slack_length,
                "max_isometric_force": m.constants.max_isometric_force,
                "pennation": m.constants.pennation,
                "max_velocity": m.constants.max_velocity,
                "force_length_width": m.constants.force_length_width,
                "passive_scale": m.constants.passive_scale,
                "tendon_strain": m.tendon_strain,
                "moment_arm_factor": m.arm,
                "share": m.share,
            }
            for m in s.muscles
        },
    }


def _trial_truth(taken: SeatedTaken) -> dict:
    torque = taken.truth.muscle_torque
    return {
        "muscle_torque_mean": float(torque.mean()),
        "muscle_torque_sd": float(torque.std()),
        "muscle_torque_range": [float(torque.min()), float(torque.max())],
    }


def _knees(taken: Sequence[SeatedTaken]) -> dict[str, float]:
    return {t.trial.subject.name: t.knee for t in taken if t.trial.subject is not None}


def _tables(rig: SeatedRig, taken: SeatedTaken) -> Tables:
    """Whole numbers of each file, and its channels: name, unit, column, scale."""
    emg = rig["emg"]
    columns = [
        ("time", "s", "time", 1e-3),
        ("position", "rad", "output", rig["instruments"]["encoder"]),
        ("torque", "N*m", "torque", TORQUE_QUANTUM),
        ("command", "N*m", "command", TORQUE_QUANTUM),
    ]
    values = (taken.time, taken.position, taken.torque, taken.command)
    counts = [np.round(x / scale) for x, (_, _, _, scale) in zip(values, columns, strict=True)]
    made = {"main": (np.column_stack(counts), columns)}
    if taken.emg is not None:
        made["emg"] = emg_table(taken.emg_time, taken.emg, emg)
    return made
