"""Write the study.toml of a proposal, with a comment for each guess."""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .._errors import listed_names
from .._given import visible_text
from ..files.file_facts import FileFact
from ..files.name_evidence import read_name
from ..files.recording import MAXIMAL_PROTOCOL
from ..study.answer import Assumption
from ..study.drive_channel import DRIVE_CHANNELS
from ..units import to_si_factor
from .given_files import GivenTable
from .inference.angle_units import ANGLE_LIMITS, MAX_RADIAN_RANGE
from .inference.assign_roles import DRIVE_QUANTITIES, ColumnRole
from .inference.clocks import find_clock
from .inference.encodings import decode_counts
from .inference.processing_choice import choose_processing
from .proposal import (
    NO_ANSWERS,
    SAID_BY_LAB,
    SCALE_QUESTIONS,
    UNKNOWN_SUPPLY,
    Layout,
    Proposal,
    ProposedRecording,
)
from .propose_study import PROPOSAL_LIMITS, has_open_counts

MARK_GUESS = "GUESS"
"""Word that begins the comment of a line that evidence does not decide."""

MARK_ASKED = "ASKED"
"""Word that begins the comment of a line that depends on a question whose default was taken."""

DEAD_BAND_WHY = "below this speed the sign of friction is uncertain"
"""Comment of a dead band."""

MAX_JOINTS_IN_TABLE = 40
"""A study names at most so many joints of a person in its table for EMG and torque."""


def study_text(proposal: Proposal, files: Mapping[int, str]) -> str:
    """Return the text of study.toml; `files` are the tables' paths in the study's folder, by the tables' ids."""
    parts = [
        f"# Proposed by pellucid init --from. Lines marked {MARK_GUESS} are guesses; lines marked {MARK_ASKED} depend",
        "# on a question whose default was taken. proposal/index.html shows every channel and the reasons.",
        "# docs/reference/index.md lists all keys.",
        "",
        f"name = {_text(proposal.name)}",
        *(["simulated = true  # as the files say"] if proposal.is_simulated else []),
        *_notes(proposal),
        "",
        *_questions(proposal),
        *_assumed(proposal),
        *_tree(proposal),
        *_rig(proposal),
        *_participants(proposal),
        *_channels(proposal.main, proposal, "[channels]"),
    ]
    for stream in proposal.streams:
        parts += ["", *_stream(stream, proposal)]
    parts += [*_processing(proposal), *_model(proposal), *_procedures(proposal)]
    for recording in proposal.recordings:
        parts += ["", *_recording(recording, proposal, files)]
    return "\n".join(parts) + "\n"


def channel_name(role: ColumnRole) -> str:
    """Return the name of a role's channel, such as ``position.elbow``."""
    return f"{role.quantity}.{role.label}" if role.label else str(role.quantity)


def defaults_of(proposal: Proposal) -> tuple[Assumption, ...]:
    """Return the defaults of questions that nobody answered."""
    return tuple(
        Assumption(question.key, question.default, question.text, True, question.key in SCALE_QUESTIONS)
        for question in (*proposal.asked, *proposal.marked)
        if question.key not in proposal.answers
    )


def unsaid_defaults(proposal: Proposal) -> set[str]:
    """Return the keys of questions whose defaults were taken."""
    return {assumption.subject for assumption in defaults_of(proposal)}


def channel_mark(role: ColumnRole, proposal: Proposal) -> str:
    """Return ``"GUESS"``, ``"ASKED"`` or nothing: how certain a channel's line is."""
    hangs = {
        "counts_per_turn": has_open_counts(role),
        "full_duty": role.quantity == "duty",
        "effort": role.quantity in DRIVE_QUANTITIES and role.is_guess and not role.is_command,
        "position_unit": role.quantity in ("position", "angle", "reference") and role.is_guess,
        "emg_unit": role.quantity == "emg" and not role.unit_is_certain,
        "muscles": role.quantity == "emg" and role.column in proposal.doubtful_muscles,
    }
    if any(hangs.get(key) for key in unsaid_defaults(proposal)):
        return MARK_ASKED
    return MARK_GUESS if role.is_guess or is_turned_effort(role) else ""


