"""Page of a robot: the moving arm, efforts and friction of each joint, and the uncertainty of all parameters."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...study.drawing.drawing import draw
from ...study.pages.forest import Row, Table, number_table
from ...study.pages.page import Page, Section, Tile
from ...study.pages.quantities import (
    number,
    parameter_interval,
    parameter_label,
    percent,
    relative_sd,
    unit_text,
)
from ...study.procedures.study_page import figure_tables, provenance, study_page
from ...study.recorded_motions import recorded_word
from ...study.study import Study
from ..fit.friction_terms import sum_friction
from ..fit.tree_estimate import parameter_verdict
from . import tree_figures as figures
from .tree_figures import Cell, FrictionCurve, RippleSpectrum, short
from .tree_result import MODEL_DESCRIPTIONS, ROW_KIND_DESCRIPTIONS, TreeResult, errors_along, terms_of

BODY_HEADS = {
    "mass": "m", "moment_x": "m·x", "moment_y": "m·y", "moment_z": "m·z", "inertia_xx": "Ixx", "inertia_xy": "Ixy",
    "inertia_xz": "Ixz", "inertia_yy": "Iyy", "inertia_yz": "Iyz", "inertia_zz": "Izz",
}  # fmt: skip
"""Column heads of the ten inertial parameters of a body."""

_TERM_COLUMN_ORDER = (
    "inertia", "viscous", "positive", "negative", "coulomb", "offset", "stiffness", "load", "root", "stribeck",
    "velocity", "sine", "cosine",
)  # fmt: skip
"""Last words of column heads, in the order of the columns of a table of friction."""

MAX_DRAWN_ROWS = 4000
"""Largest number of rows, over all recordings, in figures of friction."""


def page(study: Study, result: TreeResult) -> Page:
    """Build the page of a result."""
    judged = ROW_KIND_DESCRIPTIONS[result.judged]
    errors = {MODEL_DESCRIPTIONS[e.model]: e.each for e in result.in_order if e.judged == result.judged}
    arm = draw(figures.arm, result, errors, judged)
    trace = figures.drawn_trace(result)
    recorded = recorded_word(result.computed, is_simulated=bool(study.config.simulated))
    own = errors_along([trace])
    efforts = draw(figures.efforts, trace, result.names, result.effort_units, own, recorded)
    curves = _curves(result)
    sections = [
        Section("arm", "The arm", drawings=(arm,)),
        Section("joints", "Prediction of each joint", tables=figure_tables(result, "Prediction of each joint")),
        Section(
            "errors",
            "Errors",
            (
                "A richer model is better only if it reduces the error on data that were not fitted. The simplest "
                "reference models are shown for comparison.",
            ),
            figure_tables(result, "errors"),
        ),
        Section("effort", "Effort of each joint", drawings=(efforts,)),
        Section(
            "friction",
            "Friction",
            (_friction_words(result),),
            figure_tables(result, "Friction"),
            (draw(figures.friction, curves), draw(figures.friction_by_load, curves)),
            folded=_published(result),
        ),
        *_choice(result),
        *_ripple(result),
        Section(
            "parameters",
            "Identifiability of the parameters",
            (
                "Efforts are linear in the ten inertial parameters of every link, but identify only some combinations "
                "of them. Each combination is named after one of its parameters.",
            ),
            drawings=(draw(figures.shown_parameters, *_map(result)),),
            tables=figure_tables(result, "Parameters of joints"),
            folded=tuple(
                (f"Every parameter: {MODEL_DESCRIPTIONS[name]}", _parameters(result, name)) for name in result.models
            ),
        ),
        *_intervals(result),
        *_drives(result),
    ]
    return study_page(
        title=f"{result.study}: identified robot",
        answer=result.answer,
        tiles=_tiles(result),
        sections=(*sections, _provenance(study, result)),
        verdicts=result.verdicts,
    )


def _tiles(found: TreeResult) -> list[Tile]:
    best = found.errors_of("best", found.judged)
    worst = found.worst
    count, plain = len(found.best.parameters), len(found.models["base"].parameters)
    identified_count = sum(parameter_verdict(p) == "identified" for p in found.best.parameters.values())
    tiles = [
        Tile("Mean effort error", percent(best.mean), "%", f"on {ROW_KIND_DESCRIPTIONS[found.judged]}"),
        Tile("Worst joint", percent(best.each[worst]), "%", short(found.names[worst])),
        Tile("Parameters that differ from 0", f"{identified_count}", f"of {count}", f"{plain} with plain friction"),
    ]
    if found.jackknife is not None:
        share = number(found.jackknife.share_within, digits=3)
        tiles.append(Tile("Standard errors confirmed", share, "%", "within a factor of 2 of the jackknife"))
    for p in [p for p in found.payloads if not p.mass.refused][:1]:
        known = "" if p.known is None else f"{number(p.known)} kg stated"
        known = "used for the gains, no test" if p.tests == "nothing" else known
        tiles.append(Tile("Payload", number(p.mass.value, p.mass.standard_error), "kg", known))
    return tiles


def _friction_words(found: TreeResult) -> str:
    terms = {short(name): terms_of(found, k) for k, name in enumerate(found.names)}
    given = [f"{name}: {', '.join(each)}" for name, each in terms.items() if each]
    if not given:
        return "No joint needs more than viscous and dry friction and an offset."
    text = "Every joint has viscous and dry friction and an offset. Cross-validation adds these terms: "
    return f"{text}{'; '.join(given).replace('_', ' ')}."


def _curves(found: TreeResult) -> list[FrictionCurve]:
    """Return the recorded friction of each joint, and the modelled one at small, medium and large load."""
    best, width = found.best, found.best.velocity_width
    made = []
    for k, name in enumerate(found.names):
        speed, load, measured = (np.concatenate(parts) for parts in zip(*_rows_of(found, k), strict=True))
        step = max(1, len(speed) // MAX_DRAWN_ROWS)
        speed, load, measured = speed[::step], load[::step], measured[::step]
        numbers = best.joint_numbers(k)
        top = float(np.abs(speed).max(initial=1e-6))
        grid = np.concatenate([np.linspace(-top, -0.002 * top, 120), np.linspace(0.002 * top, top, 120)])
        loads = np.quantile(np.abs(load), (1 / 6, 1 / 2, 5 / 6)) if len(load) else np.array([0.0, 0.5, 1.0])
        curves = {repr(float(x)): sum_friction(numbers, grid, np.full_like(grid, x), width) for x in loads}
        coordinate = "rad/s" if found.robot.units[k][0] == "rad" else "m/s"
        made.append(
            FrictionCurve(
                name, found.effort_units[k], coordinate, speed, load, measured, grid, curves, numbers.get("load", 0.0)
            )
        )
    return made


def _rows_of(found: TreeResult, k: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield speed, load and measured friction of a joint along each fitted recording.

    The measured friction is the modelled one plus the residual; both have passed the filter of the effort.
    """
    for trace in found.traces:
        if trace.use == "fit":
            rows = trace.moving[:, k]
            left = trace.effort - trace.predicted
            yield trace.velocity[rows, k], trace.load[rows, k], (trace.friction + left)[rows, k]


