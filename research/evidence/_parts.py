"""The parts of a proof one after another, with what each has taken."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping

from pellucid.study.results import ResultRow


def run_parts(proof: str, parts: Mapping[str, Callable[[], Iterable[ResultRow]]]) -> Iterator[ResultRow]:
    """Yield the rows of every part of a proof; print to standard error which part has ended, and after how long.

    A part is called only when its turn has come, so that what it measures counts as its own time.
    """
    begun = time.monotonic()
    for name, part in parts.items():
        before = time.monotonic()
        yield from part()
        now = time.monotonic()
        print(
            f"{proof}: {name} ended after {now - before:.0f} s, {now - begun:.0f} s in all", file=sys.stderr, flush=True
        )
