"""Registry of all estimators by name. A module of this package adds its own in a mapping ``FAMILIES``.

Another package brings such a module as an entry point of ``pellucid.estimators``.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from ...._errors import IdentificationError, PluginError
from ...._plugins import load_plugins, require_attributes
from .family import Family


def _discover_families() -> dict[str, Family]:
    """Import every module of this package, and those of plug-ins; collect their families, the lowest rank first."""
    found: dict[str, Family] = {}
    for info in iter_modules([str(Path(__file__).parent)]):
        found |= getattr(import_module(f".{info.name}", __name__), "FAMILIES", {})
    for plugin in load_plugins("pellucid.estimators"):
        require_attributes(plugin, "pellucid.estimators", "FAMILIES")
        taken = {*found, *(alias for family in found.values() for alias in family.aliases)}
        for name, family in plugin.value.FAMILIES.items():
            if {name, *family.aliases} & taken:
                raise PluginError(
                    f"plug-in {plugin.name} of {plugin.distribution}: found an estimator {name!r}, expected a name "
                    "that no other estimator has"
                )
        found |= plugin.value.FAMILIES
    return dict(sorted(found.items(), key=lambda each: (each[1].rank, each[0])))


ESTIMATOR_FAMILIES = _discover_families()
"""Family of each estimator by name, in the order of tables."""

STACKED = "stacked"
"""Name of the weighted mean of estimators. It is no family of its own: `calibrate` makes it of the others."""

STACKED_FAMILY = Family("weighted mean of estimators", rank=0, short="weighted mean", colour="root")
"""What tables and figures say of the weighted mean."""


def named_family(name: str) -> Family:
    """Return the family of an estimator, or what stands for the weighted mean of several."""
    return STACKED_FAMILY if name == STACKED else ESTIMATOR_FAMILIES[name]


def find_family(name: str) -> tuple[str, Family]:
    """Return an estimator's own name and its family, given this name or an alias."""
    for own, family in ESTIMATOR_FAMILIES.items():
        if name in (own, *family.aliases):
            return own, family
    raise IdentificationError(f"torque: found the estimator {name!r}, expected one of {', '.join(ESTIMATOR_FAMILIES)}")
