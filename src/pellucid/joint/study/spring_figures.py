"""The figure of a spring on the bench: its effort over its deflection."""

from __future__ import annotations

import numpy as np

from ...study.drawing.drawing import Drawing, key, one_panel, tidy
from ...study.drawing.style import colour
from .spring_result import SpringTrace

DRAWN_SAMPLE_COUNT = 2000
"""Largest number of drawn samples: the first of a recording, so that its loops stay whole."""


def spring_loop(trace: SpringTrace, unit: str, effort_label: str) -> Drawing:
    """Draw the effort of one recording over its deflection, measured and as the spring predicts it.

    `unit` is that of the deflection, "rad" or "m", which is drawn in degrees or millimetres.
    """
    scale, shown = (float(np.degrees(1.0)), "deg") if unit == "rad" else (1e3, "mm")
    figure, axis = one_panel(3.4)
    deflection, effort, predicted = (
        each[:DRAWN_SAMPLE_COUNT] for each in (scale * trace.deflection, trace.effort, trace.predicted)
    )
    axis.plot(deflection, effort, color=colour("measured"), linewidth=2.0)
    axis.plot(deflection, predicted, color=colour(trace.split), linewidth=1.2, linestyle="--")
    axis.set_xlabel(f"Deflection ({shown})")
    tidy(axis, first=True, text=effort_label)
    said = "held out" if trace.split == "heldout" else "fitted"
    key(axis, [("measured", colour("measured")), (f"predicted (dashed), {said}", colour(trace.split))], room=0.12)
    return Drawing(
        "spring-loop",
        figure,
        f"Effort over deflection of {trace.recording} ({said}): measured (grey), and dashed as the spring predicts it. "
        "Hysteresis and damping make the loop wide.",
    )