def _published(found: TreeResult) -> tuple[tuple[str, Table], ...]:
    """Return a table of published values and those of the model with plain friction."""
    base = found.models["base"].parameters
    rows = []
    for joint, table in found.published.items():
        for name, value in table.items():
            p = base.get(f"{joint}.{name}")
            if p is not None:
                off = 100.0 * (p.value - value) / abs(value) if value else float("nan")
                found_value, unit = number(p.value, p.standard_error), unit_text(p.unit)
                difference = f"{off:+.1f}".replace("-", "−")
                rows.append(Row((short(joint), parameter_label(name), found_value, number(value), unit, difference)))
    if not rows:
        return ()
    heads = ("Joint", "Parameter", "Found", "Published", "Unit", "Difference (%)")
    return (("Comparison with published values", Table(heads, tuple(rows), frozenset({2, 3, 5}))),)


def _choice(found: TreeResult) -> tuple[Section, ...]:
    if found.choice is None:
        return ()
    names = dict.fromkeys(t for k in range(len(found.names)) for t in (*terms_of(found, k), *found.choice.terms[k]))
    ripple = any(found.choice.ripples.values()) or bool(found.best.ripples)
    terms = (*names, *(("ripple",) if ripple else ()))
    if not terms:
        return ()
    shares, chosen = np.zeros((2, len(found.names), len(terms)))
    turned = {r.motor for r in found.best.ripples}
    for k, joint in enumerate(found.names):
        for i, term in enumerate(names):
            shares[k, i] = found.choice.terms[k].get(term, 0) / found.choice.folds
            chosen[k, i] = term in found.best.families[k]
        if ripple:
            shares[k, -1] = found.choice.ripples.get(joint, 0) / found.choice.folds
            chosen[k, -1] = k in turned
    drawing = draw(figures.chosen_families, found.names, terms, shares, chosen, found.choice.folds)
    text = (
        "A joint receives a term if the term improves the prediction of held-out segments. To test the choice, it is "
        "repeated without each segment in turn."
    )
    return (Section("families", "Friction terms chosen", (text,), drawings=(drawing,)),)


