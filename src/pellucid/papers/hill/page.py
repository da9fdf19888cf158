"""The reproduction's page: the paper's tables and figures on the virtual shank exoskeleton, beside print."""

from __future__ import annotations

from pathlib import Path

from ...pages.page import Page, Tile, write_page
from ...pages.quantities import number
from ..row_sections import row_sections
from .reproduce_hill import HillReproduction
from .sections import step_sections


def write_hill_page(out: Path, made: HillReproduction) -> Path:
    """Write index.html and every figure as SVG and PDF."""
    rows = {row.id: row for row in made.rows}

    def ours(name: str) -> float:
        return rows[f"hill.{name}"].ours

    page = Page(
        title="From a robot to muscles in three steps: reproduced",
        kicker="Reproduction of a paper",
        headline=(
            f"On a virtual exoskeleton of the paper's kind, muscles calibrated on one swing tell the knee's true "
            f"torque in another one to within {ours('rmse.truth.mean'):.2f} N·m. With the electrodes' muscles alone it "
            f"is {ours('rmse.truth.recorded'):.2f} N·m, since nobody records what bends the knee. The paper's own "
            f"reference, its eq. 12, is {ours('rmse.reference.eq12'):.2f} N·m from the truth. Its swing leaves the "
            f"leg's inertia unsure to ± {ours('p.half_width.two_sines'):.0f} %; a richer one to "
            f"± {ours('p.half_width.rich'):.1f} %."
        ),
        tiles=(
            Tile("Torque, held out", f"{ours('rmse.truth.mean'):.2f}", "N·m", "RMSE against the truth"),
            Tile("Judged as in the paper", f"{ours('rmse.eq12.mean.truncated'):.2f}", "N·m", "it prints 1.83"),
            Tile("p' − p, worst", _worst(made, "p.error.rich."), "%", "with the richer swing"),
            Tile("q' − q, worst", _worst(made, "q.error.rich."), "%", "with the richer swing"),
            Tile("Adam's wandering", f"{ours('adam.spread_ratio'):.0f}", "times", "fixed rate over falling"),
        ),
        sections=(
            *step_sections(made),
            *row_sections(made.rows, over="Over subjects", remarks=True),
        ),
        footer="The rig was fixed before anything was identified on it. Errata C1 to C15.",
    )
    return write_page(out, page)


def _worst(made: HillReproduction, start: str) -> str:
    values = [r.ours for r in made.rows if r.id.startswith(f"hill.{start}")]
    return number(max(values, key=abs), digits=2)
