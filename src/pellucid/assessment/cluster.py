"""A Dask cluster as an ordinary executor, for simulations that are too large for one machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .._errors import PellucidError

PATIENCE = 30
"""Seconds within which a scheduler has to answer."""


@contextmanager
def cluster(address: str | None) -> Iterator[Any]:
    """The workers of a Dask scheduler as an executor of the standard library's kind; None without an address."""
    if not address:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise PellucidError(
            'scheduler: found no package distributed, expected it: pip install "pellucid[distributed]"'
        ) from None
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise PellucidError(
            f"scheduler: found nobody who answers at {address} ({error}), expected a Dask scheduler"
        ) from None
    with client:
        yield client.get_executor()
