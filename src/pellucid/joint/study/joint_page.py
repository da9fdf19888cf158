"""The page of a joint with friction: parameters, families, residuals, simulated motion, estimators side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...models.estimates import Parameter
from ...study.drawing.drawing import Drawing, draw
from ...study.pages.forest import Row, Table, number_table
from ...study.pages.page import Page, Section, Tile
from ...study.pages.quantities import (
    EFFORT_NAMES,
    FAMILIES,
    METHODS,
    MODES,
    MOTION_READINGS,
    interval,
    number,
    parameter_interval,
    parameter_label,
    parameter_note,
    percent,
    relative_sd,
    typeset_sentence,
    unit_text,
    value_and_half_interval,
)
from ...study.pages.values import Value
from ...study.procedures.posterior_figures import posterior_figure
from ...study.procedures.study_page import figure_tables, provenance, study_page
from ...study.study import Study
from ..fit.friction_family import FamilyFit
from ..fit.joint_estimate import JointEstimate
from . import joint_figures as figures
from .joint_answer import headline_error, judged_words
from .joint_figures import moving_joint, whole_recordings
from .joint_result import JointResult, Trace

ESTIMATOR_EXPLANATIONS = (
    (("ls",), "least squares takes the filtered motion as exact"),
    (("wls", "irls"), "weighted and robust fits give noisy samples less weight"),
    (
        ("iv", "didim"),
        "instrumental variables and DIDIM put a simulated motion in the place of the measured one, so that its noise "
        "cannot bias them",
    ),
    (("output_error",), "output error fits the simulated response itself"),
)
"""Clauses that explain the estimators, each with the names of those to which it applies."""


def page(study: Study, result: JointResult) -> Page:
    """Build the page of a result."""
    result = result.for_page()
    best = result.headlined
    simulated, compared = result.simulated, _compared_family(result)
    effort = EFFORT_NAMES.get(result.effort_unit, "Effort").lower()
    several = len(result.families) > 1
    sections = [
        Section(
            "parameters",
            "Parameters",
            (
                f"The {result.best} model: {FAMILIES.get(result.best, result.best)}. "
                f"{_by_whom(result)} Values are shown to the second uncertain digit.",
            ),
            (_parameters(result, best.estimate, result.confidence),),
            notes=tuple(typeset_sentence(note) for note in best.estimate.notes),
            folded=tuple(
                (f"The {f.family} model", _parameters(result, f.estimate, result.confidence))
                for f in result.families.values()
                if f.family != result.best
            ),
        ),
        *_posterior(result),
        Section(
            "friction",
            "Friction",
            drawings=(
                draw(figures.friction, result),
                *((draw(figures.families, result),) if several else ()),
            ),
        ),
        Section("recordings", "Recordings", drawings=_recordings(result)),
        Section("effort", f"Fit in {effort}", drawings=(draw(figures.effort, result, best),)),
    ]
    if simulated is not None and (motion := _simulation_drawings(result, simulated)):
        simulation_text = (
            "A model that predicts effort well may still drift in simulation. The identified joint "
            f"({simulated.family} friction) is therefore simulated as well."
        )
        table = _simulated(result, simulated)
        sections.append(Section("simulation", "Simulated motion", (simulation_text,), (table,), motion))
    sections.append(
        Section(
            "families",
            "Friction families compared",
            (_families_words(result),),
            (_families(result),),
            (draw(figures.heldout, result),) if several else (),
            folded=(("Every recording", _by_recording(result)), *_by_condition(result)),
        )
    )
    residuals = (draw(figures.residuals, result, best), draw(figures.whiteness, result, best))
    sections.append(Section("residuals", "Residuals", (), (_diagnostics(result),), residuals))
    if compared is not None:
        table, drawing = _estimators(compared, result.confidence), draw(figures.estimators, result, compared)
        sections.append(
            Section("estimators", "Estimators side by side", (_estimators_words(compared),), (table,), (drawing,))
        )
    return study_page(
        title=f"{result.study}: identified joint",
        answer=result.answer,
        tiles=_tiles(result, result.confidence),
        sections=(*sections, _provenance(study, result)),
        verdicts=result.verdicts,
        figure=answer_figure(result),
    )


def joint_section(study: Study, fit: JointResult) -> Section:
    """Return a joint's answer, parameters and fit as one section of a page that has other joints, too."""
    fit = fit.for_page()
    best = fit.headlined
    return Section(
        study.rig.joint,
        study.rig.joint,
        (typeset_sentence(fit.answer.whole),),
        (_parameters(fit, best.estimate, fit.confidence),),
        (answer_figure(fit), draw(figures.effort, fit, best)),
        notes=tuple(typeset_sentence(note) for note in best.estimate.notes),
        folded=(("Friction families compared", _families(fit)), ("Residuals", _diagnostics(fit))),
    )


