"""The figures of a report: from a fit to vector drawings. The only code of the package that imports Matplotlib.

Figures are made with Matplotlib's objects alone (no pyplot, no global state, no window). Blue is fitted, orange is
held out, dark grey is measured; colours and sizes live in `style`.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from ..identification.fit import FamilyFit, JointFit, Prediction, Simulation
from ..models.friction import FrictionCurve, friction_curve
from .quantities import (
    EFFORTS,
    METHODS,
    READINGS,
    Reading,
    label,
    percent,
    unit_text,
)
from .style import COLOURS, FIGURE_WIDTH, RC, SANS, colour, family_colour

COLUMNS = 4
"""Recordings side by side in one figure."""
LINE_POINTS = 900
"""A line keeps at most about so many points: the extremes of every stretch, so that no peak is lost."""
DOT_POINTS = 1400
SPLITS = {"fitted": "fitted", "heldout": "held out"}


@dataclass(frozen=True)
class Drawing:
    """A figure and what is said of it.

    Parameters
    ----------
    name : str
        File name without suffix, and prefix of every id in the inline SVG.
    figure : matplotlib.figure.Figure
    caption : str
        Plain text below the figure: what is drawn, and how to read it.
    """

    name: str
    figure: Figure
    caption: str

    def inline(self) -> str:
        """The figure as an ``<svg>`` element for an HTML page: ids of its own, colours as CSS variables."""
        return inline_svg(self.figure, self.name)

    def save(self, folder: FilePath) -> tuple[FilePath, ...]:
        """Write ``<name>.svg`` and ``<name>.pdf`` into `folder`."""
        written = []
        with matplotlib.rc_context(dict(RC)):
            for suffix, metadata in (("svg", {"Date": None}), ("pdf", {"CreationDate": None, "ModDate": None})):
                path = FilePath(folder) / f"{self.name}.{suffix}"
                self.figure.savefig(path, metadata=metadata, facecolor=colour("paper"))
                written.append(path)
        return tuple(written)


@dataclass(frozen=True)
class Trace:
    """One recording as it is drawn: arrays of shape (n,) in SI, NaN where the line is to break.

    `split` is "fitted" or "heldout".
    """

    recording: str
    split: str
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


def draw(make: Callable[..., Drawing], *args, **options) -> Drawing:
    """Call a figure's function under the report's style.

    Parameters
    ----------
    make : callable
        One of the functions below.
    *args, **options
        Its arguments.

    Returns
    -------
    Drawing
    """
    with matplotlib.rc_context(dict(RC)):
        drawing = make(*args, **options)
        # Once, so that every later output has the same layout.
        drawing.figure.draw_without_rendering()
        drawing.figure.set_layout_engine("none")
        return drawing


# --- the recordings -------------------------------------------------------------------------------------------------


def recordings(traces: Sequence[Trace], fit: JointFit, name: str = "recordings") -> Drawing:
    """Position, velocity and effort of each recording against time, fitted and held out apart by colour.

    Parameters
    ----------
    traces : sequence of Trace
        At most `COLUMNS`.
    fit : JointFit
    name : str

    Returns
    -------
    Drawing
    """
    reading = READINGS[fit.motion]
    figure = Figure(figsize=(FIGURE_WIDTH, 5.4), layout="constrained")
    axes = figure.subplots(
        3, len(traces), sharey="row", sharex="col", squeeze=False, width_ratios=_durations([t.time for t in traces])
    )
    rows = (
        (f"Position ({reading.position})", "position", reading.scale),
        (f"Velocity ({reading.velocity})", "velocity", reading.scale),
        (_effort_label(fit), "effort", 1.0),
    )
    for column, trace in enumerate(traces):
        for row, (text, key, scale) in enumerate(rows):
            axis = axes[row, column]
            _line(axis, trace.time, scale * getattr(trace, key), color=colour(trace.split), linewidth=1.1)
            _tidy(axis, first=column == 0, text=text, ticks=5)
        _head(axes[0, column], trace.recording, SPLITS[trace.split], trace.split)
        axes[2, column].set_xlabel("Time (s)")
    held = any(t.split == "heldout" for t in traces)
    return Drawing(
        name,
        figure,
        "What was recorded: joint position, its velocity and the effort at the joint, after the filter. "
        + ("Blue was fitted; orange was held out and only judged." if held else "Blue was fitted."),
    )


# --- the fit in effort ----------------------------------------------------------------------------------------------


def effort(fit: JointFit, family: FamilyFit, name: str = "effort") -> Drawing:
    """Measured and predicted effort with the prediction interval, and a zoom where the effort changes most.

    Parameters
    ----------
    fit : JointFit
    family : FamilyFit
    name : str

    Returns
    -------
    Drawing
    """
    groups = _by_recording(family.predictions)
    shown = [g for g in groups if g[0].split == "fitted"][:2] + [g for g in groups if g[0].split == "heldout"][:4]
    figure = Figure(figsize=(FIGURE_WIDTH, 0.5 + 2.15 * len(shown)), layout="constrained")
    axes = figure.subplots(len(shown), 2, squeeze=False, width_ratios=(2.3, 1.0), sharey=True)
    for row, group in enumerate(shown):
        first = group[0]
        time, measured, predicted = _joined(group, lambda p: p.time, lambda p: p.effort, lambda p: p.predicted)
        half = first.half_width
        wide, zoom = axes[row]
        window = _busiest(time, measured)
        for axis, (low, high) in ((wide, (np.nanmin(time), np.nanmax(time))), (zoom, window)):
            inside = (time >= low) & (time <= high) | np.isnan(time)
            t, m, p = time[inside], measured[inside], predicted[inside]
            # A zoom shows every sample; the overview only needs the outline.
            bt, bp = (t, p) if axis is zoom else _every(LINE_POINTS, t, p)
            axis.fill_between(bt, bp - half, bp + half, color=colour(first.split), alpha=0.2, linewidth=0)
            _line(axis, t, m, color=colour("measured"), linewidth=2.2 if axis is zoom else 1.2)
            _line(axis, t, p, color=colour(first.split), linewidth=1.1)
            axis.set_xlim(low, high)
        wide.axvspan(*window, color=colour("faint"), alpha=0.25, linewidth=0)
        _tidy(wide, first=True, text=_effort_label(fit))
        _tidy(zoom, first=False)
        error, covered = _pooled_error(group), float(np.mean(np.concatenate([_inside(p) for p in group])))
        _head(
            wide,
            first.recording,
            f"{SPLITS[first.split]} · error {percent(error)} % · {percent(100.0 * covered)} % of samples inside",
            first.split,
        )
        zoom.set_title("zoom on the grey window", color=colour("muted"), fontsize=8.5)
        if row == 0:
            _key(zoom, [("measured", colour("measured")), ("predicted", colour(first.split))])
    for axis in axes[-1]:
        axis.set_xlabel("Time (s)")
    left_out = len(groups) - len(shown)
    return Drawing(
        name,
        figure,
        f"Effort measured (grey) and predicted by the {family.family} model (colour); the band is the 95 % prediction "
        "interval. Error is the norm of the difference as a share of the norm of the effort."
        + _rest(left_out).replace("the table below", "the table of held-out errors"),
    )


# --- the fit in simulated motion ------------------------------------------------------------------------------------


def simulation(
    fit: JointFit, simulations: Mapping[str, Sequence[Simulation]], mode: str, name: str = "simulation"
) -> Drawing:
    """Measured and simulated motion, and their difference in position, for one mode of simulation.

    Parameters
    ----------
    fit : JointFit
    simulations : mapping of str to sequence of Simulation
        By method; all of `mode`. At most `COLUMNS` recordings are drawn, held-out ones first in line.
    mode : {"closed_loop", "openloop"}
    name : str

    Returns
    -------
    Drawing
    """
    reading = READINGS[fit.motion]
    reference = next(iter(simulations))
    chosen = _shown([_whole(g) for g in _by_recording(simulations[reference])])
    figure = Figure(figsize=(FIGURE_WIDTH, 7.0), layout="constrained")
    axes = figure.subplots(
        4,
        len(chosen),
        squeeze=False,
        sharey="row",
        sharex="col",
        width_ratios=_durations([s.time for s in chosen]),
        height_ratios=(1.1, 0.9, 1.0, 1.0),
    )
    off_scale, off_unit = _difference_unit(chosen, reading)
    for column, run in enumerate(chosen):
        top, off, speed, drive = axes[:, column]
        for axis, key, scale in (
            (top, "position", reading.scale),
            (speed, "velocity", reading.scale),
            (drive, "effort", 1.0),
        ):
            _line(axis, run.time, scale * np.asarray(run.measured[key]), color=colour("measured"), linewidth=1.1)
            _line(
                axis, run.time, scale * np.asarray(run.simulated[key]), color=colour(run.split), linewidth=1.1,
                dashes=(4, 1.6),
            )  # fmt: skip
        for k, (method, runs) in enumerate(simulations.items()):
            tone = colour(run.split) if method == reference else colour("load")
            for r in (_whole(g) for g in _by_recording(runs) if g[0].recording == run.recording):
                difference = off_scale * (r.measured["position"] - r.simulated["position"])
                _line(off, r.time, difference, color=tone, linewidth=1.0, zorder=3 - 0.1 * k)
        errors = run.errors
        _head(
            top,
            run.recording,
            f"{SPLITS[run.split]} · position error {percent(errors.get('position', np.nan))} %",
            run.split,
        )
        for axis, text in zip(
            (top, off, speed, drive),
            (
                f"Position ({reading.position})",
                f"Difference ({off_unit})",
                f"Velocity ({reading.velocity})",
                _effort_label(fit),
            ),
            strict=True,
        ):
            _tidy(axis, first=column == 0, text=text, ticks=5)
        drive.set_xlabel("Time (s)")
    _key(axes[0, 0], [("measured", colour("measured")), ("simulated", colour(chosen[0].split))])
    if len(simulations) > 1:
        tones = [colour(chosen[0].split), *[colour("load")] * (len(simulations) - 1)]
        _key(axes[1, 0], [(METHODS.get(m, m), t) for m, t in zip(simulations, tones, strict=True)])
    loop = {
        "closed_loop": "The identified joint simulated under the machine's own controller, from the recorded reference",
        "openloop": "The identified joint simulated from the recorded command alone, with nothing to correct it",
    }[mode]
    return Drawing(
        name,
        figure,
        f"{loop}. Grey is measured, colour simulated; the second row is the difference in position"
        + (", for each way of estimating the parameters." if len(simulations) > 1 else ".")
        + _rest(len({s.recording for s in simulations[reference]}) - len(chosen)),
    )


# --- residuals ------------------------------------------------------------------------------------------------------


def residuals(fit: JointFit, family: FamilyFit, name: str = "residuals") -> Drawing:
    """Residual effort against position, velocity and load, with running medians.

    Parameters
    ----------
    fit : JointFit
    family : FamilyFit
    name : str

    Returns
    -------
    Drawing
    """
    reading = READINGS[fit.motion]
    unit = unit_text(fit.effort_unit)
    figure = Figure(figsize=(FIGURE_WIDTH, 3.3), layout="constrained")
    axes = figure.subplots(1, 3, sharey=True)
    columns = (
        (f"Position ({reading.position})", lambda p: reading.scale * p.position),
        (f"Velocity ({reading.velocity})", lambda p: reading.scale * p.velocity),
        (f"Load ({unit})", lambda p: p.load),
    )
    everything = np.concatenate([p.residual for p in family.predictions])
    limit = 1.25 * float(np.quantile(np.abs(everything), 0.995)) or 1.0
    for axis, (text, of) in zip(axes, columns, strict=True):
        axis.axhline(0.0, color=colour("muted"), linewidth=0.8)
        half = family.predictions[0].half_width
        axis.axhspan(-half, half, color=colour("faint"), alpha=0.18, linewidth=0)
        for split in SPLITS:
            chosen = [p for p in family.predictions if p.split == split]
            if not chosen:
                continue
            x = np.concatenate([of(p) for p in chosen])
            y = np.concatenate([p.residual for p in chosen])
            _dots(axis, x, y, colour(split), alpha=0.28, size=1.7)
            centre, median = _running_median(x, y)
            axis.plot(centre, median, color=colour("paper"), linewidth=3.4, zorder=5)
            axis.plot(centre, median, color=colour(split), linewidth=1.8, zorder=6)
        axis.set_xlabel(text)
        axis.set_ylim(-limit, limit)
        _tidy(axis, first=axis is axes[0], text=f"Residual ({unit})", ticks=6)
    present = [s for s in SPLITS if any(p.split == s for p in family.predictions)]
    _key(axes[0], [(SPLITS[s], colour(s)) for s in present])
    return Drawing(
        name,
        figure,
        "What the model does not explain: measured minus predicted effort against position, velocity and load (the "
        "effort that gravity and inertia take). Thick lines are running medians, the grey band is the 95 % prediction "
        "interval. A median that leaves zero points at physics the family lacks.",
    )


def whiteness(fit: JointFit, family: FamilyFit, name: str = "whiteness") -> Drawing:
    """Autocorrelation of the residuals of the fitted recordings.

    Parameters
    ----------
    fit : JointFit
    family : FamilyFit
    name : str

    Returns
    -------
    Drawing
    """
    chosen = [p for p in family.predictions if p.split == "fitted"] or list(family.predictions)
    whole = max(chosen, key=lambda p: len(p.time))
    step = float(np.median(np.diff(whole.time))) if len(whole.time) > 1 else 1.0
    found = family.estimate.whiteness
    lags = max(2, min(max(found.lags if found else 0, 60), len(whole.time) // 4))
    correlation = np.average(
        [_autocorrelation(p.residual, lags) for p in chosen], axis=0, weights=[len(p.time) for p in chosen]
    )
    count = sum(len(p.time) for p in chosen)
    figure = Figure(figsize=(FIGURE_WIDTH, 2.3), layout="constrained")
    axis = figure.subplots()
    bound = 1.96 / np.sqrt(count)
    axis.axhspan(-bound, bound, color=colour("good"), alpha=0.22, linewidth=0)
    axis.axhline(0.0, color=colour("muted"), linewidth=0.8)
    at = step * np.arange(lags + 1)
    axis.fill_between(at, 0.0, correlation, color=colour("fitted"), alpha=0.15, linewidth=0)
    axis.plot(at, correlation, color=colour("fitted"), marker="o", markersize=2.2, linewidth=1.1)
    axis.set_xlim(0.0, at[-1])
    axis.set_ylim(min(-0.25, 1.1 * correlation.min()), 1.05)
    axis.set_xlabel("Lag (s)")
    _tidy(axis, first=True, text="Autocorrelation", ticks=4)
    return Drawing(
        name,
        figure,
        "Autocorrelation of the residuals of the fitted recordings. White residuals would stay in the green band. What "
        "lies outside it is structure that the model or the filter leaves, and it makes the naive intervals too "
        "narrow: the ones given here are widened for it.",
    )


# --- friction -------------------------------------------------------------------------------------------------------


def friction(fit: JointFit, name: str = "friction") -> Drawing:
    """Friction against velocity: the best family with its interval over the data, and all families beside it.

    Parameters
    ----------
    fit : JointFit
    name : str

    Returns
    -------
    Drawing
    """
    best = fit.families[fit.best]
    figure = Figure(figsize=(FIGURE_WIDTH, 4.3), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.35, 1.0))
    _friction_panel(left, fit, best)
    left.set_title(f"{best.family}: best on data it has not seen" if _heldout(fit) else best.family, pad=9)
    ends = []
    reading = READINGS[fit.motion]
    for family in fit.families.values():
        velocity = _velocities(fit, family)
        is_best = family.family == fit.best
        for branch in _branches(velocity):
            curve = _curve(family, branch, 0.0)
            right.plot(
                reading.scale * curve.velocity, curve.friction, color=family_colour(family.family),
                linewidth=2.2 if is_best else 1.3, zorder=4 if is_best else 3,
            )  # fmt: skip
        ends.append((float(curve.friction[-1]), family.family, family_colour(family.family)))
    right.set_title("every family, at no load", pad=9)
    right.set_xlabel(f"Velocity ({reading.velocity})")
    _tidy(right, first=False, ticks=7)
    _origin(right)
    _label_ends(right, ends)
    return Drawing(
        name,
        figure,
        "Friction against velocity. Dots are the fitted samples: measured effort less offset, gravity and inertia. The "
        "line is the identified friction, the band its 95 % interval from the parameters' covariance (often thinner "
        "than the line)." + (" Dashed: under a heavy load, either way." if _loaded(best) else ""),
    )


def families(fit: JointFit, name: str = "families") -> Drawing:
    """Small multiples of the friction curve, one panel a family, on common axes.

    Parameters
    ----------
    fit : JointFit
    name : str

    Returns
    -------
    Drawing
    """
    count = len(fit.families)
    columns = min(count, 2 if count in (2, 4) else 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(FIGURE_WIDTH, 0.3 + (3.0 if columns == 2 else 2.6) * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[count:]:
        axis.set_visible(False)
    for k, (axis, family) in enumerate(zip(axes.flat, fit.families.values(), strict=False)):
        _friction_panel(axis, fit, family)
        if k % columns:
            axis.set_ylabel("")
        if k + columns < count:
            axis.set_xlabel("")
        else:
            axis.tick_params(axis="x", labelbottom=True)
        error, split = (
            (family.heldout_effort_error, "held out")
            if np.isfinite(family.heldout_effort_error)
            else (family.fitted_effort_error, "fitted")
        )
        axis.set_title(
            f"{family.family} · {percent(error)} % {split}" + (" · best" if family.family == fit.best else ""),
            color=family_colour(family.family),
            fontweight="bold" if family.family == fit.best else "normal",
        )
    return Drawing(
        name,
        figure,
        "The same data through each friction family, with the effort error of its prediction.",
    )


def _friction_panel(axis: Axes, fit: JointFit, family: FamilyFit) -> None:
    reading = READINGS[fit.motion]
    chosen = [p for p in family.predictions if p.split == "fitted"] or list(family.predictions)
    offset = family["offset"].value if "offset" in family.model.names else family.model.known.get("offset", 0.0)
    x = reading.scale * np.concatenate([p.velocity for p in chosen])
    y = np.concatenate([p.effort - p.load - offset for p in chosen])
    _dots(axis, x, y, colour("faint"), alpha=0.5, size=1.8)
    tone = family_colour(family.family)
    velocity = _velocities(fit, family)
    top = 0.0
    for branch in _branches(velocity):
        curve = _curve(family, branch, 0.0)
        v, half = reading.scale * curve.velocity, 1.96 * curve.standard_error
        axis.fill_between(v, curve.friction - half, curve.friction + half, color=tone, alpha=0.28, linewidth=0)
        axis.plot(v, curve.friction, color=tone, linewidth=2.0, zorder=5)
        top = max(top, float(np.max(np.abs(curve.friction))))
    if _loaded(family):
        heavy = float(np.quantile(np.abs(np.concatenate([p.load for p in chosen])), 0.9))
        for load in (-heavy, heavy):
            for branch in _branches(velocity):
                curve = _curve(family, branch, load)
                axis.plot(
                    reading.scale * curve.velocity, curve.friction, color=tone, linewidth=1.1, dashes=(4, 1.8), zorder=5
                )
                top = max(top, float(np.max(np.abs(curve.friction))))
    spread = float(np.quantile(np.abs(y), 0.99))
    limit = 1.12 * max(top, min(spread, 1.8 * top) if top else spread)
    axis.set_ylim(-limit, limit)
    _origin(axis)
    axis.set_xlabel(f"Velocity ({reading.velocity})")
    _tidy(axis, first=True, text=f"Friction ({unit_text(fit.effort_unit)})", ticks=7)


def _curve(family: FamilyFit, velocity: np.ndarray, load: float) -> FrictionCurve:
    estimate = family.estimate
    return friction_curve(family.model, estimate.values, estimate.covariance, velocity, load)


def _velocities(fit: JointFit, family: FamilyFit) -> tuple[float, float]:
    chosen = [p for p in family.predictions if p.split == "fitted"] or list(family.predictions)
    speed = np.concatenate([p.velocity for p in chosen])
    return float(np.quantile(speed, 0.003)), float(np.quantile(speed, 0.997))


def _branches(limits: tuple[float, float]) -> list[np.ndarray]:
    """Negative and positive velocities, dense towards standstill, where Stribeck friction bends."""
    shape = np.geomspace(1e-3, 1.0, 90)
    branches = []
    if limits[0] < 0.0:
        branches.append((limits[0] * shape)[::-1])
    if limits[1] > 0.0:
        branches.append(limits[1] * shape)
    return branches


def _loaded(family: FamilyFit) -> bool:
    return any(p.name.startswith("load_") and p.value > 1e-3 for p in family.estimate.parameters)


def _heldout(fit: JointFit) -> bool:
    return any(np.isfinite(f.heldout_effort_error) for f in fit.families.values())


# --- estimators and families in numbers -----------------------------------------------------------------------------


def estimators(fit: JointFit, family: FamilyFit, name: str = "estimators") -> Drawing:
    """Every parameter by every way of estimating it, with 95 % intervals.

    Parameters
    ----------
    fit : JointFit
    family : FamilyFit
    name : str

    Returns
    -------
    Drawing
    """
    estimates = {family.estimate.method: family.estimate, **family.others}
    names = family.model.names
    columns = min(len(names), 4)
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(FIGURE_WIDTH, rows * (0.75 + 0.22 * len(estimates))), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for k, (axis, parameter) in enumerate(zip(axes.flat, names, strict=False)):
        reference = family.estimate[parameter]
        axis.axvspan(*reference.interval(), color=colour("faint"), alpha=0.25, linewidth=0)
        for row, (method, estimate) in enumerate(estimates.items()):
            found = estimate[parameter]
            tone = colour("fitted") if method == family.estimate.method else colour("measured")
            axis.plot(found.interval(), (row, row), color=tone, linewidth=1.4)
            axis.plot([found.value], [row], color=tone, marker="o", markersize=4.2)
        axis.set_ylim(len(estimates) - 0.5, -0.5)
        axis.set_yticks(range(len(estimates)), [METHODS.get(m, m) for m in estimates])
        axis.tick_params(axis="y", labelcolor=colour("ink"), length=0)
        axis.grid(axis="y", visible=False)
        axis.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        axis.spines["left"].set_visible(False)
        unit = unit_text(family.model.unit(parameter))
        axis.set_title(label(parameter) + (f" ({unit})" if unit else ""), fontsize=8.5)
        if k % columns:
            axis.tick_params(axis="y", labelleft=False)
    return Drawing(
        name,
        figure,
        f"Parameters of the {family.family} model by each estimator, with 95 % intervals; the grey band is the "
        "interval of the reference, filtered least squares.",
    )


def heldout(fit: JointFit, name: str = "heldout") -> Drawing:
    """Effort error of every family, fitted and held out.

    Parameters
    ----------
    fit : JointFit
    name : str

    Returns
    -------
    Drawing
    """
    chosen = list(fit.families.values())
    figure = Figure(figsize=(FIGURE_WIDTH, 0.75 + 0.34 * len(chosen)), layout="constrained")
    axis = figure.subplots()
    for row, family in enumerate(chosen):
        errors = {"fitted": family.fitted_effort_error, "heldout": family.heldout_effort_error}
        errors = {s: e for s, e in errors.items() if np.isfinite(e)}
        if len(errors) == 2:
            axis.plot(list(errors.values()), (row, row), color=colour("faint"), linewidth=1.6, zorder=2)
        for split, error in errors.items():
            axis.plot([error], [row], marker="o", markersize=6.5, color=colour(split), zorder=3)
            right = split == max(errors, key=errors.get)
            axis.annotate(
                f"{percent(error)}", (error, row), xytext=(8 if right else -8, -0.5), textcoords="offset points",
                ha="left" if right else "right", va="center", color=colour(split), fontsize=9,
                fontweight="bold" if family.family == fit.best else "normal",
            )  # fmt: skip
    axis.set_ylim(len(chosen) - 0.5, -0.6)
    axis.set_yticks(range(len(chosen)), [f.family for f in chosen])
    for text, family in zip(axis.get_yticklabels(), chosen, strict=True):
        text.set_color(family_colour(family.family))
        text.set_fontweight("bold" if family.family == fit.best else "normal")
    axis.tick_params(axis="y", length=0)
    axis.grid(axis="y", visible=False)
    axis.spines["left"].set_visible(False)
    low, high = axis.get_xlim()
    pad = 0.12 * (high - low)
    axis.set_xlim(max(0.0, low - pad), high + pad)
    axis.set_xlabel("Effort error (%)")
    return Drawing(name, figure, "Effort error of each family: blue on what was fitted, orange on what was held out.")


# --- drawing --------------------------------------------------------------------------------------------------------


def _effort_label(fit: JointFit) -> str:
    return f"{EFFORTS.get(fit.effort_unit, 'Effort')} ({unit_text(fit.effort_unit)})"


def _durations(times: Iterable[np.ndarray]) -> list[float]:
    spans = [float(np.nanmax(t) - np.nanmin(t)) if len(t) else 1.0 for t in times]
    # Recordings of very different length stay readable side by side.
    return [max(s, 0.35 * max(spans)) for s in spans]


def _tidy(axis: Axes, *, first: bool, text: str = "", ticks: int = 6) -> None:
    axis.tick_params(length=3, width=0.7, pad=3)
    axis.margins(x=0.01)
    axis.yaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 2.5, 5, 10]))
    if first:
        axis.set_ylabel(text)
    else:
        axis.tick_params(axis="y", labelleft=False)


def _head(axis: Axes, name: str, rest: str, split: str) -> None:
    """A panel's head: the recording in bold ink, then what it was used for in its colour."""
    axis.set_title("")
    head = axis.annotate(
        name, (0.0, 1.0), xytext=(0, 6), xycoords="axes fraction", textcoords="offset points", fontweight="bold",
        fontsize=9.5, va="bottom",
    )  # fmt: skip
    axis.annotate(
        rest, (1.0, 0.0), xytext=(8, 0.4), xycoords=head, textcoords="offset points", color=colour(split),
        fontsize=8.5, va="bottom",
    )  # fmt: skip


