r"""Model of one joint: its parameters, their names, and the parameters that each friction family frees.

The physics itself is the core's (``include/pellucid/joint.hpp``, ``friction.hpp``):

.. math::
   y &= J\ddot q + g_s\sin q + g_c\cos q + k q \\
   \tau &= y + f(\dot q, y) + \tau_0

This file states only which of the core's parameters each family uses, and how printed names map to the core's flat
parameter vector. The core defines units and physical bounds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .._errors import IdentificationError
from .fields import COORDINATE_UNITS, Field
from .filtered_dynamics import LoadedMotion, filtered_effort, filtered_jacobian, filtered_rows
from .friction_terms import CORE_FIELDS, DIRECTIONAL_FEATURE, FRICTION_FAMILIES, TERMS, freed_terms, shape_index

PARAMETER_FIELDS: Mapping[str, Field] = CORE_FIELDS
"""What the core says of its parameters, in its order."""

NAMES: tuple[str, ...] = tuple(PARAMETER_FIELDS)
"""The core's parameters, in its order."""

PARAMETER_INDEX: Mapping[str, int] = {name: i for i, name in enumerate(NAMES)}
"""Position of each parameter in the core's vector."""


@dataclass(frozen=True)
class Symbol:
    """A reported parameter: the core's parameters it drives, and where it may lie."""

    name: str  # The name in model cards, reports and figure ids
    targets: tuple[str, ...]  # Core parameters that take this value (a symmetric Coulomb level drives both directions)
    linear: bool = True  # Whether effort is proportional to it, all else held

    @property
    def lower(self) -> float:
        """Physical bound, in SI (or per ampere, per volt): the tightest of its targets."""
        return max(PARAMETER_FIELDS[target].lower for target in self.targets)

    @property
    def upper(self) -> float:
        """Physical bound, in SI (or per ampere, per volt): the tightest of its targets."""
        return min(PARAMETER_FIELDS[target].upper for target in self.targets)

    def unit(self, motion: str = "rotary", effort_unit: str = "N*m") -> str:
        """SI unit, as plain text."""
        return PARAMETER_FIELDS[self.targets[0]].unit(motion, effort_unit)


NONLINEAR_PARAMETERS = frozenset({"velocity_width"} | {name for t in TERMS if not t.linear for name in t.targets})
"""Parameters of the core that effort is not proportional to."""

TIED_PARAMETERS: dict[str, tuple[str, ...]] = {"gravity": ("gravity_sine",)} | {
    term.name: term.targets for term in TERMS if term.targets != (term.name,)
}
"""Parameters that are reported under a name of their own."""

SYMBOLS_BY_NAME: Mapping[str, Symbol] = {
    name: Symbol(name, targets, not NONLINEAR_PARAMETERS & set(targets))
    for name, targets in ({name: (name,) for name in NAMES} | TIED_PARAMETERS).items()
}
"""Every parameter of the core as it is, and those that are tied."""

PARALLEL_STIFFNESS = "parallel_stiffness"
"""Name of the stiffness of a spring in parallel with the drive."""

MAX_STRIBECK_SHARE = 0.25
GRAVITY = 9.80665  # m/s^2

FAMILIES: Mapping[str, frozenset[str]] = {family.name: family.features for family in FRICTION_FAMILIES}
"""Friction families, as the features each adds to symmetric Coulomb and viscous friction."""

DEFAULT_FAMILIES: tuple[str, ...] = tuple(family.name for family in FRICTION_FAMILIES if family.is_default)
"""Families that are compared unless a study names families."""


UNITS: Mapping[str, Mapping[str, str]] = {
    motion: {"position": q, "velocity": f"{q}/s", "acceleration": f"{q}/s^2"} for motion, q in COORDINATE_UNITS.items()
}


