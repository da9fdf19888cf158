"""Tell how a column of whole numbers encodes its sign, and where it rolls over, by the continuity of the motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .angle_units import find_rolling_bits, find_unsigned_bits


@dataclass(frozen=True)
class EncodingLimits:
    """When a column has a sign bit, or rolls over."""

    # A sign bit is found if the decoded numbers travel at most this share of the way of the stored ones.
    max_way_share: float = 0.5
    # A value rolls over if it falls by at least this share of its period, in at most this share of the steps.
    min_jump_share: float = 0.8
    max_jumping_share: float = 0.05
    # All other steps are at most this share of the period.
    max_step_share: float = 0.3
    # The numbers fill at least this share of the period, and go beyond it by at most `max_excess_share` of it.
    min_filled_share: float = 0.9
    max_excess_share: float = 0.02
    # It has at least so many levels, and moves in at least this share of the other steps.
    min_levels: int = 32
    min_moving_share: float = 0.2


ENCODING_LIMITS = EncodingLimits()

VALUE_PERIODS = {"turn": 1.0, "rad": 2.0 * math.pi, "deg": 360.0}
"""Periods after which an absolute encoder starts again, by the unit of its numbers."""


@dataclass(frozen=True)
class Encoding:
    """How stored numbers become values."""

    values: np.ndarray  # decoded numbers, shape (n,)
    keys: Mapping[str, object] = field(default_factory=dict)  # keys of the channel in study.toml
    why: str = ""  # reason


def find_encoding(values: np.ndarray, unit: str | None = None) -> Encoding | None:
    """Return how a column of numbers, shape (n,), is encoded; None if the numbers are the values.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Stored numbers; NaN where one is missing.
    unit : str or None
        Unit that is stated. Numbers in rad or deg roll over after a turn alone, and have no sign bit.
    """
    if unit in (None, "counts", "1"):
        bits = find_unsigned_bits(values)
        if bits is not None:
            keys = {"signed_bits": bits}
            return Encoding(decode_counts(values, keys), keys, f"negative numbers are stored in {bits} bits (wrapped)")
        bit = find_sign_bit(values)
        if bit is not None:
            keys = {"sign_bit": bit}
            return Encoding(decode_counts(values, keys), keys, f"bit {bit} is the sign")
        rolling = find_rolling_bits(values)
        if rolling is not None:
            keys = {"wrap_bits": rolling}
            return Encoding(decode_counts(values, keys), keys, f"a count of {rolling} bits that wraps")
    for name, period in VALUE_PERIODS.items():
        if unit in (None, name) and rolls_over(values, period):
            keys = {"wrap": f"{period:.12g} {name}"}
            return Encoding(decode_counts(values, keys), keys, f"it rolls over after {period:.4g}")
    return None


def decode_counts(values: np.ndarray, keys: Mapping[str, object]) -> np.ndarray:
    """Return stored numbers, shape (n,), without the jumps of their signs and rollovers, as a channel's keys say.

    `signed_bits`, `sign_bit` and `wrap_bits` are of the stored number, `wrap` is of the value after `scale`.
    """
    decoded = np.array(values, float)
    bits, sign, rolling = (keys.get(name) for name in ("signed_bits", "sign_bit", "wrap_bits"))
    if isinstance(bits, int):
        decoded = np.where(decoded >= 2.0 ** (bits - 1), decoded - 2.0**bits, decoded)
    if isinstance(sign, int):
        decoded = np.where(decoded >= 2.0**sign, 2.0**sign - decoded, decoded)
    period = 2.0**rolling if isinstance(rolling, int) else None
    if "wrap" in keys:
        period = float(str(keys["wrap"]).split()[0]) / abs(float(str(keys.get("scale", 1.0))))
    if period is not None:
        known = np.isfinite(decoded)
        decoded[known] = np.unwrap(decoded[known], period=period)
    return decoded


def find_sign_bit(values: np.ndarray) -> int | None:
    """Return the bit that states a minus sign; None if there is none.

    The largest number has this bit as its highest one. With the sign decoded, the numbers cross zero without a jump.
    """
    known = values[np.isfinite(values)]
    if len(known) < 20 or known.min() < 0.0 or known.max() < 16.0 or np.any(known != np.round(known)):
        return None
    bit = int(np.floor(np.log2(known.max())))
    is_negative = known >= 2.0**bit
    magnitude = np.where(is_negative, known - 2.0**bit, known)
    if not 0.0 < np.mean(is_negative) < 1.0:
        return None
    decoded = np.where(is_negative, -magnitude, magnitude)
    crossings = np.flatnonzero(np.diff(is_negative.astype(int)) != 0)
    stored_way, decoded_way = float(np.sum(np.abs(np.diff(known)))), float(np.sum(np.abs(np.diff(decoded))))
    # At a true change of sign both magnitudes are small.
    ends = np.maximum(magnitude[crossings], magnitude[crossings + 1])
    is_smooth = float(np.median(ends)) < 0.25 * max(float(magnitude.max()), 1.0)
    empty = 2.0**bit - float(magnitude[~is_negative].max()) > 0.05 * 2.0**bit
    has_less_way = decoded_way < ENCODING_LIMITS.max_way_share * stored_way
    return bit if is_smooth and empty and has_less_way else None


def rolls_over(values: np.ndarray, period: float) -> bool:
    """Whether numbers, shape (n,), start again after a period: they jump by nearly that, and fill it."""
    known = values[np.isfinite(values)]
    if len(known) < 20:
        return False
    spread, steps = float(np.ptp(known)), np.abs(np.diff(known))
    limits = ENCODING_LIMITS
    if not limits.min_filled_share * period < spread <= (1.0 + limits.max_excess_share) * period:
        return False
    is_jump = steps > limits.min_jump_share * period
    rest = steps[~is_jump]
    # A trigger, and a command that rests on levels, jump as far.
    if len(np.unique(known)) < limits.min_levels or np.mean(rest > 0.0) < limits.min_moving_share:
        return False
    return bool(
        0 < np.sum(is_jump) <= limits.max_jumping_share * len(steps)
        and (len(rest) == 0 or float(rest.max()) <= limits.max_step_share * period)
    )