def is_turned_effort(role: ColumnRole) -> bool:
    """Whether a role is an effort whose sign was reversed; the report must show this to the author of the log."""
    return role.quantity in DRIVE_QUANTITIES and role.keys.get("sign") == -1


def _notes(proposal: Proposal) -> list[str]:
    guesses = [channel_name(r) for r in proposal.main.channels if channel_mark(r, proposal)]
    guesses += [
        f"{channel_name(r)} ({s.stream})" for s in proposal.streams for r in s.channels if channel_mark(r, proposal)
    ]
    notes = []
    if guesses:
        notes.append(f"Proposed by init --from and not confirmed: {listed_names(guesses, 12)}.")
    if "rate" in unsaid_defaults(proposal):
        notes.append(f"No file states the sampling rate: {_rate(proposal, proposal.main):g} Hz is a placeholder.")
    lines = [f"notes = [{', '.join(map(_text, notes))}]"] if notes else []
    # The wearer's limb moves with the machine.
    return [*lines, "worn = true"] if proposal.is_worn else lines


def _questions(proposal: Proposal) -> list[str]:
    lines = []
    for question in proposal.asked:
        answer = proposal.answers.get(question.key)
        taken = f"{MARK_ASKED}, the default is taken: {question.default}"
        said = taken if answer is None else f"answered: {answer}"
        lines += _wrapped(f"{question.key}: {question.text} {said}. It decides {question.consequence}.")
    for question in proposal.marked:
        lines += _wrapped(f"{question.key}: {MARK_GUESS}, not asked: {question.text} Taken: {question.default}.")
    return [*lines, ""] if lines else []


def _assumed(proposal: Proposal) -> list[str]:
    """Return a table for each default that was taken; every report of the study repeats it."""
    lines = ["# Once you know an answer, correct the values that depend on it and remove its table below."]
    for each in defaults_of(proposal):
        lines += ["[[assumed]]", f"key = {_text(each.subject)}", f"taken = {_text(each.taken)}"]
        lines += [f"question = {_text(each.why)}", *(["scale = true"] if each.is_scale else []), ""]
    return lines if len(lines) > 1 else []


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 116, initial_indent="# ", subsequent_indent="#   ")


def _tree(proposal: Proposal) -> list[str]:
    robot = proposal.robot_joints
    if robot is None:
        return []
    lines = ["[tree]", f'urdf = "recordings/{proposal.given.robots[0].name}"  # where joints are']
    if robot.held:
        places = ", ".join(f"{_text(name)} = {_text(place)}" for name, place in robot.held.items())
        lines.append(_line(f"held = {{ {places} }}", f"{MARK_GUESS}: joints that did not move"))
    return [*lines, ""]


def joint_names(proposal: Proposal) -> dict[str, str]:
    """Return the joint names in study.toml by their names in the recordings, without excluded joints.

    They come from the robot's file, or from the recordings with other characters than a joint name allows replaced.
    """
    if proposal.robot_joints is not None:
        return dict(proposal.robot_joints.names)
    joints = () if proposal.is_person else proposal.main.roles.joints
    made: dict[str, str] = {}
    for i, joint in enumerate(joints, start=1):
        plain = re.sub(r"[^A-Za-z0-9_-]+", "_", joint).strip("_-") or f"joint_{i}"
        made[joint] = plain if plain not in made.values() else f"{plain}_{i}"
    return made


def _has_joint_tables(proposal: Proposal) -> bool:
    return not proposal.is_person and (proposal.robot_joints is not None or len(proposal.main.roles.joints) > 1)


