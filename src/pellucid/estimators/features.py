"""What a torque map sees of a trial: envelopes, earlier envelopes, joint angles and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from ..signals.filters import central_difference, zero_phase_lowpass
from .torque_trial import TorqueTrial

MOTION_LOWPASS = 6.0
"""Cut-off of the low-pass on joint angles before they are differentiated [Hz]: gait has little above."""

CAUSAL_LOWPASS = 12.0
"""The same for the causal form, of order 2: late by 19 ms instead of 37 ms, for somewhat more noise [Hz]."""

LAGS = (0.05, 0.1)
"""How much earlier envelopes are seen as well [s]: a muscle's force follows its EMG by 10 to 100 ms."""


@dataclass(frozen=True)
class FeatureSet:
    """Which features a map uses."""

    # The other joints' angles too: muscles cross two joints, and moments pass from one to the next
    neighbours: bool = False
    velocities: bool = False  # velocities, accelerations: Of every joint seen
    accelerations: bool = False
    lags: tuple[float, ...] = ()  # How much earlier envelopes are seen, beside the present ones [s]
    muscles: bool = True  # False: none, which shows what motion alone tells

    def __str__(self) -> str:
        parts = ["EMG"] if self.muscles else []
        parts += ["now and " + " and ".join(f"{1e3 * lag:.0f} ms" for lag in self.lags) + " ago"] if self.lags else []
        parts.append("angles" if self.neighbours else "the joint's angle")
        parts += ["velocities"] if self.velocities else []
        parts += ["accelerations"] if self.accelerations else []
        return ", ".join(parts)


def feature_sets(*, neighbours: bool, lags: bool | None = None, muscles: bool = True) -> tuple[FeatureSet, ...]:
    """The sets to choose from, the smallest first: with `neighbours`' angles or not, `lags` or not (None: both),
    `muscles`.
    """
    motions = [{}, {"velocities": True}, {"velocities": True, "accelerations": True}]
    if neighbours:
        motions = [{}, *({"neighbours": True, **motion} for motion in motions)]
    seen = {None: ((), LAGS), False: ((),), True: (LAGS,)}[lags if muscles else False]
    return tuple(FeatureSet(**motion, lags=each, muscles=muscles) for each in seen for motion in motions)


@dataclass(frozen=True, eq=False)
class Features:
    """A trial's features."""

    x: np.ndarray  # (n, k)
    names: tuple[str, ...]  # Of the columns
    motion: tuple[int, ...]  # Columns that are angles or their derivatives


def features(trial: TorqueTrial, chosen: FeatureSet, *, causal: bool = False) -> Features:
    """A trial's `chosen` features, `causal` ones from the past alone; its first value is taken to have lasted before
    it.
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
        q, v, a = derivatives(np.asarray(trial.angles[joint], float), fs, causal=causal)
        columns.append(q)
        names.append(f"angle.{joint}")
        if chosen.velocities:
            columns.append(v)
            names.append(f"velocity.{joint}")
        if chosen.accelerations:
            columns.append(a)
            names.append(f"acceleration.{joint}")
    return Features(np.column_stack(columns), tuple(names), tuple(range(first, len(columns))))


def derivatives(q: np.ndarray, fs: float, *, causal: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle `q` [rad] low-passed at `fs` [Hz], speed, acceleration, each of shape (n,); `causal`: of the past alone."""
    if not causal:
        q = zero_phase_lowpass(q, MOTION_LOWPASS, 4, fs)
        v = central_difference(q, fs)
        return q, v, central_difference(v, fs)
    sos = signal.butter(2, CAUSAL_LOWPASS, fs=fs, output="sos")
    # Started as if the first angle had lasted, so that there is no step to settle.
    q, _ = signal.sosfilt(sos, q, zi=signal.sosfilt_zi(sos) * q[0])
    v = fs * np.diff(q, prepend=q[0])
    return q, v, fs * np.diff(v, prepend=v[0])
