"""Write a study.toml for a robot's file, with its joints and limits, and places to fill in."""

from __future__ import annotations

import math
import re

from ..._errors import StudyError
from ...models.kinematic_tree import TreeJoint
from ...study.study_fields import NAME_PATTERN
from ..urdf import Limits, Urdf

ROBOT_FILE = "robot.urdf"
"""Name of the copy of the robot's file."""

HEAD_TEXT = """# {robot}: {count} joints, all identified at once.
# Every quantity is a text with its unit. docs/reference/index.md lists all keys; `pellucid check` says what is missing.

name = "{name}"

[tree]
urdf = "robot.urdf"                 # copied from {file}; its bodies are initial values and a comparison
# gravity = [0, 0, -1]              # in the base's frame; change it for a robot on a wall or a ceiling
# velocity_width = "0.02 rad/s"     # friction takes tanh(velocity / this) for the velocity's sign
# effort_lowpass = "10 Hz"          # where efforts need another low-pass than motion

[rig]

"""
"""Template of the beginning of the new study.toml."""

JOINT_TEXT = """[[rig.joints]]
name = "{name}"
motion = "{motion}"
{band}[rig.joints.drive]
kind = "torque"
"""
"""Template of a joint's table in the new study.toml, for all joints but the first."""

FIRST_JOINT_TEXT = """\
# Names are those of the robot's file; channels end in them. Where channels are the motors', say how
# these turn for each turn of a joint, with a minus against it, and where the joint is while its motor is at 0; a motor
# may move with two:
# turns = {{ {name} = 100.0 }}
# turns = {{ a = 32.0, b = 32.0 }}
# zero = "90 deg"
[[rig.joints]]
name = "{name}"
motion = "{motion}"
{band}[rig.joints.drive]
kind = "torque"                     # or "current" with torque_constant = "12 N*m/A", or without one: results per ampere
"""
"""Template of the first joint's table, with comments that explain it."""

CHANNELS_TEXT = """
[channels]                          # a column's name, or its number from 0 in files without a header
time = {{ column = 0, unit = "s" }}   # also "ms" or "ns"; time = {{ rate = "1 kHz" }} where there is no such column
{channels}
# If the controller logs them, these identify the drives' gains, with [tree] gains = "desired":
# desired_current.{name} = {{ column = {next}, unit = "A" }}
# desired_torque.{name} = {{ column = {after}, unit = "N*m" }}

# If efforts are in a file of their own, move their lines to [streams.drives.channels], and name it in [[recordings]].
# [streams.drives]
# join = true
# offset = "0 s"
# drift = 0

[processing]
lowpass = "10 Hz"                   # the same zero-phase filter for effort and motion: look at the spectrum
# decimate = 10
trim = 20                           # samples at each border, where the filter has not settled
{dead_band}# velocity = "recorded"             # with channels velocity.{name}, ...; else position is differentiated

[[recordings]]
name = "first"
file = "recordings/first.csv"
use = "fit"

# [[recordings]]
# name = "second"                   # another motion
# file = "recordings/second.csv"
# use = "validate"                  # never fitted: it validates the model

# [[recordings]]
# name = "loaded"
# file = "recordings/loaded.csv"
# use = "validate"
# payload = {{ mass = "2 kg" }}       # on the last link, or link = "NAME"
"""
"""Template of the tables of channels and recordings, with comments that explain them."""


def new_study(robot: Urdf, folder: str) -> str:
    """Return the text of a study.toml for a robot in a `folder` of that name; refuse a robot that is not supported."""
    # Joints that mimic another one are held at first, and the text says so.
    held = {name: mimic.offset for name, mimic in robot.mimics.items()}
    tree, _ = robot.tree(held)
    joints = tree.moving
    for joint in joints:
        if re.fullmatch(NAME_PATTERN, joint.name) is None:
            raise StudyError(
                f"{robot.path.name}: found a joint {joint.name!r}, expected letters, digits, - and _ in its name, "
                "which channels end in: rename it in the file"
            )
    mixed = len({joint.kind for joint in joints}) > 1
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", folder).strip("-_") or "robot"
    about = {"robot": _comment(robot.name), "file": _comment(robot.path.name)}
    study_text = HEAD_TEXT.format(count=len(joints), name=name, **about)
    if held:
        units = {joint.name: _units(joint)[0] for joint in robot.joints}
        places = ", ".join(f'"{key}" = "{x:.6g} {units[key]}"' for key, x in held.items())
        line = f"held = {{ {places} }}  # they follow other joints; hold those too, if they do not move\n"
        study_text = study_text.replace("# gravity", f"{line}# gravity", 1)
    tables = []
    for i, joint in enumerate(joints):
        band = f'dead_band = "{_band(joint)}"\n' if mixed else ""
        motion = "prismatic" if joint.kind == "prismatic" else "rotary"
        joint_text = (JOINT_TEXT if i else FIRST_JOINT_TEXT).format(name=joint.name, motion=motion, band=band)
        tables.append(joint_text + _limits(joint, robot.limits[joint.name]))
    n, positions, efforts = len(joints), [], []
    for i, joint in enumerate(joints, 1):
        position, _, effort = _units(joint)
        positions.append(f'position.{joint.name} = {{ column = {i}, unit = "{position}" }}')
        quantity = "force" if joint.kind == "prismatic" else "torque"
        efforts.append(f'{quantity}.{joint.name} = {{ column = {i + n}, unit = "{effort}" }}')
    alike = f'dead_band = "{_band(joints[0])}"'
    dead_band = "" if mixed else f"{alike:<35} # slower, friction may be anything up to its level\n"
    tail = CHANNELS_TEXT.format(
        channels="\n".join(positions + efforts),
        name=joints[0].name, next=1 + 2 * n, after=1 + 3 * n, dead_band=dead_band,
    )
    return study_text + "\n".join(tables) + tail


def _band(joint: TreeJoint) -> str:
    return "0.002 m/s" if joint.kind == "prismatic" else "0.02 rad/s"


def _units(joint: TreeJoint) -> tuple[str, str, str]:
    """Return the units of a joint's position, speed and effort."""
    return ("m", "m/s", "N") if joint.kind == "prismatic" else ("rad", "rad/s", "N*m")


def _limits(joint: TreeJoint, limits: Limits) -> str:
    position, speed, effort = _units(joint)
    stated = (
        ("position_min", limits.lower, position), ("position_max", limits.upper, position),
        ("velocity", limits.velocity, speed), ("effort", limits.effort, effort),
    )  # fmt: skip
    # Robot files state very large or negative numbers for unknown limits.
    lines = [
        f'{key} = "{x:.6g} {unit}"\n'
        for key, x, unit in stated
        if x is not None and math.isfinite(x) and abs(x) < 1e6 and (unit == position or x > 0.0)
    ]
    return "[rig.joints.limits]\n" + "".join(lines) if lines else ""


def _comment(text: str) -> str:
    """Return a text on one line, so that it can stand in a comment."""
    return re.sub(r"[^\w .()+-]", "_", text)[:100]