def _rig(proposal: Proposal) -> list[str]:
    if not _has_joint_tables(proposal):
        return [
            "[rig]",
            f"joint = {_text(_joint_name(proposal))}",
            _line(f'motion = "{proposal.motion}"', _motion_comment(proposal)),
            *_drive(proposal, "[rig.drive]"),
            *_limits(proposal, "", "[rig.limits]"),
        ]
    lines = ["[rig]"]
    dead_bands = _dead_bands(proposal)
    for joint, name in joint_names(proposal).items():
        motion = _motion_of(proposal, joint)
        comment = "" if proposal.robot_joints is not None else _motion_comment(proposal)
        lines += [
            "",
            "[[rig.joints]]",
            f"name = {_text(name)}",
            _line(f'motion = "{motion}"', comment),
            *([_line(f'dead_band = "{dead_bands[joint]}"', DEAD_BAND_WHY)] if joint in dead_bands else []),
            *_turns(proposal, name),
            *_drive(proposal, "[rig.joints.drive]"),
            *_limits(proposal, joint, "[rig.joints.limits]"),
        ]
    return lines


def _motion_of(proposal: Proposal, joint: str) -> str:
    """Return whether one of several joints turns or slides."""
    if proposal.robot_joints is not None:
        return proposal.robot_joints.kinds[joint]
    roles = [r for r in proposal.main.channels if r.label == joint and r.quantity in ("position", "reference")]
    lengths = [r.is_length for r in roles]
    return ("prismatic" if lengths[0] else "rotary") if lengths else proposal.motion


def _dead_bands(proposal: Proposal) -> dict[str, str]:
    """Return a dead band for each of several joints, where one does not serve all of them."""
    names, rate = joint_names(proposal), proposal.main.roles.rate
    motions = {_motion_of(proposal, joint) for joint in names} if _has_joint_tables(proposal) else set()
    is_alike = proposal.robot_joints is not None and len(motions) == 1
    if not motions or is_alike or proposal.processing is None or rate is None:
        return {}
    made, table, first = {}, proposal.main.tables[0], proposal.main.roles.clock.first_sound
    for role in proposal.main.channels:
        if role.quantity in ("position", "motor_position") and role.label in names and not role.is_command:
            values = decode_counts(table.columns[role.column], role.keys)[first:]
            band = choose_processing(values, rate).dead_band * abs(_position_scale(role, proposal))
            unit = "m/s" if _motion_of(proposal, role.label) == "prismatic" else "rad/s"
            made.setdefault(role.label, f"{band:.3g} {unit}")
    return made


def _position_scale(role: ColumnRole, proposal: Proposal) -> float:
    """Return the SI value of a position's unit [rad; m]."""
    if role.unit == "counts":
        return 2.0 * math.pi / float(str(role.keys.get("counts_per_turn", ANGLE_LIMITS.usual_counts)))
    scale = role.scale
    turns = proposal.motor_turns if role.quantity == "motor_position" else 1.0
    return scale * to_si_factor(role.unit, None)[0] / turns


def _turns(proposal: Proposal, joint: str) -> list[str]:
    """Return how often a joint's motor turns with it, where positions are the motors'."""
    is_of_motors = any(r.quantity == "motor_position" for r in proposal.main.channels)
    if not is_of_motors or proposal.robot_joints is None:
        return []
    turns = proposal.motor_turns
    mark = "" if "gear_turns" in proposal.answers else f"{MARK_ASKED}: a motor's turns for a turn of the joint"
    return [_line(f"turns = {{ {joint} = {turns:g} }}", mark)]


def _motion_comment(proposal: Proposal) -> str:
    if proposal.motion_is_certain or "position_unit" in proposal.answers:
        return ""
    return f"{MARK_ASKED}: whether it turns or slides" if "position_unit" in unsaid_defaults(proposal) else MARK_GUESS


