"""The reproduction's page: the thesis's tables and figures on the virtual orthosis, each printed number beside ours."""

from __future__ import annotations

from pathlib import Path

from ...pages.page import Page, Tile, write_page
from ...pages.quantities import number
from ..reproduction import Reproduced
from ..row_sections import row_sections
from .reproduce_knee import KneeReproduction
from .residual_rows import residual_section
from .sections import thesis_sections


def write_knee_page(out: Path, made: KneeReproduction) -> Path:
    """Write index.html and every figure as SVG and PDF."""
    rows = {row.id: row for row in made.rows}
    fit, form, best = (
        rows[f"knee.{name}"]
        for name in ("coupled.fit", "coupled.fit.published_form", "coupled.fit.published_form.true_torque.fitted")
    )
    seeds = len({d.seed for d in made.drawn})
    page = Page(
        title="A knee orthosis and its wearer: reproduced",
        kicker="Reproduction of a thesis",
        headline=(
            f"The strap between orthosis and leg, found from one body's balance, explains {fit.ours:.1f} % of the "
            f"angle between them in swings it was not fitted to. The thesis's equation, from which the strap cancels, "
            f"explains {form.ours:.0f} %, and {best.ours:.0f} % of its own data when it is given the muscles' true "
            f"torque; printed are {form.published:g} %. All on a virtual orthosis of the thesis's kind, whose three "
            f"wearers have its subjects' weights and heights."
        ),
        tiles=(
            _tile(rows, "mgl_e.error", "Orthosis's gravity, error", "%"),
            _tile(rows, "mgl_sh.error", "Shanks' gravity, error", "%"),
            _tile(rows, "tf.fit", "Response at another amplitude", "%", "tf.fit.published_form.heldout", "two poles"),
            Tile("Mismatch, held out", f"{fit.ours:.1f}", "%", f"the thesis, in sample: {fit.published:g}"),
            *_torque_tiles(rows),
        ),
        sections=(
            *thesis_sections(made, rows),
            *((residual_section(made.compared),) if made.compared else ()),
            *row_sections(made.rows, over="Range or interval", remarks=False),
        ),
        footer=f"{seeds} seeds of all noise; the rig was fixed before anything was identified on it. Errata B1 to B13.",
    )
    return write_page(out, page)


def _tile(rows: dict[str, Reproduced], name: str, what: str, unit: str, beside: str = "", words: str = "") -> Tile:
    row = rows[f"knee.{name}"]
    if beside:
        more = f"{words}: {rows[f'knee.{beside}'].ours:.1f}"
    else:
        more = "" if row.published is None else f"the thesis: {row.published:.3g}"
    return Tile(what, number(row.ours, digits=3), unit, more)


def _torque_tiles(rows: dict[str, Reproduced]) -> tuple[Tile, ...]:
    if "knee.emg.rmse.boost" not in rows:
        return ()
    return (_tile(rows, "emg.rmse.boost", "Torque from EMG, boosting", "N·m"),)
