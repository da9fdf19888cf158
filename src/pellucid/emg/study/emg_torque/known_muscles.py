"""Constants and geometry of a study's muscles: recorded lengths and moment arms, or those of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....files.recording import Recording
from ....models.estimates import Verdict
from ....study.study import Study
from ...estimators.torque_trial import FIBRE_DAMPING, SEATED_POSTURE_RAD, STANDING_POSTURE_RAD, MuscleSource
from ...models.hill import HillMuscle
from ...models.muscle_geometry import muscle_table
from .emg_torque_table import EmgTorqueTable
from .relative_envelopes import is_maximal, is_relative
from .study_muscles import study_geometry, study_muscles


@dataclass(frozen=True)
class PolynomialLimits:
    """RMS errors beyond which a muscle's polynomial is reported as poor.

    Both were chosen by judgement; no measurement is recorded.
    """

    # A muscle's polynomial is reported as poor if the RMS error of its length exceeds this [m]. Chosen by judgement.
    max_length_error_m: float = 1e-3
    # A muscle's polynomial is reported as poor if the RMS error of its moment arm exceeds this [m]. Chosen by
    # judgement.
    max_arm_error_m: float = 2e-3


POLYNOMIAL_LIMITS = PolynomialLimits()


def muscle_source(study: Study, recording: Recording, joint: str) -> MuscleSource | None:
    """Return the source of the muscles across a joint in a recording; None without a geometry of the joint.

    Recorded lengths and moment arms have precedence, then those of the study's own model, then those of the leg model.

    `study` [emg_torque].
    """
    table = muscle_table()
    constants = {name: replace(m, damping=FIBRE_DAMPING) for name, m in table.constants.items()}
    for name, found in study_muscles(study).items():
        constants[name] = HillMuscle(
            name, found.optimal_fibre_length, found.tendon_slack_length, found.largest_force, found.pennation,
            damping=FIBRE_DAMPING,
        )  # fmt: skip
    recorded = _recorded_paths(recording, joint)
    model = None if recorded else study_geometry(study)
    paths = table.geometry if model is None else model.polynomials
    if not recorded and not any(joint in path.angles for path in paths.values()):
        return None
    posture = SEATED_POSTURE_RAD if recording.protocol in ("leg_extension", "seated_swing") else STANDING_POSTURE_RAD
    return MuscleSource(
        constants,
        recorded,
        maximal=is_maximal(study, recording.participant),
        sign=-1.0 if joint == "knee" and study.config.rig.lifts == "flexion" else 1.0,
        relative=is_relative(study),
        polynomials={} if model is None else model.polynomials,
        posture=posture if model is None else {j: model.signs.get(j, 1.0) * q for j, q in posture.items()},
    )


def _recorded_paths(recording: Recording, joint: str) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return length, rate and moment arm of muscles that have all three among the streams, on the recording's clock."""
    every = {
        name: (stream.time, channel.samples)
        for stream in recording.streams.values()
        for name, channel in stream.channels.items()
    }
    heads = ("length.", "lengthening.", f"moment_arm.{joint}.")
    muscles = [name.removeprefix("length.") for name in every if name.startswith("length.")]
    return {
        muscle: tuple(np.interp(recording.time, *every[head + muscle]) for head in heads)
        for muscle in muscles
        if all(head + muscle in every for head in heads)
    }


def geometry_verdicts(study: Study) -> list[Verdict]:
    """Return verdicts on the polynomials of the study's own model: their errors, and muscles that were refused."""
    if all(_recorded_paths(r, joint) for r in study.recordings() for joint in study.table(EmgTorqueTable).joints):
        return []
    model = study_geometry(study)
    if model is None:
        return []
    far = max(model.polynomials.values(), key=lambda p: p.error.arm)
    held = ", ".join(f"{name} {value:.3g}" for name, value in model.held.items())
    verdicts = [
        Verdict(
            "note",
            f"lengths and moment arms of {len(model.polynomials)} muscles are those of {model.source} over "
            f"{', '.join(model.coordinates)}, as polynomials that err by at most "
            f"{1e3 * max(p.error.length for p in model.polynomials.values()):.2g} mm in length and "
            f"{1e3 * far.error.arm:.2g} mm in moment arm ({far.muscle}), RMS of poses that were not fitted"
            + (f"; the model's other coordinates are at rest: {held}." if held else "."),
        )
    ]
    verdicts += [
        Verdict(
            "warning",
            f"{model.source}, muscle {name}: a polynomial errs by {1e3 * p.error.length:.2g} mm in length and "
            f"{1e3 * p.error.arm:.2g} mm in moment arm: somewhere in the coordinates' ranges the muscle's way jumps.",
            "Narrow the coordinates' <range> in the model to what was recorded.",
        )
        for name, p in model.polynomials.items()
        if p.error.length > POLYNOMIAL_LIMITS.max_length_error_m or p.error.arm > POLYNOMIAL_LIMITS.max_arm_error_m
    ]
    return verdicts + [
        Verdict("warning", f"{model.source}, {why}; it takes no part.") for why in model.refused.values()
    ]
