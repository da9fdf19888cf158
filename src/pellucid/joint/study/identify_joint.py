"""Identify a joint: solve it, and report what the chosen model misses and shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...files.recording import Recording
from ...study.procedures.findings import collect_findings
from ...study.procedures.procedure import Progress, quiet
from ...study.recorded_motions import (
    computed_effort,
    drive_model,
    filtering_of,
    motions_of,
)
from ...study.study import Study
from ...study.study_file import Processing
from ..fit.drive_constant import widen_for_unknown_shares
from ..fit.joint_estimate import JointEstimate
from ..fit.presliding import estimate_presliding
from ..fit.slip_direction import DirectionChoice
from ..fit.unknown_payload import UnknownPayload, estimate_payload
from . import joint_findings
from .joint_case import JointCase
from .joint_causes import causes_of
from .joint_result import JointResult, complete_result, traces_of
from .solve_joint import SolvedJoint, solve_joint


def identify_joint(
    study: Study, tell: Progress = quiet, *, families: Sequence[str] | None = None, thorough: bool = True
) -> JointResult:
    """Identify a study's joint with all friction families.

    `thorough` adds the other estimators and simulations to least squares.
    """
    return report_joint(solve_joint(study, tell, families=families, thorough=thorough))


def report_joint(solved: SolvedJoint) -> JointResult:
    """Return the result of a solved joint: its causes, presliding travel, payloads, verdicts and tables."""
    study, fit, constant = solved.study, solved.fits[solved.choice.family], solved.constant
    estimate, drive = fit.estimate, drive_model(study.rig)
    known_drive = drive.effort_unit in ("N*m", "N")
    if constant is not None and not known_drive:
        constant = widen_for_unknown_shares(constant, estimate)
    fitted, held = ([m for m in solved.excerpt.motions if m.split == split] for split in ("fitted", "heldout"))
    below_slip = estimate_presliding(estimate.model, estimate.array, fitted, held, study.model.confidence)
    payloads_found = _find_payloads(study, solved.carried, estimate, solved.choice.direction)
    causes = causes_of(study, fit, solved.searched, solved.spring)
    case = JointCase(
        study, solved.motions, solved.data, solved.excerpt.motions, solved.fits, solved.choice, solved.machine,
        solved.failures, constant, solved.no_constant, solved.posterior, solved.no_posterior, below_slip,
        solved.shares, payloads_found, causes,
    )  # fmt: skip
    found = JointResult(
        study=study.name,
        headline="",
        tables=(),
        verdicts=collect_findings(joint_findings, case),
        rows=(),
        cards={},
        checksums={r.name: r.checksum for r in study.recordings()},
        confidence=study.model.confidence,
        joint=study.rig.joint,
        motion=study.rig.motion,
        effort_unit=drive.effort_unit,
        computed=computed_effort([study.rig.drive.kind] if study.rig.drive else [], drive.effort_unit),
        is_simulated=bool(study.config.simulated),
        lifts=study.rig.lifts,
        families=solved.fits,
        choice=solved.choice,
        filter_note=filter_note(study, solved.choice.direction),
        drive_constant=None if known_drive else constant,
        posterior=solved.posterior,
        presliding=below_slip,
        payloads=tuple(payload for payload in payloads_found.values() if payload is not None),
        causes=causes,
        traces=traces_of(solved.motions),
    )
    return complete_result(study, found)


def _find_payloads(
    study: Study, carried: Sequence[Recording], joint: JointEstimate, direction: DirectionChoice
) -> dict[str, UnknownPayload | None]:
    """Return the payload of each recording that carries an unknown one; None where it cannot be estimated."""
    found = {}
    for recording in carried:
        distance = 0.0 if recording.payload is None else recording.payload.distance
        motions = [direction.apply(m) for m in motions_of([recording], study)]
        found[recording.name] = estimate_payload(
            joint.model, joint.array, joint.covariance, joint.statistical, motions, distance
        )
    return found


def filter_note(study: Study, direction: DirectionChoice) -> str:
    """Return the study's processing in one line, with that of recordings that differ."""
    unit = "rad/s" if study.rig.motion == "rotary" else "m/s"
    own = [
        f"{e.name}: {_processing_sentence(e.processing, unit, direction)}"
        for e in study.config.recordings
        if e.processing is not None
    ]
    return "; of ".join([_processing_sentence(study.processing, unit, direction), *own])


def _processing_sentence(processing: Processing, unit: str, direction: DirectionChoice) -> str:
    """Return one processing in words."""
    filtering = replace(
        filtering_of(processing), direction_share=direction.share, presliding_travel=direction.travel
    )
    sentence = filtering.sentence(unit)
    if processing.velocity == "recorded":
        sentence = sentence.replace("central differences", "velocity as recorded")
    return f"resampled to {processing.resample:g} Hz; {sentence}" if processing.resample else sentence
