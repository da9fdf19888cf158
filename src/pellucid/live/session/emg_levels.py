"""Levels of EMG while a person contracts: envelopes of raw samples as they arrive, as shares of the largest ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...emg.signals.emg_chain import EmgStream, emg_chain

ENVELOPE_CHAIN = "knee"
"""Name of the chain of filters that makes an envelope for a screen."""

SETTLING_S = 1.0
"""Time after the start in which a filter's output counts for nothing [s]."""


class EmgLevels:
    """The level of each muscle now, and the largest one so far."""

    def __init__(self, fs: float):
        self.fs = fs
        self.envelopes: dict[str, float] = {}  # [V]
        self.largest: dict[str, float] = {}  # [V]
        self.seen = 0  # samples
        self._streams: dict[str, EmgStream] = {}

    def take(self, channels: Mapping[str, np.ndarray], *, keep_largest: bool = True) -> dict[str, np.ndarray]:
        """Take the samples that came, (n,) [V] by muscle; return their envelopes, (n,) [V]."""
        made = {}
        for muscle, samples in channels.items():
            if not len(samples):
                continue
            if muscle not in self._streams:
                self._streams[muscle] = emg_chain(ENVELOPE_CHAIN).stream(self.fs)
            made[muscle] = self._streams[muscle].filter(np.nan_to_num(samples))
            self.envelopes[muscle] = float(made[muscle][-1])
        self.seen += max((len(samples) for samples in channels.values()), default=0)
        if keep_largest and self.seen > SETTLING_S * self.fs:
            for muscle, envelope in made.items():
                self.largest[muscle] = max(self.largest.get(muscle, 0.0), float(np.max(envelope)))
        return made

    @property
    def levels(self) -> dict[str, float]:
        """Envelope of each muscle as a share of its largest one; nothing until there is one."""
        return {m: self.envelopes[m] / top for m, top in self.largest.items() if top > 0.0 and m in self.envelopes}
