"""Held-out data have types of their own, which no fit accepts.

A recording with ``use = "validate"`` may reach reported errors and the verdict on the prediction, and nothing else.
What is made of it derives from `JudgedData`, and every function that fits, scales or chooses asks `require_fitted`.
"""

from __future__ import annotations

from collections.abc import Iterable

from .._errors import PellucidError


class JudgedData:
    """Mark of held-out data: recordings, and motions and records made of them."""

    __slots__ = ()


class JudgedDataInFitError(PellucidError, TypeError):
    """Held-out data were given to a function that fits, scales or chooses. It is an error in the program."""


def require_fitted(parts: Iterable[object], what: str) -> None:
    """Raise a `JudgedDataInFitError` if any of `parts` is held out; `what` names the function that was called."""
    held = [part for part in parts if isinstance(part, JudgedData)]
    if held:
        names = ", ".join(dict.fromkeys(str(getattr(part, "recording", getattr(part, "name", "?"))) for part in held))
        raise JudgedDataInFitError(f"{what}: found held-out data ({names}), expected fitted recordings only")
