r"""Stiffness and damping of the strap between wearer and orthosis, from its torque and the mismatch of the angles.

The balance of one body gives the strap's torque (``strap_torque``), to which the mismatch D of the two angles responds:

.. math::
    D(s) = \frac{\tau_c(s)}{I_c s^2 + b_c s + k_c}, \qquad
    y(t_i) = o + g\,\bigl[\theta_e(t_i + \delta) + D(t_i + \delta)\bigr] + e_i

y is the limb's angle by the IMU. Its errors are on the output, so the output error is minimised. The IMU's mounting
angle o, gain g and clock delta are estimated together with the strap, because a late clock looks like damping. A strap
has no inertia: k_c and b_c are fitted with I_c = 0, and I_c is then freed as a test.

The response is computed by a Fourier transform over the whole trial. This gives the bounded response for any signs of
the coefficients, so the estimate of I_c may be negative. The ends of the trial, where the unknown initial state still
acts, are excluded.

`StrapProblem` has residuals, their Jacobian and the covariance. `PublishedCoupling` and what follows it are the
published estimates, in which the strap's torque cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import fft
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...numerics.clocks import best_delay
from ...numerics.filters import central_difference
from ...numerics.uncertainty import sandwich_covariance
from .strap_model import Limb, Orthosis, StrappedSwing, StrapTorque, derivative_lowpass


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
                    "20 % or more: the orthosis sticks or hardly moves; record larger or faster swings"
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
                    f"{SEARCH_SETTINGS.min_imu_samples} or more: the IMU and the actuator did not record at the same "
                    "time"
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
                "the swings do not distinguish the strap's stiffness from its damping: record more than one speed"
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


MAX_DECAY_TIME_CONSTANTS = 3.0
"""After an interval of unknown torque, samples are excluded for this many time constants of the strap."""

MAX_DECAY_S = 0.3
"""They are excluded for at most this long [s]. A longer time constant means that friction looks like damping."""

UNITS = {"stiffness": "N*m/rad", "damping": "N*m*s/rad", "inertia": "kg*m^2", "gain": "1"}


@dataclass(frozen=True)
class Instrument:
    """Clock and mounting of the IMU in one trial."""

    shift: float  # time by which the IMU's clock is ahead of the actuator's [s]
    offset: float  # angle of the IMU where the limb's angle is 0 [rad]
    gain: float = 1.0  # change of the IMU's angle per change of the limb's


@dataclass(frozen=True, eq=False)
class CouplingFit:
    """A spring and damper fitted to the strap's torque from one body's balance."""

    side: str  # body whose balance gave the torque: ``"orthosis"`` or ``"limb"``
    stiffness: Parameter  # stiffness of a strap without inertia [N m/rad]
    damping: Parameter  # damping of a strap without inertia [N m s/rad]
    inertia: Parameter  # inertia when it is fitted together with stiffness and damping, as a test [kg m^2]
    gain: Parameter | None  # gain of the IMU's angle; None where it was given
    covariance: np.ndarray = field(repr=False)  # (2, 2) covariance of stiffness and damping
    instruments: tuple[Instrument, ...] = field(repr=False)  # one for each trial
    # (m,) residual of each trial at the IMU's times [rad]; NaN where a sample was excluded
    residuals: tuple[np.ndarray, ...] = field(repr=False)
    used: int = 0  # number of the IMU's samples that were fitted
    converged: bool = True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Damping and stiffness, then the tested inertia and the IMU's gain."""
        return tuple(p for p in (self.damping, self.stiffness, self.inertia, self.gain) if p is not None)

    @property
    def residual_sd(self) -> float:
        """RMS residual of the IMU's angle over all trials [rad]."""
        every = np.concatenate(self.residuals)
        return float(np.sqrt(np.nanmean(every**2)))


def mismatch(torque: np.ndarray, fs: float, *, stiffness: float, damping: float, inertia: float = 0.0) -> np.ndarray:
    """Return the mismatch that a strap's torque causes, shape (n,) [rad].

    `torque`, shape (n,) [N m]; `fs` [Hz]; `stiffness` [N m/rad], `damping` [N m s/rad], `inertia` [kg m^2].
    """
    return Spectrum(torque[:, None], fs).response(stiffness, damping, inertia)[:, 0]


