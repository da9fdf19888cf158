"""Design the residual compensator that `export` writes for a wearer; ranking, lab and proofs wear the same numbers."""

from __future__ import annotations

from .coupling import Coupling
from .limits import Limits
from .residual_compensator import ResidualDesign, design, within

MIN_GAIN_MARGIN_DB = 6.0
"""Gain margin that the loop keeps with every strap of `STRAP_FACTORS` [dB]."""

MIN_DELAY_MARGIN_S = 0.020
"""Delay margin that the loop keeps with every strap of `STRAP_FACTORS` [s]."""

STRAP_FACTORS = (0.7, 1.6)
"""Factors on the identified stiffness and damping of the strap, in every combination [1].

A strap hardens as it is pulled. With 1.3 the loop swung by itself on two of ten foreign straps of 20261101, which are
0.7 to 1.4 times as stiff as identified and twice as stiff at 0.05 to 0.12 rad."""

INERTIA_FACTORS = (0.7, 1.4)
"""Factors on the identified inertia of the orthosis with which the loop still comes to rest, on every such strap [1].

Without them the loop swung at its limit of rate, at 7 to 13 Hz, on 11 of 300 foreign orthoses of 20261103 and 20261105
to 20261107, and their drive's watch stopped it. They do not follow from the card's interval, which says how well
recordings of the empty orthosis tell its inertia, and nothing of a shell, a cuff or a longer shank that is put on
later. Nor may a loop swing on each tenth wearer, whose interval does not hold."""


def other_straps(coupling: Coupling) -> list[Coupling]:
    """Return the identified coupling and those with the straps of `STRAP_FACTORS`."""
    straps = [coupling.scaled(strap_stiffness=k, strap_damping=b) for k in STRAP_FACTORS for b in STRAP_FACTORS]
    return [coupling, *straps]


def other_orthoses(coupling: Coupling) -> list[Coupling]:
    """Return those of `other_straps`, and each with the inertias of `INERTIA_FACTORS`."""
    straps = other_straps(coupling)
    return [*straps, *(one.scaled(orthosis_inertia=factor) for one in straps for factor in INERTIA_FACTORS)]


def design_worn_law(coupling: Coupling, period: float, limits: Limits | None = None) -> ResidualDesign:
    """Return the residual compensator of one wearer, weakened until it is safe with other straps and orthoses.

    Parameters
    ----------
    coupling : Coupling
        Orthosis, actuator, strap and limb as they were identified.
    period : float
        Control period [s].
    limits : Limits, optional
        Limits of the safety gate, which the study states.
    """
    return within(
        design(coupling, period, limits=limits),
        other_straps(coupling),
        gain_db=MIN_GAIN_MARGIN_DB,
        delay=MIN_DELAY_MARGIN_S,
        wrong_plants=other_orthoses(coupling),
    )
