"""Identify a spring on the bench from recordings with `protocol = "locked_spring"`: stiffness, damping, hysteresis."""

from __future__ import annotations

import numpy as np

from ..._errors import PellucidError
from ...files.fault import Fault
from ...models.estimates import Verdict
from ...study.pages.page import Page, Section, Tile
from ...study.pages.quantities import number, unit_text
from ...study.procedures.dead_effort import dead_effort_faults, require_live_effort
from ...study.procedures.findings import MAX_GOOD_ERROR
from ...study.procedures.result import FigureTable, ParameterTable
from ...study.procedures.study_page import figure_tables, parameter_tables, study_page
from ...study.quality import inspect, require_sound
from ...study.recorded_motions import computed_effort, drive_model, motions_of, recorded_word
from ...study.results import ResultRow
from ...study.study import Study
from ...study.study_file import JointTable
from ..fit.spring_fit import BACKLASH_PARAMETER, CUBIC_PARAMETER, SpringFit, fit_spring
from .spring_result import SpringResult, SpringTrace

SPRING_ADVICE = "Deflect it both ways, slowly and fast; check that its far end is locked, and the effort's unit."
"""What to do where a spring does not explain the effort."""


def spring_faults(study: Study) -> list[Fault]:
    """Return the faults of the files of a spring, and a refusal if they do not tell it."""
    faults = [fault for recording in study.recordings() for fault in inspect(recording, study)]
    faults += dead_effort_faults(study)
    if not any(fault.severity == "refuse" for fault in faults):
        try:
            _fitted(study)
        except PellucidError as error:
            wanted = "a deflection that shows stiffness, damping and hysteresis"
            faults.append(Fault("refuse", "excitation", "study.toml", "position", str(error), wanted, str(error)))
    return faults


def _fitted(study: Study) -> SpringFit:
    rig = study.rig
    assert isinstance(rig, JointTable)  # the procedure is asked for one joint alone
    coordinate = "rad" if rig.motion == "rotary" else "m"
    motions = motions_of(study.recordings("fit"), study)
    return fit_spring(motions, coordinate=coordinate, effort=drive_model(rig).effort_unit)


def identify_spring(study: Study) -> SpringResult:
    """Return the stiffness, damping and hysteresis of a spring, tested on held-out recordings if there are any."""
    for recording in study.recordings():
        require_sound(recording, study)
    require_live_effort(study)
    fit = _fitted(study)
    traces = _traces(study, fit)
    errors = tuple((each.recording, each.split, each.error) for each in traces)
    stiffness, level = fit.parameters[0], study.model.confidence
    half = 0.5 * (stiffness.interval(level)[1] - stiffness.interval(level)[0])
    scale, unit = (float(np.degrees(1.0)), "deg") if study.rig.motion == "rotary" else (1e3, "mm")
    low, high = (scale * end for end in fit.deflection)
    return SpringResult(
        study=study.name,
        headline=f"a spring of {number(stiffness.value, half)} ± {number(half, digits=2)} {unit_text(stiffness.unit)} "
        f"between {number(low, digits=3)} and {number(high, digits=3)} {unit}",
        tables=(
            ParameterTable("Spring", fit.parameters),
            FigureTable("Error of the effort", ("recording", "use", "error [%]"), errors),
        ),
        verdicts=_verdicts(fit, errors),
        rows=tuple(_rows(study, fit, errors)),
        cards={},
        checksums={recording.name: recording.checksum for recording in study.recordings()},
        confidence=level,
        fit=fit,
        traces=traces,
    )


def _traces(study: Study, fit: SpringFit) -> tuple[SpringTrace, ...]:
    """Return every recording with its prediction, held-out recordings last."""
    made = []
    for recording in sorted(study.recordings(), key=lambda each: each.use != "fit"):
        motions = motions_of([recording], study)
        deflection, effort = (np.concatenate([m.rows(getattr(m, x)) for m in motions]) for x in ("position", "effort"))
        predicted = np.concatenate([fit.predict(m) for m in motions])
        split = "fitted" if recording.use == "fit" else "heldout"
        made.append(SpringTrace(recording.name, split, deflection, effort, predicted))
    return tuple(made)


