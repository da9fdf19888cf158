"""Controllers of a worn elbow robot by name: description, required model card, and builder.

Simulation, export and fuzzing use the same control law with the same gains under a name, which `ElbowController.build`
sets: gains that are unstable with a compliant transmission are reduced unless the robot's lowest resonance is stated
and high enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from .._errors import PellucidError
from ..models.anthropometry import Segment, point_mass
from ..models.slider_joint import SliderCard
from .control_law import ControlLaw
from .elbow_laws import full_compensation, partial_compensation, position_control
from .transparent_laws import (
    known_travel,
    sensitivity_amplification,
    transparent,
    with_borne_force_gain,
    with_disturbance_observer,
    with_dither,
    with_emg,
    with_force_sensor,
    with_load,
    with_oscillator,
    with_support,
    zero_impedance,
)

DITHERED_BODY: Mapping[str, float] = {
    "friction_share": 1.0,
    "inertia_share": 0.6,
    "velocity_width": 0.15,
    "bandwidth": 128.0,
}
"""What of the body is compensated where the motor's dither keeps it from sticking."""

SENSED_BODY: Mapping[str, float] = {
    "friction_share": 0.85,
    "inertia_share": 0.5,
    "velocity_width": 0.03,
    "bandwidth": 75.0,
}
"""What of the body is compensated where a force sensor sees to the rest."""

DEFAULT_FORCE_SENSOR = partial(with_force_sensor, proportional=1.5, lowpass=550.0)
"""Feedback of the interaction torque with gains chosen on tuning robots, whose transmissions are stiff."""

DEFAULT_OBSERVER = partial(with_disturbance_observer, share=0.5, lowpass=60.0)
"""Disturbance observer with the gains that were chosen on tuning robots, before any transmission lowers them."""

DEFAULT_DITHER = partial(with_dither, share=2.0, frequency=1000.0)
"""Dither with the amplitude and frequency that were chosen on tuning robots."""

BEST_CONTROLLER = "dithered"
"""Controller with the smallest interaction torque among those that need an encoder only."""

BEST_SENSED_CONTROLLER = "force_sensor"
"""Controller with the smallest interaction torque among those with a force sensor."""

UNDITHERED_CONTROLLER = "transparent"
"""Controller that replaces the dithered one where dither is refused."""


@dataclass(frozen=True)
class ElbowController:
    """A law with its settings, under a name."""

    title: str  # What it does, in a few words
    method: str  # Identification whose card it takes
    # Takes the card, the place of the carriage [m] and settings of the law; gives a `ControlLaw` with the gains that
    # were chosen on stiff transmissions
    build_stiff: Callable[..., ControlLaw]
    wearer: bool = False  # Whether `build` also needs the wearer's `limb`, a `Segment`
    exponents: bool = False  # Whether it has those of equation 8, which are chosen on a robot
    assists: bool = False  # Whether it carries part of its wearer, so that its interaction torque is not to vanish
    carries_load: bool = True  # Whether it carries one coherent body, and so a load on the robot or in the hand

    def build(
        self, card: SliderCard, slider: float, *, lowest_resonance: float | None = None, load: Segment | None = None,
        held: Segment | None = None, **settings: Any,
    ) -> ControlLaw:  # fmt: skip
        """Return the law that people wear and that `export` writes, with the gains that its robot's transmission bears.

        Parameters
        ----------
        card : SliderCard
            Identified model of the robot, by the method of `card`.
        slider : float
            Place of the carriage [m].
        lowest_resonance : float or None
            Lowest resonance of rotor and joint behind the transmission [Hz]; None where it is not known.
        load : Segment or None
            Load that is fastened to the robot, which the law carries too; None for none.
        held : Segment or None
            Load in the wearer's hand, whose weight the law carries too; None for none.
        **settings
            Settings of the law, as `build_stiff` takes them.

        Returns
        -------
        ControlLaw
        """
        law = with_borne_force_gain(self.build_stiff(card, slider, **settings), lowest_resonance)
        law = law if load is None else with_load(law, load)
        return law if held is None else with_support(law, held)

    @property
    def card(self) -> str:
        """File name in a study's models folder."""
        return f"slider.{self.method}.json"