def _joint_name(proposal: Proposal) -> str:
    if proposal.is_person:
        angles = [r.label for r in proposal.main.channels if r.quantity in ("angle", "moment") and r.label]
        return angles[0] if len(angles) == 1 else "leg" if any("knee" in a for a in angles) else "joint"
    joints = (read_name(r.column).joint for r in proposal.main.channels if r.quantity == "position")
    return next(filter(None, joints), "joint")


def _drive(proposal: Proposal, head: str) -> list[str]:
    if proposal.drive is None:
        return []
    lines = [head, f'kind = "{proposal.drive}"']
    facts = proposal.drive_facts
    key = "torque_constant" if proposal.motion == "rotary" else "force_constant"
    if proposal.drive in ("current", "voltage"):
        if key in facts:
            # Without a resistance, the constant of a voltage drive is per volt: one per ampere says nothing.
            if proposal.drive == "current" or "resistance" in facts or "/A" not in facts[key].unit:
                lines.append(_line(f'{key} = "{facts[key].text}"', _origin(facts[key])))
        else:
            unit, word = {"current": ("A", "ampere"), "voltage": ("V", "volt")}[proposal.drive]
            why = f"{MARK_ASKED}: unknown, so that results are per {word}"
            lines.append(f'# {key} = "0.06 N*m/{unit}"  # {why}')
        if "gear_ratio" in facts and key in facts:
            lines.append(_line(f"gear_ratio = {facts['gear_ratio'].value:g}", _origin(facts["gear_ratio"])))
    if "limit" in facts:
        lines.append(_line(f'limit = "{facts["limit"].text}"', f"{MARK_GUESS}: {facts['limit'].label}"))
    has_duty = any(r.quantity == "duty" for r in proposal.main.channels)
    if proposal.drive == "voltage" and has_duty and "supply" in facts:
        lines.append(_line(f'supply = "{facts["supply"].text}"', _origin(facts["supply"])))
    return lines


def _origin(fact: FileFact) -> str:
    if fact is UNKNOWN_SUPPLY:
        return f"{MARK_ASKED}: {fact.label}"
    return fact.label if fact.label == SAID_BY_LAB else f"{fact.label}, in the files"


def _limits(proposal: Proposal, joint: str, head: str) -> list[str]:
    """Return the range of a joint that turns further than joints do, so that `check` does not doubt its unit.

    Only a unit that is certain, or was answered, makes the range a fact.
    """
    places = ("position", "motor_position")
    positions = [r for r in proposal.main.channels if r.quantity in places and r.label == joint]
    if not positions or proposal.motion != "rotary" or not positions[0].unit_is_certain:
        return []
    role, main = positions[0], proposal.main
    factor = _position_scale(role, proposal)
    known = []
    for table in proposal.main.tables:
        name = role.column if role.column in table.columns else main.column_in(table, role.column)
        values = decode_counts(table.columns[name], role.keys)
        known.append(values[np.isfinite(values)])
    ends = [factor * float(end) for x in known if len(x) for end in (x.min(), x.max())]
    if not ends or "wrap" in role.keys or max(map(abs, ends)) <= MAX_RADIAN_RANGE:
        return []
    margin = 0.05 * (max(ends) - min(ends))
    why = f"{MARK_GUESS}: the joint rotates without end stops; this is the range of the recordings"
    return [
        head,
        _line(f'position_min = "{min(ends) - margin:.4g} rad"', why),
        f'position_max = "{max(ends) + margin:.4g} rad"',
    ]


def _participants(proposal: Proposal) -> list[str]:
    people = sorted({r.participant for r in proposal.recordings if r.participant})
    lines = [""]
    for person in people:
        lines += [f"[participants.{person}]", '# mass = "70 kg", height = "1.75 m", age = 30', ""]
    return lines


