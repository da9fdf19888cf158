"""Every controller by name, which makes an identified model into a control law that runs.

Largest share of inertia that a control law with encoders alone may compensate on a robot of several joints.

The share is fed forward from an acceleration that encoders give, late. A robot that seems lighter is pulled by its
cuffs more quickly, and the loop rings. About drawn postures the loop is linear (`tree_stability`). It must stay stable
when the share is multiplied by `MIN_INERTIA_MARGIN`, on any limb of the robot's size in cuffs of the usual stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from .._errors import PellucidError
from ..models.card import Card
from ..models.fields import largest_friction, model_fields
from ..models.slider_joint import SliderCard
from ..models.tree_card import TreeCard
from ..numerics.arguments import with_checked_arguments
from .control_law import ControlLaw, Limits
from .elbow_controllers import ELBOW_CONTROLLERS
from .joint_compensation import compensation, place_on_rail
from .stability import LinearSystem, radius
from .tree_stability import (
    DRAWN_LIMBS,
    LinearShares,
    TreeCoupling,
    closed_tree,
    gravity_slope,
    linear_law,
    sampled_each,
    with_limb,
    worn_tree,
)


@dataclass(frozen=True)
class NamedController:
    """What a name stands for: a title, and what makes the law of what was found, `limits`, `period` and settings."""

    title: str
    build: Callable[..., ControlLaw]


def _of_elbow(name: str, found: object, *, slider: float | None = None, **settings: Any) -> ControlLaw:
    """A law of a worn elbow robot, from its card and the place of its carriage [m]."""
    card = _card(found)
    if not isinstance(card, SliderCard):
        raise PellucidError(f'controller "{name}": found the card of a joint, expected one of a joint with a carriage')
    return ELBOW_CONTROLLERS[name].build(card, place_on_rail(card, slider), **settings)


def _compensation(found: object, **settings: Any) -> ControlLaw:
    return compensation(_card(found), **settings)


CONTROLLER_BUILDERS: Mapping[str, NamedController] = {
    "compensation": NamedController("compensation of a joint's gravity and friction", _compensation),
    **{name: NamedController(one.title, partial(_of_elbow, name)) for name, one in ELBOW_CONTROLLERS.items()},
}
"""By name."""


def controllers() -> tuple[str, ...]:
    """Names of the controllers that `controller` makes.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> import pellucid as pl
    >>> "compensation" in pl.controllers()
    True
    """
    return tuple(CONTROLLER_BUILDERS)


@with_checked_arguments
def controller(
    found: object,
    name: str = "compensation",
    *,
    period: float = 1e-3,
    limits: Limits | None = None,
    **settings: object,
) -> ControlLaw:
    """Return a controller of an identified model: the control law of simulations and of `export`, stepped in Python.

    Parameters
    ----------
    found : card, anything with a ``card()``, or what `identify` found of a joint
        Of a joint for "compensation"; of a joint with a carriage, by the method that the controller needs, for a worn
        elbow's.
    name : str
        Of `controllers`.
    period : float
        Between two steps [s].
    limits : Limits or None
        Limits of the command; None: the defaults of the controller.
    **settings
        As the controller takes them: `slider`, where a carriage is [m]; `limb`, the wearer's segment.

    Returns
    -------
    ControlLaw
        At rest; `step(time, position)` gives the effort.

    Raises
    ------
    PellucidError
        If there is no such controller, or it is made of something else.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> t = np.arange(0.0, 20.0, 0.005)
    >>> q = 0.6 * np.sin(0.8 * t) + 0.3 * np.sin(3.1 * t) + 0.1 * np.sin(7.0 * t)
    >>> v = np.gradient(q, t)
    >>> effort = 0.05 * np.gradient(v, t) + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v
    >>> fit = pl.fit_joint(t, q, effort, lowpass=10.0, decimate=5)
    >>> limits = pl.Limits(effort=5.0, rate=500.0, velocity=10.0, position=(-2.0, 2.0))
    >>> law = pl.controller(fit, "compensation", period=1e-3, limits=limits)
    >>> efforts = [law.step(1e-3 * i, 0.5) for i in range(100)]
    >>> round(efforts[-1], 2), law.fault
    (0.72, 'none')
    >>> _ = law.step(0.1, float("nan"))
    >>> law.fault
    'not_finite'
    """
    if name not in CONTROLLER_BUILDERS:
        raise PellucidError(f'found the controller "{name}", expected one of {", ".join(CONTROLLER_BUILDERS)}')
    if limits is not None:
        settings["limits"] = limits
    return CONTROLLER_BUILDERS[name].build(found, period=period, **settings)


def _card(found: object) -> Card:
    """The card of what was found, or what was found if it is one."""
    if isinstance(found, Card):
        return found
    cards = getattr(found, "cards", None)
    if isinstance(cards, Mapping) and isinstance(cards.get("joint"), Card):
        return cards["joint"]
    if cards is None and hasattr(found, "card"):
        return found.card()
    raise PellucidError(
        f"controller: found {type(found).__name__}, expected what `identify` found of a joint, its fit or its card"
    )


MIN_INERTIA_MARGIN = 1.5
"""Factor by which the share of inertia could grow before a loop that is stable without it is not [1].

By the linear analysis of this file, on arms of seeds 20261101, 20261122 and 777, a share of 0.4 is beyond that and one
of 0.2 within it. One worn arm of five had gone unstable with 0.4; with 0.2 none was worn."""

INERTIA_SHARE_STEP = 0.05
"""Step in which shares of inertia are tried [1]."""

MARGIN_POSTURE_COUNT = 3
"""Number of postures drawn within the joints' ranges."""

MARGIN_SEED = 20261124
"""Seed of these postures."""

