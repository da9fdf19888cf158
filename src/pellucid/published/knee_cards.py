"""What a wearer's compensator is built from: the identified coupling, the actuator's residual, and a causal EMG map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from .._errors import IdentificationError
from ..controllers.coupling import Coupling
from ..controllers.worn import EmgMap
from ..identification.actuator_residual import actuator_residual
from ..lab.knee_protocol import bench_trials, torque_trial
from ..lab.knee_rig import KneeRig
from ..lab.knee_trial import KneeTaken, run_trial

BAND, ENVELOPE = (30.0, 450.0), 4.0
"""Corners of the causal chain [Hz]: its envelope is 56 ms late, as muscles are some 50 ms."""

HELD_ANGLES = (0.0, 30.0, 60.0, 90.0)
"""At which the torque map is learnt [deg]."""


@dataclass(frozen=True)
class WearerCard:
    """One wearer in one orthosis.

    Attributes
    ----------
    coupling : Coupling
        Orthosis, actuator, strap and limb.
    emg : EmgMap
        From raw EMG to torque.
    emg_rmse : float
        Of the map, on the recordings that it was not fitted to [N m].
    """

    coupling: Coupling
    emg: EmgMap
    emg_rmse: float


def actuator_card(taken: Sequence[KneeTaken], rig: KneeRig) -> dict[str, float]:
    """The actuator's lag and what its torque loop lets through, from recordings of the orthosis alone.

    Parameters
    ----------
    taken : sequence of KneeTaken
        Sines.
    rig : KneeRig
        Of which only the sampling rate and the loop's dead time, which its maker states, are used.

    Returns
    -------
    dict of str to float
        By the names of `Coupling`.
    """
    found = actuator_residual([(t.command, t.torque, t.position, t.motor_position) for t in taken], 1 / rig.period)
    known = {field.name for field in fields(Coupling)}
    return {name: value for name, value in found.items() if name in known} | {
        "delay": rig["torque_loop"]["delay"] * rig.period
    }


def emg_card(taken: Sequence[KneeTaken], coupling: Coupling, *, ridge: float = 1e-3) -> tuple[EmgMap, float]:
    """A causal torque map, linear in envelopes and angle, from what the instruments wrote while angles were held.

    The muscles' torque is the limb's gravity less the strap's torque, which at rest is the orthosis's gravity less the
    spring's torque. Every third of a recording's seconds is held out for the error.

    Parameters
    ----------
    taken : sequence of KneeTaken
        Torque steps.
    coupling : Coupling
        Gravity of limb and orthosis, stiffness of the strap.
    ridge : float
        Penalty, as a share of the features' variance [1].

    Returns
    -------
    EmgMap
        As the core takes it; what is twice the largest envelope of these recordings is no muscle's.
    float
        Root mean square error on held-out seconds [N m].

    Raises
    ------
    IdentificationError
        If a recording has no EMG.
    """
    from scipy.signal import butter, sosfilt

    features, torques, levels, held = [], [], [], []
    band = envelope = None
    for t in taken:
        if t.emg is None or t.emg_time is None:
            raise IdentificationError(f"emg_card: {t.trial.name} has no EMG.")
        fs = 1 / float(np.median(np.diff(t.emg_time)))
        band = butter(2, BAND, "bandpass", fs=fs, output="sos")
        envelope = butter(2, ENVELOPE, fs=fs, output="sos")
        level = sosfilt(envelope, np.abs(sosfilt(band, t.emg * t.emg_quantum, axis=0)), axis=0)
        level = np.column_stack([np.interp(t.time, t.emg_time, column) for column in level.T])
        strap = coupling.orthosis_gravity * np.sin(t.position) - t.torque
        limb = t.position + strap / coupling.strap_stiffness
        kept = slice(round(2.0 / (t.time[1] - t.time[0])), None, 25)
        q, e = t.position[kept], level[kept]
        features.append(np.column_stack([np.ones_like(q), q, e[:, 0], e[:, 0] * q, e[:, 1], e[:, 1] * q]))
        torques.append((coupling.limb_gravity * np.sin(limb) - strap)[kept])
        levels.append(e)
        held.append(np.floor(t.time[kept]) % 3 == 2)
    x, y, out = np.vstack(features), np.concatenate(torques), np.concatenate(held)
    scale = np.append(1.0, x[:, 1:].std(axis=0))
    penalty = ridge * np.diag([0.0, 1, 1, 1, 1, 1])

    def fitted(rows: np.ndarray) -> np.ndarray:
        a = x[rows] / scale
        return np.linalg.solve(a.T @ a / len(a) + penalty, a.T @ y[rows] / len(a)) / scale

    error = float(np.sqrt(np.mean((y[out] - x[out] @ fitted(~out)) ** 2)))
    seen = np.vstack(levels)
    made = EmgMap(
        band, envelope, fitted(np.ones(len(y), bool)).reshape(3, 2), 0.2 * seen.min(axis=0), 2 * seen.max(axis=0)
    )
    return made, error


def simulated_cards(
    rig: KneeRig, subjects: Sequence[str], bodies: Mapping[str, Mapping[str, float]], seed: int
) -> dict[str, WearerCard]:
    """Cards of some wearers from recordings on the virtual orthosis.

    Parameters
    ----------
    rig : KneeRig
        The virtual orthosis.
    subjects : sequence of str
        Names in the rig.
    bodies : mapping of str to mapping
        Per subject what was identified of orthosis, limb and strap, SI, by the names of `Coupling`.
    seed : int
        Of the recordings.

    Returns
    -------
    dict of str to WearerCard
        By subject.
    """
    sines = [task for task in bench_trials(rig) if task[0].name in ("response_05", "response_10")]
    alone = [run_trial(rig, None, trial, rng=np.random.default_rng([seed, i])) for i, (trial, _) in enumerate(sines)]
    actuator = actuator_card(alone, rig)
    cards = {}
    for number, name in enumerate(subjects):
        coupling = Coupling.from_cards(actuator, bodies[name])
        steps = []
        for i, angle in enumerate(HELD_ANGLES):
            trial, wearer = torque_trial(rig, f"{name}_torque", rig.subjects[name], float(np.radians(angle)))
            steps.append(run_trial(rig, wearer, trial, rng=np.random.default_rng([seed, 100 + number, i])))
        cards[name] = WearerCard(coupling, *emg_card(steps, coupling))
    return cards
