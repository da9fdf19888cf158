"""Families, estimators and simulations that came to nothing."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..joint_case import JointCase
from .estimators_disagree import METHODS


def find(case: JointCase) -> Iterator[Verdict]:
    """Each, and why."""
    for family, why in case.failures.items():
        yield Verdict("note", f"The '{family}' family could not be fitted: {why}.")
    for what, why in case.fit.failures.items():
        yield Verdict("warning", f"{METHODS.get(what, what)} came to nothing: {why}.")