def _rate(proposal: Proposal, layout: Layout) -> float:
    if layout.roles.rate is not None:
        return layout.roles.rate
    question = next((q for q in (*proposal.asked, *proposal.marked) if q.key == "rate"), None)
    if question is None or question.default in NO_ANSWERS:
        return PROPOSAL_LIMITS.default_rate_hz
    return float(question.default.split()[0])


def _time(layout: Layout, proposal: Proposal) -> str:
    clock = layout.roles.clock
    if clock.column is not None:
        mark = "" if clock.is_certain else f"{MARK_GUESS}: "
        column = _column(clock.column, layout.tables[0])
        wrap = f', wrap = "{clock.period:.12g} {clock.unit}"' if clock.period is not None else ""
        return _line(f'time = {{ column = {column}, unit = "{clock.unit}"{wrap} }}', f"{mark}{clock.why}")
    rate = _rate(proposal, layout)
    if layout.roles.rate is None:
        said = f"{MARK_ASKED}: no column is a time, and no file states the rate"
    elif "rate" in proposal.answers:
        said = SAID_BY_LAB
    elif layout.rate_fact is not None:
        said = f'"{layout.rate_fact.label}" in the file states it'
    else:
        said = f'{MARK_GUESS}: {clock.why}; a known rate may be stated: --answer "rate=..."'
    return _line(f'time = {{ rate = "{rate:.10g} Hz" }}', said)


def _channels(layout: Layout, proposal: Proposal, head: str) -> list[str]:
    lines = [head, _time(layout, proposal)]
    taken: set[str] = set()
    groups: set[str] = set()  # what stands before the dots of names that are taken
    counts: dict[str, int] = {}
    left = [(r, r.why) for r in layout.roles.roles if r.quantity is None]
    for given in layout.channels:
        role = _in_study(given, proposal)
        if role is None:
            left.append((given, "not a joint of the study, see [tree]"))
            continue
        name = channel_name(role)
        base = name
        while name in taken or name in groups or not taken.isdisjoint(_groups_of(name)):
            counts[base] = counts.get(base, 1) + 1
            name = f"{base}_{counts[base]}"
        taken.add(name)
        groups.update(_groups_of(name))
        mark = channel_mark(given, proposal)
        why = "; ".join(dict.fromkeys(text for text in (role.why, role.unit_why) if text))
        comment = f"{mark}: {why}" if mark else why
        lines.append(_line(f"{_key(name)} = {_entry(role, layout.tables[0])}", comment))
    if left:
        lines.append("# Left out:")
        lines += [f"#   {_one_line(role.column)}: {_one_line(why)}" for role, why in left[:60]]
    return lines


SLIDING_ROLES = {
    "rad": "m", "rad/s": "m/s", "rad/s^2": "m/s^2", "N*m": "N",
}  # fmt: skip
"""Units of a joint that slides, by those of one that turns which stand for both where no unit is stated."""


def _in_study(role: ColumnRole, proposal: Proposal) -> ColumnRole | None:
    """Return a role with its joint's name in the study; None if its joint is excluded."""
    role = _at_joint(role, proposal)
    if role.label not in proposal.main.roles.joints or not _has_joint_tables(proposal):
        return role
    names = joint_names(proposal)
    if role.label not in names:
        return None
    slides = _motion_of(proposal, role.label) == "prismatic"
    made = replace(role, label=names[role.label])
    if slides and role.unit in SLIDING_ROLES and read_name(role.column).unit is None:
        # Loggers of robots write numbers in SI without a unit, and the robot's file says that the joint slides.
        quantity = "force" if role.quantity == "torque" else role.quantity
        made = replace(made, quantity=quantity, unit=SLIDING_ROLES[role.unit], unit_why="the joint slides")
    return made


