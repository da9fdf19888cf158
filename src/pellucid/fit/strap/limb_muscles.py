r"""What the wearer's muscles do: envelopes, whether they rest, and a plain linear map to the knee's torque.

While the wearer holds against the actuator, both bodies' balances give the torque of the knee:

.. math::
    \tau_k = m_{sh} g l_{sh}\sin\theta + m_e g l_e\sin\theta - \tau_e

(the thesis leaves gravity out). It is regressed on the envelopes, and on envelopes times the angle. Better maps need
more than this layer knows; the coupling asks only how far the limb's side can be trusted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError, RecordingError
from ...recordings.recording import Recording
from ...signals.emg_chain import EmgChain
from ...signals.emg_quality import relaxed_faults, resting_level
from ...signals.filters import zero_phase_lowpass

SETTLED = 0.5
"""Seconds at either end of a recording at which an envelope has not settled."""
LOWPASS = 2.0
"""Of the reference torque, as of the envelopes [Hz]."""
RATE = 20.0
"""Samples a second that enter the regression."""


@dataclass(frozen=True, eq=False)
class Levels:
    """A wearer's envelopes at rest and in a maximal contraction, by muscle [V]."""

    rest: Mapping[str, float]
    maximum: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class MuscleTorque:
    """Torque of the knee as a linear function of envelopes and angle."""

    muscles: tuple[str, ...]
    # (2 k + 2,) Of each muscle's relative envelope, of the same times the angle, of 1 and of the angle [N m, N m/rad]
    coefficients: np.ndarray
    levels: Levels
    # Of the torques fitted, each repetition judged by a map fitted to the others where there are several [N m]
    rmse: float

    def __call__(self, envelopes: Mapping[str, np.ndarray], angle: np.ndarray) -> np.ndarray:
        """Torque, shape (n,) [N m], at envelopes and an `angle` of shape (n,) [V], [rad]."""
        return _columns(self.muscles, envelopes, self.levels, angle) @ self.coefficients


def envelopes(emg: Recording, chain: EmgChain) -> dict[str, np.ndarray]:
    """Zero-phase envelopes of every muscle of a stream. Gives (n,) [V]."""
    names = [name for name in emg.channels if name.startswith("emg.")]
    if not names:
        raise RecordingError(f"{emg.path.name}: found {', '.join(emg.channels)}, expected channels emg.<muscle>")
    chain.require_rate(emg.fs, f"{emg.path.name}, channel {names[0]}")
    return {name.removeprefix("emg."): chain.zero_phase(emg[name], emg.fs) for name in names}


def settled(emg: Recording, made: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Envelopes without the ends at which they have not settled. `made` (n,); gives (m,)."""
    inside = (emg.time >= emg.time[0] + SETTLED) & (emg.time <= emg.time[-1] - SETTLED)
    return {muscle: envelope[inside] for muscle, envelope in made.items()}


def find_levels(maximal: Sequence[Recording], every: Sequence[Recording], chain: EmgChain) -> Levels:
    """A wearer's resting and maximal envelopes."""
    if not maximal:
        raise RecordingError(
            'found no recording of protocol "mvc", expected one: what a muscle at rest is, is relative'
        )
    strong = [settled(r, envelopes(r, chain)) for r in maximal]
    resting = strong + [settled(r, envelopes(r, chain)) for r in every]
    muscles = list(strong[0])
    return Levels(
        {m: resting_level([e[m] for e in resting]) for m in muscles},
        {m: max(float(np.max(e[m])) for e in strong) for m in muscles},
    )


def at_work(emg: Recording, chain: EmgChain, levels: Levels) -> str:
    """Why a recording was not relaxed, in one sentence; empty where it was."""
    faults = relaxed_faults(emg, settled(emg, envelopes(emg, chain)), levels.rest, levels.maximum)
    return "; ".join(fault.message for fault in faults)


def fit_muscle_torque(
    angles: Sequence[np.ndarray],
    torques: Sequence[np.ndarray],
    made: Sequence[Mapping[str, np.ndarray]],
    levels: Levels,
    fs: float,
    gravity: float,
) -> MuscleTorque:
    """Regress the knee's torque on envelopes, repetition by repetition. `angles`, `torques` (n,) [rad], [N m];
    `made` (n,) [V]; `fs` [Hz]; `gravity` [N m]."""
    muscles = tuple(levels.maximum)
    step = max(1, round(fs / RATE))
    blocks, targets = [], []
    for angle, torque, envelope in zip(angles, torques, made, strict=True):
        angle, torque = zero_phase_lowpass(np.column_stack([angle, torque]), LOWPASS, 2, fs).T
        inside = slice(round(SETTLED * fs), len(angle) - round(SETTLED * fs), step)
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
