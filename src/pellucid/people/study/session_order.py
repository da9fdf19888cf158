"""Order of the conditions for each participant, from the `period` of recordings in study.toml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import StudyError
from ...files.recording import Recording


@dataclass(frozen=True)
class SessionOrder:
    """Order of the recordings."""

    period: Mapping[str, int]  # period by recording, from 1; empty if it is not stated for all
    by_condition: Mapping[tuple[str, str], float]  # mean period by participant and condition
    within: Mapping[str, int]  # rank of a recording in its participant and condition; -1 if unknown
    unknown: str = ""  # reason why the order cannot be used

    def later(self, participants: Sequence[str], condition: str, control: str | None) -> np.ndarray:
        """Return the number of periods by which the condition followed control, or its own mean, (n,)."""
        own = np.array([self.by_condition[person, condition] for person in participants])
        if control is None:
            return own - own.mean()
        return own - np.array([self.by_condition[person, control] for person in participants])


def session_order(recordings: Sequence[Recording]) -> SessionOrder:
    """Return the order of `recordings`; refuse two conditions of a participant in one period."""
    seen: dict[tuple[str, int], Recording] = {}
    for each in recordings:
        if each.period is not None:
            other = seen.setdefault((each.participant, each.period), each)
            if other.condition != each.condition:
                raise StudyError(
                    f"[[recordings]] {each.name}: found period = {each.period} of {each.participant} in "
                    f"{each.condition}, which {other.name} has in {other.condition}; expected another number"
                )
    lacking = [each.name for each in recordings if each.period is None]
    within = _within(recordings)
    if lacking:
        some = f" of {lacking[0]}" + (f" and {len(lacking) - 1} more" if len(lacking) > 1 else "")
        some = some if len(lacking) < len(recordings) else ""
        return SessionOrder({}, {}, within, f"study.toml does not say in which order conditions came (period{some})")
    by: dict[tuple[str, str], list[int]] = {}
    for each in recordings:
        by.setdefault((each.participant, each.condition), []).append(each.period)
    means = {key: float(np.mean(own)) for key, own in by.items()}
    return SessionOrder({each.name: each.period for each in recordings}, means, within)


def _within(recordings: Sequence[Recording]) -> dict[str, int]:
    groups: dict[tuple[str, str], list[Recording]] = {}
    for each in recordings:
        groups.setdefault((each.participant, each.condition), []).append(each)
    places: dict[str, int] = {}
    for own in groups.values():
        for key in ("period", "repetition"):
            numbers = [getattr(each, key) for each in own]
            if len(own) == 1 or (None not in numbers and len(set(numbers)) == len(own)):
                order = sorted(own, key=lambda each: getattr(each, key) or 0)
                places |= {each.name: i for i, each in enumerate(order)}
                break
        else:
            places |= dict.fromkeys((each.name for each in own), -1)
    return places
