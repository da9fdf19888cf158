"""Elbow misaligned with the robot's axis: unloading of the skin by a carriage, and axis estimated from its travel.

The wearer's axis is displaced by up to 15 mm in the robot's plane, moves along a curve while the elbow turns, and is
tilted by up to 10 degrees. Skin under the cuff is compliant along the link, the carriage has stiction, and markers
measure its position. Markers on the forearm rotate with the skin, more towards the ends. The estimator knows no number
of the wearer and assumes another shape of the axis's path. Geometry, skin and markers are assumptions, not recordings.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pellucid.joint.slider.axis_offset import AxisOffset, estimate_axis_offset
from pellucid.numerics.filters import zero_phase_lowpass
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

SEED = 20261203
"""Seed of the simulated wearers. The method was developed on 20261129; this seed is held out."""

WEARER_COUNT = sized(200, smallest=4)
"""Number of drawn wearers."""

FS_HZ = 100.0
"""Sampling rate of the markers [Hz]."""

MAX_OFFSET_M = 0.015
"""Largest distance of both axes in the middle of the range [m]."""

MAX_TILT_RAD = np.deg2rad(10.0)
"""Largest tilt of the wearer's axis [rad]."""

MARKER_NOISE_M = 5e-4
"""Standard deviation of a marker's error, white [m]."""

LIMB_NOISE_RAD = np.deg2rad(0.2)
"""Standard deviation of the error of the forearm's angle, white [rad]."""

SKIN_GAIN_SD = 0.006
"""Standard deviation of how far skin turns the forearm's markers per angle [1], and per square of it, half as much."""

LOWPASS_HZ = 5.0
"""Cut-off of the low-pass on the carriage's place [Hz]."""


@dataclass(frozen=True)
class WornElbow:
    """One wearer's slow movements."""

    truth: np.ndarray  # (2,) place of the axis, mean over the samples [m]
    found: AxisOffset
    plain: np.ndarray  # (2,) the same by least squares on length, cosine and sine alone [m]
    forces: tuple[float, float]  # largest force along the forearm with and without a carriage [N]


def misalignment_rows(count: int = WEARER_COUNT) -> Iterator[ResultRow]:
    """Every figure of misaligned axes."""
    tried = [try_elbow(np.random.default_rng([SEED, i])) for i in range(count)]
    off = np.array([np.hypot(*(np.array([t.found.along, t.found.across]) - t.truth)) for t in tried])
    plain = np.array([np.hypot(*(t.plain - t.truth)) for t in tried])
    none = np.array([np.hypot(*t.truth) for t in tried])
    pairs = [(x, ends) for t in tried for x, ends in zip(t.truth, t.found.interval, strict=True)]
    inside = np.mean([low <= x <= high for x, (low, high) in pairs])
    width = np.median([high - low for t in tried for low, high in t.found.interval])
    freed, fixed = np.array([t.forces for t in tried]).T
    yield _row(
        "error", 1e3 * np.median(off), "mm",
        f"distance of the estimated axis from the true one, median of {count} wearers; 90 % quantile "
        f"{1e3 * np.quantile(off, 0.9):.1f} mm, largest {1e3 * off.max():.1f} mm; least squares on the carriage's "
        f"travel alone {1e3 * np.median(plain):.1f} and {1e3 * np.quantile(plain, 0.9):.1f} mm; no estimate "
        f"{1e3 * np.median(none):.1f} mm",
    )  # fmt: skip
    rival = np.mean(plain <= 0.003)
    note = f"share of {count}; least squares on the carriage's travel alone {rival:.2f}"
    yield _row("within_3_mm", np.mean(off <= 0.003), "1", note)
    yield _row("coverage", inside, "1", "share of intervals of 95 % with the true coordinate")
    yield _row("interval", 0.5e3 * width, "mm", "half the interval's width, median")
    yield _row(
        "force_with_carriage", np.median(freed), "N",
        f"largest along the forearm, median; 90 % quantile {np.quantile(freed, 0.9):.0f} N; without a carriage "
        f"{np.median(fixed):.0f} and {np.quantile(fixed, 0.9):.0f} N",
    )  # fmt: skip


def try_elbow(rng: np.random.Generator) -> WornElbow:
    """Return the axis estimated from a simulated wearer's slow movements."""
    t = np.arange(round(60.0 * FS_HZ)) / FS_HZ
    middle, amplitude = rng.uniform(1.2, 1.7), rng.uniform(0.6, 0.9)
    angle = middle + amplitude * np.sin(2.0 * np.pi * rng.uniform(0.12, 0.2) * t + 0.3 * np.sin(0.37 * t))
    length, stiffness, friction = rng.uniform(0.2, 0.28), rng.uniform(1500.0, 5000.0), rng.uniform(1.0, 5.0)
    distance, place = MAX_OFFSET_M * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    bend = np.sin(2.0 * (angle - middle)) / 2.0
    wander = rng.normal(0.0, 0.002, (2, 1)) * bend + rng.normal(0.0, 0.001, (2, 1)) * (angle - middle) ** 2
    axis = distance * np.array([[np.cos(place)], [np.sin(place)]]) + wander
    tilt, about = rng.uniform(0.0, MAX_TILT_RAD), rng.uniform(0.0, np.pi)
    along, across = np.cos(angle - about), np.sin(angle - about) * np.cos(tilt)
    hand = np.array([
        np.cos(about) * along - np.sin(about) * across, np.sin(about) * along + np.cos(about) * across
    ])  # fmt: skip
    cuff = axis + length * hand
    position = np.arctan2(cuff[1], cuff[0])
    wanted = np.hypot(*cuff)
    carriage = _dragged(wanted, friction / stiffness)
    seen = zero_phase_lowpass(carriage + MARKER_NOISE_M * rng.standard_normal(len(t)), LOWPASS_HZ, 2, FS_HZ)
    turned = angle - middle
    skin = SKIN_GAIN_SD * (rng.standard_normal() * turned + 0.5 * rng.standard_normal() * turned**2)
    limb = angle + skin + rng.uniform(-0.1, 0.1) + LIMB_NOISE_RAD * rng.standard_normal(len(t))
    found = estimate_axis_offset(position, seen, limb, FS_HZ)
    columns = np.column_stack([np.ones(len(t)), np.cos(position), np.sin(position)])
    plain = np.linalg.lstsq(columns, seen, rcond=None)[0][1:]
    forces = stiffness * np.abs(wanted - carriage).max(), stiffness * np.abs(wanted - wanted[0]).max()
    return WornElbow(axis.mean(axis=1), found, plain, forces)


def _dragged(wanted: np.ndarray, play: float) -> np.ndarray:
    """Return the place of a carriage that friction holds until skin has given by `play` [m], (n,) [m]."""
    place, at = np.empty_like(wanted), wanted[0]
    for i, target in enumerate(wanted):
        at = min(max(at, target - play), target + play)
        place[i] = at
    return place


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"mission.misalignment.{name}", float(value), unit, "evidence", "simulated", None, note)