def _key(axis: Axes, entries: Sequence[tuple[str, str]]) -> None:
    """Names in their colours, in the panel's upper right corner: no boxes, no samples of lines."""
    shift = 0.0
    for text, tone in reversed(entries):
        axis.annotate(
            text, (1.0, 1.0), xytext=(-4 - shift, -3), xycoords="axes fraction", textcoords="offset points",
            ha="right", va="top", color=tone, fontsize=8.5, fontweight="bold", zorder=9,
            bbox={"boxstyle": "square,pad=0.12", "facecolor": colour("paper"), "alpha": 0.8, "linewidth": 0},
        )  # fmt: skip
        shift += 6.2 * len(text) + 8


def _origin(axis: Axes) -> None:
    axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    axis.axvline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)


def _label_ends(axis: Axes, ends: Sequence[tuple[float, str, str]]) -> None:
    """Names at the right ends of curves, moved apart where they would overlap."""
    low, high = axis.get_ylim()
    ends = sorted(ends)
    for at, (_, text, tone) in zip(_apart([y for y, *_ in ends], 0.06 * (high - low)), ends, strict=True):
        axis.annotate(
            text, (1.0, at), xytext=(5, 0), xycoords=("axes fraction", "data"), textcoords="offset points",
            va="center", color=tone, fontsize=8.5, annotation_clip=False,
        )  # fmt: skip


