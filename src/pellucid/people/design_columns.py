"""Which columns of a table describe how it was recorded: factors of the design, which are never tested as indices.

A column is one by its name (`design_word`), or by its values: few levels, the same ones in every condition and
participant, are set by a design, not measured (`is_designed`).

`MeasuredMovement` is one movement with its indices and its place in the design. `cluster` gives the workers of a
scheduler to simulations.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from .._errors import PellucidError, missing_package
from .emg_index import MAX_AMPLITUDE_COUNT
from .movements import Movement


class DesignRole(Enum):
    """What a column of the design says of a movement."""

    CELL_FACTOR = "which movements are alike"
    PERIOD_FACTOR = "when a condition came"
    TRIAL_FACTOR = "when a movement came within its condition"


AMBIGUOUS_WORDS = ("distance", "width", "load", "difficulty")
"""Words that name a factor, but with a word for a trial (``movement_distance``) a measurement in it."""

DESIGN_WORDS: Mapping[str, DesignRole] = {
    **dict.fromkeys(
        ("amplitude", "target", "direction", "side", "hand", "limb", "task", *AMBIGUOUS_WORDS), DesignRole.CELL_FACTOR
    ),
    "period": DesignRole.PERIOD_FACTOR,
    **dict.fromkeys(
        ("session", "visit", "day", "block", "run", "round", "set", "cycle", "repetition", "rep", "attempt",
         "iteration", "trial", "movement", "sequence", "order"),
        DesignRole.TRIAL_FACTOR,
    ),
}  # fmt: skip
"""Words that name a factor of the design, and its role; those of a trial from the slowest to the fastest."""

DEMAND_WORDS = frozenset((
    "condition", "nominal", "instructed", "prescribed", "commanded", "demanded", "desired", "requested", "cued",
))  # fmt: skip
"""Words that say that a quantity was demanded and not measured, as ``target`` does."""

DEMANDED_WORDS = frozenset((
    "speed", "velocity", "pace", "cadence", "tempo", "frequency", "force", "torque", "height", "weight", "mass",
))  # fmt: skip
"""Quantities that are a factor only with one of `DEMAND_WORDS` or ``target``; otherwise they may be measurements."""

QUALIFIER_WORDS = frozenset((
    "number", "no", "nr", "num", "n", "id", "index", "idx", "label", "name", "code", "level",
    "angle", "position", "deg", "degree", "degrees", "rad", "m", "mm", "cm", "kg", "s", "of", "the",
))  # fmt: skip
"""Words that leave a factor one: its unit, its number, its label."""

MIN_LEVEL_SHARE = 2 / 3
"""Least share of the levels that a participant has in a condition on average, of a designed factor. What differs
between participants or conditions by design has at most half; the rest is room for movements that were lost."""

MIN_LEVEL_BALANCE = 0.75
"""Rarest level over commonest one, in the condition where they are most alike, from which words and consecutive whole
numbers are taken as designed: successes, counts and scores are seldom as balanced. Chosen by judgement."""


def design_word(name: str) -> str:
    """Return the word of `DESIGN_WORDS` in the name of a column that has no other words but qualifiers; "" without one.

    >>> design_word("amplitude [deg]"), design_word("TrialNumber"), design_word("trial_duration")
    ('amplitude', 'trial', '')
    >>> design_word("target_distance"), design_word("speed_condition"), design_word("movement_distance")
    ('distance', 'target', '')
    """
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)
    words = [part.lower() for part in parts]
    words = [word[:-1] if word[:-1] in DESIGN_WORDS else word for word in words]
    demanded = any(word == "target" or word in DEMAND_WORDS for word in words)
    known = {*DESIGN_WORDS, *DEMAND_WORDS, *QUALIFIER_WORDS, *(DEMANDED_WORDS if demanded else ())}
    if not all(word in known for word in words):
        return ""
    if demanded and any(word in DEMANDED_WORDS for word in words):
        return "target"
    found = [word for word in words if word in DESIGN_WORDS]
    measured = len({DESIGN_WORDS[word] for word in found}) > 1 and any(word in AMBIGUOUS_WORDS for word in found)
    return found[-1] if found and (demanded or not measured) else ""


def level_of(value: Any) -> object:
    """Return the level of a factor that a value is: numbers to six digits, as labels that were computed are rounded."""
    return float(f"{value:.6g}") if isinstance(value, (int, float, np.integer, np.floating)) else str(value)


def is_designed(values: Sequence[Any], participants: Sequence[str], conditions: Sequence[str]) -> bool:
    """Return whether a column has few levels, the same ones in every condition and participant."""
    if any(value is None for value in values):
        return False
    levels = [level_of(value) for value in values]
    kinds = set(levels)
    if len(kinds) < 2 or too_many_levels(tuple(kinds)) or any(level != level for level in kinds):
        return False
    counts: dict[str, dict[object, int]] = {}
    for level, condition in zip(levels, conditions, strict=True):
        own = counts.setdefault(condition, dict.fromkeys(kinds, 0))
        own[level] += 1
    pairs = set(zip(participants, conditions, strict=True))
    cells = set(zip(participants, conditions, levels, strict=True))
    balance = max(min(own.values()) / max(own.values()) for own in counts.values())
    if balance == 0.0 or len(cells) < MIN_LEVEL_SHARE * len(pairs) * len(kinds):
        return False
    numbers = [level for level in kinds if isinstance(level, float)]
    spaced = len(numbers) == len(kinds) and not (
        all(level.is_integer() for level in numbers) and max(numbers) - min(numbers) == len(numbers) - 1
    )
    return spaced or balance >= MIN_LEVEL_BALANCE


def design_roles(
    columns: Mapping[str, Sequence[Any]], participants: Sequence[str], conditions: Sequence[str]
) -> dict[str, DesignRole]:
    """Return the columns of the design and their roles, by name or else by values.

    An order that is one value of each participant and condition is when the condition came.
    """
    roles = {}
    for name, values in columns.items():
        word = design_word(name)
        if word:
            pairs = len(set(zip(participants, conditions, strict=True)))
            once = len(set(zip(participants, conditions, map(level_of, values), strict=True))) == pairs
            roles[name] = DesignRole.PERIOD_FACTOR if word == "order" and once else DESIGN_WORDS[word]
        elif is_designed(values, participants, conditions):
            roles[name] = DesignRole.CELL_FACTOR
    return roles


def columns_with_role(roles: Mapping[str, DesignRole], role: DesignRole) -> list[str]:
    """Return the columns with a role, in the order of `DESIGN_WORDS`; those without such a name come last."""
    order = [*DESIGN_WORDS, ""]
    return sorted((name for name in roles if roles[name] is role), key=lambda name: order.index(design_word(name)))


def too_many_levels(levels: Sequence[object]) -> bool:
    """Return whether a factor has so many levels that no movements are alike by it: they were drawn at random."""
    return len(levels) > MAX_AMPLITUDE_COUNT


SCHEDULER_TIMEOUT_S = 30
"""A scheduler must answer within this time. Otherwise the address is reported as wrong."""


@contextmanager
def cluster(address: str | None) -> Iterator[Any]:
    """Yield the workers of a Dask scheduler as a `concurrent.futures` executor; None without an address."""
    if not address:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise missing_package("scheduler", "distributed", "distributed") from None
    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise PellucidError(f"scheduler: found no answer at {address} ({error}), expected a Dask scheduler") from None
    with client:
        yield client.get_executor()


DIRECTION_UP = "up"
"""Direction of increasing angle, which is 0 where the segment hangs."""

DIRECTION_DOWN = "down"
"""Direction of decreasing angle."""


@dataclass(frozen=True)
class MeasuredMovement:
    """One movement and its indices."""

    participant: str
    condition: str
    recording: str
    movement: Movement
    # Cell of similar movements: labelled amplitude [deg, or mm for a position], None if there is none or too many, and
    # direction
    cell: tuple[float | None, str]
    values: Mapping[str, float]  # values by index, in SI; NaN if a value could not be computed


@dataclass(frozen=True)
class MovementDuration:
    """How long one movement was seen, and whether it had settled by then; includes movements without indices."""

    participant: str
    condition: str
    cell: tuple[float | None, str]  # cell as in `MeasuredMovement`
    seconds: float  # time seen; infinite if the person never set out or turned round
    settled: bool
