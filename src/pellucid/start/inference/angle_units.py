"""Tell degrees from radians, and counts from both, by quantum, rollover and range of a column of positions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

FULL_TURNS = {"deg": 360.0, "rad": 2.0 * math.pi}
"""One turn in each unit of angles."""


@dataclass(frozen=True)
class AngleLimits:
    """When numbers are angles, and in which unit."""

    # A turn holds a whole number of quanta if their quotient is within this of one that encoders have, relative.
    quantum_tolerance: float = 2e-3
    # A column rolls over if it jumps by one period at least so often.
    min_rollover_jumps: int = 2
    # Quanta of a turn that most encoders of servos have.
    usual_counts: int = 4096
    # Values of at most so many quanta are compared; five printed digits then resolve a hundredth of a quantum.
    max_lattice_quanta: float = 1000.0
    # At least so many different values must be there to tell a lattice.
    min_lattice_values: int = 24
    # Values lie on a lattice if the mean of their phases, as unit vectors, is at least so long.
    min_phase_agreement: float = 0.85
    # A range above this is more than a joint turns in radians, or little in degrees.
    likely_degree_range: float = 8.0


ANGLE_LIMITS = AngleLimits()

MAX_RADIAN_RANGE = 4.0 * math.pi
"""A joint turns less than twice. A larger range of a joint's angle is in degrees [rad]."""

ENCODER_COUNTS = tuple(sorted({*(2**k for k in range(7, 21)), 500, 1000, 2000, 4000, 5000, 10000, 20000}))
"""Quanta of a turn that are tried, coarse ones first: powers of two, and lines of encoders."""


@dataclass(frozen=True)
class AngleUnit:
    """Unit of a column of angles."""

    unit: str  # "deg", "rad" or "counts"
    why: str  # reason, for a comment in study.toml
    is_certain: bool  # whether quantum, rollover or range leave no other unit
    wrap: str | None = None  # period after which the value rolls over, such as "360 deg"
    counts_per_turn: int | None = None  # quanta of a turn, if the quantum tells


def find_angle_unit(values: np.ndarray) -> AngleUnit:
    """Return the unit of a joint's or motor's angles, shape (n,), by what the numbers themselves tell."""
    known = values[np.isfinite(values)]
    spread = float(np.ptp(known)) if len(known) else 0.0
    quantum = find_quantum(known)
    for unit, turn in FULL_TURNS.items():
        jumps = np.abs(np.abs(np.diff(known)) - turn) < 0.1 * turn
        if np.sum(jumps) >= ANGLE_LIMITS.min_rollover_jumps and spread < 1.02 * turn and spread > 0.9 * turn:
            return AngleUnit(unit, f"it wraps at {turn:.4g}", True, wrap=f"{turn:.12g} {unit}")
    if quantum is not None and not is_decimal(quantum):
        for unit, turn in FULL_TURNS.items():
            count = turn / quantum
            nearest = round(count)
            if (
                nearest >= 64
                and abs(count / nearest - 1.0) < ANGLE_LIMITS.quantum_tolerance
                and is_encoder_count(nearest)
            ):
                return AngleUnit(
                    unit,
                    f"its resolution {quantum:.6g} is 1/{nearest} of a turn, as of an encoder",
                    True,
                    counts_per_turn=nearest,
                )
    lattice = find_lattice(known)
    if lattice is not None:
        unit, count = lattice
        why = f"its values are multiples of 1/{count} of a turn in {unit}, as of an encoder"
        return AngleUnit(unit, why, True, counts_per_turn=count)
    if spread > 1000.0 and np.all(known == np.round(known)):
        return AngleUnit("counts", f"integers over a range of {spread:.6g}", True)
    if spread > MAX_RADIAN_RANGE:
        # A motor before its gears may turn so often in radians, so that the range alone decides nothing.
        return AngleUnit("deg", f"a range of {spread:.4g} is {spread / (2 * math.pi):.1f} turns in radians", False)
    if spread > ANGLE_LIMITS.likely_degree_range:
        return AngleUnit("deg", f"a range of {spread:.4g} is more than a turn in radians", False)
    return AngleUnit("rad", f"a range of {spread:.4g} would be little in degrees", False)


