"""Read a study's robot, and its recordings as motions of all joints; check the signs and scales of its efforts.

Friction must dissipate energy, no joint may be flipped, and no two efforts may be exchanged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from ..._errors import RecordingError, StudyError
from ...files.recording import Recording
from ...models.joint import GRAVITY
from ...models.joint_frames import FrameRow, JointFrame, frame_of_row, frame_of_screw
from ...models.kinematic_tree import Link, Pose, Tree, TreeJoint, Vector, roll_pitch_yaw
from ...models.robot import Robot
from ...study.drive_channel import DRIVE_CHANNELS, command_channel
from ...study.recorded_motions import command_of, drive_model, filtering_of, usable_stretches
from ...study.study import Study
from ...study.study_file import PayloadSpec, RigJoint
from ..tree_motion import TreeMotion, segments_of, tree_motion_of
from ..urdf import STAND_IN, Urdf, read_urdf
from .tree_table import TreeTable


@dataclass(frozen=True)
class SignThresholds:
    """When a sign counts as wrong."""

    # Approximate number of rows, spread over all recordings, from which signs are determined.
    sign_row_count: int = 4000
    # A motor's sign is wrong if its friction creates at least this share of RMS effort times RMS speed.
    motor_power_threshold: float = 0.02
    # The same threshold for a torque sensor at the joint. It sees little friction, and a delay of some milliseconds
    # makes a few hundredths.
    sensor_power_threshold: float = 0.2
    # A joint is flipped if the other sign reduces the unexplained effort by more than this factor, in most segments.
    decisive_ratio: float = 1.15
    # A joint may be flipped if the other sign reduces the unexplained effort by at least this factor.
    hint_ratio: float = 1.01
    # Another joint is an equally good candidate if flipping it explains more than this share of the same reduction.
    min_alternative_share: float = 0.8
    min_segment_share: float = 0.9  # smallest share of segments in which the other sign must fit better


SIGN_THRESHOLDS = SignThresholds()


@dataclass(frozen=True)
class FlippedJoint:
    """A joint that fits the others better with the other sign of position and effort, or of effort alone."""

    joint: int  # index of the joint
    ratio: float  # residual with the stated sign over residual with the other
    sure: bool  # whether the evidence is decisive
    effort_alone: bool  # whether only the effort's sign is wrong
    others: tuple[int, ...] = ()  # joints that fit nearly as well if flipped instead, because mirror images move alike
    stated: bool = False  # whether the evidence comes from the stated bodies


def friction_power_shares(
    robot: Robot, motions: Sequence[TreeMotion], zeros: np.ndarray | None = None
) -> np.ndarray:
    """Return the power that friction dissipates at each joint, divided by RMS effort times RMS speed, shape (m,).

    A negative share means that the sign of effort or velocity is wrong, unless springs in parallel to the drives
    explain the efforts better than other signs do. Joints are flipped about their `zeros`, (m,), by default 0.
    """
    rows, count = thinned(motions, SIGN_THRESHOLDS.sign_row_count), len(robot.names)
    signs, zeros, weights = np.ones((2, count)), np.zeros(count) if zeros is None else zeros, effort_weights(rows)
    shares = _dissipated_power(robot, rows, signs, zeros, weights)
    if shares.min() < -SIGN_THRESHOLDS.motor_power_threshold and _are_springs_likelier(robot, rows, zeros, weights):
        return _dissipated_power(robot, rows, signs, zeros, weights, springs=True)
    return shares


def _are_springs_likelier(robot: Robot, rows, zeros, weights) -> bool:
    """Return whether springs in parallel to the drives explain the efforts decisively, and better than any joint with
    the other sign of gear or drive does."""
    stated = np.ones((2, len(robot.names)))
    before, after = (solve_with_signs(robot, rows, stated, zeros, weights, springs=x)[1] for x in (False, True))
    if before <= SIGN_THRESHOLDS.decisive_ratio * after:
        return False
    flipped = (solve_with_signs(robot, rows, s, zeros, weights)[1] for _, s in _single_flips(stated))
    return after < min(flipped)


def _single_flips(signs: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each joint that has its stated signs, (2, m), with the signs of either its gear or its drive reversed."""
    for k in np.flatnonzero((signs > 0.0).all(axis=0)):
        for turned in ([-1.0, 1.0], [1.0, -1.0]):
            other = signs.copy()
            other[:, k] = turned
            yield int(k), other