def fit_coupling(
    swings: Sequence[StrappedSwing],
    torques: Sequence[StrapTorque],
    *,
    side: str = "orthosis",
    gain: Parameter | None = None,
    free_gain: bool = True,
) -> CouplingFit:
    """Fit stiffness and damping by minimising the output error of the IMU's angle.

    `gain` is the IMU's gain with its standard error, if it was calibrated. If `free_gain`, it is estimated too.
    """
    problem = StrapProblem([StrapTrial(s, t) for s, t in zip(swings, torques, strict=True)], gain, free_gain)
    start = problem.start()
    strap = problem.solve(start, inertia=False)
    # The first fit gives the strap's time constant, for which samples after an unknown torque must be excluded.
    problem.leave_out(decay_time(strap.stiffness, strap.damping))
    strap = problem.solve(strap, inertia=False)
    tested = problem.solve(strap, inertia=True)
    covariance, at_bound = problem.covariance(strap, inertia=False), problem.at_bound(strap, start)
    with_inertia = problem.covariance(tested, inertia=True)
    sd = np.sqrt(np.diag(covariance))
    sure = {name: float(s) for name, s in zip(problem.names(inertia=False), sd, strict=False)}
    inertia_sd = float(np.sqrt(with_inertia[2, 2]))

    def parameter(name: str, value: float, error: float, bound: bool = False) -> Parameter:
        return Parameter(name, UNITS[name], value, error, bound, not bound and abs(value) > 1.96 * error)

    return CouplingFit(
        side,
        parameter("stiffness", strap.stiffness, sure["stiffness"], at_bound[0]),
        parameter("damping", strap.damping, sure["damping"], at_bound[1]),
        parameter("inertia", tested.inertia, inertia_sd),
        parameter("gain", strap.gain, sure["gain"]) if free_gain else None,
        covariance[:2, :2],
        tuple(Instrument(s, o, strap.gain) for s, o in zip(strap.shifts, strap.offsets, strict=True)),
        problem.residuals(strap),
        problem.count,
        strap.converged and tested.converged,
    )


def decay_time(stiffness: float, damping: float) -> float:
    """Return how long samples are excluded after an interval of unknown torque [s]."""
    return min(MAX_DECAY_TIME_CONSTANTS * damping / stiffness, MAX_DECAY_S)


def align(swing: StrappedSwing, torque: StrapTorque, fit: CouplingFit) -> Instrument:
    """Estimate clock and mounting of the IMU in a held-out trial, with the strap fixed at its fit."""
    trial = StrapTrial(swing, torque)
    gain = fit.instruments[0].gain
    problem = StrapProblem([trial], None, False, held_gain=gain)
    k, b = fit.stiffness.value, fit.damping.value
    problem.leave_out(decay_time(k, b))
    found = problem.solve(replace(problem.start(), stiffness=k, damping=b), inertia=False, hold_strap=True)
    return Instrument(float(found.shifts[0]), float(found.offsets[0]), gain)


def seen_mismatch(swing: StrappedSwing, instrument: Instrument) -> tuple[np.ndarray, np.ndarray]:
    """Return times and the measured mismatch at the IMU's samples, each of shape (m,) [s], [rad]."""
    time = swing.imu_time + instrument.shift
    inside = (time >= swing.time[0]) & (time <= swing.time[-1])
    angle = CubicSpline(swing.time, swing.position)(np.clip(time, swing.time[0], swing.time[-1]))
    return time, np.where(inside, (swing.imu_angle - instrument.offset) / instrument.gain - angle, np.nan)


def limb_angle(swing: StrappedSwing, instrument: Instrument) -> np.ndarray:
    """Return the limb's aligned angle at the actuator's times, shape (n,) [rad]; constant outside the IMU's times."""
    time = swing.imu_time + instrument.shift
    known = np.isfinite(swing.imu_angle)
    time, angle = time[known], (swing.imu_angle[known] - instrument.offset) / instrument.gain
    return CubicSpline(time, angle)(np.clip(swing.time, time[0], time[-1]))


TWO_POLE_FIT_RATE_HZ = 100.0
"""The transfer function is fitted to signals decimated to about this rate."""

COEFFICIENT_SCALES = np.array([0.1, 1.0, 10.0])
"""Typical sizes of inertia, damping and stiffness, by which the search scales them."""

SEARCH_STARTS = ((0.5, 0.3, 0.3), (1.0, 0.5, 1.0), (5.0, 0.1, 2.0))
"""Starting points of the search, in units of `COEFFICIENT_SCALES`."""

AT_BOUND_SHARE = 1e-4
"""A coefficient below this share of its scale counts as held by its bound of zero."""


