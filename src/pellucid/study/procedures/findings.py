"""Collect the findings on a result from a module with one function for each finding."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from types import ModuleType
from typing import Any

from ...models.estimates import Verdict, rank_verdicts

FINDING_PREFIX = "report_"
"""Prefix of the functions that report a finding; what follows is the finding's name."""


def finders(module: ModuleType) -> Iterator[tuple[str, Callable[[Any], Iterator[Verdict]]]]:
    """Yield name and function of every finding of a module, by name: each function ``report_<name>(case)``."""
    for name, function in sorted(vars(module).items()):
        if name.startswith(FINDING_PREFIX) and getattr(function, "__module__", None) == module.__name__:
            yield name.removeprefix(FINDING_PREFIX), function


def collect_findings(module: ModuleType, case: Any) -> tuple[Verdict, ...]:
    """Return the verdicts of all findings of a module on a `case`, worst first, each under its finding's name."""
    return rank_verdicts(replace(v, finding=v.finding or name) for name, find in finders(module) for v in find(case))
