"""The report of a study's transfer functions and its figures: fits, coefficients, responses, poles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from ....study.drawing.drawing import (
    Drawing,
    Head,
    draw,
    heads,
    key,
    line,
    measured_and_predicted,
    one_panel,
    origin,
    tidy,
)
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.forest import Row, Table
from ....study.pages.page import Page, Section, Tile
from ....study.pages.quantities import number, parameter_interval, relative_sd, typeset_sentence, unit_text
from ....study.procedures.study_page import figure_tables, provenance, study_page
from ....study.study import Study
from ...transfer.fit_transfer_function import Response
from .first_look import FirstLook
from .identify_transfer import TransferResult, ratio

CHANNEL_AXES: Mapping[str, tuple[str, float, str]] = {
    "rad": ("Angle", 180.0 / np.pi, "deg"),
    "m": ("Position", 1e3, "mm"),
    "N*m": ("Torque", 1.0, "N·m"),
    "N": ("Force", 1.0, "N"),
}
"""How a channel's unit is shown: in words, shown units per SI unit, and their name."""


def shown_channel(unit: str, channel: str) -> tuple[str, float]:
    """An axis's label and what an SI value is multiplied by, for a `channel` in a `unit`."""
    words, scale, text = CHANNEL_AXES.get(unit, (channel.replace("_", " ").capitalize(), 1.0, unit))
    return f"{words} ({text})", scale


def response(found: Response, labels: Sequence[tuple[str, float]]) -> Drawing:
    """Draw measured and simulated output, the simulation's error, and the input; `labels` are of input and output."""
    heldout, time = found.split == "heldout", found.time
    (input_label, input_scale), (output_label, output_scale) = labels
    figure = Figure(figsize=(FIGURE_WIDTH, 4.6), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(3.0, 1.3, 1.0))
    tone = colour("heldout" if heldout else "fitted")
    measured_and_predicted(top, time, output_scale * found.measured, output_scale * found.simulated, tone)
    line(middle, time, output_scale * found.residual, color=tone)
    middle.axhline(0.0, color=colour("muted"), linewidth=0.8, zorder=1)
    line(bottom, time, input_scale * found.input, color=colour("muted"))
    tidy(top, first=True, text=output_label)
    tidy(middle, first=True, text="Missed", ticks=4)
    tidy(bottom, first=True, text=input_label, ticks=3)
    top.margins(y=0.12)
    key(top, [("measured", colour("measured")), ("simulated", tone)])
    bottom.set_xlabel("Time (s)")
    return Drawing(
        f"response-{found.recording}".replace(".", "-"),
        figure,
        f"{found.recording.replace('_', ' ')}, {'held out' if heldout else 'fitted'}: measured "
        f"(black; white on a dark page) and simulated (dashed), "
        f"the simulation's error, and the input. Fit {number(found.fit, digits=3)} %.",
    )


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
    sure, angle = followed_phase(measured, radius)
    if fitted is not None:
        phase = np.unwrap(np.angle(fitted[1]))
        bottom.plot(fitted[0], np.degrees(phase), color=colour("fitted"), zorder=4)
        apart = np.median(angle - np.interp(frequency[sure], fitted[0], phase)) if sure.any() else 0.0
        angle = angle - 2.0 * np.pi * np.round(apart / (2.0 * np.pi))
    bottom.plot(frequency[sure], np.degrees(angle), color=tone, marker="o", markersize=3.5, linestyle="none", zorder=3)
    tidy(bottom, first=True, text="Phase (deg)", ticks=4)
    bottom.set_xlabel("Frequency (Hz)")
    return Drawing(name, figure, caption)


MAX_PHASE_HALF_WIDTH_RAD = np.pi / 6.0
"""A phase is drawn where the interval of the response leaves it at most so uncertain [rad]: noise adds turns to the
others, and to all that follow them."""


