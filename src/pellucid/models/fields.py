"""What the core says of its numbers: name, SI unit, default, bounds and a sentence of each parameter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from .. import _core

COORDINATE_UNITS: Mapping[str, str] = {"rotary": "rad", "prismatic": "m"}


@dataclass(frozen=True)
class Resists:
    """How a coefficient of friction resists a motion: by ``|v|**speed * |y|**load`` per unit, y the load."""

    speed: float  # power of the speed
    load: float  # power of the load
    one_way: bool  # Whether it acts in one of two directions, and another number in the other


@dataclass(frozen=True)
class Field:
    """One parameter of the core: `dimension` is powers of effort, coordinate and time, or a unit of its own."""

    name: str
    dimension: tuple[float, float, float] | str
    default: float
    lower: float
    upper: float
    above: bool
    below: bool
    infinite: bool
    count: bool
    sentence: str
    resists: Resists | None = None  # None: the number is no coefficient of friction

    def unit(self, motion: str = "rotary", effort_unit: str = "N*m") -> str:
        """SI unit as plain text, "1" for none."""
        return unit_of(self.dimension, motion, effort_unit)

    @property
    def range(self) -> str:
        """Where it may lie, in words."""
        low = f"{'>' if self.above else '>='} {self.lower:g}"
        high = f"{'<' if self.below else '<='} {self.upper:g}"
        ends = [text for text, end in ((low, self.lower), (high, self.upper)) if abs(end) != float("inf")]
        return ", ".join(ends)


def unit_of(dimension: tuple[float, float, float] | str, motion: str, effort_unit: str) -> str:
    """SI unit, as plain text, of a `dimension` of a rotary or prismatic `motion` whose efforts are in `effort_unit`.

    A drive without a known constant keeps its own unit: an inertia is then in ``V*s^2/rad``, never silently in kg.
    """
    if isinstance(dimension, str):
        return dimension
    q = COORDINATE_UNITS[motion]
    si = (effort_unit, q) in (("N*m", "rad"), ("N", "m"))
    if si and dimension == (1, -1, 2):
        return "kg*m^2" if q == "rad" else "kg"
    if si and dimension == (1, 1, 0):
        return "J"
    powers = list(zip((effort_unit, "s", q), (dimension[0], dimension[2], dimension[1]), strict=True))
    above = [_power(base, power) for base, power in powers if power > 0]
    under = [_power(base, -power) for base, power in powers if power < 0]
    below = under[0] if len(under) == 1 and "*" not in under[0] else f"({'*'.join(under)})"
    return "*".join(above or ["1"]) + (f"/{below}" if under else "")


def _power(base: str, power: float) -> str:
    return base if power == 1 else f"{base}^{power:g}"


def fields_from_core(rows: list[dict]) -> tuple[Field, ...]:
    """Fields of what the core says, in the order of its arrays."""
    return tuple(Field(**row | {"resists": Resists(*row["resists"]) if "resists" in row else None}) for row in rows)


@cache
def model_fields(model: str) -> tuple[Field, ...]:
    """Fields of a model of the core, by the name that `_core.model_fields` has for it."""
    return fields_from_core(_core.model_fields()[model])


def friction_coefficients(fields: Iterable[Field], values: Mapping[str, float]) -> dict[tuple[float, float], float]:
    """Return the most that friction resists by: coefficients by the powers of speed and load that they multiply.

    The core sums them: of numbers that act in one direction each the larger counts; all others add up. `values` by
    name, SI; names that are no friction are passed over.
    """
    roles, names = _friction_roles(fields, values)
    sums = _core.resistance_coefficients(roles, np.array([values[name] for name in names], float))
    return {(speed, load): coefficient for speed, load, coefficient in sums}


def largest_friction(
    fields: Iterable[Field],
    values: Mapping[str, np.ndarray | float],
    speed: np.ndarray | float,
    load: np.ndarray | float,
) -> np.ndarray | float:
    """Return the most that friction resists by at a `speed` [rad/s or m/s] under a `load` [effort], in that unit.

    The core sums it, as in `friction_coefficients`, for one joint or for arrays of joints.
    """
    roles, names = _friction_roles(fields, values)
    *coefficients, speed, load = np.broadcast_arrays(*(values[name] for name in names), speed, load)
    columns = np.reshape(coefficients, (len(names), speed.size)).astype(float)
    most = _core.max_resistance(roles, columns, speed.ravel().astype(float), load.ravel().astype(float))
    return most.reshape(speed.shape) if speed.ndim else float(most[0])


def _friction_roles(fields: Iterable[Field], values: Mapping) -> tuple[np.ndarray, list[str]]:
    """Return the roles, (k, 3), and the names of the coefficients of friction among `values`."""
    friction = [(each.name, each.resists) for each in fields if each.resists is not None and each.name in values]
    roles = [(resists.speed, resists.load, resists.one_way) for _, resists in friction]
    return np.array(roles, float).reshape(-1, 3), [name for name, _ in friction]
