"""Something wrong or remarkable in a recording, and how it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """Something wrong or remarkable in a recording.

    Attributes
    ----------
    severity : str
        ``"refuse"``: nothing may be identified from it; ``"cut"``: used, but without it; ``"warn"``: used, and what is
        found there is not to be believed as it is; ``"note"``: told, and used.
    kind : str
        ``"missing_channel"``, ``"missing_samples"``, ``"time_order"``, ``"sampling_jitter"``, ``"repeated_packets"``,
        ``"gap"``, ``"rate"``, ``"too_few_samples"``, ``"spike"``, ``"dropout"``, ``"clipped"``, ``"frozen_encoder"``,
        ``"excluded"``, ``"too_much_cut"``, ``"duplicate"``, ``"wrap"`` or ``"magnitude"``; of a joint's drive
        ``"dead_effort"``, ``"copied_effort"`` or ``"delay"``, of a joined file ``"clock"``, of a recorded velocity
        ``"velocity_mismatch"``, ``"velocity_sign"``, ``"velocity_scale"`` or ``"velocity_delay"``; of a robot of
        several joints ``"robot"``, ``"payload"``, ``"gains"``, ``"lengths"``, ``"velocity"``, ``"resting_joint"``,
        ``"joined_joints"``, ``"sign"`` or ``"limits"``; of markers also ``"lost_marker"`` and ``"overlap"``; of EMG
        beside what is to be fitted ``"changed_channel"`` and ``"another_condition"``.
    file, channel : str
        Where; of a motion capture's file, the marker or ``"time"``.
    found, expected : str
        What, in words.
    message : str
        All of it in one line.
    """

    severity: str
    kind: str
    file: str
    channel: str
    found: str
    expected: str
    message: str


def grouped(faults: Sequence[Fault], most: int = 3, most_cuts: int = 10) -> list[str]:
    """Messages of what does not refuse; of many that differ only in their file, the first, and how many more there
    are."""
    kinds: dict[tuple[str, ...], list[str]] = {}
    for fault in faults:
        if fault.severity == "cut":
            kinds.setdefault((fault.kind, fault.channel, fault.file), []).append(fault.message)
        elif fault.severity != "refuse":
            what = (fault.kind, fault.channel) if len(faults) > most else (fault.message, "")
            kinds.setdefault(what, []).append(fault.message)
    said = []
    for what, messages in kinds.items():
        # A cut is told with its place; where there are many of one kind in one file, the first ones are.
        told = most_cuts if len(what) == 3 else 1
        if len(messages) <= max(most, told):
            said += messages
        else:
            said += [*messages[: told - 1], f"{messages[told - 1]} (and {len(messages) - told} more like it)"]
    return said
