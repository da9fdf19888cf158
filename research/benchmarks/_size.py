"""The size of a run of benchmarks or proofs: full, or the smallest that still does every kind of step once.

A benchmark or proof states both sizes of a setting in one line: ``REPEATS = sized(7, smallest=1)``. The runners
(``python -m research.benchmarks --smallest``, ``python -m research.evidence --smallest``) choose by an environment
variable before they import anything, so that processes which they start have the same size. Figures of the smallest
size mean nothing: it shows that everything runs.
"""

from __future__ import annotations

import os
from typing import TypeVar

SIZE_VARIABLE = "PELLUCID_PROOF_SIZE"
"""The environment variable that holds the size."""

SMALLEST = "smallest"
"""The value of `SIZE_VARIABLE` that asks for the smallest size."""

Setting = TypeVar("Setting")


def is_smallest() -> bool:
    """Whether the smallest size was asked for."""
    return os.environ.get(SIZE_VARIABLE) == SMALLEST


def choose_smallest() -> None:
    """Ask for the smallest size, in this process and in those that it starts."""
    os.environ[SIZE_VARIABLE] = SMALLEST


def sized(full: Setting, *, smallest: Setting) -> Setting:
    """Return the value of a setting at the size that was asked for."""
    return smallest if is_smallest() else full
