"""A virtual elbow's recordings: as files of a study, or straight to recordings where thousands are wanted."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ...models.joint import GRAVITY
from ...protocols.fourier import optimised_fourier, play
from ...recordings.optical import OpticalRecording
from ...recordings.recording import Channel, Recording
from ...recordings.study import Study
from ...recordings.study_file import StudyFile
from ..study_folder import study_config, write_study_folder
from .instruments import Taken, frame, record
from .protocol import Trial, trials
from .rig import ElbowRig

HEAD = """\
# A virtual elbow exoskeleton, recorded like a real one. Nothing below tells its physics apart from a machine's.
name = "{name}"

[rig]
joint = "elbow"
motion = "rotary"
lifts = "{lifts}"
moving_mass = "{mass:.1f} kg"           # an upper limit: what the forearm with its carriage may weigh

[rig.drive]
kind = "current"
torque_constant = "{torque_constant} N*m/A"
gear_ratio = {gear_ratio}
limit = "{limit} A"

[rig.slider]                    # a carriage on the forearm; clamped at one place during each recording
low = "{low} m"
high = "{high} m"
marker = "C"
mass = "{carriage} kg"          # taken off and weighed

[rig.limits]
position_min = "{position_min} rad"
position_max = "{position_max} rad"

[channels]
time = {{ column = "time", unit = "s" }}
position = {{ column = "counts", unit = "rad", scale = {quantum!r} }}
current = {{ column = "current", unit = "mA" }}

[optical]                       # motion capture, on its own clock
time = {{ column = "time", unit = "s" }}
unit = "mm"
markers = ["C", "R1", "R2", "R3"]
down = [0, 0, -1]

[processing]
lowpass = "5 Hz"                # both passes together: -3 dB at 4.5 Hz, as the moving mean of 100 samples had
dead_band = "0.1 rad/s"         # slower, friction may be anything up to its level
trim = 500