def _at_joint(role: ColumnRole, proposal: Proposal) -> ColumnRole:
    """Return a motor's position or speed as its joint's, where no robot's file relates both."""
    quantities = {r.quantity for r in proposal.main.channels if r.label == role.label}
    moves = {"motor_position": "position", "velocity": "velocity"}
    if proposal.robot_joints is not None or "motor_position" not in quantities or role.quantity not in moves:
        return role
    if "position" in quantities:
        return role
    scale = role.scale / proposal.motor_turns
    keys = {**role.keys, "scale": scale} if scale != 1.0 else role.keys
    return replace(role, quantity=moves[role.quantity], keys=keys)


def _groups_of(name: str) -> list[str]:
    """Return the tables in which a dotted name stands: a and a.b of a.b.c."""
    return [name[:i] for i, letter in enumerate(name) if letter == "."]


def _key(name: str) -> str:
    parts = name.split(".")
    return ".".join(p if re.fullmatch(r"[A-Za-z0-9_-]+", p) else _text(p) for p in parts)


def _entry(role: ColumnRole, table: GivenTable) -> str:
    unit, keys = role.unit, {key: value for key, value in role.keys.items() if key != "rated"}
    # A further channel in counts stays in counts: study.toml knows no turn of it.
    per = int(str(keys.pop("counts_per_turn", ANGLE_LIMITS.usual_counts)))
    if unit in ("counts", "counts/s") and role.quantity in ("position", "reference", "angle", "velocity"):
        unit = unit.replace("counts", "rad")
        keys["scale"] = float(str(keys.get("scale", 1.0))) * 2.0 * 3.141592653589793 / per
    parts = [f"column = {_column(role.column, table)}", f'unit = "{unit}"']
    if role.column in table.flat:
        order, i, count = table.flat[role.column]
        keys[order] = [i, count]
    parts += [f"{key} = {_value(value)}" for key, value in keys.items()]
    if role.quantity in ("voltage", "current", "torque", "duty") and "a program sets it" in role.why:
        parts.append('clip = "accept"')
    return f"{{ {', '.join(parts)} }}"


def _column(name: str, table: GivenTable) -> str:
    plain = name.partition("#")[0] if name in table.flat else name
    names = [column.partition("#")[0] if column in table.flat else column for column in table.columns]
    if plain.isdigit() and all(column.isdigit() for column in names):
        return plain
    return _text(plain)


def _value(value: object) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(str, value))}]"
    return f"{value:.17g}" if isinstance(value, float) else str(value)


def _stream(layout: Layout, proposal: Proposal) -> list[str]:
    lines = []
    first, main = layout.tables[0], proposal.main.tables[0]
    is_clocked_alike = first.path == main.path or (layout.roles.clock.column is None and first.rows == main.rows)
    if not proposal.is_person and proposal.drive is not None:
        own, efforts = {r.quantity for r in proposal.main.channels}, DRIVE_CHANNELS[proposal.drive]
        needed = {"supply", *(() if own.intersection(efforts) else efforts)} - own
        if is_clocked_alike or any(r.quantity in needed for r in layout.channels):
            lines += [f"[streams.{layout.stream}]", "join = true"]
        if is_clocked_alike:
            lines += ['offset = "0 s"  # the same rows as the recordings', "drift = 0"]
    return [*lines, *_channels(layout, proposal, f"[streams.{layout.stream}.channels]")]


def _processing(proposal: Proposal) -> list[str]:
    choice = proposal.processing
    if choice is None:
        return []
    unit = "m/s" if proposal.motion == "prismatic" else "rad/s"
    role = next(r for r in proposal.main.channels if r.quantity in ("position", "motor_position"))
    # A spring shows its stiffness where it is held, too, and has no dead band.
    factor = _position_scale(role, proposal)
    dead_band = f'dead_band = "{choice.dead_band * abs(factor):.3g} {unit}"'
    has_one_for_all = proposal.spring is None and not _dead_bands(proposal)
    why = f"{MARK_GUESS}: {choice.why} (the page shows the spectrum)."
    lines = ["", "[processing]", *_wrapped(why), f'lowpass = "{choice.lowpass:g} Hz"', "order = 4"]
    if choice.resample is not None:
        text = f'resample = "{choice.resample:.5g} Hz"'
        lines.append(_line(text, "samples are missing; short losses are interpolated"))
    lines.append(f"decimate = {choice.decimate}")
    if choice.cut_share is not None:
        why = f"{MARK_GUESS}: samples are missing; what lies between them is used"
        lines.append(_line(f"cut_share = {choice.cut_share:g}", why))
    if has_one_for_all:
        lines.append(_line(dead_band, DEAD_BAND_WHY))
    return [*lines, _line(f"trim = {choice.trim}", "samples at each border, where the filter has not settled")]


