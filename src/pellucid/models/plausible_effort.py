"""Whether the efforts of an identified joint are of the size of a worn robot's: a wrong unit is off by a thousand."""

from __future__ import annotations

from .joint import GRAVITY

MAX_LEAST_MASS_KG = 150.0
"""Largest mass of a worn robot's segment that weight and inertia may require [kg]."""

MIN_WORN_EFFORT_NM = 0.1
"""Smallest largest torque of a worn robot [N*m]: a finger needs more."""

UNIT_ADVICE = "Check the unit of the effort in [channels], such as N*mm instead of N*m"
"""What to do about an implausible effort."""


def least_mass(gravity: float, inertia: float) -> float:
    """Return the least mass [kg] of a body with a weight's torque [N*m] and an inertia [kg*m^2] about an axis.

    No body of mass m has a static moment larger than the root of m and its inertia.
    """
    return gravity**2 / (GRAVITY**2 * inertia)


def doubt_torques(gravity: float, inertia: float, limit: float | None = None) -> str:
    """Return in a sentence that torques are not of a worn robot's size, without a full stop; "" if they are.

    `limit` is the effort limit of a controller [N*m].
    """
    if inertia > 0.0 and least_mass(gravity, inertia) > MAX_LEAST_MASS_KG:
        return (
            f"Weight of {gravity:.3g} N·m and inertia of {inertia:.3g} kg·m² require a mass of at least "
            f"{least_mass(gravity, inertia):.3g} kg"
        )
    if limit is not None and 0.0 < limit < MIN_WORN_EFFORT_NM:
        return f"An effort limit of {limit:.3g} N·m moves no limb"
    return ""
