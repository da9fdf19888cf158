r"""The wearer's muscles: envelopes, a test of relaxation, and a linear map from envelopes to the knee's torque.

While the wearer holds against the actuator, the balances of both bodies give the torque of the knee:

.. math::
    \tau_k = m_{sh} g l_{sh}\sin\theta + m_e g l_e\sin\theta - \tau_e

(the thesis omits gravity). The torque is regressed on the envelopes and on their products with the angle. Better
estimators exist (``pellucid.emg.estimators``); here the torque only serves to show how far the limb's balance can be
trusted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError, RecordingError
from ...emg.signals.emg_chain import EmgChain
from ...emg.signals.emg_quality import relaxed_faults, resting_level
from ...files.recording import Recording
from ...numerics.filters import zero_phase_lowpass

ENVELOPE_SETTLING_S = 0.5
"""Envelopes have not settled for this time at either end of a recording [s]."""

TORQUE_LOWPASS_HZ = 2.0
"""Cut-off of the low-pass on the reference torque, equal to that of the envelopes."""

REGRESSION_RATE_HZ = 20.0
"""Rate of the samples that enter the regression."""


@dataclass(frozen=True, eq=False)
class Levels:
    """A wearer's envelopes at rest and in a maximal contraction, by muscle [V]."""

    rest: Mapping[str, float]
    maximum: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class MuscleTorque:
    """Torque of the knee as a linear function of envelopes and angle."""

    muscles: tuple[str, ...]
    # (2 k + 2,) coefficients of the relative envelopes, their products with the angle, 1, and the angle [N m, N m/rad]
    coefficients: np.ndarray
    levels: Levels
    # RMS error of the torque [N m]: by leave-one-repetition-out where there are several repetitions, else of the fit
    rmse: float

    def __call__(self, envelopes: Mapping[str, np.ndarray], angle: np.ndarray) -> np.ndarray:
        """Return the torque, shape (n,) [N m], from envelopes [V] and an `angle` [rad], each of shape (n,)."""
        return _columns(self.muscles, envelopes, self.levels, angle) @ self.coefficients


def envelopes(emg: Recording, chain: EmgChain) -> dict[str, np.ndarray]:
    """Return the zero-phase envelope of every muscle of a recording, each of shape (n,) [V]."""
    names = [name for name in emg.channels if name.startswith("emg.")]
    if not names:
        raise RecordingError(f"{emg.path.name}: found {', '.join(emg.channels)}, expected channels emg.<muscle>")
    chain.require_rate(emg.fs, f"{emg.path.name}, channel {names[0]}")
    return {name.removeprefix("emg."): chain.zero_phase(emg[name], emg.fs) for name in names}


def without_settling_ends(emg: Recording, made: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return envelopes without the ends of the recording, where the filters have not settled."""
    inside = (emg.time >= emg.time[0] + ENVELOPE_SETTLING_S) & (emg.time <= emg.time[-1] - ENVELOPE_SETTLING_S)
    return {muscle: envelope[inside] for muscle, envelope in made.items()}


def find_levels(maximal: Sequence[Recording], every: Sequence[Recording], chain: EmgChain) -> Levels:
    """Return a wearer's resting and maximal envelope of each muscle."""
    if not maximal:
        raise RecordingError(
            'found no recording of protocol "mvc", expected one: rest is judged relative to a maximal contraction'
        )
    strong = [without_settling_ends(r, envelopes(r, chain)) for r in maximal]
    resting = strong + [without_settling_ends(r, envelopes(r, chain)) for r in every]
    muscles = list(strong[0])
    return Levels(
        {m: resting_level([e[m] for e in resting]) for m in muscles},
        {m: max(float(np.max(e[m])) for e in strong) for m in muscles},
    )


def at_work(emg: Recording, chain: EmgChain, levels: Levels) -> str:
    """Return in one sentence why a recording was not relaxed, or an empty string if it was."""
    faults = relaxed_faults(emg, without_settling_ends(emg, envelopes(emg, chain)), levels.rest, levels.maximum)
    return "; ".join(fault.message for fault in faults)


def fit_muscle_torque(
    angles: Sequence[np.ndarray],
    torques: Sequence[np.ndarray],
    made: Sequence[Mapping[str, np.ndarray]],
    levels: Levels,
    fs: float,
    gravity: float,
) -> MuscleTorque:
    """Regress the knee's torque on envelopes and angle.

    Each repetition has an angle [rad], a torque [N m] and envelopes `made` [V] of shape (n,), sampled at `fs` [Hz].
    `gravity` is that of limb and orthosis together [N m].
    """
    muscles = tuple(levels.maximum)
    step = max(1, round(fs / REGRESSION_RATE_HZ))
    blocks, targets = [], []
    for angle, torque, envelope in zip(angles, torques, made, strict=True):
        angle, torque = zero_phase_lowpass(np.column_stack([angle, torque]), TORQUE_LOWPASS_HZ, 2, fs).T
        inside = slice(round(ENVELOPE_SETTLING_S * fs), len(angle) - round(ENVELOPE_SETTLING_S * fs), step)
        blocks.append(_columns(muscles, envelope, levels, angle)[inside])
        targets.append((gravity * np.sin(angle) - torque)[inside])
    if sum(len(t) for t in targets) < 10 * (2 * len(muscles) + 2):
        raise IdentificationError(
            f"found {sum(len(t) for t in targets)} samples of torque against EMG, expected ten for each of "
            f"{2 * len(muscles) + 2} coefficients"
        )
    found = _solve(blocks, targets)
    left_out = [
        b @ (_solve(blocks[:i] + blocks[i + 1 :], targets[:i] + targets[i + 1 :]) if len(blocks) > 1 else found) - t
        for i, (b, t) in enumerate(zip(blocks, targets, strict=True))
    ]
    return MuscleTorque(muscles, found, levels, float(np.sqrt(np.mean(np.concatenate(left_out) ** 2))))


def _columns(muscles, made: Mapping[str, np.ndarray], levels: Levels, angle: np.ndarray) -> np.ndarray:
    relative = np.column_stack([(made[m] - levels.rest[m]) / (levels.maximum[m] - levels.rest[m]) for m in muscles])
    return np.column_stack([relative, relative * angle[:, None], np.ones(len(angle)), angle])


def _solve(blocks: list[np.ndarray], targets: list[np.ndarray]) -> np.ndarray:
    return np.linalg.lstsq(np.vstack(blocks), np.concatenate(targets), rcond=None)[0]