def _verdicts(fit: SpringFit, errors: tuple[tuple[str, str, float], ...]) -> tuple[Verdict, ...]:
    """Return whether a spring explains the effort, where it is not linear, and what was held out."""
    made = []
    if fit.effort_error > 50.0 or not fit.parameters[0].value > 0.0:
        text = f"A spring leaves {fit.effort_error:.0f} % of the effort unexplained: this is none, or not that alone."
        made.append(Verdict("wrong", text, SPRING_ADVICE, "locked_spring"))
    held = [error for _, split, error in errors if split == "heldout"]
    if held:
        kind = "good" if max(held) <= MAX_GOOD_ERROR else "warning"
        text = f"Held-out recordings are predicted with an error of {max(held):.2g} % at the most."
        made.append(Verdict(kind, text, "" if kind == "good" else SPRING_ADVICE, "locked_spring"))
    else:
        made.append(
            Verdict("note", "No recording is held out.", 'Mark one `use = "validate"` to test it.', "locked_spring")
        )
    if not fit.is_linear:
        saved = f"With it the error is {fit.effort_error:.2g} %, without it {fit.linear_error:.2g} %."
        found = {p.name: p for p in fit.parameters}
        if BACKLASH_PARAMETER in found:
            gap = found[BACKLASH_PARAMETER]
            scale, unit = (float(np.degrees(1.0)), "deg") if gap.unit == "rad" else (1e3, "mm")
            width = number(scale * gap.value, scale * gap.standard_error)
            text = f"The spring has {width} {unit} of backlash. {saved} The stiffness is that beyond the gap."
        else:
            changes = "hardens" if found[CUBIC_PARAMETER].value > 0.0 else "softens"
            text = f"The spring {changes} with its deflection. {saved} The stiffness is that in the middle."
        made.append(Verdict("note", text, "", "locked_spring"))
    return tuple(made)


def _rows(study: Study, fit: SpringFit, errors: tuple[tuple[str, str, float], ...]) -> list[ResultRow]:
    head = f"{study.name}.spring"
    made = [
        ResultRow(f"{head}.{p.name}", p.value, p.unit, "identify", "fitted", None, p.sentence()) for p in fit.parameters
    ]
    said, unit = "hysteresis builds up over it from its middle", "rad" if study.rig.motion == "rotary" else "m"
    made.append(ResultRow(f"{head}.hysteresis_way", fit.way, unit, "identify", "fitted", None, said))
    linear = f"of the spring that is chosen; of a linear one {fit.linear_error:.3g} %"
    made.append(ResultRow(f"{head}.effort_error", fit.effort_error, "%", "identify", "fitted", None, linear))
    for name, split, error in errors:
        made.append(ResultRow(f"{head}.effort_error.{name}", error, "%", "identify", split, None, "of the effort"))
    return made


def spring_page(study: Study, found: SpringResult) -> Page:
    """Return the report of a spring on the bench."""
    from ...study.drawing.drawing import draw
    from .joint_figures import spring_loop

    rig, stiffness = study.rig, found.fit.parameters[0]
    assert isinstance(rig, JointTable)  # the procedure is asked for one joint alone
    effort_unit = drive_model(rig).effort_unit
    recorded = recorded_word(
        computed_effort([rig.drive.kind] if rig.drive else [], effort_unit), is_simulated=bool(study.config.simulated)
    )
    label = f"Effort ({unit_text(effort_unit)})"
    loop = draw(spring_loop, found.traces[-1], "rad" if rig.motion == "rotary" else "m", label, recorded)
    where = "beyond the gap" if found.fit.shape == "backlash" else "in the middle"
    tile = Tile("Stiffness", number(stiffness.value, stiffness.standard_error), unit_text(stiffness.unit), where)
    return study_page(
        title=f"{found.study}: a spring on the bench",
        answer=found.answer,
        verdicts=found.verdicts,
        tiles=(tile,),
        sections=(
            Section("spring", "What was found", tables=parameter_tables(found), drawings=(loop,)),
            Section("errors", "Recordings", tables=figure_tables(found), notes=study.notes),
        ),
    )
