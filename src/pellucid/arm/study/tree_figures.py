"""Figures of a robot of several joints: the moving arm, predicted efforts, friction, and identified parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..._errors import listed_names
from ...models.kinematic_tree import Tree
from ...study.drawing.drawing import Drawing, Head, dots, heads, key, line, tidy
from ...study.drawing.style import FIGURE_WIDTH, colour
from ...study.pages.moving import MovingDrawing, Way, strokes
from ...study.pages.quantities import effort_label, number, percent, unit_text
from .tree_result import MODEL_DESCRIPTIONS, TreeResult, TreeTrace


@dataclass(frozen=True)
class FigureSettings:
    """What the figures of a robot show."""

    frame_count: int = 120  # number of frames of the moving figure
    max_shown_s: float = 20.0  # longest part of a recording that is shown [s]
    ghost_count: int = 6  # number of poses that are drawn faintly behind the moving figure
    view_count: int = 24  # number of viewing directions that are tried
    view_elevation_rad: float = np.radians(20.0)  # elevation of the viewing directions [rad]
    # Length of a last link beyond its joint, and of a joint's drawn axis, as a share of the arm's reach.
    stub_length_share: float = 0.1
    column_count: int = 3  # number of joints side by side
    max_good_sd_percent: float = 10.0  # largest relative standard deviation of a well identified parameter [%]
    max_fair_sd_percent: float = 30.0  # largest relative standard deviation of a barely identified parameter [%]
    worst_share: float = 0.08  # length of the enlarged stretch with the largest errors, as a share of the recording


FIGURE_SETTINGS = FigureSettings()


def stick_figure(
    axis: Axes, tree: Tree, time: np.ndarray, position: np.ndarray, *, worst: str = "", name: str = "arm"
) -> tuple[dict[str, Way], float]:
    """Draw the arm along a recording with `time`, (n,) [s], and `position`, (n, m) [rad; m].

    The joint `worst` is highlighted. Returns the moving parts, and the duration [s].
    """
    shown = np.flatnonzero(time - time[0] <= FIGURE_SETTINGS.max_shown_s)
    dense = np.unique(np.linspace(shown[0], shown[-1], 4 * FIGURE_SETTINGS.frame_count).astype(int))
    frames = dense[::4]
    links, pins = _lines(tree, position[dense])
    up = -np.asarray(tree.gravity, float)
    view = _view(links, up / np.linalg.norm(up) if np.any(up) else np.array([0.0, 0.0, 1.0]))
    links, pins = links @ view.T, pins @ view.T
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_axis_off()
    everywhere = np.concatenate([links.reshape(-1, 2), pins.reshape(-1, 2)])
    axis.update_datalim(everywhere)
    axis.margins(0.06)
    axis.autoscale_view()
    axis.plot(*links[:, -1].T, color=colour("fitted"), linewidth=0.8, alpha=0.45)
    base, reach = links[0, 0], float(np.ptp(everywhere, axis=0).max())
    axis.plot(base[0] + np.array([-0.09, 0.09]) * reach, [base[1], base[1]], color=colour("muted"), linewidth=3.0)
    links, pins = links[::4], pins[::4]
    for i in np.linspace(0, len(links) - 1, FIGURE_SETTINGS.ghost_count + 1).astype(int)[1:]:
        strokes(axis, links[i], f"{name}-ghost-{i}", edgecolor=colour("rule"), linewidth=3.0, zorder=1)
    joints = links[:, 1::2][:, _moves(tree)]
    parts = {
        f"{name}-links": (links, {"edgecolor": colour("measured"), "linewidth": 6.0, "zorder": 4}),
        f"{name}-axes": (pins, {"edgecolor": colour("fitted"), "linewidth": 2.0, "zorder": 5}),
        f"{name}-joints": (_dots(joints), {"edgecolor": colour("fitted"), "linewidth": 11.0, "zorder": 6}),
        f"{name}-centres": (_dots(joints), {"edgecolor": colour("paper"), "linewidth": 5.0, "zorder": 7}),
    }
    marked = [k for k, joint in enumerate(tree.moving) if joint.name == worst]
    if marked:
        style = {"edgecolor": colour("heldout"), "linewidth": 5.0, "zorder": 8}
        parts[f"{name}-worst"] = (_dots(joints[:, marked]), style)
    for gid, (points, style) in parts.items():
        strokes(axis, points[0], gid, **style)
    return {gid: Way(axis, points) for gid, (points, _) in parts.items()}, float(time[frames[-1]] - time[frames[0]])


def _moves(tree: Tree) -> np.ndarray:
    return np.flatnonzero([joint.kind != "fixed" for joint in tree.order])


def _lines(tree: Tree, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the strokes of links, (n, 2 links + 2, 3) [m], and of joint axes, (n, 2 m, 3) [m].

    The last pair of the links belongs to the end of the outermost link.
    """
    number = {tree.base: -1} | {joint.child: i for i, joint in enumerate(tree.order)}
    frames = tree.core.placements(position)
    places = np.concatenate([frames[..., 3], np.zeros((len(frames), 1, 3))], axis=1)  # the base is the last, number -1
    pairs = [index for joint in tree.order for index in (number[joint.parent], number[joint.child])]
    links = places[:, pairs]
    reach = float(np.linalg.norm(links[:, 0::2] - links[:, 1::2], axis=2).sum(axis=1).max())
    pins = []
    for i in _moves(tree):
        turned = frames[:, i, :, :3] @ np.asarray(tree.order[i].axis, float)
        pins += [
            places[:, i] - 0.4 * FIGURE_SETTINGS.stub_length_share * reach * turned,
            places[:, i] + 0.4 * FIGURE_SETTINGS.stub_length_share * reach * turned,
        ]
    last = _moves(tree)[-1]
    end = places[:, len(tree.order) - 1]
    stub = end + FIGURE_SETTINGS.stub_length_share * reach * frames[:, last, :, :3] @ np.asarray(
        tree.order[last].axis, float
    )
    links = np.concatenate([links, end[:, None], stub[:, None]], axis=1)
    return links, np.stack(pins, axis=1)


