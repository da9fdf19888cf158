"""Say which part of a study the given files lack, in one sentence that names what supplies it."""

from __future__ import annotations

from collections.abc import Iterator

from .propose_study import Proposal, accepted_units, duty_without_supply, has_accepted_unit

EFFORT_QUANTITIES = ("torque", "force", "moment", "current", "voltage", "duty")
"""Quantities of which a study needs one: each tells the effort of a joint."""


def missing_part(proposal: Proposal) -> str | None:
    """Return the first thing that keeps a proposal from being a study; None if the proposal has all its parts."""
    return next(_missing_parts(proposal), None)


def _missing_parts(proposal: Proposal) -> Iterator[str]:
    channels = [role for layout in (proposal.main, *proposal.streams) for role in layout.channels]
    quantities = {role.quantity for role in channels}
    if proposal.drive is None and not quantities & set(EFFORT_QUANTITIES):
        yield (
            "no effort was recorded: found no column with a torque, force, current, voltage or duty cycle, "
            "expected one beside the motion"
        )
    elif proposal.drive is None and "emg" not in quantities:
        yield (
            "found joint moments of a person and no EMG, expected EMG beside the moments, or the effort of a drive "
            "(torque, force, current, voltage or duty cycle)"
        )
    for role in channels:
        if not has_accepted_unit(role):
            units = " or ".join(accepted_units(role))
            yield (
                f'the column "{role.column}" is taken for {role.quantity} and states the unit "{role.unit}", expected '
                f"{units} or a multiple: export the column in such a unit"
            )
    joints = proposal.main.roles.joints
    if len(joints) > 1 and not proposal.is_person and not proposal.robot_joints:
        robots = proposal.given.robots
        found = f"{robots[0].name}, which has another number of joints" if robots else "no URDF file of the robot"
        yield (
            f"found {len(joints)} joints ({', '.join(joints)}) and {found}, expected a URDF file with these joints: "
            "name it with --urdf FILE, or give files with the columns of one joint"
        )
    duty = duty_without_supply((proposal.main, *proposal.streams), proposal.drive, proposal.drive_facts)
    if duty is not None:
        yield (
            f'the effort "{duty.column}" is a duty cycle and no file states the supply voltage, expected it: '
            '--answer "supply_voltage=12 V", with the voltage of your supply'
        )
