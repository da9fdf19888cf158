"""Every estimator by its name: a module of this package with a mapping ``FAMILIES`` adds its own."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from ..._errors import IdentificationError
from .family import Family


def _discovered() -> dict[str, Family]:
    found: dict[str, Family] = {}
    for info in iter_modules([str(Path(__file__).parent)]):
        found |= getattr(import_module(f".{info.name}", __name__), "FAMILIES", {})
    return dict(sorted(found.items(), key=lambda each: (each[1].rank, each[0])))


ESTIMATORS = _discovered()
"""Name to family, in the order of tables."""


def family_of(name: str) -> tuple[str, Family]:
    """The name under which rows have an estimator, and its family."""
    for own, family in ESTIMATORS.items():
        if name in (own, *family.aliases):
            return own, family
    raise IdentificationError(f"torque: found the estimator {name!r}, expected one of {', '.join(ESTIMATORS)}")
