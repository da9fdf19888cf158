"""Friction terms and parallel spring of a joint: their regressor columns, and the core's parameters for them.

A family is a tuple of terms; every joint has at least those of `PLAIN_TERMS`. A load term makes friction alpha |y|
sign(v), with y the load that bodies, rotors and motor inertias need. Terms of a motor that turns with several joints
begin with ``motor_`` and belong to the family of the joint with the motor's number.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.friction_terms import (
    COULOMB_FRICTION,
    DIRECTIONAL_FEATURE,
    LOAD_FEATURE,
    LOAD_FRICTION,
    SQUARE_ROOT,
    STRIBECK_FRICTION,
    STRIBECK_VELOCITY,
    VISCOUS_FRICTION,
    VISCOUS_NEGATIVE,
    VISCOUS_POSITIVE,
    FrictionTerm,
    grows_with_load,
)
from ...models.joint import PARALLEL_STIFFNESS
from ..tree_motion import TreeMotion

PLAIN_TERMS = ("viscous", "coulomb", "offset")
"""Friction terms of every joint."""

SHARED_MOTOR_TERMS = ("motor_viscous", "motor_coulomb")
"""Additional friction terms of a motor that turns with several joints."""

FURTHER_TERMS = ("load", "square_root", "stribeck", "directional")
"""Further terms that a joint may have, the plainest first."""

FURTHER_MOTOR_TERMS = ("motor_square_root",)
"""Further terms that a motor may have if it turns with several joints."""

MAX_LOAD_COEFFICIENT = 0.9
"""Upper bound of a load coefficient. With a larger one the joint could hardly be driven backwards."""

Column = Callable[[np.ndarray, float, float], np.ndarray]
"""A function from velocities, (n,), the width of the smooth sign and a Stribeck speed to a column, (n,)."""


@dataclass(frozen=True)
class FrictionCoefficient:
    """A friction coefficient: its regressor column, unit and bounds."""

    column: Column  # friction per unit of the coefficient
    unit: tuple[str, str]  # unit for a rotary and for a prismatic joint
    lower: float = 0.0  # smallest physical value
    upper: float = np.inf  # largest physical value
    targets: tuple[str, ...] = ()  # numbers of the core that take its value; empty: the one of the same name
    grows_with_load: bool = False  # whether its column is multiplied by |y| where it is used
    is_linear: bool = False  # whether a filter of the speed, or position, is a filter of the column
    of_position: bool = False  # whether the column is one of the position, and no friction

    @classmethod
    def from_term(
        cls, term: FrictionTerm, column: Column, *, upper: float = np.inf, is_linear: bool = False
    ) -> FrictionCoefficient:
        """Return the coefficient of a term of the catalogue, with its unit, its numbers and what it resists by."""
        unit = term.unit("rotary", "N*m"), term.unit("prismatic", "N")
        grows = grows_with_load(term.name)
        return cls(column, unit, upper=upper, targets=term.targets, grows_with_load=grows, is_linear=is_linear)

    def rows(self, motion: TreeMotion, turn: np.ndarray, width: float, speed: float) -> np.ndarray:
        """Return the column, (n,), of the speed velocity @ `turn` of a motion, or of its position @ `turn`, filtered as
        its effort is."""
        if self.is_linear:
            signal = motion.position if self.of_position else motion.velocity
            return self.column(signal @ turn, width, speed)
        return motion.friction(lambda v: self.column(v, width, speed), turn)


def smooth_sign(velocity: np.ndarray, width: float = 0.0) -> np.ndarray:
    """Return the sign of a velocity, or the smooth sign tanh(v / w) with a width w [rad/s; m/s]."""
    return np.tanh(velocity / width) if width > 0.0 else np.sign(velocity)


def signed_root(velocity: np.ndarray, width: float = 0.0) -> np.ndarray:
    """Return sqrt|v| sign v, or the smooth v / (v^2 + w^2)^(1/4) with a width w [rad/s; m/s]."""
    return velocity / np.maximum(velocity**2 + width**2, 1e-36) ** 0.25


EFFORT_UNITS = ("N*m", "N")
"""Units of effort, for a rotary and a prismatic joint."""

STIFFNESS_UNITS = ("N*m/rad", "N/m")
"""Units of the stiffness of a spring in parallel with a joint's drive, for a rotary and a prismatic joint."""

