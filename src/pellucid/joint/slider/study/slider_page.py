"""The report of a joint with a carriage: two directions against one body, errors trial by trial, geometry, methods.

One figure animates the recorded motion of joint and carriage, with the measured and predicted current.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ....models.estimates import Parameter
from ....models.friction_terms import COULOMB_FRICTION, LOAD_FRICTION, LOAD_GENERATING, LOAD_MOTORING, VISCOUS_FRICTION
from ....models.joint import GRAVITY, PARAMETER_INDEX
from ....models.slider_joint import BODY_UNITS
from ....study.drawing.drawing import Drawing, Head, dots, draw, heads, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.forest import Row, Table, number_table
from ....study.pages.moving import MovingDrawing, Way, cursor, strokes
from ....study.pages.page import Page, Section, Tile
from ....study.pages.quantities import (
    number,
    parameter_interval,
    parameter_note,
    relative_sd,
    typeset_sentence,
    unit_text,
)
from ....study.procedures.study_page import provenance, study_page
from ....study.recorded_motions import recorded_word
from ....study.study import Study
from ...study.joint_figures import busiest
from ..slider_fit import SLIDER_METHODS, SliderEstimate, SliderFit
from . import direction_figures as figures
from .identify_slider import directional_friction, predicted
from .slider_answer import error_value, evaluated_use
from .slider_result import SliderResult

FRAME_COUNT = 60
"""Number of frames of the movement."""

MAX_SHOWN_S = 12.0
"""Longest stretch of a recording that moves [s]."""

LINE_WIDTHS = (1.6, 1.3, 1.1)
"""Line widths of the predictions, in their order."""

DASH_PATTERNS = ((0, ()), (0, (4, 2)), (0, (1.5, 1.5)))
"""Dashes of the predictions, in their order."""


def moving_slider(
    fit: SliderFit, methods: Mapping[str, str], roles: Mapping[str, str], recorded: str
) -> MovingDrawing:
    """Draw the joint along the busiest seconds of a recording, its measured and predicted current, and the errors that
    the models are compared by, trial by trial.

    `methods` are up to three names of methods by what they are called here, `roles` the colours' roles by the same;
    `recorded` is the word for the recorded current, such as "measured".
    """
    held = [m for m in fit.motions if m.split == "heldout"] or list(fit.motions)
    motion = next((m for m in held if m.protocol == "constant_velocity"), held[0])
    time, measured = motion.time, motion.effort / fit.gain
    start, stop = busiest(time, measured, share=min(1.0, MAX_SHOWN_S / max(float(np.ptp(time)), 1e-9)))
    shown = (time >= start) & (time <= stop)
    figure = Figure(figsize=(FIGURE_WIDTH, 3.1), layout="constrained")
    arm, traces, errors = figure.subplots(1, 3, width_ratios=(0.7, 1.9, 1.15))
    line(traces, time[shown], measured[shown], color=colour("measured"), linewidth=2.4)
    for (words, method), width, dashes in zip(methods.items(), LINE_WIDTHS, DASH_PATTERNS, strict=False):
        # No model predicts the current at rest, because friction may then have any value up to its level.
        values = np.where(motion.scored, predicted(fit[method], motion) / fit.gain, np.nan)
        line(traces, time[shown], values[shown], color=colour(roles[words]), linewidth=width, linestyle=dashes)
    tidy(traces, first=True, text="Current (A)", ticks=5)
    traces.set_xlim(start, stop)
    traces.set_xlabel("Time (s)")
    use = "held out" if motion.split == "heldout" else "fitted"
    heads([traces], [Head(motion.recording.replace("_", " "), use, colour(motion.split))])
    key(traces, [(recorded, colour("measured"))])
    _error_columns(errors, {words: [e.current for e in fit.evaluated(m)] for words, m in methods.items()}, roles)
    frames = np.linspace(start, stop, FRAME_COUNT)
    angle = np.interp(frames, time, motion.position)
    arm.set_aspect("equal")
    arm.set_axis_off()
    arm.set_xlim(-1.25, 1.25)
    arm.set_ylim(-1.25, 1.25)
    arm.plot((0.0, 0.0), (0.0, -1.15), color=colour("rule"), linewidth=1.0, dashes=(4, 3))
    ends = np.column_stack([np.sin(angle), -np.cos(angle)])
    along = motion.slider / max(max(m.slider for m in fit.motions), 1e-9)
    # The carriage is a short stroke across the link, at its place between the axis and the farthest one.
    places = 0.85 * along * ends
    link = np.stack([np.zeros_like(ends), ends], axis=1)
    carriage = np.stack([places - 0.09 * ends, places + 0.09 * ends], axis=1)
    strokes(arm, link[0], "link", edgecolor=colour("measured"), linewidth=6.0, zorder=4)
    strokes(arm, carriage[0], "carriage", edgecolor=colour("heldout"), linewidth=15.0, zorder=5)
    arm.plot([0.0], [0.0], "o", color=colour("fitted"), markersize=12.0, zorder=6)
    ways = {"link": Way(arm, link), "carriage": Way(arm, carriage), "cursor": cursor(traces, frames)}
    caption = (
        f"Left: the joint as it was recorded, its carriage at {1e3 * motion.slider:.0f} mm (lengths are not to scale). "
        f"Middle: its current, {recorded}, and as each model predicts it where the joint moves, in the colours of the "
        f"right panel. Right: mean absolute error of the current in each {evaluated_use(fit)} trial (dots) and over "
        "them (bars)."
    )
    return MovingDrawing("answer", figure, caption, ways, float(stop - start))


def _error_columns(axis: Axes, errors: Mapping[str, Sequence[float]], roles: Mapping[str, str]) -> None:
    """Draw the errors [A] of each model in a column: a dot for each trial, and a bar and a number for their mean."""
    for column, (words, values) in enumerate(errors.items()):
        tone, known = colour(roles[words]), np.array([v for v in values if np.isfinite(v)])
        dots(axis, column + np.linspace(-0.16, 0.16, len(known)), known, tone, alpha=0.8, size=4.0)
        if len(known):
            mean = float(known.mean())
            axis.plot((column - 0.3, column + 0.3), (mean, mean), color=tone, linewidth=2.6, zorder=4)
    axis.set_xlim(-0.6, len(errors) - 0.4)
    highest = max((float(np.nanmax(v)) for v in errors.values() if len(v)), default=1.0)
    axis.set_ylim(0.0, 1.08 * highest)
    tidy(axis, first=True, text="Error (A)", ticks=5)
    axis.set_xlim(-0.6, len(errors) - 0.4)
    axis.set_xticks(range(len(errors)), [textwrap.fill(words, MAX_COLUMN_WORDS) for words in errors])
    for text, words in zip(axis.get_xticklabels(), errors, strict=True):
        text.set_color(colour(roles[words]))
        text.set_fontweight("bold")
    axis.grid(visible=False, axis="x")


MAX_COLUMN_WORDS = 12
"""Longest line of a column's name, in characters."""


