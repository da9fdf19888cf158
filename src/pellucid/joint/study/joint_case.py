"""Input of the findings of a joint, and what several of them ask: wearers, unstated payloads, advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...files.defects import echoed, worn
from ...files.fault import Fault
from ...files.quantity import quantity_of
from ...files.recording import Recording
from ...models.causes import Cause
from ...models.estimates import Parameter
from ...models.friction_terms import TERMS
from ...numerics.motion import Motion
from ...numerics.regression import Stack, regression_rows, stack
from ...numerics.uncertainty import sandwich_covariance
from ...study.drive_channel import drive_channel
from ...study.pages.quantities import interval_text
from ...study.study import Study
from ...study.study_file import Drive
from ..fit.drive_constant import LoadShares
from ..fit.friction_family import FamilyFit
from ..fit.headline_choice import HeadlineChoice
from ..fit.presliding import Presliding
from ..fit.replay import Machine
from ..fit.unknown_payload import UnknownPayload, estimate_payload

if TYPE_CHECKING:
    from ...numerics.posterior.posterior import Posterior


@dataclass(frozen=True)
class JointCase:
    """An identified joint, from which the findings are derived."""

    study: Study
    motions: tuple[Motion, ...]  # motions of every recording, fitted and held out
    data: Stack  # fitted motions
    excerpt: tuple[Motion, ...]  # all motions, or parts of each if there are hours, for methods that search
    fits: Mapping[str, FamilyFit]  # fit of each family
    choice: HeadlineChoice  # the model behind the headline, and why
    machine: Machine = field(default_factory=Machine)
    failures: Mapping[str, str] = field(default_factory=dict)  # reasons, by family, why it could not be fitted
    constant: Parameter | None = None  # drive constant from payloads, divided by the stated one if that is known
    no_constant: str = ""  # reason why the payloads give no drive constant
    posterior: Posterior | None = None  # posterior of the best family, if requested
    no_posterior: str = ""  # reason why a requested posterior is missing
    presliding: Presliding | None = None  # estimate of the presliding travel; None if not requested
    shares: LoadShares = field(default_factory=lambda: LoadShares(False, "no known load"))  # decision on load shares
    # payload of each recording that study.toml says to carry an unknown one; None where it cannot be estimated
    payloads: Mapping[str, UnknownPayload | None] = field(default_factory=dict)
    causes: tuple[Cause, ...] = ()  # causes of what the best family misses

    @property
    def best(self) -> str:
        """Name of the chosen family."""
        return self.choice.family

    @property
    def fit(self) -> FamilyFit:
        """Fit of the chosen family."""
        return self.fits[self.best]

    @property
    def level(self) -> float:
        """Confidence level of the study's intervals."""
        return self.study.model.confidence

    @property
    def judged_on_held_out(self) -> bool:
        """Whether any recording was held out."""
        return any(m.split == "heldout" for m in self.motions)

    @property
    def drive(self) -> Drive:
        """The joint's drive; a joint without one is not identified."""
        assert self.study.rig.drive is not None
        return self.study.rig.drive

    @property
    def rotary(self) -> bool:
        """Whether the joint is rotary."""
        return self.study.rig.motion == "rotary"


WORN_ADVICE = (
    "Record the robot alone, or with a known torque of the limb ([coupling]). Gravity at rest and friction at known "
    "speeds can still be estimated from segments in which the wearer is passive"
)
"""Advice on a joint that was worn during a recording."""


def wearer_faults(study: Study) -> list[Fault]:
    """Return a warning for each recording that somebody seems to wear, and for each measurement that echoes a command.

    A command that the drive's channel echoes is another channel with its unit whose name says that it was asked for.
    """
    if "wearer" not in study.found:
        study.found["wearer"] = [fault for recording in study.recordings() for fault in _faults_of(recording, study)]
    return list(study.found["wearer"])


def is_worn(study: Study) -> bool:
    """Whether a fitted recording shows that somebody wears the joint; held-out recordings decide nothing."""
    fitted = {recording.path.name for recording in study.recordings("fit")}
    return any(fault.kind == worn.KIND and fault.file in fitted for fault in wearer_faults(study))


