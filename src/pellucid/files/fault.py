"""Faults of recordings, and their messages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .recording import Recording


@dataclass(frozen=True)
class Fault:
    """A fault or a remarkable property of a recording.

    Attributes
    ----------
    severity : str
        ``"refuse"``: nothing may be identified from the recording; ``"cut"``: it is used without the faulty part;
        ``"warn"``: it is used, but its results are doubtful; ``"note"``: it is used.
    kind : str
        ``"missing_channel"``, ``"missing_samples"``, ``"time_order"``, ``"sampling_jitter"``, ``"repeated_packets"``,
        ``"gap"``, ``"rate"``, ``"too_few_samples"``, ``"spike"``, ``"dropout"``, ``"clipped"``, ``"sensor_range"``,
        ``"frozen_encoder"``, ``"garbage"``, ``"excluded"``, ``"too_much_cut"``, ``"duplicate"``, ``"wrap"`` or
        ``"magnitude"``. A joint's drive has also ``"dead_effort"``, ``"copied_effort"``, ``"echoed"``, ``"worn"`` or
        ``"delay"``, a joined file ``"clock"``, a recorded velocity ``"velocity_mismatch"``, ``"velocity_sign"``,
        ``"velocity_scale"`` or ``"velocity_delay"``. A robot with several joints has also ``"robot"``, ``"payload"``,
        ``"gains"``, ``"lengths"``, ``"velocity"``, ``"resting_joint"``, ``"joined_joints"``, ``"sign"`` or
        ``"limits"``, markers ``"lost_marker"`` and ``"overlap"``, and EMG ``"changed_channel"`` and
        ``"another_condition"``.
    file, channel : str
        File and channel with the fault; in a motion capture's file, the marker or ``"time"``.
    found, expected : str
        Descriptions of the state that was found and of the expected one.
    message : str
        Complete message in one line.
    """

    severity: str
    kind: str
    file: str
    channel: str
    found: str
    expected: str
    message: str


def fault_of(
    recording: Recording,
    severity: str,
    kind: str,
    channel: str,
    *,
    found: str,
    expected: str,
    end: str = "",
    of_channel: bool = True,
) -> Fault:
    """Return a fault of a recording; its message states the place, `found`, and the expectation at its `end`.

    Parameters
    ----------
    recording : Recording
        Recording, or stream of one, with the fault.
    severity, kind, channel, found, expected : str
        Attributes of the fault.
    end : str
        End of the message after the comma; "" for what was expected.
    of_channel : bool
        Whether the message names the channel.
    """
    where = f"{recording.path.name} (recording {recording.name})" + f", channel {channel}" * of_channel
    message = f"{where}: found {found}, {end or f'expected {expected}'}"
    return Fault(severity, kind, recording.path.name, channel, found, expected, message)


def warn_if_held_out(fault: Fault, use: str) -> Fault:
    """Return the fault as a warning if it refuses a recording whose `use` is not to be fitted.

    A held-out recording is evaluated even if it is implausible. It reaches no fit, so it does not stop a study.
    """
    return replace(fault, severity="warn") if use != "fit" and fault.severity == "refuse" else fault


def grouped_messages(faults: Sequence[Fault], most: int = 3, most_cuts: int = 10) -> list[str]:
    """Return the messages of the faults, shortened.

    If more than `most` differ only in their file, only the first is listed, with the number of the others. Of cuts of
    one kind in one file, `most_cuts` are listed.
    """
    kinds: dict[tuple[str, ...], list[str]] = {}
    for fault in faults:
        key: tuple[str, ...]
        if fault.severity == "cut":
            key = ("cut", fault.kind, fault.channel, fault.file)
        elif fault.severity == "refuse":
            # Recordings that lack the same thing are one line; those that differ in what was found are not.
            key = ("refuse", fault.kind, fault.channel, fault.found)
        else:
            key = ("told", fault.kind, fault.channel) if len(faults) > most else ("told", fault.message)
        kinds.setdefault(key, []).append(fault.message)
    listed: list[str] = []
    for what, messages in kinds.items():
        # The first cuts of one kind in one file are listed with their places.
        count = most_cuts if what[0] == "cut" else 1
        if len(messages) <= max(most, count):
            listed += messages
        else:
            listed += [*messages[: count - 1], f"{messages[count - 1]} (and {len(messages) - count} more like it)"]
    return listed
