"""Figures of transfer functions, each a function from plain arrays to a drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from ....study.drawing.drawing import Drawing, key, line, one_panel, origin, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.quantities import number

CHANNEL_AXES: Mapping[str, tuple[str, float, str]] = {
    "rad": ("Angle", 180.0 / np.pi, "deg"),
    "m": ("Position", 1e3, "mm"),
    "N*m": ("Torque", 1.0, "N·m"),
    "N": ("Force", 1.0, "N"),
}
"""How a channel's unit is shown: in words, shown units per SI unit, and their name."""


def shown(unit: str, channel: str) -> tuple[str, float]:
    """An axis's label and what an SI value is multiplied by, for a `channel` in a `unit`."""
    words, scale, text = CHANNEL_AXES.get(unit, (channel.replace("_", " ").capitalize(), 1.0, unit))
    return f"{words} ({text})", scale


def response(
    time: np.ndarray,
    measured: np.ndarray,
    simulated: np.ndarray,
    signal: np.ndarray,
    labels: Sequence[tuple[str, float]],
    name: str,
    *,
    caption: str,
    heldout: bool = False,
) -> Drawing:
    """Output measured and simulated, what the simulation misses, and the input. `time`, `measured`, `simulated`,
    `signal` (n,) [s]."""
    (input_label, input_scale), (output_label, output_scale) = labels
    figure = Figure(figsize=(FIGURE_WIDTH, 4.6), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(3.0, 1.3, 1.0))
    tone = colour("heldout" if heldout else "fitted")
    line(top, time, output_scale * measured, color=colour("measured"), linewidth=2.4, alpha=0.55)
    line(top, time, output_scale * simulated, color=tone)
    line(middle, time, output_scale * (measured - simulated), color=tone)
    middle.axhline(0.0, color=colour("muted"), linewidth=0.8, zorder=1)
    line(bottom, time, input_scale * signal, color=colour("muted"))
    tidy(top, first=True, text=output_label)
    tidy(middle, first=True, text="Missed", ticks=4)
    tidy(bottom, first=True, text=input_label, ticks=3)
    top.margins(y=0.12)
    key(top, [("measured", colour("measured")), ("simulated", tone)])
    bottom.set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


def frequency_response(
    frequency: np.ndarray,
    measured: np.ndarray,
    radius: np.ndarray,
    levels: Sequence[tuple[str, str, np.ndarray]],
    fitted: tuple[np.ndarray, np.ndarray] | None,
    unit: str,
    name: str,
    *,
    caption: str,
) -> Drawing:
    """Magnitude and phase of a response as measured and as fitted, and what limits it. `frequency` (k,) [Hz];
    `measured` (k,) complex in a `unit`; `radius` (k,) of disks; `levels`: words, a colour's role, (k,); `fitted`:
    frequencies [Hz] and response, (j,)."""
    figure = Figure(figsize=(FIGURE_WIDTH, 5.2), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    size, tone = np.abs(measured), colour("measured")
    # An interval that holds zero has no lower end on a logarithm's scale.
    top.vlines(frequency, np.maximum(size - radius, 0.1 * size), size + radius, color=tone, linewidth=1.0, alpha=0.5)
    top.plot(frequency, size, color=tone, marker="o", markersize=3.5, linestyle="none", zorder=3)
    entries = [("measured", tone)]
    if fitted is not None:
        top.plot(fitted[0], np.abs(fitted[1]), color=colour("fitted"), zorder=4)
        entries.append(("transfer function", colour("fitted")))
    for words, role, level in levels:
        known = np.isfinite(level) & (level > 0.0)
        top.plot(frequency[known], level[known], color=colour(role), marker=".", markersize=4, linewidth=0.9, zorder=2)
        entries.append((words, colour(role)))
    _logarithmic(top, f"Gain ({unit})")
    key(top, entries)
    # The phase is arbitrary where the gain's uncertainty includes 0.
    sure = radius < size
    angle = np.degrees(np.unwrap(np.angle(measured[sure])))
    bottom.plot(frequency[sure], angle, color=tone, marker="o", markersize=3.5, linestyle="none", zorder=3)
    if fitted is not None:
        phase = np.degrees(np.unwrap(np.angle(fitted[1])))
        near = np.median(np.interp(frequency[sure], fitted[0], phase) - angle) if sure.any() else 0.0
        bottom.plot(fitted[0], phase - 360.0 * np.round(near / 360.0), color=colour("fitted"), zorder=4)
    tidy(bottom, first=True, text="Phase (deg)", ticks=4)
    bottom.set_xlabel("Frequency (Hz)")
    return Drawing(name, figure, caption)


def _logarithmic(axis: Axes, text: str) -> None:
    """Both scales, with numbers as they are said, and room for a key."""
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_ylabel(text)
    axis.tick_params(which="both", length=3, width=0.7, pad=3)
    axis.margins(x=0.02)
    low, high = axis.get_ylim()
    axis.set_ylim(low, high * (high / low) ** 0.12)
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=20))
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high < 30.0 * low else (1.0,), numticks=8))
    for each in (axis.xaxis, axis.yaxis):
        each.set_minor_locator(NullLocator())
        each.set_major_formatter(lambda x, _: f"{x:g}")