CUFF_FREQUENCIES = (25.0, 50.0)
"""Natural frequencies of a limb as heavy as the robot's link in its cuffs [rad/s]: those of the virtual arm have 30 to
40."""

CUFF_DAMPING = 0.2
"""Damping ratio of a limb in its cuffs [1]."""

MARGIN_SPEED = 0.5
"""Speed at which dry friction is linear [rad/s or m/s]."""

DRIVE_FREQUENCY = 1250.0
"""Bandwidth of a drive's current loop [rad/s]."""


@dataclass(frozen=True)
class InertiaMargin:
    """Margin by which each joint's share of inertia could grow."""

    joint: str  # joint that is nearest to instability
    factor: float  # factor by which all shares together may grow [1]


def inertia_margin(
    card: TreeCard, width: np.ndarray, *, share: float, friction_share: float, bandwidth: float, period: float
) -> InertiaMargin:
    """Return how much a share of inertia may grow over drawn postures, limbs and cuffs, up to twice the least margin.

    `width` (m,) of friction's smooth sign, `bandwidth` of the motion's estimator [rad/s], `period` [s].
    """
    loops = _worn_loops(card, period)
    settings = (width, friction_share, bandwidth, period)
    judged = [one for one in loops if _is_stable(one, 0.0, *settings)]
    most = 2.0 * MIN_INERTIA_MARGIN
    factors = np.arange(most, 0.0, -INERTIA_SHARE_STEP / max(share, 1e-9))
    found = next((f for f in factors if all(_is_stable(one, f * share, *settings) for one in judged)), 0.0)
    if found >= most:
        return InertiaMargin(card.names[0], found)
    # Beyond that factor, which joint alone does most of it?
    m, worst = len(card.names), np.zeros(len(card.names))
    for k in range(m):
        shares = np.full(m, found * share)
        shares[k] = 2.0 * most * share
        worst[k] = max(_radius(one, shares, *settings) for one in judged) if judged else 0.0
    return InertiaMargin(card.names[int(np.argmax(worst))], float(found))


def supported_inertia_share(card: TreeCard, width: np.ndarray, *, most: float, **settings) -> float:
    """Return the largest share of inertia up to `most` whose margin is `MIN_INERTIA_MARGIN`, in steps; 0 where none is.

    `settings` as of `inertia_margin`.
    """
    found = inertia_margin(card, width, share=most, **settings).factor
    if found >= MIN_INERTIA_MARGIN:
        return most
    steps = math.floor(most * found / MIN_INERTIA_MARGIN / INERTIA_SHARE_STEP + 1e-9)
    return round(INERTIA_SHARE_STEP * steps, 9)


def require_inertia_margin(card: TreeCard, width: np.ndarray, *, share: float, **settings) -> None:
    """Raise a PellucidError if a share of inertia has too small a margin on this robot; `settings` as above."""
    found = inertia_margin(card, width, share=share, **settings)
    if found.factor < MIN_INERTIA_MARGIN:
        least = supported_inertia_share(card, width, most=share, **settings)
        raise PellucidError(
            f"{found.joint}: found an inertia_share of {share:g} with a gain margin of {found.factor:.2g} before the "
            f"loop becomes unstable, expected {MIN_INERTIA_MARGIN:g}: use {least:g} or less, or a force sensor"
        )


@dataclass(frozen=True, eq=False)
class _Loop:
    coupling: TreeCoupling
    plant: LinearSystem  # sampled, from efforts wanted to encoders


def _worn_loops(card: TreeCard, period: float) -> list[_Loop]:
    """The robot about drawn postures on drawn limbs and cuffs."""
    m, tree = len(card.names), card.tree
    rng, made = np.random.default_rng(MARGIN_SEED), []
    fields = model_fields("tree_joint")
    column = card.joint_columns
    for _ in range(MARGIN_POSTURE_COUNT):
        q = np.array([rng.uniform(*known.span(motion)) for known, motion in zip(card.ranges, card.motion, strict=True)])
        mass = tree.mass_matrix(q[None])[0]
        weight = np.abs(tree.gravity(q[None])[0])
        resting = np.asarray(largest_friction(fields, column, 0.0, weight))
        moving = np.asarray(largest_friction(fields, column, MARGIN_SPEED, weight))
        for frequency in CUFF_FREQUENCIES:
            coupling = TreeCoupling(
                mass=mass,
                viscous=(moving - resting) / MARGIN_SPEED,
                slope=gravity_slope(tree, q),
                coulomb=resting,
                limb_mass=mass,
                limb_viscous=np.full(m, 0.1),
                limb_slope=gravity_slope(tree, q),
                cuff_stiffness=frequency**2 * mass,
                cuff_damping=2.0 * CUFF_DAMPING * frequency * mass,
                drive_frequency=np.full(m, DRIVE_FREQUENCY),
                drive_damping=np.ones(m),
                delay=period,
            )
            for limb in DRAWN_LIMBS:
                worn = with_limb(coupling, limb)
                plant = worn_tree(worn, MARGIN_SPEED)
                seen = LinearSystem(plant.a, plant.b[:, :m], plant.c[:m], plant.d[:m, :m])
                made.append(_Loop(worn, sampled_each(seen, period, np.full(m, period))))
    return made


def _radius(
    loop: _Loop, share: np.ndarray | float, width: np.ndarray, friction: float, bandwidth: float, period: float
) -> float:
    shares = LinearShares(1.0, friction, share, bandwidth=bandwidth)
    law = linear_law(loop.coupling, shares, period, width=width, speed=MARGIN_SPEED)
    return radius(closed_tree(loop.plant, law))


def _is_stable(loop: _Loop, share: np.ndarray | float, *settings) -> bool:
    return _radius(loop, share, *settings) < 1.0
