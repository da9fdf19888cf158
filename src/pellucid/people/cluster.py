"""A Dask cluster as an ordinary executor, for simulations that are too large for one machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .._errors import PellucidError, missing_package

SCHEDULER_TIMEOUT_S = 30
"""A scheduler must answer within this time. Otherwise the address is reported as wrong."""


@contextmanager
def cluster(address: str | None) -> Iterator[Any]:
    """Yield the workers of a Dask scheduler as a `concurrent.futures` executor; None without an address."""
    if not address:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise missing_package("scheduler", "distributed", "distributed") from None
    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise PellucidError(f"scheduler: found no answer at {address} ({error}), expected a Dask scheduler") from None
    with client:
        yield client.get_executor()