ROTOR_INERTIA_UNITS = ("kg*m^2", "kg")
"""Units of a rotor inertia, for a rotary and a prismatic joint."""

FRICTION_COEFFICIENTS: Mapping[str, FrictionCoefficient] = {
    VISCOUS_FRICTION.name: FrictionCoefficient.from_term(VISCOUS_FRICTION, lambda v, w, _: v, is_linear=True),
    VISCOUS_POSITIVE.name: FrictionCoefficient.from_term(VISCOUS_POSITIVE, lambda v, w, _: np.maximum(v, 0.0)),
    VISCOUS_NEGATIVE.name: FrictionCoefficient.from_term(VISCOUS_NEGATIVE, lambda v, w, _: np.minimum(v, 0.0)),
    COULOMB_FRICTION.name: FrictionCoefficient.from_term(COULOMB_FRICTION, lambda v, w, _: smooth_sign(v, w)),
    "offset": FrictionCoefficient(lambda v, w, _: np.ones_like(v), EFFORT_UNITS, lower=-np.inf, is_linear=True),
    SQUARE_ROOT.name: FrictionCoefficient.from_term(SQUARE_ROOT, lambda v, w, _: signed_root(v, w)),
    STRIBECK_FRICTION.name: FrictionCoefficient.from_term(
        STRIBECK_FRICTION, lambda v, w, speed: np.exp(-((v / speed) ** 2)) * smooth_sign(v, w)
    ),
    LOAD_FEATURE: FrictionCoefficient.from_term(
        LOAD_FRICTION, lambda v, w, _: smooth_sign(v, w), upper=MAX_LOAD_COEFFICIENT
    ),
    PARALLEL_STIFFNESS: FrictionCoefficient(
        lambda q, w, _: q, STIFFNESS_UNITS, lower=-np.inf, is_linear=True, of_position=True
    ),
}
"""Coefficients of a joint by name. The column of ``load`` is multiplied by |y| where it is used."""

TERM_COEFFICIENTS: Mapping[str, tuple[str, ...]] = {
    **{name: (name,) for name in FRICTION_COEFFICIENTS if name not in VISCOUS_FRICTION.targets},
    DIRECTIONAL_FEATURE: VISCOUS_FRICTION.targets,
}
"""Linear coefficients of each term; ``directional`` replaces ``viscous``."""

STRIBECK_VELOCITY_NAME = STRIBECK_VELOCITY.name
"""Name of the Stribeck velocity, the only friction parameter that is not linear."""

MOTOR_PREFIX = "motor_"
"""Prefix of terms and parameters of a motor that turns with several joints."""


def coefficient_names(family: Sequence[str], of_motor: bool = False) -> tuple[str, ...]:
    """Return the linear coefficients of a family's terms, those of the joint or of its motor, without ``motor_``."""
    terms = [t.removeprefix(MOTOR_PREFIX) for t in family if t.startswith(MOTOR_PREFIX) == of_motor]
    if DIRECTIONAL_FEATURE in terms:
        terms = [t for t in terms if t != VISCOUS_FRICTION.name]
    for term in terms:
        if term not in TERM_COEFFICIENTS or (of_motor and term in ("offset", LOAD_FEATURE, PARALLEL_STIFFNESS)):
            known = ", ".join((*TERM_COEFFICIENTS, *SHARED_MOTOR_TERMS, *FURTHER_MOTOR_TERMS))
            name = f"{MOTOR_PREFIX}{term}" if of_motor else term
            raise IdentificationError(f"found friction term {name!r}, expected some of {known}")
    return tuple(name for term in terms for name in TERM_COEFFICIENTS[term])


