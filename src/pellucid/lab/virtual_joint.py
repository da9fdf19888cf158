"""A virtual joint, and the recordings a lab would make of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .. import _core
from .._errors import StudyError
from ..models.joint import INDEX, NAMES
from ..models.simulate import substeps_for
from ..protocols.excitation import multisine, point_to_point
from ..recordings.recording import Channel
from ..recordings.study import Study
from ..recordings.writers import write_csv
from .noise import noise
from .rig_file import checked_tables, shipped_rig
from .study_folder import write_study_folder

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
"""What a rig file must say, table by table; a constant of the joint that it leaves out is zero."""


@dataclass(frozen=True)
class VirtualJoint:
    """Everything the plant knows; identification sees only what `record` returns.

    Parameters
    ----------
    vector : ndarray, shape (13,)
        The core's joint parameters, SI.
    motion, lifts : str
    torque_constant : float
        [N*m/A], motor side.
    gear_ratio : float
    ripple_amplitude, ripple_wave_number : float
        [N*m], [1/rad].
    current_limit, current_noise, current_noise_memory : float
        [A], [A], [s]; a memory of 0 is white noise.
    quantum, position_noise : float
        Encoder step and noise [rad].
    loop : mapping
        kind, kp, kv, velocity_span.
    motion_range : mapping
        low, high [rad], velocity [rad/s], acceleration [rad/s^2].
    rate, duration : float
        [Hz], [s].
    """

    vector: np.ndarray
    motion: str
    lifts: str
    torque_constant: float
    gear_ratio: float
    ripple_amplitude: float
    ripple_wave_number: float
    current_limit: float
    current_noise: float
    current_noise_memory: float
    quantum: float
    position_noise: float
    loop: dict
    motion_range: dict
    rate: float
    duration: float

    @property
    def gain(self) -> float:
        """Effort at the joint per ampere [N*m/A]."""
        return self.torque_constant * self.gear_ratio


def bench_joint() -> VirtualJoint:
    """The joint of ``lab/rigs/bench-joint.toml``."""
    return parse_rig(shipped_rig("bench-joint"), "bench-joint")


def parse_rig(text: str, name: str) -> VirtualJoint:
    """A virtual joint from the text of a rig file.

    Parameters
    ----------
    text : str
        TOML, SI units.
    name : str
        Of the rig.

    Returns
    -------
    VirtualJoint

    Raises
    ------
    StudyError
        If the file is not TOML, lacks a table or a constant, or the joint has one that no joint has.
    """
    table = checked_tables(text, name, None, NEEDED)
    strange = [key for key in table["joint"] if key not in INDEX]
    if strange:
        raise StudyError(f"rig {name}: [joint] found {', '.join(strange)}, expected some of {', '.join(NAMES)}")
    vector = np.array([table["joint"].get(key, 0.0) for key in NAMES], float)
    drive, encoder = table["drive"], table["encoder"]
    return VirtualJoint(
        vector=vector,
        motion=table["motion"],
        lifts=table["lifts"],
        torque_constant=drive["torque_constant"],
        gear_ratio=drive["gear_ratio"],
        ripple_amplitude=drive["ripple_amplitude"],
        ripple_wave_number=drive["ripple_wave_number"],
        current_limit=drive["current_limit"],
        current_noise=drive["current_noise"],
        current_noise_memory=drive["current_noise_memory"],
        quantum=2.0 * np.pi / encoder["counts_per_turn"],
        position_noise=encoder["noise"],
        loop=table["loop"],
        motion_range=table["motion_range"],
        rate=table["sampling"]["rate"],
        duration=table["sampling"]["duration"],
    )


def matched(joint: VirtualJoint) -> VirtualJoint:
    """The same joint without anything the symmetric model lacks: to test intervals, plant must equal model."""
    vector = joint.vector.copy()
    for name in ("gravity_cosine", "stribeck", "stribeck_velocity", "load_motoring", "load_generating"):
        vector[INDEX[name]] = 0.0
    for kind in ("coulomb", "viscous"):
        mean = 0.5 * (vector[INDEX[f"{kind}_positive"]] + vector[INDEX[f"{kind}_negative"]])
        vector[INDEX[f"{kind}_positive"]] = vector[INDEX[f"{kind}_negative"]] = mean
    return replace(joint, vector=vector, ripple_amplitude=0.0)


def references(joint: VirtualJoint, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The motions a lab would ask for, each shape (n,) [rad]: two to fit and two to hold out."""
    span = joint.motion_range
    centre, half = 0.5 * (span["low"] + span["high"]), 0.5 * (span["high"] - span["low"])
    return {
        "point_to_point": point_to_point(joint.duration, joint.rate, dwell=0.2, rng=rng, **span),
        "multisine": multisine(
            joint.duration, joint.rate, fundamental=0.1, harmonics=12, amplitude=half, centre=centre, rng=rng
        ),
        "heldout_point_to_point": point_to_point(joint.duration, joint.rate, dwell=0.2, rng=rng, **span),
        "heldout_multisine": multisine(
            joint.duration, joint.rate, fundamental=0.13, harmonics=8, amplitude=0.8 * half, centre=centre, rng=rng
        ),
    }


