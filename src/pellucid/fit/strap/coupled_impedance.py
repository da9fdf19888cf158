r"""Stiffness and damping of the strap between wearer and orthosis, from its torque and the mismatch that it makes.

One body's balance tells the strap's torque (``strap_torque``); the mismatch D of the two angles answers it:

.. math::
    D(s) = \frac{\tau_c(s)}{I_c s^2 + b_c s + k_c}, \qquad
    y(t_i) = o + g\,\bigl[\theta_e(t_i + \delta) + D(t_i + \delta)\bigr] + e_i

y is the limb's angle as the IMU tells it. Its errors are on the output, so the output's error is minimised; how it was
strapped on (o), its scale (g) and its clock (delta) are estimated with the strap, because a late clock looks like
damping. A strap has no inertia: k_c and b_c are fitted with I_c = 0, and I_c is then fitted too, as a test.

The response is computed by Fourier transform over the whole trial: the bounded answer, whatever the signs of the
coefficients, so that I_c may come out on either side of 0. The ends, where a start unknown to it still shows, are left
out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline

from ..parameter import Parameter
from .strap_search import Spectrum, StrapProblem, StrapTrial
from .strap_torque import StrappedSwing, StrapTorque

DECAY = 3.0
"""Time constants after which a torque that was not known has left the mismatch."""
UNITS = {"stiffness": "N*m/rad", "damping": "N*m*s/rad", "inertia": "kg*m^2", "gain": "1"}


@dataclass(frozen=True)
class Instrument:
    """How the IMU saw one trial: its clock is `shift` ahead of the actuator's [s], its angle is `offset` [rad] plus
    `gain` times the limb's."""

    shift: float
    offset: float
    gain: float = 1.0


@dataclass(frozen=True, eq=False)
class CouplingFit:
    """The strap as one side's balance shows it."""

    side: str  # ``"orthosis"`` or ``"limb"``: whose balance gave the torque
    stiffness: Parameter  # stiffness, damping: Of a strap without inertia [N m/rad], [N m s/rad]
    damping: Parameter
    inertia: Parameter  # What an inertia in the strap would be, fitted with them [kg m^2]
    gain: Parameter | None  # Of the IMU's angle; None where it was given
    covariance: np.ndarray = field(repr=False)  # (2, 2) Of stiffness and damping
    instruments: tuple[Instrument, ...] = field(repr=False)  # One for each trial
    # (m,) Of each trial at the IMU's times [rad]; NaN where a sample was left out
    residuals: tuple[np.ndarray, ...] = field(repr=False)
    used: int = 0  # Samples of the IMU that were fitted
    converged: bool = True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Strap first, then what it was tested against."""
        return tuple(p for p in (self.damping, self.stiffness, self.inertia, self.gain) if p is not None)

    @property
    def residual_sd(self) -> float:
        """Of the IMU's angle, all trials together [rad]."""
        every = np.concatenate(self.residuals)
        return float(np.sqrt(np.nanmean(every**2)))


def mismatch(torque: np.ndarray, fs: float, *, stiffness: float, damping: float, inertia: float = 0.0) -> np.ndarray:
    """Mismatch that a strap's torque makes. `torque` (n,) [N m]; `fs` [Hz]; `stiffness`, `damping`, `inertia` [N
    m/rad], [N m s/rad], [kg m^2]; gives (n,) [rad]."""
    return Spectrum(torque[:, None], fs).response(stiffness, damping, inertia)[:, 0]


def fit_coupling(
    swings: Sequence[StrappedSwing],
    torques: Sequence[StrapTorque],
    *,
    side: str = "orthosis",
    gain: Parameter | None = None,
    free_gain: bool = True,
) -> CouplingFit:
    """Stiffness and damping by output error on the IMU's angle."""
    problem = StrapProblem([StrapTrial(s, t) for s, t in zip(swings, torques, strict=True)], gain, free_gain)
    start = problem.start()
    strap = problem.solve(start, inertia=False)
    # Only now is it known for how long a torque that was not known stays in the mismatch.
    problem.leave_out(DECAY * strap.damping / strap.stiffness)
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


def align(swing: StrappedSwing, torque: StrapTorque, fit: CouplingFit) -> Instrument:
    """Clock and mounting of the IMU in a trial that was not fitted, the strap held as it was found."""
    trial = StrapTrial(swing, torque)
    gain = fit.instruments[0].gain
    problem = StrapProblem([trial], None, False, held_gain=gain)
    k, b = fit.stiffness.value, fit.damping.value
    problem.leave_out(DECAY * b / k)
    found = problem.solve(replace(problem.start(), stiffness=k, damping=b), inertia=False, hold_strap=True)
    return Instrument(float(found.shifts[0]), float(found.offsets[0]), gain)


def seen_mismatch(swing: StrappedSwing, instrument: Instrument) -> tuple[np.ndarray, np.ndarray]:
    """The mismatch as the IMU saw it, at its own times. Gives `time`, `mismatch` (m,) [s], [rad]."""
    time = swing.imu_time + instrument.shift
    inside = (time >= swing.time[0]) & (time <= swing.time[-1])
    angle = CubicSpline(swing.time, swing.position)(np.clip(time, swing.time[0], swing.time[-1]))
    return time, np.where(inside, (swing.imu_angle - instrument.offset) / instrument.gain - angle, np.nan)


def limb_angle(swing: StrappedSwing, instrument: Instrument) -> np.ndarray:
    """The limb's angle at the actuator's times, aligned: shape (n,) [rad]; held at its ends outside the IMU's times.
    Gives (n,)."""
    time = swing.imu_time + instrument.shift
    known = np.isfinite(swing.imu_angle)
    time, angle = time[known], (swing.imu_angle[known] - instrument.offset) / instrument.gain
    return CubicSpline(time, angle)(np.clip(swing.time, time[0], time[-1]))
