"""Figures of an assessment: mean movements by condition, isochrony, and every participant's indices.

Each condition has one colour on all figures; control is dark grey.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...study.drawing.drawing import Drawing, dots, key, line, tidy
from ...study.drawing.style import FIGURE_WIDTH, colour
from ...study.pages.forest import Estimate, forest_panel
from ...study.pages.moving import MovingDrawing, Way, strokes
from ...study.pages.quantities import MINUS_SIGN, name_words, unit_text
from ...units import COORDINATES_BY_UNIT, Coordinate
from ..certificate_text import change_figure, interval_level
from ..design_columns import DIRECTION_DOWN, DIRECTION_UP
from ..movement_indices import Isochrony
from .assessment_result import Assessed, Certified, Profile, Settling
from .movement_curves import QUANTITY_NAMES
from .primary_change import PrimaryChange

CONDITION_COLOUR_ROLES = ("measured", "fitted", "heldout", "directional", "load", "stribeck", "combined", "good")
"""Colour roles of control and of the other conditions in their order; further conditions share the last."""

FRAME_COUNT = 48
"""Number of frames of a movement."""

START_ANGLE_RAD = -0.5
"""Drawn direction of a limb when a movement starts [rad from horizontal]; profiles are relative to the start."""

LIMB_WIDTH = 7.0
"""Drawn width of a moving limb [points]."""

REST_S = 0.6
"""Time for which moving limbs rest before they move again [s]."""

DIRECTION_LABELS = {DIRECTION_UP: "Upwards", DIRECTION_DOWN: "Downwards"}
"""Labels of the directions of movement."""


def tones(conditions: Sequence[str]) -> dict[str, str]:
    """Return the colour of every condition, control first."""
    return {
        c: colour(CONDITION_COLOUR_ROLES[min(i, len(CONDITION_COLOUR_ROLES) - 1)]) for i, c in enumerate(conditions)
    }


def profile_figure(
    profiles: Sequence[Profile], what: str, conditions: Sequence[str], along: Coordinate = COORDINATES_BY_UNIT["rad"]
) -> Drawing:
    """Draw mean position, velocity and acceleration of one kind of movement from its start."""
    tone = tones(conditions)
    figure = Figure(figsize=(FIGURE_WIDTH, 3.2), layout="constrained")
    axes = figure.subplots(1, 3)
    first, unit = "Angle" if along.unit == "rad" else "Position", along.shown
    parts = (
        (f"{first} ({unit})", "angle"),
        (f"Velocity ({unit}/s)", "velocity"),
        (f"Acceleration ({unit}/s²)", "acceleration"),
    )
    for axis, (text, name) in zip(axes, parts, strict=True):
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        for profile in profiles:
            line(
                axis, profile.time, along.factor * getattr(profile, name), color=tone[profile.condition], linewidth=1.5
            )
        tidy(axis, first=True, text=text)
        axis.set_xlabel("Time from start (s)")
    key(axes[0], [(profile.condition, tone[profile.condition]) for profile in profiles])
    return Drawing(
        "profiles",
        figure,
        f"Mean movements of {what}, aligned at their start and averaged within, then over participants.",
    )


def settling_figure(settling: Sequence[Settling], conditions: Sequence[str]) -> Drawing:
    """Draw the share of movements that have not settled, against the time since their start."""
    tone = tones(conditions)
    figure = Figure(figsize=(FIGURE_WIDTH, 3.2), layout="constrained")
    axis = figure.subplots()
    for each in settling:
        curve = each.curve
        first = 0.5 * float(curve.time[0]) if len(curve.time) else 0.5 * curve.longest
        time = np.concatenate(([first], curve.time, [curve.longest]))
        last = curve.share[-1] if len(curve.share) else 1.0
        kinds = (
            np.concatenate(([1.0], part, [part[-1] if len(part) else last]))
            for part in (curve.low, curve.high, curve.share)
        )
        low, high, share = (100.0 * part for part in kinds)
        axis.fill_between(time, low, high, step="post", color=tone[each.condition], alpha=0.15, linewidth=0.0)
        axis.step(time, share, where="post", color=tone[each.condition], linewidth=1.5)
    axis.set_xscale("log")
    ticks = [t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if axis.get_xlim()[0] <= t <= axis.get_xlim()[1]]
    axis.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axis.minorticks_off()
    axis.set_ylim(0.0, 105.0)
    tidy(axis, first=True, text="Still moving (%)")
    axis.set_xlabel("Time from start (s)")
    key(axis, [(each.condition, tone[each.condition]) for each in settling])
    shares_text = "; ".join(f"{each.condition} {100.0 * each.curve.cut:.1f} %" for each in settling)
    return Drawing(
        "settling",
        figure,
        "Share of movements that have not ended (Kaplan-Meier, all participants), with 95 % intervals that treat "
        f"movements as independent. Not settled before the next target: {shares_text}.",
    )


def isochrony_figure(lines: Sequence[Isochrony], conditions: Sequence[str]) -> Drawing:
    """Draw mean velocity and duration against amplitude: every participant, means over them, and straight lines."""
    tone = tones(conditions)
    along = COORDINATES_BY_UNIT[lines[0].unit]
    names = DIRECTION_LABELS if along.unit == "rad" else {DIRECTION_UP: "Forwards", DIRECTION_DOWN: "Backwards"}
    directions = [d for d in names if any(each.direction == d for each in lines)]
    figure = Figure(figsize=(FIGURE_WIDTH, 5.6), layout="constrained")
    axes = figure.subplots(2, len(directions), squeeze=False, sharex=True, sharey="row")
    for column, direction in enumerate(directions):
        top, bottom = axes[:, column]
        for each in (x for x in lines if x.direction == direction):
            for person in each.people:
                own = np.array(person).T
                for axis, values in ((top, along.factor * own[1]), (bottom, own[2])):
                    line(axis, along.factor * own[0], values, color=tone[each.condition], linewidth=0.7, alpha=0.35)
            amplitude, velocity, duration = np.array(each.points).T
            for axis, values, slope, offset, scale in (
                (top, velocity, each.velocity_slope, each.velocity_intercept, along.factor),
                (bottom, duration, each.duration_slope, each.duration_intercept, 1.0),
            ):
                far = along.factor * amplitude
                line(axis, far, scale * (slope * amplitude + offset), color=tone[each.condition], linewidth=1.3)
                dots(axis, far, scale * values, tone[each.condition], alpha=0.9, size=6.0)
        top.set_title(names[direction], fontweight="bold")
        tidy(top, first=column == 0, text=f"Mean velocity ({along.shown}/s)")
        tidy(bottom, first=column == 0, text="Duration (s)")
        bottom.set_xlabel(f"Amplitude ({along.shown})")
        bottom.margins(x=0.04)
    shown = [c for c in conditions if any(each.condition == c for each in lines)]
    key(axes[0, -1], [(c, tone[c]) for c in shown])
    slopes_text = "; ".join(
        f"{each.condition} {each.direction} {each.velocity_slope:.2f} 1/s, "
        f"{along.factor * each.velocity_intercept:.0f} {along.shown}/s"
        for each in lines
    )
    return Drawing(
        "isochrony",
        figure,
        "Means over participants at each amplitude, with straight-line fits; thin lines are participants. Slope and "
        "offset of mean velocity: " + slopes_text + ".",
    )


def index_figure(assessed: Mapping[str, Assessed], conditions: Sequence[str]) -> Drawing:
    """Draw every participant in every condition as a line of points, with the mean over participants."""
    tone = tones(conditions)
    columns = min(len(assessed), 3)
    rows = -(-len(assessed) // columns)
    figure = Figure(figsize=(FIGURE_WIDTH, 0.4 + 2.9 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, each in zip(axes, assessed.values(), strict=False):
        _panel(axis, each, tone)
    for axis in axes[len(assessed) :]:
        axis.set_visible(False)
    return Drawing(
        "indices",
        figure,
        "Each line is a participant: the mean over movements. The bar is the mean over participants.",
    )


def _panel(axis, each: Assessed, tone: Mapping[str, str]) -> None:
    table = each.table
    at = np.arange(len(table.conditions))
    factor, unit = table.index.shown
    for row in factor * table.values:
        line(axis, at, row, color=colour("faint"), linewidth=0.9, zorder=2)
    for x, condition in zip(at, table.conditions, strict=True):
        values = factor * table.column(condition)
        mean = float(np.mean(values))
        axis.plot((x - 0.24, x + 0.24), (mean, mean), color=tone[condition], linewidth=2.8, zorder=4)
        dots(axis, np.full(len(values), float(x)), values, tone[condition], alpha=0.9, size=5.0)
    unit = unit_text(unit)
    tidy(axis, first=True, text=f"{table.index.short}" + (f" ({unit})" if unit else ""), ticks=5)
    axis.set_xticks(at, [name_words(condition).replace(" ", "\n") for condition in table.conditions])
    axis.set_xlim(-0.6, len(at) - 0.4)
    axis.grid(visible=False, axis="x")


def changes_figure(
    each: Assessed,
    changes: Mapping[str, PrimaryChange],
    control: str,
    study: str,
    profiles: Sequence[Profile] = (),
    what: str = "",
) -> Drawing:
    """Draw an index's participants as points and lines, and its changes from control with their intervals.

    With `profiles` of a joint's angle, which are of the movement `what`, an animated limb for each condition is added.
    """
    conditions = each.table.conditions
    tone = tones((control, *(c for c in conditions if c != control)))
    figure = Figure(figsize=(FIGURE_WIDTH, 3.3), layout="constrained")
    if profiles:
        limbs, people, forest = figure.subplots(1, 3, width_ratios=(0.62, 1.0, 1.25))
    else:
        people, forest = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    _panel(people, each, tone)
    roles = dict(zip((c for c in conditions if c != control), CONDITION_COLOUR_ROLES[1:], strict=False))
    estimates = [
        Estimate(
            name_words(condition), change.value, change.low, change.high,
            roles.get(condition, CONDITION_COLOUR_ROLES[-1]),
            f"{'≥ ' if change.at_least else ''}{change_figure(change.value, change.unit)}".replace("-", MINUS_SIGN)
            if np.isfinite(change.value) else "",
            "" if change.at_least else f"{study}.transparency.{each.name}.{condition.lower()}",
        )
        for condition, change in changes.items()
    ]  # fmt: skip
    unit = next((change.unit for change in changes.values()), "")
    forest_panel(forest, estimates, f"Change from {control}" + (f" ({unit})" if unit else ""))
    widest = 3.0 * max((abs(e.value) for e in estimates if np.isfinite(e.value)), default=1.0)
    low, high = forest.get_xlim()
    forest.set_xlim(max(low, -max(widest, 100.0)), min(high, max(widest, 100.0)))
    told = (
        f"{each.table.index.words}: every participant is a line, the bar is the mean. Right: the change from {control} "
        "with its interval; an interval at the edge of the panel extends beyond it."
    )
    if not profiles:
        return Drawing("changes", figure, told)
    ways, seconds = _moving_limbs(limbs, profiles, tone)
    caption = f"Left: mean movements of the limb, one colour for each condition ({what}). {told}"
    return MovingDrawing("changes", figure, caption, ways, seconds)


LIMB_CELL_WIDTH = 1.75
"""Width of the room of one limb, in lengths of its upper part."""

LIMB_NAME_HEIGHT = 0.55
"""Height of a limb's name below it, in the same lengths."""