def _apart(heights: Sequence[float], gap: float) -> list[float]:
    """Ascending heights at least `gap` apart, each group centred on where its members wanted to be."""
    groups: list[list[float]] = []
    for y in heights:
        groups.append([y])
        while len(groups) > 1 and _centre(groups[-1]) - _centre(groups[-2]) < gap * (
            0.5 * (len(groups[-1]) + len(groups[-2]))
        ):
            last = groups.pop()
            groups[-1] += last
    return [_centre(g) + gap * (i - 0.5 * (len(g) - 1)) for g in groups for i in range(len(g))]


def _centre(group: Sequence[float]) -> float:
    return sum(group) / len(group)


def _line(axis: Axes, time: np.ndarray, values: np.ndarray, **style) -> None:
    time, values = _broken(np.asarray(time, float), np.asarray(values, float))
    axis.plot(*_outline(time, values), **style)


def _dots(axis: Axes, x: np.ndarray, y: np.ndarray, tone: str, *, alpha: float, size: float) -> None:
    """Many dots as a few paths (round-capped strokes of no length): a hundredth of the markup of markers."""
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = x[keep], y[keep]
    if len(x) > DOT_POINTS:
        chosen = np.sort(np.random.default_rng(0).choice(len(x), DOT_POINTS, replace=False))
        x, y = x[chosen], y[chosen]
    if not len(x):
        return
    tiny = 1e-4 * (np.ptp(x) or 1.0)
    for part in np.array_split(np.arange(len(x)), 4):
        if not len(part):
            continue
        vertices = np.empty((2 * len(part), 2))
        vertices[0::2], vertices[1::2] = np.c_[x[part], y[part]], np.c_[x[part] + tiny, y[part]]
        codes = np.tile([Path.MOVETO, Path.LINETO], len(part))
        axis.add_patch(
            PathPatch(
                Path(vertices, codes), fill=False, edgecolor=tone, alpha=alpha, linewidth=size, capstyle="round",
                zorder=2,
            )
        )  # fmt: skip
    axis.update_datalim(np.c_[x, y])
    axis.autoscale_view()


