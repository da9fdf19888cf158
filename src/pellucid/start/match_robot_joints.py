"""Match the joints of recordings with those of a robot's file: by their names, then by their order.

The torques that the file's bodies need check a match: if another order explains the recorded efforts much better, the
match is rejected. A joint of the file without a recording is accepted only if its position is known or if it carries no
joint that moved.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import numpy as np

from .._errors import PellucidError, StudyError
from ..arm.urdf import Urdf, read_urdf
from ..files.name_evidence import read_name, words_of
from ..models.kinematic_tree import TreeJoint, order_outwards
from ..models.robot import MIN_MOVING_RANGE
from ..numerics.filters import central_difference, zero_phase_lowpass
from ..units import to_si_factor
from .inference.assign_roles import DRIVE_QUANTITIES, ColumnRole, TableRoles
from .inference.encodings import decode_counts

GENERIC_WORDS = frozenset(
    ("joint", "joints", "jnt", "j", "axis", "ax", "axes", "achse", "link", "motor", "actuator", "drive", "state",
     "states", "position", "pos", "q", "actual", "act", "measured", "the", "of")
)  # fmt: skip
"""Words of joints' names that name no joint."""

SIDE_WORDS = {"l": "left", "r": "right"}
"""Words for sides by their first letters."""

END_EFFECTOR_WORDS = frozenset(
    ("gripper", "finger", "fingers", "hand", "jaw", "tool", "claw", "knuckle", "thumb", "suction", "ee")
)
"""Words of joints behind the wrist of a robot."""


@dataclass(frozen=True)
class MatchLimits:
    """When efforts contradict a match. Chosen by judgement, and checked on simulated arms."""

    max_rows: int = 1500  # so many rows are compared, evenly spaced
    min_rows: int = 200  # with fewer rows nothing is decided
    lowpass_share: float = 0.02  # cut-off of the low-pass, as a share of the rate
    # Another order contradicts if it leaves at most this share of what the match leaves of the efforts' variance,
    max_left_ratio: float = 0.5
    # and itself leaves no more than this share of the variance.
    max_left_share: float = 0.3


MATCH_LIMITS = MatchLimits()


@dataclass(frozen=True)
class RobotJoints:
    """The joints of a robot's file, as recordings tell them."""

    names: Mapping[str, str]  # joints of the file that moved, by their names in the recordings
    kinds: Mapping[str, str]  # "rotary" or "prismatic", by the same names
    held: Mapping[str, str] = field(default_factory=dict)  # joints of the file that did not move, and where they were
    remarks: tuple[str, ...] = ()  # what was left out or taken by order, in sentences


@dataclass(frozen=True, eq=False)
class _RecordedJoint:
    """A joint of recordings: its positions and efforts in SI, (n,) each of the first table; None where not recorded."""

    name: str
    position: np.ndarray | None
    effort: np.ndarray | None
    ranges: tuple[float, float]  # least and largest position over all tables
    slides: bool | None  # whether its unit is a length; None if its name states no unit

    @property
    def rests(self) -> bool:
        """Whether the joint never moves."""
        low, high = self.ranges
        return np.isfinite(low) and high - low <= MIN_MOVING_RANGE[bool(self.slides)]


