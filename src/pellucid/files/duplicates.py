"""Find recordings of a study with the same samples. A copy would validate the model on its own training data, or count
twice in the fit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from hashlib import blake2b

import numpy as np

from .fault import Fault
from .recording import Recording

MIN_SHARED_SAMPLES = 50
"""Only recordings with at least this many samples are compared; shorter ones may be equal by chance."""


def find_duplicates(recordings: Iterable[Recording]) -> list[Fault]:
    """Return a fault for each recording that has another one's samples, or the same stretch of the same file."""
    faults: list[Fault] = []
    seen: dict[tuple[int, bytes] | int, Recording] = {}
    recordings = [recording for recording in recordings if len(recording) >= MIN_SHARED_SAMPLES]
    lengths = Counter(map(len, recordings))
    for recording in recordings:
        # The digest of a long recording takes time, and is needed only if another recording has the same length.
        key: tuple[int, bytes] | int = _samples_digest(recording) if lengths[len(recording)] > 1 else len(recording)
        if key in seen:
            faults.append(_fault(recording, seen[key]))
            continue
        seen[key] = recording
        for other in seen.values():
            if other is not recording and _overlap(other, recording):
                faults.append(_fault(recording, other))
                break
    return faults


def _samples_digest(recording: Recording) -> tuple[int, bytes]:
    digest = blake2b("".join(stream.checksum for stream in recording.streams.values()).encode(), digest_size=16)
    for name, channel in sorted(recording.channels.items()):
        if name != "time":
            digest.update(name.encode() + np.ascontiguousarray(channel.samples).data)
    return len(recording), digest.digest()


def _overlap(one: Recording, other: Recording) -> bool:
    """Whether two recordings are windows of one file that share a stretch of time and a channel."""
    if one.checksum != other.checksum or one.use == other.use:
        return False
    columns = [{c.column for n, c in r.channels.items() if n != "time"} for r in (one, other)]
    if not columns[0] & columns[1]:
        return False
    return max(one.time[0], other.time[0]) <= min(one.time[-1], other.time[-1])


def _fault(one: Recording, other: Recording) -> Fault:
    found = f"the same samples as in {other.path.name} (recording {other.name})"
    uses = f'"{other.use}" and "{one.use}"' if one.use != other.use else f'"{one.use}", both'
    wanted = f"recordings of their own, for they are used as {uses}: a copy predicts nothing"
    message = f"{one.path.name} (recording {one.name}): found {found}, expected {wanted}"
    return Fault("refuse", "duplicate", one.path.name, "", found, wanted, message)
