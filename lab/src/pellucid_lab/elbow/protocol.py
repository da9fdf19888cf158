r"""Protocol of the virtual elbow: holds, constant velocities, the swept sine, slow movements, reversals.

The first three are the steps of the identification; the slow movements and unseen places validate it [1]_.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, sections 3.3 and 3.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellucid.numerics.protocols.excitation import REVERSALS_NAME, swept_sine

from ..fourier import optimised_fourier, play
from ..rig import Trial
from .machine import ElbowMachine

CONSTANT_SPEEDS_TURNS = (1.0, 3.5, 6.0, 8.5, 11.0)
"""Speeds of the constant-velocity movements [motor turns/s]."""

HOLD_COUNT = 20
"""Number of angles of a static trial."""

HOLD_DURATION_S = 5.0
"""Time for which each angle is held [s]."""

MOVE_DURATION_S = 1.0
"""Time in which the joint moves to the next angle [s]."""

SWEPT_SINE = {"duration": 25.0, "amplitude": 0.5, "start": 1.0, "growth": 3.0}
"""Parameters of equation 5: duration [s], amplitude [rad], first frequency and its growth [rad/s]."""

SLOW_MOVEMENT_COUNT = 10
"""Number of slow movements in either direction."""

SLOW_TRAVEL_RAD = 1.0
"""Travel of each slow movement [rad]."""

REVERSAL_AMPLITUDE_RAD = 0.15
"""Amplitude of the slow sines that show how friction reverses [rad]."""

REVERSAL_FREQUENCY_HZ = 0.05
"""Frequency of these sines [Hz]. At this frequency friction takes about a second to reverse."""

REVERSAL_PERIOD_COUNT = 3.0
"""Number of periods of these sines."""

REVERSAL_PLACES = (1 / 3, 2 / 3)
"""Centres of these sines, as shares of the joint's range [1]."""

TRAVEL_MARGIN_RAD = 0.1
"""Distance between the ends of the range and those of constant-velocity movements [rad]."""

REST_DURATION_S = 0.4
"""Duration of the rest between two movements [s]."""

RAMP_ACCELERATION = 20.0
"""Acceleration with which a constant velocity is reached [rad/s^2]."""


@dataclass(frozen=True)
class ElbowTrial(Trial):
    """One recording of the elbow; its `reference` is an angle [rad] or a velocity [rad/s], as `loop` says."""

    loop: str = "position"  # "position" or "velocity": the controller, and the quantity of the reference
    start: float = 0.0  # first angle of the joint [rad]
    slider: float = 0.0  # place at which the carriage is clamped [m]


def fitted_sliders(rig: ElbowMachine) -> np.ndarray:
    """Six positions of the carriage, equally spaced over the rail, shape (6,) [m]."""
    return np.linspace(rig.constants.slider.low, rig.constants.slider.high, 6)


def unseen_sliders(rig: ElbowMachine) -> np.ndarray:
    """Six positions between the fitted ones, shape (6,) [m]: the five midpoints, and one a quarter of a step in."""
    fitted = fitted_sliders(rig)
    step = fitted[1] - fitted[0]
    return np.append(fitted[:-1] + 0.5 * step, fitted[0] + 0.25 * step)


def holds(rig: ElbowMachine) -> tuple[np.ndarray, float]:
    """Angles equally spaced over the range, in an order that comes from both sides; reference [rad] and start [rad]."""
    span, fs = rig.constants.range, rig.constants.sampling.rate
    angles = np.linspace(span.low, span.high, HOLD_COUNT)
    # Every seventh of twenty visits each once, and arrives from below about as often as from above.
    order = angles[(7 * np.arange(HOLD_COUNT)) % HOLD_COUNT]
    s = np.arange(round(MOVE_DURATION_S * fs)) / (MOVE_DURATION_S * fs)
    ease = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    parts, at = [], order[0]
    for angle in order:
        parts += [at + (angle - at) * ease, np.full(round(HOLD_DURATION_S * fs), angle)]
        at = angle
    return np.concatenate(parts), float(order[0])


def _one_way(speed: float, travel: float, fs: float) -> np.ndarray:
    """Return the velocity of one movement over a travel [rad], a trapezoid with a rest after it [rad/s]."""
    ramp = max(round(speed / RAMP_ACCELERATION * fs), 1)
    flat = max(round((travel / speed - ramp / fs) * fs), 1)
    up = speed * (np.arange(ramp) + 0.5) / ramp
    return np.concatenate([up, np.full(flat, speed), up[::-1], np.zeros(round(REST_DURATION_S * fs))])


def constant_velocities(rig: ElbowMachine) -> tuple[np.ndarray, float]:
    """Return the velocity reference [rad/s] of movements up and down at each speed, and its start [rad]."""
    span, fs = rig.constants.range, rig.constants.sampling.rate
    travel = span.high - span.low - 2.0 * TRAVEL_MARGIN_RAD
    parts = [np.zeros(round(REST_DURATION_S * fs))]
    for turns in CONSTANT_SPEEDS_TURNS:
        one = _one_way(2.0 * np.pi * turns / rig.constants.motor.gear_ratio, travel, fs)
        parts += [one, -one]
    return np.concatenate(parts), span.low + TRAVEL_MARGIN_RAD