def _model(proposal: Proposal) -> list[str]:
    has_robot = proposal.robot_joints is not None
    is_fixed = proposal.motion == "prismatic" or has_robot or proposal.spring is not None
    if proposal.drive is not None and not has_robot and _has_joint_tables(proposal):
        # One joint of a machine may be upright and another level.
        zero = "sine" if proposal.gravity == "sine" else "sine+cosine"
        is_weighed = any(_motion_of(proposal, joint) == "rotary" for joint in proposal.main.roles.joints)
        return ["", "[model]", f'gravity = "{zero}"'] if is_weighed else []
    if proposal.drive is None or proposal.gravity is None or is_fixed:
        return []
    why = {
        "none": f"{MARK_GUESS}: the sine of the angle explains none of the effort",
        "sine": "the joint hangs straight down at 0",
        "sine+cosine": "the direction of gravity is estimated",
    }[proposal.gravity]
    return ["", "[model]", _line(f'gravity = "{proposal.gravity}"', why)]


def has_task(proposal: Proposal) -> bool:
    """Whether a proposal has a drive to identify, or what a procedure for people asks for."""
    return proposal.drive is not None or bool(_procedures(proposal))


def _procedures(proposal: Proposal) -> list[str]:
    roles = [r for layout in proposal.layouts for r in layout.channels]
    sides = {r.quantity.partition(".")[0] for r in roles if r.quantity and r.quantity.endswith(".angular_velocity")}
    if {"proximal", "distal"} <= sides and proposal.drive is None:
        return [
            "",
            "[hinge]",
            'proximal = "proximal"',
            'distal = "distal"',
            _line('calibration = "10 s"', f"{MARK_GUESS}: axes and zero are estimated from this period"),
            'score_from = "10 s"',
            _line(
                'jump = "20 deg"', f"{MARK_GUESS}: a larger step of the reference between samples is an error"
            ),
        ]
    emg = [r for r in roles if r.quantity == "emg"]
    if not (proposal.is_person and emg):
        return []
    angles = [r.label for r in roles if r.quantity == "angle"]
    moments = {r.label for r in roles if r.quantity == "moment"}
    joints = [label for label in angles if label in moments] or angles[:1]
    if not moments and not any(r.quantity in DRIVE_QUANTITIES for r in roles):
        return _muscle_tables(proposal)
    if not joints:
        return []
    tried = [j for j in joints if any(word in j for word in ("knee", "ankle", "elbow", "l5_s1"))] or joints
    chain = "none" if all(r.unit in ("1", "%") for r in emg) else "hill"
    why = "envelopes were recorded" if chain == "none" else "raw EMG was recorded"
    lines = ["", "[emg_torque]", f"joints = [{', '.join(map(_text, tried[:MAX_JOINTS_IN_TABLE]))}]"]
    stream = next((s.stream for s in proposal.streams if any(r.quantity == "emg" for r in s.channels)), None)
    moment = next((s.stream for s in proposal.streams if any(r.quantity == "moment" for r in s.channels)), None)
    lines += [f'emg = "{stream}"'] if stream not in (None, "emg") else []
    lines += [f'moments = "{moment}"'] if moment not in (None, "moments") else []
    return [*lines, _line(f'chain = "{chain}"', why)]