[model]
gravity = "sine+cosine"
"""

ENTRY = """
[[recordings]]
name = "{name}"
file = "recordings/{name}.csv"
optical = "recordings/{name}_markers.csv"
protocol = "{protocol}"
use = "{use}"
"""

WEIGHING_STEP = 0.005  # kg: of the scale the carriage is put on


def study_text(rig: ElbowRig, made: tuple[Trial, ...], name: str) -> str:
    """The study.toml of a virtual elbow.

    Parameters
    ----------
    rig : ElbowRig
    made : tuple of Trial
    name : str

    Returns
    -------
    str
    """
    motor, slider, span = rig["motor"], rig["slider"], rig["range"]
    head = HEAD.format(
        name=name,
        lifts=rig["lifts"],
        mass=1.5 * (rig["link"]["mass"] + rig["carriage"]["mass"]),
        torque_constant=motor["torque_constant"],
        gear_ratio=motor["gear_ratio"],
        limit=motor["current_limit"],
        low=slider["low"],
        high=slider["high"],
        carriage=f"{round(rig['carriage']['mass'] / WEIGHING_STEP) * WEIGHING_STEP:.3f}",
        position_min=span["low"] - 0.1,
        position_max=span["high"] + 0.1,
        quantum=rig.quantum,
    )
    return head + "".join(ENTRY.format(name=t.name, protocol=t.protocol, use=t.use) for t in made)


def excitation(rig: ElbowRig) -> np.ndarray:
    """A Fourier motion optimised for what the coherent body's parameters show in, shape (n,) [rad].

    Parameters
    ----------
    rig : ElbowRig

    Returns
    -------
    ndarray, shape (n,)
    """
    span, fs = rig["range"], rig["sampling"]["rate"]

    def regressor(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        sign = np.tanh(v / 0.05)
        up, down = sign * (v > 0.0), sign * (v <= 0.0)
        return np.column_stack([a, np.sin(q), np.cos(q), up, down, v * (v > 0.0), v * (v <= 0.0)])

    # Half of what the drive allows: a wearer's forearm will be in it.
    series = optimised_fourier(
        regressor,
        fundamental=0.1,
        harmonics=8,
        low=span["low"] + 0.05,
        high=span["high"] - 0.05,
        velocity=0.5 * span["velocity"],
        acceleration=0.5 * span["acceleration"],
        scales=np.array([0.05, 2.0, 0.3, 0.3, 0.3, 0.1, 0.1]),
        rng=np.random.default_rng(7),
    )
    return play(series, 40.0, fs, velocity=span["velocity"], acceleration=span["acceleration"])


def recordings_of(taken: list[Taken], config: StudyFile, rig: ElbowRig) -> tuple[Recording, ...]:
    """Recordings as reading the files would give them, without files.

    Parameters
    ----------
    taken : list of Taken
    config : StudyFile
    rig : ElbowRig

    Returns
    -------
    tuple of Recording
    """
    down = np.array(config.optical.down)
    made = []
    for one in taken:
        name = f"{one.trial.name}.csv"
        digest = hashlib.sha256(one.counts.tobytes() + one.milliamperes.tobytes()).hexdigest()
        optical = OpticalRecording(
            Path(f"{one.trial.name}_markers.csv"),
            digest,
            one.optical_time,
            {marker: 1e-3 * points for marker, points in one.markers.items()},
            down,
            "C",
        )
        channels = {
            "time": Channel("time", one.time, "s", "time"),
            "position": Channel("position", rig.quantum * one.counts, "rad", "counts"),
            "current": Channel("current", 1e-3 * one.milliamperes, "A", "current"),
        }
        made.append(
            Recording(
                name=one.trial.name,
                path=Path(name),
                checksum=digest,
                use=one.trial.use,
                channels=channels,
                protocol=one.trial.protocol,
                optical=optical,
            )
        )
    return tuple(made)


def record_in_memory(
    rig: ElbowRig, made: tuple[Trial, ...], *, seed: int, threads: int = 1
) -> tuple[StudyFile, tuple[Recording, ...], list[Taken]]:
    """What the study of a rig and a seed would hold, without writing it.

    Parameters
    ----------
    rig : ElbowRig
    made : tuple of Trial
    seed : int
    threads : int

    Returns
    -------
    config, recordings, taken
        `taken` also knows the truth.
    """
    taken = record(rig, made, np.random.default_rng(seed), threads=threads)
    config = study_config(study_text(rig, made, rig.name))
    return config, recordings_of(taken, config, rig), taken


def write_elbow_study(
    folder: Path,
    rig: ElbowRig,
    *,
    name: str,
    seed: int,
    made: tuple[Trial, ...] | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Study:
    """Record the full protocol on a virtual elbow and write it as a lab would: study.toml, CSV files of the robot and
    of the cameras; the truth stands apart, in ``lab/truth.json``.

    Parameters
    ----------
    folder : Path
    rig : ElbowRig
    name : str
        The study's name.
    seed : int
        Of every random draw.
    made : tuple of Trial, optional
        What to record; the full protocol if left out.
    on_progress : callable, optional

    Returns
    -------
    Study
    """
    tell = on_progress or (lambda text, share: None)
    if made is None:
        tell("optimising the excitation", 0.0)
        made = trials(rig, excitation)
    tell("moving the virtual elbow", 0.05)
    taken = record(rig, made, np.random.default_rng(seed), threads=2)
    for i, one in enumerate(taken):
        tell("writing recordings", 0.2 + 0.8 * i / len(taken))
        _write(folder / "recordings", one)
    return write_study_folder(folder, study_text(rig, made, name), truth(rig, taken, seed))


def truth(rig: ElbowRig, taken: list[Taken], seed: int) -> dict:
    """What only tests, benchmarks and reproductions may read: the plant, where the carriage was, the clocks.

    Parameters
    ----------
    rig : ElbowRig
    taken : list of Taken
    seed : int

    Returns
    -------
    dict
        SI.
    """
    sliders = {one.trial.name: one.trial.slider for one in taken}
    link, carriage = rig["link"], rig["carriage"]
    return {
        "seed": seed,
        "rig": rig.name,
        "carriage_mass": carriage["mass"],
        "gravity": GRAVITY * (link["mass"] * link["centre"][0] + carriage["mass"] * carriage["centre"][0]),
        "gravity_cosine": rig.gravity(0.0)[1],
        "inertia": rig.inertia(0.0),
        "carriage_moment": carriage["mass"] * carriage["centre"][0],
        "axis": frame(rig)[2].tolist(),
        "sliders": sliders,
        "clock_offsets": {one.trial.name: one.clock_offset for one in taken},
        "transmission": dict(rig["transmission"]),
    }


def _write(folder: Path, one: Taken) -> None:
    """The robot's file and the cameras', compact enough for an hour of recordings."""
    rows = zip(one.time.tolist(), one.counts.astype(int).tolist(), one.milliamperes.astype(int).tolist(), strict=True)
    text = "\n".join(f"{t:.3f},{count},{current}" for t, count, current in rows)
    write_text_atomically(folder / f"{one.trial.name}.csv", f"time,counts,current\n{text}\n")
    names = list(one.markers)
    table = np.column_stack([one.optical_time, *(one.markers[n] for n in names)])
    heads = ",".join(["time", *(f"{n}_{axis}" for n in names for axis in "xyz")])
    pattern = "%.5f" + ",%.1f" * (3 * len(names))
    text = "\n".join(pattern % tuple(row) for row in table.tolist()).replace("nan", "")
    write_text_atomically(folder / f"{one.trial.name}_markers.csv", f"{heads}\n{text}\n")
