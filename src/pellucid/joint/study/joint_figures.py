"""The figures of a report, each a function from a fit to a drawing.

Blue is fitted, orange is held out, dark grey is measured; colours and sizes live in `style`. Series are prepared
here too: joined recordings, the busiest window, running medians.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...models.friction import FrictionCurve, friction_curve
from ...models.friction_terms import FAMILIES_BY_NAME, grows_with_load
from ...numerics.gravity_holds import GravityFit, Hold
from ...study.drawing.drawing import (
    LINE_POINTS,
    SHADED_GAPS_WORDS,
    Drawing,
    Head,
    broken,
    dots,
    every,
    heads,
    key,
    label_ends,
    line,
    measured_and_predicted,
    one_panel,
    origin,
    shade_gaps,
    tidy,
)
from ...study.drawing.style import FIGURE_WIDTH, colour
from ...study.pages.moving import MovingDrawing, Way, cursor, strokes
from ...study.pages.quantities import (
    METHODS,
    MOTION_READINGS,
    Reading,
    effort_label,
    number,
    parameter_label,
    percent,
    unit_text,
)
from ...study.pages.values import Value
from ..fit.friction_family import FamilyFit
from ..fit.replay import Prediction, Simulation
from .joint_answer import by_recording, pooled_error
from .joint_result import JointResult, Trace
from .spring_result import SpringTrace


def join_stretches(group: Sequence[Simulation]) -> Simulation:
    """Return the simulated stretches of one recording as one simulation with breaks, and with pooled errors."""

    def one(of: Callable) -> np.ndarray:
        return join_arrays(group, of)[0]

    names = list(group[0].measured)
    measured = {n: one(lambda s, n=n: s.measured[n]) for n in names}
    simulated = {n: one(lambda s, n=n: s.simulated[n]) for n in names}
    errors = {
        n: 100.0 * float(np.sqrt(np.nansum((measured[n] - simulated[n]) ** 2) / np.nansum(measured[n] ** 2)))
        for n in names
    }
    off = measured["position"] - simulated["position"]
    return Simulation(
        group[0].recording, group[0].split, group[0].mode, one(lambda s: s.time), measured, simulated, errors,
        float(np.sqrt(np.nanmean(off**2))), float(np.nanmean(np.abs(off))),
    )  # fmt: skip


def whole_recordings(simulations: Sequence[Simulation]) -> list[Simulation]:
    """Return the simulations with all stretches of each recording and mode joined, and with pooled errors."""
    modes = dict.fromkeys(s.mode for s in simulations)
    return [join_stretches(g) for mode in modes for g in by_recording([s for s in simulations if s.mode == mode])]


def join_arrays(group: Sequence, *of: Callable) -> tuple[np.ndarray, ...]:
    """Return arrays of several stretches one after another, with breaks between them."""
    parts = [[np.append(np.asarray(f(p), float), np.nan) for p in group] for f in of]
    return tuple(np.concatenate(p)[:-1] for p in parts)


def busiest(time: np.ndarray, values: np.ndarray, share: float = 0.035) -> tuple[float, float]:
    """Return start and end of the window, a `share` of all `time`, in which the `values` vary most, for a zoom.

    A window without breaks is preferred.
    """
    t0, t1 = float(np.nanmin(time)), float(np.nanmax(time))
    good = np.isfinite(time) & np.isfinite(values)
    time, values = time[good], values[good]
    width = max(share * (t1 - t0), 16.0 * float(np.median(np.diff(time))) if len(time) > 1 else 0.0)
    width = min(width, t1 - t0)
    starts = np.linspace(t0, t1 - width, 60)
    expected = np.median([np.sum((time >= s) & (time <= s + width)) for s in starts])

    def variation(start: float) -> float:
        inside = values[(time >= start) & (time <= start + width)]
        if len(inside) < 3:
            return -1.0
        # Turning points count as well as the range, because a single jump says little about a fit.
        return float(np.ptp(inside) + 0.1 * np.sum(np.abs(np.diff(inside)))) * min(1.0, len(inside) / expected)

    start = float(max(starts, key=variation))
    return start, start + width


def running_median(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return medians of `y` over stretches of `x`, at the medians of `x`.

    A stretch has at least a 22nd of the range, so that clustered samples give one point, and enough samples for a
    stable median.
    """
    order = np.argsort(x, kind="stable")
    width = np.subtract(*np.quantile(x, (0.99, 0.01))) / 22.0
    least = max(12, len(x) // 80)
    parts, start = [], 0
    for stop in range(1, len(order) + 1):
        if stop - start >= least and x[order[stop - 1]] - x[order[start]] >= width:
            parts.append(order[start:stop])
            start = stop
    if len(order) - start >= least:
        parts.append(order[start:])
    return np.array([np.median(x[p]) for p in parts]), np.array([np.median(y[p]) for p in parts])


def autocorrelation(x: np.ndarray, lags: int) -> np.ndarray:
    """Return the autocorrelation of `x` at 0 to `lags` samples, shape (lags + 1,)."""
    x = np.asarray(x, float) - np.mean(x)
    n = len(x)
    spectrum = np.fft.rfft(x, 2 * n)
    full = np.fft.irfft(np.abs(spectrum) ** 2)[: lags + 1]
    out = np.zeros(lags + 1)
    out[: len(full)] = full / full[0] if full[0] > 0.0 else 0.0
    return out


def difference_unit(simulations: Sequence[Simulation], reading: Reading) -> tuple[float, str]:
    """Return scale and unit for differences in position; the unit is finer than the reading's for tiny ones."""
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


COLUMN_COUNT = 4
"""Number of recordings side by side in one figure."""

SPLIT_LABELS = {"fitted": "fitted", "heldout": "held out"}
"""Labels of the splits in figures."""


# --- the recordings -------------------------------------------------------------------------------------------------


def recordings(traces: Sequence[Trace], fit: JointResult, name: str = "recordings") -> Drawing:
    """Draw position, velocity and effort of each recording against time, coloured by split."""
    reading = MOTION_READINGS[fit.motion]
    figure = Figure(figsize=(FIGURE_WIDTH, 5.4), layout="constrained")
    axes = figure.subplots(
        3, len(traces), sharey="row", sharex="col", squeeze=False, width_ratios=_durations([t.time for t in traces])
    )
    rows = (
        (f"Position ({reading.position})", "position", reading.scale),
        (f"Velocity ({reading.velocity})", "velocity", reading.scale),
        (effort_label(fit.effort_unit), "effort", 1.0),
    )
    for column, trace in enumerate(traces):
        for row, (text, signal, scale) in enumerate(rows):
            axis = axes[row, column]
            line(axis, trace.time, scale * getattr(trace, signal), color=colour(trace.split), linewidth=1.1)
            tidy(axis, first=column == 0, text=text, ticks=5)
        axes[2, column].set_xlabel("Time (s)")
    heads(axes[0], [Head(t.recording, SPLIT_LABELS[t.split], colour(t.split)) for t in traces])
    held = any(t.split == "heldout" for t in traces)
    return Drawing(
        name,
        figure,
        "Filtered position, velocity and effort of the joint. "
        + ("Blue: fitted recordings. Orange: held-out recordings." if held else "Blue: fitted recordings."),
    )


# --- the fit in effort ----------------------------------------------------------------------------------------------


def effort(fit: JointResult, family: FamilyFit) -> Drawing:
    """Draw measured and predicted effort with the prediction interval, and a zoom on the largest changes."""
    groups = by_recording(family.predictions)
    shown = [g for g in groups if g[0].split == "fitted"][:2] + [g for g in groups if g[0].split == "heldout"][:4]
    figure = Figure(figsize=(FIGURE_WIDTH, 0.5 + 2.15 * len(shown)), layout="constrained")
    axes = figure.subplots(len(shown), 2, squeeze=False, width_ratios=(2.3, 1.0), sharey=True)
    gaps = False
    for row, group in enumerate(shown):
        first = group[0]
        time, measured, predicted = join_arrays(group, lambda p: p.time, lambda p: p.effort, lambda p: p.predicted)
        half = first.half_width
        gaps = gaps or len(broken(time, predicted)[0]) > len(time)
        wide, zoom = axes[row]
        window = busiest(time, measured)
        for axis, (low, high) in ((wide, (np.nanmin(time), np.nanmax(time))), (zoom, window)):
            within = (time >= low) & (time <= high) | np.isnan(time)
            t, m, p = time[within], measured[within], predicted[within]
            # A zoom shows every sample; the overview only needs the outline.
            bt, bp = broken(*((t, p) if axis is zoom else every(LINE_POINTS, t, p)))
            axis.fill_between(bt, bp - half, bp + half, color=colour(first.split), alpha=0.2, linewidth=0)
            shade_gaps(axis, t)
            measured_and_predicted(axis, t, m, p, colour(first.split))
            axis.set_xlim(low, high)
        tidy(wide, first=True, text=effort_label(fit.effort_unit))
        tidy(zoom, first=False)
        zoom.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        if window[1] - window[0] < 0.4 * (np.nanmax(time) - np.nanmin(time)):
            wide.axvspan(*window, color=colour("faint"), alpha=0.25, linewidth=0)
            zoom.set_title("zoom on the grey window", color=colour("muted"), fontsize=8.5)
        else:
            zoom.set_visible(False)
        error = percent(pooled_error(group))
        covered = np.average([p.coverage for p in group], weights=[len(p.time) for p in group])
        rest = f"{SPLIT_LABELS[first.split]} · error {error} % · {percent(100.0 * covered)} % of samples inside"
        heads([wide], [Head(first.recording, rest, colour(first.split))])
        if row == 0:
            entries = [(fit.recorded, colour("measured")), ("predicted", colour(first.split))]
            key(zoom if zoom.get_visible() else wide, entries)
        for axis in (wide, zoom):
            axis.set_xlabel("Time (s)" if row == len(shown) - 1 else "")
    left_out = len(groups) - len(shown)
    return Drawing(
        "effort",
        figure,
        f"Effort {fit.recorded} (black; white on a dark page) and predicted by the {family.family} "
        "model (dashed, colour); the band is the 95 % prediction interval. The error is the norm of the difference "
        "relative to the norm of the effort."
        + (f" {SHADED_GAPS_WORDS}" if gaps else "")
        + _rest(left_out).replace("the table below", "the table of held-out errors"),
    )


# --- the fit in simulated motion ------------------------------------------------------------------------------------


def simulation(
    fit: JointResult, simulations: Mapping[str, Sequence[Simulation]], mode: str, name: str = "simulation"
) -> Drawing:
    """Draw measured and simulated motion, and their difference in position, for one mode of simulation."""
    reading = MOTION_READINGS[fit.motion]
    reference = next(iter(simulations))
    chosen = _shown([join_stretches(g) for g in by_recording(simulations[reference])])
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
    off_scale, off_unit = difference_unit(chosen, reading)
    position, velocity = f"Position ({reading.position})", f"Velocity ({reading.velocity})"
    labels = (position, f"Difference ({off_unit})", velocity, effort_label(fit.effort_unit))
    for column, run in enumerate(chosen):
        top, off, speed, drive = axes[:, column]
        signals = ((top, "position", reading.scale), (speed, "velocity", reading.scale), (drive, "effort", 1.0))
        for axis, signal, scale in signals:
            line(axis, run.time, scale * np.asarray(run.measured[signal]), color=colour("measured"), linewidth=1.1)
            line(
                axis, run.time, scale * np.asarray(run.simulated[signal]), color=colour(run.split), linewidth=1.1,
                dashes=(4, 1.6),
            )  # fmt: skip
        for k, (method, runs) in enumerate(simulations.items()):
            tone = colour(run.split) if method == reference else colour("load")
            for r in (join_stretches(g) for g in by_recording(runs) if g[0].recording == run.recording):
                difference = off_scale * (r.measured["position"] - r.simulated["position"])
                line(off, r.time, difference, color=tone, linewidth=1.0, zorder=3 - 0.1 * k)
        for axis, text in zip(axes[:, column], labels, strict=True):
            tidy(axis, first=column == 0, text=text, ticks=5)
        drive.set_xlabel("Time (s)")
    errors = [f"{SPLIT_LABELS[r.split]} · position {percent(r.errors['position'])} %" for r in chosen]
    heads(axes[0], [Head(r.recording, error, colour(r.split)) for r, error in zip(chosen, errors, strict=True)])
    key(axes[0, 0], [("measured", colour("measured")), ("simulated", colour(chosen[0].split))])
    if len(simulations) > 1:
        tones = [colour(chosen[0].split), *[colour("load")] * (len(simulations) - 1)]
        key(axes[1, 0], [(METHODS.get(m, m), t) for m, t in zip(simulations, tones, strict=True)])
    loop = {
        "closed_loop": "The identified joint simulated under the machine's own controller, from the recorded reference",
        "openloop": "The identified joint simulated from the recorded command alone, with nothing to correct it",
    }[mode]
    return Drawing(
        name,
        figure,
        f"{loop}. Black (white on a dark page): measured. Colour: simulated. The second row is the difference in "
        "position"
        + (", for each way of estimating the parameters." if len(simulations) > 1 else ".")
        + _rest(len({s.recording for s in simulations[reference]}) - len(chosen)),
    )


# --- residuals ------------------------------------------------------------------------------------------------------


def residuals(fit: JointResult, family: FamilyFit) -> Drawing:
    """Draw residual effort against position, velocity and load, with running medians."""
    reading = MOTION_READINGS[fit.motion]
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
        for split in SPLIT_LABELS:
            chosen = [p for p in family.predictions if p.split == split]
            if not chosen:
                continue
            x = np.concatenate([of(p) for p in chosen])
            y = np.concatenate([p.residual for p in chosen])
            dots(axis, x, y, colour(split), alpha=0.28, size=1.7)
            centre, median = running_median(x, y)
            axis.plot(centre, median, color=colour("paper"), linewidth=3.4, zorder=5)
            axis.plot(centre, median, color=colour(split), linewidth=1.8, zorder=6)
        axis.set_xlabel(text)
        axis.set_ylim(-limit, limit)
        tidy(axis, first=axis is axes[0], text=f"Residual ({unit})", ticks=6)
    present = [s for s in SPLIT_LABELS if any(p.split == s for p in family.predictions)]
    key(axes[0], [(SPLIT_LABELS[s], colour(s)) for s in present])
    return Drawing(
        "residuals",
        figure,
        f"Residuals: {fit.recorded} minus predicted effort against position, velocity and load (the effort for gravity "
        "and inertia). Thick lines: running medians. Grey band: 95 % prediction interval. A median that departs from "
        "zero shows an effect that the model lacks.",
    )


def whiteness(fit: JointResult, family: FamilyFit) -> Drawing:
    """Draw the autocorrelation of the residuals of the fitted recordings."""
    chosen = [p for p in family.predictions if p.split == "fitted"] or list(family.predictions)
    longest = max(chosen, key=lambda p: len(p.time))
    # With samples left out, a lag is a number of samples and not a time.
    even = all(len(broken(p.time, p.time)[0]) == len(p.time) for p in chosen)
    step = float(np.median(np.diff(longest.time))) if even and len(longest.time) > 1 else 1.0
    found = family.estimate.whiteness
    lags = max(2, min(max(found.lags if found else 0, 60), len(longest.time) // 4))
    correlation = np.average(
        [autocorrelation(p.residual, lags) for p in chosen], axis=0, weights=[len(p.time) for p in chosen]
    )
    count = sum(len(p.time) for p in chosen)
    figure, axis = one_panel(2.3)
    bound = 1.96 / np.sqrt(count)
    axis.axhspan(-bound, bound, color=colour("good"), alpha=0.22, linewidth=0)
    axis.axhline(0.0, color=colour("muted"), linewidth=0.8)
    at = step * np.arange(lags + 1)
    axis.fill_between(at, 0.0, correlation, color=colour("fitted"), alpha=0.15, linewidth=0)
    axis.plot(at, correlation, color=colour("fitted"), marker="o", markersize=2.2, linewidth=1.1)
    axis.set_xlim(0.0, at[-1])
    axis.set_ylim(min(-0.25, 1.1 * correlation.min()), 1.05)
    axis.set_xlabel("Lag (s)" if even else "Lag (scored samples)")
    tidy(axis, first=True, text="Autocorrelation", ticks=4)
    return Drawing(
        "whiteness",
        figure,
        "Autocorrelation of the residuals of the fitted recordings. White residuals would stay in the green band. "
        "Values outside it come from the model error or the filter. The confidence intervals are widened accordingly.",
    )


# --- friction -------------------------------------------------------------------------------------------------------


def friction(fit: JointResult) -> Drawing:
    """Draw friction against velocity: the best family with its interval over the data, and all other families."""
    best = fit.headlined
    figure = Figure(figsize=(FIGURE_WIDTH, 4.3), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.35, 1.0))
    _friction_panel(left, fit, best)
    left.set_title(f"{best.family} friction, as chosen" if len(fit.families) > 1 else f"{best.family} friction", pad=9)
    ends = []
    reading = MOTION_READINGS[fit.motion]
    for family in fit.families.values():
        velocity = _velocities(family)
        is_best = family.family == fit.best
        for branch in _branches(velocity):
            curve = _curve(family, branch, 0.0)
            right.plot(
                reading.scale * curve.velocity, curve.friction, color=colour(FAMILIES_BY_NAME[family.family].colour),
                linewidth=2.2 if is_best else 1.3, zorder=4 if is_best else 3,
            )  # fmt: skip
        ends.append((float(curve.friction[-1]), family.family, colour(FAMILIES_BY_NAME[family.family].colour)))
    right.set_title("every family, at no load", pad=9)
    right.set_xlabel(f"Velocity ({reading.velocity})")
    tidy(right, first=False, ticks=7)
    origin(right)
    label_ends(right, ends)
    return Drawing(
        "friction",
        figure,
        f"Friction against velocity. Dots: fitted samples ({fit.recorded} effort minus offset, gravity and inertia). "
        "Line: identified friction, with its 95 % interval from the covariance of the parameters (often thinner than "
        "the line)." + (" Dashed: under a heavy load, in either direction." if _loaded(best) else ""),
    )


def families(fit: JointResult) -> Drawing:
    """Draw the friction curve of each family in its own panel, on common axes."""
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
        error, split = family.fitted_effort_error, "fitted"
        if np.isfinite(family.heldout_effort_error):
            error, split = family.heldout_effort_error, "held out"
        axis.set_title(
            f"{family.family} · {percent(error)} % {split}" + (" · chosen" if family.family == fit.best else ""),
            color=colour(FAMILIES_BY_NAME[family.family].colour),
            fontweight="bold" if family.family == fit.best else "normal",
        )
    caption = "The same data with each friction family, fitted by least squares, with its effort error."
    chosen = fit.headlined
    if chosen.estimate.method != fit.families[fit.best].estimate.method and np.isfinite(chosen.heldout_effort_error):
        method = METHODS.get(chosen.estimate.method, chosen.estimate.method)
        caption += f" The reported result is by {method}: {percent(chosen.heldout_effort_error)} %."
    return Drawing("families", figure, caption)


def _friction_panel(axis: Axes, fit: JointResult, family: FamilyFit) -> None:
    reading = MOTION_READINGS[fit.motion]
    chosen = [p for p in family.predictions if p.split == "fitted"] or list(family.predictions)
    offset = family["offset"].value if "offset" in family.model.names else family.model.known.get("offset", 0.0)
    x = reading.scale * np.concatenate([p.velocity for p in chosen])
    y = np.concatenate([p.effort - p.load - offset for p in chosen])
    dots(axis, x, y, colour("muted"), alpha=0.32, size=1.8 if len(x) > 600 else 2.4)
    tone = colour(FAMILIES_BY_NAME[family.family].colour)
    velocity = _velocities(family)
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
    origin(axis)
    axis.set_xlabel(f"Velocity ({reading.velocity})")
    tidy(axis, first=True, text=f"Friction ({unit_text(fit.effort_unit)})", ticks=7)


def _curve(family: FamilyFit, velocity: np.ndarray, load: float) -> FrictionCurve:
    estimate = family.estimate
    return friction_curve(family.model, estimate.array, estimate.covariance, velocity, load)


def _velocities(family: FamilyFit) -> tuple[float, float]:
    chosen = [p for p in family.predictions if p.split == "fitted"] or list(family.predictions)
    speed = np.concatenate([p.velocity for p in chosen])
    return float(np.quantile(speed, 0.003)), float(np.quantile(speed, 0.997))


def _branches(limits: tuple[float, float]) -> list[np.ndarray]:
    """Return negative and positive velocities, dense near standstill, where Stribeck friction is curved."""
    shape = np.geomspace(1e-3, 1.0, 90)
    branches = []
    if limits[0] < 0.0:
        branches.append((limits[0] * shape)[::-1])
    if limits[1] > 0.0:
        branches.append(limits[1] * shape)
    return branches


def _loaded(family: FamilyFit) -> bool:
    return any(grows_with_load(p.name) and p.value > 1e-3 for p in family.estimate.parameters)


# --- estimators and families in numbers -----------------------------------------------------------------------------


def estimators(fit: JointResult, family: FamilyFit) -> Drawing:
    """Draw every parameter by every estimator, with 95 % intervals."""
    estimates = {family.estimate.method: family.estimate, **family.others}
    names = family.model.names
    columns = {5: 3, 6: 3, 9: 3}.get(len(names), min(len(names), 4))
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(FIGURE_WIDTH, rows * (0.75 + 0.22 * len(estimates))), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for k, (axis, parameter) in enumerate(zip(axes.flat, names, strict=False)):
        reference = family.estimate[parameter]
        axis.axvspan(*reference.interval(), color=colour("faint"), alpha=0.25, linewidth=0)
        for row, (method, estimate) in enumerate(estimates.items()):
            found = estimate.get(parameter)
            if found is None:
                continue
            tone = colour("fitted") if method == family.estimate.method else colour("measured")
            axis.plot(found.interval(), (row, row), color=tone, linewidth=1.4)
            axis.plot([found.value], [row], color=tone, marker="o", markersize=4.2)
        axis.margins(x=0.06)
        axis.set_ylim(len(estimates) - 0.5, -0.5)
        axis.set_yticks(range(len(estimates)), [METHODS.get(m, m) for m in estimates])
        axis.tick_params(axis="y", labelcolor=colour("ink"), length=0)
        axis.grid(axis="y", visible=False)
        axis.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        axis.spines["left"].set_visible(False)
        unit = unit_text(family.model.unit(parameter))
        axis.set_title(parameter_label(parameter) + (f" ({unit})" if unit else ""), fontsize=8.5)
        if k % columns:
            axis.tick_params(axis="y", labelleft=False)
    return Drawing(
        "estimators",
        figure,
        f"Parameters of the {family.family} model by each estimator, with 95 % intervals. Grey band: interval of the "
        "reference method, filtered least squares.",
    )


def heldout(fit: JointResult) -> Drawing:
    """Draw the effort error of every family, fitted and held out."""
    chosen = list(fit.families.values())
    figure, axis = one_panel(0.75 + 0.34 * len(chosen))
    for row, family in enumerate(chosen):
        errors = {"fitted": family.fitted_effort_error, "heldout": family.heldout_effort_error}
        errors = {s: e for s, e in errors.items() if np.isfinite(e)}
        if len(errors) == 2:
            axis.plot(list(errors.values()), (row, row), color=colour("faint"), linewidth=1.6, zorder=2)
        for split, error in errors.items():
            axis.plot([error], [row], marker="o", markersize=6.5, color=colour(split), zorder=3)
            right = split == max(errors, key=errors.__getitem__)
            axis.annotate(
                f"{percent(error)}", (error, row), xytext=(8 if right else -8, -0.5), textcoords="offset points",
                ha="left" if right else "right", va="center", color=colour(split), fontsize=9,
                fontweight="bold" if family.family == fit.best else "normal",
            )  # fmt: skip
    axis.set_ylim(len(chosen) - 0.5, -0.6)
    axis.set_yticks(range(len(chosen)), [f.family for f in chosen])
    for text, family in zip(axis.get_yticklabels(), chosen, strict=True):
        text.set_color(colour(FAMILIES_BY_NAME[family.family].colour))
        text.set_fontweight("bold" if family.family == fit.best else "normal")
    axis.tick_params(axis="y", length=0)
    axis.grid(axis="y", visible=False)
    axis.spines["left"].set_visible(False)
    low, high = axis.get_xlim()
    pad = 0.12 * (high - low)
    axis.set_xlim(low - pad, high + pad)  # room for the numbers, also below 0
    axis.set_xticks([tick for tick in axis.get_xticks() if 0.0 <= tick <= high + pad])
    axis.set_xlabel("Effort error (%)")
    return Drawing(
        "heldout",
        figure,
        "Effort error of each family by least squares: blue on fitted recordings, orange on held-out recordings.",
    )


# --- common to several ----------------------------------------------------------------------------------------------


def _durations(times: Iterable[np.ndarray]) -> list[float]:
    spans = [float(np.nanmax(t) - np.nanmin(t)) if len(t) else 1.0 for t in times]
    # Panel widths are limited, so that recordings of very different length stay readable side by side.
    least = 0.35 if len(spans) < 3 else 0.75
    return [max(s, least * max(spans)) for s in spans]


def _shown(runs: Sequence[Simulation]) -> list[Simulation]:
    """Return as many simulations as fit side by side; held-out recordings get at least half of the places."""
    held, fitted = ([r for r in runs if r.split == s] for s in ("heldout", "fitted"))
    places = COLUMN_COUNT - min(len(held), COLUMN_COUNT // 2)
    fitted = fitted[:places]
    return fitted + held[: COLUMN_COUNT - len(fitted)]


def _rest(count: int) -> str:
    if count <= 0:
        return ""
    return f" {count} more {'recording is' if count == 1 else 'recordings are'} in the table below."


FRAME_COUNT = 60
"""Number of frames of the movement."""

MAX_SHOWN_S = 10.0
"""Longest stretch of a recording that moves [s]."""

LINK_LENGTH = 1.0
"""Drawn length of a turning link; lengths are not known."""


def moving_joint(
    parts: Sequence[Prediction],
    name: str,
    *,
    rotary: bool,
    upright: float,
    unit: str,
    error: Value,
    use: str,
    recorded: str,
    caption: str,
) -> MovingDrawing:
    """Draw a joint along the busiest seconds of a recording, with its measured and predicted effort.

    Parameters
    ----------
    parts : sequence of Prediction
        Predictions of which one recording is drawn: the one whose error is nearest to the pooled one.
    name : str
        Name of the figure.
    rotary : bool
        Whether the joint turns; else it slides.
    upright : float
        Angle at which the link hangs along gravity [rad].
    unit : str
        Unit of the effort.
    error : Value
        Error of the prediction over all `parts` [%].
    use : str
        Use of the recordings in words, such as "held out".
    recorded : str
        Word for the recorded effort, such as "measured".
    caption : str
        Text below the figure.
    """
    groups = by_recording(parts)
    group = min(groups, key=lambda g: abs(pooled_error(g) - error.number))
    time, position, measured, predicted = join_arrays(
        group, lambda p: p.time, lambda p: p.position, lambda p: p.effort, lambda p: p.predicted
    )
    start, stop = busiest(
        time, measured, share=min(1.0, MAX_SHOWN_S / max(float(np.nanmax(time) - np.nanmin(time)), 1e-9))
    )
    shown = (time >= start) & (time <= stop) | np.isnan(time)
    time, position, measured, predicted = (x[shown] for x in (time, position, measured, predicted))
    figure = Figure(figsize=(FIGURE_WIDTH, 3.1), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 2.6), height_ratios=(2.2, 1.0))
    stick, traces = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
    errors = figure.add_subplot(grid[1, 1], sharex=traces)
    role = group[0].split
    half = group[0].half_width
    # Around the prediction an interval is often thinner than its line, so the error shows it on its own scale.
    is_banded = bool(np.isfinite(half))
    if is_banded:
        errors.axhspan(-half, half, color=colour(role), alpha=0.18, linewidth=0)
    has_gaps = any([shade_gaps(axis, time) for axis in (traces, errors)])
    measured_and_predicted(traces, time, measured, predicted, colour(role))
    line(errors, time, measured - predicted, color=colour(role), linewidth=1.1)
    errors.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    tidy(traces, first=True, text=effort_label(unit), ticks=5)
    tidy(errors, first=True, text=f"Error ({unit_text(unit)})", ticks=3)
    traces.tick_params(axis="x", labelbottom=False)
    traces.set_xlim(start, stop)
    errors.set_xlabel("Time (s)")
    heads([traces], [Head(group[0].recording, use, colour(role))])
    key(traces, [(recorded, colour("measured")), ("predicted (dashed)", colour(role))])
    known = np.isfinite(time) & np.isfinite(position)
    frames = np.linspace(start, stop, FRAME_COUNT)
    moved = np.interp(frames, time[known], position[known])
    ways = _turning(stick, moved - upright) if rotary else _sliding(stick, moved)
    ways["cursor"] = cursor(traces, frames)
    caption += f" Below: {recorded} minus predicted" + (
        ", and the 95 % prediction interval (band)." if is_banded else "."
    )
    caption = f"{caption} {SHADED_GAPS_WORDS}" if has_gaps else caption
    return MovingDrawing(name, figure, caption, ways, float(stop - start))


def _turning(axis: Axes, angle: np.ndarray) -> dict[str, Way]:
    """Draw a link that turns about its axis by `angle`, (n,) [rad] from hanging."""
    ends = LINK_LENGTH * np.column_stack([np.sin(angle), -np.cos(angle)])
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-1.25, 1.25)
    axis.set_ylim(-1.3, 1.3)
    axis.plot(*ends.T, color=colour("fitted"), linewidth=1.0, alpha=0.5)
    axis.plot((0.0, 0.0), (0.0, -1.2), color=colour("rule"), linewidth=1.0, dashes=(4, 3))
    link = np.stack([np.zeros_like(ends), ends], axis=1)
    weight = np.stack([ends, ends + np.array([1e-3, 0.0])], axis=1)
    hub = np.zeros((len(ends), 2, 2)) + np.array([[0.0, 0.0], [1e-3, 0.0]])
    strokes(axis, link[0], "link", edgecolor=colour("measured"), linewidth=7.0, zorder=4)
    strokes(axis, weight[0], "weight", edgecolor=colour("measured"), linewidth=17.0, zorder=5)
    strokes(axis, hub[0], "hub", edgecolor=colour("fitted"), linewidth=13.0, zorder=6)
    return {"link": Way(axis, link), "weight": Way(axis, weight)}


def _sliding(axis: Axes, place: np.ndarray) -> dict[str, Way]:
    """Draw a carriage that slides along its rail to `place`, (n,) [m]."""
    span = max(float(np.ptp(place)), 1e-9)
    at = 2.0 * (place - place.min()) / span - 1.0
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-1.5, 1.5)
    axis.set_ylim(-1.0, 1.0)
    axis.plot((-1.4, 1.4), (-0.2, -0.2), color=colour("muted"), linewidth=3.0)
    block = np.stack([np.column_stack([at + d, np.zeros_like(at)]) for d in (-0.2, 0.2)], axis=1)
    strokes(axis, block[0], "carriage", edgecolor=colour("measured"), linewidth=20.0, zorder=4)
    return {"carriage": Way(axis, block)}


