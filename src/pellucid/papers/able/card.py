"""An elbow as published, as a JSON card of its own kind: never to be taken for an identified model.

A `models.card.ModelCard` holds one joint with intervals and a covariance, and is deployed. This holds three directional
sets with a slider and without any interval; it says ``"kind": "as_published"``, and carries what is wrong with it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path

from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from .coherence import inconsistencies
from .elbow import DIRECTIONS, DirectionSet, PublishedElbow

FORMAT = 1
KIND = "as_published"

UNITS = {
    "m_x_slope": "kg",
    "m_x_offset": "kg*m",
    "m_y": "kg*m",
    "adherence": "N*m",
    "coulomb": "N*m",
    "viscous": "N*m*s/rad",
    "inertia": ["kg*m^2", "kg*m", "kg"],
}

MISSING = ("torque constant", "reduction ratio", "range of the slider", "which way the angle grows", "any interval")
"""What the paper does not give, and a model would need."""


def published_card(elbow: PublishedElbow) -> dict:
    """The card: parameters, units, source, angle convention, what is missing, and what is wrong."""
    return {
        "format": FORMAT,
        "kind": KIND,
        "source": elbow.source,
        "angle": "rad, 0 with the forearm horizontal; hanging is -pi/2",
        "units": UNITS,
        "directions": {name: _plain(found) for name, found in elbow.sets.items()},
        "missing": list(MISSING),
        "warnings": [asdict(i) for i in inconsistencies(elbow)],
    }


def write_published_card(path: Path, elbow: PublishedElbow) -> None:
    """Write the card as JSON, atomically."""
    write_text_atomically(path, json.dumps(published_card(elbow), indent=2, allow_nan=False) + "\n")


def read_published_card(path: Path) -> PublishedElbow:
    """Read a card back; its warnings are not kept, they follow from the numbers."""
    try:
        table = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise PellucidError(f"{path}: no such card") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise PellucidError(f"{path}: not a card ({error})") from None
    if not isinstance(table, dict) or table.get("kind") != KIND:
        raise PellucidError(f"{path}: not a card of a model as published: its 'kind' is not {KIND!r}")
    if not isinstance(table.get("format"), int) or table["format"] > FORMAT:
        raise PellucidError(f"{path}: format {table.get('format')!r}; this version reads up to {FORMAT}")
    try:
        return PublishedElbow(str(table["source"]), {name: _set(table["directions"][name]) for name in DIRECTIONS})
    except (KeyError, TypeError, ValueError) as error:
        raise PellucidError(f"{path}: not a card of format {FORMAT}: {error!r}") from None


def _plain(found: DirectionSet) -> dict:
    return {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(found).items() if v is not None}


def _set(cells: dict) -> DirectionSet:
    unknown = set(cells) - {f.name for f in fields(DirectionSet)}
    if unknown:
        raise ValueError(f"unknown {', '.join(sorted(unknown))}")
    inertia = tuple(float(a) for a in cells["inertia"]) if "inertia" in cells else None
    if inertia is not None and len(inertia) != 3:
        raise ValueError(f"an inertia of {len(inertia)} numbers; expected a0, a1, a2")
    rest = {name: float(v) for name, v in cells.items() if name != "inertia"}
    return DirectionSet(**rest, inertia=inertia)
