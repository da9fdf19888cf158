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
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

from ...models.estimates import Parameter
from ...numerics.filters import central_difference, zero_phase_lowpass
from .strap_model import DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, Limb, Orthosis, StrappedSwing, StrapTorque
from .strap_search import Spectrum, StrapProblem, StrapTrial

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
    k, e, torque = zero_phase_lowpass(signals, DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, fs).T
    static = torque - limb.gravity * np.sin(k) - orthosis.gravity * np.sin(e)
    return static - limb.inertia * _second(k, fs) - orthosis.inertia * _second(e, fs)


def solve_balance(torques: Sequence[np.ndarray], mismatches: Sequence[np.ndarray], fs: float) -> PublishedCoupling:
    """Estimate the three coefficients by least squares of equation 2.2.

    Each trial has a torque [N m] and a mismatch [rad] of shape (n,), sampled at `fs` [Hz].
    """
    rows = []
    for angle in mismatches:
        smooth = zero_phase_lowpass(angle, DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, fs)
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
