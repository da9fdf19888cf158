"""Find channels that are cut at a limit in long stretches: a command that saturates, or a sensor out of its range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .watched import find_runs

KIND = "saturated"


@dataclass(frozen=True)
class SaturationLimits:
    """When a channel rests at a limit."""

    # At least this many samples are at the limit. Chosen by judgement, as the other thresholds here; `python -m
    # research.evidence formats` counts what they miss.
    min_limited_samples: int = 8
    # At least this share of the samples are at the limit.
    min_limited_share: float = 0.004
    # One stretch at the limit has at least this many samples in a row.
    min_run_samples: int = 4
    # At the limit lie at least this many times as many samples as on an equal width just beside it.
    min_crowding: float = 8.0
    # The width beside the limit that is counted, as a share of the range.
    nearby_share: float = 0.02
    # A channel that holds another value than zero for at least this share of its longest stretch at the limit steps
    # by itself.
    max_elsewhere_share: float = 0.25
    # A channel that leaps into the limit by more than this many times its steps before was set to it.
    max_arrival_ratio: float = 20.0
    # Number of steps before a stretch with which the arrival is compared.
    steps_before: int = 5
    # Into a limit, and out of it, the steps are at least this share of the usual one. What comes to rest slows
    # down.
    min_arrival_share: float = 0.25


SATURATION_LIMITS = SaturationLimits()


@dataclass(frozen=True)
class Limit:
    """A value at which a channel is cut."""

    value: float  # limit in the channel's unit
    samples: int  # number of samples at it
    stretches: int  # number of stretches of them
    longest: int  # samples of the longest stretch


def find_limits(x: np.ndarray) -> tuple[Limit, ...]:
    """Return the limits, the upper one first, at which a channel `x`, (n,), is cut in long stretches."""
    known = np.isfinite(x)
    if known.sum() < 10 * SATURATION_LIMITS.min_limited_samples:
        return ()
    found = []
    low, high = float(x[known].min()), float(x[known].max())
    if high == low:
        return ()
    for sign, extreme in ((1.0, high), (-1.0, low)):
        at = known & (sign * (extreme - x) <= 1e-9 * (high - low))
        first, length = find_runs(at)
        count = int(at.sum())
        least = max(SATURATION_LIMITS.min_limited_samples, SATURATION_LIMITS.min_limited_share * known.sum())
        if count < least or length.max(initial=0) < SATURATION_LIMITS.min_run_samples:
            continue
        inside = x[known & ~at]
        resolution = _resolution(inside)
        width = max(SATURATION_LIMITS.nearby_share * (high - low), 2.0 * resolution)
        beside = int(np.sum(sign * (extreme - inside) <= width))
        levels = float(np.clip(width / resolution, 1.0, max(beside, 1))) if resolution > 0.0 else 1.0
        # On a grid the limit is one level among several; between levels there are no samples.
        crowded = count >= SATURATION_LIMITS.min_crowding * max(beside / levels, 1.0)
        set_to = extreme == 0.0 or _is_held_elsewhere(x, int(length.max())) or _is_leapt_to(x, first, length)
        if crowded and beside < count and not set_to and _arrives_at_speed(x, first, length):
            found.append(Limit(extreme, count, int(first.size), int(length.max())))
    return tuple(found)


def _resolution(x: np.ndarray) -> float:
    """Return the smallest difference between two of the values, 0 if none differ."""
    levels = np.diff(np.unique(x))
    levels = levels[levels > 1e-12 * max(1.0, float(np.abs(x).max(initial=0.0)))]
    return float(levels.min()) if levels.size else 0.0


def _is_held_elsewhere(x: np.ndarray, longest: int) -> bool:
    """Whether a channel holds a value between its extremes, but not zero, nearly as long as the limit.

    A switching command does.
    """
    inside = (x[1:] != 0.0) & (x[1:] < np.nanmax(x)) & (x[1:] > np.nanmin(x))
    _, length = find_runs((x[1:] == x[:-1]) & inside)
    least = max(SATURATION_LIMITS.min_run_samples, SATURATION_LIMITS.max_elsewhere_share * longest)
    return bool(length.size) and int(length.max()) + 1 >= least


def _is_leapt_to(x: np.ndarray, first: np.ndarray, length: np.ndarray) -> bool:
    """Whether a channel leaps into most of its stretches at the limit, as one that is set to a value does."""
    ratios = []
    for a, n in zip(first.tolist(), length.tolist(), strict=True):
        if n < SATURATION_LIMITS.min_run_samples or a < SATURATION_LIMITS.steps_before + 1:
            continue
        before = np.abs(np.diff(x[a - 1 - SATURATION_LIMITS.steps_before : a]))
        ratios.append(
            abs(x[a] - x[a - 1]) > SATURATION_LIMITS.max_arrival_ratio * float(np.nanmax(before, initial=0.0))
        )
    return bool(ratios) and float(np.mean(ratios)) > 0.5


def _arrives_at_speed(x: np.ndarray, first: np.ndarray, length: np.ndarray) -> bool:
    """Whether a channel arrives at the limit, and leaves it, as fast as it usually moves."""
    steps = np.abs(np.diff(x))
    usual = float(np.nanmedian(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    arrivals = []
    for a, n in zip(first.tolist(), length.tolist(), strict=True):
        if n < SATURATION_LIMITS.min_run_samples:
            continue
        arrivals += [steps[a - 1]] if a > 0 else []
        arrivals += [steps[a + n - 1]] if a + n - 1 < len(steps) else []
    return bool(arrivals) and float(np.nanmedian(arrivals)) > SATURATION_LIMITS.min_arrival_share * usual
