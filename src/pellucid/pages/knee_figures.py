"""Figures of an orthosis and who wears it: torques held, angles and torques over time, straps with their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from .drawing import Drawing, Head, heads, key, line, tidy
from .style import FIGURE_WIDTH, colour


@dataclass(frozen=True)
class HeldTorques:
    """One panel of `held_torques`.

    Parameters
    ----------
    head : str
    angle, torque : ndarray, shape (k,)
        Of the holds [rad], [N m].
    gravity, zero, offset : float
        Of the sine: m g l [N m], angle of rest [rad], torque without gravity [N m].
    printed : float or None
        m g l that stands beside it [N m].
    """

    head: str
    angle: np.ndarray
    torque: np.ndarray
    gravity: float
    zero: float = 0.0
    offset: float = 0.0
    printed: float | None = None


def held_torques(panels: Sequence[HeldTorques], name: str, *, caption: str) -> Drawing:
    """Torques that hold a segment at its angles, the sine through them, and the straight line of best fit.

    Parameters
    ----------
    panels : sequence of HeldTorques
    name : str
    caption : str

    Returns
    -------
    Drawing
    """
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
        key(axis, [("held", colour("measured")), ("sine", colour("fitted")), ("line", colour("heldout"))])
        axis.set_ylim(min(0.0, float(panel.torque.min())) - 0.04 * panel.gravity, 1.28 * float(panel.torque.max()))
    beside = ["" if p.printed is None else f", thesis {p.printed:.4g}" for p in panels]
    heads(
        axes, [Head(p.head, f"{p.gravity:.4g} N·m{b}", colour("fitted")) for p, b in zip(panels, beside, strict=True)]
    )
    return Drawing(name, figure, caption)


@dataclass(frozen=True)
class Traces:
    """One panel of `over_time`.

    Parameters
    ----------
    head, rest : str
        Its name, and what else stands above it.
    time : ndarray, shape (n,)
        [s]
    lines : mapping of str to ndarray, shape (n,)
        By label.
    unit : str
        The vertical axis's label, with its unit.
    """

    head: str
    rest: str
    time: np.ndarray
    lines: Mapping[str, np.ndarray]
    unit: str


def over_time(
    panels: Sequence[Traces], name: str, *, roles: Mapping[str, str], caption: str, height: float = 2.6
) -> Drawing:
    """Signals over time, one panel beneath another.

    Parameters
    ----------
    panels : sequence of Traces
    name : str
    roles : mapping of str to str
        Of each label, a role of `style`; the first line of a panel is drawn wide.
    caption : str
    height : float
        Of a panel, inches.

    Returns
    -------
    Drawing
    """
    figure = Figure(figsize=(FIGURE_WIDTH, height * len(panels) + 0.3), layout="constrained")
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for axis, panel in zip(axes, panels, strict=True):
        for i, (label, values) in enumerate(panel.lines.items()):
            width = {"linewidth": 2.6, "alpha": 0.55} if i == 0 else {"linewidth": 1.3}
            line(axis, panel.time, values, color=colour(roles[label]), **width)
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        tidy(axis, first=True, text=panel.unit, ticks=5)
        low, high = axis.get_ylim()
        axis.set_ylim(low, high + 0.16 * (high - low))  # room for the key
        key(axis, [(label, colour(roles[label])) for label in panel.lines])
        axis.set_title(" ", fontsize=9.5)
        heads([axis], [Head(panel.head, panel.rest, colour("muted"))])
    axes[-1].set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


@dataclass(frozen=True)
class StrapIntervals:
    """One panel of `strap_intervals`: a parameter of one subject's strap over seeds.

    Parameters
    ----------
    head : str
    values, half_widths : ndarray, shape (k,)
        Estimates and half their intervals, in the panel's unit.
    truth : float
    unit : str
    """

    head: str
    values: np.ndarray
    half_widths: np.ndarray
    truth: float
    unit: str


def strap_intervals(rows: Sequence[Sequence[StrapIntervals]], name: str, *, caption: str) -> Drawing:
    """Estimates of straps with their intervals, seed by seed, and the truth as a line.

    Parameters
    ----------
    rows : sequence of sequence of StrapIntervals
        Panels, row by row.
    name : str
    caption : str

    Returns
    -------
    Drawing
    """
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
