"""Columns for what a friction model misses where a joint turns.

Every friction family switches its sign at once where the joint turns, or over one travel. Real friction gives way
first: contacts bend over a travel, films shear at a speed, a gap opens. Two kinds of columns describe it without a law.
Friction that builds up over several travels follows the path. Pulses at times from every reversal of the velocity take
the rest, spread over the memory of the filters.
"""

from __future__ import annotations

import numpy as np

from ... import _core
from ...numerics.motion import Motion

REVERSAL_TIMES_S = (-0.05, -0.025, 0.0, 0.025, 0.05, 0.075)
"""Times of the pulses from a reversal [s]: filters spread over them what a gap, or friction, does there."""

TRAVEL_RANGE_SHARES = (1e-3, 3e-3, 1e-2, 2e-2)
"""Travels over which friction builds up, as shares of the range of motion."""


def reversal_pulses(motion: Motion, signal: np.ndarray) -> np.ndarray:
    """Return pulses at `REVERSAL_TIMES_S` from every change of the sign of a `signal`, (n,); shape (n, k)."""
    return np.gradient(motion.smooth(np.column_stack(shifted_signs(signal, motion.fs))), axis=0) * motion.fs


def shifted_signs(signal: np.ndarray, fs: float) -> list[np.ndarray]:
    """Return the sign of a `signal`, (n,), that is sampled at `fs` [Hz], later by each of `REVERSAL_TIMES_S`."""
    sign, made = np.sign(signal), []
    for time in REVERSAL_TIMES_S:
        shift = round(time * fs)
        moved = np.concatenate([np.full(abs(shift), sign[0]), sign, np.full(abs(shift), sign[-1])])
        start = abs(shift) - shift
        made.append(moved[start : start + len(sign)])
    return made


def turning_columns(motion: Motion) -> np.ndarray:
    """Return what friction may do where the joint turns, per unit of each column, (n, k)."""
    span, at_once = float(np.ptp(motion.position[motion.inner])), np.sign(motion.velocity)
    position = np.ascontiguousarray(motion.position, float)
    # A stretch at rest turns nowhere.
    gives = np.zeros((len(position), len(TRAVEL_RANGE_SHARES)))
    if span > 0.0:
        built_up = [_core.presliding(share * span, position) - at_once for share in TRAVEL_RANGE_SHARES]
        gives = motion.smooth(np.column_stack(built_up))
    return np.hstack([gives, reversal_pulses(motion, motion.velocity)])
