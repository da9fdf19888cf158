"""Check whether recordings of a robot are suitable: faults of the files, then faults of the motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..._errors import PellucidError
from ...files.fault import Fault, warn_if_held_out
from ...models.robot import MIN_MOVING_RANGE, Robot
from ...study.procedures.dead_effort import dead_effort_faults
from ...study.quality import clock_faults, inspect
from ...study.recorded_motions import short_stretch_faults
from ...study.study import Study
from ...study.study_file import RigJoint
from ..tree_motion import TreeMotion, fitted_without_payload
from .recorded_tree import (
    SIGN_THRESHOLDS,
    file_of,
    find_effort_mixup,
    find_flipped_joints,
    frames_of,
    friction_power_shares,
    motions_of,
    position_channel,
    robot_of,
    stated_effort_correlation,
)
from .tree_table import TreeTable


@dataclass(frozen=True)
class MotionThresholds:
    """When recordings of a robot are suitable."""

    min_moving_rows: int = 50  # a joint counts as moving only if it moves in at least this many rows
    # Two joints move only together if the correlation of their speeds exceeds this.
    max_speed_correlation: float = 0.9995
    # Largest relative difference between a recorded velocity and the position's derivative.
    max_velocity_difference: float = 0.2
    max_lost_share: float = 0.01  # largest share of a recording that may be lost because another file of it is shorter
    # All efforts have the wrong sign if their correlation with those of the stated bodies is below this.
    opposed_correlation: float = -0.5
    max_limit_excess_share: float = 0.05  # share of a joint's range by which a position may exceed its limits


MOTION_THRESHOLDS = MotionThresholds()


def tree_faults(study: Study) -> list[Fault]:
    """Return the faults of the robot's file and of every recording and, if none refuses, those of the motion."""
    try:
        robot = robot_of(study)
    except PellucidError as error:
        return [_fault("refuse", "robot", "", "", str(error), "a robot", str(error))]
    urdf = file_of(study)
    faults = [_fault("note", "robot", urdf.path.name, "", text, "a body", text) for text in urdf.notes] if urdf else []
    faults += list(_unmet_requests(study, robot))
    faults += [fault for recording in study.recordings() for fault in inspect(recording, study)]
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    faults += dead_effort_faults(study)
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    faults += short_stretch_faults(study)
    try:
        motions = motions_of(study, robot)
    except PellucidError as error:
        return [*faults, _fault("refuse", "motion", "", "", str(error), "motions", str(error))]
    for find in (_lengths, _velocities, _resting, _together, _signs, _mixups, _limits):
        faults += find(study, robot, motions)
        if any(fault.severity == "refuse" for fault in faults):
            break
    return faults


def even_sampling_notes(study: Study) -> list[Fault]:
    """Return the notes on jittering clocks and on packets that were delivered twice."""
    return [fault for recording in study.recordings() for fault in clock_faults(recording, study)]


def _fault(severity: str, kind: str, file: str, channel: str, found: str, expected: str, message: str = "") -> Fault:
    file = file or "study.toml"
    text = message or f"{file}{', channel ' if channel else ''}{channel}: found {found}, expected {expected}"
    return Fault(severity, kind, file, channel, found, expected, text)


def _unmet_requests(study: Study, robot: Robot) -> Iterator[Fault]:
    """Yield faults of requests in study.toml that cannot be met."""
    table, entries = study.table(TreeTable), study.config.recordings
    links = {joint.child for joint in robot.tree.order} | set(frames_of(study))
    for entry in entries:
        link = entry.payload.link if entry.payload is not None else None
        if link is not None and link not in links:
            found = f'[[recordings]] {entry.name}: a payload on the link "{link}"'
            yield _fault("refuse", "payload", "", "", found, f"one of {', '.join(sorted(links))}")
    if not any(entry.use == "fit" and entry.payload is None for entry in entries):
        found = 'no recording with use = "fit" and without a payload'
        yield _fault("refuse", "no_fit", "", "", found, "at least one")
    weighed = [entry for entry in entries if entry.payload is not None and entry.use == "fit"]
    unknown = [entry.name for entry in weighed if entry.payload is not None and entry.payload.mass is None]
    if table.gains == "payload" and unknown:
        found = f'[tree] gains = "payload" and a payload without a mass in {", ".join(unknown)}'
        yield _fault("refuse", "gains", "", "", found, 'its mass, or use = "validate" there')
    if table.gains == "payload" and not weighed:
        found = '[tree] gains = "payload" and no recording with a payload and use = "fit"'
        yield _fault("refuse", "gains", "", "", found, 'one, and the same motion without it, or gains = "stated"')
    if table.gains == "desired":
        wanted = [f"{head}.{name}" for head in ("desired_current", "desired_torque") for name in robot.names]
        missing = [name for name in wanted if not any(name in r for r in study.recordings())]
        if missing and len(robot.names) > 1:
            found = f'[tree] gains = "desired" and no channel {missing[0]}'
            yield _fault("refuse", "gains", "", missing[0], found, 'one for each joint, or gains = "stated"')


