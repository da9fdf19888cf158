r"""Can these numbers belong to one joint? What mechanics asks of a forearm with a slider, and where a table fails it.

A forearm of fixed parts and a slider of mass m_5 at s has, whichever way it moves,

.. math::
   m x(s) = m_5 s + \text{const}, \qquad J(s) = J_0 + a_1 s + m_5 s^2 > 0, \qquad (m x)^2 + (m y)^2 \le m J

(parallel axes; Cauchy and Schwarz), one gravity for up, down and rest, and friction that never drives the motion.
Where gravity is let to differ with the direction, the difference is friction by another name: of the torques at
vanishing speed

.. math::
   f = \tfrac12 \left( G_+ - G_- + \tau_{C+} + \tau_{C-} \right)

opposes motion, and f < 0 would feed energy in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .elbow import PublishedElbow

DEFAULT_SLIDERS_M = tuple(np.linspace(0.0, 0.3, 31))
"""Positions of the slider at which Table II is checked by default; the paper does not give the rail's length."""

DEFAULT_ANGLES_RAD = tuple(np.radians(np.linspace(-60.0, 60.0, 25)))
"""Angles from the horizontal at which Table II is checked by default."""


@dataclass(frozen=True)
class Inconsistency:
    """One way in which a model cannot be."""

    erratum: str  # Its number in ``docs/errata.md``
    # What fails: "inertia", "slider_mass", "one_mass", "rest", "adherence", "gravity_jump", "friction_sign"
    subject: str
    value: float  # The figure that shows it, in `unit`
    unit: str
    what: str  # A sentence with the figures


def inconsistencies(
    elbow: PublishedElbow,
    sliders: np.ndarray | tuple = DEFAULT_SLIDERS_M,
    angles: np.ndarray | tuple = DEFAULT_ANGLES_RAD,
) -> tuple[Inconsistency, ...]:
    """Return all that contradicts mechanics in an elbow; sliders (n,) [m], angles (m,) [rad]."""
    sliders, angles = np.asarray(sliders, float), np.asarray(angles, float)
    found = []
    for direction in ("down", "up"):
        found += _inertia(elbow, direction, sliders)
        found += _slider_mass(elbow, direction)
    found += _one_mass(elbow)
    found += _rest(elbow, sliders)
    found += _adherence(elbow)
    found += _gravity_jump(elbow, sliders, angles)
    found += _friction_sign(elbow, sliders, angles)
    return tuple(found)


def positive_inertia_range(elbow: PublishedElbow, direction: str) -> tuple[float, float] | None:
    """Return the slider positions [m] between which a concave inertia is positive; None if nowhere or not concave."""
    a0, a1, a2 = elbow.direction(direction).inertia
    root = a1**2 - 4.0 * a0 * a2
    if a2 >= 0.0 or root <= 0.0:
        return None
    middle, half = -0.5 * a1 / a2, 0.5 * np.sqrt(root) / abs(a2)
    return float(middle - half), float(middle + half)


def implied_friction(
    elbow: PublishedElbow, sliders: np.ndarray, angles: np.ndarray, *, positive: str = "up"
) -> np.ndarray:
    """Return the friction at vanishing speed that two directional sets imply.

    sliders (n,) [m], angles (m,) [rad]; gives (n, m) [N*m].
    """
    s, q = np.asarray(sliders, float)[:, None], np.asarray(angles, float)[None, :]
    apart = elbow.gravity("up", s, q) - elbow.gravity("down", s, q)
    coulomb = elbow.direction("up").coulomb + elbow.direction("down").coulomb
    return 0.5 * ((apart if positive == "up" else -apart) + coulomb)