@dataclass(frozen=True)
class JointModel:
    """A friction family of a joint: the free symbols, and the values that are known beforehand."""

    family: str  # One of `FAMILIES`
    symbols: tuple[Symbol, ...]  # Free parameters, in the order of every covariance and Jacobian
    motion: str  # motion, effort_unit: "rotary" or "prismatic"; "N*m", "N", "A" or "V"
    effort_unit: str
    known: Mapping[str, float] = field(default_factory=dict)  # Symbols fixed to a value, SI
    velocity_range: float = np.inf  # Largest speed the model is fitted on [rad/s or m/s]
    # `effort_unit` per SI unit of effort: 1 in SI, one over the drive constant per ampere or volt, 0 where that is not
    # known and payloads therefore count as part of the joint
    payload_scale: float = 1.0

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Physical lower and upper bounds of the free symbols, each shape (p,), SI.

        A Stribeck velocity above `MAX_STRIBECK_SHARE` of the speeds seen would bend the whole curve instead of its
        start, and could not be told from Coulomb and viscous friction.
        """
        lower = np.array([s.lower for s in self.symbols])
        upper = np.array([s.upper for s in self.symbols])
        if self.shape_index is not None:
            upper[self.shape_index] = MAX_STRIBECK_SHARE * self.velocity_range
        return lower, upper

    @property
    def shape_index(self) -> int | None:
        """Position of the free symbol that shapes a friction curve instead of scaling it; None without one."""
        return shape_index(self.names)

    @property
    def linear(self) -> bool:
        """Whether effort is linear in every free symbol."""
        return all(s.linear for s in self.symbols)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free symbols, in their order."""
        return tuple(s.name for s in self.symbols)

    def unit(self, name: str) -> str:
        """SI unit of a symbol, as plain text."""
        return SYMBOLS_BY_NAME[name].unit(self.motion, self.effort_unit)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"family '{self.family}'"

    def effort(self, values: np.ndarray, motion: LoadedMotion) -> np.ndarray:
        """Effort, (n,), of free `values`, (p,), and the motion's payload, filtered as the `motion`'s own was."""
        return filtered_effort(self.loaded(self.vector(values), *motion.payload), motion)

    def jacobian(self, values: np.ndarray, motion: LoadedMotion) -> tuple[np.ndarray, np.ndarray]:
        """The same, and its derivative by the free `values`, (n, p)."""
        return filtered_jacobian(self.loaded(self.vector(values), *motion.payload), self.selection(), motion)

    def rows(self, values: np.ndarray, motion: LoadedMotion) -> tuple[np.ndarray, np.ndarray]:
        """Effort, (m,), and derivative, (m, p), at the rows that a regression uses, sooner than by `jacobian`."""
        return filtered_rows(self.loaded(self.vector(values), *motion.payload), self.selection(), motion)

    def selection(self) -> np.ndarray:
        """Matrix S, shape (k, p), with core vector = S @ free values (+ known): chain rule for every Jacobian."""
        matrix = np.zeros((len(NAMES), len(self.symbols)))
        for j, symbol in enumerate(self.symbols):
            for target in symbol.targets:
                matrix[PARAMETER_INDEX[target], j] = 1.0
        return matrix

    def vector(self, values: np.ndarray, velocity_width: float = 0.0) -> np.ndarray:
        """The core's flat parameter vector, shape (k,), SI, for free `values`, shape (p,).

        `velocity_width` [rad/s or m/s] is the width of the smooth sign; 0 is the true sign.
        """
        vector = self.selection() @ np.asarray(values, float)
        for name, value in self.known.items():
            for target in SYMBOLS_BY_NAME[name].targets:
                vector[PARAMETER_INDEX[target]] = value
        vector[PARAMETER_INDEX["velocity_width"]] = velocity_width
        return vector

    def loaded(self, vector: np.ndarray, mass: float, distance: float) -> np.ndarray:
        """A core vector with a payload on the moving segment: its inertia and its gravity are known. `vector` (k,);
        `mass`, `distance` [kg], [m]; gives (k,)."""
        if not mass or not self.payload_scale:
            return vector
        vector = vector.copy()
        rotary = self.motion == "rotary"
        vector[PARAMETER_INDEX["inertia"]] += self.payload_scale * mass * (distance**2 if rotary else 1.0)
        vector[PARAMETER_INDEX["gravity_sine"]] += self.payload_scale * mass * distance * GRAVITY * rotary
        return vector


def joint_model(
    family: str,
    *,
    motion: str,
    effort_unit: str,
    gravity: str,
    known: Mapping[str, float] | None = None,
    separate_load: bool = False,
    velocity_range: float = np.inf,
    parallel_spring: bool = False,
) -> JointModel:
    """Return the model of a joint with a friction family, and with a spring in parallel with the drive if it has one.

    `velocity_range` [rad/s or m/s]."""
    if family not in FAMILIES:
        raise IdentificationError(f"unknown friction family {family!r}; known: {', '.join(FAMILIES)}")
    terms = {"none": [], "sine": ["gravity"], "sine+cosine": ["gravity", "gravity_cosine"]}
    if gravity not in terms:
        raise IdentificationError(f"gravity is {gravity!r}; expected one of {', '.join(terms)}")
    features = FAMILIES[family]
    plain = freed_terms(features & {DIRECTIONAL_FEATURE})
    # An offset and two Coulomb levels are collinear (their columns add up to 1): the offset goes.
    offset = [] if DIRECTIONAL_FEATURE in features else ["offset"]
    richer = [term for term in freed_terms(features, separate_load=separate_load) if term not in plain]
    spring = [PARALLEL_STIFFNESS] if parallel_spring else []
    names = ["inertia", *terms[gravity], *spring, *(t.name for t in plain), *offset, *(t.name for t in richer)]
    known = dict(known or {})
    symbols = tuple(SYMBOLS_BY_NAME[n] for n in names if n not in known)
    return JointModel(family, symbols, motion, effort_unit, known, velocity_range)
