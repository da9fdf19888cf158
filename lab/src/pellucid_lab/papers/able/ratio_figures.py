"""Figures of this paper alone: ratios of errors with and without the directional model, and the energy of a cycle.

They look as those of `direction_figures` do. SI in; angles are drawn in degrees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pellucid.joint.slider.study.direction_figures import curves_panel, label_rows, write_names
from pellucid.study.drawing.drawing import Drawing, one_panel, tidy
from pellucid.study.drawing.style import colour
from pellucid.study.pages.quantities import number


def ratio_by_rig(
    names: Sequence[str], medians: np.ndarray, low: np.ndarray, high: np.ndarray, published: float
) -> Drawing:
    """Error without over error with the directional model, rig by rig, with its spread over seeds. `medians`, `low`,
    `high` (r,)."""
    medians, low, high = (np.asarray(v, float) for v in (medians, low, high))
    figure, axis = one_panel(1.1 + 0.36 * len(names))
    tone = colour("fitted")
    for row, (middle, least, most) in enumerate(zip(medians, low, high, strict=True)):
        axis.plot((least, most), (row, row), color=tone, linewidth=2.0, alpha=0.45, zorder=2)
        axis.plot([middle], [row], color=tone, marker="o", markersize=6.5, markeredgewidth=0.0, zorder=3)
        axis.annotate(
            number(middle, digits=3), (max(most, middle), row), xytext=(8, -0.5), textcoords="offset points",
            va="center", color=tone, fontsize=9,
        )  # fmt: skip
    label_rows(axis, names)
    axis.set_xlim(0.0, 1.12 * float(np.nanmax([*high, *medians, published])))
    entries = [("this work, median and spread over seeds", tone), _published(axis.axvline, published)]
    axis.axvline(1.0, color=colour("muted"), linewidth=0.8, zorder=1)
    axis.set_xlabel("Error without / error with")
    write_names(axis, entries)
    return Drawing(
        "ratio-by-rig",
        figure,
        "How many times smaller the error becomes with the directional model: the median over seeds, and the spread "
        f"as a line. At 1 nothing is gained. The dashed line is what was published, {published:g}.",
    )


def ratio_by_friction(x: np.ndarray, ratio: np.ndarray, published: float, xlabel: str) -> Drawing:
    """Error without over error with the directional model, against a parameter of friction. `x`, `ratio` (n,)."""
    x, ratio = np.asarray(x, float), np.asarray(ratio, float)
    figure, axis = one_panel(3.5)
    tone = colour("fitted")
    axis.plot(x, ratio, color=tone, linewidth=1.8, marker="o", markersize=4.6, markeredgewidth=0.0, zorder=3)
    entries = [("this work", tone), _published(axis.axhline, published)]
    axis.axhline(1.0, color=colour("muted"), linewidth=0.8, zorder=1)
    tidy(axis, first=True, text="Error without / error with")
    axis.set_ylim(0.0, 1.08 * float(np.nanmax([*ratio, published])))
    axis.set_xlabel(xlabel)
    write_names(axis, entries)
    return Drawing(
        "ratio-by-friction",
        figure,
        "How many times smaller the error becomes with the directional model, against a parameter of friction. At 1 "
        f"nothing is gained. The dashed line is what was published, {published:g}.",
    )


def cycle_energy(
    amplitude_deg: np.ndarray,
    energies: Mapping[str, np.ndarray],
    caption: str,
    *,
    roles: Mapping[str, str] | None = None,
) -> Drawing:
    """Net energy of one closed cycle against its amplitude. `amplitude_deg` (n,) [deg]; `energies` (n,) [J]."""
    figure, axis = curves_panel(amplitude_deg, energies, roles, 3.5, "Net energy per cycle (J)", "Amplitude (deg)")
    axis.axhline(0.0, color=colour("muted"), linewidth=0.8, zorder=1)
    return Drawing("cycle-energy", figure, caption)


def _published(draw_line, published: float) -> tuple[str, str]:
    """Draw the line of the published value; return its entry for the list of names."""
    tone = colour("measured")
    draw_line(published, color=tone, linewidth=1.4, dashes=(4, 2), zorder=1.5)
    return f"published, {published:g}", tone
