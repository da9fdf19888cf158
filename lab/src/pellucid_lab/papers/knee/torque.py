"""Torque of the knee from EMG on the virtual orthosis: Table 3.4's estimators, cross-validated over repetitions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pellucid.emg.estimators.cross_validation import Score, score
from pellucid.emg.estimators.torque_map import cross_validate_torque_maps
from pellucid.emg.estimators.torque_trial import MOTION_LOWPASS_HZ, MovedBody, TorqueTrial, human_torque
from pellucid.emg.signals.emg_chain import emg_chain
from pellucid.emg.study.emg_torque.emg_torque_table import EmgTorqueTable
from pellucid.orthosis.strap.orthosis_alone import strapped_torque
from pellucid.orthosis.strap.strap_model import Orthosis

from ...knee.recorded_session import KneeSession
from ...knee.rig import KneeRig
from .wearers import WearerIdentification

ESTIMATOR_NAMES = ("boost", "bagging", "tree", "ridge")
"""Table 3.4's three estimators, and a ridge regression as the simple baseline."""

PUBLISHED_ESTIMATOR_NAMES = ("boost_published", "bagging_published", "tree_published")
"""Table 3.4's three estimators with the defaults of the tool that the thesis used."""

STEP_PROTOCOLS = ("published", "both_ways")
"""The thesis's steps of 0, 5 and 10 N m in one direction, and these followed by the same in the other direction."""

SAMPLE_STEP = 5
"""Every fifth sample is kept, which is 100 a second."""


@dataclass(frozen=True, eq=False)
class ScoredMap:
    """One estimator on one subject's torque steps."""

    subject: str
    estimator: str
    protocol: str  # One of `STEP_PROTOCOLS`
    score: Score  # Score over all trials, each predicted without its repetition
    words: str  # Features and settings of the first repetition's map
    predicted: Mapping[str, np.ndarray] = field(repr=False)  # (n,) Predicted torque by trial [N m]


@dataclass(frozen=True, eq=False)
class TorqueSteps:
    """One subject's torque steps, prepared for EMG maps. Torques by trial have shape (n,) [N m]."""

    subject: str
    protocol: str  # One of `STEP_PROTOCOLS`
    trials: tuple[TorqueTrial, ...]  # Their torque is the knee's, from the models of orthosis, strap and limb
    actuator: Mapping[str, np.ndarray] = field(repr=False)  # Torque of the actuator's spring
    plain: Mapping[str, np.ndarray] = field(repr=False)  # Knee torque with the strap as a linear spring and damper
    as_one: Mapping[str, np.ndarray] = field(repr=False)  # Knee torque with a rigid strap
    true: Mapping[str, np.ndarray] = field(repr=False)  # True knee torque of muscles and ligaments in the simulation

    @property
    def targets(self) -> dict[str, np.ndarray]:
        """Torque that maps are fitted to and scored on, by trial, shape (n,) [N m]."""
        return {t.name: t.torque for t in self.trials}

    def true_error(self, predicted: Mapping[str, np.ndarray]) -> float:
        """Return the RMS error of predicted torques, by trial, against the knee's true ones [N m]."""
        return score(*(np.concatenate([t[n] for n in self.true]) for t in (self.true, predicted))).rmse


def torque_steps(rig: KneeRig, taken: KneeSession, orthosis: Orthosis, found: WearerIdentification) -> TorqueSteps:
    """Return a subject's torque steps with their EMG envelopes."""
    chain, kept = emg_chain(taken.config.table(EmgTorqueTable).chain), slice(None, None, SAMPLE_STEP)
    limb, coupling = found.stages.limb.limb, found.stages.coupling
    body = MovedBody(orthosis.gravity + limb.gravity, orthosis.inertia + limb.inertia, orthosis.viscous)
    trials, actuator, plain, as_one, true = [], {}, {}, {}, {}
    for r in taken.of("torque_steps"):
        emg, truth = r.streams["emg"], taken.truth[r.name]
        torque, plain[r.name] = (
            strapped_torque(
                r.time, r["position"], r["torque"], orthosis=orthosis, limb=limb, strap=strap, lowpass=MOTION_LOWPASS_HZ
            )[kept]
            for strap in (coupling.core, coupling.plain)
        )
        envelopes = {
            m: np.interp(r.time, emg.time, chain.zero_phase(emg[f"emg.{m}"], emg.fs))
            for m in taken.config.table(EmgTorqueTable).muscles
        }
        trials.append(
            TorqueTrial(
                name=r.name, joint="knee", time=r.time[kept], envelopes={m: e[kept] for m, e in envelopes.items()},
                angles={"knee": r["position"][kept]}, torque=torque, group=r.name.rsplit("_", 1)[-1],
                participant=r.participant,
            )
        )  # fmt: skip
        actuator[r.name] = r["torque"][kept]
        as_one[r.name] = human_torque(r["position"], r["torque"], body, lowpass=MOTION_LOWPASS_HZ, fs=r.fs)[kept]
        true[r.name] = (truth.muscle_torque + _ligaments(rig, truth.limb_position))[kept]
    return TorqueSteps(found.name, "both_ways", tuple(trials), actuator, plain, as_one, true)


def published_steps(steps: TorqueSteps, duration: float) -> TorqueSteps:
    """Return the thesis's own steps, which are the first `duration` [s] of every trial."""
    inside = {t.name: t.time < duration for t in steps.trials}
    trials = tuple(
        replace(
            t, time=t.time[i], torque=t.torque[i], envelopes={m: e[i] for m, e in t.envelopes.items()},
            angles={j: a[i] for j, a in t.angles.items()},
        )
        for t, i in ((t, inside[t.name]) for t in steps.trials)
    )  # fmt: skip
    parts = ({name: values[inside[name]] for name, values in of.items()} for of in
             (steps.actuator, steps.plain, steps.as_one, steps.true))  # fmt: skip
    return TorqueSteps(steps.subject, "published", trials, *parts)


def score_map(steps: TorqueSteps, estimator: str) -> ScoredMap:
    """Score one estimator; each repetition is predicted by a map that is chosen and fitted without it."""
    found = cross_validate_torque_maps(steps.trials, (estimator,))[estimator]
    return ScoredMap(steps.subject, estimator, steps.protocol, found.score, found.choices[0].words, found.predicted)


def _ligaments(rig: KneeRig, position: np.ndarray) -> np.ndarray:
    """Return the passive torque towards flexion at the end of extension, shape (n,) [N m]."""
    passive = rig["passive"]
    return passive["torque"] * np.exp(np.clip((passive["angle"] - position) / passive["scale"], -80.0, 5.0))
