"""Finding: families, estimators or simulations failed."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ....study.pages.quantities import METHODS
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Report each failure with its reason."""
    for family, why in case.failures.items():
        yield Verdict("note", f"The '{family}' family could not be fitted: {why}.")
    for what, why in case.fit.failures.items():
        name = METHODS.get(what, what)
        yield Verdict("warning", f"{name[0].upper()}{name[1:]} came to nothing: {why}.")