def _inertia(elbow: PublishedElbow, direction: str, sliders: np.ndarray):
    inertia = elbow.inertia(direction, sliders)
    bad = inertia <= 0.0
    if not np.any(bad):
        return
    least = int(np.argmin(inertia))
    where = positive_inertia_range(elbow, direction)
    only = "" if where is None else f"; it is positive only for slider positions in ({where[0]:.3f}, {where[1]:.4f}) m"
    yield Inconsistency(
        "A5",
        "inertia",
        float(inertia[least]),
        "kg*m^2",
        f"{direction}: inertia is not positive at {bad.sum()} of {len(sliders)} slider positions, down to "
        f"{inertia[least]:.4f} kg*m^2 at {sliders[least]:.2f} m{only}",
    )


def _slider_mass(elbow: PublishedElbow, direction: str):
    found = elbow.direction(direction)
    by_gravity, by_inertia = found.m_x_slope, found.inertia[2]
    if abs(by_inertia - by_gravity) > 0.05 * abs(by_gravity):
        yield Inconsistency(
            "A5",
            "slider_mass",
            by_inertia,
            "kg",
            f"{direction}: the slider's mass is {by_gravity:g} kg by gravity and {by_inertia:g} kg by inertia; "
            f"both are the same mass, and no mass is negative",
        )


def _one_mass(elbow: PublishedElbow):
    slopes = {name: s.m_x_slope for name, s in elbow.sets.items()}
    spread = max(slopes.values()) - min(slopes.values())
    if spread > 0.05 * max(abs(v) for v in slopes.values()):
        masses_text = ", ".join(f"{v:g} kg {n}" for n, v in slopes.items())
        yield Inconsistency("A5", "one_mass", spread, "kg", f"one slider has several masses by gravity: {masses_text}")


def _rest(elbow: PublishedElbow, sliders: np.ndarray):
    down, rest, up = (elbow.gravity(d, sliders, 0.0) for d in ("down", "static", "up"))
    outside = np.maximum(np.minimum(down, up) - rest, rest - np.maximum(down, up))
    worst = int(np.argmax(outside))
    if outside[worst] > 1e-9:
        yield Inconsistency(
            "A6",
            "rest",
            float(outside[worst]),
            "N*m",
            f"gravity at rest is not between that of both directions at {np.sum(outside > 1e-9)} of {len(sliders)} "
            f"slider positions with the forearm level; at {sliders[worst]:.2f} m it is {rest[worst]:.2f} N*m, "
            f"with {down[worst]:.2f} down and {up[worst]:.2f} up",
        )


def _adherence(elbow: PublishedElbow):
    adherence = elbow.direction("static").adherence
    if adherence is not None and adherence < 0.0:
        yield Inconsistency(
            "A6", "adherence", adherence, "N*m", f"adherence is {adherence:g} N*m; a bound on friction is not negative"
        )


def _gravity_jump(elbow: PublishedElbow, sliders: np.ndarray, angles: np.ndarray):
    s, q = sliders[:, None], angles[None, :]
    jump = np.abs(elbow.gravity("up", s, q) - elbow.gravity("down", s, q))
    if jump.max() > 1e-9:
        i, j = np.unravel_index(int(np.argmax(jump)), jump.shape)
        yield Inconsistency(
            "A7",
            "gravity_jump",
            float(jump.max()),
            "N*m",
            f"gravity jumps by up to {jump.max():.2f} N*m where the velocity changes sign (slider {sliders[i]:.2f} m, "
            f"angle {np.degrees(angles[j]):.0f} deg); gravity does not know which way the forearm moves",
        )


def _friction_sign(elbow: PublishedElbow, sliders: np.ndarray, angles: np.ndarray):
    friction = {p: implied_friction(elbow, sliders, angles, positive=p) for p in ("up", "down")}
    if all(f.min() < 0.0 for f in friction.values()):
        best = max(friction, key=lambda p: friction[p].min())
        f = friction[best]
        share = ", ".join(f"{100.0 * np.mean(v < 0.0):.0f} % if angles grow {p}" for p, v in friction.items())
        yield Inconsistency(
            "A7",
            "friction_sign",
            float(f.min()),
            "N*m",
            f"the friction both sets amount to is between {f.min():.2f} and {f.max():.2f} N*m (angles growing {best}): "
            f"it drives the motion over part of the range ({share})",
        )