# --- arrays to draw -------------------------------------------------------------------------------------------------


def _by_recording(parts: Sequence[Prediction] | Sequence[Simulation]) -> list[list]:
    """Stretches of one recording together, in the order of the recordings."""
    groups: dict[str, list] = {}
    for part in parts:
        groups.setdefault(part.recording, []).append(part)
    return list(groups.values())


def _whole(group: Sequence[Simulation]) -> Simulation:
    """Simulated stretches of one recording as one, with breaks between; its errors pool them."""

    def joined(of: Callable) -> np.ndarray:
        return _joined(group, of)[0]

    names = list(group[0].measured)
    measured = {n: joined(lambda s, n=n: s.measured[n]) for n in names}
    simulated = {n: joined(lambda s, n=n: s.simulated[n]) for n in names}
    errors = {
        n: 100.0 * float(np.sqrt(np.nansum((measured[n] - simulated[n]) ** 2) / np.nansum(measured[n] ** 2)))
        for n in names
    }
    off = measured["position"] - simulated["position"]
    return Simulation(
        group[0].recording, group[0].split, group[0].mode, joined(lambda s: s.time), measured, simulated, errors,
        float(np.sqrt(np.nanmean(off**2))), float(np.nanmean(np.abs(off))),
    )  # fmt: skip


