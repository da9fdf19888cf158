r"""What a strap may be: Kelvin and Voigt's spring and damper, and any of four things that straps do besides.

Every strap is the core's (``include/pellucid/strap.hpp``), so that one grammar names them all: a model is the features
that it has, and each feature frees parameters that are 0 without it. With a dashpot behind a second spring it is the
standard linear solid. How askew it sits is no property of the strap, but without it the rest comes out wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ... import _core

NAMES: tuple[str, ...] = tuple(_core.STRAP_PARAMETER_NAMES)


@dataclass(frozen=True)
class Coefficient:
    """A number of a strap, and how it is searched for: as it is, as a curvature, or by its logarithm."""

    name: str
    field: str  # Of the core
    unit: str
    start: float  # Where there is next to nothing of its feature; a share of the stiffness where `per_stiffness`
    lower: float
    upper: float
    per_stiffness: bool = False
    searched: Literal["plain", "curvature", "logarithm"] = "plain"
    spread: float = float("inf")  # Of what straps do, about the start, as it is searched for

    def sought(self, value: float) -> float:
        """What is searched for."""
        return float(np.log(value)) if self.searched == "logarithm" else float(value)

    def value(self, sought: float) -> float:
        """Of what is searched for."""
        return float(np.exp(sought)) if self.searched == "logarithm" else float(sought)

    def core(self, value: float) -> float:
        """What the core calls it."""
        return value**-0.5 if self.searched == "curvature" else value

    def slope(self, value: float) -> float:
        """Of the core's number by what is searched for."""
        if self.searched == "curvature":
            return -0.5 * value**-1.5
        return value if self.searched == "logarithm" else 1.0


STIFFNESS = Coefficient("stiffness", "strap_stiffness", "N*m/rad", 1.0, 1e-3, 1e5)
DAMPING = Coefficient("damping", "strap_damping", "N*m*s/rad", 1.0, 1e-4, 1e4)
FEATURES: Mapping[str, tuple[Coefficient, ...]] = {
    "hardening": (Coefficient("hardening", "strap_hardening", "1/rad^2", 1.0, 1e-4, 1e4, searched="curvature"),),
    "slack": (Coefficient("slack", "strap_slack", "rad", 1e-3, 1e-6, 0.5),),
    "relaxing": (
        Coefficient("relaxing_stiffness", "strap_relaxing_stiffness", "N*m/rad", 0.1, 1e-4, 1e5, per_stiffness=True),
        Coefficient("relaxation_time", "strap_relaxation_time", "s", 0.4, 0.02, 10.0, searched="logarithm", spread=1.2),
    ),
    "askew": (
        Coefficient("along", "strap_along", "1", 0.0, -0.5, 0.5, spread=0.15),
        Coefficient("across", "strap_across", "1", 0.0, -0.5, 0.5, spread=0.15),
    ),
}
"""What straps do besides, and the parameters that it takes."""
DOES: Mapping[str, str] = {
    "hardening": "hardens",
    "slack": "has slack",
    "relaxing": "relaxes (a standard linear solid)",
    "askew": "sits askew of the joint's axis",
}
PLAIN = "kelvin_voigt"


@dataclass(frozen=True)
class StrapModel:
    """A spring and a damper with some features, in the order of `FEATURES`."""

    features: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """As ids and cards have it."""
        return "_".join(self.features) or PLAIN

    @classmethod
    def named(cls, name: str) -> StrapModel:
        """By its name."""
        return cls(() if name == PLAIN else tuple(name.split("_")))

    @property
    def words(self) -> str:
        """For a sentence."""
        does = [DOES[f] for f in self.features]
        if not does:
            return "a spring and a damper hold it all"
        return f"it {' and '.join(filter(None, [', '.join(does[:-1]), does[-1]]))}"

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """What is free."""
        return (STIFFNESS, DAMPING, *(c for f in self.features for c in FEATURES[f]))

    def has(self, feature: str) -> bool:
        """Whether it does this."""
        return feature in self.features

    def without(self, feature: str) -> StrapModel:
        """The same but for one feature."""
        return StrapModel(tuple(f for f in self.features if f != feature))

    def core(self, values: Mapping[str, float]) -> np.ndarray:
        """The core's parameters, (p,), of values by coefficient; what is not free is 0."""
        made = dict.fromkeys(NAMES, 0.0) | {c.field: c.core(values[c.name]) for c in self.coefficients}
        return np.array([made[name] for name in NAMES])


FULL = StrapModel(tuple(FEATURES))
KELVIN_VOIGT = StrapModel()