def answer_figure(fit: JointResult) -> Drawing:
    """Return the joint along a recording, held out where one is, with its effort measured and predicted."""
    best = fit.headlined
    held = [p for p in best.predictions if p.split == "heldout"]
    parts, use = (held, "held out") if held else (list(best.predictions), "fitted")
    own = Value(f"{fit.study}.headline.effort_error", best.fitted_effort_error, percent(best.fitted_effort_error))
    sine, cosine = (best[n].value if n in best.model.names else 0.0 for n in ("gravity", "gravity_cosine"))
    source = f"{fit.recorded}, {fit.computed}" if fit.is_simulated and fit.computed else fit.computed or fit.recorded
    return draw(
        moving_joint, parts, "answer", rotary=fit.motion == "rotary", upright=-float(np.arctan2(cosine, sine)),
        unit=fit.effort_unit, error=headline_error(fit) if held else own, use=use, recorded=fit.recorded,
        caption=f"The joint as it was recorded ({use}; its length is not to scale), and its effort: "
        f"{source}, and dashed as the model predicts it.",
    )  # fmt: skip


def parameter_value(fit: JointResult, p: Parameter) -> str:
    """Return a parameter of the chosen estimate as every part of the page shows it."""
    return str(Value(f"{fit.study}.headline.{p.name}", p.value, number(p.value, p.standard_error)))


def _posterior(fit: JointResult) -> tuple[Section, ...]:
    if fit.posterior is None:
        return ()
    text = (
        f"Posterior from the same data, with physical bounds and an estimated error of the {fit.best} model. "
        f"{fit.posterior.settled}."
    )
    drawing = draw(posterior_figure, fit.posterior_pairs, fit.confidence)
    return (Section("posterior", "Posterior", (text,), figure_tables(fit, "Posterior"), (drawing,)),)


# --- figures --------------------------------------------------------------------------------------------------------


def _recordings(fit: JointResult) -> tuple[Drawing, ...]:
    groups = _in_columns(fit.traces)
    names = [f"recordings-{i + 1}" if len(groups) > 1 else "recordings" for i in range(len(groups))]
    return tuple(draw(figures.recordings, group, fit, name) for group, name in zip(groups, names, strict=True))


def _simulation_drawings(fit: JointResult, simulated: FamilyFit) -> tuple[Drawing, ...]:
    drawings = []
    for mode in MODES:
        runs = {m: [s for s in made if s.mode == mode] for m, made in simulated.simulations.items()}
        runs = {m: made for m, made in runs.items() if made}
        if runs:
            drawings.append(draw(figures.simulation, fit, runs, mode, f"simulation-{mode.replace('_', '-')}"))
    return tuple(drawings)


