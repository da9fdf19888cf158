r"""What the virtual elbow is asked to do: holds, constant velocities, the swept sine, slow movements, reversals.

The first three are the steps of the identification, the last two and the slow movements its validation [1]_.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, sections 3.3 and 3.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...protocols.fourier import optimised_fourier, play
from ...protocols.reversals import REVERSALS_NAME
from ...protocols.swept_sine import swept_sine
from ..rig import Trial
from .machine import ElbowMachine

SPEEDS = (1.0, 3.5, 6.0, 8.5, 11.0)
"""Of the constant velocities [motor turns/s]."""

HOLDS, HOLD_TIME, MOVE_TIME = 20, 5.0, 1.0
"""Angles of a static trial, how long each is held, and how long the way to it takes [s]."""

SWEEP = {"duration": 25.0, "amplitude": 0.5, "start": 1.0, "growth": 3.0}
"""Equation 5: [s], [rad], [rad/s], [rad/s]."""

SLOW_MOVES, SLOW_TRAVEL = 10, 1.0
"""Slow movements in either direction, and how far each goes [rad]."""

TURNS = {"amplitude": 0.15, "frequency": 0.05, "periods": 3.0, "places": (1 / 3, 2 / 3)}
"""Slow motions that turn round: [rad], [Hz], and where in the range. Friction then takes a second to change over."""

TRAVEL_MARGIN = 0.1  # rad: between the range's ends and where constant velocities turn round
DWELL = 0.4  # s: rest between two movements
RAMP = 20.0  # rad/s^2: how fast a constant velocity is reached


@dataclass(frozen=True)
class ElbowTrial(Trial):
    """One recording of the elbow. `name`, `protocol`, `use`, `participant`, `condition`, `reference` [rad or rad/s]."""

    loop: str = "position"  # "position" or "velocity": which controller, and what the reference is
    start: float = 0.0  # Where the joint is at first [rad]
    slider: float = 0.0  # Where the carriage is clamped [m]


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
    angles = np.linspace(span.low, span.high, HOLDS)
    # Every seventh of twenty visits each once, and arrives from below about as often as from above.
    order = angles[(7 * np.arange(HOLDS)) % HOLDS]
    s = np.arange(round(MOVE_TIME * fs)) / (MOVE_TIME * fs)
    ease = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    parts, at = [], order[0]
    for angle in order:
        parts += [at + (angle - at) * ease, np.full(round(HOLD_TIME * fs), angle)]
        at = angle
    return np.concatenate(parts), float(order[0])


def _one_way(speed: float, travel: float, fs: float) -> np.ndarray:
    """Velocity of one movement, trapezoid, with a rest after it [rad/s]."""
    ramp = max(round(speed / RAMP * fs), 1)
    flat = max(round((travel / speed - ramp / fs) * fs), 1)
    up = speed * (np.arange(ramp) + 0.5) / ramp
    return np.concatenate([up, np.full(flat, speed), up[::-1], np.zeros(round(DWELL * fs))])


def constant_velocities(rig: ElbowMachine) -> tuple[np.ndarray, float]:
    """Up and down at each speed; velocity reference [rad/s] and start [rad]."""
    span, fs = rig.constants.range, rig.constants.sampling.rate
    travel = span.high - span.low - 2.0 * TRAVEL_MARGIN
    parts = [np.zeros(round(DWELL * fs))]
    for turns in SPEEDS:
        one = _one_way(2.0 * np.pi * turns / rig.constants.motor.gear_ratio, travel, fs)
        parts += [one, -one]
    return np.concatenate(parts), span.low + TRAVEL_MARGIN


def slow_movements(rig: ElbowMachine) -> tuple[np.ndarray, float]:
    """Ten slow movements up and ten down, at one motor turn a second; velocity [rad/s] and start [rad]."""
    span, fs = rig.constants.range, rig.constants.sampling.rate
    one = _one_way(2.0 * np.pi / rig.constants.motor.gear_ratio, SLOW_TRAVEL, fs)
    rest = np.zeros(round(DWELL * fs))
    return np.concatenate([rest, *([one, -one] * SLOW_MOVES)]), 0.5 * (span.low + span.high - SLOW_TRAVEL)


def sweep(rig: ElbowMachine, *, literal: bool) -> tuple[np.ndarray, float]:
    """Equation 5 about the middle of the range, as printed or phase-integrated; velocity [rad/s] and start [rad]."""
    span, fs = rig.constants.range, rig.constants.sampling.rate
    _, velocity, _ = swept_sine(fs=fs, literal=literal, **SWEEP)
    rest = np.zeros(round(DWELL * fs))
    return np.concatenate([rest, velocity, rest]), 0.5 * (span.low + span.high)


def reversals(rig: ElbowMachine, place: float) -> tuple[np.ndarray, float]:
    """To and fro about a place of the range, slowly; position reference [rad] and start [rad]."""
    span, fs, w = rig.constants.range, rig.constants.sampling.rate, 2.0 * np.pi * TURNS["frequency"]
    time = np.arange(round(TURNS["periods"] / TURNS["frequency"] * fs)) / fs
    reference = span.low + place * (span.high - span.low) + TURNS["amplitude"] * np.cos(w * time)
    return reference, float(reference[0])


def trials(rig: ElbowMachine, fourier: Callable[[ElbowMachine], np.ndarray] | None = None) -> tuple[ElbowTrial, ...]:
    """Three steps and slow movements at six positions of the carriage, 18 unseen trials, and reversals; with the
    position reference [rad] that `fourier` gives for a `rig`, if it is given."""
    static, cv, slow = holds(rig), constant_velocities(rig), slow_movements(rig)
    printed, integrated = sweep(rig, literal=True), sweep(rig, literal=False)
    made = []

    def add(protocol: str, use: str, loop: str, motion: tuple[np.ndarray, float], sliders: np.ndarray, tag: str):
        for i, x in enumerate(sliders):
            place = {"reference": motion[0], "loop": loop, "start": motion[1], "slider": float(x)}
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
    for i, place in enumerate(TURNS["places"]):
        made.append(_reversals(rig, place, f"reversals_{i + 1}"))
    return tuple(made)


def _reversals(rig: ElbowMachine, place: float, name: str) -> ElbowTrial:
    """The carriage in the middle of its rail: where it is changes nothing of what is looked for."""
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
