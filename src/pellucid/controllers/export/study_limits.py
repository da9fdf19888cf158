"""Combine the limits that a study states for its joint with default ones."""

from __future__ import annotations

from ...study.study import Study
from ..limits import Limits


def limits_of(study: Study, otherwise: Limits) -> tuple[Limits, tuple[str, ...]]:
    """Return the limits of the safety gate, `otherwise` those that the study does not state, and notes about them."""
    given = study.rig.limits
    stops = zip((given.position_min, given.position_max), otherwise.position, strict=True)
    limits = Limits(
        effort=otherwise.effort if given.effort is None else min(given.effort, otherwise.effort),
        rate=otherwise.rate,
        velocity=otherwise.velocity if given.velocity is None else given.velocity,
        position=tuple(float(plain if stop is None else stop) for stop, plain in stops),
        stop_margin=otherwise.stop_margin,
        emg_torque=otherwise.emg_torque,
    )
    if given.position_min is not None and given.position_max is not None:
        return limits, ()
    low, high = limits.position
    return limits, (f"The study names no stops: {low:g} to {high:g} rad is a guess; set yours before switching on.",)