SHORT_METHOD_NAMES: Mapping[str, str] = {
    "pooled": "one set",
    "dissociated": "two directions",
    "pooled_at_once": "one set, at once",
    "dissociated_at_once": "two directions, at once",
    "consistent": "one body",
    "load": "one body, friction by load",
}
"""Short names of the methods, for figures and tiles."""

COLOUR_ROLES: Mapping[str, str] = {
    "one set": "stribeck",
    "two directions": "heldout",
    "one body": "directional",
    "one body, friction by load": "fitted",
    "up": "heldout",
    "down": "load",
    "held still": "directional",
}
"""Colour role of each curve's name, the same in every figure."""

COMPARED_METHODS = ("pooled", "dissociated", "consistent", "load")
"""Methods whose errors the headline and the figures compare."""

FIRST_METHODS = ("load", "dissociated", "pooled")
"""Methods that the question compares, in the page's first figure."""

PROTOCOL_WORDS: Mapping[str, str] = {
    "constant_velocity": "constant",
    "swept_sine": "sweep",
    "swept_sine_integrated": "sweep, phase integrated",
}
"""Names of the protocols in figures."""

PARAMETER_WORDS: Mapping[str, str] = {
    "moment_slope": "Mass of the carriage, by gravity",
    "moment": "Moment of mass, sine",
    "cross_moment": "Moment of mass, cosine",
    "a0": "Inertia, constant",
    "a1": "Inertia, per slider position",
    "a2": "Inertia, per square of it",
    "carriage_moment": "Carriage, moment of mass",
    "carriage_mass": "Carriage, mass",
    "inertia": "Inertia at slider 0",
    "gravity": "Gravity, sine, at slider 0",
    "gravity_cosine": "Gravity, cosine",
    **{
        term.name: term.words
        for term in (COULOMB_FRICTION, VISCOUS_FRICTION, LOAD_FRICTION, LOAD_MOTORING, LOAD_GENERATING)
    },
    "adherence": "Adherence",
}
"""Descriptions of the parameters, by name."""

