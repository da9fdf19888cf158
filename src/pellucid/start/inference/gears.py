"""Find a gear between what was recorded of a motor and of its joint: by a speed no unit explains, and by names."""

from __future__ import annotations

from dataclasses import dataclass

from ...units import to_si_factor
from .assign_roles import ROLE_LIMITS, ColumnRole, TableRoles
from .joint_keys import is_named_motor, side_of

WHOLE_TURNS_TOLERANCE = 0.01
"""A gear whose turns are within this share of a whole number has that number."""


@dataclass(frozen=True)
class FoundGear:
    """A gear behind which the joint's position was recorded, and before which something else was."""

    turns: float  # turns of the motor for a turn of the joint, 1 where nothing tells them
    speeds: dict[str, float]  # speeds of motors, and how many times their joints' they are
    efforts: tuple[str, ...]  # torques that may be the motors'
    is_named: bool  # whether an effort is named after the motor


def find_gear(roles: TableRoles, efforts: tuple[str, ...]) -> FoundGear | None:
    """Return the gear of a table's joints; None if nothing shows one. `efforts` are quantities of the drive.

    A speed in a stated unit that is many times its position's derivative is the motor's. Without one, a torque named
    after the motor with a position named after the joint may be on the motor side of a gear.
    """
    channels = {role.column: role for role in roles.roles if role.quantity is not None and not role.is_command}
    speeds = {}
    for pair in roles.pairs:
        of, by = channels.get(pair.of), channels.get(pair.by)
        ratio = None if of is None or by is None else _speed_ratio(of, by, abs(pair.ratio))
        if ratio is not None and ratio >= ROLE_LIMITS.min_gear_turns:
            speeds[pair.by] = ratio
    positions = {role.label: role for role in channels.values() if role.quantity == "position"}
    driving = [r for r in channels.values() if r.quantity in efforts and r.label in positions]
    named = [r for r in driving if is_before_gear(r, positions[r.label])]
    # A torque that is named after the joint is behind the gear, whatever the speed is.
    moved = {channels[column].label for column in speeds}
    if roles.geared:
        moved |= set(positions)
    open_ones = [r for r in driving if r in named or (r.label in moved and side_of(r.column) != "output")]
    if not speeds and not named and not roles.geared:
        return None
    turns = min((*speeds.values(), *roles.geared.values()), default=1.0)
    whole = round(turns)
    turns = float(whole) if abs(turns / whole - 1.0) < WHOLE_TURNS_TOLERANCE else float(f"{turns:.4g}")
    return FoundGear(turns, speeds, tuple(r.column for r in open_ones), bool(named))


def is_before_gear(effort: ColumnRole, position: ColumnRole) -> bool:
    """Whether an effort is named after the motor while the position is named after the joint."""
    return is_named_motor(effort.column) and side_of(position.column) == "output"


def _speed_ratio(of: ColumnRole, by: ColumnRole, ratio: float) -> float | None:
    """Return how many times the derivative of a position a speed is, by the units of both; None if one is open.

    `ratio` is that of their numbers.
    """
    if of.quantity != "position" or by.quantity != "velocity" or not (of.unit_is_certain and by.unit_is_certain):
        return None
    try:
        units = to_si_factor(by.unit, None)[0] / to_si_factor(of.unit, None)[0]
    except ValueError:
        return None
    scales = by.scale / of.scale
    return ratio * units * scales
