"""The report of a study's transfer functions: fits, coefficients, measured and simulated responses, poles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....study.drawing.drawing import Drawing, draw
from ....study.pages.page import Page, Section, Tile
from ....study.pages.quantities import number, parameter_interval, relative_sd, typeset_sentence, unit_text
from ....study.pages.tables import Row, Table
from ....study.procedures.study_page import figure_tables, paper_step, provenance, study_page
from ....study.study import Study
from ...transfer.transfer_function_fit import Response, TransferFit
from . import transfer_figures as figures
from .first_look import FirstLook
from .identify_transfer import TransferResult, ratio

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
        headline=found.headline,
        verdicts=found.verdicts,
        following=(paper_step(study),),
        tiles=_tiles(found),
        sections=(
            *_looks(found),
            _found(found),
            _responses(found),
            _poles(found),
            _coefficients(found),
            _provenance(study, found),
        ),
    )


def _single(found: TransferResult) -> dict[str, TransferFit]:
    """Fits of one recording alone, by its name."""
    return {name: fit for name, fit in found.fits.items() if len(fit.responses) == 1}


def _tiles(found: TransferResult) -> tuple[Tile, ...]:
    inside = {n: f.responses[0].fit for n, f in _single(found).items()}
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
    single = _single(found)
    names = list(dict.fromkeys([*single, *found.heldout]))
    nan = float("nan")
    inside = np.array([single[n].responses[0].fit if n in single else nan for n in names])
    outside = np.array([found.heldout[n].fit if n in found.heldout else nan for n in names])
    shown = next(iter(found.fits.values()))
    each = (*shown.parameters, *shown.physical)
    heads = ("Recording", "Fit (%)", "Held out (%)", *(f"{p.name} ({unit_text(p.unit)})" for p in each))
    best = max(single, key=lambda n: single[n].responses[0].fit)
    rows = []
    for name, value, out in zip(names, inside, outside, strict=True):
        parameters = (*single[name].parameters, *single[name].physical) if name in single else ()
        cells = [number(p.value, p.standard_error) for p in parameters] or ["–"] * len(each)
        rows.append(Row((name.replace("_", " "), _percent(value), _percent(out), *cells), name == best))
    tables = [Table(heads, tuple(rows), frozenset(range(1, len(heads))), "Every recording's transfer function.", True)]
    if found.refused:
        reasons = tuple(Row((name.replace("_", " "), typeset_sentence(why))) for name, why in found.refused.items())
        tables.append(Table(("Recording", "Why it was refused"), reasons, wide=True))
    return Section(
        "found",
        "What was found",
        (),
        tuple(tables),
        (draw(figures.fits, names, inside, outside),),
    )


def _percent(value: float) -> str:
    return number(float(value), digits=3) if np.isfinite(value) else "–"


def _looks(found: TransferResult) -> Iterator[Section]:
    if not found.looks:
        return
    periodic = [look for look in found.looks.values() if look.periodic]
    others = [look for look in found.looks.values() if not look.periodic]
    # Evenly among those that no period tells apart.
    chosen = np.unique(np.round(np.linspace(0, len(others) - 1, min(MAX_DRAWN_FIRST_LOOKS, len(others)))).astype(int))
    drawings = []
    for look in (*periodic, *(others[k] for k in chosen)):
        drawings.append(_response_seen(found, look))
        if look.periodic:
            drawings.append(_lines_seen(found, look))
    text = (
        "A frequency response without a model, and how much of the output no linear model explains. Over periods only "
        "noise changes; over realisations of random phases what is not linear changes too, and lines that were left "
        "out show it directly."
        if periodic
        else "A frequency response without a model, smooth over a few neighbouring frequencies. What it leaves is "
        "noise and distortion together: without periods nothing tells them apart."
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
        figures.frequency_response, seen.frequency, seen.response, seen.radius(found.confidence), levels, fitted,
        unit_text(ratio(found.units)), f"before-{look.name}".replace(".", "-"),
        caption=f"{look.name.replace('_', ' ')}: response as measured, with its {level} interval{over}; {words}, as "
        "errors of the response.",
    )  # fmt: skip


def _lines_seen(found: TransferResult, look: FirstLook) -> Drawing:
    seen, left = look.found, look.found.left_out
    groups = [("excited", "measured", seen.frequency, 2.0 * np.abs(seen.response) * np.sqrt(seen.input_power))]
    for words, role, side in (("odd left out", "heldout", ~seen.even), ("even left out", "load", seen.even)):
        above = side & (left.power > 0.0)
        groups.append((words, role, left.frequency[above], 2.0 * np.sqrt(left.power[above])))
    frequency = np.concatenate([seen.frequency, left.frequency])
    order = np.argsort(frequency)
    noise = 2.0 * np.sqrt(np.concatenate([seen.noise_variance, left.noise]))[order]
    return draw(
        figures.output_lines, groups, (frequency[order], noise), figures.shown(found.units[1], found.channels[1]),
        f"lines-{look.name}".replace(".", "-"),
        caption=f"{look.name.replace('_', ' ')}: the output's sines. Where nothing is excited only noise and "
        "distortion are left: at even lines that of even powers, such as friction that differs by direction, at odd "
        "ones that of odd powers, such as Coulomb friction or sin q. What noise makes there is taken off.",
    )  # fmt: skip


def _responses(found: TransferResult) -> Section:
    labels = tuple(figures.shown(u, c) for u, c in zip(found.units, found.channels, strict=True))
    single = _single(found)
    ranked = sorted(single, key=lambda n: -single[n].responses[0].fit)
    chosen = np.unique(np.round(np.linspace(0, len(ranked) - 1, min(MAX_DRAWN_RESPONSES, len(ranked)))).astype(int))
    drawings = [_response(single[ranked[k]].responses[0], labels) for k in chosen]
    drawings += [_response(r, labels) for n, r in found.heldout.items() if n not in single]
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


def _response(response: Response, labels: tuple[tuple[str, float], ...]) -> Drawing:
    heldout = response.split == "heldout"
    words = "held out" if heldout else "fitted"
    return draw(
        figures.response, response.time, response.measured, response.simulated, response.input, labels,
        f"response-{response.recording}".replace(".", "-"), heldout=heldout,
        caption=f"{response.recording.replace('_', ' ')}, {words}: measured (grey) and simulated, what the simulation "
        f"misses, and the input. Fit {number(response.fit, digits=3)} %.",
    )  # fmt: skip


def _poles(found: TransferResult) -> Section:
    poles = {n: f.transfer_function.poles for n, f in found.fits.items()}
    rows = []
    for name, values in poles.items():
        for p in values[values.imag >= 0.0]:
            pair = p.imag > 0.0
            rows.append(
                Row(
                    (
                        name.replace("_", " "),
                        number(float(p.real), digits=3),
                        number(float(p.imag), digits=3) if pair else "–",
                        number(float(abs(p)) / (2.0 * np.pi), digits=3) if pair else "–",
                        number(float(-p.real / abs(p)), digits=3) if pair else "–",
                    )
                )
            )
    heads = ("Recording", "Real part (1/s)", "Imaginary part (rad/s)", "Frequency (Hz)", "Damping ratio")
    return Section(
        "poles",
        "Poles",
        tables=(Table(heads, tuple(rows), frozenset({1, 2, 3, 4}), "One of each pair.", True),),
        drawings=(draw(figures.pole_map, poles),),
    )


def _coefficients(found: TransferResult) -> Section:
    level = found.confidence
    heads = ("Parameter", "Value", "Unit", f"{100.0 * level:.4g} % interval", "Relative SD (%)")
    tables = []
    for name, fit in found.fits.items():
        rows = tuple(
            Row(
                (
                    PHYSICAL_PARAMETER_WORDS.get(p.name, p.name),
                    number(p.value, p.standard_error),
                    unit_text(p.unit) or "–",
                    parameter_interval(p, level),
                    relative_sd(p),
                )
            )
            for p in (*fit.parameters, *fit.physical)
        )
        tables.append(Table(heads, rows, frozenset({1, 3, 4}), f"{name.replace('_', ' ')}.", True))
    return Section(
        "coefficients",
        "Coefficients and their intervals",
        (
            "Of (b_m s^m + ... + b_0) / (s^n + a_{n-1} s^{n-1} + ... + a_0). Intervals allow for coloured residuals, "
            "and for the initial state being estimated; those of inertia, damping and stiffness follow to first order.",
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