def whole_recordings(simulations: Sequence[Simulation]) -> list[Simulation]:
    """Stretches of one recording and mode joined, errors pooled over them."""
    modes = dict.fromkeys(s.mode for s in simulations)
    return [_whole(g) for mode in modes for g in _by_recording([s for s in simulations if s.mode == mode])]


def _shown(runs: Sequence[Simulation]) -> list[Simulation]:
    """As many as fit side by side: held-out recordings fill at least half of the places."""
    held, fitted = ([r for r in runs if r.split == s] for s in ("heldout", "fitted"))
    places = COLUMNS - min(len(held), COLUMNS // 2)
    fitted = fitted[:places]
    return fitted + held[: COLUMNS - len(fitted)]


def _rest(count: int) -> str:
    if count <= 0:
        return ""
    return f" {count} more {'recording is' if count == 1 else 'recordings are'} in the table below."


def _joined(group: Sequence, *of: Callable) -> tuple[np.ndarray, ...]:
    """Arrays of several stretches one after the other, with a break between."""
    parts = [[np.append(np.asarray(f(p), float), np.nan) for p in group] for f in of]
    return tuple(np.concatenate(p)[:-1] for p in parts)


def _pooled_error(group: Sequence[Prediction]) -> float:
    residual = np.concatenate([p.residual for p in group])
    return 100.0 * float(np.linalg.norm(residual) / np.linalg.norm(np.concatenate([p.effort for p in group])))


def _inside(prediction: Prediction) -> np.ndarray:
    return np.abs(prediction.residual) <= prediction.half_width


def _broken(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A NaN wherever samples are missing, so that no line bridges what was not scored."""
    steps = np.diff(time)
    known = steps[np.isfinite(steps)]
    if not len(known):
        return time, values
    gaps = np.flatnonzero(steps > 3.5 * np.median(known)) + 1
    return np.insert(time, gaps, np.nan), np.insert(values, gaps, np.nan)


def _outline(time: np.ndarray, values: np.ndarray, points: int = LINE_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest sample of each of `points` / 2 stretches, in order; breaks stay."""
    if len(time) <= points:
        return time, values
    keep = {0, len(time) - 1, *np.flatnonzero(~np.isfinite(time) | ~np.isfinite(values)).tolist()}
    for part in np.array_split(np.arange(len(time)), points // 2):
        good = part[np.isfinite(values[part])]
        if len(good):
            keep.update((int(good[np.argmin(values[good])]), int(good[np.argmax(values[good])])))
    index = np.array(sorted(keep))
    return time[index], values[index]


def _every(points: int, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    step = max(1, len(arrays[0]) // points)
    keep = np.zeros(len(arrays[0]), bool)
    keep[::step] = True
    keep |= ~np.isfinite(arrays[0])
    return tuple(a[keep] for a in arrays)


def _busiest(time: np.ndarray, values: np.ndarray, share: float = 0.035) -> tuple[float, float]:
    """The window in which the values vary most, free of breaks if there is one: where a zoom tells most."""
    t0, t1 = float(np.nanmin(time)), float(np.nanmax(time))
    good = np.isfinite(time) & np.isfinite(values)
    time, values = time[good], values[good]
    width = max(share * (t1 - t0), 40.0 * float(np.median(np.diff(time))) if len(time) > 1 else 0.0)
    width = min(width, t1 - t0)
    starts = np.linspace(t0, t1 - width, 60)
    expected = np.median([np.sum((time >= s) & (time <= s + width)) for s in starts])

    def variation(start: float) -> float:
        inside = values[(time >= start) & (time <= start + width)]
        if len(inside) < 3:
            return -1.0
        # Turning points as well as range: a single jump says little about a fit.
        return float(np.ptp(inside) + 0.1 * np.sum(np.abs(np.diff(inside)))) * min(1.0, len(inside) / expected)

    start = float(max(starts, key=variation))
    return start, start + width


def _running_median(x: np.ndarray, y: np.ndarray, bins: int = 22) -> tuple[np.ndarray, np.ndarray]:
    edges = np.linspace(*np.quantile(x, (0.01, 0.99)), bins + 1)
    which = np.digitize(x, edges) - 1
    enough = max(12, len(x) // 150)
    rows = [
        (0.5 * (edges[b] + edges[b + 1]), np.median(y[which == b]))
        if np.sum(which == b) >= enough
        else (np.nan, np.nan)
        for b in range(bins)
    ]
    return tuple(np.array(rows).T)


def _autocorrelation(x: np.ndarray, lags: int) -> np.ndarray:
    x = np.asarray(x, float) - np.mean(x)
    n = len(x)
    spectrum = np.fft.rfft(x, 2 * n)
    full = np.fft.irfft(np.abs(spectrum) ** 2)[: lags + 1]
    out = np.zeros(lags + 1)
    out[: len(full)] = full / full[0] if full[0] > 0.0 else 0.0
    return out


def _difference_unit(simulations: Sequence[Simulation], reading: Reading) -> tuple[float, str]:
    """Scale and unit for differences in position: finer than the reading's where they are tiny."""
    largest = max(
        float(np.nanmax(np.abs(np.asarray(s.measured["position"]) - np.asarray(s.simulated["position"]))))
        for s in simulations
    )
    shown = reading.scale * largest
    if reading.position == "mm" and shown < 0.1:
        return reading.scale * 1e3, "µm"
    if reading.position == "deg" and shown < 0.05:
        return reading.scale * 1e3, "mdeg"
    return reading.scale, reading.position


# --- SVG ------------------------------------------------------------------------------------------------------------

_NUMBER = re.compile(r"-?\d+\.\d{3,}")


def inline_svg(figure: Figure, name: str) -> str:
    """A figure as an ``<svg>`` element that can stand beside others in one HTML page.

    Every id gets the figure's name as prefix, every colour of the style becomes its CSS variable (so that the page's
    light and dark values apply), and coordinates keep two decimals.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    name : str
        Unique in the page.

    Returns
    -------
    str
    """
    buffer = io.StringIO()
    with matplotlib.rc_context(dict(RC)):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", text)
    text = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', text)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    for attribute in (r'\bd="[^"]*"', r'\b(?:points|x|y|transform)="[^"]*"'):
        text = re.sub(attribute, lambda m: _NUMBER.sub(lambda n: f"{float(n[0]):.2f}", m[0]), text)
    text = re.sub(r" \n", " ", text)
    for role, (light, _) in COLOURS.items():
        text = text.replace(light, f"var(--{role})")
    text = re.sub(r"font: ([^;\"]*?)'DejaVu Sans'[^;\"]*", rf"font: \1{SANS}".replace('"', "'"), text)
    return text.strip()


__all__ = [
    "Drawing", "Trace", "draw", "effort", "estimators", "families", "friction", "heldout", "inline_svg", "recordings",
    "residuals", "simulation", "whiteness", "whole_recordings",
]  # fmt: skip
