"""A virtual knee orthosis's recordings: as files of a study, or straight to recordings where thousands are wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from ...recordings.recording import Recording
from ...recordings.study import Study
from ...recordings.study_file import StudyFile
from ..recorded_table import Tables, emg_table, tables_recording, write_tables
from ..study_folder import emg_channels, entry_text, study_config, write_study_folder
from .instruments import Session, draw_session
from .protocol import Task, tasks
from .rig import KneeRig
from .trial import KneeTaken, run_trial

HEAD = """\
# A virtual knee orthosis and its wearers, recorded like real ones. Nothing below tells their physics apart from
# a machine's.
name = "{name}"

[rig]
joint = "knee"
motion = "rotary"
lifts = "{lifts}"

[rig.drive]
kind = "torque"                 # of the spring, from its deflection
limit = "{limit} N*m"

[channels]
time = {{ column = "time", unit = "ms" }}
position = {{ column = "output", unit = "rad", scale = {output!r} }}
motor_position = {{ column = "motor", unit = "rad", scale = {motor!r} }}
torque = {{ column = "torque", unit = "N*m", scale = {torque!r} }}
command = {{ column = "command", unit = "N*m", scale = {torque!r} }}

[streams.emg.channels]          # raw, started by the orthosis's trigger
time = {{ column = "sample", unit = "s", scale = {tick!r} }}
{emg}

[streams.imu.channels]          # on its own clock
time = {{ column = "time", unit = "s" }}
{imu}

[coupling]
imu = "imu"
emg = "emg"
orientation = "vqf"
magnetometer = {magnetometer}

[emg_torque]
joints = ["knee"]
muscles = [{muscles}]
emg = "emg"
chain = "knee"
"""

PARTICIPANT = """
[participants.{name}]
sex = "{sex}"
age = {age}
mass = "{weight} kg"
height = "{height} m"
shank_length = "{shank_length} m"
"""

TORQUE_QUANTUM = 1e-4
"""To which torques are written [N*m]."""

IMU_CHANNELS = ("acceleration", "angular_velocity", "magnetic_field")
"""In the order of the rig's quanta."""


def study_text(rig: KneeRig, made: Sequence[Task], name: str) -> str:
    """The study.toml of a virtual knee orthosis.

    Parameters
    ----------
    rig : KneeRig
    made : sequence of Task
    name : str

    Returns
    -------
    str
    """
    emg, imu = rig["emg"], rig["imu"]
    head = HEAD.format(
        name=name,
        lifts=rig["lifts"],
        limit=rig["actuator"]["torque_limit"],
        output=rig["encoders"]["output"],
        motor=rig["encoders"]["motor"],
        torque=TORQUE_QUANTUM,
        tick=1.0 / emg["rate"],
        emg=emg_channels(emg),
        imu="\n".join(
            f'imu.{channel}.{axis} = {{ column = "{channel}_{axis}", unit = "{unit}", scale = {quantum!r} }}'
            for channel, unit, quantum in zip(_imu_channels(rig), ("m/s^2", "rad/s", "T"), imu["quanta"], strict=False)
            for axis in "xyz"
        ),
        magnetometer=str(imu["magnetometer"]).lower(),
        muscles=", ".join(f'"{muscle}"' for muscle in emg["muscles"]),
    )
    people = "".join(
        PARTICIPANT.format(
            name=s.name, sex=s.sex, age=s.age, weight=s.weight, height=s.height, shank_length=s.shank_length
        )
        for s in rig.subjects.values()
    )
    return head + people + "".join(_entry(rig, *task) for task in made)


def _imu_channels(rig: KneeRig) -> tuple[str, ...]:
    return IMU_CHANNELS if rig["imu"]["magnetometer"] else IMU_CHANNELS[:2]


def _participant(rig: KneeRig, task: Task) -> str | None:
    trial, wearer = task
    if wearer is not None:
        return wearer.subject.name
    # Without a wearer, only the IMU's calibration is somebody's: it stays as it is when it moves to their ankle.
    return next((name for name in rig.subjects if trial.name.startswith(f"{name}_")), None)


def _entry(rig: KneeRig, trial, wearer) -> str:
    participant = _participant(rig, (trial, wearer))
    lines = [] if participant is None else [f'participant = "{participant}"']
    streams = ["emg"] if wearer is not None else []
    streams += ["imu"] if trial.imu is not None else []
    if streams:
        named = ", ".join(f'{stream} = "recordings/{trial.name}_{stream}.csv"' for stream in streams)
        lines.append(f"streams = {{ {named} }}")
    return entry_text(trial.name, trial.protocol, trial.use, lines)


def sessions_of(rig: KneeRig, seed: int) -> dict[str, Session]:
    """How the instruments sit on each subject, by name."""
    return {name: draw_session(rig, np.random.default_rng([seed, 1, i])) for i, name in enumerate(rig.subjects)}


def record(
    rig: KneeRig,
    made: Sequence[Task],
    seed: int,
    *,
    on_progress: Callable[[str, float], None] | None = None,
) -> Iterable[KneeTaken]:
    """Do trials one after another; a trial's noise depends on the seed and its name alone.

    Parameters
    ----------
    rig : KneeRig
    made : sequence of Task
    seed : int
    on_progress : callable, optional

    Yields
    ------
    KneeTaken
    """
    tell = on_progress or (lambda text, share: None)
    sessions = sessions_of(rig, seed)
    for i, (trial, wearer) in enumerate(made):
        tell(f"recording {trial.name}", i / len(made))
        rng = np.random.default_rng([seed, 0, *trial.name.encode()])
        session = sessions.get(_participant(rig, (trial, wearer)))
        yield run_trial(rig, wearer, trial, rng=rng, session=session)


