"""Tell raw EMG and its envelopes from other channels by their spectrum and their distribution.

Find accelerometers, gyroscopes and quaternions among columns by what their axes must fulfil together.

Find how a flat list of numbers, one a line, holds several columns: in turn, or one after another.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import gcd

import numpy as np


@dataclass(frozen=True)
class SpectrumLimits:
    """When a column is EMG, an envelope, or of an inertial sensor."""

    # Raw EMG is recorded at this rate or faster.
    min_emg_rate_hz: float = 400.0
    # Most of the power of surface EMG lies in this band.
    emg_band_hz: tuple[float, ...] = (20.0, 450.0)
    # Raw EMG has at least this share of its power, its mean taken off, in `SPECTRUM_LIMITS.emg_band_hz`.
    min_band_share: float = 0.7
    # A channel whose strongest line of the spectrum has more than this share of its power is mains hum, not EMG.
    max_line_share: float = 0.6
    # An envelope has nearly all of its power below this frequency.
    max_envelope_frequency_hz: float = 15.0
    # The median length of an accelerometer's reading is that of gravity within this share.
    gravity_tolerance: float = 0.12
    # Four columns are a quaternion if the length of each row is 1 within this.
    quaternion_tolerance: float = 0.02
    # Three columns are a gyroscope if the turn that they tell explains at least this share of how gravity's
    # direction changes.
    min_rotation_fit: float = 0.3
    # A flat list is tried to hold at most so many columns.
    max_flat_columns: int = 16
    # A column in a flat list has at least so many rows.
    min_flat_rows: int = 200
    # The columns are those of which the usual step is at least so many times smaller than that of the flat list.
    min_smoothing: float = 5.0


SPECTRUM_LIMITS = SpectrumLimits()


def is_raw_emg(values: np.ndarray, rate: float) -> bool:
    """Whether samples, shape (n,), taken at `rate` [Hz], are raw EMG by their spectrum.

    It swings about zero, its power lies between 20 and 450 Hz, and no single line holds most of it.
    """
    from scipy.signal import welch  # it loads all of scipy.stats

    if rate < SPECTRUM_LIMITS.min_emg_rate_hz:
        return False
    known = values[np.isfinite(values)]
    if len(known) < 256 or np.ptp(known) == 0.0 or len(np.unique(known[:5000])) < 8:
        return False
    frequency, power = welch(known - np.median(known), rate, nperseg=min(1024, len(known)))
    total = power[1:].sum()
    if total <= 0.0:
        return False
    low, high = SPECTRUM_LIMITS.emg_band_hz
    inside = power[(frequency >= low) & (frequency <= high)].sum() / total
    peak = int(np.argmax(power[1:])) + 1
    line = power[max(peak - 1, 1) : peak + 2].sum() / total
    is_in_band = inside >= SPECTRUM_LIMITS.min_band_share and line <= SPECTRUM_LIMITS.max_line_share
    return bool(is_in_band and _is_broad(frequency, power))


def _is_broad(frequency: np.ndarray, power: np.ndarray) -> bool:
    """Whether half of the power needs a band of at least 15 Hz; a vibration has it in a narrow one."""
    ordered = np.sort(power[1:])[::-1]
    count = int(np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())) + 1
    return count * (frequency[1] - frequency[0]) >= 15.0


def is_envelope(values: np.ndarray, rate: float) -> bool:
    """Whether samples, shape (n,), taken at `rate` [Hz], may be an envelope of EMG: never negative, and slow."""
    from scipy.signal import welch  # it loads all of scipy.stats

    known = values[np.isfinite(values)]
    if len(known) < 32 or np.ptp(known) == 0.0:
        return False
    largest = float(np.max(known))
    if largest <= 0.0 or float(np.min(known)) < -0.03 * largest or float(np.quantile(known, 0.1)) > 0.6 * largest:
        return False
    if rate < 4.0 * SPECTRUM_LIMITS.max_envelope_frequency_hz:
        return True
    frequency, power = welch(known - known.mean(), rate, nperseg=min(1024, len(known)))
    total = power.sum()
    return bool(total > 0.0 and power[frequency <= SPECTRUM_LIMITS.max_envelope_frequency_hz].sum() > 0.95 * total)


def swings_fast(values: np.ndarray) -> bool:
    """Whether a column swings about its mean within some samples and in bursts, whatever the rate is."""
    known = values[np.isfinite(values)]
    if len(known) < 500:
        return False
    centred = known - np.median(known)
    crossings = float(np.mean(np.diff(np.signbit(centred)) != 0))
    first = float(np.corrcoef(centred[:-1], centred[1:])[0, 1]) if np.ptp(centred) > 0.0 else 1.0
    return crossings > 0.05 and -0.3 < first < 0.98 and abs(float(np.mean(centred))) < 0.5 * float(np.std(centred))


GRAVITY_UNITS = (("m/s^2", 9.81), ("g0", 1.0), ("mg0", 1000.0))
"""Units of accelerometers, with the length of gravity in each."""


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
    whose axes all move, are an accelerometer. Three further columns are its gyroscope if they explain the rotation of
    gravity in the sensor: a' = -w x a, which also distinguishes rad/s from deg/s. An accelerometer needs a gyroscope or
    a name, which are the columns `named`: three angles may have that length by chance.
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
        if moving >= 2 and np.nanquantile(np.abs(lengths - 1.0), 0.95) < SPECTRUM_LIMITS.quaternion_tolerance:
            why = "the norm of every row is 1, as that of a quaternion"
            found.append(InertialColumns("orientation", group, "1", why, True))
            used |= set(group)
    accelerometers: list[tuple[str, ...]] = []
    confirmed: set[str] = set(named)
    for i in range(len(names) - 2):
        group = tuple(names[i : i + 3])
        if used & set(group):
            continue
        unit = _gravity_unit([columns[name] for name in group])
        if unit is not None:
            why = f"the norm of its rows is that of gravity in {unit[0]} (median {unit[1]:.4g})"
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
                f"it explains {100 * share:.0f} % of gravity's rotation in the neighbouring accelerometer, with a "
                f"scale of {scale:.3g}"
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
        usual = abs(median / gravity - 1.0) < SPECTRUM_LIMITS.gravity_tolerance
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
    if share < SPECTRUM_LIMITS.min_rotation_fit or factor <= 0.0:
        return None
    return 1.0 / factor, share


@dataclass(frozen=True)
class FlatShape:
    """Columns of a flat list."""

    count: int  # number of columns
    order: str  # "interleaved": row after row; "stacked": column after column; "single": one column

    def split(self, values: np.ndarray) -> list[np.ndarray]:
        """Return the columns of a flat list, shape (n,), each shape (n / count,)."""
        if self.order == "interleaved":
            return [values[i :: self.count] for i in range(self.count)]
        if self.order == "stacked":
            return list(values.reshape(self.count, -1))
        return [values]


def find_flat_shape(values: np.ndarray, counts: tuple[int, ...] = ()) -> FlatShape:
    """Return how a flat list, shape (n,), holds columns.

    Steps from a number to the next are small within a column and large between columns. `counts` are the numbers of
    columns that the lengths of other files make likely; without them all up to 16 are tried.
    """
    known = np.nan_to_num(values)
    n = len(known)
    plain = float(np.median(np.abs(np.diff(known)))) if n > 1 else 0.0
    likely = counts or range(2, SPECTRUM_LIMITS.max_flat_columns + 1)
    tried = [k for k in likely if k > 1 and n % k == 0 and n // k >= SPECTRUM_LIMITS.min_flat_rows]
    best: tuple[float, int] | None = None
    for k in tried:
        step = float(np.median(np.abs(np.diff(known.reshape(-1, k), axis=0))))
        if plain > SPECTRUM_LIMITS.min_smoothing * step and (best is None or step < 0.5 * best[0]):
            best = (step, k)
    if best is not None:
        return FlatShape(best[1], "interleaved")
    for k in tried if counts else ():
        if _jumps_at_borders(known, k):
            return FlatShape(k, "stacked")
    return FlatShape(counts[0], "stacked") if counts and counts[0] in tried else FlatShape(1, "single")


def common_rows(lengths: Mapping[str, int]) -> int | None:
    """Return the number of rows that flat files share, if each length is a small multiple of it; None if none is."""
    common = 0
    for length in lengths.values():
        common = gcd(common, length)
    shortest = min(lengths.values())
    for rows in (shortest, common):
        if rows >= SPECTRUM_LIMITS.min_flat_rows and all(
            n % rows == 0 and n // rows <= SPECTRUM_LIMITS.max_flat_columns for n in lengths.values()
        ):
            return rows
    return None


def _jumps_at_borders(values: np.ndarray, count: int) -> bool:
    rows = len(values) // count
    steps = np.abs(np.diff(values))
    borders = np.arange(1, count) * rows - 1
    return bool(np.median(steps[borders]) > 20.0 * (np.quantile(steps, 0.9) + 1e-300))
