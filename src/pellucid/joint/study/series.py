"""Prepare series for figures of joints: joined recordings, the busiest window, running medians.

Arrays in, arrays out; nothing here knows a figure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...study.pages.quantities import Reading
from ..fit.replay import Prediction, Simulation


def by_recording(parts: Sequence[Prediction] | Sequence[Simulation]) -> list[list]:
    """Return the stretches grouped by recording, in the order of the recordings."""
    groups: dict[str, list] = {}
    for part in parts:
        groups.setdefault(part.recording, []).append(part)
    return list(groups.values())


def join_stretches(group: Sequence[Simulation]) -> Simulation:
    """Return the simulated stretches of one recording as one simulation with breaks, and with pooled errors."""

    def one(of: Callable) -> np.ndarray:
        return join_arrays(group, of)[0]

    names = list(group[0].measured)
    measured = {n: one(lambda s, n=n: s.measured[n]) for n in names}
    simulated = {n: one(lambda s, n=n: s.simulated[n]) for n in names}
    errors = {
        n: 100.0 * float(np.sqrt(np.nansum((measured[n] - simulated[n]) ** 2) / np.nansum(measured[n] ** 2)))
        for n in names
    }
    off = measured["position"] - simulated["position"]
    return Simulation(
        group[0].recording, group[0].split, group[0].mode, one(lambda s: s.time), measured, simulated, errors,
        float(np.sqrt(np.nanmean(off**2))), float(np.nanmean(np.abs(off))),
    )  # fmt: skip


def whole_recordings(simulations: Sequence[Simulation]) -> list[Simulation]:
    """Return the simulations with all stretches of each recording and mode joined, and with pooled errors."""
    modes = dict.fromkeys(s.mode for s in simulations)
    return [join_stretches(g) for mode in modes for g in by_recording([s for s in simulations if s.mode == mode])]


def join_arrays(group: Sequence, *of: Callable) -> tuple[np.ndarray, ...]:
    """Return arrays of several stretches one after another, with breaks between them."""
    parts = [[np.append(np.asarray(f(p), float), np.nan) for p in group] for f in of]
    return tuple(np.concatenate(p)[:-1] for p in parts)


def pooled_error(group: Sequence[Prediction]) -> float:
    """Return the effort error over several stretches [%]."""
    residual = np.concatenate([p.residual for p in group])
    return 100.0 * float(np.linalg.norm(residual) / np.linalg.norm(np.concatenate([p.effort for p in group])))


def busiest(time: np.ndarray, values: np.ndarray, share: float = 0.035) -> tuple[float, float]:
    """Return start and end of the window, a `share` of all `time`, in which the `values` vary most, for a zoom.

    A window without breaks is preferred.
    """
    t0, t1 = float(np.nanmin(time)), float(np.nanmax(time))
    good = np.isfinite(time) & np.isfinite(values)
    time, values = time[good], values[good]
    width = max(share * (t1 - t0), 16.0 * float(np.median(np.diff(time))) if len(time) > 1 else 0.0)
    width = min(width, t1 - t0)
    starts = np.linspace(t0, t1 - width, 60)
    expected = np.median([np.sum((time >= s) & (time <= s + width)) for s in starts])

    def variation(start: float) -> float:
        inside = values[(time >= start) & (time <= start + width)]
        if len(inside) < 3:
            return -1.0
        # Turning points count as well as the range, because a single jump says little about a fit.
        return float(np.ptp(inside) + 0.1 * np.sum(np.abs(np.diff(inside)))) * min(1.0, len(inside) / expected)

    start = float(max(starts, key=variation))
    return start, start + width


def running_median(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return medians of `y` over stretches of `x`, at the medians of `x`.

    A stretch has at least a 22nd of the range, so that clustered samples give one point, and enough samples for a
    stable median.
    """
    order = np.argsort(x, kind="stable")
    width = np.subtract(*np.quantile(x, (0.99, 0.01))) / 22.0
    least = max(12, len(x) // 80)
    parts, start = [], 0
    for stop in range(1, len(order) + 1):
        if stop - start >= least and x[order[stop - 1]] - x[order[start]] >= width:
            parts.append(order[start:stop])
            start = stop
    if len(order) - start >= least:
        parts.append(order[start:])
    return np.array([np.median(x[p]) for p in parts]), np.array([np.median(y[p]) for p in parts])


def autocorrelation(x: np.ndarray, lags: int) -> np.ndarray:
    """Return the autocorrelation of `x` at 0 to `lags` samples, shape (lags + 1,)."""
    x = np.asarray(x, float) - np.mean(x)
    n = len(x)
    spectrum = np.fft.rfft(x, 2 * n)
    full = np.fft.irfft(np.abs(spectrum) ** 2)[: lags + 1]
    out = np.zeros(lags + 1)
    out[: len(full)] = full / full[0] if full[0] > 0.0 else 0.0
    return out


def difference_unit(simulations: Sequence[Simulation], reading: Reading) -> tuple[float, str]:
    """Return scale and unit for differences in position; the unit is finer than the reading's for tiny ones."""
    largest = max(
        float(np.nanmax(np.abs(np.asarray(s.measured["position"]) - np.asarray(s.simulated["position"]))))
        for s in simulations
    )
    shown = reading.scale * largest
    if reading.position == "mm" and shown < 0.1:
        return reading.scale * 1e3, "µm"
    if reading.position == "deg" and shown < 0.05:
        return reading.scale * 1e3, "mdeg"
    return reading.scale, reading.position
