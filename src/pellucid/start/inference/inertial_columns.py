"""Find accelerometers, gyroscopes and quaternions among columns by what their axes must fulfil together."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

GRAVITY_UNITS = (("m/s^2", 9.81), ("g0", 1.0), ("mg0", 1000.0))
"""Units of accelerometers, with the length of gravity in each."""

GRAVITY_TOLERANCE = 0.12
"""The median length of an accelerometer's reading is that of gravity within this share."""

QUATERNION_TOLERANCE = 0.02
"""Four columns are a quaternion if the length of each row is 1 within this."""

MIN_ROTATION_FIT = 0.3
"""Three columns are a gyroscope if the turn that they tell explains at least this share of how gravity's direction
changes."""


@dataclass(frozen=True)
class InertialColumns:
    """Axes of one sensor, in order."""

    kind: str  # "acceleration", "angular_velocity" or "orientation"
    names: tuple[str, ...]  # columns of its axes: x, y, z, or w, x, y, z
    unit: str  # unit of the numbers
    why: str  # reason, for a comment in study.toml
    is_certain: bool  # whether the numbers leave no other unit


def find_inertial(
    columns: Mapping[str, np.ndarray], order: Sequence[str], rate: float, named: Collection[str] = ()
) -> list[InertialColumns]:
    """Return the sensors among neighbouring columns, in the order of the file.

    Rows of four that have length 1 throughout are quaternions. Rows of three whose usual length is that of gravity, and
    whose axes all move, are an accelerometer. Three further columns are its gyroscope if they tell how gravity's
    direction turns in the sensor: a' = -w x a, which also tells rad/s from deg/s. An accelerometer needs a gyroscope
    beside it, or names that say so, which are the columns `named`: three angles may have that length by chance.
    """
    found: list[InertialColumns] = []
    used: set[str] = set()
    names = [name for name in order if np.isfinite(columns[name]).mean() > 0.9]
    for i in range(len(names) - 3):
        group = tuple(names[i : i + 4])
        if used & set(group):
            continue
        lengths = np.linalg.norm([columns[name] for name in group], axis=0)
        moving = sum(np.ptp(columns[name]) > 1e-3 for name in group)
        if moving >= 2 and np.nanquantile(np.abs(lengths - 1.0), 0.95) < QUATERNION_TOLERANCE:
            found.append(InertialColumns("orientation", group, "1", "its rows have length 1 throughout", True))
            used |= set(group)
    accelerometers: list[tuple[str, ...]] = []
    confirmed: set[str] = set(named)
    for i in range(len(names) - 2):
        group = tuple(names[i : i + 3])
        if used & set(group):
            continue
        unit = _gravity_unit([columns[name] for name in group])
        if unit is not None:
            why = f"the length of its rows is that of gravity in {unit[0]} (median {unit[1]:.4g})"
            found.append(InertialColumns("acceleration", group, unit[0], why, True))
            accelerometers.append(group)
            used |= set(group)
    for group in accelerometers:
        after = names.index(group[2]) + 1
        for start in (after, names.index(group[0]) - 3, after + 3):
            axes = names[start : start + 3] if start >= 0 else []
            if len(axes) < 3 or used & set(axes):
                continue
            fit = _gyroscope_scale([columns[n] for n in group], [columns[n] for n in axes], rate)
            if fit is None:
                continue
            scale, share = fit
            unit_text = "deg/s" if scale > 10.0 else "rad/s"
            why = (
                f"it turns gravity in the accelerometer beside it ({100 * share:.0f} % explained) with a scale of "
                f"{scale:.3g}"
            )
            found.append(InertialColumns("angular_velocity", tuple(axes), unit_text, why, True))
            used |= set(axes)
            confirmed |= set(group)
            break
    found = [s for s in found if s.kind != "acceleration" or confirmed & set(s.names)]
    return sorted(found, key=lambda sensor: list(order).index(sensor.names[0]))


def _gravity_unit(axes: list[np.ndarray]) -> tuple[str, float] | None:
    lengths = np.linalg.norm(axes, axis=0)
    median = float(np.nanmedian(lengths))
    spreads = [float(np.nanstd(axis)) for axis in axes]
    for unit, gravity in GRAVITY_UNITS:
        usual = abs(median / gravity - 1.0) < GRAVITY_TOLERANCE
        # All axes measure, and the length varies less than the axes do: gravity turns among them.
        if usual and min(spreads) > 1e-3 * gravity and np.nanstd(lengths) < 0.8 * max(spreads):
            return unit, median
    return None


def _gyroscope_scale(
    acceleration: list[np.ndarray], rates: list[np.ndarray], rate: float
) -> tuple[float, float] | None:
    """Return the numbers per rad/s of a gyroscope and the share it explains; None if the columns are none."""
    a, w = np.nan_to_num(np.array(acceleration)), np.nan_to_num(np.array(rates))
    width = max(1, round(rate / 12.0))
    kernel = np.ones(width) / width
    a = np.array([np.convolve(row, kernel, "valid") for row in a])
    w = np.array([np.convolve(row, kernel, "valid") for row in w])
    change = np.gradient(a, 1.0 / rate, axis=1)
    turned = -np.cross(w.T, a.T).T
    power = float(np.sum(turned * turned))
    if power == 0.0:
        return None
    factor = float(np.sum(change * turned)) / power
    share = 1.0 - float(np.sum((change - factor * turned) ** 2)) / float(np.sum(change * change))
    if share < MIN_ROTATION_FIT or factor <= 0.0:
        return None
    return 1.0 / factor, share