TRACED_METHODS = ("dissociated", "load")
"""Methods whose predicted current the figure of one trial shows, in addition to ``pooled``."""


def page(study: Study, result: SliderResult) -> Page:
    """Return the report's page, figures drawn."""
    fit = result.fit
    level = result.confidence
    recorded = recorded_word("", is_simulated=bool(study.config.simulated))
    sections = (_found(fit, level), _directions(fit), _errors(fit, recorded), _geometry(fit), _methods(fit, level))
    return study_page(
        title=f"{fit.study}: identified joint",
        answer=result.answer,
        verdicts=fit.verdicts,
        tiles=slider_tiles(fit),
        sections=(*sections, _provenance(study, fit)),
        figure=draw(moving_slider, fit, {SHORT_METHOD_NAMES[m]: m for m in FIRST_METHODS}, COLOUR_ROLES, recorded),
    )


def slider_tiles(fit: SliderFit) -> tuple[Tile, ...]:
    """Errors of the three models that matter, and how many places the carriage had."""
    places = np.unique(np.round([m.slider for m in fit.motions], 3))
    tiles = []
    for m in reversed(FIRST_METHODS):
        more = f"{len(fit[m].values)} parameters; {evaluated_use(fit)} trials"
        tiles.append(Tile(f"Error, {SHORT_METHOD_NAMES[m]}", str(error_value(fit, m)), "A", more))
    reach = f"{1e3 * places.min():.0f} to {1e3 * places.max():.0f} mm from the axis"
    return (*tiles, Tile("Places of the carriage", f"{len(places)}", "", reach))


# --- what is judged -------------------------------------------------------------------------------------------------


def _angles(fit: SliderFit) -> np.ndarray:
    low, high = min(m.position.min() for m in fit.motions), max(m.position.max() for m in fit.motions)
    return np.linspace(low, high, 121)


# --- sections -------------------------------------------------------------------------------------------------------


def _found(fit: SliderFit, level: float) -> Section:
    known = getattr(fit["load"].model, "known", {})
    tables = [_parameters(fit["load"], level, f"{SLIDER_METHODS['load'].capitalize()}.", known)]
    tables.append(_parameters(fit["dissociated"], level, f"{SLIDER_METHODS['dissociated'].capitalize()}."))
    if fit.static:
        rows = tuple(Row(_cells(p, level)) for p in fit.static)
        caption = "Static holds: gravity, and the mean torque of static friction."
        tables.append(Table(_heads(level), rows, frozenset({1, 3}), caption, True))
    return Section("found", "Identified parameters", (), tuple(tables))


