"""Compare channels with the fitted ones while they are recorded: sample by sample, from the past alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..._errors import RecordingError
from .emg_session import COMPARISON_INTERVAL_S, MIN_WATCH_S, WINDOW_S, ChannelChange, ChannelComparison, FittedSession
from .torque_trial import TorqueTrial


class SessionWatch:
    """A monitor of the channels' changes, for envelopes and angles that come one after another.

    Its result is that of `FittedSession.compare` for a recording of the samples in its buffer.
    """

    def __init__(self, session: FittedSession, joints: tuple[str, ...], fs: float, *, seconds: float = WINDOW_S):
        """Prepare a buffer of `seconds` [s] of samples at the rate `fs` [Hz]; `joints` names the angles."""
        if not fs > 0.0 or seconds < MIN_WATCH_S:
            raise RecordingError(
                f"channels watched: found {fs:g} Hz and {seconds:g} s to be compared, expected a rate above 0 and at "
                f"least {MIN_WATCH_S:g} s"
            )
        if 2 * len(joints) != len(session.low):
            raise RecordingError(
                f"channels watched: found angles of {', '.join(joints) or 'no joint'}, expected "
                f"{len(session.low) // 2} as in what was fitted"
            )
        self._session, self._joints, self._fs = session, joints, fs
        self._rows = np.full((round(seconds * fs), len(session.muscles) + len(joints)), np.nan)
        self.reset()

    def reset(self) -> None:
        """Empty the buffer."""
        self._count = 0
        self._last_comparison: ChannelComparison | None = None

    @property
    def last_comparison(self) -> ChannelComparison | None:
        """Result of the last comparison; None before the first."""
        return self._last_comparison

    @property
    def changes(self) -> tuple[ChannelChange, ...]:
        """Channels that changed, by the last comparison."""
        return () if self._last_comparison is None else self._last_comparison.changes

    def step(self, envelopes: Mapping[str, float], angles: Mapping[str, float]) -> tuple[ChannelChange, ...]:
        """Add one sample of every envelope [1] and angle [rad] and return `changes`.

        A sample with a missing number is ignored.
        """
        row = [envelopes[m] for m in self._session.muscles] + [angles[j] for j in self._joints]
        if not np.isfinite(row).all():
            return self.changes
        self._rows[self._count % len(self._rows)] = row
        self._count += 1
        if self._count >= MIN_WATCH_S * self._fs and self._count % max(1, round(COMPARISON_INTERVAL_S * self._fs)) == 0:
            self._last_comparison = self._session.compare(self._buffered_trial())
        return self.changes

    def _buffered_trial(self) -> TorqueTrial:
        """Return the samples in the buffer as a trial, the oldest first."""
        at = self._count % len(self._rows)
        rows = self._rows[: self._count] if self._count < len(self._rows) else np.roll(self._rows, -at, axis=0)
        n, muscles = len(rows), self._session.muscles
        envelopes = {m: rows[:, i] for i, m in enumerate(muscles)}
        angles = {j: rows[:, len(muscles) + i] for i, j in enumerate(self._joints)}
        time = np.arange(n) / self._fs
        return TorqueTrial("live", self._joints[0], time, envelopes, angles, np.zeros(n))
