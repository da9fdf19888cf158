"""Collect the findings on a result from a folder with one file for each finding."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from ...models.parameter import Verdict, rank_verdicts


def finders(folder: ModuleType) -> Iterator[tuple[str, ModuleType]]:
    """Yield the name and module of every finding: a module of the package `folder` with a function ``find(case)``."""
    for info in iter_modules(folder.__path__):
        module = import_module(f"{folder.__name__}.{info.name}")
        if hasattr(module, "find"):
            yield info.name, module


def collect_findings(folder: ModuleType, case: Any) -> tuple[Verdict, ...]:
    """Return the verdicts of all findings in a package on a `case`, worst first, each under its file's name."""
    named_verdicts = (
        replace(v, finding=v.finding or name) for name, module in finders(folder) for v in module.find(case)
    )
    return rank_verdicts(named_verdicts)
