"""Identification of a joint: the causes that are named, the intervals of the headline, and its error over the best."""

from __future__ import annotations

from collections.abc import Iterator

from pellucid.study.results import ResultRow

from ._causes import cause_rows
from ._headline import headline_rows


def rows() -> Iterator[ResultRow]:
    """Every figure of the proof."""
    yield from cause_rows()
    yield from headline_rows()