def match_robot_joints(path: Path, roles: TableRoles, tables: Sequence[Mapping[str, np.ndarray]]) -> RobotJoints | None:
    """Return how the joints of recordings lie in a robot's file; None if the recordings are of a single joint.

    `tables` have the columns that `roles` name. A StudyError names both lists where they do not fit.
    """
    if len(roles.joints) < 2 or not tables:
        return None
    robot = read_urdf(path)
    chain = [j for j in order_outwards(robot.joints, robot.links, path.name) if j in robot.moving]
    recorded = [_recorded(name, roles, tables) for name in roles.joints]
    names = [joint.name for joint in chain]
    logged = [joint.name for joint in recorded]

    def refuse(why: str) -> StudyError:
        return StudyError(
            f"{path.name}: found the joints {', '.join(names)}, but the recordings have {', '.join(logged)}: {why}"
        )

    pairs, remarks = match_names(logged, names), []
    if not pairs or len(pairs) < min(len(logged), len(names)):
        pairs, text = _with_order(pairs, logged, names)
        remarks += [text] if text else []
    if not pairs:
        if _are_numbers(logged):
            raise refuse(f"expected columns for {len(names)} joints, not for {len(logged)}")
        raise refuse("expected the same names, or numbered columns in the order of the joints")
    left_logged = [name for name in logged if name not in pairs]
    missing = [joint for joint in chain if joint.name not in pairs.values()]
    moving = [joint for joint in recorded if joint.name in left_logged and not joint.rests]
    if missing and moving and not _are_end_effectors([*left_logged, *(joint.name for joint in missing)]):
        raise refuse(
            f"expected the same names: the robot has no joint {', '.join(j.name for j in moving)}, and the recordings "
            f"have no column for {', '.join(joint.name for joint in missing)}"
        )
    held = {}
    for joint in missing:
        place = _constant_place(joint, roles, tables)
        if place is None and _carries(joint, robot, set(pairs.values())):
            raise refuse(
                f"expected a column with the position of {joint.name}, which carries joints that moved; if it did not "
                "move, add a constant column"
            )
        held[joint.name] = place or _within_limits(joint, robot)
        where = "its column is constant" if place else "it was not recorded and carries no joint that was"
        remarks.append(f"{path.name}: {joint.name} is fixed at {held[joint.name]}: {where}")
    kinds = {joint.name: joint.kind for joint in chain}
    by_name = {joint.name: joint for joint in recorded}
    for own, other in list(pairs.items()):
        if by_name[own].slides is not None and by_name[own].slides != (kinds[other] == "prismatic"):
            does = ("prismatic", "rotary") if by_name[own].slides else ("rotary", "prismatic")
            raise refuse(
                f"expected joints of one type: {own} is {does[0]} in the recordings, but {other} is {does[1]} in "
                "the file"
            )
        if by_name[own].rests:
            # A joint that rests has no unit of its own evidence: the file says whether it turns.
            held[other] = f"{0.5 * sum(by_name[own].ranges):.6g} {'m' if kinds[other] == 'prismatic' else 'rad'}"
            remarks.append(f"{path.name}: {other} is fixed at {held[other]}: it never moves in the recordings")
            del pairs[own]
    if not pairs:
        raise refuse("expected at least one joint that moves")
    remarks += [f"{name}: excluded, because {path.name} has no such joint" for name in left_logged]
    better = _better_order(robot, held, [by_name[own] for own in pairs], list(pairs.values()), roles.rate)
    if better is not None:
        order = ", ".join(f"{own} for {other}" for own, other in zip(pairs, better, strict=True))
        raise refuse(
            f"{', '.join(f'{own} was matched with {other}' for own, other in pairs.items())}, but the bodies of the "
            f"file explain the efforts much better with {order}. Expected columns in the order of their names"
        )
    slides = {own: "prismatic" if kinds[other] == "prismatic" else "rotary" for own, other in pairs.items()}
    return RobotJoints(pairs, slides, held, tuple(remarks))


def joints_remarks(robots: Sequence[Path], matched: RobotJoints | None, joints: Sequence[str]) -> list[str]:
    """Return what a user must know of a study's joints and of the robot's file that was given for them."""
    if matched is not None:
        return list(matched.remarks)
    if robots:
        return [f"{robots[0].name}: not used, because only one joint was recorded"]
    if len(joints) < 2:
        return []
    return [
        f"{len(joints)} joints ({', '.join(joints)}) and no URDF: each joint is identified separately. If the joints "
        "act on each other, pass the robot's URDF (--urdf FILE) to identify one model of all of them"
    ]


# --- names ----------------------------------------------------------------------------------------------------------


