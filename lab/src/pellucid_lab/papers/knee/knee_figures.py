"""Figures of an orthosis and its wearer: torques of holds, straps with their intervals, compared controllers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from pellucid.study.drawing.drawing import Drawing, Head, heads, key, one_panel, tidy
from pellucid.study.drawing.style import FIGURE_WIDTH, colour


@dataclass(frozen=True)
class HoldTorques:
    """One panel of `hold_torques`."""

    head: str
    angle: np.ndarray  # angle, torque: (k,) Of the holds [rad], [N m].
    torque: np.ndarray
    # gravity, zero, offset: Of the sine: m g l [N m], angle of rest [rad], torque without gravity [N m].
    gravity: float
    zero: float = 0.0
    offset: float = 0.0
    printed: float | None = None  # m g l that stands beside it [N m]


def hold_torques(panels: Sequence[HoldTorques], name: str, *, caption: str) -> Drawing:
    """Draw torques that hold a segment at its angles, the sine through them, and the straight line of best fit."""
    figure = Figure(figsize=(FIGURE_WIDTH, 3.9), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    angle = np.linspace(-0.03, np.pi / 2 + 0.03, 120)
    for axis, panel in zip(axes, panels, strict=True):
        sine = panel.gravity * np.sin(angle - panel.zero) + panel.offset
        straight = np.polyval(np.polyfit(panel.angle, panel.torque, 1), angle)
        axis.plot(np.degrees(angle), straight, color=colour("heldout"), linewidth=1.2, linestyle=(0, (5, 3)))
        axis.plot(np.degrees(angle), sine, color=colour("fitted"), linewidth=1.8)
        axis.plot(
            np.degrees(panel.angle), panel.torque, color=colour("measured"), marker="o", markersize=5.0,
            markeredgewidth=0.0, linestyle="none", alpha=0.75, zorder=4,
        )  # fmt: skip
        tidy(axis, first=True, text="Torque (N·m)" if axis is axes[0] else "")
        axis.set_xticks((0, 15, 30, 45, 60, 90))
        axis.set_xlabel("Angle (deg)")
        axis.set_ylim(min(0.0, float(panel.torque.min())) - 0.04 * panel.gravity, 1.08 * float(panel.torque.max()))
    beside = ["" if p.printed is None else f", thesis {p.printed:.4g}" for p in panels]
    heads(
        axes, [Head(p.head, f"{p.gravity:.4g} N·m{b}", colour("fitted")) for p, b in zip(panels, beside, strict=True)]
    )
    for axis in axes:
        key(axis, [("held", colour("measured")), ("sine", colour("fitted")), ("line", colour("heldout"))])
    return Drawing(name, figure, caption)


@dataclass(frozen=True)
class StrapIntervals:
    """One panel of `strap_intervals`: a parameter of one subject's strap over seeds."""

    head: str
    values: np.ndarray  # values, half_widths: (k,) Estimates and half their intervals, in the panel's unit.
    half_widths: np.ndarray
    truth: float
    unit: str


def strap_intervals(rows: Sequence[Sequence[StrapIntervals]], name: str, *, caption: str) -> Drawing:
    """Draw estimates of straps with their intervals, seed by seed, and the truth as a line."""
    figure = Figure(figsize=(FIGURE_WIDTH, 2.4 * len(rows) + 0.3), layout="constrained")
    axes = figure.subplots(len(rows), len(rows[0]), squeeze=False)
    for panels, row in zip(rows, axes, strict=True):
        for axis, panel in zip(row, panels, strict=True):
            seeds = np.arange(1, len(panel.values) + 1)
            inside = np.abs(panel.values - panel.truth) <= panel.half_widths
            axis.axhline(panel.truth, color=colour("measured"), linewidth=1.4, zorder=2)
            for chosen, tone in ((inside, "fitted"), (~inside, "heldout")):
                if chosen.any():
                    axis.errorbar(
                        seeds[chosen], panel.values[chosen], panel.half_widths[chosen], color=colour(tone), fmt="o",
                        markersize=4.5, markeredgewidth=0.0, elinewidth=1.3, zorder=3,
                    )  # fmt: skip
            tidy(axis, first=True, text=panel.unit, ticks=4)
            axis.set_xlim(0.4, len(seeds) + 0.6)
            axis.set_xticks(seeds if len(seeds) <= 12 else [])
        heads(list(row), [Head(p.head, f"truth {p.truth:.3g}", colour("measured")) for p in panels])
    for axis in axes[-1]:
        axis.set_xlabel("Seed of the noise")
    return Drawing(name, figure, caption)


@dataclass(frozen=True)
class ControllerRatios:
    """One line of `torque_ratios`."""

    name: str  # The controller
    # (k,) Strap torque as a share of zero-impedance mode's, a value for each wearer and swing [1], by group of wearers
    groups: Mapping[str, np.ndarray]


def torque_ratios(
    lines: Sequence[ControllerRatios], name: str, *, roles: Mapping[str, str], wanted: float, caption: str
) -> Drawing:
    """Strap torque of every controller as a share of zero-impedance mode's, a dot for each wearer, a bar their median.

    wanted [1].
    """
    figure, axis = one_panel(0.42 * len(lines) + 1.2)
    largest = max(float(np.max(v)) for one in lines for v in one.groups.values())
    for place, one in enumerate(lines):
        for i, (group, values) in enumerate(one.groups.items()):
            height = place + 0.22 * (i - 0.5 * (len(one.groups) - 1))
            tone = colour(roles[group])
            axis.plot(
                values, np.full(len(values), height), color=tone, marker="o", markersize=5.0, markeredgewidth=0.0,
                linestyle="none", alpha=0.65, zorder=3,
            )  # fmt: skip
            axis.plot([np.median(values)] * 2, [height - 0.14, height + 0.14], color=tone, linewidth=2.4, zorder=4)
    axis.axvline(wanted, color=colour("faint"), linewidth=1.2, zorder=1)
    tidy(axis, first=True, text="")
    axis.set_yticks(range(len(lines)), [one.name for one in lines])
    axis.set_ylim(len(lines) - 0.4, -0.9)
    axis.set_xlim(0.0, 1.05 * largest)
    axis.set_xlabel("Strap torque as a share of zero-impedance mode's (RMS)")
    key(axis, [(group, colour(roles[group])) for group in lines[0].groups])
    return Drawing(name, figure, caption)
