"""Find what each domain offers to the rest of Pellucid: a folder with a `domain.py`, such as `joint/` or `emg/`.

A `domain.py` holds references and imports nothing of its domain, so that none of it is loaded before it is used:

``PROCEDURE_ENTRIES``
    Procedures that a study may ask for: objects of `study.procedures.procedure.ProcedureEntry`.
``ARRAY_FUNCTIONS``
    Functions that a command calls if it is given arrays instead of a study, by the command's name.
``EXPORTER_CLASSES``
    Products that `export` writes: objects of `study.exporter.Exporter`.
``PARAMETER_DRAWINGS``
    The function that draws the parameters of any fit, whatever domain it is of.
``TORQUE_EVALUATIONS``
    Evaluations of `calibrate` for studies whose torque comes from another domain's procedure: objects of
    `emg.study.emg_torque.trial_sources.TorqueEvaluation`.
``LOG_CHECKS``
    Functions that check the columns of a log of the domain's kind: a `files.log.Log` in, `files.log.LogFinding` objects
    out. Their findings on a channel replace those of the general checks.
``LOGS_CHECKS``
    Functions that tell what depends on all logs that are audited: a sequence of `files.log.Log` in, a list of
    `files.log.LogFinding` objects for each out.
``WORN_BODIES``
    Functions that build, from model cards, the body with which a wearer's torque is computed, as
    `emg.study.emg_torque.trial_sources.WornBody`.

References are relative to the domain: ``"fit.joint_estimate:JointEstimate"``.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from ._errors import PellucidError

DOMAIN_NAMES = ("arm", "controllers", "emg", "joint", "orthosis", "people")
"""Folders of domains. Each may be missing; a function that needs it then raises an error."""


@cache
def find_domains() -> tuple[ModuleType, ...]:
    """Return the `domain.py` of every domain whose folder is there, by name."""
    package = import_module(__package__)
    names = sorted(each.name for each in iter_modules(package.__path__) if each.ispkg)
    folders = [Path(folder) for folder in package.__path__]
    found = [name for name in names if any((folder / name / "domain.py").is_file() for folder in folders)]
    return tuple(import_module(f"{__package__}.{name}.domain") for name in found)


@cache
def offered(kind: str) -> tuple[Any, ...]:
    """Return all objects of a kind that domains offer as a sequence of references.

    Objects that need a missing domain are excluded.
    """
    found = []
    for domain in find_domains():
        for reference in getattr(domain, kind, ()):
            try:
                found.append(_load(domain, reference))
            except ModuleNotFoundError as error:
                if missing_domain(error) is None:
                    raise
    return tuple(found)


def missing_domain(error: ModuleNotFoundError) -> str | None:
    """Return the domain that an installation lacks, if this is why a module was not found."""
    package, _, module = (error.name or "").partition(".")
    name = module.partition(".")[0]
    there = {domain.__name__.split(".")[-2] for domain in find_domains()}
    return name if package == __package__ and name in DOMAIN_NAMES and name not in there else None


def array_function(command: str) -> Any:
    """Return the function that a command calls with arrays.

    Raises
    ------
    PellucidError
        If no domain offers one.
    """
    for domain in find_domains():
        functions = getattr(domain, "ARRAY_FUNCTIONS", {})
        if command in functions:
            return _load(domain, functions[command])
    names = ", ".join(domain.__name__.split(".")[-2] for domain in find_domains())
    raise PellucidError(f"pellucid.{command}: found no such function in the domains {names}, expected one")


def load_reference(package: str, reference: str) -> Any:
    """Return what a reference names, imported now: ``"module:attribute"``, or a module, relative to `package`."""
    module, _, attribute = reference.partition(":")
    found = import_module(f".{module}", package)
    return getattr(found, attribute) if attribute else found


def _load(domain: ModuleType, reference: str) -> Any:
    """Return what a reference of a domain names."""
    return load_reference(domain.__name__.rpartition(".")[0], reference)
