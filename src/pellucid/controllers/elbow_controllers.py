"""Controllers of a worn elbow robot by name: what each is, the card that it needs, and what makes it of that card.

What virtual people wear, what is exported and what is fuzzed under a name is the same law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..models.anthropometry import Segment
from ..models.slider_card import SliderCard
from .elbow_laws import (
    ElbowLaw,
    full_compensation,
    partial_compensation,
    position_control,
    sensitivity_amplification,
    transparent,
    with_emg,
    with_force_sensor,
    with_oscillator,
)

SENSED_BODY: Mapping[str, float] = {
    "friction_share": 0.5,
    "inertia_share": 0.0,
    "velocity_width": 0.05,
    "bandwidth": 90.0,
}
"""What of the body is compensated where a force sensor sees to the rest. Chosen, as the other gains were, by the
smallest interaction torque of five people on three robots that are not those it is judged on."""


@dataclass(frozen=True)
class ElbowController:
    """A law with its settings, under a name.

    Attributes
    ----------
    title : str
        What it does, in a few words.
    method : str
        Of the identification whose card it takes.
    build : callable
        Takes the card, the place of the carriage [m] and settings of the law; gives an `ElbowLaw`.
    wearer : bool
        Whether `build` also needs the wearer's `limb`, a `Segment`.
    exponents : bool
        Whether it has those of equation 8, which are chosen on a robot.
    """

    title: str
    method: str
    build: Callable[..., ElbowLaw]
    wearer: bool = False
    exponents: bool = False

    @property
    def card(self) -> str:
        """File name in a study's models folder."""
        return f"slider.{self.method}.json"


def sensed(card: SliderCard, slider: float, **settings) -> ElbowLaw:
    """The transparent law with a force sensor.

    Parameters
    ----------
    card : SliderCard
        "consistent" or "load".
    slider : float
        Where the carriage is [m].
    **settings
        As `transparent` takes them; `SENSED_BODY` where not given.

    Returns
    -------
    ElbowLaw
    """
    return with_force_sensor(transparent(card, slider, **{**SENSED_BODY, **settings}))


def led_by_emg(card: SliderCard, slider: float, *, limb: Segment, **settings) -> ElbowLaw:
    """The transparent law, its inertia led by EMG.

    Parameters
    ----------
    card : SliderCard
        "consistent" or "load".
    slider : float
        Where the carriage is [m].
    limb : Segment
        Of the wearer.
    **settings
        As `transparent` takes them.

    Returns
    -------
    ElbowLaw
    """
    return with_emg(transparent(card, slider, **settings), limb)


def led_by_oscillator(card: SliderCard, slider: float, **settings) -> ElbowLaw:
    """The transparent law, its inertia led by an oscillator.

    Parameters
    ----------
    card : SliderCard
        "consistent" or "load".
    slider : float
        Where the carriage is [m].
    **settings
        As `transparent` takes them.

    Returns
    -------
    ElbowLaw
    """
    return with_oscillator(transparent(card, slider, **settings))


ELBOW_CONTROLLERS: Mapping[str, ElbowController] = {
    "clpc": ElbowController("the maker's position control, as published", "pooled", position_control),
    "pcfr": ElbowController(
        "compensation by direction without friction, as published", "dissociated", partial_compensation, exponents=True
    ),
    "fc": ElbowController(
        "compensation by direction with friction, as published", "dissociated", full_compensation, exponents=True
    ),
    "transparent": ElbowController("one coherent body compensated", "load", transparent),
    "force_sensor": ElbowController(
        "one coherent body compensated, the measured interaction torque driven to zero", "load", sensed
    ),
    "emg": ElbowController("one coherent body compensated, led by EMG", "load", led_by_emg, wearer=True),
    "oscillator": ElbowController(
        "one coherent body compensated, led by an oscillator where motion is periodic", "load", led_by_oscillator
    ),
    "amplification": ElbowController("the wearer's torque amplified", "load", sensitivity_amplification),
}
"""By the name that ``pellucid export --controller`` takes."""