def slow_movements(rig: ElbowMachine) -> tuple[np.ndarray, float]:
    """Return the velocity [rad/s] of slow movements up and down at one motor turn a second, and its start [rad]."""
    span, fs = rig.constants.range, rig.constants.sampling.rate
    one = _one_way(2.0 * np.pi / rig.constants.motor.gear_ratio, SLOW_TRAVEL_RAD, fs)
    rest = np.zeros(round(REST_DURATION_S * fs))
    return np.concatenate([rest, *([one, -one] * SLOW_MOVEMENT_COUNT)]), 0.5 * (span.low + span.high - SLOW_TRAVEL_RAD)


def sweep(rig: ElbowMachine, *, literal: bool) -> tuple[np.ndarray, float]:
    """Return the velocity [rad/s] of equation 5 in the middle of the range, and its start [rad].

    The equation is `literal`, as printed, or has its phase integrated.
    """
    span, fs = rig.constants.range, rig.constants.sampling.rate
    _, velocity, _ = swept_sine(fs=fs, literal=literal, **SWEPT_SINE)
    rest = np.zeros(round(REST_DURATION_S * fs))
    return np.concatenate([rest, velocity, rest]), 0.5 * (span.low + span.high)


def reversals(rig: ElbowMachine, place: float) -> tuple[np.ndarray, float]:
    """Return the angle [rad] of a slow sine about a place of the range, a share of it, and its start [rad]."""
    span, fs, w = rig.constants.range, rig.constants.sampling.rate, 2.0 * np.pi * REVERSAL_FREQUENCY_HZ
    time = np.arange(round(REVERSAL_PERIOD_COUNT / REVERSAL_FREQUENCY_HZ * fs)) / fs
    reference = span.low + place * (span.high - span.low) + REVERSAL_AMPLITUDE_RAD * np.cos(w * time)
    return reference, float(reference[0])


def trials(rig: ElbowMachine, fourier: Callable[[ElbowMachine], np.ndarray] | None = None) -> tuple[ElbowTrial, ...]:
    """Return three steps and slow movements at six places of the carriage, 18 unseen trials, and reversals.

    Where `fourier` is given, it makes the angle reference [rad] of further trials.
    """
    static, cv, slow = holds(rig), constant_velocities(rig), slow_movements(rig)
    printed, integrated = sweep(rig, literal=True), sweep(rig, literal=False)
    made: list[ElbowTrial] = []

    def add(protocol: str, use: str, loop: str, motion: tuple[np.ndarray, float], sliders: np.ndarray, tag: str):
        for i, x in enumerate(sliders):
            place: dict[str, Any] = {"reference": motion[0], "loop": loop, "start": motion[1], "slider": float(x)}
            made.append(ElbowTrial(f"{tag}_{i + 1}", protocol, use, **place))

    fitted, unseen = fitted_sliders(rig), unseen_sliders(rig)
    add("static", "fit", "position", static, fitted, "static")
    add("constant_velocity", "fit", "velocity", cv, fitted, "constant")
    add("swept_sine", "fit", "velocity", printed, fitted, "sweep")
    if fourier is not None:
        reference = fourier(rig)
        add("fourier", "fit", "position", (reference, float(reference[0])), fitted, "fourier")
    add("slow", "validate", "velocity", slow, fitted, "slow")
    add("swept_sine_integrated", "validate", "velocity", integrated, fitted, "sweep_integrated")
    add("constant_velocity", "validate", "velocity", cv, unseen, "unseen_constant")
    add("swept_sine", "validate", "velocity", printed, unseen, "unseen_sweep")
    add("slow", "validate", "velocity", slow, unseen, "unseen_slow")
    for i, place in enumerate(REVERSAL_PLACES):
        made.append(_reversals(rig, place, f"reversals_{i + 1}"))
    return tuple(made)


def _reversals(rig: ElbowMachine, place: float, name: str) -> ElbowTrial:
    """Return a reversal trial with the carriage in the middle of its rail; its place does not matter for friction."""
    reference, start = reversals(rig, place)
    middle = 0.5 * (rig.constants.slider.low + rig.constants.slider.high)
    return ElbowTrial(name, REVERSALS_NAME, "fit", reference=reference, loop="position", start=start, slider=middle)


def excitation(rig: ElbowMachine) -> np.ndarray:
    """A Fourier motion optimised for what the coherent body's parameters show in, shape (n,) [rad]."""
    span, fs = rig.constants.range, rig.constants.sampling.rate

    def regressor(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        sign = np.tanh(v / 0.05)
        up, down = sign * (v > 0.0), sign * (v <= 0.0)
        return np.column_stack([a, np.sin(q), np.cos(q), up, down, v * (v > 0.0), v * (v <= 0.0)])

    # Half of what the drive allows: a wearer's forearm will be in it.
    series = optimised_fourier(
        regressor,
        fundamental=0.1,
        harmonics=8,
        low=span.low + 0.05,
        high=span.high - 0.05,
        velocity=0.5 * span.velocity,
        acceleration=0.5 * span.acceleration,
        scales=np.array([0.05, 2.0, 0.3, 0.3, 0.3, 0.1, 0.1]),
        rng=np.random.default_rng(7),
    )
    return play(series, 40.0, fs, velocity=span.velocity, acceleration=span.acceleration)