def _ripple(found: TreeResult) -> tuple[Section, ...]:
    spectra = []
    for ripple in found.best.ripples:
        k, angle, left = ripple.motor, [], []
        for trace in (t for t in found.traces if t.use == "fit"):
            rows = trace.moving[:, k]
            turned = (trace.position @ found.robot.turns_array.T)[rows, k]
            angle.append(turned)
            left.append((trace.effort - trace.predicted)[rows, k] + ripple.effort(turned))
        order, amplitude = _spectrum(np.concatenate(angle), np.concatenate(left), ripple.order)
        spectra.append(RippleSpectrum(found.names[k], found.effort_units[k], order, amplitude, ripple.order))
    if not spectra:
        return ()
    text = (
        "Cogging, teeth and bearings cause ripple that repeats with the motor's angle at unknown orders. The model "
        "includes a ripple if it is a peak in the spectrum of the residuals and improves the prediction of held-out "
        "segments."
    )
    return (Section("ripple", "Drive ripple", (text,), drawings=(draw(figures.ripples, spectra),)),)


def _spectrum(angle: np.ndarray, left: np.ndarray, order: float) -> tuple[np.ndarray, np.ndarray]:
    """Return orders around a given one, and the residual's amplitude at each, (n,), by fitting one wave at a time."""
    low, high = max(0.3 * order, order - 40.0), order + 40.0
    turns = float(np.ptp(angle)) / (2.0 * np.pi)
    orders = np.unique(np.append(np.arange(low, high, max(0.12 / max(turns, 1e-3), (high - low) / 1500)), order))
    phase = np.exp(1j * np.outer(orders, angle - angle.mean()))
    return orders, 2.0 * np.abs(phase @ (left - left.mean())) / len(left)


