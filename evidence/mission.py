"""What the three papers claim or want, beyond their equations, tables and figures: measured, each beside its rival.

- loads and support (ABLE, sections 1 and 6): the load of the first lift, laws that carry it, a load that falls, and a
  law that carries part of the forearm (`_loads`).
"""

from collections.abc import Iterator

from pellucid.studies.results import ResultRow

from ._loads import load_rows


def rows() -> Iterator[ResultRow]:
    """Every figure."""
    yield from load_rows()