def find_quantum(values: np.ndarray) -> float | None:
    """Return the step of which all differences are multiples, None if there is none to be seen."""
    known = values[np.isfinite(values)]
    if len(known) > 200_000:
        known = known[:200_000]
    levels = np.unique(known)
    if len(levels) < 4 or len(levels) > 0.9 * len(known):
        return None
    gaps = np.diff(levels)
    scale = max(abs(float(levels[0])), abs(float(levels[-1])), 1e-300)
    gaps = gaps[gaps > 1e-9 * scale]
    if gaps.size < 3:
        return None
    smallest = float(np.quantile(gaps, 0.02))
    # Stored digits round each level, so that neighbouring gaps differ; their mean over small multiples is finer.
    multiples = np.round(gaps / smallest)
    near = (multiples >= 1) & (multiples <= 8) & (np.abs(gaps / smallest - multiples) < 0.2)
    if near.mean() < 0.8:
        return None
    estimate = float(np.sum(gaps[near]) / np.sum(multiples[near]))
    return estimate if estimate > 0.0 else None


def find_lattice(values: np.ndarray) -> tuple[str, int] | None:
    """Return the unit and the quanta of a turn on whose multiples values lie, shape (n,); None if on none's.

    For each division of a turn that encoders have, the phases of the values within a quantum are compared. Printed
    digits are fine enough for that near zero only, so that values of at most a thousand quanta are taken.
    """
    for count in ENCODER_COUNTS:
        for unit, turn in FULL_TURNS.items():
            quantum = turn / count
            near = values[np.abs(values) < ANGLE_LIMITS.max_lattice_quanta * quantum][:50_000]
            if is_decimal(quantum) or len(near) < ANGLE_LIMITS.min_lattice_values or np.ptp(near) < 30.0 * quantum:
                continue
            levels = np.unique(np.round(near / quantum, 3))
            if len(levels) < ANGLE_LIMITS.min_lattice_values:
                continue
            if abs(np.mean(np.exp(2j * np.pi * levels))) > ANGLE_LIMITS.min_phase_agreement:
                return unit, count
    return None


def is_decimal(quantum: float) -> bool:
    """Whether a quantum is one that printing with few digits makes: 1, 2 or 5 times a power of ten."""
    mantissa = quantum / 10.0 ** math.floor(math.log10(quantum) + 1e-9)
    return any(abs(mantissa / m - 1.0) < 1e-3 for m in (1.0, 2.0, 2.5, 5.0, 10.0))


def is_encoder_count(count: int) -> bool:
    """Whether an encoder may divide a turn so: a power of two, or whole hundreds, with gears of small whole ratios."""
    return count & (count - 1) == 0 or count % 500 == 0 or (count % 256 == 0 and count // 256 < 4096)


def find_unsigned_bits(values: np.ndarray) -> int | None:
    """Return the bits of a signed count that was stored as an unsigned one, None if it was not.

    Negative numbers then stand just below 2^16 or 2^32, and nothing stands between them and the positive ones.
    """
    known = values[np.isfinite(values)]
    if len(known) == 0 or np.mean(known != np.round(known)) > 0.01 or known.min() < 0.0:
        return None
    for bits in (16, 32):
        top = 2.0**bits
        if known.max() <= top * (1.0 + 1e-7) and np.any(known > 0.75 * top) and np.any(known < 0.25 * top):
            middle = np.mean((known > 0.3 * top) & (known < 0.7 * top))
            if middle < 0.01:
                return bits
    return None


def find_rolling_bits(values: np.ndarray) -> int | None:
    """Return the bits after which a count rolls over, None if it does not: it jumps by nearly 2^bits and back."""
    known = values[np.isfinite(values)]
    if len(known) < 20 or np.any(known != np.round(known)):
        return None
    steps = np.abs(np.diff(known))
    spread = np.ptp(known)
    for bits in range(8, 33):
        top = 2.0**bits
        if (
            0.9 * top < spread <= top
            and known.min() >= -0.5 * top
            and np.sum(steps > 0.8 * top) >= ANGLE_LIMITS.min_rollover_jumps
        ):
            return bits if np.mean((steps > 0.05 * top) & (steps < 0.8 * top)) < 0.01 else None
    return None
