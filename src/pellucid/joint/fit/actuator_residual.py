"""Residual motor and gear effects behind an actuator's torque loop, from recordings of commands and torques."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._errors import IdentificationError


def actuator_residual(
    recordings: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]], fs: float, *, cutoff: float = 20.0
) -> dict[str, float]:
    """Estimate the inertia and friction that reach the spring, the loop's natural frequency, and its leak rate.

    With e = command - torque, K the spring and the motor's angle q_m = q + torque/K, a motor under proportional,
    integral and rate feedback of the spring's torque has

        e + leak integral(e) = J a_m + b v_m + F sign(v_m) + c dtorque/dt + constant.

    With the orthosis held, torque follows the command with w^2 = K/J and 2 zeta w = b/J + c K/J. Every signal goes
    through the same zero-phase low-pass. The leak is found by a line search, the other parameters by least squares.

    Each of `recordings` has command [N m], torque [N m], joint position [rad] and motor angle [rad], each (n,); `fs`
    and `cutoff` are in [Hz]. The results are in [kg m^2], [N m s/rad], [N m], [1/s], [rad/s], 1, [N m/rad] and 1.
    """
    from scipy.optimize import minimize_scalar
    from scipy.signal import butter, sosfiltfilt

    sos = butter(4, cutoff, fs=fs, output="sos")
    kept, spring = [], []
    for command, torque, position, motor in recordings:
        e, q = sosfiltfilt(sos, np.asarray(command) - torque), sosfiltfilt(sos, motor)
        rate = np.gradient(sosfiltfilt(sos, torque), 1 / fs)
        spring.append((np.asarray(motor) - position, np.asarray(torque)))
        v = np.gradient(q, 1 / fs)
        edge = round(fs / 2)
        window = slice(edge, len(q) - edge)
        kept.append((e[window], np.cumsum(e)[window] / fs, v[window], np.gradient(v, 1 / fs)[window], rate[window]))
    moving = [np.abs(v) > 0.05 * np.abs(v).max() for _, _, v, _, _ in kept]
    if sum(m.sum() for m in moving) < 2 * fs:
        raise IdentificationError(
            f"actuator_residual: the joint moves in {sum(m.sum() for m in moving) / fs:.1f} s, expected at least 2 s."
        )
    columns, now, summed = [], [], []
    for i, ((e, total, v, a, rate), m) in enumerate(zip(kept, moving, strict=True)):
        constants = np.zeros((m.sum(), len(kept)))
        constants[:, i] = 1
        columns.append(np.column_stack([a[m], v[m], np.sign(v[m]), rate[m], constants]))
        now.append(e[m])
        summed.append(total[m])
    x, e, total = np.vstack(columns), np.concatenate(now), np.concatenate(summed)

    def rest(leak: float) -> tuple[float, np.ndarray]:
        y = e + leak * total
        beta = np.linalg.lstsq(x, y, rcond=None)[0]
        return float(np.sum((y - x @ beta) ** 2) / np.sum((y - y.mean()) ** 2)), beta

    leak = float(minimize_scalar(lambda c: rest(c)[0], bounds=(0.0, 8.0), method="bounded").x)
    share, beta = rest(leak)
    inertia, viscous, coulomb, feedback = (float(b) for b in np.maximum(beta[:4], 0.0))
    deflection, torque = (np.concatenate(parts) for parts in zip(*spring, strict=True))
    stiffness = float(deflection @ torque / (deflection @ deflection))
    frequency = np.sqrt(stiffness / max(inertia, 1e-9))
    return {
        "actuator_inertia": inertia,
        "actuator_viscous": viscous,
        "actuator_coulomb": coulomb,
        "actuator_leak": leak,
        "actuator_frequency": float(frequency),
        "actuator_damping": float((viscous + feedback * stiffness) / (2 * max(inertia, 1e-9) * frequency)),
        "spring_stiffness": stiffness,
        "actuator_fit": 1 - share,
    }