def _faults_of(recording: Recording, study: Study) -> list[Fault]:
    drive = drive_channel(recording, study)
    if drive is None or drive not in recording or "position" not in recording:
        return []
    faults = []
    unit, where = recording.channels[drive].unit, f"{recording.path.name} (recording {recording.name})"
    kept = recording.enabled & recording.sound
    for name, channel in recording.channels.items():
        asked = name != drive and channel.unit == unit and quantity_of(name).role == "command"
        echo = echoed.find_echo(recording[drive][kept], channel.samples[kept]) if asked else None
        if echo is not None:
            late = f"delayed by {1e3 * echo.delay / recording.fs:.3g} ms (r = {echo.correlation:.4f})"
            found, wanted = f"a copy of the command {name}, {late}", "a measurement"
            message = f"{where}, channel {drive}: found {found}, expected {wanted}"
            faults.append(Fault("warn", echoed.KIND, recording.path.name, drive, found, wanted, message))
    seen = worn.find_worn(recording.time, recording["position"], recording[drive], kept)
    if seen is not None:
        found, wanted = "; ".join(seen.reasons), f"a machine alone; it was probably worn. {WORN_ADVICE}"
        message = f"{where}, channel {drive}: found that {found}, expected {wanted}"
        faults.insert(0, Fault("warn", worn.KIND, recording.path.name, drive, found, wanted, message))
    return faults


PAYLOAD_ADVICE = "If it carried a payload, write payload = {} there to estimate it, or state its mass and distance."
"""Advice on a payload that was found and is not stated."""

MIN_WEIGHT_SHARE = 0.05
"""A payload that is not stated is named only if it weighs at least this share of what the joint carries by itself."""


def estimate_without(case: JointCase, recordings: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint's values, (p,), and their covariance, (p, p), from fitted recordings without those named."""
    joint = case.fit.estimate
    motions = [m for m in case.excerpt if m.split == "fitted" and m.recording not in recordings]
    if not motions:
        return joint.array, joint.covariance
    data = stack(motions)
    w, effort = regression_rows(joint.model, joint.array, data)
    step = np.linalg.lstsq(w, data.target - effort, rcond=None)[0]
    return joint.array + step, sandwich_covariance(w, data.target - effort - w @ step, data.lengths)


def unstated_payload(values: np.ndarray, covariance: np.ndarray, recording: str, case: JointCase) -> str | None:
    """Return a sentence with the payload that explains a recording; None if none does, or if one is stated there.

    The joint without it has `values`, (p,), with `covariance`, (p, p).
    """
    motions = [m for m in case.excerpt if m.recording == recording]
    if not motions or any(m.payload[0] for m in motions):
        return None
    payload = estimate_payload(case.fit.estimate.model, values, covariance, covariance, motions)
    if payload is None or not payload.is_told:
        return None
    names = case.fit.estimate.model.names
    if payload.weight.value < MIN_WEIGHT_SHARE * abs(float(values[names.index("gravity")])):
        return None
    share = f"{100.0 * payload.explained:.0f} % of the residual there"
    if not payload.mass.trusted:
        return f"An unstated payload explains {share}: weight {interval_text(payload.weight, case.level)}."
    point = f"{interval_text(payload.mass, case.level)} at {interval_text(payload.distance, case.level)}"
    return f"An unstated payload explains {share}: {point}."


ADVICE_BY_PARAMETER = {
    "inertia": "Record quick reversals too: steps, or a motion of several frequencies.",
    "gravity": "Record over a wider range of angles.",
    "gravity_cosine": "Record over a wider range of angles.",
    "parallel_stiffness": "Record over a wider range of positions.",
    "offset": "Record both directions over the same positions.",
} | {term.name: term.advice for term in TERMS}
"""Recordings to make so that a parameter is identified."""


def advice(name: str) -> str:
    """Return what to record so that a parameter shows; empty for one that has no advice."""
    return ADVICE_BY_PARAMETER.get(name, "")
