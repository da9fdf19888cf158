"""Every controller by name: what an identification found, made into a control law that runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from .._errors import PellucidError
from ..models.card import Card
from ..models.slider_card import SliderCard
from .control_law import ControlLaw
from .elbow_controllers import ELBOW_CONTROLLERS
from .joint_compensation import compensation, place_on_rail
from .limits import Limits


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
    "compensation": NamedController("a joint's gravity and friction carried", _compensation),
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


def controller(
    found: object,
    name: str = "compensation",
    *,
    period: float = 1e-3,
    limits: Limits | None = None,
    **settings: object,
) -> ControlLaw:
    """A controller of what was found: the same law that virtual people wear and that `export` writes, stepped here.

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
        What may be asked for; None: what the controller takes by itself.
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
