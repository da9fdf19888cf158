"""Draw the ranking: torque of every controller on every pair, relative to the unpowered robot's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellucid.study.drawing.drawing import Drawing, one_panel
from pellucid.study.drawing.style import colour


@dataclass(frozen=True)
class Line:
    """One controller in the figure."""

    name: str
    shares: np.ndarray  # torque over that of the unpowered robot, for each pair, shape (k,) [1]
    rival: bool  # whether it is one of the simplest rivals


def ranked_torque(lines: Sequence[Line], name: str, *, caption: str) -> Drawing:
    """Draw a dot for each pair and a bar for the median of every controller, from the first rank to the last."""
    figure, axis = one_panel(0.27 * len(lines) + 0.9)
    for place, one in enumerate(lines):
        tone = colour("measured" if one.rival else "fitted")
        axis.plot(
            one.shares, np.full(len(one.shares), place), color=tone, marker="o", markersize=4.5, markeredgewidth=0.0,
            linestyle="none", alpha=0.55, zorder=3,
        )  # fmt: skip
        axis.plot(
            [np.median(one.shares) if len(one.shares) else np.nan] * 2,
            [place - 0.3, place + 0.3],
            color=tone,
            linewidth=2.4,
            zorder=4,
        )
    axis.set_xscale("log")
    axis.axvline(1.0, color=colour("faint"), linewidth=1.0, zorder=1)
    least = min(float(one.shares.min()) for one in lines if len(one.shares))
    ticks = [t for t in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0) if t >= 0.7 * least]
    axis.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axis.set_xticks([], minor=True)
    axis.set_yticks(range(len(lines)), [one.name for one in lines])
    axis.tick_params(length=3, width=0.7, pad=3)
    axis.set_ylim(len(lines) - 0.4, -0.6)
    axis.set_xlabel("Torque between robot and person, RMS, over that without power")
    return Drawing(name, figure, caption)
