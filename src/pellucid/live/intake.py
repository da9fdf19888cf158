"""Take streams of the lab streaming layer in: `python -m pellucid.live.intake REGION TYPE... --names NAME...`.

One process pulls every stream of the stated names, or of the stated types where no name is stated. It brings their
times onto the host's clock, and writes them into rings next to the region. Recorder and session read there, so that
neither's death loses a sample. A stream that falls silent is resolved again; one that comes back, by its name and
source, goes on in its ring.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import PellucidError, install_command
from .clock_tracker import ClockTracker
from .setup import SessionProcess
from .stream_ring import StreamRing, ask_for_niceness

NAMES_WORD = "--names"
"""Word of the command line after which names of streams follow."""

POLL_S = 0.01
"""Time between two looks at the streams."""

RESOLVE_INTERVAL_S = 1.0
"""Time between two searches for streams."""

SILENCE_S = 2.0
"""A stream that was silent for this time is looked for again."""

MAX_CHUNK_SAMPLES = 8192
"""Largest number of samples that are pulled at once."""

CORRECTION_INTERVAL_S = 5.0
"""Time between two measurements of the offset between computers."""


def streaming_layer() -> Any:
    """Return pylsl.

    Raises
    ------
    PellucidError
        If it is not installed.
    """
    try:
        import pylsl
    except (ImportError, RuntimeError) as error:
        raise PellucidError(
            f"streams: could not load pylsl ({error}), expected it: {install_command('live')}"
        ) from None
    return pylsl


class _Inlet:
    """One stream that is pulled into its ring."""

    def __init__(self, info: Any, ring: StreamRing | None, region: Path, index: int) -> None:
        pylsl = streaming_layer()
        self.inlet = pylsl.StreamInlet(info, max_buflen=60, recover=False)
        full = self.inlet.info(timeout=5.0)
        labels, units = _channels_of(full)
        self.key = key_of(info)
        self.ring = ring or StreamRing.create(
            region, index, name=info.name(), type=info.type(), source=info.source_id(), rate=info.nominal_srate(),
            labels=labels, units=units,
        )  # fmt: skip
        self.tracker = ClockTracker(info.nominal_srate())
        self.corrected = -np.inf
        self.correction = 0.0
        self.heard = time.monotonic()
        self.lost = False
        self.lost_before = self.ring.clock.lost

    def pull(self) -> None:
        """Take in what has arrived."""
        now = time.monotonic()
        try:
            values, stamps = self.inlet.pull_chunk(timeout=0.0, max_samples=MAX_CHUNK_SAMPLES)
            if now - self.corrected > CORRECTION_INTERVAL_S:
                self.correction = self.inlet.time_correction(timeout=0.2)
                self.corrected = now
        except Exception as error:  # the layer has its own kinds: lost, timeout
            if type(error).__name__ == "TimeoutError":
                self.corrected = now
                return
            self.lost = True
            return
        if not len(stamps):
            self.lost = now - self.heard > SILENCE_S
            return
        self.heard = now
        device = np.asarray(stamps, float)
        # The layer measures the offset between computers; the tracker follows the rest, such as a device's own clock.
        self.tracker.take(device + self.correction, now)
        self.ring.append(device + self.correction, device, np.asarray(values, float))
        state = self.tracker.state
        known = type(state)(
            state.offset + self.correction,
            state.drift,
            state.jumps,
            state.batches,
            state.lost + self.lost_before,
            state.rate,
        )
        self.ring.tell(known, round(1e9 * now))


def key_of(info: Any) -> tuple[str, str, str]:
    """Return what a stream is known by after its source was started again."""
    return info.name(), info.type(), info.source_id()


def _channels_of(info: Any) -> tuple[list[str], list[str]]:
    """Return labels and units of a stream's channels; those without a label are numbered from 1."""
    channel = info.desc().child("channels").child("channel")
    labels, units = [], []
    for i in range(info.channel_count()):
        labels.append(channel.child_value("label") or str(i + 1))
        units.append(channel.child_value("unit") or "")
        channel = channel.next_sibling("channel")
    return labels, units


def is_wanted(info: Any, types: Sequence[str], names: Sequence[str]) -> bool:
    """Return whether a stream is taken in: one of the `names`, or of the `types` where there are no names."""
    return info.name() in names if names else info.type() in types


def run(region: Path, types: Sequence[str], names: Sequence[str] = ()) -> None:
    """Take streams of these names in, or of these types, until SIGTERM."""
    pylsl = streaming_layer()
    ends: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: ends.append(number))
    ask_for_niceness()
    resolver = pylsl.ContinuousResolver()
    inlets: dict[tuple[str, str, str], _Inlet] = {}
    rings = {(ring.name, ring.type, ring.source): ring for ring in StreamRing.all_of(region)}
    resolved = -np.inf
    process = SessionProcess()
    while not ends and not process.is_over():
        now = time.monotonic()
        if now - resolved > RESOLVE_INTERVAL_S:
            resolved = now
            for info in resolver.results():
                key = key_of(info)
                if not is_wanted(info, types, names) or (key in inlets and not inlets[key].lost):
                    continue
                try:
                    inlets[key] = _Inlet(info, rings.get(key), region, len(rings))
                except Exception as error:
                    print(f"stream {info.name()}: {error}", file=sys.stderr, flush=True)
                    continue
                rings[key] = inlets[key].ring
        for inlet in inlets.values():
            if not inlet.lost:
                inlet.pull()
        time.sleep(POLL_S)


if __name__ == "__main__":
    place = sys.argv.index(NAMES_WORD) if NAMES_WORD in sys.argv else len(sys.argv)
    run(Path(sys.argv[1]), sys.argv[2:place], sys.argv[place + 1 :])
