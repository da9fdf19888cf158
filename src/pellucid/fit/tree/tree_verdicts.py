"""What the recordings show of each number and of each joint, in words."""

from __future__ import annotations

from collections.abc import Iterator

from ..parameter import Parameter, Verdict
from .tree_estimate import TreeEstimate

IDENTIFIED, WEAK, ON_A_BOUND, NOT_IDENTIFIABLE = "identified", "weak", "on a bound", "not identifiable"
NAMED = 4
"""So many numbers are named in a sentence; the table has all."""


def state_of(parameter: Parameter) -> str:
    """Of an estimated number: identified where its 95 % interval leaves out 0; else weak, on a bound, or not
    identifiable."""
    if parameter.at_bound:
        return ON_A_BOUND
    if parameter.refused and not parameter.standard_error:
        return NOT_IDENTIFIABLE
    return IDENTIFIED if parameter.identifiable else WEAK


def states(estimate: TreeEstimate) -> dict[str, str]:
    """Of every number that was fitted."""
    return {name: state_of(p) for name, p in estimate.parameters.items() if not name.endswith("stribeck_velocity")}


def verdicts(estimate: TreeEstimate) -> tuple[Verdict, ...]:
    """Of each joint's friction, and of the bodies."""
    found = states(estimate)
    joints = estimate.robot.names
    friction = {n: s for n, s in found.items() if n.rpartition(".")[0] in joints and not n.endswith("inertia")}
    made = []
    for joint in joints:
        own = {n: s for n, s in friction.items() if n.rpartition(".")[0] == joint}
        made += list(_of_group(f"joint {joint}", own, "friction"))
    bodies = {n: s for n, s in found.items() if n not in friction}
    made += list(_of_group("bodies and rotors", bodies, "inertia"))
    return tuple(made)


RECORD = {
    "friction": "Record slow and fast motion of this joint, both ways, with and without load.",
    "inertia": "Record quicker motion of all joints at once, over more of their ranges.",
}


def _of_group(who: str, found: dict[str, str], what: str) -> Iterator[Verdict]:
    if not found:
        return
    by_state = {state: [n for n, s in found.items() if s == state] for state in (WEAK, ON_A_BOUND, NOT_IDENTIFIABLE)}
    if not any(by_state.values()):
        yield Verdict("good", f"{who}: all {len(found)} numbers are identified.", finding=f"tree_{what}")
        return
    if by_state[NOT_IDENTIFIABLE]:
        names = by_state[NOT_IDENTIFIABLE]
        yield Verdict(
            "warning",
            f"{who}: {_listed(names)} cannot be identified: nothing in these recordings tells "
            f"{'it' if len(names) == 1 else 'them'} from the others.",
            RECORD[what],
            finding=f"tree_{what}",
            weight=float(len(names)),
        )
    if by_state[WEAK]:
        names = by_state[WEAK]
        yield Verdict(
            "note",
            f"{who}: {_listed(names)} {'is' if len(names) == 1 else 'are'} weak, of {len(found)} numbers: the 95 % "
            "interval holds 0.",
            RECORD[what],
            finding=f"tree_{what}",
            weight=len(names) / len(found),
        )
    if by_state[ON_A_BOUND]:
        names = by_state[ON_A_BOUND]
        yield Verdict(
            "note",
            f"{who}: {_listed(names)} {'is' if len(names) == 1 else 'are'} held by a physical bound: there is none to "
            "see, or the model lacks something that pushes there.",
            finding=f"tree_{what}",
        )


def _listed(names: list[str]) -> str:
    if len(names) > NAMED + 1:
        names = [*names[:NAMED], f"{len(names) - NAMED} others"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