def check_families(families: Sequence[Sequence[str]], joints: Sequence[str], shared: Sequence[int]) -> None:
    """Refuse families, (m,), that do not match the joints, or give a motor terms that it cannot have."""
    if len(families) != len(joints):
        raise IdentificationError(
            f"found {len(families)} friction families, expected one for each of {len(joints)} joints"
        )
    for k, family in enumerate(families):
        coefficient_names(family), coefficient_names(family, True)
        if k not in shared and any(term.startswith(MOTOR_PREFIX) for term in family):
            raise IdentificationError(
                f"joint {joints[k]!r}: found terms of a motor that is coupled to several joints, expected none: its "
                "motor drives only this joint"
            )


def plain_families(joints: int, shared: Sequence[int], sprung: Collection[int] = ()) -> tuple[tuple[str, ...], ...]:
    """Return the plain friction terms of every joint, those of shared motors, and the springs of `sprung` joints."""
    return tuple(
        PLAIN_TERMS + SHARED_MOTOR_TERMS * (k in shared) + (PARALLEL_STIFFNESS,) * (k in sprung) for k in range(joints)
    )


def sum_friction(
    numbers: Mapping[str, float], velocity: np.ndarray, load: np.ndarray | None, width: float = 0.0
) -> np.ndarray:
    """Return the friction, (n,), of named coefficients at velocities and loads of shape (n,)."""
    return _sum_columns(numbers, lambda each, speed: each.column(velocity, width, speed), load, len(velocity))


def sum_filtered_friction(
    numbers: Mapping[str, float], motion: TreeMotion, turn: np.ndarray, load: np.ndarray | None, width: float = 0.0
) -> np.ndarray:
    """Return the friction, (n,), of named coefficients at the speed velocity @ `turn`, filtered as the effort is.

    `load` has the rows of the `motion`, (n,).
    """
    return _sum_columns(numbers, lambda each, speed: each.rows(motion, turn, width, speed), load, len(motion))


def _sum_columns(
    numbers: Mapping[str, float],
    column: Callable[[FrictionCoefficient, float], np.ndarray],
    load: np.ndarray | None,
    count: int,
) -> np.ndarray:
    """Return the sum, (count,), of friction coefficients times their columns, made for each Stribeck velocity."""
    total: np.ndarray = np.zeros(count)
    for name, value in numbers.items():
        if name == STRIBECK_VELOCITY_NAME or FRICTION_COEFFICIENTS[name].of_position:
            continue
        coefficient = FRICTION_COEFFICIENTS[name]
        part = value * column(coefficient, numbers.get(STRIBECK_VELOCITY_NAME, np.nan))
        if coefficient.grows_with_load:
            if load is None:
                raise ValueError(f"{name}: found no load, expected one value for each velocity")
            part = part * np.abs(load)
        total += part
    return total


def core_parameters(numbers: Mapping[str, float], names: Sequence[str], width: float, who: str) -> np.ndarray:
    """Return the core's parameters `names` of one joint or motor with these coefficients; `who` begins messages."""
    targets = {name: each.targets for name, each in FRICTION_COEFFICIENTS.items() if each.targets}
    row = np.zeros(len(names))
    for name, value in {**numbers, "velocity_width": width}.items():
        for part in targets.get(name, (name,)):
            if part not in names:
                raise IdentificationError(
                    f"{who}: found the friction term {part!r}, expected one of the core's: {', '.join(names)}"
                )
            row[names.index(part)] = value
    return row


def joint_core_parameters(numbers: Mapping[str, float], width: float, who: str) -> np.ndarray:
    """Return the core's parameters of a joint, in the order of `_core.TREE_JOINT_PARAMETER_NAMES`.

    They contain no parallel spring.
    """
    numbers = {name: value for name, value in numbers.items() if name != PARALLEL_STIFFNESS}
    return core_parameters(numbers, _core.TREE_JOINT_PARAMETER_NAMES, width, who)


def motor_core_parameters(numbers: Mapping[str, float], inertia: float, width: float, who: str) -> np.ndarray:
    """Return the core's parameters of a shared motor, in the order of `_core.TREE_MOTOR_PARAMETER_NAMES`."""
    return core_parameters({**numbers, "motor_inertia": inertia}, _core.TREE_MOTOR_PARAMETER_NAMES, width, who)
