r"""The thesis's coupled impedance, as it prints it.

Its equation 2.2 writes the balance of both bodies together and adds the coupling's torque to it:

.. math::
    I_c\ddot D + b_c\dot D + k_c D = \tau_k + \tau_e - m_{sh} g l_{sh}\sin\theta_k - m_e g l_e\sin\theta_e
    - I_k\ddot\theta_k - I_e\ddot\theta_e

The coupling is internal: it pulls one body as it pushes the other, and the right-hand side is what remains of the two
balances, b_k dtheta_k + b_e dtheta_e and friction. It holds nothing of the strap. Both routes to the coefficients are
here: least squares of 2.2, and the transfer function 2.7 from that torque to the mismatch, with two poles and no zeros.
As the toolbox has it, the poles are stable and the sign of the gain is free: all three coefficients may be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

from ...signals.filters import central_difference, zero_phase_lowpass
from .strap_torque import LOWPASS, ORDER, Limb, Orthosis, StrappedSwing

RATE = 100.0
"""The transfer function is fitted on about so many samples a second."""
SCALES = np.array([0.1, 1.0, 10.0])
"""Sizes of inertia, damping and stiffness: the search's units and starts, and what counts as at a bound."""
STARTS = ((0.5, 0.3, 0.3), (1.0, 0.5, 1.0), (5.0, 0.1, 2.0))
"""Of the search, in these units."""
AT_BOUND = 1e-4
"""Share of its size below which a coefficient is at its bound."""


@dataclass(frozen=True)
class PublishedCoupling:
    """The thesis's three coefficients: `inertia` [kg m^2], `damping` [N m s/rad] and `stiffness` [N m/rad]."""

    inertia: float
    damping: float
    stiffness: float

    @property
    def natural_frequency(self) -> float:
        """Of the two poles [Hz]; NaN where stiffness and inertia differ in sign or are zero."""
        ratio = self.stiffness / self.inertia if self.inertia else np.nan
        return float(np.sqrt(ratio) / (2.0 * np.pi)) if ratio > 0.0 else float("nan")

    @property
    def damping_ratio(self) -> float:
        """Of the two poles; NaN where they have no natural frequency."""
        product = self.stiffness * self.inertia
        return float(self.damping / (2.0 * np.sqrt(product))) if product > 0.0 else float("nan")

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Coefficients that a bound of zero stopped: the fit means nothing then."""
        values = np.array([self.inertia, self.damping, self.stiffness])
        stopped = np.flatnonzero(np.abs(values) < AT_BOUND * SCALES)
        return tuple(("inertia", "damping", "stiffness")[i] for i in stopped)


def torque_mismatch(swing: StrappedSwing, limb_angle: np.ndarray, orthosis: Orthosis, limb: Limb) -> np.ndarray:
    """Right-hand side of equation 2.2. `limb_angle` (n,) [rad]; gives (n,) [N m]."""
    if swing.knee_torque is None:
        raise ValueError(f"{swing.name}: found no knee torque, expected the muscles' for equation 2.2")
    fs = swing.fs
    signals = np.column_stack([limb_angle, swing.position, swing.knee_torque + swing.torque - orthosis.offset])
    k, e, torque = zero_phase_lowpass(signals, LOWPASS, ORDER, fs).T
    static = torque - limb.gravity * np.sin(k) - orthosis.gravity * np.sin(e)
    return static - limb.inertia * _second(k, fs) - orthosis.inertia * _second(e, fs)


def solve_balance(torques: Sequence[np.ndarray], mismatches: Sequence[np.ndarray], fs: float) -> PublishedCoupling:
    """Least squares of equation 2.2 for its three coefficients. `torques`, `mismatches` (n,) [N m], [rad]; `fs`
    [Hz]."""
    rows = []
    for angle in mismatches:
        smooth = zero_phase_lowpass(angle, LOWPASS, ORDER, fs)
        rows.append(np.column_stack([_second(smooth, fs), central_difference(smooth, fs), smooth]))
    found, *_ = np.linalg.lstsq(np.vstack(rows), np.concatenate(torques), rcond=None)
    return PublishedCoupling(*(float(v) for v in found))


def fit_two_poles(torques: Sequence[np.ndarray], mismatches: Sequence[np.ndarray], fs: float) -> PublishedCoupling:
    """Output error of equation 2.7, coefficients of one sign, each trial's initial state estimated. `torques`,
    `mismatches` (n,) [N m], [rad]; `fs` [Hz]."""
    step = max(1, round(fs / RATE))
    pairs = [(u[::step], y[::step]) for u, y in zip(torques, mismatches, strict=True)]

    def residual(x: np.ndarray, sign: float) -> np.ndarray:
        return np.concatenate([_respond(sign * x * SCALES, u, y, step / fs) - y for u, y in pairs])

    best, signed = None, 1.0
    for sign in (1.0, -1.0):
        for start in STARTS:
            found = least_squares(residual, start, bounds=(1e-9, 1e4), args=(sign,), max_nfev=60)
            if best is None or found.cost < best.cost:
                best, signed = found, sign
    return PublishedCoupling(*(float(v) for v in signed * best.x * SCALES))


def published_mismatch(coupling: PublishedCoupling, torque: np.ndarray, seen: np.ndarray, fs: float) -> np.ndarray:
    """Mismatch by equation 2.7, from the initial state that suits it best. `torque`, `seen` (n,) [N m], [rad]; `fs`
    [Hz]; gives (n,) [rad]."""
    values = np.array([coupling.inertia, coupling.damping, coupling.stiffness])
    if np.any(values < 0.0) and np.any(values > 0.0):
        return np.full(len(torque), np.nan)
    return _respond(values, torque, seen, 1.0 / fs)


def _respond(values: np.ndarray, torque: np.ndarray, seen: np.ndarray, dt: float) -> np.ndarray:
    """Response of the two poles, straight lines between samples; the free part by least squares."""
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
