"""Identify a joint's weight from recordings in which it is only held: each recording is one angle and one effort."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...files.fault import Fault
from ...models.estimates import Parameter, Verdict
from ...numerics.gravity_holds import GravityFit, Hold, fit_gravity
from ...study.answer import Answer, AnswerNumber, Basis, Step
from ...study.pages.page import Page, Section, Tile
from ...study.pages.quantities import number, percent, unit_text
from ...study.procedures.findings import MAX_GOOD_ERROR
from ...study.procedures.result import FigureTable, ParameterTable, Result
from ...study.procedures.study_page import figure_tables, parameter_tables, study_page
from ...study.quality import inspect, require_sound
from ...study.recorded_motions import command_of, drive_model
from ...study.results import ResultRow
from ...study.study import Study

NO_MOTION_VERDICT = Verdict(
    "note",
    "The joint was only held: postures identify its weight, not its inertia and viscous friction.",
    "Record a motion for those.",
)
"""What no posture shows."""

MOTION_STEP = Step("Record a motion: static postures show neither inertia nor friction")
"""Next step with a weight that explains every posture."""

POSTURES_STEP = Step("Record more postures, spread over the whole range, each reached from both directions")
"""Next step with a weight that does not."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PostureResult(Result):
    """Weight of a joint from the angles at which it was held."""

    fit: GravityFit
    judged: tuple[tuple[Hold, float], ...] = ()  # held-out postures with the effort that was predicted

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return posture_answer(self)


def posture_faults(study: Study) -> list[Fault]:
    """Return the faults of recordings that are only postures, and a note on what they can show."""
    faults = [fault for recording in study.recordings() for fault in inspect(recording, study)]
    found = f"{len(study.recordings())} recordings in which the joint is held"
    wanted = "a motion, for inertia and friction; postures identify only the weight"
    files = ", ".join(recording.path.name for recording in study.recordings()[:3])
    message = f"{files}, channel position: found {found}, expected {wanted}"
    try:
        fit_gravity(_holds(study, "fit"))
    except IdentificationError as error:
        faults.append(Fault("refuse", "excitation", files, "position", found, wanted, str(error)))
    return [*faults, Fault("note", "posture", files, "position", found, wanted, message)]


def _holds(study: Study, use: str) -> list[Hold]:
    """Return one hold for each recording of a use; effort in the unit of the drive's model."""
    model, made = drive_model(study.rig), []
    for recording in study.recordings(use):
        kept = recording.sound & recording.enabled
        angle, effort = recording["position"][kept], model.gain * command_of(recording, study.rig)[kept]
        known = np.isfinite(angle) & np.isfinite(effort)
        time = recording.time[kept][known]
        mean = float(np.mean(angle[known])), float(np.mean(effort[known]))
        made.append(Hold(recording.name, float(time[0]), float(time[-1]), *mean, float(np.std(effort[known])), 0))
    return made


def identify_postures(study: Study) -> PostureResult:
    """Return the gravity of a joint from static postures, tested on held-out postures if there are any."""
    for recording in study.recordings():
        require_sound(recording, study)
    unit = drive_model(study.rig).effort_unit
    fit = fit_gravity(_holds(study, "fit"), level=study.model.confidence)
    angles = np.array([hold.angle for hold in fit.holds])
    judged = tuple((hold, float(fit.torque(np.array([hold.angle]))[0])) for hold in _holds(study, "validate"))
    parameters = tuple(replace(p, unit=unit) if p.name != "zero" else p for p in fit.parameters)
    checksums = {recording.name: recording.checksum for recording in study.recordings()}
    weight = next(p for p in parameters if p.name == "gravity")
    half = 0.5 * (weight.interval(study.model.confidence)[1] - weight.interval(study.model.confidence)[0])
    headline = (
        f"weight {number(weight.value, half)} ± {number(half, half)} {unit_text(unit)} from {len(angles)} postures "
        f"between {np.degrees(angles.min()):.0f} and {np.degrees(angles.max()):.0f} deg"
    )
    return PostureResult(
        study=study.name,
        headline=headline,
        tables=(ParameterTable("Weight from postures", parameters), _posture_table(fit, judged, unit)),
        verdicts=(NO_MOTION_VERDICT,),
        rows=tuple(_rows(study, parameters, fit, judged, unit)),
        cards={},
        checksums=checksums,
        confidence=study.model.confidence,
        fit=fit,
        judged=judged,
    )


