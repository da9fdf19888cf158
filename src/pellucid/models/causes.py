"""A cause of what a joint's model misses: one of the effects that wearable robots have."""

from __future__ import annotations

from dataclasses import dataclass

PARALLEL_SPRING, POSITION_FRICTION, MISALIGNED_AXIS, BACKLASH, SATURATION, DRIFT, WARM_UP, DELAY = CAUSE_NAMES = (
    "parallel_spring", "position_friction", "misaligned_axis", "backlash", "saturation", "drift", "warm_up", "delay",
)  # fmt: skip
"""Names of all causes."""


@dataclass(frozen=True)
class Cause:
    """A cause of the residual of a joint's model.

    Attributes
    ----------
    name : str
        One of "parallel_spring", "position_friction", "misaligned_axis", "backlash", "saturation", "drift", "warm_up"
        and "delay".
    size : float
        Its size: stiffness, change of friction over the travel, angle, gap, limit of the sensor, relative change of the
        effort over a recording, change of friction over a recording, or delay. NaN for a gap whose parts rattle: no
        column predicts that, so that its width is unknown.
    unit : str
        Unit of the size.
    share : float
        Share of the cross-validated residual variance that it explains in addition to load
        friction; NaN if no model can tell.
    half_width : float
        Half the confidence interval of the size; NaN where the size is a rough one.
    joint : str
        Name of the joint of a robot of several joints; empty otherwise.
    may_twist : bool
        Whether a transmission that twists would explain as much as this parallel spring.
    """

    name: str
    size: float
    unit: str
    share: float
    half_width: float = float("nan")
    joint: str = ""
    may_twist: bool = False


@dataclass(frozen=True)
class ParallelSpring:
    """Whether a spring acts in parallel to the drive, by cross-validation on the fitted recordings."""

    is_found: bool = False
    share: float = 0.0  # share of the residual's variance there that it explains
    may_twist: bool = False  # whether a transmission that twists would explain as much