def _cells(p: Parameter, level: float) -> tuple[str, ...]:
    """Return a parameter's first four cells in every table."""
    return _words(p.name), number(p.value, p.standard_error), unit_text(p.unit) or "–", parameter_interval(p, level)


def _heads(level: float) -> tuple[str, ...]:
    return "Parameter", "Value", "Unit", f"{100.0 * level:.4g} % interval"


def _words(name: str) -> str:
    suffixes = {"_up": ", up", "_down": ", down", "_positive": ", up", "_negative": ", down", "": ""}
    for suffix, words in suffixes.items():
        if name.endswith(suffix) and name.removesuffix(suffix) in PARAMETER_WORDS:
            return PARAMETER_WORDS[name.removesuffix(suffix)] + words
    return name.replace("_", " ")


def _parameters(
    estimate: SliderEstimate, level: float, caption: str, known: Mapping[str, float] | None = None
) -> Table:
    rows = [Row((*_cells(p, level), relative_sd(p), parameter_note(p, level))) for p in estimate.parameters]
    rows += [
        Row((_words(n), number(v), unit_text(BODY_UNITS.get(n, "1")), "–", "–", "weighed"))
        for n, v in (known or {}).items()
    ]
    heads = (*_heads(level), "Relative SD (%)", "Notes")
    return Table(heads, tuple(rows), frozenset({1, 3, 4}), caption, True)


def _directions(fit: SliderFit) -> Section:
    middle = 0.5 * sum(fit.rail)
    angles = _angles(fit)
    sets, body, values = fit.sets, fit.body("load"), fit["load"].values
    torques = {
        "up": sets.gravity("up", middle, angles),
        "down": sets.gravity("down", middle, angles),
        SHORT_METHOD_NAMES["load"]: body.gravity(values, middle, angles),
    }
    if fit.static:
        slope, moment, cross = (p.value for p in fit.static[:3])
        torques["held still"] = GRAVITY * ((slope * middle + moment) * np.sin(angles) + cross * np.cos(angles))
    x = np.linspace(*fit.rail, 41)
    inertias = {
        "up": sets.inertia("up", x),
        "down": sets.inertia("down", x),
        SHORT_METHOD_NAMES["load"]: body.inertia(values, x),
    }
    drawings = (
        draw(
            figures.gravity_by_direction, np.degrees(angles), torques, roles=COLOUR_ROLES,
            caption=f"Gravity torque with the carriage at {1e3 * middle:.0f} mm. The parameters for upward and for "
            "downward motion include the friction of that direction; where they differ, friction was attributed to "
            "gravity.",
        ),
        draw(
            figures.inertia_by_slider, x, inertias, roles=COLOUR_ROLES,
            caption="Inertia about the joint's axis along the rail: for each direction separately, without a physical "
            "constraint, and for one rigid body.",
        ),
        _friction(fit, middle, angles),
    )  # fmt: skip
    return Section(
        "directions",
        "Separate directions and one rigid body",
        (
            "A rigid body has the same gravity and inertia in both directions of motion. If the separately fitted "
            "directions differ, they contain load-dependent friction, which adds to gravity in lifting and subtracts "
            "from it in lowering.",
        ),
        drawings=drawings,
    )


def _friction(fit: SliderFit, middle: float, angles: np.ndarray) -> Drawing:
    """Half the torque between up and down near rest, over the load, where the load grows with the angle."""
    load = fit.body("load").gravity(fit["load"].values, middle, angles)
    rising = slice(int(np.argmin(load[: np.argmax(load) + 1])), int(np.argmax(load)) + 1)
    angles, load = angles[rising], load[rising]
    curves = {SHORT_METHOD_NAMES["dissociated"]: directional_friction(fit.sets, np.array([middle]), angles)[0]}
    for method in ("consistent", "load"):
        vector = fit.body(method).vector(fit[method].values, middle)
        dry, share = (
            np.mean([vector[PARAMETER_INDEX[target]] for target in term.targets])
            for term in (COULOMB_FRICTION, LOAD_FRICTION)
        )
        curves[SHORT_METHOD_NAMES[method]] = dry + share * np.abs(load)
    return draw(
        figures.friction_by_load, load, curves, roles=COLOUR_ROLES,
        caption="Friction near rest (half the difference of the torques upwards and downwards) against the gravity "
        f"torque ({1e3 * middle:.0f} mm, {np.degrees(angles[0]):.0f} to {np.degrees(angles[-1]):.0f} deg).",
    )  # fmt: skip