@dataclass(frozen=True)
class PublishedCoupling:
    """The thesis's three coefficients: `inertia` [kg m^2], `damping` [N m s/rad] and `stiffness` [N m/rad]."""

    inertia: float
    damping: float
    stiffness: float

    @property
    def natural_frequency(self) -> float:
        """Natural frequency of the two poles [Hz]; NaN where stiffness and inertia differ in sign or are zero."""
        ratio = self.stiffness / self.inertia if self.inertia else np.nan
        return float(np.sqrt(ratio) / (2.0 * np.pi)) if ratio > 0.0 else float("nan")

    @property
    def damping_ratio(self) -> float:
        """Damping ratio of the two poles; NaN where they have no natural frequency."""
        product = self.stiffness * self.inertia
        return float(self.damping / (2.0 * np.sqrt(product))) if product > 0.0 else float("nan")

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of the coefficients held by their bound of zero, in which case the fit is meaningless."""
        values = np.array([self.inertia, self.damping, self.stiffness])
        stopped = np.flatnonzero(np.abs(values) < AT_BOUND_SHARE * COEFFICIENT_SCALES)
        return tuple(("inertia", "damping", "stiffness")[i] for i in stopped)


def torque_mismatch(swing: StrappedSwing, limb_angle: np.ndarray, orthosis: Orthosis, limb: Limb) -> np.ndarray:
    """Return the right-hand side of equation 2.2, shape (n,) [N m]; `limb_angle`, shape (n,) [rad]."""
    if swing.knee_torque is None:
        raise ValueError(f"{swing.name}: found no knee torque, expected the muscles' for equation 2.2")
    fs = swing.fs
    signals = np.column_stack([limb_angle, swing.position, swing.knee_torque + swing.torque - orthosis.offset])
    k, e, torque = derivative_lowpass(signals, fs).T
    static = torque - limb.gravity * np.sin(k) - orthosis.gravity * np.sin(e)
    return static - limb.inertia * _second(k, fs) - orthosis.inertia * _second(e, fs)


def solve_balance(torques: Sequence[np.ndarray], mismatches: Sequence[np.ndarray], fs: float) -> PublishedCoupling:
    """Estimate the three coefficients by least squares of equation 2.2.

    Each trial has a torque [N m] and a mismatch [rad] of shape (n,), sampled at `fs` [Hz].
    """
    rows = []
    for angle in mismatches:
        smooth = derivative_lowpass(angle, fs)
        rows.append(np.column_stack([_second(smooth, fs), central_difference(smooth, fs), smooth]))
    found, *_ = np.linalg.lstsq(np.vstack(rows), np.concatenate(torques), rcond=None)
    return PublishedCoupling(*(float(v) for v in found))


def fit_two_poles(torques: Sequence[np.ndarray], mismatches: Sequence[np.ndarray], fs: float) -> PublishedCoupling:
    """Estimate the three coefficients by output error of equation 2.7, with equal signs and free initial states.

    Each trial has a torque [N m] and a mismatch [rad] of shape (n,), sampled at `fs` [Hz].
    """
    step = max(1, round(fs / TWO_POLE_FIT_RATE_HZ))
    pairs = [(u[::step], y[::step]) for u, y in zip(torques, mismatches, strict=True)]

    def residual(x: np.ndarray, sign: float) -> np.ndarray:
        return np.concatenate([_respond(sign * x * COEFFICIENT_SCALES, u, y, step / fs) - y for u, y in pairs])

    tried = [
        (sign, least_squares(residual, start, bounds=(1e-9, 1e4), args=(sign,), max_nfev=60))
        for sign in (1.0, -1.0)
        for start in SEARCH_STARTS
    ]
    signed, best = min(tried, key=lambda each: float(each[1].cost))
    return PublishedCoupling(*(float(v) for v in signed * best.x * COEFFICIENT_SCALES))


def published_mismatch(coupling: PublishedCoupling, torque: np.ndarray, seen: np.ndarray, fs: float) -> np.ndarray:
    """Predict the mismatch by equation 2.7, shape (n,) [rad], from the best-fitting initial state.

    `torque` [N m] and the measured mismatch `seen` [rad] have shape (n,); `fs` [Hz].
    """
    values = np.array([coupling.inertia, coupling.damping, coupling.stiffness])
    if np.any(values < 0.0) and np.any(values > 0.0):
        return np.full(len(torque), np.nan)
    return _respond(values, torque, seen, 1.0 / fs)


def _respond(values: np.ndarray, torque: np.ndarray, seen: np.ndarray, dt: float) -> np.ndarray:
    """Return the response of the two poles with a first-order hold; the initial state is found by least squares."""
    top, bottom, _ = cont2discrete(([1.0], values), dt, method="foh")
    top, n = np.atleast_2d(top)[0], len(torque)
    impulse = np.zeros(n)
    impulse[0] = 1.0
    forced = lfilter(top, bottom, torque)
    free = lfilter([1.0], bottom, impulse)
    columns = np.column_stack([free, np.concatenate([[0.0], free[:-1]])])
    initial, *_ = np.linalg.lstsq(columns, seen - forced, rcond=None)
    return forced + columns @ initial


def _second(samples: np.ndarray, fs: float) -> np.ndarray:
    return central_difference(central_difference(samples, fs), fs)