def record(joint: VirtualJoint, reference: np.ndarray, repetitions: int, rng: np.random.Generator) -> dict:
    """What the lab's instruments write while the joint follows a reference, `repetitions` times with new noise.

    Parameters
    ----------
    joint : VirtualJoint
    reference : ndarray, shape (n,)
        [rad]
    repetitions : int
    rng : numpy.random.Generator

    Returns
    -------
    dict of str to ndarray
        "time" (n,) [s]; "position" and "current", shape (repetitions, n), [rad], [A].
    """
    n = len(reference)
    encoder_noise = joint.position_noise * rng.standard_normal((repetitions, n))
    _, _, _, command, _, measured = _core.simulate_batch(
        np.tile(joint.vector, (repetitions, 1)),
        reference=np.ascontiguousarray(reference),
        period=1.0 / joint.rate,
        substeps=substeps_for(1.0 / joint.rate),
        limit=joint.current_limit,
        gain=joint.gain,
        encoder_quantum=joint.quantum,
        encoder_noise=encoder_noise,
        ripple_amplitude=joint.ripple_amplitude,
        ripple_wave_number=joint.ripple_wave_number,
        position0=float(reference[0]),
        stiction=True,
        loop=joint.loop["kind"],
        kp=joint.loop["kp"],
        kv=joint.loop["kv"],
        velocity_span=joint.loop["velocity_span"],
    )
    # Sampled in the middle of a centre-aligned PWM period: half of what flowed before, half of what flows after.
    current = 0.5 * (command + np.concatenate([command[:, :1], command[:, :-1]], axis=1))
    sensed = current + noise((repetitions, n), joint.current_noise, joint.current_noise_memory, joint.rate, rng)
    return {"time": np.arange(n) / joint.rate, "position": measured, "current": sensed}


STUDY = """\
# A virtual joint, recorded like a real one. Nothing below tells the physics apart from a machine's.
name = "{name}"

[rig]
joint = "elbow"
motion = "{motion}"
lifts = "{lifts}"

[rig.drive]
kind = "current"
torque_constant = "{torque_constant} N*m/A"
gear_ratio = {gear_ratio}
limit = "{limit} A"

[rig.loop]
kind = "{kind}"
kp = {kp}
kv = {kv}
limit = "{limit} A"
velocity_span = {span}

[channels]
time = {{ column = "time", unit = "s" }}
position = {{ column = "position", unit = "rad" }}
reference = {{ column = "reference", unit = "rad" }}
current = {{ column = "current", unit = "A" }}

[processing]
lowpass = "60 Hz"               # well above the motion (below 3 Hz); decimation then takes both sides to 20 Hz
decimate = 20
dead_band = "0.2 rad/s"         # around reversals the joint sticks: friction is then anything up to its level
trim = 100

[model]
gravity = "sine"
"""

ENTRY = """
[[recordings]]
name = "{name}"
file = "recordings/{name}.csv"
use = "{use}"
"""


def write_study(folder: Path, joint: VirtualJoint, *, name: str, seed: int) -> Study:
    """Record a joint and write the study a lab would have: study.toml and CSV files; the truth stands apart, in
    ``lab/truth.json``, for tests and benchmarks only.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    joint : VirtualJoint
    name : str
        The study's name.
    seed : int
        Of every random draw.

    Returns
    -------
    Study
    """
    rng = np.random.default_rng(seed)
    text = STUDY.format(
        name=name,
        motion=joint.motion,
        lifts=joint.lifts,
        torque_constant=joint.torque_constant,
        gear_ratio=joint.gear_ratio,
        limit=joint.current_limit,
        kind=joint.loop["kind"],
        kp=joint.loop["kp"],
        kv=joint.loop["kv"],
        span=joint.loop["velocity_span"],
    )
    for title, reference in references(joint, rng).items():
        taken = record(joint, reference, 1, rng)
        columns = (
            Channel("time", taken["time"], "s", "time"),
            Channel("position", taken["position"][0], "rad", "position"),
            Channel("reference", reference, "rad", "reference"),
            Channel("current", taken["current"][0], "A", "current"),
        )
        write_csv(folder / "recordings" / f"{title}.csv", {c.name: c for c in columns})
        text += ENTRY.format(name=title, use="validate" if title.startswith("heldout") else "fit")
    truth = {"seed": seed, "parameters": dict(zip(NAMES, joint.vector.tolist(), strict=True))}
    return write_study_folder(folder, text, truth)