def _dissipated_power(robot: Robot, rows, signs, zeros, weights, springs: bool = False) -> np.ndarray:
    """Return the friction power shares, (m,), for other `signs`, (2, m), of gears and drives."""
    theta, _ = solve_with_signs(robot, rows, signs, zeros, weights, springs=springs)
    first, width = 10 * len(robot.tree.order), 4 + springs
    own = theta[first : first + width * len(robot.names)].reshape(-1, width)[:, 1:3]
    of_motors = theta[first + width * len(robot.names) :].reshape(-1, 3)[:, 1:]
    turns = _signed_turns(robot, signs)
    made = [_arguments(robot, row, signs, zeros)[:2] for row in rows]
    shares = np.zeros(len(own))
    for k in range(len(own)):
        moving = [row.moving[:, k] for row in rows]
        v = np.concatenate([motion[1][rows] for (motion, _), rows in zip(made, moving, strict=True)])
        effort = np.concatenate([effort[rows, k] for (_, effort), rows in zip(made, moving, strict=True)])
        both = [(v[:, k], own[k])]
        if k in robot.shared:
            both.append((v @ turns[k], of_motors[robot.shared.index(k)]))
        size = np.sqrt(np.mean(effort * effort)) if len(v) else 0.0
        taken = [
            np.mean(viscous * x * x + dry * np.abs(x)) / (size * np.sqrt(np.mean(x * x)))
            for x, (viscous, dry) in both
            if size > 0.0 and x.any()
        ]
        shares[k] = min(taken, default=0.0)
    return shares


def stated_effort_correlation(robot: Robot, motions: Sequence[TreeMotion]) -> float:
    """Return the mean correlation of the efforts with those of the stated bodies, over all joints."""
    effort, needed, moving = (
        np.concatenate(each)
        for each in zip(
            *(
                (m.effort, robot.tree.core.inverse_dynamics(m.position, m.velocity, m.acceleration), m.moving)
                for m in motions
            ),
            strict=True,
        )
    )
    sizes = [np.sqrt((x * x * moving).sum(axis=0)) for x in (effort, needed)]
    has_effort = (sizes[0] > 0.0) & (sizes[1] > 0.0)
    alike = (effort * needed * moving).sum(axis=0)[has_effort] / (sizes[0] * sizes[1])[has_effort]
    return float(alike.mean()) if has_effort.any() else 0.0


def find_flipped_joints(
    robot: Robot, motions: Sequence[TreeMotion], zeros: np.ndarray, stated: bool = False
) -> list[FlippedJoint]:
    """Find joints that fit better when flipped about their `zeros`, (m,), one after the other, the clearest first.

    Inertial parameters are free, and the mirror image of most bodies makes nearly the same efforts. If they are
    `stated`, the stated ones are tried too.
    """
    rows, found = thinned(motions, SIGN_THRESHOLDS.sign_row_count), []
    weights, signs = effort_weights(rows), np.ones((2, len(robot.names)))  # signs of gears and of drives
    left = solve_with_signs(robot, rows, signs, zeros, weights)[1]
    for _ in robot.names:
        tried = [(solve_with_signs(robot, rows, s, zeros, weights)[1], k, s) for k, s in _single_flips(signs)]
        # A fit in which friction creates energy is no improvement.
        better = (one for one in sorted(tried, key=lambda one: one[0]) if left >= SIGN_THRESHOLDS.hint_ratio * one[0])
        chosen = next(
            (
                one
                for one in better
                if _dissipated_power(robot, rows, one[2], zeros, weights).min() > -SIGN_THRESHOLDS.motor_power_threshold
            ),
            None,
        )
        if chosen is None or (not found and _are_springs_likelier(robot, rows, zeros, weights)):
            break
        best, k, other = chosen
        ratio, is_explained = left / best, False
        sure = _is_decisive(ratio, *(_residuals_by_segment(robot, rows, s, zeros, weights) for s in (signs, other)))
        if stated and not sure:
            before, after = (solve_with_signs(robot, rows, s, zeros, weights, stated=True)[1] for s in (signs, other))
            sure = is_explained = _is_decisive(
                before / after,
                *(_residuals_by_segment(robot, rows, s, zeros, weights, stated=True) for s in (signs, other)),
            )
            ratio = before / after if is_explained else ratio
        alone = bool(other[0, k] > 0.0)
        alike = (
            i
            for one, i, s in tried
            if i != k
            and (s[0, i] > 0.0) == alone
            and left - one > SIGN_THRESHOLDS.min_alternative_share * (left - best)
        )
        others = () if is_explained else tuple(int(i) for i in alike)
        found.append(FlippedJoint(int(k), float(ratio), sure, alone, others, is_explained))
        signs, left = other, best
    return found


