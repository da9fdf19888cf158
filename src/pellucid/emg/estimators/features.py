"""Features of a trial for torque maps: envelopes, earlier envelopes, joint angles and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from ...numerics.filters import central_difference, zero_phase_lowpass
from .torque_trial import TorqueTrial

MOTION_LOWPASS_HZ = 6.0
"""Cut-off of the low-pass on joint angles before they are differentiated [Hz]. Gait has little power above it."""

CAUSAL_MOTION_LOWPASS_HZ = 12.0
"""Cut-off of the causal low-pass on joint angles, of order 2 [Hz].

Its delay is 19 ms, where 6 Hz would have 37 ms; in exchange, it passes somewhat more noise.
"""

ENVELOPE_LAGS_S = (0.05, 0.1)
"""Lags of the earlier envelopes among the features [s]. A muscle's force follows its EMG by 10 to 100 ms."""


@dataclass(frozen=True)
class FeatureSet:
    """A set of features that a map uses."""

    # Whether it holds the other joints' angles: muscles cross two joints, and moments pass from one to the next
    neighbours: bool = False
    velocities: bool = False  # Whether it holds the velocity of every joint in it
    accelerations: bool = False  # Whether it holds the acceleration of every joint in it
    lags: tuple[float, ...] = ()  # Lags of the earlier envelopes, beside the present ones [s]
    muscles: bool = True  # Whether it holds EMG; without it, a map shows what motion alone can predict

    def __str__(self) -> str:
        parts = ["EMG"] if self.muscles else []
        parts += ["now and " + " and ".join(f"{1e3 * lag:.0f} ms" for lag in self.lags) + " ago"] if self.lags else []
        parts.append("angles" if self.neighbours else "the joint's angle")
        parts += ["velocities"] if self.velocities else []
        parts += ["accelerations"] if self.accelerations else []
        return ", ".join(parts)


def list_feature_sets(*, neighbours: bool, lags: bool | None = None, muscles: bool = True) -> tuple[FeatureSet, ...]:
    """Return the feature sets to choose from, the smallest first.

    `neighbours`: whether sets with the other joints' angles are among them. `lags`: whether sets hold earlier
    envelopes; None: some do. `muscles`: whether sets hold EMG.
    """
    motions = [{}, {"velocities": True}, {"velocities": True, "accelerations": True}]
    if neighbours:
        motions = [{}, *({"neighbours": True, **motion} for motion in motions)]
    seen = {None: ((), ENVELOPE_LAGS_S), False: ((),), True: (ENVELOPE_LAGS_S,)}[lags if muscles else False]
    return tuple(FeatureSet(**motion, lags=each, muscles=muscles) for each in seen for motion in motions)


@dataclass(frozen=True, eq=False)
class Features:
    """Features of a trial."""

    x: np.ndarray  # Values, shape (n, k)
    names: tuple[str, ...]  # Names of the columns
    motion: tuple[int, ...]  # Indices of the columns that are angles or their derivatives


def compute_features(trial: TorqueTrial, chosen: FeatureSet, *, causal: bool = False) -> Features:
    """Return a trial's features of the `chosen` set.

    `causal` features use the past alone. Before the trial, every signal is taken to have its first value.
    """
    fs, columns, names = trial.fs, [], []
    for muscle, envelope in trial.envelopes.items() if chosen.muscles else ():
        for lag in (0.0, *chosen.lags):
            late = min(round(lag * fs), len(envelope))
            columns.append(np.concatenate((np.full(late, envelope[0]), envelope[: len(envelope) - late])))
            names.append(f"emg.{muscle}" + (f" {1e3 * lag:.0f} ms ago" if lag else ""))
    first = len(columns)
    joints = [trial.joint, *(j for j in trial.angles if j != trial.joint)] if chosen.neighbours else [trial.joint]
    for joint in joints:
        q, v, a = filter_and_differentiate(np.asarray(trial.angles[joint], float), fs, causal=causal)
        columns.append(q)
        names.append(f"angle.{joint}")
        if chosen.velocities:
            columns.append(v)
            names.append(f"velocity.{joint}")
        if chosen.accelerations:
            columns.append(a)
            names.append(f"acceleration.{joint}")
    return Features(np.column_stack(columns), tuple(names), tuple(range(first, len(columns))))


def filter_and_differentiate(q: np.ndarray, fs: float, *, causal: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return an angle low-passed [rad], its velocity and its acceleration, each of shape (n,).

    `q` is the angle, shape (n,) [rad], sampled at `fs` [Hz]. `causal` filters use the past alone.
    """
    if not causal:
        q = zero_phase_lowpass(q, MOTION_LOWPASS_HZ, 4, fs)
        v = central_difference(q, fs)
        return q, v, central_difference(v, fs)
    sos = signal.butter(2, CAUSAL_MOTION_LOWPASS_HZ, fs=fs, output="sos")
    # The filter starts as if the first angle had lasted, so that no step has to settle.
    q, _ = signal.sosfilt(sos, q, zi=signal.sosfilt_zi(sos) * q[0])
    v = fs * np.diff(q, prepend=q[0])
    return q, v, fs * np.diff(v, prepend=v[0])