def _files(study: Study) -> str:
    return ", ".join(dict.fromkeys(recording.path.name for recording in study.recordings("fit")))


def _channel(study: Study, robot: Robot, k: int) -> str:
    joints: dict[str, RigJoint] = {joint.joint: joint for joint in study.rig.joints}
    return position_channel(study.recordings()[0], joints[robot.names[k]], len(joints) == 1)


def _lengths(study: Study, robot: Robot, motions: Sequence[TreeMotion]) -> Iterator[Fault]:
    """Yield a fault for files of one recording with different lengths; only their common part is used."""
    for recording in study.recordings():
        before = len(study.apart(recording.name))
        if recording.streams and len(recording) < (1.0 - MOTION_THRESHOLDS.max_lost_share) * before:
            files = ", ".join(stream.path.name for stream in recording.streams.values())
            found = f"{before} samples, of which {files} has {len(recording)} (recording {recording.name})"
            yield _fault(
                "note", "lengths", recording.path.name, "time", found, "files of one length; the rest is excluded"
            )


def _velocities(study: Study, robot: Robot, motions: Sequence[TreeMotion]) -> Iterator[Fault]:
    """Yield a fault for recorded velocities whose sign or scale differs from the position's derivative."""
    for motion in motions:
        if study.config.processing_of(motion.recording).velocity != "recorded" or len(motion) < 3:
            continue
        file = study.recording(motion.recording).path.name
        moved = np.gradient(motion.position, 1.0 / motion.rate, axis=0)
        for k, name in enumerate(robot.names):
            size = float(moved[:, k] @ moved[:, k])
            slope = float(moved[:, k] @ motion.velocity[:, k]) / size if size > 0.0 else 1.0
            if (
                np.ptp(motion.position[:, k]) > MIN_MOVING_RANGE[robot.prismatic[k]]
                and not abs(slope - 1.0) <= MOTION_THRESHOLDS.max_velocity_difference
            ):
                degrees = "; one of them is probably in degrees" if 50.0 < max(slope, 1.0 / slope) < 65.0 else ""
                looks = "; reverse the sign of one of them" if slope < 0.0 else degrees
                found = f"a velocity {slope:.3g} times the position's derivative in recording {motion.recording}"
                fault = _fault("refuse", "velocity", file, f"velocity.{name}", found, f"1 time{looks}")
                yield warn_if_held_out(fault, motion.use)


def _resting(study: Study, robot: Robot, motions: Sequence[TreeMotion]) -> Iterator[Fault]:
    """Yield a fault for joints that never move in the fitted recordings."""
    fitted = fitted_without_payload(motions)
    for k, name in enumerate(robot.names):
        places = np.concatenate([m.position[:, k] for m in fitted])
        rows = sum(int(m.moving[:, k].sum()) for m in fitted)
        if rows >= MOTION_THRESHOLDS.min_moving_rows and np.ptp(places) > MIN_MOVING_RANGE[robot.prismatic[k]]:
            continue
        unit = robot.units[k][0]
        found = f"joint {name} within {np.ptp(places):.3g} {unit} in all that is fitted ({rows} rows that move)"
        where = f"{np.median(places):.4g} {unit}"
        hold = (
            f'remove its [[rig.joints]] and write [tree] held = {{ {name} = "{where}" }}'
            if study.table(TreeTable).urdf is not None
            else "add its body to that of the joint before it"
        )
        wanted = f"a joint that moves: record it moving, make dead_band smaller if it is slow, or {hold}"
        yield _fault("refuse", "resting_joint", _files(study), _channel(study, robot, k), found, wanted)


def _together(study: Study, robot: Robot, motions: Sequence[TreeMotion]) -> Iterator[Fault]:
    """Yield a fault for pairs of joints whose speeds are always proportional."""
    v = np.concatenate([m.velocity[m.moving.any(axis=1)] for m in fitted_without_payload(motions)])
    size = np.linalg.norm(v, axis=0)
    for i, k in combinations(range(len(robot.names)), 2):
        alike = float(v[:, i] @ v[:, k]) / (size[i] * size[k])
        if abs(alike) > MOTION_THRESHOLDS.max_speed_correlation:
            pair = f"joints {robot.names[i]} and {robot.names[k]}"
            ratio = float(v[:, i] @ v[:, k]) / size[i] ** 2
            found = f"{pair} moving only together (speeds {ratio:.3g} to 1, correlation {alike:.5f})"
            wanted = (
                "a motion in which each moves separately; if one motor moves both, state its turns; if both channels "
                "use the same column, correct one"
            )
            yield _fault("refuse", "joined_joints", _files(study), _channel(study, robot, k), found, wanted)