def posture_answer(found: PostureResult) -> Answer:
    """Return whether one weight explains the effort in every posture, held-out ones first."""
    fit, held = found.fit, bool(found.judged)
    measured = np.array([hold.torque for hold, _ in found.judged] if held else [hold.torque for hold in fit.holds])
    missed = np.array([hold.torque - predicted for hold, predicted in found.judged]) if held else fit.residual
    error = 100.0 * float(np.linalg.norm(missed) / np.linalg.norm(measured))
    plural = "s" * (len(missed) > 1)
    judged = f"{len(missed)} held-out posture{plural}" if held else f"the {len(missed)} postures that were fitted"
    weight = next(p for p in found.estimates.values() if p.name == "gravity")
    told = weight.identifiable and error <= MAX_GOOD_ERROR
    reason = "" if told else f"the error on {judged} is {percent(error)} %, more than {MAX_GOOD_ERROR:g} %"
    if not weight.identifiable:
        reason = "the interval of the weight contains 0"
    count = len(found.checksums)
    return Answer(
        "Does one weight explain the effort in every posture?",
        "yes" if told else "no" if weight.identifiable else "cannot say",
        f"{found.headline}; the error on {judged} is {percent(error)} % of the effort",
        reason,
        numbers=(
            AnswerNumber("weight", weight.value, weight.unit, weight.interval(found.confidence)),
            AnswerNumber(f"error of the effort on {judged}", error, "%"),
        ),
        basis=Basis(count, count, judged=judged),
        next=(MOTION_STEP if told else POSTURES_STEP,),
        is_relative=True,
    )


def _posture_table(fit: GravityFit, judged: tuple[tuple[Hold, float], ...], unit: str) -> FigureTable:
    rows = [
        (hold.recording, "fitted", np.degrees(hold.angle), hold.torque, float(off))
        for hold, off in zip(fit.holds, fit.residual, strict=True)
    ]
    rows += [(hold.recording, "held out", np.degrees(hold.angle), hold.torque, hold.torque - p) for hold, p in judged]
    heads = ("posture", "use", "angle [deg]", f"effort [{unit_text(unit)}]", f"unexplained [{unit_text(unit)}]")
    return FigureTable("Postures", heads, tuple(rows))


def _rows(
    study: Study, parameters: tuple[Parameter, ...], fit: GravityFit, judged: tuple[tuple[Hold, float], ...], unit: str
) -> list[ResultRow]:
    made = [
        ResultRow(f"{study.name}.postures.{p.name}", p.value, p.unit, "identify", "fitted", None, p.sentence())
        for p in parameters
    ]
    errors = {"fitted": fit.residual, "heldout": np.array([hold.torque - predicted for hold, predicted in judged])}
    for split, off in errors.items():
        if off.size:
            rms, count = float(np.sqrt(np.mean(off**2))), f"{off.size} postures"
            made.append(ResultRow(f"{study.name}.postures.rms.{split}", rms, unit, "identify", split, None, count))
    return made


def posture_page(study: Study, found: PostureResult) -> Page:
    """Return the report of a joint that was only held."""
    from ...study.drawing.drawing import draw
    from .joint_figures import posture_figure

    weight = next(p for p in found.estimates.values() if p.name == "gravity")
    held = draw(posture_figure, found.fit, [hold for hold, _ in found.judged], weight.unit)
    tile = Tile("Weight", number(weight.value, weight.standard_error), unit_text(weight.unit), "times the angle's sine")
    return study_page(
        title=f"{found.study}: weight of a joint",
        answer=found.answer,
        verdicts=found.verdicts,
        tiles=(tile,),
        sections=(
            Section("weight", "What was found", tables=parameter_tables(found), drawings=(held,)),
            Section("postures", "Postures", tables=figure_tables(found), notes=study.notes),
        ),
    )
