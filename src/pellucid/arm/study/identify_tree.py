"""Identify all joints of a robot together: base parameters, friction of each joint, consistent inertias."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError, RecordingError
from ...study.procedures.findings import collect_findings
from ...study.procedures.procedure import Progress, quiet
from ...study.recorded_motions import computed_effort, filtering_of
from ...study.study import Study
from ..fit import fit_tree as identification
from ..fit.consistent_inertias import ConsistentSolution
from ..fit.fit_tree import (
    TreeIdentification,
    cross_validate_segments,
    heldout_errors,
    plain_model,
    relative_errors,
    residuals_on,
    rows_without_maker_effort,
)
from ..fit.friction_terms import FURTHER_MOTOR_TERMS, MOTOR_PREFIX
from ..fit.inertia_prior import fit_consistent, solve_with_prior
from ..fit.published_parameters import published_parameters
from ..fit.tree_regression import TreeModel, TreeRows, TreeSolution, collect_rows, fit_rows
from ..tree_motion import TreeMotion
from . import tree_findings
from .recorded_tree import file_of, recorded_tree
from .tree_faults import tree_faults
from .tree_result import (
    GAIN_SOURCES,
    Errors,
    TreeResult,
    TreeTrace,
    choice_of,
    complete_result,
    identify_payloads,
    in_drive_units,
    of_effort,
    with_gains,
)
from .tree_table import TreeTable


def identify_tree(study: Study, tell: Progress = quiet) -> TreeResult:
    """Identify every model of a study's robot."""
    tell("reading recordings", 0.0)
    faults = tree_faults(study)
    refused = [fault.message for fault in faults if fault.severity == "refuse"]
    if refused:
        raise RecordingError("\n".join(refused))
    tell("filtering", 0.05)
    table = study.table(TreeTable)
    robot, motions = recorded_tree(study)
    motions, gains = with_gains(study, robot, motions)
    fitted, judged = ([m for m in motions if m.payload is None and m.use == use] for use in ("fit", "validate"))
    if not fitted:
        raise IdentificationError('no recording without payload is marked use = "fit"; at least one must be')
    tell("cross-validating the friction of each joint", 0.1)
    of_motors = (f"{MOTOR_PREFIX}{term}" for term in table.families)
    terms = (*table.families, *(term for term in of_motors if term in FURTHER_MOTOR_TERMS))
    found = identification.identify_tree(
        robot, fitted, judged, width=table.velocity_width, terms=terms, ripple=table.ripple
    )
    best = TreeModel(robot, found.rows.base, found.best.families, found.choice.speeds, found.best.ripples)
    tell("bodies that can exist", 0.74)
    models, failures, bodies = {"base": found.base, "best": found.best}, {}, None
    prior = {"stated": table.inertia_prior, "in_si": all(fitted[0].gain_known)}
    try:
        models["consistent"], bodies = fit_consistent(best, found.rows, **prior)
    except IdentificationError as error:
        # Without consistent bodies, for example after a wrong sign, the base parameters may still show the cause.
        failures["consistent"] = str(error)
    tell("judging", 0.76)
    errors = [*_baseline_errors(study, found, fitted, judged), *_errors_of_base_and_best(found, fitted, judged)]
    errors += _errors_of_consistent(found, bodies, judged, prior) if bodies is not None else ()
    tell("payloads", 0.97)
    payloads = identify_payloads(study, robot, motions, found.best, gains)
    out = found.best_out
    processing = study.processing_of(study.recordings()[0])
    filtering = filtering_of(processing)
    bands = {joint.joint: joint.dead_band for joint in study.rig.joints}
    effort = "N*m" if all(fitted[0].gain_known) else ""
    result = TreeResult(
        study=study.name,
        headline="",
        tables=(),
        verdicts=(),
        rows=(),
        cards={},
        checksums={recording.name: recording.checksum for recording in study.recordings()},
        confidence=table.confidence,
        robot=robot,
        models=models,
        failures=failures,
        errors=tuple(errors),
        choice=None if out is None else choice_of(robot, out.models),
        lines=tuple(found.lines),
        jackknife=found.jackknife,
        payloads=payloads,
        computed=computed_effort((joint.drive.kind for joint in study.rig.joints), effort),
        gains=tuple(zip(map(float, fitted[0].gain), fitted[0].drive_units, fitted[0].gain_known, strict=True)),
        identified_gains=gains,
        gains_note=GAIN_SOURCES[table.gains],
        published=table.published,
        filter_note=filtering.sentence("rad/s"),
        filtering=filtering,
        effort_lowpass=table.effort_lowpass,
        dead_band=tuple(processing.dead_band if bands[n] is None else bands[n] for n in robot.names),
        doubts=tuple(f"{f.found}, expected {f.expected}" for f in faults if f.kind == "sign"),
        segments=len(np.unique(found.rows.segment[found.rows.used.any(axis=1)])),
        traces=tuple(_trace(m, found) for m in motions if m.payload is None),
    )
    stated = {name: in_drive_units(model, result.effort_units) for name, model in models.items()}
    units = dict(zip(robot.names, result.effort_units, strict=True))
    causes = tuple(replace(cause, unit=of_effort(cause.unit, units[cause.joint])) for cause in found.causes)
    result = replace(result, models=stated, causes=causes)
    result = replace(result, verdicts=collect_findings(tree_findings, result))
    return complete_result(study, result)


