r"""Reference trajectories that show a joint's parameters.

Multisines follow the finite Fourier series that is standard in robot identification [1]_; `point_to_point` moves with
bounded acceleration between random targets, so that inertia shows while the velocity changes and friction while it does
not [2]_.

.. [1] J. Swevers, C. Ganseman, D. B. Tukel, J. De Schutter, H. Van Brussel, "Optimal robot excitation and
   identification", IEEE Trans. Robot. Autom. 13, 1997.
.. [2] M. Gautier, "Dynamic identification of robots with power model", Proc. IEEE ICRA, 1997.
"""

from __future__ import annotations

import numpy as np


def multisine(
    duration: float,
    fs: float,
    *,
    fundamental: float,
    harmonics: int,
    amplitude: float,
    centre: float,
    rng: np.random.Generator,
) -> np.ndarray:
    r"""Return a periodic position, shape (n,): harmonics with random phases and amplitudes falling as 1 / harmonic.

    .. math::  q(t) = q_0 + \sum_k \frac{A}{k} \sin(2\pi k f_0 t + \phi_k)

    scaled so that the largest excursion from the centre is `amplitude`, and eased in over half a period so that it
    starts at rest.

    `duration`, `fs` [s], [Hz]; `fundamental` [Hz]; `amplitude`, `centre` [rad or m]; gives (n,) [rad or m].
    """
    time = np.arange(round(duration * fs)) / fs
    order = np.arange(1, harmonics + 1)
    phases = rng.uniform(0.0, 2.0 * np.pi, harmonics)
    shape = np.sin(2.0 * np.pi * fundamental * time[:, None] * order + phases) @ (1.0 / order)
    ease = np.clip(time * 2.0 * fundamental, 0.0, 1.0)
    ease = ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
    return centre + amplitude * ease * shape / np.abs(shape).max()


def point_to_point(
    duration: float,
    fs: float,
    *,
    low: float,
    high: float,
    velocity: float,
    acceleration: float,
    dwell: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return a position, shape (n,), that moves between random targets with trapezoidal velocity and rests at each.

    `duration`, `fs` [s], [Hz]; `low`, `high` [rad or m]; `velocity`, `acceleration` [rad/s or m/s; per second];
    `dwell` [s]; gives (n,) [rad or m].
    """
    n = round(duration * fs)
    pieces, here, filled = [np.full(round(dwell * fs), 0.5 * (low + high))], 0.5 * (low + high), round(dwell * fs)
    while filled < n:
        target = rng.uniform(low, high)
        # A move shorter than a fifth of the range shows little: take the far end instead.
        if abs(target - here) < 0.2 * (high - low):
            target = high if here < 0.5 * (low + high) else low
        move = trapezoid(target - here, velocity * rng.uniform(0.2, 1.0), acceleration, fs)
        pieces += [here + move, np.full(round(dwell * fs), target)]
        filled += len(move) + round(dwell * fs)
        here = target
    return np.concatenate(pieces)[:n]


def trapezoid(distance: float, velocity: float, acceleration: float, fs: float) -> np.ndarray:
    """Return a move from rest to rest with constant velocity between constant accelerations, (n,) [rad or m].

    `distance` [rad or m]; `velocity`, `acceleration` [rad/s or m/s; per second]; `fs` [Hz].
    """
    size = abs(distance)
    velocity = min(velocity, np.sqrt(size * acceleration))
    ramp = velocity / acceleration
    total = size / velocity + ramp
    time = np.arange(1, round(total * fs) + 1) / fs
    rising = 0.5 * acceleration * np.minimum(time, ramp) ** 2
    cruising = velocity * np.clip(time - ramp, 0.0, total - 2.0 * ramp)
    braking = np.clip(time - (total - ramp), 0.0, ramp)
    return np.sign(distance) * np.minimum(
        rising + cruising + velocity * braking - 0.5 * acceleration * braking**2, size
    )