def _signs(study: Study, robot: Robot, motions: Sequence[TreeMotion]) -> Iterator[Fault]:
    """Yield faults of efforts with the wrong sign, and of flipped joints."""
    fitted = fitted_without_payload(motions)
    joints: dict[str, RigJoint] = {joint.joint: joint for joint in study.rig.joints}
    zeros = np.array([joints[name].zero if joints[name].turns else _offset(study, robot, name) for name in robot.names])
    shares = friction_power_shares(robot, fitted, zeros)
    wrong = np.flatnonzero(shares < -SIGN_THRESHOLDS.motor_power_threshold)
    # A torque sensor at the joint sees little of its friction, a motor all of it.
    motors = np.array([bool(joints[name].turns) or joints[name].drive.kind != "torque" for name in robot.names])
    sure = set(
        np.flatnonzero(
            shares < np.where(motors, -SIGN_THRESHOLDS.motor_power_threshold, -SIGN_THRESHOLDS.sensor_power_threshold)
        ).tolist()
    )
    for k in wrong:
        name = robot.names[k]
        found = f"friction of joint {name} that delivers energy, {-100 * shares[k]:.2g} % of its effort times its speed"
        turns = f", or, of turns.{name}," if joints[name].turns else ", or"
        wanted = (
            "friction that dissipates energy: effort and motion have opposite signs; write sign = -1 for the drive's "
            f"channel{turns} for the position's, whichever is wrong"
            + (", or of a joint that shares its motor" if any(robot.turns_array[i, k] for i in robot.shared) else "")
        )
        severity = "refuse" if k in sure else "note"
        yield _fault(severity, "sign", _files(study), _channel(study, robot, k), found, wanted)
    if sure:
        return
    urdf, alike = file_of(study), stated_effort_correlation(robot, fitted)
    if alike < MOTION_THRESHOLDS.opposed_correlation and (urdf is None or urdf.has_bodies):
        found = f"efforts that oppose what the stated bodies need (correlation {alike:.2f})"
        yield _fault(
            "refuse", "sign", _files(study), "", found, "the opposite sign of all drive channels, or of gravity"
        )
        return
    stated = (urdf is None or urdf.has_bodies) and all(fitted[0].gain_known)
    for turned in find_flipped_joints(robot, fitted, zeros, stated):
        name = robot.names[turned.joint]
        of = f"turns.{name}" if joints[name].turns else f"position.{name} and of its drive's channel"
        either = " or ".join([name, *(robot.names[i] for i in turned.others)])
        what = f"{'the effort of ' * turned.effort_alone}joint {either}"
        by = "by the stated bodies " * turned.stated
        found = f"{turned.ratio:.3g} times as much of the efforts unexplained {by}as with the sign of {what} reversed"
        if turned.effort_alone:
            of = f"the drive's channel of {name}"
        wanted = (
            f"less: signs of joints and gears are those of the robot's file; try the opposite sign of {of}"
            + (", or of the other's" if turned.others else "")
            + ", and zeros"
        )
        severity = "refuse" if turned.sure else "note"
        yield _fault(severity, "sign", _files(study), _channel(study, robot, turned.joint), found, wanted)


def _mixups(study: Study, robot: Robot, motions: Sequence[TreeMotion]) -> Iterator[Fault]:
    """Yield a warning for efforts of two joints that are exchanged, or for one with another scale than the others."""
    mixup = find_effort_mixup(robot, fitted_without_payload(motions))
    if mixup is None:
        return
    names = [robot.names[k] for k in mixup.joints]
    without = f"{mixup.ratio:.3g} times as much of the efforts unexplained"
    if len(names) == 2:
        found = f"{without} as with the efforts of {names[0]} and {names[1]} swapped"
        wanted = "each joint's own effort: check the columns of both drives' channels"
    else:
        found = f"{without} as with the effort of {names[0]} times {mixup.gain:.2g}"
        wanted = "efforts of one scale: check this joint's gear, its torque constant and its unit"
    yield _fault("warn", "gains", _files(study), _channel(study, robot, mixup.joints[0]), found, wanted)


def _offset(study: Study, robot: Robot, name: str) -> float:
    """Return the offset that is added to a position's stored values [rad; m], about which they are flipped."""
    specs = study.specs_of(study.recordings()[0])
    spec = specs.get(f"position.{name}", specs.get("position"))
    return spec.offset * spec.si_factor if spec is not None else 0.0


def _limits(study: Study, robot: Robot, motions: Sequence[TreeMotion]) -> Iterator[Fault]:
    """Yield a fault for positions beyond the limits of study.toml or the robot's file."""
    urdf, joints = file_of(study), {joint.joint: joint for joint in study.rig.joints}
    for k, name in enumerate(robot.names):
        stated_limits, unit = joints[name].limits, robot.units[k][0]
        of_file = urdf.limits.get(name) if urdf is not None else None
        low, high = (
            stated if stated is not None else getattr(of_file, side, None)
            for stated, side in ((stated_limits.position_min, "lower"), (stated_limits.position_max, "upper"))
        )
        if low is None or high is None:
            continue
        least, most = min(m.position[:, k].min() for m in motions), max(m.position[:, k].max() for m in motions)
        excess = MOTION_THRESHOLDS.max_limit_excess_share * (high - low)
        if least < low - excess or most > high + excess:
            found = f"joint {name} from {least:.4g} to {most:.4g} {unit}"
            wanted = f"{low:.4g} to {high:.4g} {unit}, its limits; check zero, sign and unit"
            yield _fault("note", "limits", _files(study), _channel(study, robot, k), found, wanted)
