"""Search for a strap's stiffness and damping: residuals of the IMU's angle, their Jacobian and the covariance.

The module ``coupled_impedance`` explains the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft
from scipy.interpolate import CubicSpline

from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...numerics.clocks import best_delay
from ...numerics.uncertainty import sandwich_covariance
from .strap_model import StrappedSwing, StrapTorque


@dataclass(frozen=True)
class SearchSettings:
    """What of a trial is used, and how far and how long is searched."""

    # Samples are excluded for this time at either end of a trial, where the unknown initial state still acts [s].
    trial_edge_s: float = 1.0
    # A smooth bridge of this length connects the end of a trial with its beginning, because the transform is periodic
    # [s].
    transform_bridge_s: float = 2.0
    max_clock_shift_s: float = 1.5  # largest difference between the clocks of IMU and actuator that is searched [s]
    min_imu_samples: int = 40  # smallest number of IMU samples in a trial
    min_motion_rad: float = np.radians(2.0)  # smallest range of the orthosis's angle in a trial [rad]
    max_iterations: int = 60  # largest number of Levenberg-Marquardt steps
    cost_tolerance: float = 1e-9  # the search stops when a step reduces the cost by less than this share
    min_coefficient_share: float = 1e-6  # lower bound of stiffness and damping, relative to their first values


SEARCH_SETTINGS = SearchSettings()


STRAP_PARAMETERS = ("stiffness", "damping")
"""Parameters of the strap, in the covariance's order."""


def clock_shift(swing: StrappedSwing) -> float:
    """Return a first estimate of the IMU's clock shift [s]: the shift at which its angle follows the orthosis's
    best."""
    known = np.isfinite(swing.imu_angle) & np.isfinite(swing.imu_time)
    if known.sum() < SEARCH_SETTINGS.min_imu_samples or np.ptp(swing.position) < SEARCH_SETTINGS.min_motion_rad:
        raise IdentificationError(
            f"{swing.name}: found {int(known.sum())} samples of the IMU and {np.degrees(np.ptp(swing.position)):.1f} "
            f"deg of motion, expected {SEARCH_SETTINGS.min_imu_samples} and "
            f"{np.degrees(SEARCH_SETTINGS.min_motion_rad):.0f} deg or more"
        )
    imu_time, imu_angle = swing.imu_time[known], swing.imu_angle[known]
    shift = best_delay(
        imu_time,
        imu_angle,
        lambda at: np.interp(at, swing.time, swing.position),
        np.arange(-SEARCH_SETTINGS.max_clock_shift_s, SEARCH_SETTINGS.max_clock_shift_s + 1e-9, 0.01),
        span=(swing.time[0], swing.time[-1]),
        either_sense=False,
        fewest=SEARCH_SETTINGS.min_imu_samples,
    )
    if shift is None:
        raise IdentificationError(
            f"{swing.name}: the IMU's times and the actuator's do not overlap, expected clocks within "
            f"{SEARCH_SETTINGS.max_clock_shift_s:g} s"
        )
    return shift


class Spectrum:
    """Fourier transform of one trial's signals, `columns` of shape (n, c) [N m] at `fs` [Hz], made periodic."""

    def __init__(self, columns: np.ndarray, fs: float):
        n = len(columns)
        total = fft.next_fast_len(n + round(SEARCH_SETTINGS.transform_bridge_s * fs), real=True)
        share = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, total - n + 1) / (total - n + 1))[:, None]
        self.length, self.total = n, total
        self.spectrum = fft.rfft(np.vstack([columns, columns[-1] + share * (columns[0] - columns[-1])]), axis=0)
        self.omega = 2.0 * np.pi * fft.rfftfreq(total, 1.0 / fs)[:, None]

    def response(self, k: float, b: float, i: float) -> np.ndarray:
        """Return the response of a strap of stiffness `k`, damping `b` and inertia `i` to all signals, shape (n, c)."""
        return fft.irfft(self.spectrum / self._denominator(k, b, i), self.total, axis=0)[: self.length]

    def derivatives(self, k: float, b: float, i: float) -> np.ndarray:
        """Return the response to the first signal and its derivatives by `k`, `b` and `i`, shape (n, 4)."""
        h = 1.0 / self._denominator(k, b, i)
        tau, w = self.spectrum[:, :1] * h, self.omega
        parts = np.hstack([tau, -tau * h, -1j * w * tau * h, w**2 * tau * h])
        return fft.irfft(parts, self.total, axis=0)[: self.length]

    def _denominator(self, k: float, b: float, i: float) -> np.ndarray:
        return k + 1j * self.omega * b - i * self.omega**2