def output_lines(
    groups: Sequence[tuple[str, str, np.ndarray, np.ndarray]],
    noise: tuple[np.ndarray, np.ndarray],
    label: tuple[str, float],
    name: str,
    *,
    caption: str,
) -> Drawing:
    """Amplitudes of the output line by line: `groups` in words, a colour's role, frequencies [Hz] and amplitudes; and
    the `noise`, frequencies and amplitudes; `label` of the axis and its scale."""
    text, scale = label
    figure, axis = one_panel(3.4)
    axis.plot(noise[0], scale * noise[1], color=colour("muted"), linewidth=1.6, zorder=1)
    for _, role, frequency, amplitude in groups:
        axis.plot(
            frequency, scale * amplitude, color=colour(role), marker="o", markersize=3.5, linestyle="none", zorder=3
        )
    _logarithmic(axis, text)
    key(axis, [*((words, colour(role)) for words, role, *_ in groups), ("noise", colour("muted"))])
    axis.set_xlabel("Frequency (Hz)")
    return Drawing(name, figure, caption)


def pole_map(poles: Mapping[str, np.ndarray], name: str = "poles", *, caption: str = "") -> Drawing:
    """Poles of several transfer functions in the complex plane, upper half. `poles` (k,) [1/s]."""
    figure, axis = one_panel(3.9)
    origin(axis)
    points = [(p.real, p.imag, k + 1) for k, each in enumerate(poles.values()) for p in each if p.imag >= 0.0]
    x, y = (np.array([p[i] for p in points]) for i in (0, 1))
    axis.plot(x, y, color=colour("fitted"), marker="x", markersize=7, markeredgewidth=1.8, linestyle="none", zorder=3)
    for px, py, k in points:
        axis.annotate(
            f"{k}", (px, py), xytext=(4, 5), textcoords="offset points", fontsize=8.5, color=colour("muted"),
        )  # fmt: skip
    tidy(axis, first=True, text="Imaginary part (rad/s)")
    # One pole far to the left must not press the others into a corner.
    near = float(np.quantile(np.abs(x), 0.8)) if len(x) else 1.0
    if np.abs(x).max(initial=0.0) > 20.0 * max(near, 1e-9):
        axis.set_xscale("symlog", linthresh=max(near, 1e-9))
        axis.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    axis.set_ylim(bottom=-0.05 * max(float(y.max(initial=0.0)), 1e-9) - 1e-9)
    axis.set_xlabel("Real part (1/s)")
    numbered = "; ".join(f"{k + 1} {recording}" for k, recording in enumerate(poles))
    return Drawing(
        name,
        figure,
        caption
        or f"Poles of every transfer function, upper half of the plane: the further left, the faster a response dies "
        f"away; the higher, the faster it oscillates. {numbered}.",
    )


def fits(
    names: Sequence[str], fitted: np.ndarray, heldout: np.ndarray, name: str = "fits", *, caption: str = ""
) -> Drawing:
    """Fit of every recording, as fitted and held out. `fitted`, `heldout` (r,) [%]."""
    figure, axis = one_panel(1.0 + 0.3 * len(names))
    rows = np.arange(len(names))
    for values, role, shift in ((fitted, "fitted", -0.12), (heldout, "heldout", 0.12)):
        axis.plot(values, rows + shift, color=colour(role), marker="o", markersize=6, linestyle="none", zorder=3)
    for k, value in enumerate(fitted):
        if np.isfinite(value):
            axis.annotate(
                number(float(value), digits=3), (value, k - 0.12), xytext=(7, 0), textcoords="offset points",
                va="center", fontsize=8.5, color=colour("fitted"),
            )  # fmt: skip
    axis.set_ylim(len(names) - 0.5, -0.9)
    axis.set_yticks(rows, [n.replace("_", " ") for n in names])
    axis.tick_params(axis="y", labelcolor=colour("ink"), length=0)
    low = float(np.nanmin(np.concatenate([fitted, heldout, [0.0]])))
    axis.set_xlim(max(low, -20.0), 106.0)
    axis.set_xlabel("Fit (%)")
    key(axis, [("fitted", colour("fitted")), ("held out", colour("heldout"))])
    return Drawing(
        name,
        figure,
        caption
        or "Fit of the simulated output: 100 % is every sample met, 0 % no better than the mean. Held out means "
        "coefficients from other samples; the initial state is estimated either way.",
    )
