"""An elbow as published, as a JSON card of its own kind: never to be taken for an identified model.

A `models.card.ModelCard` holds one joint with intervals and a covariance, and is deployed. This holds three directional
sets with a slider and without any interval; it says ``"kind": "as_published"``, and carries what is wrong with it.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from pellucid._atomic import write_text_atomically

from .coherence import inconsistencies
from .elbow import DirectionSet, PublishedElbow

CARD_FORMAT = 1
"""Version of the card's layout."""

CARD_KIND = "as_published"
"""The card's ``kind``, which no reader of identified models accepts."""

PARAMETER_UNITS = {
    "m_x_slope": "kg",
    "m_x_offset": "kg*m",
    "m_y": "kg*m",
    "adherence": "N*m",
    "coulomb": "N*m",
    "viscous": "N*m*s/rad",
    "inertia": ["kg*m^2", "kg*m", "kg"],
}
"""Units of the card's parameters; an inertia has those of a_0, a_1 and a_2."""

MISSING_QUANTITIES = (
    "torque constant",
    "reduction ratio",
    "range of the slider",
    "which way the angle grows",
    "any interval",
)
"""Quantities that a usable model needs and the paper does not give."""


def published_card(elbow: PublishedElbow) -> dict:
    """Return the card: parameters, units, source, angle convention, missing quantities and inconsistencies."""
    return {
        "format": CARD_FORMAT,
        "kind": CARD_KIND,
        "source": elbow.source,
        "angle": "rad, 0 with the forearm horizontal; hanging is -pi/2",
        "units": PARAMETER_UNITS,
        "directions": {name: _plain(found) for name, found in elbow.sets.items()},
        "missing": list(MISSING_QUANTITIES),
        "warnings": [asdict(i) for i in inconsistencies(elbow)],
    }


def write_published_card(path: Path, elbow: PublishedElbow) -> None:
    """Write the card as JSON, atomically."""
    write_text_atomically(path, json.dumps(published_card(elbow), indent=2, allow_nan=False) + "\n")


def _plain(found: DirectionSet) -> dict:
    """Return a direction's parameters as JSON values, without those that the paper leaves empty."""
    return {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(found).items() if v is not None}
