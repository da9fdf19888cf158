"""Finding: somebody wears the joint, or its effort is its own command."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ....files.defects import worn
from ....files.fault import Fault
from ....models.parameter import Verdict
from ..joint_case import JointCase
from ..wearer import WORN_ADVICE, wearer_faults

WORN_WEIGHT = 1e6
"""Weight of this verdict, which stands before all others of its kind."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report that recordings were worn, which makes every parameter one of robot and wearer together."""
    faults = wearer_faults(case.study)
    worn_faults = [fault for fault in faults if fault.kind == worn.KIND]
    echoes = [fault for fault in faults if fault.kind != worn.KIND]
    if worn_faults:
        files, found = _files_of(worn_faults), worn_faults[0].found
        text = f"Somebody seems to wear the joint in {files}: {found}. No channel was moved for it."
        yield Verdict("warning", text, f"{WORN_ADVICE}.", weight=WORN_WEIGHT)
    if echoes:
        text = (
            f"{echoes[0].channel} of {_files_of(echoes)} is no measurement: {echoes[0].found}. It is its own command."
        )
        do = "Log what the drive's current or a torque sensor measured."
        yield Verdict("warning", text, do, weight=WORN_WEIGHT)


def _files_of(faults: Sequence[Fault]) -> str:
    files = list(dict.fromkeys(fault.file for fault in faults))
    return files[0] if len(files) == 1 else f"{files[0]} and {len(files) - 1} more"
