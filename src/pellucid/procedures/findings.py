"""What is worth telling of a result: a folder of files, one for each finding, asked in turn and told worst first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from ..fit.parameter import Verdict, rank_verdicts


def finders(folder: ModuleType) -> Iterator[tuple[str, ModuleType]]:
    """Name and module of every finding: a module of the package `folder` with a function ``find(case)``."""
    for info in iter_modules(folder.__path__):
        module = import_module(f"{folder.__name__}.{info.name}")
        if hasattr(module, "find"):
            yield info.name, module


def findings_of(folder: ModuleType, case: Any) -> tuple[Verdict, ...]:
    """Everything that the findings of a package `folder` say of a `case`, worst first, each under its file's name."""
    told = (replace(v, finding=v.finding or name) for name, module in finders(folder) for v in module.find(case))
    return rank_verdicts(told)
