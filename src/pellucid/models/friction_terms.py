"""Catalogue of friction terms and of the families that free them.

The core's ``friction.hpp`` gives the equation, the unit, the bounds and what each number resists by. A term adds what a
report says of it: words, why recordings may not show it, and what to record so that they do. Limits, supervisor,
carried friction, prior knowledge, pages and findings walk this catalogue or the core's roles, so that a new term is
complete with its header and one entry here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from .fields import Field, Resists, model_fields

CORE_FIELDS: Mapping[str, Field] = {field.name: field for field in model_fields("joint")}
"""Numbers of the core's joint by name, in the core's order."""

SYMMETRIC_FEATURE = "symmetric"
"""Feature of the terms that act alike in both directions; every family has these or the directional ones."""

DIRECTIONAL_FEATURE = "directional"
"""Feature of the terms that have a value for each direction."""

LOAD_FEATURE = "load"
"""Feature of friction with the load, with one coefficient for both directions of power."""

SEPARATE_LOAD_FEATURE = "separate load"
"""Feature that takes the place of `LOAD_FEATURE` where a known payload tells motoring from generating."""


@dataclass(frozen=True)
class FrictionTerm:
    """A reported coefficient of friction, or a number that shapes the curve of one."""

    name: str  # name in cards, reports, study.toml and ids of figures
    feature: str  # feature of a family that frees it
    words: str  # label on a page
    advice: str  # what to record so that it shows
    weak_because: str = "it never moves faster than {speed}"  # why recordings may not show it
    targets: tuple[str, ...] = ()  # numbers of the core that take its value; empty: the one of the same name
    linear: bool = True  # whether effort is proportional to it, all else held
    shapes: str = ""  # name of the term whose curve it shapes; empty: it scales a curve of its own

    def __post_init__(self):
        object.__setattr__(self, "targets", self.targets or (self.name,))

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """What the core says of its numbers."""
        return tuple(CORE_FIELDS[target] for target in self.targets)

    @property
    def resists(self) -> Resists | None:
        """What it resists by; None for a number that only shapes a curve."""
        return self.fields[0].resists

    def unit(self, motion: str = "rotary", effort_unit: str = "N*m") -> str:
        """SI unit, as plain text."""
        return self.fields[0].unit(motion, effort_unit)


@dataclass(frozen=True)
class FrictionFamily:
    """A friction model: the features that it adds to symmetric Coulomb and viscous friction."""

    name: str
    features: frozenset[str]
    words: str  # sentence on a page
    colour: str = "ink"  # role of `drawing.style.COLOURS`
    is_default: bool = True  # whether it is compared unless a study names families


_SEVERAL_SPEEDS = "Record at several speeds, up to fast ones."
_SLOW_AND_FAST = "Record slow motions as well as fast ones, in both directions."
_SLOW_REVERSALS = "Record slow reversals, so that the joint is often just above zero speed."
_KNOWN_MASS = "Record with and without a known mass attached, or over a wider range of angles."
_HIDDEN_LEVEL = "the other friction terms explain its effect"
_RARELY_SLOW = "it spends too little time just above zero speed"
_SAME_LOAD = "the load hardly changes"

VISCOUS_FRICTION = FrictionTerm(
    "viscous", SYMMETRIC_FEATURE, "Viscous friction", _SEVERAL_SPEEDS, targets=("viscous_positive", "viscous_negative")
)
COULOMB_FRICTION = FrictionTerm(
    "coulomb",
    SYMMETRIC_FEATURE,
    "Coulomb friction",
    _SLOW_AND_FAST,
    _HIDDEN_LEVEL,
    ("coulomb_positive", "coulomb_negative"),
)
VISCOUS_POSITIVE = FrictionTerm(
    "viscous_positive", DIRECTIONAL_FEATURE, "Viscous friction, + direction", _SEVERAL_SPEEDS
)
COULOMB_POSITIVE = FrictionTerm(
    "coulomb_positive", DIRECTIONAL_FEATURE, "Coulomb friction, + direction", _SLOW_AND_FAST, _HIDDEN_LEVEL
)
VISCOUS_NEGATIVE = FrictionTerm(
    "viscous_negative", DIRECTIONAL_FEATURE, "Viscous friction, \N{MINUS SIGN} direction", _SEVERAL_SPEEDS
)
COULOMB_NEGATIVE = FrictionTerm(
    "coulomb_negative", DIRECTIONAL_FEATURE, "Coulomb friction, \N{MINUS SIGN} direction", _SLOW_AND_FAST, _HIDDEN_LEVEL
)
STRIBECK_FRICTION = FrictionTerm("stribeck", "stribeck", "Stribeck friction", _SLOW_REVERSALS, _RARELY_SLOW)
STRIBECK_VELOCITY = FrictionTerm(
    "stribeck_velocity", "stribeck", "Stribeck velocity", _SLOW_REVERSALS, _RARELY_SLOW, linear=False, shapes="stribeck"
)
SQUARE_ROOT = FrictionTerm(
    "square_root", "root", "Friction with the root of speed", "Record at several speeds, from slow to fast ones."
)
# Without a known payload only the sum of the two coefficients shows: one value then drives both.
LOAD_FRICTION = FrictionTerm(
    "load_friction",
    LOAD_FEATURE,
    "Load friction",
    _KNOWN_MASS,
    _SAME_LOAD,
    ("load_motoring", "load_generating"),
    linear=False,
)
LOAD_MOTORING = FrictionTerm(
    "load_motoring", SEPARATE_LOAD_FEATURE, "Load friction, motoring", _KNOWN_MASS, _SAME_LOAD, linear=False
)
LOAD_GENERATING = FrictionTerm(
    "load_generating", SEPARATE_LOAD_FEATURE, "Load friction, generating", _KNOWN_MASS, _SAME_LOAD, linear=False
)

TERMS: tuple[FrictionTerm, ...] = (
    VISCOUS_FRICTION, COULOMB_FRICTION,
    VISCOUS_POSITIVE, COULOMB_POSITIVE, VISCOUS_NEGATIVE, COULOMB_NEGATIVE,
    STRIBECK_FRICTION, STRIBECK_VELOCITY,
    SQUARE_ROOT,
    LOAD_FRICTION, LOAD_MOTORING, LOAD_GENERATING,
)  # fmt: skip
"""Every term, in the order in which a family's covariance has those that it frees."""