def _errors(fit: SliderFit, recorded: str) -> Section:
    evaluated = {m: {e.recording: e for e in fit.evaluated(m)} for m in COMPARED_METHODS}
    names = list(evaluated["pooled"])
    errors = {SHORT_METHOD_NAMES[m]: np.array([evaluated[m][n].current for n in names]) for m in COMPARED_METHODS}
    protocols = [evaluated["pooled"][n].protocol for n in names]
    use = evaluated_use(fit)
    drawings = [
        draw(
            figures.paired_errors,
            errors,
            [PROTOCOL_WORDS.get(p, p.replace("_", " ")) for p in protocols],
            roles=COLOUR_ROLES,
            ids={SHORT_METHOD_NAMES[m]: f"{fit.study}.{m}.error" for m in COMPARED_METHODS},
        )
    ]
    trace = _trace(fit, names, recorded)
    if trace is not None:
        drawings.append(trace)
    labels = [f"{n.replace('_', ' ')}, {1e3 * evaluated['pooled'][n].slider:.0f} mm" for n in names]
    drawings.append(draw(figures.error_by_trial, labels, errors, roles=COLOUR_ROLES))
    rows = []
    for protocol in dict.fromkeys(protocols):
        chosen = np.array([p == protocol for p in protocols])
        means = (number(float(e[chosen].mean()), digits=3) for e in errors.values())
        rows.append(Row((protocol.replace("_", " "), f"{int(chosen.sum())}", *means)))
    rows.append(Row(("all", f"{len(names)}", *(str(error_value(fit, m)) for m in COMPARED_METHODS)), True))
    heads = ("Protocol", "Trials", *(f"{m} (A)" for m in errors))
    table = number_table(heads, rows, f"Mean absolute current error over {use} trials, while the joint moves.")
    return Section(
        "errors",
        "Errors by trial",
        (f"Error of the predicted current in {len(names)} {use} trials, by model.",),
        (table,),
        tuple(drawings),
    )


def _trace(fit: SliderFit, names: list[str], recorded: str) -> Drawing | None:
    """One constant-velocity trial, or the first there is."""
    motions = [m for m in fit.motions if m.recording in names]
    if not motions:
        return None
    m = next((m for m in motions if m.protocol == "constant_velocity"), motions[0])
    made = {SHORT_METHOD_NAMES[name]: predicted(fit[name], m) / fit.gain for name in ("pooled", *TRACED_METHODS)}
    # No model predicts the current at rest, because friction may then have any value up to its level.
    made = {name: np.where(m.scored, values, np.nan) for name, values in made.items()}
    return draw(
        figures.current_trace, m.time, m.effort / fit.gain, made, m.velocity, recorded, roles=COLOUR_ROLES,
        caption=f"Motor current during {m.recording.replace('_', ' ')}, with the carriage at {1e3 * m.slider:.0f} mm: "
        f"{recorded} (black; white on a dark page) and predicted where the joint moves (colour), with the velocity "
        "beneath.",
    )  # fmt: skip