MIN_SYNERGY_MUSCLES = 3
"""Synergies are found among at least so many muscles."""


def _muscle_tables(proposal: Proposal) -> list[str]:
    """Return the tables of a study of EMG without an effort: onsets of raw EMG, and synergies of envelopes."""
    best = max(proposal.layouts, key=lambda layout: sum(r.quantity == "emg" for r in layout.channels))
    emg = [r for r in best.channels if r.quantity == "emg"]
    stream = [f"emg = {_text(best.stream)}"] if best.stream not in ("", "emg") else []
    is_raw = not any(r.unit in ("1", "%", "MVC", "%MVC") for r in emg)
    moves = any(r.protocol != MAXIMAL_PROTOCOL for r in proposal.recordings)
    lines = ["", "[onset]", *stream] if is_raw else []
    if len(emg) >= MIN_SYNERGY_MUSCLES and moves:
        chain = _line('chain = "hill"', "raw EMG was recorded")
        chain = chain if is_raw else _line('chain = "none"', "envelopes were recorded")
        lines += ["", "[synergies]", *stream, chain]
    return lines


def _recording(recording: ProposedRecording, proposal: Proposal, files: Mapping[int, str]) -> list[str]:
    lines = []
    if recording.why:
        lines += _wrapped(f"{recording.why[0].upper()}{recording.why[1:]}.")
    lines += ["[[recordings]]", f"name = {_text(recording.name)}", f"file = {_text(files[id(recording.table)])}"]
    if recording.streams:
        inner = ", ".join(f"{name} = {_text(files[id(table)])}" for name, table in recording.streams.items())
        lines.append(f"streams = {{ {inner} }}")
    for key in ("participant", "condition", "protocol"):
        value = getattr(recording, key)
        is_spring = key == "protocol" and proposal.spring is not None
        comment = f"{MARK_GUESS}: {proposal.spring.why}" if is_spring and proposal.spring else ""
        if value:
            lines.append(_line(f"{key} = {_text(value)}", comment))
    lines.append(f'use = "{recording.use}"')
    window = recording.window or _sound_window(recording, proposal)
    if window is not None:
        lines.append(f'window = ["{window[0]:.12g} s", "{window[1]:.12g} s"]')
    time = recording.columns.get(proposal.main.roles.clock.column or "")
    if time is not None:
        lines.append(f"channels.time = {{ column = {_column(time, recording.table)} }}")
    for role in proposal.main.channels:
        other, own = recording.columns.get(role.column), _in_study(role, proposal)
        if other is not None and own is not None:
            lines.append(f"channels.{_key(channel_name(own))} = {{ column = {_column(other, recording.table)} }}")
    for role in recording.extras:
        mark = channel_mark(role, proposal) or (MARK_GUESS if role.is_guess else "")
        comment = f"{mark}: {role.why}" if mark else role.why
        lines.append(_line(f"channels.{_key(channel_name(role))} = {_entry(role, recording.table)}", comment))
    return lines


def _sound_window(recording: ProposedRecording, proposal: Proposal) -> tuple[float, float] | None:
    """Return the window [s] that leaves out stale rows before time first advances, None if there are none."""
    clock = proposal.main.roles.clock
    if clock.column is None or clock.column not in recording.table.columns:
        return None
    values = recording.table.columns[clock.column]
    first = find_clock({clock.column: values}, [read_name(clock.column)]).first_sound
    if not first:
        return None
    tail = clock.seconds(values)[first:]
    # Stale rows may have times inside the window; only those outside are left out by it.
    begin, end = float(np.nanmin(tail)), float(np.nanmax(tail))
    return begin, end + 1.0 / _rate(proposal, proposal.main)


def _line(text: str, comment: str) -> str:
    return f"{text}  # {_one_line(comment)}" if comment else text


def _one_line(text: str) -> str:
    return visible_text(" ".join(text.split()))[:300]


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