CURVE_MARGIN_RAD = np.radians(10.0)
"""Angle by which the curve of the weight reaches beyond the postures [rad]."""

POSTURE_DOT_POINTS = 6.0
"""Diameter of the dot of a posture, in points."""


def posture_figure(fit: GravityFit, judged: Sequence[Hold], unit: str) -> Drawing:
    """Draw effort against angle: fitted postures, held-out ones (`judged`), and gravity; effort in `unit`."""
    figure, axis = one_panel(3.4)
    angles = np.array([hold.angle for hold in (*fit.holds, *judged)])
    span = np.linspace(angles.min() - CURVE_MARGIN_RAD, angles.max() + CURVE_MARGIN_RAD, 121)
    line(axis, np.degrees(span), fit.torque(span), color=colour("fitted"), linewidth=1.8)
    drawn = [("fitted postures", fit.holds, "measured"), ("held-out postures", judged, "heldout")]
    for _, holds, role in (each for each in drawn if each[1]):
        angle, effort = ([getattr(hold, name) for hold in holds] for name in ("angle", "torque"))
        dots(axis, np.degrees(angle), np.array(effort), colour(role), alpha=0.9, size=POSTURE_DOT_POINTS)
    tidy(axis, first=True, text=effort_label(unit))
    axis.set_xlabel("Angle (deg)")
    names = [("weight", colour("fitted")), *((words, colour(role)) for words, holds, role in drawn if holds)]
    key(axis, names)
    off = float(np.abs(fit.residual).max())
    return Drawing(
        "postures",
        figure,
        "Effort that holds the joint in each posture, and gravity estimated from the fitted ones, with a largest "
        f"residual of {number(off, off)} {unit_text(unit)}.",
    )