def recording_of(rig: KneeRig, taken: KneeTaken) -> Recording:
    """A recording as reading its files would give it, without files.

    Parameters
    ----------
    rig : KneeRig
    taken : KneeTaken

    Returns
    -------
    Recording
    """
    trial = taken.trial
    participant = _participant(rig, (trial, taken.wearer))
    return tables_recording(trial.name, trial.use, trial.protocol, participant, _tables(rig, taken))


def record_in_memory(
    rig: KneeRig, made: Sequence[Task], *, seed: int
) -> tuple[StudyFile, tuple[Recording, ...], list[KneeTaken]]:
    """What the study of a rig and a seed would hold, without writing it.

    Parameters
    ----------
    rig : KneeRig
    made : sequence of Task
        Of one `tasks`, or a part of it: each recording is the same either way.
    seed : int

    Returns
    -------
    config, recordings, taken
        `taken` also knows the truth.
    """
    taken = list(record(rig, made, seed))
    config = study_config(study_text(rig, made, rig.name))
    return config, tuple(recording_of(rig, one) for one in taken), taken


def write_knee_study(
    folder: Path,
    rig: KneeRig,
    *,
    name: str,
    seed: int,
    made: Sequence[Task] | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Study:
    """Record the full protocol on a virtual knee orthosis and write it as a lab would: study.toml and CSV files; the
    truth stands apart, in ``lab/truth.json``.

    Parameters
    ----------
    folder : Path
    rig : KneeRig
    name : str
        The study's name.
    seed : int
        Of every random draw.
    made : sequence of Task, optional
        What to record; the full protocol if left out.
    on_progress : callable, optional

    Returns
    -------
    Study
    """
    made = tasks(rig) if made is None else made
    trials = {}
    for taken in record(rig, made, seed, on_progress=on_progress):
        write_tables(folder, taken.trial.name, _tables(rig, taken))
        trials[taken.trial.name] = trial_truth(taken)
    truth = rig_truth(rig, seed) | {"trials": trials}
    return write_study_folder(folder, study_text(rig, made, name), truth)


def rig_truth(rig: KneeRig, seed: int) -> dict:
    """What only tests, benchmarks and reproductions may read: the orthosis, its wearers, how instruments sit; SI."""
    sine, cosine = rig.orthosis_gravity
    orthosis, actuator = rig["orthosis"], rig["actuator"]
    sessions = sessions_of(rig, seed)
    return {
        "seed": seed,
        "rig": rig.name,
        "orthosis": {
            "gravity": float(np.hypot(sine, cosine)),
            "gravity_sine": sine,
            "gravity_cosine": cosine,
            "inertia": orthosis["inertia"],
            "damping": orthosis["bearing_viscous"],
            "coulomb": orthosis["bearing_coulomb"],
        },
        "actuator": dict(actuator),
        "subjects": {
            s.name: {
                "gravity": s.gravity,
                "gravity_centre": s.limb["ahead"],
                "inertia": s.inertia,
                "damping": s.limb["viscous"],
                "strap_stiffness": s.strap["stiffness"],
                "strap_damping": s.strap["damping"],
                "imu_remounting": sessions[s.name].remounting.tolist(),
                "emg_gain": list(sessions[s.name].emg_gain),
            }
            for s in rig.subjects.values()
        },
    }


def trial_truth(taken: KneeTaken) -> dict:
    """What is true of one trial in few numbers; `KneeTaken.truth` has every sample."""
    truth = taken.truth
    if taken.wearer is None:
        return {} if taken.imu is None else {"imu_clock_offset": taken.imu.clock_offset}
    settled = slice(min(round(2.0 / (taken.time[1] - taken.time[0])), len(taken.time) // 2), None)
    made = {
        "mismatch_mean": float(np.mean(truth.mismatch[settled])),
        "mismatch_sd": float(np.std(truth.mismatch[settled])),
        "strap_torque_rms": float(np.sqrt(np.mean(truth.strap_torque[settled] ** 2))),
        "muscle_torque_mean": float(np.mean(truth.muscle_torque[settled])),
        "muscle_torque_sd": float(np.std(truth.muscle_torque[settled])),
    }
    return made if taken.imu is None else {**made, "imu_clock_offset": taken.imu.clock_offset}


def _tables(rig: KneeRig, taken: KneeTaken) -> Tables:
    """Numbers of each file, whole but for the IMU's time; and its channels: name, unit, column, scale."""
    encoders, emg, imu = rig["encoders"], rig["emg"], rig["imu"]
    columns = [
        ("time", "s", "time", 1e-3),
        ("position", "rad", "output", encoders["output"]),
        ("motor_position", "rad", "motor", encoders["motor"]),
        ("torque", "N*m", "torque", TORQUE_QUANTUM),
        ("command", "N*m", "command", TORQUE_QUANTUM),
    ]
    values = (taken.time, taken.position, taken.motor_position, taken.torque, taken.command)
    counts = [np.round(x / scale) for x, (_, _, _, scale) in zip(values, columns, strict=True)]
    made = {"main": (np.column_stack(counts), columns)}
    if taken.emg is not None:
        made["emg"] = emg_table(taken.emg_time, taken.emg, emg)
    if taken.imu is not None:
        columns, parts = [("time", "s", "time", 1.0)], [taken.imu.time[:, None]]
        for channel, unit, quantum in zip(_imu_channels(rig), ("m/s^2", "rad/s", "T"), imu["quanta"], strict=False):
            parts.append(np.round(getattr(taken.imu, channel) / quantum))
            columns += [(f"imu.{channel}.{axis}", unit, f"{channel}_{axis}", quantum) for axis in "xyz"]
        made["imu"] = np.column_stack(parts), columns
    return made
