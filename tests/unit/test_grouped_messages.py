"""Faults that recordings share are told once, whatever their severity; what differs stays apart."""

from pellucid.files.fault import Fault, grouped_messages


def missing_position(number: int, found: str = "only torque") -> Fault:
    file = f"trial_{number}.csv"
    return Fault("refuse", "missing", file, "position", found, "a channel position", f"{file}: found {found}")


def test_a_channel_that_every_recording_lacks_is_one_line() -> None:
    told = grouped_messages([missing_position(number) for number in range(24)])
    assert told == ["trial_0.csv: found only torque (and 23 more like it)"]


def test_refusals_that_found_different_things_are_all_told() -> None:
    told = grouped_messages([missing_position(number, f"column {number}") for number in range(5)])
    assert len(told) == 5