def _geometry(fit: SliderFit) -> Section:
    g = fit.geometry
    optical = [p for p in g.placements if p.optical]
    paragraphs = []
    if optical and np.all(np.isfinite(g.axis)):
        x, y, z = (number(float(v), 1e-4) for v in g.axis)
        paragraphs.append(
            f"The axis points along ({x}, {y}, {z}) in the laboratory, with a standard error of "
            f"{np.degrees(g.axis_se):.2g} deg; its position has a standard error of {1e3 * g.origin_se:.2g} mm. The "
            f"RMS deviation of the markers from a rotation about it is {1e3 * g.residual:.2g} mm. These errors include "
            "marker noise only."
        )
        delays = 1e3 * np.array([p.delay for p in optical if p.aligned])
        if len(delays):
            paragraphs.append(
                f"The cameras' clock is {number(float(delays.min()), 0.1)} to {number(float(delays.max()), 0.1)} ms "
                "from the robot's; each recording is corrected by its own delay."
            )
    rows = []
    for p in g.placements:
        error = f"{1e3 * p.slider_se:.2g}" if np.isfinite(p.slider_se) else "–"
        clock = ("–", "ruler", "–")
        if p.optical:
            clock = number(1e3 * p.delay, 0.1), "yes" if p.aligned else "no", f"{p.lost}"
        rows.append(Row((p.recording, f"{1e3 * p.slider:.2f}", error, *clock)))
    heads = ("Recording", "Slider (mm)", "its SE (mm)", "Clock delay (ms)", "told by its motion", "Frames lost")
    table = Table(
        heads, tuple(rows), frozenset({1, 2, 3, 5}),
        "Where the carriage was, and what the cameras' clock shows when the robot's shows 0.", True,
    )  # fmt: skip
    return Section("geometry", "Axis, carriage and clocks", tuple(paragraphs), (table,))


def _methods(fit: SliderFit, level: float) -> Section:
    rows = []
    best = min(("dissociated", "load"), key=fit.evaluated_error)
    for method, estimate in fit.estimates.items():
        error = fit.evaluated_error(method)
        seen = [e.current for e in fit.errors[method] if e.split == "fitted" and np.isfinite(e.current)]
        figures_of = (fit.gain * error, float(np.mean(seen or [np.nan])), estimate.residual_sd)
        numbers = (number(x, digits=3) for x in figures_of)
        first = (SLIDER_METHODS[method], f"{len(estimate.values)}", str(error_value(fit, method)))
        rows.append(Row((*first, *numbers, f"{estimate.samples}"), method == best))
    word = evaluated_use(fit).capitalize()
    heads = (
        "Method", "Parameters", f"{word} error (A)", f"{word} error (N·m)", "Error on fitted (A)", "Residual SD (N·m)",
        "Samples",
    )  # fmt: skip
    caption = "All identification methods; errors are mean absolute errors, averaged over trials."
    notes = [f"{SLIDER_METHODS[m]}: {note}." for m, e in fit.estimates.items() for note in e.notes]
    others = tuple(
        _parameters(fit[m], level, f"{SLIDER_METHODS[m].capitalize()}.", getattr(fit[m].model, "known", {}))
        for m in fit.estimates
        if m not in ("dissociated", "load")
    )
    return Section(
        "methods",
        "Methods",
        (f"Signals: {fit.filter_note}.",),
        (number_table(heads, rows, caption), *others),
        notes=tuple(typeset_sentence(note) for note in notes),
    )


def _provenance(study: Study, fit: SliderFit) -> Section:
    rig = study.rig
    entries = [
        ("Joint", f"{rig.joint}, {rig.motion}" + (f"; positive is {rig.lifts}" if rig.lifts else "")),
        ("Rail", f"{1e3 * fit.rail[0]:.0f} to {1e3 * fit.rail[1]:.0f} mm from the axis"),
        ("Torque", f"from the drive's current, {number(fit.gain)} N·m/A at the joint"),
        ("Processing", fit.filter_note),
    ]
    splits = {m.recording: m.split for m in fit.motions}
    sums = tuple(Row((n, "held out" if splits.get(n) == "heldout" else "fitted", d)) for n, d in fit.checksums.items())
    return provenance(study, entries, Table(("Recording", "Use", "SHA-256 of its file"), sums, wide=True))