def _baseline_errors(
    study: Study, found: TreeIdentification, fitted: Sequence[TreeMotion], judged: Sequence[TreeMotion]
) -> Iterator[Errors]:
    """Yield the errors of the baselines: stated bodies with fitted and with published friction."""
    urdf = file_of(study)
    if not all(fitted[0].gain_known) or (urdf is not None and not urdf.has_bodies):
        return  # stated masses predict no effort in amperes, and placeholder bodies are no baseline
    kinds = {"fitted": found.rows}
    if judged:
        kinds["heldout"] = collect_rows(found.rows.robot, judged, width=found.rows.width, base=found.rows.base)
    rows = {
        kind: rows_without_maker_effort(each, motions)
        for (kind, each), motions in zip(kinds.items(), (fitted, judged), strict=False)
    }
    model = plain_model(rows["fitted"])
    values = fit_rows(model, rows["fitted"])[0].values
    for kind, each in rows.items():
        yield _errors("stated", kind, relative_errors(residuals_on(model, values, each), kinds[kind].size))
    if found.maker_out is not None:
        yield _errors("stated", "segments_out", found.maker_out.errors)
    plain = plain_model(found.rows)
    published = published_parameters(plain, study.table(TreeTable).published)
    if published is None:
        return
    for kind, each in kinds.items():
        yield _errors("published", kind, relative_errors(residuals_on(plain, published, each), each.size))
    if found.base_out is not None:
        # Nothing is fitted, so every segment counts as left out.
        missed = residuals_on(plain, published, found.rows)
        yield _errors("published", "segments_out", relative_errors(missed, found.rows.size))


def _errors_of_base_and_best(
    found: TreeIdentification, fitted: Sequence[TreeMotion], judged: Sequence[TreeMotion]
) -> Iterator[Errors]:
    for model, out in ((found.base, found.base_out), (found.best, found.best_out)):
        yield _errors(model.name, "fitted", heldout_errors(model, fitted))
        if out is not None:
            yield _errors(model.name, "segments_out", out.errors)
        if judged:
            yield _errors(model.name, "heldout", found.heldout[model.name])


def _errors_of_consistent(
    found: TreeIdentification, bodies: ConsistentSolution, judged: Sequence[TreeMotion], prior: Mapping[str, bool]
) -> Iterator[Errors]:
    """Yield the errors of the consistent model; each left-out segment has the friction chosen without it.

    `prior` are the keywords of `solve_with_prior`.
    """
    rows, model = found.rows, bodies.spread.model
    yield _errors("consistent", "fitted", relative_errors(residuals_on(model, bodies.parameters, rows), rows.size))
    if found.best_out is not None:
        chosen = iter(found.best_out.models)

        def fit(part: TreeRows) -> tuple[TreeModel, TreeSolution]:
            each = next(chosen)
            start = fit_rows(each, part)[0]
            return each, replace(start, values=solve_with_prior(each, part, start=start, **prior)[0].parameters)

        yield _errors("consistent", "segments_out", cross_validate_segments(rows, fit).errors)
    if judged:
        kept = collect_rows(rows.robot, judged, width=rows.width, base=rows.base)
        yield _errors("consistent", "heldout", relative_errors(residuals_on(model, bodies.parameters, kept), kept.size))


def _trace(motion: TreeMotion, found: TreeIdentification) -> TreeTrace:
    load = found.best.load(motion)
    return TreeTrace(
        motion.recording, motion.use, motion.time, motion.position, motion.velocity, motion.effort, motion.moving,
        load, found.best.friction(motion, load), found.best.effort(motion),
    )  # fmt: skip


def _errors(model: str, judged: str, each: np.ndarray) -> Errors:
    return Errors(model, judged, tuple(map(float, each)))
