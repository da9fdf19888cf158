r"""Models of a strap: a spring and a damper in parallel (Kelvin-Voigt), with up to six additional features.

The core computes every strap (``include/pellucid/strap.hpp``). A model is a set of features; each feature frees
parameters that are 0 without it. A second spring in series with a dashpot makes the strap a standard linear solid. A
strap rubs if dry friction acts beside the spring; its cloth bends over a way before it slips. Soft tissue in series is
compressed less and less by a growing torque. Tissue that is a linear spring, with or without a damper, cannot be told
from a standard linear solid, which has the same response. The strap's misalignment with the joint's axis is no property
of the strap, but the other parameters are biased without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ... import _core

CORE_NAMES: tuple[str, ...] = tuple(_core.STRAP_PARAMETER_NAMES)
"""Names of the core's strap parameters, in its order."""

CONTACT_NAMES: tuple[str, ...] = tuple(_core.STRAP_CONTACT_NAMES)
"""Names of the core's parameters of what rubs beside a strap and gives in series with it, in its order."""


@dataclass(frozen=True)
class Coefficient:
    """A free parameter of a strap, with the scale on which the search treats it."""

    name: str
    field: str  # name of the parameter in the core
    unit: str
    start: float  # first value, at which the feature has almost no effect; a share of the stiffness if `per_stiffness`
    lower: float
    upper: float
    per_stiffness: bool = False
    searched: Literal["plain", "curvature", "logarithm"] = "plain"
    spread: float = float("inf")  # prior standard deviation around `start`, on the search's scale

    def sought(self, value: float) -> float:
        """Convert the parameter to the search's scale."""
        return float(np.log(value)) if self.searched == "logarithm" else float(value)

    def value(self, sought: float) -> float:
        """Convert a value on the search's scale to the parameter."""
        return float(np.exp(sought)) if self.searched == "logarithm" else float(sought)

    def core(self, value: float) -> float:
        """Convert the parameter to the core's parameter."""
        return value**-0.5 if self.searched == "curvature" else value

    def slope(self, value: float) -> float:
        """Return the derivative of the core's parameter with respect to the value on the search's scale."""
        if self.searched == "curvature":
            return -0.5 * value**-1.5
        return value if self.searched == "logarithm" else 1.0


STIFFNESS_COEFFICIENT = Coefficient("stiffness", "strap_stiffness", "N*m/rad", 1.0, 1e-3, 1e5)
"""The stiffness, which every strap has."""

DAMPING_COEFFICIENT = Coefficient("damping", "strap_damping", "N*m*s/rad", 1.0, 1e-4, 1e4)
"""The damping, which every strap has."""

STRAP_FEATURES: Mapping[str, tuple[Coefficient, ...]] = {
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
    "friction": (
        Coefficient("friction", "strap_friction", "N*m", 0.02, 1e-5, 50.0),
        Coefficient("friction_way", "strap_friction_way", "rad", 5e-3, 1e-4, 0.1, searched="logarithm", spread=1.2),
    ),
    "tissue": (
        Coefficient("tissue_depth", "strap_tissue_depth", "rad", 2e-3, 1e-6, 0.5),
        Coefficient("tissue_torque", "strap_tissue_torque", "N*m", 0.5, 0.01, 50.0, searched="logarithm", spread=1.2),
    ),
}
"""The features that a strap may have, each with the parameters that it frees."""

FEATURE_WORDS: Mapping[str, str] = {
    "hardening": "hardens",
    "slack": "has slack",
    "relaxing": "relaxes (a standard linear solid)",
    "askew": "sits askew of the joint's axis",
    "friction": "rubs (dry friction beside the spring)",
    "tissue": "pulls through soft tissue in series",
}
"""Each feature as the verb phrase of a sentence whose subject is the strap."""

PLAIN_NAME = "kelvin_voigt"
"""Name of the model without any feature, in ids and on cards."""


@dataclass(frozen=True)
class StrapModel:
    """A spring and a damper with additional features, in the order of `STRAP_FEATURES`."""

    features: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the model in ids and on cards."""
        return "_".join(self.features) or PLAIN_NAME

    @classmethod
    def named(cls, name: str) -> StrapModel:
        """Return the model with this name."""
        return cls(() if name == PLAIN_NAME else tuple(name.split("_")))

    @property
    def words(self) -> str:
        """The model as a clause of a sentence."""
        does = [FEATURE_WORDS[f] for f in self.features]
        if not does:
            return "a spring and a damper hold it all"
        return f"it {' and '.join(filter(None, [', '.join(does[:-1]), does[-1]]))}"

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """The free parameters: stiffness, damping, then those of the features."""
        return (STIFFNESS_COEFFICIENT, DAMPING_COEFFICIENT, *(c for f in self.features for c in STRAP_FEATURES[f]))

    def has(self, feature: str) -> bool:
        """Return whether the model has a feature."""
        return feature in self.features

    def without(self, feature: str) -> StrapModel:
        """Return the model without one of its features."""
        return StrapModel(tuple(f for f in self.features if f != feature))

    @property
    def in_core(self) -> bool:
        """Whether `core` is the whole model: neither friction nor tissue is among its parameters."""
        return not any(c.field in CONTACT_NAMES for c in self.coefficients)

    def core(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the core's parameters, shape (p,), from values by coefficient; parameters that are not free are 0."""
        made = dict.fromkeys(CORE_NAMES, 0.0) | {c.field: c.core(values[c.name]) for c in self.coefficients}
        return np.array([made[name] for name in CORE_NAMES])

    def contact(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the core's parameters of friction and tissue, shape (4,); parameters that are not free are 0."""
        made = dict.fromkeys(CONTACT_NAMES, 0.0) | {c.field: c.core(values[c.name]) for c in self.coefficients}
        return np.array([made[name] for name in CONTACT_NAMES])


FULL_MODEL = StrapModel(tuple(STRAP_FEATURES))
"""The model with all features."""

KELVIN_VOIGT = StrapModel()
"""The model without any feature: a spring and a damper in parallel."""