def _is_decisive(ratio: float, before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether the residual falls by a decisive `ratio`, and in most segments."""
    return (
        ratio > SIGN_THRESHOLDS.decisive_ratio and float(np.mean(before > after)) >= SIGN_THRESHOLDS.min_segment_share
    )


def thinned(motions: Sequence[TreeMotion], count: int) -> list[TreeMotion]:
    """Return what is needed of the motions to compare signs, in about `count` evenly spaced rows of all of them."""
    step = max(1, sum(len(m) for m in motions) // count)
    names = ("time", "position", "velocity", "acceleration", "effort", "moving", "segment")
    return [replace(m, **{name: getattr(m, name)[::step] for name in names}, recorded=None) for m in motions]


def effort_weights(rows: Sequence[TreeMotion]) -> np.ndarray:
    """Return one over each joint's mean square effort, (m,)."""
    size = sum((row.effort**2 * row.moving).sum(axis=0) for row in rows)
    count = sum(row.moving.sum(axis=0) for row in rows)
    return np.where(size > 0.0, count / np.where(size > 0.0, size, 1.0), 0.0)


def _signed_turns(robot: Robot, signs: np.ndarray) -> np.ndarray:
    """Return the turns of motors per turn of joints, (m, m), with the signs of gears applied to other joints' turns."""
    stated_turns = robot.turns_array
    return np.where(np.eye(len(stated_turns)) > 0.0, stated_turns, signs[0][:, None] * stated_turns)


def _arguments(robot: Robot, row: TreeMotion, signs: np.ndarray, zeros: np.ndarray, springs: bool = False):
    """Return motion, efforts, and columns of friction and `springs`, with other `signs`, (2, m), of gears and of
    drives."""
    stated_turns, (gear, drive), turns = robot.turns_array, signs, _signed_turns(robot, signs)
    moved = np.linalg.solve(turns, gear[:, None] * stated_turns)
    effort = np.linalg.solve(stated_turns.T, row.effort.T).T * (gear * drive) @ turns
    q, v, a = zeros + (row.position - zeros) @ moved.T, row.velocity @ moved.T, row.acceleration @ moved.T
    shared = [
        x[:, None] * turns[i]
        for i in robot.shared
        for c, b in [(v @ turns[i], a @ turns[i])]
        for x in (b, c, np.sign(c))
    ]
    own = np.stack([a, v, np.sign(v), np.ones_like(v), *([q] if springs else [])], axis=-1)
    return (q, v, a), effort, {"own": own, "shared": np.stack(shared, axis=-1) if shared else None}


def solve_with_signs(
    robot: Robot, rows, signs, zeros, weights, stated: bool = False, springs: bool = False
) -> tuple[np.ndarray, float]:
    """Solve least squares over all rows with free or `stated` bodies, and `springs` in parallel to the drives.

    Returns the parameters and the weighted squared residual.
    """
    normal, projected, whole = 0.0, 0.0, 0.0
    for row in rows:
        motion, effort, columns = _arguments(robot, row, signs, zeros, springs)
        n, p, _ = robot.tree.core.normal_equations(*motion, effort, weight=row.moving * weights, **columns)
        normal, projected = normal + n, projected + p
        whole += float((effort**2 * row.moving * weights).sum())
    known = robot.tree.parameters if stated else np.zeros(0)
    theta, free = np.concatenate([known, np.zeros(len(normal) - len(known))]), slice(len(known), None)
    size = np.sqrt(np.maximum(np.diag(normal), 1e-30))[free]
    values, vectors = np.linalg.eigh(normal[free, free] / np.outer(size, size))
    seen = values > 1e-9 * values[-1]
    left = (projected - normal @ theta)[free] / size
    theta[free] = vectors[:, seen] @ ((vectors[:, seen].T @ left) / values[seen]) / size
    return theta, whole - float(theta @ (2.0 * projected - normal @ theta))


def _residuals_by_segment(robot: Robot, rows, signs, zeros, weights, stated: bool = False) -> np.ndarray:
    """Return the weighted squared residual of each segment."""
    theta, _ = solve_with_signs(robot, rows, signs, zeros, weights, stated)
    squares: dict[int, float] = {}
    for row in rows:
        motion, effort, columns = _arguments(robot, row, signs, zeros)
        left = ((effort - robot.tree.core.regressor(*motion, **columns) @ theta) ** 2 * row.moving) @ weights
        for segment in np.unique(row.segment[row.segment >= 0]):
            squares[int(segment)] = squares.get(int(segment), 0.0) + float(left[row.segment == segment].sum())
    return np.array([squares[key] for key in sorted(squares)])


BASE_LINK_NAME = "base"
"""Name of the fixed base link if no file names it."""

ZERO_VECTOR: Vector = (0.0, 0.0, 0.0)
"""No way, or no turn."""


def recorded_tree(study: Study) -> tuple[Robot, list[TreeMotion]]:
    """Return the robot and the motion of every stretch, with segments numbered over all recordings."""
    robot = robot_of(study)
    return robot, motions_of(study, robot)


def file_of(study: Study) -> Urdf | None:
    """Return the robot's file; None if study.toml describes the robot."""
    stated_file = study.table(TreeTable).urdf
    if stated_file is None:
        return None
    if "urdf" not in study.found:
        path = study.inside(stated_file, "[tree] urdf")
        if not path.exists():
            raise RecordingError(
                f"{path}: no such file, expected by [tree] urdf: the robot's file, in the study's folder"
            )
        study.found["urdf"] = read_urdf(path)
    return study.found["urdf"]


def robot_of(study: Study) -> Robot:
    """Return the robot that study.toml or its robot file describes."""
    return _with_frames(study)[0]


def frames_of(study: Study) -> dict[str, tuple[str, Pose]]:
    """Return, for every link including welded ones, the moving link that carries it, and its pose on that link."""
    return dict(_with_frames(study)[1])


def _with_frames(study: Study) -> tuple[Robot, dict[str, tuple[str, Pose]]]:
    gravity = tuple(GRAVITY * x for x in study.table(TreeTable).gravity)
    joints: dict[str, RigJoint] = {joint.joint: joint for joint in study.rig.joints}
    urdf = file_of(study)
    if urdf is None:
        tree, frames = _tree_of(joints, gravity, study), {}
    else:
        tree, frames = urdf.tree(study.table(TreeTable).held, gravity)
        _require_same(tree, joints, urdf.path)
        rotors = {name: joint.rotor_inertia for name, joint in joints.items()}
        moving = [replace(j, rotor_inertia=rotors[j.name]) for j in tree.joints]
        tree = replace(tree, joints=tuple(moving))
    return Robot(tree, _turns(tree, joints)), dict(frames)


def _tree_of(joints: dict[str, RigJoint], gravity: tuple[float, float, float], study: Study) -> Tree:
    made, links = [], []
    frames = _frames_of(joints, study.table(TreeTable).dh)
    for name, parent in _carriers(joints).items():
        joint, frame = joints[name], frames[name]
        kind = {"rotary": "revolute", "prismatic": "prismatic"}[joint.motion]
        carrier = BASE_LINK_NAME if parent == BASE_LINK_NAME else f"{parent}_link"
        made.append(
            TreeJoint(name, carrier, f"{name}_link", kind, frame.axis, frame.place, frame.turned, joint.rotor_inertia)
        )
        body = replace(STAND_IN, name=f"{name}_link")
        if joint.body is not None:
            turn, place = frame.body
            x, y, z = (place + turn @ np.asarray(joint.body.centre)).tolist()
            body = Link.about_centre(body.name, joint.body.mass, (x, y, z), joint.body.inertia, roll_pitch_yaw(turn))
        links.append(body)
    return Tree(tuple(made), tuple(links), gravity, f"{study.folder.name}/study.toml")


def _carriers(joints: dict[str, RigJoint]) -> dict[str, str]:
    """Return the joint that carries each joint, ``"base"`` for none."""
    before, made = BASE_LINK_NAME, {}
    for name, joint in joints.items():
        made[name], before = before if joint.parent is None else joint.parent, name
    return made


def _frames_of(joints: dict[str, RigJoint], convention: str | None) -> dict[str, JointFrame]:
    """Return the frame of each joint, as study.toml says it: by its place, its row, or its axis."""
    carriers, made = _carriers(joints), dict[str, JointFrame]()

    def frame(name: str, behind: tuple[str, ...] = ()) -> JointFrame:
        joint, carrier = joints[name], carriers[name]
        if name in behind:
            raise StudyError(f"study.toml: [[rig.joints]] {name}: found a loop of parents, expected a path to the base")
        if name not in made:
            if joint.dh is not None and convention is not None:
                row = FrameRow(joint.dh.a, joint.dh.alpha, joint.dh.d, joint.dh.theta)
                before = None if carrier == BASE_LINK_NAME else frame(carrier, (*behind, name))
                made[name] = frame_of_row(row, convention, before)
            elif joint.through is not None and joint.axis is not None:
                before = None if carrier == BASE_LINK_NAME else joints[carrier].through
                made[name] = frame_of_screw(joint.axis, joint.through, before)
            else:
                made[name] = JointFrame(
                    joint.place or ZERO_VECTOR, joint.turned or ZERO_VECTOR, joint.axis or ZERO_VECTOR
                )
        return made[name]

    return {name: frame(name) for name in joints}


def _require_same(tree: Tree, joints: dict[str, RigJoint], path: Path) -> None:
    """Refuse a study.toml whose joints differ from the moving joints of the robot's file."""
    found = {joint.name: joint.kind for joint in tree.moving}
    unknown = [name for name in joints if name not in found]
    if unknown:
        raise StudyError(
            f"study.toml: [[rig.joints]]: found {unknown[0]!r}, expected joints that move in {path.name}: "
            f"{', '.join(found)}"
        )
    missing = [name for name in found if name not in joints]
    if missing:
        raise StudyError(
            f"study.toml: found no [[rig.joints]] for {missing[0]!r}, which moves in {path.name}; expected one, or, "
            f'where it did not move, [tree] held = {{ {missing[0]} = "0 rad" }}'
        )
    for name, kind in found.items():
        if (kind == "prismatic") != (joints[name].motion == "prismatic"):
            raise StudyError(
                f'study.toml: [[rig.joints]] {name}: found motion = "{joints[name].motion}", expected that of '
                f"{path.name}, where it is {kind}"
            )


def _gearing(tree: Tree, joints: dict[str, RigJoint]) -> np.ndarray:
    """Return the turns of motors per turn of joints, (m, m); a row of the unit matrix if study.toml states none."""
    names = [joint.name for joint in tree.moving]
    gearing = np.eye(len(names))
    for i, name in enumerate(names):
        if joints[name].turns:
            gearing[i] = [joints[name].turns.get(other, 0.0) for other in names]
    return gearing


def _turns(tree: Tree, joints: dict[str, RigJoint]) -> tuple[tuple[float, ...], ...]:
    gearing = _gearing(tree, joints)
    return tuple(tuple(row) for row in (gearing / np.diag(gearing)[:, None]).tolist())


@dataclass(frozen=True)
class Drives:
    """Drives of a robot's motors."""

    gain: np.ndarray  # effort at the joint per unit of the drive, (m,) [N m or N per drive's unit]; 1 or -1 if unknown
    back_emf: np.ndarray  # effort lost per speed, (m,) [N m s/rad; N s/m]
    known: tuple[bool, ...]  # whether each gain is known
    units: tuple[str, ...]  # unit of each drive's channel


def drives_of(study: Study, robot: Robot) -> Drives:
    """Return the drives that study.toml states, in the order of the robot's joints."""
    joints: dict[str, RigJoint] = {joint.joint: joint for joint in study.rig.joints}
    gears = np.diag(_gearing(robot.tree, joints))
    models = [drive_model(joints[name]) for name in robot.names]
    known = tuple(
        joints[name].drive.kind == "torque" or joints[name].drive.constant is not None for name in robot.names
    )
    turned = robot.turns_array != 0.0
    for i in robot.shared:
        unknown = [k for k in np.flatnonzero(turned[i]) if not known[k]]
        if unknown:
            raise StudyError(
                f"study.toml: [[rig.joints]] {robot.names[unknown[0]]}: found no torque constant, expected one: its "
                "motor or another one moves several joints, whose efforts add up"
            )
    units = {"torque": "", "current": "A", "voltage": "V"}
    kinds = [joints[name].drive.kind for name in robot.names]
    return Drives(
        np.array([m.gain * (g if k else np.sign(g)) for m, g, k in zip(models, gears, known, strict=True)]),
        np.array([m.back_emf * g * g for m, g in zip(models, gears, strict=True)]),
        known,
        tuple(units[kind] or unit[1] for kind, unit in zip(kinds, robot.units, strict=True)),
    )


def positions_of(recording: Recording, study: Study, robot: Robot) -> np.ndarray:
    """Return the position of each joint, (n, m) [rad; m], from recorded joints or motors."""
    joints: dict[str, RigJoint] = {joint.joint: joint for joint in study.rig.joints}
    gearing = _gearing(robot.tree, joints)
    rows, values = np.eye(len(robot.names)), np.empty((len(recording), len(robot.names)))
    zeros = np.array([joints[name].zero for name in robot.names])
    for i, name in enumerate(robot.names):
        channel = position_channel(recording, joints[name], len(joints) == 1)
        values[:, i] = recording[channel]
        if channel.startswith("motor_position"):
            rows[i] = gearing[i]
            values[:, i] += gearing[i] @ zeros
    return values if np.array_equal(rows, np.eye(len(rows))) else np.linalg.solve(rows, values.T).T


def position_channel(recording: Recording, joint: RigJoint, alone: bool = False) -> str:
    """Return a joint's position channel: the motor's if study.toml states its gear and it was recorded."""
    for head in ("position", "motor_position") if not joint.turns else ("motor_position", "position"):
        name = head if alone and head in recording else f"{head}.{joint.joint}"
        if name in recording and (head == "position" or joint.turns):
            return name
    wanted = f"motor_position.{joint.joint}" if joint.turns else f"position.{joint.joint}"
    raise RecordingError(
        f"{recording.path.name} (recording {recording.name}): found no channel {wanted}, expected one in [channels]; "
        f"there are {', '.join(recording.channels)}"
    )


def motions_of(study: Study, robot: Robot, use: str | None = None) -> list[TreeMotion]:
    """Return the motion of every uncut stretch in order, with segments numbered over all recordings."""
    made, first = [], 0
    for recording in study.recordings(use):
        every = list(_motions_of(recording, study, robot))
        # Stretches in which all joints rest are left out if there are others.
        motions = [motion for motion in every if motion.moving.any()] or every
        # Segments are those of the whole recording; a cut makes no new ones.
        time, moving, still = (
            np.concatenate([getattr(m, name) for m in motions]) for name in ("time", "moving", "still")
        )
        segment = segments_of(time, moving, still, _requested_segments(recording, study))
        segment = np.where(segment < 0, -1, segment + first)
        first = max(first, int(segment.max(initial=-1)) + 1)
        ends = np.cumsum([len(m) for m in motions])[:-1]
        made += [replace(m, segment=part) for m, part in zip(motions, np.split(segment, ends), strict=True)]
    return made


def _requested_segments(recording: Recording, study: Study) -> int | tuple[float, ...] | None:
    asked = study.table(TreeTable).segments
    if isinstance(asked, dict):
        entry = study.config.entry_of(recording.name)
        return asked.get(entry.name if entry is not None else recording.name)
    return None if asked == "automatic" else asked


def _motions_of(recording: Recording, study: Study, robot: Robot) -> Iterator[TreeMotion]:
    table, processing = study.table(TreeTable), study.processing_of(recording)
    joints: dict[str, RigJoint] = {joint.joint: joint for joint in study.rig.joints}
    drives, filtering = drives_of(study, robot), filtering_of(processing)
    stretches = usable_stretches(recording, processing)
    entry = study.config.entry_of(recording.name)
    bands = [joints[name].dead_band for name in robot.names]
    for stretch in stretches:
        try:
            yield tree_motion_of(
                stretch.time,
                positions_of(stretch.recording, study, robot),
                np.column_stack([_command(stretch.recording, joints[name], len(joints)) for name in robot.names]),
                filtering,
                fs=stretch.fs,
                gain=drives.gain,
                back_emf=drives.back_emf,
                turns=robot.turns_array,
                velocity=_quantity_of_all_joints(stretch.recording, "velocity", robot)
                if processing.velocity == "recorded"
                else None,
                desired=_quantity_of_all_joints(stretch.recording, "desired_torque", robot, needed=False),
                desired_drive=_quantity_of_all_joints(stretch.recording, "desired_current", robot, needed=False),
                effort_lowpass=table.effort_lowpass,
                dead_band=[processing.dead_band if band is None else band for band in bands],
                recording=recording.name,
                use=recording.use,
                protocol=recording.protocol,
                payload=_payload(study, entry.payload if entry is not None else None),
                drive_units=drives.units,
                gain_known=drives.known,
            )
        except RecordingError as error:
            raise RecordingError(f"{recording.path}: {error}") from None


def _payload(study: Study, stated: PayloadSpec | None) -> PayloadSpec | None:
    """Return a payload on the moving link, if study.toml names a link that is welded to it."""
    link, frames = stated.link if stated is not None else None, frames_of(study)
    if link not in frames or frames[link][0] == link:
        return stated
    carrier, (turn, place) = frames[link]
    centre = None if stated.centre is None else tuple((place + turn @ np.array(stated.centre)).tolist())
    return stated.model_copy(update={"link": carrier, "centre": centre})


def _command(recording: Recording, joint: RigJoint, joints: int) -> np.ndarray:
    """Return the signal of a joint's drive, shape (n,)."""
    if joints == 1 and command_channel(recording, joint.drive.kind):
        return command_of(recording, joint)
    ending = f".{joint.joint}"
    own = {n.removesuffix(ending): c for n, c in recording.channels.items() if n.endswith(ending) or n == "time"}
    try:
        return command_of(replace(recording, channels=own, cuts=(), streams={}), joint)
    except RecordingError:
        wanted = " or ".join(f"{name}{ending}" for name in DRIVE_CHANNELS[joint.drive.kind])
        raise RecordingError(
            f"found no channel {wanted} for a {joint.drive.kind} drive, expected one; there are "
            f"{', '.join(recording.channels)}"
        ) from None


def _quantity_of_all_joints(
    recording: Recording, quantity: str, robot: Robot, needed: bool = True
) -> np.ndarray | None:
    """Return a quantity of every joint, (n, m); None if it is not `needed` and was not recorded for every joint."""
    names = [f"{quantity}.{name}" for name in robot.names]
    if len(names) == 1 and quantity in recording:
        names = [quantity]
    if not needed and not all(name in recording for name in names):
        return None
    return np.column_stack([recording[name] for name in names])


@dataclass(frozen=True)
class MixupThresholds:
    """When efforts count as exchanged, or as of another scale."""

    # A mistake is looked for only if at least this share of the efforts' mean square is unexplained.
    min_unexplained_share: float = 0.01
    search_row_count: int = 1000  # approximate number of rows of each search
    # A factor closer to 1 than this share is no mistake in a gear or a drive's constant.
    min_gain_difference: float = 0.15
    # A mistake is told if the squared residual falls by at least this factor without it.
    min_residual_ratio: float = 2.0


MIXUP_THRESHOLDS = MixupThresholds()


TRIED_GAINS = np.geomspace(0.25, 4.0, 17)
"""Factors by which a joint's effort is multiplied; the one in the middle is 1."""


@dataclass(frozen=True)
class EffortMixup:
    """A mistake in the efforts of a robot's joints."""

    joints: tuple[int, ...]  # the joint with another scale, or two joints whose efforts are exchanged
    gain: float  # factor that puts the effort right; 1 for exchanged joints
    ratio: float  # squared residual as recorded over that without the mistake


def find_effort_mixup(robot: Robot, motions: Sequence[TreeMotion]) -> EffortMixup | None:
    """Return the mistake that explains the efforts of several joints best.

    The result is None if no mistake explains them far better, and better than springs in parallel to the drives.
    """
    count = len(robot.names)
    if count < 2:
        return None
    # Two steps, so that the rows are among those from which signs are determined.
    rows = thinned(thinned(motions, SIGN_THRESHOLDS.sign_row_count), MIXUP_THRESHOLDS.search_row_count)
    before = _residual(robot, rows)
    if before < MIXUP_THRESHOLDS.min_unexplained_share * sum(float(row.moving.sum()) for row in rows):
        return None
    tried = []
    for i, k in combinations(range(count), 2):
        order = list(range(count))
        order[i], order[k] = k, i
        swapped = [replace(row, effort=row.effort[:, order]) for row in rows]
        tried.append(EffortMixup((i, k), 1.0, before / max(_residual(robot, swapped), 1e-300)))
    for k in range(count):
        left = np.array([_residual(robot, _scaled(rows, k, gain)) for gain in TRIED_GAINS])
        best = int(np.argmin(left))
        # At an end of the range the effort tells nothing of its scale.
        if 0 < best < len(TRIED_GAINS) - 1 and abs(np.log(TRIED_GAINS[best])) > MIXUP_THRESHOLDS.min_gain_difference:
            tried.append(EffortMixup((k,), float(TRIED_GAINS[best]), before / max(float(left[best]), 1e-300)))
    found = max(tried, key=lambda each: each.ratio)
    sprung = before / max(_residual(robot, rows, springs=True), 1e-300)
    return found if found.ratio > max(MIXUP_THRESHOLDS.min_residual_ratio, sprung) else None


def _scaled(rows: Sequence[TreeMotion], joint: int, gain: float) -> list[TreeMotion]:
    gains = np.ones(rows[0].effort.shape[1])
    gains[joint] = gain
    return [replace(row, effort=row.effort * gains) for row in rows]


def _residual(robot: Robot, rows: Sequence[TreeMotion], springs: bool = False) -> float:
    """Return the squared residual over all joints, each in shares of its own mean square effort."""
    signs, zeros = np.ones((2, len(robot.names))), np.zeros(len(robot.names))
    return solve_with_signs(robot, rows, signs, zeros, effort_weights(rows), springs=springs)[1]