def followed_phase(measured: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the phase of a response is certain enough, and the phase there [rad], followed without jumps.

    `measured` (k,) complex; `radius` (k,) of the disks around it.
    """
    sure = radius < np.sin(MAX_PHASE_HALF_WIDTH_RAD) * np.abs(measured)
    return sure, np.unwrap(np.angle(measured[sure]))


def answer_figure(found: TransferResult) -> Drawing:
    """Draw the worst and the median response that answer: held out where there are any, else fitted."""
    judged = found.heldout or {name: fit.responses[0] for name, fit in found.single.items()}
    ranked = sorted(judged.items(), key=lambda each: each[1].fit)
    shown = {"worst": ranked[0]}
    if len(ranked) > 1:
        shown["median"] = ranked[len(ranked) // 2]
    label, scale = shown_channel(found.units[1], found.channels[1])
    figure = Figure(figsize=(FIGURE_WIDTH, 0.7 + 1.7 * len(shown)), layout="constrained")
    axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for axis, (rank, (name, each)) in zip(axes, shown.items(), strict=True):
        tone = colour("heldout" if found.heldout else "fitted")
        measured_and_predicted(axis, each.time, scale * each.measured, scale * each.simulated, tone)
        tidy(axis, first=True, text=label, ticks=4)
        rest = f"{rank} of {len(ranked)}: fit {number(each.fit, digits=3)} %" if len(ranked) > 1 else ""
        rest = rest or f"fit {number(each.fit, digits=3)} %"
        heads([axis], [Head(name.replace("_", " "), rest, tone)])
    key(axes[0], [("measured", colour("measured")), ("simulated (dashed)", tone)])
    axes[-1].set_xlabel("Time (s)")
    which = "Worst and median response" if len(ranked) > 1 else "The response"
    return Drawing(
        "answer",
        figure,
        f"{which} on {'held-out' if found.heldout else 'fitted'} data: measured, and simulated by the transfer "
        "function (dashed). A fit of 100 % meets every sample; 0 % is no better than the mean.",
    )


def _logarithmic(axis: Axes, text: str) -> None:
    """Both scales, with numbers as they are said."""
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_ylabel(text)
    axis.tick_params(which="both", length=3, width=0.7, pad=3)
    axis.margins(x=0.02)
    low, high = axis.get_ylim()
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=20))
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high < 30.0 * low else (1.0,), numticks=8))
    for each in (axis.xaxis, axis.yaxis):
        each.set_minor_locator(NullLocator())
        each.set_major_formatter(lambda x, _: f"{x:g}")


def output_lines(look: FirstLook, label: tuple[str, float]) -> Drawing:
    """Amplitudes of the output line by line, and their noise; `label` of the axis and its scale."""
    seen, left, (text, scale) = look.found, look.found.left_out, label
    groups = [("excited", "measured", seen.frequency, 2.0 * np.abs(seen.response) * np.sqrt(seen.input_power))]
    for words, role, side in (("odd left out", "heldout", ~seen.even), ("even left out", "load", seen.even)):
        above = side & (left.power > 0.0)
        groups.append((words, role, left.frequency[above], 2.0 * np.sqrt(left.power[above])))
    frequency = np.concatenate([seen.frequency, left.frequency])
    order = np.argsort(frequency)
    noise = 2.0 * np.sqrt(np.concatenate([seen.noise_variance, left.noise]))[order]
    figure, axis = one_panel(3.4)
    axis.plot(frequency[order], scale * noise, color=colour("muted"), linewidth=1.6, zorder=1)
    style = {"marker": "o", "markersize": 3.5, "linestyle": "none", "zorder": 3}
    for _, role, at, amplitude in groups:
        axis.plot(at, scale * amplitude, color=colour(role), **style)
    _logarithmic(axis, text)
    key(axis, [*((words, colour(role)) for words, role, *_ in groups), ("noise", colour("muted"))])
    axis.set_xlabel("Frequency (Hz)")
    return Drawing(
        f"lines-{look.name}".replace(".", "-"),
        figure,
        f"{look.name.replace('_', ' ')}: the output's sines. Where nothing is excited only noise and "
        "distortion remain. Even lines show distortion of even order, such as friction that differs by direction. Odd "
        "lines show that of odd order, such as Coulomb friction or sin q. The share of noise is subtracted.",
    )


def pole_map(poles: Mapping[str, np.ndarray]) -> Drawing:
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
        "poles",
        figure,
        "Poles of every transfer function, upper half of the plane: the further left, the faster a response dies "
        f"away; the higher, the faster it oscillates. {numbered}.",
    )


def fits(names: Sequence[str], fitted: np.ndarray, heldout: np.ndarray) -> Drawing:
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
        "fits",
        figure,
        "Fit of the simulated output: 100 % is every sample met, 0 % no better than the mean. Held out means "
        "coefficients from other samples; the initial state is estimated either way.",
    )


MAX_DRAWN_RESPONSES = 6
"""The page draws at most this many responses: best and worst fit, and those evenly ranked between them."""

MAX_DRAWN_FIRST_LOOKS = 3
"""The page draws frequency responses of at most this many recordings without periodic excitation."""

RESPONSE_POINTS = 400
"""A transfer function's frequency response is drawn with this many points."""

PHYSICAL_PARAMETER_WORDS = {"inertia": "Inertia, 1/b0", "damping": "Damping, a1/b0", "stiffness": "Stiffness, a0/b0"}
"""Description of each physical parameter with its formula in the coefficients."""

HOLD_WORDS = {
    "zero": "held from each sample to the next",
    "first": "taken to go straight from each sample to the next",
}
"""Sentences' ends for the two assumptions on the input between samples: zero-order and first-order hold."""


def page(study: Study, found: TransferResult) -> Page:
    """The report's page, figures drawn."""
    return study_page(
        title=f"{found.study}: transfer functions",
        answer=found.answer,
        verdicts=found.verdicts,
        tiles=_tiles(found),
        sections=(
            *_looks(found),
            _found(found),
            _responses(found),
            _poles(found),
            _coefficients(found),
            _provenance(study, found),
        ),
        figure=draw(answer_figure, found),
    )


def _tiles(found: TransferResult) -> tuple[Tile, ...]:
    inside = {n: f.responses[0].fit for n, f in found.single.items()}
    best = max(inside, key=inside.get)
    tiles = [
        Tile("Recordings fitted", f"{len(inside)}", "", f"{len(found.refused)} refused"),
        Tile("Best fit", number(inside[best], digits=3), "%", best.replace("_", " ")),
        Tile("Median fit", number(float(np.median(list(inside.values()))), digits=3), "%"),
    ]
    if found.heldout:
        outside = [r.fit for r in found.heldout.values()]
        tiles.append(Tile("Median fit, held out", number(float(np.median(outside)), digits=3), "%"))
    return tuple(tiles)


def _found(found: TransferResult) -> Section:
    single = found.single
    names = list(dict.fromkeys([*single, *found.heldout]))
    nan = float("nan")
    inside = np.array([single[n].responses[0].fit if n in single else nan for n in names])
    outside = np.array([found.heldout[n].fit if n in found.heldout else nan for n in names])
    each = next(iter(found.fits.values())).every
    heads = ("Recording", "Fit (%)", "Held out (%)", *(f"{p.name} ({unit_text(p.unit)})" for p in each))
    best = max(single, key=lambda n: single[n].responses[0].fit)
    rows = []
    for name, value, out in zip(names, inside, outside, strict=True):
        known = single[name].every if name in single else ()
        cells = [number(p.value, p.standard_error) for p in known] or ["–"] * len(each)
        rows.append(Row((name.replace("_", " "), _figure(value), _figure(out), *cells), name == best))
    tables = [Table(heads, tuple(rows), frozenset(range(1, len(heads))), "Every recording's transfer function.", True)]
    if found.refused:
        reasons = tuple(Row((name.replace("_", " "), typeset_sentence(why))) for name, why in found.refused.items())
        tables.append(Table(("Recording", "Why it was not fitted"), reasons, wide=True))
    return Section("found", "What was found", tables=tuple(tables), drawings=(draw(fits, names, inside, outside),))


def _figure(value: float) -> str:
    return number(float(value), digits=3) if np.isfinite(value) else "–"


def _evenly(items: list, count: int) -> list:
    """At most `count` of some items, evenly spaced from the first to the last."""
    at = np.unique(np.round(np.linspace(0, len(items) - 1, min(count, len(items)))).astype(int))
    return [items[k] for k in at]


def _looks(found: TransferResult) -> Iterator[Section]:
    if not found.looks:
        return
    periodic = [look for look in found.looks.values() if look.periodic]
    others = [look for look in found.looks.values() if not look.periodic]
    drawings = []
    for look in (*periodic, *_evenly(others, MAX_DRAWN_FIRST_LOOKS)):
        drawings.append(_response_seen(found, look))
        if look.periodic:
            drawings.append(draw(output_lines, look, shown_channel(found.units[1], found.channels[1])))
    text = (
        "A frequency response without a model, and the share of the output that no linear model explains. Only noise "
        "changes from period to period. Distortion changes from one realisation of random phases to the next, and "
        "lines without excitation show it directly."
        if periodic
        else "A frequency response without a model, smooth over a few neighbouring frequencies. The rest is noise and "
        "distortion together; only a periodic input separates them."
    )
    tables = tuple(figure_tables(found, "Before any model"))
    yield Section("before", "Before any model", (text,), tables, tuple(drawings))


def _response_seen(found: TransferResult, look: FirstLook) -> Drawing:
    seen, fit = look.found, found.seen_with(look)
    finely = np.geomspace(seen.frequency[0], seen.frequency[-1], RESPONSE_POINTS)
    fitted = None if fit is None else (finely, fit.transfer_function.frequency_response(finely))
    if look.periodic:
        levels = [
            ("noise", "muted", np.sqrt(seen.at_response(seen.noise_variance))),
            ("distortion", "heldout", np.sqrt(np.maximum(seen.at_response(seen.nonlinear_variance), 0.0))),
        ]
        words = "noise (pale) and distortion (orange) in one period of one realisation"
    else:
        levels = [("noise and distortion", "muted", np.sqrt(seen.missed_power / seen.input_power))]
        words = "noise and distortion together (pale)"
    level = f"{100.0 * found.confidence:.4g} %"
    over = ", and the transfer function fitted to it (blue)" if fit is not None else ""
    return draw(
        frequency_response, seen.frequency, seen.response, seen.radius(found.confidence), levels, fitted,
        unit_text(ratio(found.units)), f"before-{look.name}".replace(".", "-"),
        caption=f"{look.name.replace('_', ' ')}: response as measured, with its {level} interval{over}; {words}, as "
        "errors of the response. Phases that are uncertain by more than "
        f"{np.degrees(MAX_PHASE_HALF_WIDTH_RAD):.0f}° are not drawn.",
    )  # fmt: skip


def _responses(found: TransferResult) -> Section:
    labels = tuple(shown_channel(u, c) for u, c in zip(found.units, found.channels, strict=True))
    ranked = sorted((f.responses[0] for f in found.single.values()), key=lambda each: -each.fit)
    drawings = [draw(response, each, labels) for each in _evenly(ranked, MAX_DRAWN_RESPONSES)]
    drawings += [draw(response, each, labels) for n, each in found.heldout.items() if n not in found.single]
    hold = next(iter(found.fits.values())).hold
    return Section(
        "responses",
        "Measured and simulated",
        (
            f"Between samples the input is {HOLD_WORDS[hold]}; with that the simulation is exact at every sample, "
            "however they are spaced. Each record's initial state is estimated.",
        ),
        drawings=tuple(drawings),
    )


def _poles(found: TransferResult) -> Section:
    poles = {n: f.transfer_function.poles for n, f in found.fits.items()}
    rows = []
    for name, values in poles.items():
        for p in values[values.imag >= 0.0]:
            of_pair = (p.imag, abs(p) / (2.0 * np.pi), -p.real / abs(p)) if p.imag > 0.0 else (np.nan,) * 3
            rows.append(Row((name.replace("_", " "), *(_figure(x) for x in (p.real, *of_pair)))))
    heads = ("Recording", "Real part (1/s)", "Imaginary part (rad/s)", "Frequency (Hz)", "Damping ratio")
    return Section(
        "poles",
        "Poles",
        tables=(Table(heads, tuple(rows), frozenset({1, 2, 3, 4}), "One of each pair.", True),),
        drawings=(draw(pole_map, poles),),
    )


def _coefficients(found: TransferResult) -> Section:
    level = found.confidence
    heads = ("Parameter", "Value", "Unit", f"{100.0 * level:.4g} % interval", "Relative SD (%)")
    tables = []
    for name, fit in found.fits.items():
        rows = tuple(
            Row((
                PHYSICAL_PARAMETER_WORDS.get(p.name, p.name), number(p.value, p.standard_error),
                unit_text(p.unit) or "–", parameter_interval(p, level), relative_sd(p),
            ))
            for p in fit.every
        )  # fmt: skip
        tables.append(Table(heads, rows, frozenset({1, 3, 4}), f"{name.replace('_', ' ')}.", True))
    return Section(
        "coefficients",
        "Coefficients and their intervals",
        (
            "The transfer function is (b_m s^m + ... + b_0) / (s^n + a_{n-1} s^{n-1} + ... + a_0). Its intervals "
            "account for coloured residuals and for the estimated initial state. Those of inertia, damping and "
            "stiffness follow to first order.",
        ),
        tuple(tables),
    )


def _provenance(study: Study, found: TransferResult) -> Section:
    entries = [
        ("Input", f"{found.channels[0]}, {unit_text(found.units[0])}"),
        ("Output", f"{found.channels[1]}, {unit_text(found.units[1])}"),
    ]
    sums = tuple(Row(pair) for pair in found.checksums.items())
    return provenance(study, entries, Table(("Recording", "SHA-256 of its file"), sums, wide=True))
