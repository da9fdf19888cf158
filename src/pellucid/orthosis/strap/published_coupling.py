r"""The coupled impedance as the thesis prints it.

Its equation 2.2 adds the balances of both bodies and includes the torque of the coupling:

.. math::
    I_c\ddot D + b_c\dot D + k_c D = \tau_k + \tau_e - m_{sh} g l_{sh}\sin\theta_k - m_e g l_e\sin\theta_e
    - I_k\ddot\theta_k - I_e\ddot\theta_e

The coupling's torque is internal: it acts on both bodies with opposite signs and cancels in the sum. The right-hand
side is therefore b_k dtheta_k + b_e dtheta_e and friction, and contains no information on the strap. Both published
estimates are implemented: least squares of equation 2.2, and the transfer function 2.7 from that torque to the
mismatch, with two poles and no zeros. As in the thesis's toolbox, the poles are stable and the sign of the gain is
free, so all three coefficients may be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

from ...numerics.filters import central_difference, zero_phase_lowpass
from .strap_torque import DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, Limb, Orthosis, StrappedSwing

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
