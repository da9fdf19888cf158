"""Figures of controllers that are compared on a worn orthosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...pages.drawing import Drawing, key, one_panel, tidy
from ...pages.style import colour


@dataclass(frozen=True)
class ControllerRatios:
    """One line of `torque_ratios`."""

    name: str  # The controller
    # (k,) By group of wearers: each wearer's strap torque as a share of zero-impedance mode's [1]
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
