"""Finding: friction parameters that are not identified, by joint, and the number of identified inertial parameters."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ...fit.tree_verdicts import IDENTIFIED_VERDICT, NOT_IDENTIFIABLE_VERDICT, parameter_verdicts
from ..tree_result import TreeResult, unidentified_parameters


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the parameters that do not differ from 0, and those that the recordings do not determine."""
    weak = {joint: ", ".join(own) for k, joint in enumerate(case.names) if (own := unidentified_parameters(case, k))}
    if weak:
        names_text = "; ".join(f"{joint}: {names}" for joint, names in weak.items())
        do = "Record these joints slowly and fast, both ways, with more load and less."
        yield Verdict("note", f"Not sure of a joint's own numbers: {names_text}.", do, weight=len(weak))
    of_joints = {f"{joint}." for joint in case.names}
    bodies = {
        n: s for n, s in parameter_verdicts(case.best).items() if not any(n.startswith(joint) for joint in of_joints)
    }
    identified_count = sum(state == IDENTIFIED_VERDICT for state in bodies.values())
    lost = sum(state == NOT_IDENTIFIABLE_VERDICT for state in bodies.values())
    text = f"Of {len(bodies)} combinations of the bodies' numbers, {identified_count} are told from 0"
    text += f", and {lost} cannot be told at all." if lost else "."
    do = (
        ""
        if identified_count > 0.5 * len(bodies)
        else "Quicker motion of all joints at once, over more of their ranges, shows more."
    )
    yield Verdict("warning" if lost else "note", text, do, weight=lost)
