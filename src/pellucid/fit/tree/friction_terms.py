"""What rubs at each joint, term by term: the columns that efforts are linear in, and the core's numbers for them.

A family is a tuple of terms; `PLAIN` is what every joint has. The load that a load term takes is what bodies, rotors
and motors' inertias need, the core's y (theory, sections 2 and 20): friction is alpha |y| sign(v). Terms of a motor
that turns with several joints begin with ``motor_`` and stand in the family of the joint with the motor's number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ... import _core
from ..._errors import IdentificationError

PLAIN = ("viscous", "coulomb", "offset")
"""Terms of every joint."""
SHARED = ("motor_viscous", "motor_coulomb")
"""Terms that a motor has besides where it turns with several joints."""
RICHER = ("load", "square_root", "stribeck", "directional")
"""Terms that a joint may have besides, plainest first."""
RICHER_SHARED = ("motor_square_root",)

MOST_LOAD = 0.9
"""Of a load coefficient: with more, what drives backwards would never move."""

Column = Callable[[np.ndarray, float, float], np.ndarray]


@dataclass(frozen=True)
class Number:
    """A coefficient of friction: its column of velocities, (n,), of the width of the smooth sign and of a Stribeck
    speed; what one unit of it is; the range that is physical."""

    column: Column
    unit: tuple[str, str]  # Of a rotary and of a prismatic joint
    lower: float = 0.0
    upper: float = np.inf


def direction(velocity: np.ndarray, width: float = 0.0) -> np.ndarray:
    """The sign of a velocity; smooth, tanh(v / w), with a width w [rad/s; m/s]."""
    return np.tanh(velocity / width) if width > 0.0 else np.sign(velocity)


def signed_root(velocity: np.ndarray, width: float = 0.0) -> np.ndarray:
    """sqrt|v| sign v; smooth, v / (v^2 + w^2)^(1/4), with a width w."""
    return velocity / np.maximum(velocity**2 + width**2, 1e-36) ** 0.25


EFFORT, VISCOUS = ("N*m", "N"), ("N*m*s/rad", "N*s/m")
ROOT = ("N*m*s^0.5/rad^0.5", "N*s^0.5/m^0.5")
INERTIA = ("kg*m^2", "kg")

NUMBERS: Mapping[str, Number] = {
    "viscous": Number(lambda v, w, _: v, VISCOUS),
    "viscous_positive": Number(lambda v, w, _: np.maximum(v, 0.0), VISCOUS),
    "viscous_negative": Number(lambda v, w, _: np.minimum(v, 0.0), VISCOUS),
    "coulomb": Number(lambda v, w, _: direction(v, w), EFFORT),
    "offset": Number(lambda v, w, _: np.ones_like(v), EFFORT, lower=-np.inf),
    "square_root": Number(lambda v, w, _: signed_root(v, w), ROOT),
    "stribeck": Number(lambda v, w, speed: np.exp(-((v / speed) ** 2)) * direction(v, w), EFFORT),
    "load": Number(lambda v, w, _: direction(v, w), ("1", "1"), upper=MOST_LOAD),
}  # The load's column is |y| times this one
TERMS: Mapping[str, tuple[str, ...]] = {
    **{name: (name,) for name in ("viscous", "coulomb", "offset", "square_root", "stribeck", "load")},
    "directional": ("viscous_positive", "viscous_negative"),
}
"""Linear coefficients of each term; ``directional`` takes the place of ``viscous``."""
SPEED = "stribeck_velocity"
MOTOR = "motor_"


def numbers_of(family: Sequence[str], of_motor: bool = False) -> tuple[str, ...]:
    """Linear coefficients of a family's terms: of the joint, or of the motor it shares, without ``motor_``."""
    terms = [t.removeprefix(MOTOR) for t in family if t.startswith(MOTOR) == of_motor]
    if "directional" in terms:
        terms = [t for t in terms if t != "viscous"]
    for term in terms:
        if term not in TERMS or (of_motor and term in ("offset", "load")):
            known = ", ".join((*TERMS, *SHARED, *RICHER_SHARED))
            name = f"{MOTOR}{term}" if of_motor else term
            raise IdentificationError(f"found friction term {name!r}, expected some of {known}")
    return tuple(name for term in terms for name in TERMS[term])


def check_families(families: Sequence[Sequence[str]], joints: Sequence[str], shared: Sequence[int]) -> None:
    """Refuse families, (m,), that do not fit the joints, or that give a motor terms that it does not have."""
    if len(families) != len(joints):
        raise IdentificationError(
            f"found {len(families)} friction families, expected one for each of {len(joints)} joints"
        )
    for k, family in enumerate(families):
        numbers_of(family), numbers_of(family, True)
        if k not in shared and any(term.startswith(MOTOR) for term in family):
            raise IdentificationError(
                f"joint {joints[k]!r}: found terms of a motor that turns with several joints, expected none: its motor "
                "turns with it alone"
            )


def plain_families(joints: int, shared: Sequence[int]) -> tuple[tuple[str, ...], ...]:
    """What every joint has, and shared motors too."""
    return tuple(PLAIN + SHARED if k in shared else PLAIN for k in range(joints))


def friction(
    numbers: Mapping[str, float], velocity: np.ndarray, load: np.ndarray | None, width: float = 0.0
) -> np.ndarray:
    """Friction of named coefficients at velocities, and loads, of shape (n,)."""
    total = np.zeros_like(velocity)
    for name, value in numbers.items():
        if name != SPEED:
            column = NUMBERS[name].column(velocity, width, numbers.get(SPEED, np.nan))
            total += value * column * (np.abs(load) if name == "load" else 1.0)
    return total


def core_row(numbers: Mapping[str, float], names: Sequence[str], width: float, who: str) -> np.ndarray:
    """The core's numbers `names` of one joint, or motor, with these coefficients."""
    both = {"coulomb": ("coulomb_positive", "coulomb_negative"), "viscous": ("viscous_positive", "viscous_negative"),
            "load": ("load_motoring", "load_generating")}  # fmt: skip
    row = np.zeros(len(names))
    for name, value in {**numbers, "velocity_width": width}.items():
        for part in both.get(name, (name,)):
            if part not in names:
                raise IdentificationError(f"{who}: the core has no friction term {part!r}")
            row[names.index(part)] = value
    return row


def joint_row(numbers: Mapping[str, float], width: float, who: str) -> np.ndarray:
    """Of a joint, in the order of `_core.TREE_JOINT_PARAMETER_NAMES`."""
    return core_row(numbers, _core.TREE_JOINT_PARAMETER_NAMES, width, who)


def motor_row(numbers: Mapping[str, float], inertia: float, width: float, who: str) -> np.ndarray:
    """Of a motor that joints share, in the order of `_core.TREE_MOTOR_PARAMETER_NAMES`."""
    return core_row({**numbers, "motor_inertia": inertia}, _core.TREE_MOTOR_PARAMETER_NAMES, width, who)