def _view(points: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the two directions, (2, 3), onto which `points`, (n, p, 3), are projected, in the view that shows the most
    movement."""
    first = np.cross(up, [1.0, 0.0, 0.0] if abs(up[0]) < 0.9 else [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    moved = points.reshape(-1, 3) - points.reshape(-1, 3).mean(axis=0)
    turns = 2.0 * np.pi * np.arange(FIGURE_SETTINGS.view_count) / FIGURE_SETTINGS.view_count
    rights = [np.cos(turn) * first + np.sin(turn) * second for turn in turns]
    right = max(rights, key=lambda direction: round(float(np.var(moved @ direction)), 9))
    towards = np.cross(right, up)
    return np.stack(
        [right, np.cos(FIGURE_SETTINGS.view_elevation_rad) * up - np.sin(FIGURE_SETTINGS.view_elevation_rad) * towards]
    )


def _dots(points: np.ndarray) -> np.ndarray:
    """Return strokes of almost no length, (n, 2 p, 2); their round ends appear as dots."""
    tiny = np.array([1e-4, 0.0]) * np.ptp(points)
    return np.stack([points, points + tiny], axis=2).reshape(len(points), -1, 2)


def efforts(
    trace: TreeTrace, names: Sequence[str], units: Sequence[str], errors: Sequence[float], recorded: str
) -> Drawing:
    """Draw measured and predicted effort of each joint, and their difference, over the recording and its worst
    stretch. `recorded` is the word for the recorded effort, such as "measured"."""
    m = len(names)
    figure = Figure(figsize=(FIGURE_WIDTH, 1.55 * m + 0.4), layout="constrained")
    axes = figure.subplots(m, 2, width_ratios=(2.3, 1.0), sharey="row", squeeze=False)
    for k, (left, right) in enumerate(axes):
        shown = trace.moving[:, k]
        measured = trace.effort[:, k]
        predicted, difference = (
            np.where(shown, x, np.nan) for x in (trace.predicted[:, k], measured - trace.predicted[:, k])
        )
        lines = ((measured, "measured", 2.4), (predicted, "fitted", 1.1), (difference, "heldout", 0.9))
        low, high = _worst(trace.time, difference)
        within = (trace.time >= low) & (trace.time <= high)
        for values, role, width in lines:
            line(left, trace.time, values, color=colour(role), linewidth=width)
            line(right, trace.time[within], values[within], color=colour(role), linewidth=1.5 * width)
        left.axvspan(low, high, color=colour("panel"), zorder=0)
        for axis in (left, right):
            axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
            tidy(axis, first=axis is left, text=effort_label(units[k]), ticks=4)
        heads([left], [Head(names[k].replace("_", " "), f"error {percent(errors[k])} %", colour("muted"))])
        right.set_xlim(low, high)
    key(
        axes[0, 1],
        [(t, colour(r)) for t, r in ((recorded, "measured"), ("predicted", "fitted"), ("difference", "heldout"))],
    )
    axes[-1, 0].set_xlabel("Time (s)")
    axes[-1, 1].set_xlabel("Time (s), largest error")
    return Drawing(
        "effort",
        figure,
        f"Effort of each joint in {trace.recording.replace('_', ' ')}: {recorded}, predicted where the joint moves, "
        "and the difference. Right: the segment with the largest difference, shaded at the left.",
    )


def _worst(time: np.ndarray, difference: np.ndarray) -> tuple[float, float]:
    """Return the stretch in which a difference, (n,), is largest; NaN does not count."""
    span = float(time[-1] - time[0])
    width = min(max(FIGURE_SETTINGS.worst_share * span, 12.0 * float(np.median(np.diff(time)))), span)
    squares = np.where(np.isfinite(difference), difference, 0.0) ** 2
    summed = np.concatenate([[0.0], np.cumsum(squares)])
    starts = np.linspace(time[0], time[-1] - width, 400)
    first, last = np.searchsorted(time, starts), np.searchsorted(time, starts + width)
    start = float(starts[int(np.argmax(summed[last] - summed[first]))])
    return start, start + width


def short(name: str) -> str:
    """Return a joint's name, shortened for a table head."""
    return name.removesuffix("_joint").replace("_", " ")


def error_dots(
    axis: Axes, names: Sequence[str], errors: Mapping[str, Sequence[float]], roles: Mapping[str, str]
) -> None:
    """Draw the error of each joint in a row, with a dot for each model."""
    values = np.array([list(each) for each in errors.values()], float)
    for k in range(len(names)):
        known = values[:, k][np.isfinite(values[:, k])]
        if len(known):
            axis.plot((known.min(), known.max()), (k, k), color=colour("rule"), linewidth=2.0, zorder=1)
    # Each model has a height of its own within a row, so that no dot hides another.
    heights = np.linspace(-0.36, 0.36, len(errors)) if len(errors) > 1 else np.zeros(1)
    for (model, each), height in zip(errors.items(), heights, strict=True):
        axis.plot(
            list(each), np.arange(len(names)) + height, color=colour(roles[model]), marker="o", markersize=5.5,
            linestyle="none", markeredgewidth=0.0, zorder=3,
        )  # fmt: skip
    axis.set_ylim(len(names) - 0.5, -0.6)
    axis.set_yticks(range(len(names)), [short(name) for name in names])
    axis.set_xlim(0.0, 1.08 * float(np.nanmax(values)) if np.isfinite(values).any() else 1.0)
    axis.tick_params(axis="y", labelcolor=colour("ink"), length=0)
    axis.tick_params(axis="x", length=3, width=0.7, pad=3)
    axis.grid(axis="y", visible=False)
    axis.spines["left"].set_visible(False)
    axis.set_xlabel("Error of the effort (%)")
    for i, model in enumerate(errors):
        axis.annotate(
            model, (0.0, 1.0), xytext=(4, 8 + 14 * (len(errors) - 1 - i)), xycoords="axes fraction",
            textcoords="offset points", color=colour(roles[model]), fontsize=9, fontweight="bold",
        )  # fmt: skip
    axis.set_title("\n" * len(errors), fontsize=8.5)


@dataclass(frozen=True)
class FrictionCurve:
    """Friction of a joint, measured and modelled."""

    name: str  # name of the joint
    unit: str  # unit of friction and load
    speed_unit: str
    speed: np.ndarray  # (n,) [rad/s; m/s]
    load: np.ndarray  # load at these samples, (n,) [N m; N]
    measured: np.ndarray  # measured friction, (n,) [N m; N]
    grid: np.ndarray  # speeds of the modelled curves, (g,) [rad/s; m/s]
    curves: Mapping[str, np.ndarray]  # modelled friction by load in words, (g,) each [N m; N]
    slope: float  # increase of friction with load


LOAD_ROLES = ("fitted", "load", "heldout")
"""Colour roles of the curves at small, medium and large load."""


def friction(curves: Sequence[FrictionCurve]) -> Drawing:
    """Draw the friction of each joint against speed: recorded effort minus that of the links, and the model."""
    figure, axes = _grid(len(curves), 2.3)
    for axis, curve in zip(axes, curves, strict=True):
        thirds = np.quantile(np.abs(curve.load), (1 / 3, 2 / 3)) if len(curve.load) else (0.0, 0.0)
        group = np.digitize(np.abs(curve.load), thirds)
        for g, role in enumerate(LOAD_ROLES):
            dots(axis, curve.speed[group == g], curve.measured[group == g], colour(role), alpha=0.22, size=2.2)
        for (_, values), role in zip(curve.curves.items(), LOAD_ROLES, strict=True):
            axis.plot(curve.grid, values, color=colour(role), linewidth=1.8, zorder=4)
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        axis.axvline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        tidy(axis, first=True, text=effort_label(curve.unit), ticks=5)
        # The axis ignores a few outliers, which would compress all other rows.
        low, high = np.quantile(curve.measured, (0.003, 0.997)) if len(curve.measured) else (-1.0, 1.0)
        made = np.concatenate([np.array([low, high]), *curve.curves.values()])
        pad = 0.08 * float(np.ptp(made) or 1.0)
        axis.set_ylim(float(made.min()) - pad, float(made.max()) + pad)
        axis.set_xlabel(f"Velocity ({unit_text(curve.speed_unit)})")
        axis.set_title(short(curve.name), fontweight="bold", fontsize=9.5)
        loads = [float(label) for label in curve.curves]
        for i, (x, role) in enumerate(zip(loads, LOAD_ROLES, strict=True)):
            axis.annotate(
                f"{number(x, digits=2)} {unit_text(curve.unit)}", (0.02, 0.97), xytext=(0, -11 * i),
                xycoords="axes fraction", textcoords="offset points", va="top", color=colour(role), fontsize=8,
            )  # fmt: skip
    return Drawing(
        "friction",
        figure,
        "Friction of each joint against its velocity. Dots: recorded effort minus that of bodies and of other joints' "
        "motors. Curves: the model at low, medium and high load (colours). Where the curves differ, friction depends "
        "on the load.",
    )


def friction_by_load(curves: Sequence[FrictionCurve]) -> Drawing:
    """Draw the load-dependent part of friction against the load of each joint."""
    figure, axes = _grid(len(curves), 2.2)
    for axis, curve in zip(axes, curves, strict=True):
        first = next(iter(curve.curves))
        without = np.interp(curve.speed, curve.grid, curve.curves[first]) * np.sign(curve.speed)
        load = np.abs(curve.load)
        beyond = curve.measured * np.sign(curve.speed) - without + curve.slope * float(first)
        dots(axis, load, beyond, colour("measured"), alpha=0.16, size=2.2)
        x = np.array([0.0, float(load.max(initial=1e-9))])
        axis.plot(x, curve.slope * x, color=colour("load"), linewidth=2.0, zorder=4)
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        tidy(axis, first=True, text=effort_label(curve.unit), ticks=5)
        low, high = np.quantile(beyond, (0.003, 0.997)) if len(beyond) else (-1.0, 1.0)
        pad = 0.08 * float(high - low)
        axis.set_ylim(float(min(low, 0.0)) - pad, float(max(high, curve.slope * x[1])) + pad)
        axis.set_xlabel(f"Load ({unit_text(curve.unit)})")
        slope_text = f"{percent(100.0 * curve.slope)} % of the load" if curve.slope else "no load friction chosen"
        heads([axis], [Head(short(curve.name), slope_text, colour("muted"))])
    return Drawing(
        "friction-load",
        figure,
        "Load friction of each joint: friction against the load, minus the modelled friction without load at the same "
        "speed. Dots: recorded. Line: model.",
    )


@dataclass(frozen=True)
class Cell:
    """Entry of a parameter in the map."""

    sd: float  # relative standard deviation [%]
    remark: str = ""  # remark in place of the number, if it should not be read


def shown_parameters(rows: Sequence[str], columns: Sequence[str], cells: Mapping[tuple[str, str], Cell]) -> Drawing:
    """Draw a map of identified parameters: a row for each joint or link, a column for each kind of parameter."""
    figure, axis = _map([row.replace("_", " ") for row in rows], columns, 0.9 + 0.34 * len(rows))
    axis.tick_params(axis="x", labelsize=8)
    for y, row in enumerate(rows):
        for x, column in enumerate(columns):
            cell = cells.get((row, column))
            if cell is None:
                continue
            role, alpha = _shade(cell)
            axis.add_patch(
                Rectangle((x - 0.46, y - 0.44), 0.92, 0.88, facecolor=colour(role), alpha=alpha, linewidth=0)
            )
            text = cell.remark or ("> 999" if cell.sd > 999.0 else number(cell.sd, digits=2 if cell.sd < 100 else 3))
            axis.annotate(text, (x, y), ha="center", va="center", fontsize=8, color=colour("ink"))
    return Drawing(
        "shown",
        figure,
        "Relative standard deviation of each parameter in percent. Green: up to "
        f"{FIGURE_SETTINGS.max_good_sd_percent:g} %, blue up to {FIGURE_SETTINGS.max_fair_sd_percent:g} %, "
        "orange: above. Empty: parameters that no motion of this robot identifies separately; others represent them.",
    )


def _map(rows: Sequence[str], columns: Sequence[str], height: float) -> tuple[Figure, Axes]:
    """Return an empty map with a named place for each row and column, numbered from 0."""
    figure = Figure(figsize=(FIGURE_WIDTH, height), layout="constrained")
    axis = figure.subplots()
    axis.set_xlim(-0.5, len(columns) - 0.5)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_yticks(range(len(rows)), rows)
    axis.set_xticks(range(len(columns)), columns)
    axis.xaxis.tick_top()
    axis.tick_params(length=0, labelcolor=colour("ink"))
    axis.grid(False)
    for spine in axis.spines.values():
        spine.set_visible(False)
    return figure, axis


def _shade(cell: Cell) -> tuple[str, float]:
    if cell.remark:
        return "faint", 0.35
    if cell.sd <= FIGURE_SETTINGS.max_good_sd_percent:
        return "good", 0.38
    return ("fitted", 0.28) if cell.sd <= FIGURE_SETTINGS.max_fair_sd_percent else ("heldout", 0.28)


def chosen_families(
    joints: Sequence[str], terms: Sequence[str], shares: np.ndarray, chosen: np.ndarray, folds: int
) -> Drawing:
    """Draw the chosen friction terms: `shares`, (m, t), of the folds, and `chosen`, (m, t), from all data."""
    heads = [term.replace("_", " ") for term in terms]
    figure, axis = _map([short(joint) for joint in joints], heads, 0.8 + 0.3 * len(joints))
    for y in range(len(joints)):
        for x in range(len(terms)):
            axis.add_patch(
                Rectangle(
                    (x - 0.46, y - 0.42), 0.92, 0.84, facecolor=colour("fitted"), linewidth=0,
                    alpha=0.06 + 0.5 * float(shares[y, x]),
                )
            )  # fmt: skip
            text = f"{round(folds * float(shares[y, x]))} of {folds}" + (" ✓" if chosen[y, x] else "")
            axis.annotate(
                text, (x, y), ha="center", va="center", fontsize=8.5, color=colour("ink"),
                fontweight="bold" if chosen[y, x] else "normal",
            )  # fmt: skip
    return Drawing(
        "families",
        figure,
        "Friction terms in addition to viscous and dry friction. Each number states in how many of "
        f"{folds} cross-validation folds the term was chosen for the joint; ✓ marks the choice on all segments.",
    )


def intervals(stated: np.ndarray, jackknife: np.ndarray, share: float) -> Drawing:
    """Draw stated against jackknife standard errors, both (p,) and divided by the parameter's value."""
    figure = Figure(figsize=(FIGURE_WIDTH, 3.9), layout="constrained")
    axis = figure.subplots()
    good = (stated > 0.0) & (jackknife > 0.0) & np.isfinite(stated) & np.isfinite(jackknife)
    x, y = jackknife[good], stated[good]
    low, high = (float(f(np.concatenate([x, y]))) for f in (np.min, np.max)) if len(x) else (0.1, 1.0)
    span = np.array([0.6 * low, 1.7 * high])
    axis.fill_between(span, span / 2.0, span * 2.0, color=colour("good"), alpha=0.12, linewidth=0)
    axis.plot(span, span, color=colour("muted"), linewidth=0.9)
    inside = (y <= 2.0 * x) & (x <= 2.0 * y)
    for chosen, role in ((inside, "fitted"), (~inside, "heldout")):
        axis.plot(
            x[chosen], y[chosen], color=colour(role), marker="o", markersize=5.0, linestyle="none", markeredgewidth=0.0,
            alpha=0.8,
        )  # fmt: skip
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlim(*span)
    axis.set_ylim(*span)
    axis.tick_params(length=3, width=0.7, pad=3, which="both")
    axis.set_xlabel("Standard deviation by leaving out each segment in turn (% of the value)")
    axis.set_ylabel("Stated standard error (%)")
    return Drawing(
        "intervals",
        figure,
        "Stated standard errors against those of the jackknife over segments: "
        f"{number(share, digits=3)} % agree within a factor of two (band).",
    )


@dataclass(frozen=True)
class RippleSpectrum:
    """Spectrum of a drive's residual over its motor's angle."""

    joint: str
    unit: str  # unit of the amplitude
    order: np.ndarray  # periods per turn of the motor, (n,)
    amplitude: np.ndarray  # amplitude at each order, (n,)
    found: float  # order of the ripple that was found


def ripples(spectra: Sequence[RippleSpectrum]) -> Drawing:
    """Draw the ripple spectrum of each drive in a panel."""
    rows = -(-len(spectra) // 2)
    figure = Figure(figsize=(FIGURE_WIDTH, 2.4 * rows + 0.2), layout="constrained")
    axes = figure.subplots(rows, min(2, len(spectra)), squeeze=False).ravel()
    for axis in axes[len(spectra) :]:
        axis.set_axis_off()
    for axis, spectrum in zip(axes, spectra, strict=False):
        line(axis, spectrum.order, spectrum.amplitude, color=colour("measured"), linewidth=1.2)
        top = float(np.interp(spectrum.found, spectrum.order, spectrum.amplitude))
        axis.plot([spectrum.found], [top], color=colour("heldout"), marker="o", markersize=7, markeredgewidth=0.0)
        axis.annotate(
            number(spectrum.found, digits=4), (spectrum.found, top), xytext=(8, -2), textcoords="offset points",
            va="center", color=colour("heldout"), fontsize=9, fontweight="bold",
        )  # fmt: skip
        tidy(axis, first=True, text=f"Amplitude ({unit_text(spectrum.unit)})", ticks=5)
        axis.set_ylim(0.0, 1.12 * float(np.nanmax(spectrum.amplitude)))
        axis.set_xlabel("Periods per turn of the motor")
        axis.set_title(short(spectrum.joint), fontweight="bold", fontsize=9.5)
    return Drawing(
        "ripple",
        figure,
        "Torque ripple of the drives: amplitude spectrum of the residuals of the model without ripple, over the number "
        "of periods per turn of the motor.",
    )


def _grid(count: int, height: float) -> tuple[Figure, list[Axes]]:
    rows = -(-count // FIGURE_SETTINGS.column_count)
    figure = Figure(figsize=(FIGURE_WIDTH, height * rows + 0.2), layout="constrained")
    axes = figure.subplots(rows, min(FIGURE_SETTINGS.column_count, count), squeeze=False).ravel()
    for axis in axes[count:]:
        axis.set_axis_off()
    return figure, list(axes[:count])


def arm(found: TreeResult, errors: Mapping[str, Sequence[float]], judged: str, name: str = "arm") -> Drawing:
    """Draw the arm along a recording, and each joint's prediction error by each model."""
    trace = drawn_trace(found)
    figure = Figure(figsize=(FIGURE_WIDTH, max(4.4, 1.6 + 0.42 * len(found.names))), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.35, 1.0))
    worst = found.names[found.worst]
    ways, seconds = stick_figure(left, found.robot.tree, trace.time, trace.position, worst=worst, name=name)
    error_dots(right, found.names, errors, {MODEL_DESCRIPTIONS[model]: role for model, role in MODEL_ROLES.items()})
    caption = (
        f"Left: the arm during {seconds:.3g} s of {trace.recording.replace('_', ' ')}, with links as lines, joints as "
        "circles and axes as short strokes. Faint: other postures; thin line: path of the end. Orange: the joint with "
        f"the largest error.{_meeting_joints(found.robot.tree, trace.position)} Right: effort error of each joint on "
        f"{judged}, by model."
    )
    return MovingDrawing(name, figure, caption, ways=ways, seconds=seconds)


def _meeting_joints(tree: Tree, position: np.ndarray) -> str:
    """Return a caption's sentence that names the joints whose circles are at one place in all postures, or ""."""
    moving = _moves(tree)
    places = tree.core.placements(position)[..., 3][:, moving]
    reach = max(float(np.ptp(places.reshape(-1, 3), axis=0).max()), 1e-9)
    groups: list[list[int]] = []
    for k in range(len(moving)):
        met = (g for g in groups if np.abs(places[:, k] - places[:, g[0]]).max() <= MEETING_SHARE * reach)
        group = next(met, None)
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    shared = [listed_names([short(tree.moving[k].name) for k in g], len(g)) for g in groups if len(g) > 1]
    return f" One circle stands for {'; one for '.join(shared)}." if shared else ""


MEETING_SHARE = 0.01
"""Joints whose centres stay within this share of the arm's extent share a circle."""

MODEL_ROLES: Mapping[str, str] = {
    "published": "muted", "stated": "load", "base": "fitted", "best": "heldout", "consistent": "good",
}  # fmt: skip
"""Colour roles of the models."""


def drawn_trace(found: TreeResult) -> TreeTrace:
    """Return the recording that is drawn: the first held-out one, or else the first."""
    return next((t for t in found.traces if t.use == "validate"), found.traces[0])
