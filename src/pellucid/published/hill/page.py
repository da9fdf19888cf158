"""The reproduction's page: the paper's tables and figures on the virtual shank exoskeleton, beside print."""

from __future__ import annotations

from pathlib import Path

from ...report.page import Page, Section, Tile, write_page
from ...report.quantities import MINUS, number, unit_text
from ...report.tables import Row, Table
from ..reproduction import Reproduced
from . import sections
from .reproduce_hill import HillReproduction


def write_hill_page(out: Path, made: HillReproduction) -> Path:
    """Write index.html and every figure as SVG and PDF.

    Parameters
    ----------
    out : Path
    made : HillReproduction

    Returns
    -------
    Path
        The page.
    """
    rows = {row.id: row for row in made.rows}

    def ours(name: str) -> float:
        return rows[f"hill.{name}"].ours

    page = Page(
        title="From a robot to muscles in three steps: reproduced",
        kicker="Reproduction of a paper",
        headline=(
            f"On a virtual exoskeleton of the paper's kind, muscles calibrated on one swing give the knee's true "
            f"torque in another one to {ours('rmse.truth.mean'):.2f} N·m. With the electrodes' muscles alone it is "
            f"{ours('rmse.truth.recorded'):.2f} N·m, since nobody records what bends the knee. The paper's own "
            f"reference, its eq. 12, is {ours('rmse.reference.eq12'):.2f} N·m from the truth. Its swing leaves the "
            f"leg's inertia unsure by {ours('p.half_width.two_sines'):.0f} %; a richer one by "
            f"{ours('p.half_width.rich'):.1f} %."
        ),
        tiles=(
            Tile("Torque, held out", f"{ours('rmse.truth.mean'):.2f}", "N·m", "RMSE against the truth"),
            Tile("Cut off at 0", f"{ours('rmse.truth.mean.truncated'):.2f}", "N·m", "as the paper judges"),
            Tile("Against eq. 12", f"{ours('rmse.eq12.mean.truncated'):.2f}", "N·m", "as the paper; printed: 1.83"),
            Tile("p' − p, worst", _worst(made, "p.error.rich."), "%", "with the richer swing"),
            Tile("q' − q, worst", _worst(made, "q.error.rich."), "%", "with the richer swing"),
            Tile("Adam's wandering", f"{ours('adam.spread_ratio'):.0f}", "times", "fixed rate over falling"),
        ),
        sections=(
            sections.people(made),
            sections.swings(made),
            sections.legs(made),
            sections.training(made),
            sections.torque(made),
            sections.methods(made),
            _print_errors(made),
            _all_rows(made),
        ),
        footer="The rig was fixed before anything was identified on it. Errata C1 to C15.",
    )
    return write_page(out, page)


def _worst(made: HillReproduction, start: str) -> str:
    values = [r.ours for r in made.rows if r.id.startswith(f"hill.{start}")]
    return number(max(values, key=abs), digits=2)


def _cell(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}".replace("-", MINUS)


def _print_errors(made: HillReproduction) -> Section:
    rows = [r for r in made.rows if ".recomputed." in r.id]
    table = Table(
        ("What", "Printed", "Recomputed", "Unit", "Verdict", "Why"),
        tuple(
            Row(
                (r.quantity, _cell(r.published), _cell(r.ours), unit_text(r.unit) or "–", r.verdict, r.note),
                r.verdict == "cannot be",
            )
            for r in rows
        ),
        frozenset({1, 2}),
        wide=True,
    )
    return Section("print", "What can be recomputed from print", (), (table,))


def _all_rows(made: HillReproduction) -> Section:
    def line(r: Reproduced) -> Row:
        between = "" if r.lower is None else f"{_cell(r.lower)} to {_cell(r.upper)}"
        return Row((r.id, _cell(r.published), _cell(r.ours), between, unit_text(r.unit) or "–", r.note))

    rows = tuple(line(r) for r in made.rows if ".recomputed." not in r.id)
    heads = ("Figure", "Published", "Ours", "Over subjects", "Unit", "Remark")
    return Section("rows", "Every figure", (), (Table(heads, rows, frozenset({1, 2}), wide=True),))