def _in_columns(traces: Sequence[Trace]) -> list[Sequence[Trace]]:
    """Split traces into groups of nearly equal size that fit into a figure."""
    count = -(-len(traces) // figures.COLUMN_COUNT)
    return [traces[i * len(traces) // count : (i + 1) * len(traces) // count] for i in range(count)]


def _compared_family(fit: JointResult) -> FamilyFit | None:
    """Return the family with the most estimators; the best family if several have as many."""
    ordered = [fit.families[fit.best], *fit.families.values()]
    most = max(ordered, key=lambda f: len(f.others))
    return most if most.others else None


# --- words and tables -----------------------------------------------------------------------------------------------


def _tiles(fit: JointResult, level: float) -> list[Tile]:
    best = fit.headlined
    judged = judged_words(fit)
    fitted = "in the fitted recordings"
    more = f"on {judged}; {percent(best.fitted_effort_error)} % {fitted}" if judged else fitted
    tiles = [Tile("Prediction error" if judged else "Error", str(headline_error(fit)), "%", more)]
    # Inertia, gravity and friction are the parameters that a reader looks for first.
    wanted = ("inertia", "gravity", "coulomb", "coulomb_positive", "viscous", "viscous_positive")
    for name in [n for n in wanted if n in best.model.names][:3]:
        tiles.append(_tile(best[name], level, parameter_value(fit, best[name])))
    if fit.drive_constant is not None:
        p = fit.drive_constant
        tiles.append(_tile(p, level, str(_drive_constant(fit, p))))
    return tiles


def _by_whom(fit: JointResult) -> str:
    """Return in words which estimator's values are shown, and why."""
    chosen, choice = METHODS[fit.choice.method], fit.choice
    if len(choice.methods_of(fit.best)) < 2:
        return f"Values are by {chosen} on filtered data."
    aim = {"torque": "the torque", "simulation": "the simulated motion"}[choice.purpose]
    return (
        f"Values are by {chosen}. Of {len(choice.candidates)} combinations of friction family and estimator, this is "
        "the simplest that predicts as well as the best one in cross-validation on segments of the fitted recordings. "
        f"The purpose of the study, {aim}, determines the error that is compared."
    )


def _drive_constant(fit: JointResult, p: Parameter) -> Value:
    return Value(f"{fit.study}.drive.constant", p.value, number(p.value, p.standard_error))


def _tile(p: Parameter, level: float, shown: str) -> Tile:
    more = f"{parameter_interval(p, level)} ({100.0 * level:.4g} %)"
    return Tile(parameter_label(p.name, p.unit).replace(" friction", ""), shown, unit_text(p.unit), more)


def _parameters(fit: JointResult, estimate: JointEstimate, level: float) -> Table:
    is_booted = any(p.bootstrap is not None for p in estimate.parameters)
    share = f"{100.0 * level:.4g} %"
    booted_head = (f"{share}, bootstrap",) if is_booted else ()
    heads = ("Parameter", "Value", "Unit", f"{share} interval", *booted_head, "Relative SD", "Notes")
    rows = []
    is_chosen = estimate is fit.headlined.estimate
    for p in (*estimate.parameters, *filter(None, [fit.drive_constant])):
        if p is fit.drive_constant:
            value = str(_drive_constant(fit, p))
        else:
            value = parameter_value(fit, p) if is_chosen else number(p.value, p.standard_error)
        cells = [parameter_label(p.name, p.unit), value, unit_text(p.unit) or "–", parameter_interval(p, level)]
        if is_booted:
            cells.append(interval(*p.bootstrap, p.standard_error) if p.bootstrap is not None else "–")
        cells += [f"{relative_sd(p)} %".replace("– %", "–"), parameter_note(p, level)]
        rows.append(Row(tuple(cells)))
    return Table(heads, tuple(rows), frozenset(range(len(heads) - 1)) - {0, 2}, wide=True)


def _families_words(fit: JointResult) -> str:
    if len(fit.families) == 1:
        return f"Only one family was fitted, {fit.best}: {FAMILIES.get(fit.best, fit.best)}."
    return (
        "All families are fitted by least squares here, so that only the friction model differs. A richer model always "
        "fits better. The chosen family is the simplest that predicts as well as the best one in cross-validation on "
        "segments of the fitted recordings. Held-out recordings test it."
    )


def _families(fit: JointResult) -> Table:
    def row(f: FamilyFit, words: str, held: str) -> Row:
        errors = (percent(f.fitted_effort_error), held, number(f.heldout_r2, digits=4))
        return Row((f.family, words, str(len(f.model.symbols)), *errors), f.family == fit.best)

    rows = [row(f, FAMILIES.get(f.family, ""), percent(f.heldout_effort_error)) for f in fit.families.values()]
    best = fit.headlined
    if best.estimate.method != fit.families[fit.best].estimate.method:
        held = str(headline_error(fit)) if np.isfinite(best.heldout_effort_error) else "–"
        rows.append(row(best, f"the same, by {METHODS[best.estimate.method]}: the headline", held))
    heads = ("Family", "What it knows", "Parameters", "Fitted error (%)", "Held-out error (%)", "Held-out R²")
    return number_table(heads, rows, words=2)


def _by_recording(fit: JointResult) -> Table:
    names = {p.recording: p.split for f in fit.families.values() for p in f.predictions}
    rows = []
    for recording, split in names.items():
        found = [[p for p in f.predictions if p.recording == recording] for f in fit.families.values()]
        errors = [percent(parts[0].effort_error) if parts else "–" for parts in found]
        best = [p for p in fit.headlined.predictions if p.recording == recording]
        inside = f"{100.0 * best[0].coverage:.1f}" if best else "–"
        rows.append((recording, figures.SPLIT_LABELS.get(split, split), *errors, inside))
    heads = ("Recording", "Use", *(f"{f} (%)" for f in fit.families), f"coverage of the interval, {fit.best} (%)")
    return number_table(heads, rows, "Effort error by recording and family.", words=2)


def _by_condition(fit: JointResult) -> tuple[tuple[str, Table], ...]:
    band = fit.headlined.band
    if band is None:
        return ()
    rows = [(c.kind, c.condition, f"{100.0 * c.coverage:.1f}", f"{c.samples}") for c in band.conditions]
    width = f"± {number(band.half_width, digits=3)} {unit_text(fit.effort_unit)}"
    caption = (
        f"Cross-validated coverage of the prediction interval of {width}, on blocks of the fitted recordings: each "
        "block is compared with a model and an interval from the others."
    )
    table = number_table(("Condition", "", "Coverage (%)", "Samples"), rows, caption, words=2)
    return (("Prediction interval by condition", table),)


def _diagnostics(fit: JointResult) -> Table:
    rows = []
    for f in fit.families.values():
        e, w = f.estimate, f.estimate.whiteness
        conditions = (number(x, digits=3) for x in (e.residual_sd, e.condition_number, e.scaled_condition_number))
        white = ("–", "–", "–")
        if w:
            white = number(w.lag1, digits=2), _p_value(w.p_value), percent(100.0 * w.effective_share)
        rows.append(Row((f.family, f"{e.samples}", *conditions, *white), f.family == fit.best))
    heads = (
        "Family", "Samples", f"Residual SD ({unit_text(fit.effort_unit)})", "Condition number", "columns scaled",
        "Lag-1 correlation", "Ljung-Box p", "Independent share (%)",
    )  # fmt: skip
    return number_table(
        heads,
        rows,
        "How well the recordings determine the parameters, and how far the residuals are from white: the independent "
        "share is how many of 100 samples count once their correlation is allowed for.",
    )


def _p_value(p: float) -> str:
    return "below 0.001" if p < 1e-3 else number(p, digits=2)


def _simulated(fit: JointResult, family: FamilyFit) -> Table:
    reading = MOTION_READINGS[fit.motion]
    runs = [(method, s) for method, made in family.simulations.items() for s in whole_recordings(made)]
    places = list(dict.fromkeys((s.mode, s.recording) for _, s in runs))
    # In open loop the recorded effort drives the simulation, so that it has no error.
    has_effort = any(mode != "openloop" for mode, _ in places)
    compared = ("position", "velocity", "acceleration", *(("effort",) if has_effort else ()))
    rows = []
    for mode, recording in sorted(places, key=lambda place: list(MODES).index(place[0])):
        for method, s in ((m, s) for m, s in runs if (s.mode, s.recording) == (mode, recording)):
            split = figures.SPLIT_LABELS.get(s.split, s.split)
            known = {k: e for k, e in s.errors.items() if mode != "openloop" or k != "effort"}
            errors = (percent(known.get(k, np.nan)) for k in compared)
            rmse = number(reading.scale * s.rmse, digits=3)
            rows.append((recording, split, MODES.get(mode, mode), METHODS.get(method, method), *errors, rmse))
    heads = (
        "Recording", "Use", "Simulation", "Parameters by", "Position (%)", "Velocity (%)", "Acceleration (%)",
        *((f"{EFFORT_NAMES.get(fit.effort_unit, 'Effort')} (%)",) if has_effort else ()),
        f"Position RMSE ({reading.position})",
    )  # fmt: skip
    return number_table(
        heads,
        rows,
        "Relative errors of the simulated signals: the norm of the difference over the norm of what was measured.",
        words=4,
    )


def _estimators_words(family: FamilyFit) -> str:
    """Explain in one sentence how the estimators differ."""
    present = {family.estimate.method, *family.others}
    does = [text for methods, text in ESTIMATOR_EXPLANATIONS if present & set(methods)]
    return (
        "The estimators weigh the same residuals differently: "
        f"{', '.join(does[:-1])}{', and ' if len(does) > 1 else ''}{does[-1]}; "
        "where real friction differs from the model, their results can differ."
    )


def _estimators(family: FamilyFit, level: float) -> Table:
    estimates = {family.estimate.method: family.estimate, **family.others}
    rows = []
    for name in family.model.names:
        unit = unit_text(family.model.unit(name))
        refused = family.estimate[name].refused
        found = [estimate.get(name) for estimate in estimates.values()]
        values = ("held" if p is None else value_and_half_interval(p, level, refused=refused) for p in found)
        rows.append((parameter_label(name) + (f" ({unit})" if unit else ""), *values))
    steps = (f"{e.iterations}" + ("" if e.converged else ", not converged") for e in estimates.values())
    rows.append(("Iterations", *steps))
    return number_table(
        ("Parameter", *(METHODS.get(m, m) for m in estimates)),
        rows,
        f"Parameters of the {family.family} model, each with half its {100.0 * level:.4g} % interval.",
    )


def _provenance(study: Study, fit: JointResult) -> Section:
    rig = study.rig
    effort = EFFORT_NAMES.get(fit.effort_unit, "Effort")
    entries = [
        ("Joint", f"{rig.joint}, {fit.motion}" + (f"; positive is {fit.lifts}" if fit.lifts else "")),
        (effort, _drive(study, fit)),
        ("Processing", fit.filter_note),
    ]
    return provenance(study, entries, _checksums(fit))


def _drive(study: Study, fit: JointResult) -> str:
    """Return the source of the effort in words."""
    drive = study.rig.drive
    assert drive is not None  # a joint without a drive is not identified
    if drive.kind == "torque":
        return "as a sensor measured it"
    if drive.constant is None:
        return f"the drive's {drive.kind}, without a known torque constant: results are in units of {drive.kind}"
    # With a known resistance, a voltage drive's constant is the motor's own, per ampere.
    per = "V" if drive.kind == "voltage" and drive.resistance is None else "A"
    unit = f"{fit.effort_unit}/{per}"
    text = f"from the drive's {drive.kind}, constant {number(drive.constant)} {unit_text(unit)}"
    if drive.gear_ratio != 1.0:
        text += f", gear ratio {drive.gear_ratio:g}"
    if drive.resistance is not None:
        text += f", resistance {number(drive.resistance)} Ω (back-EMF allowed for)"
    return text


def _checksums(fit: JointResult) -> Table:
    splits = {p.recording: p.split for p in fit.families[fit.best].predictions}
    rows = tuple(
        Row((name, figures.SPLIT_LABELS.get(splits.get(name, ""), "–"), digest))
        for name, digest in fit.checksums.items()
    )
    return Table(("Recording", "Use", "SHA-256 of its file"), rows, wide=True)
