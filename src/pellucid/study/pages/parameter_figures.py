"""Figure of a fit's parameters with their confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ...models.parameter import Parameter
from ..drawing.drawing import Drawing, draw, one_panel
from ..drawing.style import colour

MAX_RELATIVE_INTERVAL = 2.0
"""Intervals are drawn up to this multiple of the value; wider ones end in an arrow."""


class FitWithIntervals(Protocol):
    """Members of a fit that its figure shows."""

    @property
    def every(self) -> Sequence[Parameter]:
        """Every parameter, also those that are not free."""

    @property
    def confidence(self) -> float:
        """Confidence level of the intervals."""

    def interval(self, name: str) -> tuple[float, float]:
        """Return the confidence interval of a parameter."""


def parameters(fit: FitWithIntervals) -> Drawing:
    """Draw each parameter's confidence interval divided by its value, with value and unit beside it."""
    return draw(_forest, fit)


def _forest(fit: FitWithIntervals) -> Drawing:
    shown = [p for p in fit.every if np.isfinite(p.value)]
    figure, axis = one_panel(0.9 + 0.32 * max(len(shown), 1))
    for row, parameter in enumerate(reversed(shown)):
        size = abs(parameter.value) or 1.0
        low, high = (np.clip((end - parameter.value) / size, -MAX_RELATIVE_INTERVAL, MAX_RELATIVE_INTERVAL)
                     for end in fit.interval(parameter.name))  # fmt: skip
        told = parameter.trusted and parameter.identifiable
        tone = colour("fitted" if told else "muted")
        if np.isfinite(low) and np.isfinite(high) and parameter.trusted:
            axis.plot([100.0 * low, 100.0 * high], [row, row], color=tone, linewidth=2.2)
        axis.plot([0.0], [row], "o", color=tone, markersize=5, markerfacecolor=tone if told else "none")
    axis.axvline(0.0, color=colour("rule"), linewidth=0.8, zorder=0)
    axis.set_yticks(range(len(shown)), [f"{p.name}  {p.value:.4g} {p.unit}" for p in reversed(shown)])
    axis.set_ylim(-0.6, len(shown) - 0.4)
    axis.set_xlabel(f"{100.0 * fit.confidence:g} % interval, relative to the value (%)")
    return Drawing(
        "parameters",
        figure,
        f"Parameters with their {100.0 * fit.confidence:g} % confidence intervals, each divided by its value. Open "
        "marks are parameters that are not identifiable, or whose interval is refused.",
    )
