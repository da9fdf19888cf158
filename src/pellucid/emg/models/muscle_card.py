"""Calibrated muscles as a card's settings: all their numbers in SI, what drives each, the joints that they move.

A card's parameters are what was fitted, as factors of an anatomical model; who exports or simulates needs the muscles
themselves. Keys of ``settings``: ``joints`` and ``muscles`` (names between commas), ``muscle.<muscle>.<quantity>`` for
every quantity of the core, ``driven.<muscle>`` (EMG channels whose mean drives it), ``tissue.<joint>.<number>`` for the
joint's own offset, stiffness and damping, and ``effort``, what an envelope of 1 is of a maximal contraction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..._errors import PellucidError
from ...models.parameter_card import ParameterCard
from .hill import MUSCLE_QUANTITIES, HillMuscle

CARD_KIND = "muscles"

TISSUE_QUANTITIES = ("offset", "stiffness", "damping")
"""Numbers of a joint's own tissue: torque = offset - stiffness * angle - damping * speed, in N m, rad and s."""


@dataclass(frozen=True)
class CalibratedMuscles:
    """Muscles as they were calibrated, with what a reader needs to use them."""

    muscles: tuple[HillMuscle, ...]  # SI; one set, whatever joints they move
    driven: Mapping[str, tuple[str, ...]]  # EMG channels by muscle, whose mean is its excitation
    tissue: Mapping[str, tuple[float, float, float]]  # By joint, in the order of `TISSUE_QUANTITIES`
    effort: float = 1.0  # Share of a maximal contraction that an envelope of 1 stands for

    @property
    def joints(self) -> tuple[str, ...]:
        """Those that the muscles move."""
        return tuple(self.tissue)

    def settings(self) -> dict[str, str | float]:
        """As a card keeps them."""
        said: dict[str, str | float] = {
            "joints": ", ".join(self.joints),
            "muscles": ", ".join(m.name for m in self.muscles),
            "effort": self.effort,
        }
        for muscle in self.muscles:
            said[f"driven.{muscle.name}"] = ", ".join(self.driven[muscle.name])
            said |= {
                f"muscle.{muscle.name}.{quantity}": float(x)
                for quantity, x in zip(MUSCLE_QUANTITIES, muscle.vector(), strict=True)
            }
        for joint, numbers in self.tissue.items():
            said |= {f"tissue.{joint}.{name}": float(x) for name, x in zip(TISSUE_QUANTITIES, numbers, strict=True)}
        return said


def calibrated_muscles(card: ParameterCard) -> CalibratedMuscles:
    """The muscles that a card keeps."""
    if card.kind != CARD_KIND:
        raise PellucidError(f"the card {card.name}: found a card of {card.kind}, expected one of {CARD_KIND}")

    def asked(key: str) -> str | float:
        if key not in card.settings:
            raise PellucidError(f"the card {card.name}: found no setting {key}, expected it; calibrate again")
        return card.settings[key]

    def tissue(joint: str) -> tuple[float, float, float]:
        offset, stiffness, damping = (float(asked(f"tissue.{joint}.{number}")) for number in TISSUE_QUANTITIES)
        return offset, stiffness, damping

    names, joints = _names(asked("muscles")), _names(asked("joints"))
    return CalibratedMuscles(
        tuple(HillMuscle(name, **{q: float(asked(f"muscle.{name}.{q}")) for q in MUSCLE_QUANTITIES}) for name in names),
        {name: _names(asked(f"driven.{name}")) for name in names},
        {joint: tissue(joint) for joint in joints},
        float(asked("effort")),
    )


def _names(said: str | float) -> tuple[str, ...]:
    return tuple(part.strip() for part in str(said).split(",") if part.strip())