TERMS_BY_NAME: Mapping[str, FrictionTerm] = {term.name: term for term in TERMS}

FRICTION_FAMILIES: tuple[FrictionFamily, ...] = (
    FrictionFamily("symmetric", frozenset(), "Coulomb and viscous friction, the same in both directions", "symmetric"),
    FrictionFamily(
        "directional",
        frozenset({DIRECTIONAL_FEATURE}),
        "Coulomb and viscous friction of its own in each direction",
        "directional",
    ),
    FrictionFamily("load", frozenset({LOAD_FEATURE}), "friction that grows with the load the joint carries", "load"),
    FrictionFamily(
        "stribeck",
        frozenset({"stribeck"}),
        "friction that falls with speed near standstill (Stribeck)",
        "stribeck",
    ),
    FrictionFamily(
        "combined",
        frozenset({DIRECTIONAL_FEATURE, LOAD_FEATURE, "stribeck"}),
        "direction, load and Stribeck effect together",
        "combined",
    ),
    # Few joints of one axis show the root of speed: it is not compared unless a study asks for it.
    FrictionFamily("root", frozenset({"root"}), "friction that also grows with the root of speed", is_default=False),
)
"""Every family, plainest first."""

FAMILIES_BY_NAME: Mapping[str, FrictionFamily] = {family.name: family for family in FRICTION_FAMILIES}


def freed_terms(features: frozenset[str], *, separate_load: bool = False) -> tuple[FrictionTerm, ...]:
    """Return the terms that a family with these features frees, in the catalogue's order.

    `separate_load` frees a coefficient for each direction of power instead of one for both.
    """
    freed = features | ({SYMMETRIC_FEATURE} if DIRECTIONAL_FEATURE not in features else set())
    if separate_load and LOAD_FEATURE in freed:
        freed = freed - {LOAD_FEATURE} | {SEPARATE_LOAD_FEATURE}
    return tuple(term for term in TERMS if term.feature in freed)


def features_of(names: Iterable[str]) -> frozenset[str]:
    """Return the features whose terms are among the `names` of parameters."""
    return frozenset(TERMS_BY_NAME[name].feature for name in names if name in TERMS_BY_NAME)


def shape_index(names: Sequence[str]) -> int | None:
    """Return the position, among `names` of parameters, of the one that shapes a friction curve; None without one."""
    return next((i for i, name in enumerate(names) if name in TERMS_BY_NAME and TERMS_BY_NAME[name].shapes), None)


def shaped_by(names: Iterable[str]) -> frozenset[str]:
    """Return the names of the terms whose curves are shaped by parameters among `names`."""
    return frozenset(TERMS_BY_NAME[name].shapes for name in names if name in TERMS_BY_NAME) - {""}


def grows_with_load(name: str) -> bool:
    """Whether a parameter is a coefficient of friction that grows with the load."""
    resists = TERMS_BY_NAME[name].resists if name in TERMS_BY_NAME else None
    return resists is not None and resists.load > 0.0


def is_friction(name: str) -> bool:
    """Whether a parameter is a coefficient of friction, in a report or in the core."""
    if name in TERMS_BY_NAME:
        return TERMS_BY_NAME[name].resists is not None
    return name in CORE_FIELDS and CORE_FIELDS[name].resists is not None
