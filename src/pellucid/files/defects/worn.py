"""Find recordings in which somebody wears the robot: the effort is not that of a machine alone.

A machine's effort is what its inertia, weight and friction need, at once and with a sign that physics gives. In a worn
robot another body moves the joint, too: the effort then leads or follows the motion by tens of milliseconds to some
hundred, as people do, and what a machine's equation finds is an impedance that no bearing has.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

KIND = "worn"


@dataclass(frozen=True)
class WearerTest:
    """Thresholds of the decision that somebody wears a robot. They were chosen by judgement on the public recordings of
    machines, none of which is worn; `python -m research.evidence truth` counts what they miss."""

    max_explained_share: float = 0.99  # a machine's equation explains more of its effort's variance than this
    max_remaining_share: float = 0.8  # a shift or an impossible machine leaves at most this share of the residual
    max_drive_delay_s: float = 0.03  # a drive and its logger are no later than this [s]
    max_late_s: float = 0.4  # longest time by which people lead or follow that is tried [s]
    band_hz: tuple[float, float] = (0.15, 4.0)  # frequencies at which people move joints [Hz]
    min_band_share: float = 0.8  # share of the speed's variance that lies in this band
    min_samples: int = 200  # fewer samples show nobody
    max_samples: int = 20_000  # a longer recording is examined in its middle only
    smooth_s: float = 0.03  # width of the smoothing before derivatives [s]


@dataclass(frozen=True)
class Worn:
    """What shows that somebody wears a robot.

    Attributes
    ----------
    explained : float
        Largest share of the effort's variance that a machine's equation explains with a drive's delay.
    impossible : float
        Share that the same equation explains if inertia and friction may be negative.
    late : float
        Time by which the effort follows the motion where it is explained best [s]; negative where it leads.
    explained_late : float
        Share that a machine's equation explains with this shift.
    """

    explained: float
    impossible: float
    late: float
    explained_late: float

    @property
    def reasons(self) -> tuple[str, ...]:
        """What shows it, in words."""
        made = [f"inertia, weight and friction explain {100 * self.explained:.2g} % of the effort"]
        if self.impossible > self.explained:
            made.append(f"{100 * self.impossible:.2g} % with a negative inertia or friction, which no bearing has")
        if self.late:
            way = "followed" if self.late > 0.0 else "led"
            share = 100 * self.explained_late
            cause = "as people do" if self.late > 0.0 else "as people do, or where the motion's sensor lags"
            made.append(f"{share:.2g} % if it {way} the motion by {1e3 * abs(self.late):.3g} ms, {cause}")
        return tuple(made)


def find_worn(
    time: np.ndarray,
    position: np.ndarray,
    effort: np.ndarray,
    kept: np.ndarray | None = None,
    test: WearerTest = WearerTest(),
) -> Worn | None:
    """Return what shows that somebody wears a robot; None if a machine alone may have moved so.

    Parameters
    ----------
    time, position, effort : ndarray, shape (n,) each
        Evenly sampled time [s], position of a joint [rad or m], and what drives it, in any unit.
    kept : ndarray of bool, shape (n,), optional
        Which samples are used; all by default.
    test : WearerTest
        Thresholds.
    """
    known = np.isfinite(time) & np.isfinite(position) & np.isfinite(effort)
    rows = np.flatnonzero(known if kept is None else known & kept)
    first = max(0, (len(rows) - test.max_samples) // 2)
    time, position, effort = (x[rows[first : first + test.max_samples]] for x in (time, position, effort))
    if len(time) < test.min_samples or np.ptp(position) == 0.0 or np.ptp(effort) == 0.0:
        return None
    step = float(np.median(np.diff(time)))
    if step <= 0.0 or time[-1] - time[0] < 2.0 / test.band_hz[1]:
        return None
    width = max(1, round(test.smooth_s / step))
    q, tau = _smoothed(position, width), _smoothed(effort, width)
    v = np.gradient(q, step)
    a = np.gradient(v, step)
    if _band_share(v, step, test.band_hz) < test.min_band_share:
        return None
    speed = float(np.quantile(np.abs(v), 0.9)) or 1.0
    design = np.column_stack([a, v, np.tanh(10.0 * v / speed), np.sin(q), np.cos(q), np.ones(len(q))])
    furthest = min(round(test.max_late_s / step), len(q) // 4)
    inner = slice(furthest + 2 * width, len(q) - furthest - 2 * width)
    if inner.stop - inner.start < test.min_samples // 2 or np.ptp(tau[inner]) == 0.0:
        return None
    stride = max(1, furthest // 40)
    shifts = np.arange(-(furthest // stride) * stride, furthest + 1, stride)
    lates = shifts * step
    near = np.abs(lates) <= max(test.max_drive_delay_s, stride * step)

    def shares(some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _possible_shares(design[inner], [tau[inner.start + shift : inner.stop + shift] for shift in some])

    explained = float(np.max(shares(shifts[near])))
    if explained >= test.max_explained_share:
        return None
    possible, _ = shares(shifts)
    best = int(np.argmax(possible))
    # At the longest shift tried, the best one lies beyond: that is no time of people.
    inside = not near[best] and 0 < best < len(shifts) - 1
    remaining = test.max_remaining_share * (1.0 - explained)
    # A machine whose channel is late is explained in full once it is shifted.
    human = inside and possible[best] < test.max_explained_share
    late = float(lates[best]) if human and 1.0 - possible[best] < remaining else 0.0
    solution = np.linalg.lstsq(design[inner], tau[inner], rcond=1e-10)[0]
    off = tau[inner] - design[inner] @ solution
    impossible = 1.0 - float(np.mean(off**2)) / float(np.var(tau[inner]))
    impossible = impossible if 1.0 - impossible < remaining else explained
    if not (late or impossible > explained):
        return None
    return Worn(explained, impossible, late, float(possible[best]))


def _possible_shares(design: np.ndarray, efforts: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of each effort's variance that a possible machine explains, and of the effort with other sign.

    Inertia, viscous and Coulomb friction of a possible machine, the first three columns, are at least 0.
    """
    design = design / np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    effort = np.column_stack(efforts)
    gram, inside = design.T @ design, design.T @ effort
    whole = np.sum((effort - effort.mean(axis=0)) ** 2, axis=0)
    explained = np.zeros((2, effort.shape[1]))
    # Three bounds are few enough to try every way in which some of them hold.
    for held in product((False, True), repeat=3):
        kept = np.flatnonzero(~np.array([*held, *(False,) * (design.shape[1] - 3)]))
        solution = np.linalg.lstsq(gram[np.ix_(kept, kept)], inside[kept], rcond=1e-12)[0]
        share, bounded = np.sum(inside[kept] * solution, axis=0), solution[kept < 3]
        for sign, own in zip((1.0, -1.0), explained, strict=True):
            feasible = np.all(sign * bounded >= 0.0, axis=0)
            own[feasible] = np.maximum(own, share)[feasible]
    possible, other = 1.0 - (np.sum(effort**2, axis=0) - explained) / np.maximum(whole, 1e-300)
    return possible, other


def _smoothed(x: np.ndarray, width: int) -> np.ndarray:
    """Return `x`, (n,), smoothed twice by a moving mean over `width` samples on either side."""
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    for _ in range(2):
        x = np.convolve(np.pad(x, width, mode="edge"), kernel, mode="valid")
    return x


def _band_share(v: np.ndarray, step: float, band: tuple[float, float]) -> float:
    """Return the share of a speed's variance within a band of frequencies [Hz]."""
    spectrum = np.abs(np.fft.rfft(v - v.mean())) ** 2
    frequency = np.fft.rfftfreq(len(v), step)
    whole = float(spectrum.sum())
    return float(spectrum[(frequency >= band[0]) & (frequency <= band[1])].sum()) / whole if whole > 0.0 else 0.0