DRAWN_SAMPLE_COUNT = 2000
"""Largest number of drawn samples: the first of a recording, so that its loops stay whole."""


def spring_loop(trace: SpringTrace, unit: str, effort_label: str, recorded: str) -> Drawing:
    """Draw the effort of one recording over its deflection, measured and as the spring predicts it.

    `unit` is that of the deflection, "rad" or "m", which is drawn in degrees or millimetres. `recorded` is
    the word for the recorded effort, such as "measured".
    """
    scale, shown = (float(np.degrees(1.0)), "deg") if unit == "rad" else (1e3, "mm")
    figure, axis = one_panel(3.4)
    deflection, effort, predicted = (
        each[:DRAWN_SAMPLE_COUNT] for each in (scale * trace.deflection, trace.effort, trace.predicted)
    )
    axis.plot(deflection, effort, color=colour("measured"), linewidth=2.0)
    axis.plot(deflection, predicted, color=colour(trace.split), linewidth=1.2, linestyle="--")
    axis.set_xlabel(f"Deflection ({shown})")
    tidy(axis, first=True, text=effort_label)
    said = "held out" if trace.split == "heldout" else "fitted"
    key(axis, [(recorded, colour("measured")), (f"predicted (dashed), {said}", colour(trace.split))])
    return Drawing(
        "spring-loop",
        figure,
        f"Effort over deflection of {trace.recording} ({said}): {recorded} (black; white on a dark page) and "
        "predicted by the spring (dashed). The width of the loop comes from hysteresis and damping.",
    )