def match_names(logged: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return the robot's joint for each recorded joint whose name tells it.

    Case, separators, words such as "joint" and words that all names of a list share are ignored. Numbers may count
    from 0 in one list and from 1 in the other.
    """
    whole, bare = _keys(logged), _numbered(_keys(logged, strip=True), _keys(names, strip=True))
    other_whole, other_bare = _keys(names), _keys(names, strip=True)
    rules: tuple[Callable[[str, str], bool], ...] = (
        lambda own, other: bool(whole[own]) and whole[own] == other_whole[other],
        lambda own, other: bool(bare[own]) and bare[own] == other_bare[other],
        lambda own, other: _is_part(whole[own], other_whole[other]),
    )
    if _numbers(bare):
        rules = rules[1:2]
    pairs: dict[str, str] = {}
    for fits in rules:
        free = [name for name in logged if name not in pairs]
        other_free = [name for name in names if name not in pairs.values()]
        fitting = {own: [other for other in other_free if fits(own, other)] for own in free}
        counts = [other for each in fitting.values() for other in each]
        pairs |= {own: each[0] for own, each in fitting.items() if len(each) == 1 and counts.count(each[0]) == 1}
    return {own: pairs[own] for own in logged if own in pairs}


def _keys(names: Sequence[str], *, strip: bool = False) -> dict[str, tuple[str, ...]]:
    """Return the words of names without generic ones, and, to `strip`, without those that all names share."""
    words = {name: tuple(_plain(word) for word in words_of(name)) for name in names}
    shared = set.intersection(*map(set, words.values())) if strip and len(names) > 1 else set()
    return {name: tuple(w for w in own if w not in GENERIC_WORDS | shared) for name, own in words.items()}


def _plain(word: str) -> str:
    return str(int(word)) if word.isdecimal() else SIDE_WORDS.get(word.casefold(), word.casefold())


def _numbers(keys: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """Return the number of each name where all names are nothing but different numbers; else nothing."""
    found = _single_numbers(keys)
    return found if len(found) == len(keys) and len(set(found.values())) == len(found) else {}


def _single_numbers(keys: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    return {name: int(key[0]) for name, key in keys.items() if len(key) == 1 and key[0].isdecimal()}


def _numbered(
    bare: dict[str, tuple[str, ...]], other_bare: Mapping[str, tuple[str, ...]]
) -> dict[str, tuple[str, ...]]:
    """Return recorded names that are numbers, counted as the robot's file counts: from 0 or from 1."""
    own, other = _numbers(bare), _single_numbers(other_bare)
    if not own or not other:
        return bare
    shift = min(other.values()) - min(own.values())
    if len(own) != len(other) and (min(own.values()), min(other.values())) != (0, 1):
        shift = 0  # some of the joints were recorded, under the numbers that they have
    return {name: (str(number + shift),) for name, number in own.items()}


def _is_part(own: Sequence[str], other: Sequence[str]) -> bool:
    """Whether the words of one name are all in the other, among them one that is no number; numbers do not differ."""
    a, b = set(own), set(other)
    digits = [{word for word in words if word.isdecimal()} for words in (a, b)]
    are_alike = digits[0] == digits[1] or not all(digits)
    return (a <= b or b <= a) and are_alike and any(not word.isdecimal() for word in a & b)


def _are_numbers(names: Sequence[str]) -> bool:
    """Whether names have nothing but numbers, so that only their order tells joints."""
    return all(all(word.isdecimal() for word in key) for key in _keys(names, strip=True).values())


def _with_order(pairs: dict[str, str], logged: Sequence[str], names: Sequence[str]) -> tuple[dict[str, str], str]:
    """Return pairs with those that order tells, and what was taken by order in words.

    `names` go outwards from the base. Where one list has no names, the joints are those of the other, whatever they
    are called, with or without its end effector. Others that no name tells lie in order between those that a name
    tells, if that is most of them.
    """
    rest = [name for name in logged if name not in pairs]
    other_rest = [name for name in names if name not in pairs.values()]
    if not rest or not other_rest:
        return pairs, ""
    arm = [name for name in names if not END_EFFECTOR_WORDS & set(words_of(name))]
    if not pairs and _are_numbers(logged) != _are_numbers(names) and len(logged) in (len(names), len(arm)):
        numbers = _numbers(_keys(logged, strip=True))
        ordered = sorted(logged, key=numbers.__getitem__) if numbers else list(logged)
        made = dict(zip(ordered, names if len(logged) == len(names) else arm, strict=True))
        return {name: made[name] for name in logged}, _order_text(made)
    if pairs and len(rest) == len(other_rest) and len(rest) <= len(pairs):
        made = {**pairs, **dict(zip(rest, other_rest, strict=True))}
        places = [names.index(made[name]) for name in logged if name in made]
        if places == sorted(places):
            return {name: made[name] for name in logged}, _order_text({name: made[name] for name in rest})
    return pairs, ""


def _order_text(pairs: Mapping[str, str]) -> str:
    return "matched by order, because names do not match: " + ", ".join(f"{a} for {b}" for a, b in pairs.items())


def _are_end_effectors(names: Sequence[str]) -> bool:
    return all(END_EFFECTOR_WORDS & set(words_of(name)) for name in names)


# --- what was recorded ----------------------------------------------------------------------------------------------


def _recorded(name: str, roles: TableRoles, tables: Sequence[Mapping[str, np.ndarray]]) -> _RecordedJoint:
    own = [role for role in roles.roles if role.label == name and not role.is_command]
    position = next((role for role in own if role.quantity == "position"), None)
    effort = next((role for role in own if role.quantity in DRIVE_QUANTITIES), None)
    if position is None:
        return _RecordedJoint(name, None, None, (np.nan, np.nan), None)
    places = [_in_si(table, position) for table in tables if position.column in table]
    known = [x[np.isfinite(x)] for x in places]
    ends = [end for x in known if x.size for end in (float(x.min()), float(x.max()))]
    slides = position.is_length
    return _RecordedJoint(
        name,
        places[0],
        None if effort is None else decode_counts(tables[0][effort.column], effort.keys),
        (min(ends, default=np.nan), max(ends, default=np.nan)),
        slides if read_name(position.column).unit is not None else None,
    )


def _in_si(table: Mapping[str, np.ndarray], role: ColumnRole) -> np.ndarray:
    """Return a position in rad or m, shape (n,), as study.toml converts it."""
    unit = role.unit
    scale, offset = (float(str(role.keys.get(key, default))) for key, default in (("scale", 1.0), ("offset", 0.0)))
    if unit == "counts":
        scale, unit = 2.0 * np.pi / float(str(role.keys.get("counts_per_turn", 1.0))), "rad"
    value = float(str(role.keys.get("sign", 1))) * scale * decode_counts(table[role.column], role.keys) + offset
    factor, shift = to_si_factor(unit, None)
    return value * factor + shift


def _constant_place(joint: TreeJoint, roles: TableRoles, tables: Sequence[Mapping[str, np.ndarray]]) -> str | None:
    """Return where a joint of the file is whose column of positions never changes; None without such a column."""
    slides = joint.kind == "prismatic"
    units = {role.unit for role in roles.roles if role.quantity == "position" and (role.unit == "m") == slides}
    for column in (role.column for role in roles.roles if role.quantity is None or role.quantity == "position"):
        found = read_name(column)
        words = [word for word in words_of(found.bare) if word not in ("position", "pos")]
        if found.quantity != "position" or not match_names([" ".join(words)], [joint.name]):
            continue
        values = np.concatenate([np.asarray(table[column], float) for table in tables if column in table])
        known = values[np.isfinite(values)]
        unit = found.unit or next(iter(units), "m" if slides else "rad")
        try:
            place = known * to_si_factor(unit, "m" if slides else "rad")[0]
        except StudyError:
            continue
        if place.size and float(np.ptp(place)) <= MIN_MOVING_RANGE[slides]:
            return f"{float(np.median(place)):.6g} {'m' if slides else 'rad'}"
    return None


# --- the robot ------------------------------------------------------------------------------------------------------


def _carries(joint: TreeJoint, robot: Urdf, moving: set[str]) -> bool:
    """Whether a joint of the file carries one of those that moved."""
    behind, grown = {joint.child}, True
    while grown:
        more = {other.child for other in robot.joints if other.parent in behind} - behind
        behind, grown = behind | more, bool(more)
    return any(other.parent in behind for other in robot.joints if other.name in moving)


def _within_limits(joint: TreeJoint, robot: Urdf) -> str:
    """Return the place nearest to 0 that a joint's limits allow, as study.toml writes it."""
    limits, place = robot.limits.get(joint.name), 0.0
    if limits is not None:
        low = -np.inf if limits.lower is None else limits.lower
        high = np.inf if limits.upper is None else limits.upper
        place = min(max(place, low), high) if low <= high else 0.0
    return f"{place:.6g} {'m' if joint.kind == 'prismatic' else 'rad'}"


def _better_order(
    robot: Urdf, held: Mapping[str, str], recorded: Sequence[_RecordedJoint], names: Sequence[str], rate: float | None
) -> list[str] | None:
    """Return the names in an order in which the file's bodies explain the efforts much better; None if no order does.

    The orders are those with two joints exchanged, and the reverse one.
    """
    rows = _rows(recorded, rate)
    if rows is None or not robot.has_bodies or len(names) < 2:
        return None
    places = {name: float(text.split()[0]) for name, text in held.items()}
    try:
        tree, _ = robot.tree(places)
    except PellucidError:
        return None  # `check` says what is wrong with the file
    order = [joint.name for joint in tree.moving]
    if set(order) != set(names):
        return None
    kinds = {joint.name: joint.kind for joint in tree.moving}
    swapped = [[*names] for _ in range(len(names) * (len(names) - 1) // 2)]
    for made, (i, k) in zip(swapped, combinations(range(len(names)), 2), strict=True):
        made[i], made[k] = made[k], made[i]
    alike = [tuple(kinds[name] for name in names)]
    others = [o for o in (*swapped, list(reversed(names))) if tuple(kinds[name] for name in o) in alike]

    def left(given: Sequence[str]) -> float:
        columns = [list(given).index(name) for name in order]
        return _left_share(tree, *(x[:, columns] for x in rows))

    own = left(names)
    best, better = min(((left(each), each) for each in others), key=lambda one: one[0], default=(np.inf, None))
    is_better = best <= MATCH_LIMITS.max_left_share and best <= MATCH_LIMITS.max_left_ratio * own
    return list(better) if better is not None and is_better else None


def _rows(recorded: Sequence[_RecordedJoint], rate: float | None) -> tuple[np.ndarray, ...] | None:
    """Return positions, speeds, accelerations and efforts, (n, joints) each; None if they do not tell orders."""
    if rate is None or any(joint.position is None or joint.effort is None for joint in recorded):
        return None
    q = np.column_stack([joint.position for joint in recorded])
    effort = np.column_stack([joint.effort for joint in recorded])
    known = np.isfinite(q).all(axis=1) & np.isfinite(effort).all(axis=1)
    if known.sum() < MATCH_LIMITS.min_rows or known.mean() < 0.9:
        return None
    grid, at = np.arange(len(q)), np.flatnonzero(known)
    cutoff = MATCH_LIMITS.lowpass_share * rate

    def smooth(signals: np.ndarray) -> np.ndarray:
        whole = np.column_stack([np.interp(grid, at, x[known]) for x in signals.T])
        return zero_phase_lowpass(whole, cutoff, 4, rate)

    q, effort = smooth(q), smooth(effort)
    v = np.column_stack([central_difference(x, rate) for x in q.T])
    a = np.column_stack([central_difference(x, rate) for x in v.T])
    border = len(q) // 20
    step = max(1, (len(q) - 2 * border) // MATCH_LIMITS.max_rows)
    return tuple(x[border : len(x) - border : step] for x in (q, v, a, effort))


def _left_share(tree, q: np.ndarray, v: np.ndarray, a: np.ndarray, effort: np.ndarray) -> float:
    """Return the mean share of the efforts' variance that weight, inertia and friction leave, each scaled freely."""
    still = np.zeros_like(v)
    weight = tree.core.inverse_dynamics(q, still, still)
    inertia = tree.core.inverse_dynamics(q, v, a) - weight
    shares = []
    for k in range(q.shape[1]):
        features = np.column_stack([weight[:, k], inertia[:, k], v[:, k], np.sign(v[:, k]), np.ones(len(q))])
        spread = float(np.sum((effort[:, k] - effort[:, k].mean()) ** 2))
        if spread <= 0.0:
            continue
        scaled = features / np.maximum(np.linalg.norm(features, axis=0), 1e-300)
        off = effort[:, k] - scaled @ np.linalg.lstsq(scaled, effort[:, k], rcond=1e-8)[0]
        shares.append(float(off @ off) / spread)
    return float(np.mean(shares)) if shares else 1.0