def _moving_limbs(axis: Axes, profiles: Sequence[Profile], tone: Mapping[str, str]) -> tuple[dict[str, Way], float]:
    """Draw a limb for each condition that turns about one joint as people moved on average; return ways and seconds.

    Each limb has a cell of its own, with its condition below, so that none covers another.
    """
    columns = min(2, len(profiles))
    rows = -(-len(profiles) // columns)
    low = min(float(np.sin(START_ANGLE_RAD + np.nanmin(profile.angle))) for profile in profiles)
    width, height = LIMB_CELL_WIDTH, 1.15 - min(low, 0.0) + LIMB_NAME_HEIGHT
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-0.45, width * columns - 0.45)
    axis.set_ylim(1.15 - height * rows, 1.15)
    lasting = max(float(profile.time[-1]) for profile in profiles)
    frames = np.linspace(0.0, lasting, FRAME_COUNT)
    ways = {}
    for i, profile in enumerate(profiles):
        joint = np.array([width * (i % columns), -height * (i // columns)])
        shoulder = joint[0] - 0.35, joint[1] + 0.95
        axis.plot(
            *zip(shoulder, joint, strict=True), color=colour("faint"), linewidth=9.0, solid_capstyle="round",
        )  # fmt: skip
        known = np.isfinite(profile.time) & np.isfinite(profile.angle)
        angle = START_ANGLE_RAD + np.interp(frames, profile.time[known], profile.angle[known])
        hand = joint + 0.95 * np.column_stack([np.cos(angle), np.sin(angle)])
        points = np.stack([np.broadcast_to(joint, hand.shape), hand], axis=1)
        style = {"edgecolor": tone[profile.condition], "linewidth": LIMB_WIDTH, "zorder": 4.0}
        strokes(axis, points[-1], f"limb-{i}", **style)
        ways[f"limb-{i}"] = Way(axis, points)
        axis.plot(*joint, "o", color=colour("ink"), markersize=5.0, zorder=6)
        axis.text(
            joint[0] + 0.5 * width - 0.45, joint[1] + 1.15 - height, name_words(profile.condition), ha="center",
            va="bottom", fontsize=8.5, fontweight="bold", color=tone[profile.condition],
        )  # fmt: skip
    return ways, lasting + REST_S


VERDICT_COLOUR_ROLES = {"within": "good", "undecided": "muted", "beyond": "measured"}
"""Colour role of each verdict on an end point."""


def certificate_figure(certified: Sequence[Certified]) -> Drawing:
    """Draw every end point's interval divided by its margin, by condition."""
    rows = [(each, name) for each in certified for name in each.end_points]
    figure = Figure(figsize=(FIGURE_WIDTH, 0.9 + 0.3 * len(rows) + 0.12 * len(certified)), layout="constrained")
    axis = figure.subplots()
    axis.axvspan(-1.0, 1.0, color=colour("good"), alpha=0.10, linewidth=0.0, zorder=0)
    axis.axvline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    places, labels, at, last = [], [], 0.0, None
    reach = 1.0
    for each, name in rows:
        own, size = each.certificate.end_points[name], each.end_points[name].margin.high
        at -= 1.0 if last in (None, each.condition) else 1.4
        last = each.condition
        tone = colour(VERDICT_COLOUR_ROLES[each.certificate.said_of(name)])
        low, high = (float(np.clip(end / size, -MAX_DRAWN_MARGINS, MAX_DRAWN_MARGINS)) for end in own.interval)
        middle = float(np.clip(own.estimate / size, -MAX_DRAWN_MARGINS, MAX_DRAWN_MARGINS))
        reach = max(reach, abs(low), abs(high), abs(middle))
        axis.plot([low, high], [at, at], color=tone, linewidth=2.2, solid_capstyle="butt",
                  linestyle="-" if np.isfinite(own.interval[0]) else ":")  # fmt: skip
        axis.plot([middle], [at], marker="o", color=tone, markersize=5.0)
        places.append(at)
        label = f"{name_words(each.condition)}: {each.end_points[name].index.short}"
        shares = own.share_test(each.certificate.rule)
        by_people = f"\n{shares.far} of {shares.people} people over {shares.rule.far_margins:g} margins"
        labels.append(label + by_people * each.certificate.is_decided_by_people(name))
    axis.set_xlim(-1.1 * reach, 1.1 * reach)
    axis.set_ylim(at - 0.8, 0.0)
    tidy(axis, first=True, text="")
    axis.set_yticks(places, labels)
    alpha = certified[0].certificate.alpha
    level = interval_level(alpha)
    axis.set_xlabel(f"Change in margins, with its {level} interval")
    return Drawing(
        "certificate",
        figure,
        f"Changes from control, divided by their margins (shaded). The interval is of {level}, because an equivalence "
        f"test is two one-sided tests at {100.0 * alpha:g} % each. Where a label gives a number of people far "
        "beyond the margin, this number decides, and not the interval. Carry-over and losses may decide too. Lines are "
        f"cut beyond {MAX_DRAWN_MARGINS:g} margins.",
    )


def curves_figure(certified: Sequence[Certified], conditions: Sequence[str]) -> Drawing:
    """Draw differences of curves from control with their simultaneous bands, the margin, and clusters."""
    tone = tones(conditions)
    kinds = [name for name in QUANTITY_NAMES if any(c.quantity == name for each in certified for c in each.curves)]
    figure = Figure(figsize=(FIGURE_WIDTH, 0.5 + 2.3 * len(kinds)), layout="constrained")
    axes = figure.subplots(len(kinds), len(certified), squeeze=False, sharex=True, sharey="row")
    share = np.linspace(0.0, 100.0, 101)
    for row, kind in zip(axes, kinds, strict=True):
        for axis, each in zip(row, certified, strict=True):
            curve = next((c for c in each.curves if c.quantity == kind), None)
            axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
            if curve is None:
                continue
            own, factor = curve.comparison, curve.factor
            if own.margin is not None:
                axis.axhspan(factor * own.margin.low, factor * own.margin.high, color=colour("good"), alpha=0.10,
                             linewidth=0.0, zorder=0)  # fmt: skip
            axis.fill_between(share, factor * own.low, factor * own.high, color=tone[each.condition], alpha=0.2,
                              linewidth=0.0)  # fmt: skip
            line(axis, share, factor * own.mean, color=tone[each.condition], linewidth=1.6)
            for cluster in own.clusters:
                if cluster.p_value <= 0.05:
                    axis.plot([cluster.first, cluster.last], [0.03, 0.03], color=colour("measured"), linewidth=3.0,
                              transform=axis.get_xaxis_transform(), solid_capstyle="butt")  # fmt: skip
            tidy(axis, first=axis is row[0], text=f"{QUANTITY_NAMES[kind]} ({unit_text(curve.unit)})")
            if kind == kinds[0]:
                axis.set_title(each.condition, fontweight="bold")
            if kind == kinds[-1]:
                axis.set_xlabel("Time of the movement (%)")
    level = interval_level(certified[0].certificate.alpha)
    return Drawing(
        "curves",
        figure,
        "Change of curves from control, mean over participants, along the movement's direction; velocity and EMG in "
        f"% of their maximum in control. Bands cover the whole mean curve with {level} confidence; margins are "
        "shaded. Bars at the bottom mark times at which curves differ (sign-flip test over clusters, p at most 0.05).",
    )


MAX_DRAWN_MARGINS = 4.0
"""Largest drawn distance of an interval's end, as a multiple of the margin; longer lines are cut."""