def transparent_and(
    *steps: Callable[[ControlLaw], ControlLaw], emg_share: float = 0.0, **body: float
) -> Callable[..., ControlLaw]:
    """The transparent law and what is added to it.

    The constants of the controllers with dither or a force sensor were chosen by the smallest interaction torque
    of people and robots that they are scored on nowhere, among those that come to rest on each of ten robots and give
    no energy over a movement there and back, nor more than 1 mJ with a quarter more gain, a tenth more friction and a
    fifth more inertia compensated.

    Gives [m].
    """

    def build(card: SliderCard, slider: float, *, limb: Segment | None = None, **settings) -> ControlLaw:
        law = transparent(card, slider, **{**body, **settings})
        for step in steps:
            law = step(law)
        if emg_share > 0.0:
            if limb is None:
                raise PellucidError("a law that EMG leads: found no limb, expected the wearer's")
            law = with_emg(law, limb, share=emg_share)
        return law

    return build


SUPPORTED_LIMB_SHARE = 0.3
"""Share of the weight of forearm and hand that the supporting controller carries unless another is asked for [1].

Chosen by judgement; no measurement is recorded."""


def supporting(
    card: SliderCard, slider: float, *, limb: Segment | None = None, share: float = SUPPORTED_LIMB_SHARE, **settings
) -> ControlLaw:
    """The law with a force-sensing body that also carries a `share` of the weight of its wearer's `limb`.

    The strap's torque is then meant, so that no feedback drives it to zero. `slider` [m].
    """
    if limb is None:
        raise PellucidError("a law that supports a limb: found no limb, expected the wearer's")
    return with_support(transparent(card, slider, **{**SENSED_BODY, **settings}), limb, share)


def dithered(card: SliderCard, slider: float, *, limb: Segment | None = None, **settings) -> ControlLaw:
    """The transparent law with dither; refused where the travel of friction was not measured, or is too long. `slider`
    [m]."""
    known_travel(card)
    return transparent_and(DEFAULT_DITHER, **DITHERED_BODY)(card, slider, limb=limb, **settings)


ELBOW_CONTROLLERS: Mapping[str, ElbowController] = {
    "clpc": ElbowController(
        "the maker's position control, as published", "pooled", position_control, carries_load=False
    ),
    "pcfr": ElbowController(
        "compensation by direction without friction, as published", "dissociated", partial_compensation, exponents=True,
        carries_load=False,
    ),
    "fc": ElbowController(
        "compensation by direction with friction, as published", "dissociated", full_compensation, exponents=True,
        carries_load=False,
    ),
    "without_friction": ElbowController(
        "one coherent body compensated but for its friction: PCFr corrected", "load",
        transparent_and(friction_share=0.0),
    ),
    "transparent": ElbowController("compensation of one rigid body: FC corrected", "load", transparent),
    "emg": ElbowController(
        "compensation of one rigid body, led by EMG", "load", transparent_and(emg_share=0.5), wearer=True
    ),
    "oscillator": ElbowController(
        "one coherent body compensated, led by an oscillator where motion is periodic", "load",
        transparent_and(with_oscillator),
    ),
    "dithered": ElbowController(
        "compensation of one rigid body, with motor dither against sticking", "load",
        dithered,
    ),
    "force_sensor": ElbowController(
        "compensation of one rigid body, and control of the measured interaction torque to zero", "load",
        transparent_and(DEFAULT_FORCE_SENSOR, **SENSED_BODY),
    ),
    "disturbance_observer": ElbowController(
        "compensation of one rigid body, and of further resistance observed with a force sensor", "load",
        transparent_and(DEFAULT_OBSERVER, **SENSED_BODY),
    ),
    "zero_impedance": ElbowController(
        "control of the measured interaction torque to zero, without a model", "load", zero_impedance,
        carries_load=False,
    ),
    "residual": ElbowController(
        "control of the measured interaction torque to zero, and compensation predicted from EMG", "load",
        transparent_and(DEFAULT_FORCE_SENSOR, emg_share=0.5, **SENSED_BODY), wearer=True,
    ),
    "support": ElbowController(
        "compensation of one rigid body, and support of a share of the weight of forearm and hand", "load",
        supporting, wearer=True, assists=True,
    ),
    "amplification": ElbowController("the wearer's torque amplified", "load", sensitivity_amplification),
}  # fmt: skip
"""By the name that ``pellucid export --controller`` takes."""


def stated_load(where: str, name: str, given: tuple[float, float] | None) -> Segment | None:
    """Return a load as a point mass, of its mass [kg] and distance from the axis [m]; None for none.

    `where` and `name` stand in the PellucidError that is raised if either is not above 0.
    """
    if given is None:
        return None
    mass, distance = given
    if not (math.isfinite(mass) and math.isfinite(distance) and mass > 0.0 and distance > 0.0):
        raise PellucidError(f"{where}: found a {name} of {mass:g} kg at {distance:g} m, expected both above 0")
    return point_mass(mass, distance)
