"""Finding: the identified payloads."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import TreeResult

MAX_MASS_ERROR_PERCENT = 5.0
"""Largest error of an identified mass that counts as correct [%]."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report each identified payload, compared with its stated mass."""
    for p in case.payloads:
        if p.mass.refused:
            do = "Move the link that carries it in more directions."
            yield Verdict("note", f"The mass of the payload of {p.recording} is not told by its motion.", do)
            continue
        if p.tests == "nothing":
            yield Verdict(
                "note",
                f"The payload of {p.recording} set the gains of the drives, so that it cannot test them.",
                'Record another known payload with use = "validate": its mass is then predicted.',
            )
            continue
        text = f"The payload of {p.recording} comes out as {p.mass.value:.4g} kg"
        if p.known is None:
            yield Verdict("note", f"{text}.")
            continue
        text += ", by gains from the other payloads" if p.tests == "gains of other payloads" else ""
        text += f", {p.error:.2g} % from the {p.known:.4g} kg that were stated."
        do = (
            ""
            if p.error <= MAX_MASS_ERROR_PERCENT
            else "Check the gains of the drives: [tree] gains says where they come from."
        )
        yield Verdict("good" if p.error <= MAX_MASS_ERROR_PERCENT else "warning", text, do, weight=p.error)
