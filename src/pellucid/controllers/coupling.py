"""What was identified of a worn orthosis, as its controllers need it: two bodies, a strap and an actuator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from .._errors import PellucidError
from ..models.parameter_card import ParameterCard

ON_CARDS: Mapping[str, Mapping[str, str]] = {
    "orthosis": {
        "inertia": "orthosis_inertia",
        "damping": "orthosis_viscous",
        "gravity": "orthosis_gravity",
        "coulomb": "coulomb",
    },
    "limb": {"inertia": "limb_inertia", "damping": "limb_viscous", "gravity": "limb_gravity"},
    "coupling": {"stiffness": "strap_stiffness", "damping": "strap_damping"},
}
"""What a card of each kind calls a parameter, and what `Coupling` does."""


@dataclass(frozen=True)
class Coupling:
    """An orthosis, the limb in it, the strap between them and the torque loop that moves the orthosis."""

    # orthosis_inertia, orthosis_viscous, orthosis_gravity: I_e [kg m^2], b_e [N m s/rad], G_e = m g l [N m]
    orthosis_inertia: float
    orthosis_viscous: float
    orthosis_gravity: float
    coulomb: float  # Coulomb friction between spring and orthosis [N m]
    limb_inertia: float  # limb_inertia, limb_viscous, limb_gravity: I_k [kg m^2], b_k [N m s/rad], G_k = m g l [N m]
    limb_viscous: float
    limb_gravity: float
    strap_stiffness: float  # strap_stiffness, strap_damping: k [N m/rad], b [N m s/rad]
    strap_damping: float
    # actuator_frequency, actuator_damping: Second-order lag from the torque wanted to the spring's torque: natural
    # frequency [rad/s], damping ratio [1]
    actuator_frequency: float
    actuator_damping: float = 1.0
    delay: float = 0.0  # Dead time before that lag [s]; the loop's own sample and hold is not part of it
    slack: float = 0.0  # Half the gap in which the strap's spring is slack [rad]
    # actuator_inertia, actuator_viscous, actuator_coulomb: What the torque loop does not cancel of motor and gear [kg
    # m^2], [N m s/rad], [N m]
    actuator_inertia: float = 0.0
    actuator_viscous: float = 0.0
    actuator_coulomb: float = 0.0
    actuator_leak: float = 0.0  # Rate at which the torque loop's integral cancels it after all [1/s]

    def __post_init__(self):
        for field in fields(self):
            value = getattr(self, field.name)
            if not np.isfinite(value) or (value <= 0 if field.name in POSITIVE_NUMBERS else value < 0):
                bound = "> 0" if field.name in POSITIVE_NUMBERS else ">= 0"
                raise PellucidError(f"Coupling: {field.name} is {value:g}, expected a number {bound}.")

    @classmethod
    def from_cards(cls, *cards: Mapping[str, float]) -> Coupling:
        """From the parameters of several cards."""
        known = {field.name for field in fields(cls)}
        merged: dict[str, float] = {}
        for card in cards:
            for name in known & set(card):
                if name in merged and merged[name] != float(card[name]):
                    raise PellucidError(
                        f"Coupling: two cards give {name}, {merged[name]:g} and {float(card[name]):g}, expected one "
                        "value."
                    )
                merged[name] = float(card[name])
        missing = sorted(POSITIVE_NUMBERS | {"coulomb", "orthosis_viscous", "limb_viscous"} - set(merged))
        missing = [name for name in missing if name not in merged]
        if missing:
            raise PellucidError(
                f"Coupling: no card gives {', '.join(missing)}, expected each in one; identify the orthosis again."
            )
        return cls(**merged)

    @classmethod
    def of_cards(
        cls, orthosis: ParameterCard, limb: ParameterCard, strap: ParameterCard, actuator: Mapping[str, float]
    ) -> Coupling:
        """From the cards that `identify` writes for an orthosis and its wearer."""
        named = []
        for card, kind in ((orthosis, "orthosis"), (limb, "limb"), (strap, "coupling")):
            if card.kind != kind:
                raise PellucidError(f'Coupling: the card {card.name} is of kind "{card.kind}", expected "{kind}".')
            named.append({ON_CARDS[kind][name]: v for name, v in card.values.items() if name in ON_CARDS[kind]})
        return cls.from_cards(*named, actuator)

    def scaled(self, **factors: float) -> Coupling:
        """The same with some parameters multiplied."""
        return replace(self, **{name: getattr(self, name) * factor for name, factor in factors.items()})


POSITIVE_NUMBERS = {
    "orthosis_inertia", "orthosis_gravity", "limb_inertia", "limb_gravity", "strap_stiffness", "strap_damping",
    "actuator_frequency", "actuator_damping",
}  # fmt: skip


def friction_slope(amplitude: float, coulomb: float, width: float = 0.0) -> float:
    """Describing function of Coulomb friction: the viscous coefficient that does the same to a sinusoidal velocity.

    N(A) = 2/(pi A) int_0^pi F tanh(A sin x / w) sin x dx, which is 4 F/(pi A) for a true sign.

    `amplitude` [rad/s]; `coulomb` [N m]; `width` [rad/s]; gives [N m s/rad].
    """
    if width <= 0:
        return 4 * coulomb / (np.pi * amplitude)
    phase = (np.arange(400) + 0.5) * np.pi / 400  # the midpoint rule is spectrally exact on a periodic integrand
    return float(2 / amplitude * np.mean(coulomb * np.tanh(amplitude * np.sin(phase) / width) * np.sin(phase)))
