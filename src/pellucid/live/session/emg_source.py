"""The stream of EMG of a session's engine, which may begin after the session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

LOOK_INTERVAL_S = 0.5
"""Time between two looks for a stream that is not there yet [s]."""


class EmgSource:
    """Reads the engine's EMG by muscle, from several cursors."""

    def __init__(self, engine: Any, clock: Callable[[], float]):
        self._engine, self._clock = engine, clock
        self._ring: Any = None
        self._looked_at = -np.inf

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]; 0 while there is no stream."""
        ring = self._find()
        return 0.0 if ring is None else float(ring.nominal_rate)

    def read_since(self, cursor: int) -> tuple[int, np.ndarray, dict[str, np.ndarray]]:
        """Return the next cursor, times, shape (n,) [s], and samples by muscle, shape (n,) each [V]."""
        ring = self._find()
        if ring is None:
            return cursor, np.empty(0), {}
        found = ring.read_since(cursor)
        names = [label.removeprefix("emg.") for label in ring.labels]
        return found.cursor, found.time, {name: found.values[:, i] for i, name in enumerate(names)}

    def _find(self) -> Any:
        # A look opens files, so that it is not taken in every step.
        now = self._clock()
        if self._ring is None and now - self._looked_at >= LOOK_INTERVAL_S:
            self._looked_at, self._ring = now, self._engine.emg
        return self._ring