@dataclass(frozen=True)
class StrapPoint:
    """A point of the search: the strap, the IMU's gain, and the clock shift [s] and offset [rad] of each trial."""

    stiffness: float
    damping: float
    inertia: float
    gain: float
    shifts: np.ndarray
    offsets: np.ndarray
    converged: bool = True


class StrapTrial:
    """One trial, prepared for repeated evaluation."""

    def __init__(self, swing: StrappedSwing, torque: StrapTorque):
        self.swing, self.torque, self.fs = swing, torque, swing.fs
        self.angle = CubicSpline(swing.time, swing.position)
        # The body's parameters act through the same strap, so their columns are transformed together with the torque.
        self.forcing = Spectrum(np.column_stack([torque.torque, torque.sensitivity]), self.fs)
        self.usable = np.isfinite(swing.imu_angle) & np.isfinite(swing.imu_time)
        self.doubtful = np.zeros(len(swing.time), bool)

    def leave_out(self, seconds: float) -> None:
        """Mark samples as doubtful for `seconds` after an interval of unknown torque."""
        reach = max(1, min(round(seconds * self.fs), len(self.swing.time)))
        unknown = ~self.torque.known
        counted = np.cumsum(unknown)
        self.doubtful = counted - np.concatenate([np.zeros(reach, int), counted[:-reach]]) > 0

    def times(self, shift: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the IMU's times on the actuator's clock, `shift` later [s], and which are used; shapes (m,)."""
        time = self.swing.imu_time + shift
        first, last = self.swing.time[0], self.swing.time[-1]
        keep = (
            self.usable & (time >= first + SEARCH_SETTINGS.trial_edge_s) & (time <= last - SEARCH_SETTINGS.trial_edge_s)
        )
        near = np.clip(np.round((np.where(self.usable, time, first) - first) * self.fs), 0, len(self.swing.time) - 1)
        return time, keep & ~self.doubtful[near.astype(int)]

    def sample(self, series: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate a `series`, shape (n, c), and the rate of its first column at a `time` of shape (m,) [s]."""
        place = (time - self.swing.time[0]) * self.fs
        low = np.clip(np.floor(place).astype(int), 0, len(series) - 2)
        part = (place - low)[:, None]
        step = series[low + 1] - series[low]
        return series[low] + part * step, step[:, 0] * self.fs


class StrapProblem:
    """Residuals and Jacobian of all trials.

    The parameters are stiffness, damping, inertia, gain, then a clock shift and an offset for each trial.
    """

    def __init__(
        self, trials: Sequence[StrapTrial], prior: Parameter | None, free_gain: bool, held_gain: float | None = None
    ):
        if not trials:
            raise IdentificationError("found no swing to fit, expected one trial or more")
        self.trials, self.prior, self.free_gain = trials, prior, free_gain
        self.gain = held_gain if held_gain is not None else (prior.value if prior is not None else 1.0)

    def names(self, *, inertia: bool) -> tuple[str, ...]:
        """Return the names of the parameters that all trials share, in the covariance's order."""
        return (*STRAP_PARAMETERS, *(("inertia",) if inertia else ()), *(("gain",) if self.free_gain else ()))

    @property
    def count(self) -> int:
        """Number of samples that are used."""
        return sum(int(t.times(0.0)[1].sum()) for t in self.trials)

    def leave_out(self, seconds: float) -> None:
        """Mark samples as doubtful for `seconds` after an interval of unknown torque, in every trial."""
        for trial in self.trials:
            trial.leave_out(seconds)
            share = float(np.mean(~trial.doubtful))
            if share < 0.2:
                raise IdentificationError(
                    f"{trial.swing.name}: the strap's torque is known in {100 * share:.0f} % of the trial, expected "
                    "20 % or more: the orthosis sticks, or hardly moves; swing further or faster"
                )

    def start(self) -> StrapPoint:
        """Return a first point: clocks by correlating both angles, the strap by regressing its torque on the
        mismatch."""
        shifts, offsets, rows, sides = [], [], [], []
        for trial in self.trials:
            shift = clock_shift(trial.swing)
            time, keep = trial.times(shift)
            if keep.sum() < SEARCH_SETTINGS.min_imu_samples:
                raise IdentificationError(
                    f"{trial.swing.name}: {int(keep.sum())} samples of the IMU fall into the trial, expected "
                    f"{SEARCH_SETTINGS.min_imu_samples} or more: the IMU and the actuator did not record together"
                )
            t = time[keep]
            seen = trial.swing.imu_angle[keep] / self.gain - trial.angle(t)
            shifts.append(shift)
            offsets.append(float(np.mean(seen)) * self.gain)
            tau = trial.sample(trial.torque.torque[:, None], t)[0][:, 0]
            seen = seen - seen.mean()
            rows.append(np.column_stack([seen, np.gradient(seen, t)]))
            sides.append(tau - tau.mean())
        found, *_ = np.linalg.lstsq(np.vstack(rows), np.concatenate(sides), rcond=None)
        spread = np.std(np.concatenate(sides)) / max(np.std(np.vstack(rows)[:, 0]), 1e-9)
        stiffness = float(found[0]) if found[0] > 0.1 * spread else float(spread)
        damping = float(found[1]) if found[1] > 0.0 else 0.05 * stiffness
        return StrapPoint(stiffness, damping, 0.0, self.gain, np.array(shifts), np.array(offsets))

    def solve(self, start: StrapPoint, *, inertia: bool, hold_strap: bool = False) -> StrapPoint:
        """Search by Levenberg-Marquardt from several clock shifts, because a late clock looks like damping."""
        if hold_strap or inertia:
            return self._search(start, inertia, hold_strap)[0]
        found = [self._search(replace(start, shifts=start.shifts + d), inertia, False) for d in (-0.1, 0.0, 0.1)]
        return min(found, key=lambda pair: pair[1])[0]

    def _search(self, start: StrapPoint, inertia: bool, hold_strap: bool) -> tuple[StrapPoint, float]:
        free = self._free(inertia, hold_strap)
        floor = np.array(
            [
                SEARCH_SETTINGS.min_coefficient_share * start.stiffness,
                SEARCH_SETTINGS.min_coefficient_share * start.damping,
            ]
        )
        x, damp = self._vector(start), 1e-3
        scale = np.concatenate([[start.stiffness, max(start.damping, 1e-3), 0.05, 0.1], np.full(len(x) - 4, 0.05)])
        residual, jacobian, cost = self._evaluate(x)
        done = False
        for _ in range(SEARCH_SETTINGS.max_iterations):
            z = jacobian[:, free] * scale[free]
            gram, slope = z.T @ z, z.T @ residual
            while damp < 1e9:
                step = np.linalg.solve(gram + damp * np.diag(np.diag(gram) + 1e-12), slope)
                y = x.copy()
                y[free] += scale[free] * step
                y[:2] = np.maximum(y[:2], floor)
                r, j, c = self._evaluate(y)
                if c <= cost:
                    break
                damp *= 5.0
            else:
                done = True
                break
            gained = cost - c
            x, residual, jacobian, cost, damp = y, r, j, c, max(damp / 10.0, 1e-12)
            if gained <= SEARCH_SETTINGS.cost_tolerance * cost:
                done = True
                break
        return self._point(x, done), cost

    def _evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        residual, jacobian, _ = self._linearised(x)
        # The cost is divided by the number of samples, so that a clock shift which excludes samples gains nothing by
        # it.
        rows = len(residual) - (self.prior is not None and self.free_gain)
        return residual, jacobian, float(residual @ residual) / max(rows, 1)

    def _linearised(
        self, x: np.ndarray, body: bool = False, at: StrapPoint | None = None
    ) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Return residuals, the model's Jacobian, and the model's derivatives by the body's parameters, by trial."""
        k, b, i, g = x[:4]
        residuals, jacobians, bodies = [], [], []
        for index, trial in enumerate(self.trials):
            shift, offset = x[4 + 2 * index : 6 + 2 * index]
            time, keep = trial.times(shift)
            keep = keep if at is None else trial.times(at.shifts[index])[1]
            t = time[keep]
            series, rate = trial.sample(trial.forcing.derivatives(k, b, i), t)
            angle = trial.angle(t) + series[:, 0]
            residuals.append(trial.swing.imu_angle[keep] - offset - g * angle)
            j = np.zeros((len(t), len(x)))
            j[:, :3], j[:, 3] = g * series[:, 1:], angle
            j[:, 4 + 2 * index], j[:, 5 + 2 * index] = g * (trial.angle(t, 1) + rate), 1.0
            jacobians.append(j)
            if body:
                bodies.append(g * trial.sample(trial.forcing.response(k, b, i)[:, 1:], t)[0])
        if self.prior is not None and self.free_gain and not body:
            noise = np.sqrt(np.mean(np.concatenate(residuals) ** 2))
            row = np.zeros((1, len(x)))
            row[0, 3] = noise / self.prior.standard_error
            residuals.append(np.array([(self.prior.value - g) * row[0, 3]]))
            jacobians.append(row)
        return np.concatenate(residuals), np.vstack(jacobians), bodies

    def covariance(self, point: StrapPoint, *, inertia: bool) -> np.ndarray:
        """Return the covariance of the shared parameters, shape (p, p).

        It sums the parts of the IMU's coloured error, of the calibrated gain, and of the body's parameters.
        """
        x = self._vector(point)
        free = self._free(inertia, False)
        residual, jacobian, bodies = self._linearised(x, body=True)
        z = jacobian[:, free]
        lengths = [len(b) for b in bodies]
        bread = z.T @ z
        if self.prior is not None and self.free_gain:
            at = int(np.sum(free[:3]))
            extra = np.zeros(len(bread))
            extra[at] = np.mean(residual**2) / self.prior.standard_error**2
            bread = bread + np.diag(extra)
        try:
            spread = np.linalg.inv(bread)
            noise = sandwich_covariance(z, residual, lengths)
        except np.linalg.LinAlgError as error:
            raise IdentificationError(
                "the swings do not tell the strap's stiffness from its damping: swing at more than one speed"
            ) from error
        # The sandwich covers the data alone; the calibrated gain contributes to the estimate and to its error.
        turn = spread @ (z.T @ z)
        total = turn @ noise @ turn.T
        if self.prior is not None and self.free_gain:
            total = total + np.outer(spread[:, at], spread[:, at]) * extra[at] ** 2 * self.prior.standard_error**2
        push = -spread @ sum(z[e - n : e].T @ b for b, n, e in zip(bodies, lengths, np.cumsum(lengths), strict=True))
        total = total + push @ self.trials[0].torque.covariance @ push.T
        shared = len(self.names(inertia=inertia))
        return total[:shared, :shared]

    def about(self, point: StrapPoint, at: StrapPoint | None = None) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Return residuals, (m,), the model's Jacobian, (m, p), and its derivatives by the body's parameters, by trial.

        The Jacobian's columns are stiffness, damping, gain, and each trial's clock and offset. If `at` is given, the
        samples used are those at that point.
        """
        residual, jacobian, bodies = self._linearised(self._vector(point), body=True, at=at)
        return residual, np.delete(jacobian, 2, axis=1), bodies

    def residuals(self, point: StrapPoint) -> tuple[np.ndarray, ...]:
        """Return each trial's residual at all of the IMU's times [rad]; NaN where a sample is not used."""
        found = []
        for trial, shift, offset in zip(self.trials, point.shifts, point.offsets, strict=True):
            time, keep = trial.times(shift)
            series = trial.forcing.response(point.stiffness, point.damping, point.inertia)[:, :1]
            model = trial.angle(time[keep]) + trial.sample(series, time[keep])[0][:, 0]
            residual = np.full(len(time), np.nan)
            residual[keep] = trial.swing.imu_angle[keep] - offset - point.gain * model
            found.append(residual)
        return tuple(found)

    def at_bound(self, point: StrapPoint, start: StrapPoint) -> tuple[bool, bool]:
        """Return whether stiffness and damping are held by their lower bounds, relative to their values at `start`."""
        return point.stiffness <= 1e-4 * start.stiffness, point.damping <= 1e-4 * start.damping

    def _free(self, inertia: bool, hold_strap: bool) -> np.ndarray:
        free = np.ones(4 + 2 * len(self.trials), bool)
        free[:2], free[2], free[3] = not hold_strap, inertia, self.free_gain and not hold_strap
        return free

    def _vector(self, p: StrapPoint) -> np.ndarray:
        pairs = np.column_stack([p.shifts, p.offsets]).ravel()
        return np.concatenate([[p.stiffness, p.damping, p.inertia, p.gain], pairs])

    def _point(self, x: np.ndarray, converged: bool) -> StrapPoint:
        stiffness, damping, inertia, gain = (float(v) for v in x[:4])
        return StrapPoint(stiffness, damping, inertia, gain, x[4::2].copy(), x[5::2].copy(), converged)