def _map(found: TreeResult) -> tuple[tuple[str, ...], tuple[str, ...], dict[tuple[str, str], Cell]]:
    """Return rows, columns and cells of the map of identified parameters."""
    columns, rows, cells = [], [], {}
    bodies = tuple(joint.child for joint in found.robot.tree.order)
    for name, parameter in found.best.parameters.items():
        owner, _, number_name = name.removesuffix(".regrouped").rpartition(".")
        column = BODY_HEADS.get(number_name, number_name.replace("_", " "))
        if column not in columns:
            columns.append(column)
        if owner not in rows:
            rows.append(owner)
        remark = "bound" if parameter.at_bound else "–" if parameter.refused else ""
        cells[(owner, column)] = Cell(parameter.relative_sd, remark)
    first = [c for c in BODY_HEADS.values() if c in columns]
    columns = first + sorted(
        (c for c in columns if c not in first), key=lambda c: _TERM_COLUMN_ORDER.index(c.split()[-1])
    )
    rows.sort(key=lambda row: (bodies + found.names).index(row))
    wrapped = {c: c.replace(" ", "\n") for c in columns}
    return tuple(rows), tuple(wrapped.values()), {(r, wrapped[c]): cell for (r, c), cell in cells.items()}


def _parameters(found: TreeResult, name: str) -> Table:
    model = found.models[name]
    rows = []
    for p in model.parameters.values():
        reading = model.readings.get(p.name, "")
        stands = "" if reading in ("", p.name) else reading
        words = p.name.replace(".regrouped", " and others").replace("_", " ").replace(".", ": ")
        spread = f"{relative_sd(p)} %".replace("– %", "–")
        rows.append(
            Row((
                words, number(p.value, p.standard_error), unit_text(p.unit) or "–",
                parameter_interval(p, found.confidence), spread, parameter_verdict(p), stands.replace("_", " "),
            ))
        )  # fmt: skip
    interval = f"{100.0 * found.confidence:g} % interval"
    heads = ("Parameter", "Value", "Unit", interval, "Relative SD", "Verdict", "Stands for")
    return Table(heads, tuple(rows), frozenset({1, 3, 4}), wide=True)


def _intervals(found: TreeResult) -> tuple[Section, ...]:
    if found.jackknife is None:
        return ()
    jack = found.jackknife
    values = np.array([abs(p.value) for p in found.best.parameters.values()])[: len(jack.sd)]
    with np.errstate(divide="ignore", invalid="ignore"):
        stated, out = 100.0 * jack.stated / values, 100.0 * jack.sd / values
    text = (
        "Residuals are autocorrelated: ordinary least-squares standard errors, which treat rows as independent, are "
        f"{number(jack.textbook_ratio, digits=2)} times too small here. The stated ones are computed from blocks of "
        f"rows. The jackknife, which omits each of {jack.segments} segments in turn, is an independent check."
    )
    drawing = draw(figures.intervals, stated, out, jack.share_within)
    return (Section("intervals", "Check of the standard errors", (text,), drawings=(drawing,)),)


def _drives(found: TreeResult) -> tuple[Section, ...]:
    """Return the section on gains, if they were identified, and payloads."""
    tables, level = list(figure_tables(found, "Payloads")), found.confidence
    if found.identified_gains:
        rows = [
            (short(p.name.removesuffix(".gain")), number(p.value, p.standard_error), parameter_interval(p, level))
            for p in found.identified_gains
        ]
        unit = unit_text(found.identified_gains[0].unit)
        heads = ("Drive of", f"Gain ({unit})", f"{100.0 * level:g} % interval")
        tables.insert(0, number_table(heads, rows, f"Gains of the drives, {found.gains_note}.", wide=False))
    return (Section("drives", "Drives and payload", tables=tuple(tables)),) if tables else ()


def _provenance(study: Study, found: TreeResult):
    tree = found.robot.tree
    entries = [
        ("Robot", f"{len(found.names)} joints: {', '.join(map(short, found.names))}; from {tree.source}"),
        ("Drives' gains", found.gains_note),
        ("Segments", f"{found.segments} in the fitted recordings"),
        ("Processing", found.filter_note),
    ]
    uses = {t.recording: t.use for t in found.traces}
    sums = tuple(
        Row((name, {"fit": "fitted", "validate": "held out"}.get(uses.get(name, ""), "payload"), digest))
        for name, digest in found.checksums.items()
    )
    return provenance(study, entries, Table(("Recording", "Use", "SHA-256 of its file"), sums, wide=True))
