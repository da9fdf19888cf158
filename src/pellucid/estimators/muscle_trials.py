"""Trials as the muscles of a joint see them: envelopes, lengths, rates and moment arms, one trial after another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .._errors import IdentificationError
from ..fit.muscles.muscle_calibration import MuscleSamples
from ..models.hill import HillData, HillMuscle
from .features import derivatives
from .muscle_faults import refuse_unfit
from .torque_trial import TorqueTrial

WARM = 0.3
"""Beginning of a trial that is not fitted [s]: what EMG was before it is not known, and muscles remember."""


def driven_muscles(trials: Sequence[TorqueTrial]) -> tuple[HillMuscle, ...]:
    """Muscles of the trials' joint that EMG drives, with their anatomical values."""
    first = trials[0]
    if first.muscles is None:
        raise IdentificationError(
            f"trial {first.name}: found no lengths of muscles across the {first.joint}, expected streams length, "
            "lengthening and moment_arm, or a joint of the leg's model"
        )
    found = [t.muscles.driven(t.joint, t.envelopes) for t in trials]
    if not found[0] or any(each != found[0] for each in found):
        raise IdentificationError(
            f"trials {', '.join(t.name for t in trials)}: found EMG of {', '.join(first.envelopes)}, expected in each "
            f"trial the same muscles across the {first.joint}"
        )
    if not first.muscles.relative:
        raise IdentificationError(
            f"trial {first.name}: found envelopes in V, expected them relative to a maximal contraction: a chain in "
            '[emg_torque] that normalises, and a recording with the protocol "mvc"'
        )
    refuse_unfit(trials)
    return tuple(first.muscles.constants[name] for name in found[0])


def muscle_samples(
    trials: Sequence[TorqueTrial], *, muscles: Sequence[str], effort: float = 1.0, causal: bool = False
) -> tuple[MuscleSamples, list[slice]]:
    """Samples of several trials, and where each trial's own lie in them."""
    fs = float(np.mean([t.fs for t in trials]))
    worst = max(trials, key=lambda t: abs(t.fs - fs))
    # A lag is in seconds: a few percent of another rate are a few percent of it, less than what is known.
    if abs(worst.fs - fs) > 0.15 * fs:
        raise IdentificationError(f"trial {worst.name}: found {worst.fs:.4g} Hz, expected about {fs:.4g} Hz as others")
    parts, own, starts, at = [], [], [], 0
    for trial in trials:
        part, lead = _one(trial, muscles, causal)
        starts.append(at)
        own.append(slice(at + lead, at + len(part["torque"])))
        at += len(part["torque"])
        parts.append(part)
    joined = {key: np.concatenate([part[key] for part in parts], axis=-1) for key in parts[0]}
    data = HillData(
        effort * joined["excitation"], joined["length"], joined["rate"], joined["moment_arm"], 1.0 / fs, tuple(starts)
    )
    return MuscleSamples(data, joined["torque"], joined["angle"], joined["speed"], joined["weight"]), own


def warm(trial: TorqueTrial) -> int:
    """Samples at a trial's beginning that no estimator is compared on."""
    lead = len(next(iter(trial.lead.values()))) if trial.lead else 0
    return max(0, round(WARM * trial.fs) - lead)


def _one(trial: TorqueTrial, muscles: Sequence[str], causal: bool) -> tuple[Mapping[str, np.ndarray], int]:
    lead = len(next(iter(trial.lead.values()))) if trial.lead else 0
    moved = {name: derivatives(np.asarray(q, float), trial.fs, causal=causal)[:2] for name, q in trial.angles.items()}
    # A filter is late; the angle itself is not.
    angles = {name: np.asarray(trial.angles[name], float) if causal else q for name, (q, _) in moved.items()}
    rates = {name: v for name, (_, v) in moved.items()}
    driven = trial.muscles.driven(trial.joint, trial.envelopes)
    paths = [trial.muscles.path(m, trial.joint, angles, rates) for m in muscles]
    excitation = [
        np.mean([np.concatenate((trial.lead.get(c, ()), trial.envelopes[c])) for c in driven[m]], axis=0)
        for m in muscles
    ]
    weight = np.ones(len(trial))
    weight[: warm(trial)] = 0.0

    def lasting(x: np.ndarray) -> np.ndarray:
        return np.concatenate((np.full(lead, x[0]), x))

    return {
        "excitation": np.array(excitation),
        "length": np.array([lasting(p[0]) for p in paths]),
        "rate": np.array([lasting(p[1]) for p in paths]),
        "moment_arm": np.array([lasting(p[2]) for p in paths]),
        "torque": lasting(trial.torque),
        "angle": lasting(angles[trial.joint]),
        "speed": lasting(rates[trial.joint]),
        "weight": np.concatenate((np.zeros(lead), weight)),
    }, lead
