"""The figure of a joint that is only held: the effort of each posture, and the weight that explains them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...numerics.gravity_holds import GravityFit, Hold
from ...study.drawing.drawing import Drawing, dots, key, line, one_panel, tidy
from ...study.drawing.style import colour
from ...study.pages.quantities import EFFORT_NAMES, number, unit_text

CURVE_MARGIN_RAD = np.radians(10.0)
"""Angle by which the curve of the weight reaches beyond the postures [rad]."""

POSTURE_DOT_POINTS = 6.0
"""Diameter of the dot of a posture, in points."""


def posture_figure(fit: GravityFit, judged: Sequence[Hold], unit: str) -> Drawing:
    """Draw effort against angle: fitted postures, `judged` ones, and the weight; effort in `unit`."""
    figure, axis = one_panel(3.4)
    angles = np.array([hold.angle for hold in (*fit.holds, *judged)])
    span = np.linspace(angles.min() - CURVE_MARGIN_RAD, angles.max() + CURVE_MARGIN_RAD, 121)
    line(axis, np.degrees(span), fit.torque(span), color=colour("fitted"), linewidth=1.8)
    drawn = [("fitted postures", fit.holds, "measured"), ("held-out postures", judged, "heldout")]
    for _, holds, role in (each for each in drawn if each[1]):
        angle, effort = ([getattr(hold, name) for hold in holds] for name in ("angle", "torque"))
        dots(axis, np.degrees(angle), np.array(effort), colour(role), alpha=0.9, size=POSTURE_DOT_POINTS)
    tidy(axis, first=True, text=f"{EFFORT_NAMES.get(unit, 'Effort')} ({unit_text(unit)})")
    axis.set_xlabel("Angle (deg)")
    names = [("weight", colour("fitted")), *((words, colour(role)) for words, holds, role in drawn if holds)]
    key(axis, names, room=0.14)
    off = float(np.abs(fit.residual).max())
    return Drawing(
        "postures",
        figure,
        "Effort that holds the joint in each posture, and the weight that was found from the fitted ones, which leaves "
        f"{number(off, off)} {unit_text(unit)} at most.",
    )
