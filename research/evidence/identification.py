"""Identification of a joint: are effects that exoskeletons have named as causes, and are the others not?"""

from __future__ import annotations

from collections.abc import Iterator

from pellucid.study.results import ResultRow

from ._causes import cause_rows


def rows() -> Iterator[ResultRow]:
    """Every figure of the proof."""
    yield from cause_rows()
