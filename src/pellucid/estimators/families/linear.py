"""Linear and ridge regression, with earlier envelopes or without, and without EMG at all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features
from .family import Family, Regressor

PENALTIES = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
"""Penalties that ridge regression chooses from."""

PENALISED = tuple({"products": products, "penalty": a} for products in ("none", "motion", "all") for a in PENALTIES)


def ridge(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Ridge regression on features, and on products of none of them, of motion's, or of all."""
    from ..ridge import Ridge

    products = settings.get("products", "none")
    columns = {"none": (), "motion": seen.motion, "all": tuple(range(len(seen.names)))}[products]
    return Ridge(settings["penalty"], columns)


SHARED = {"along": "penalty", "smoothing": 0.0, "reach": 2}

FAMILIES = {
    "ridge": Family("ridge regression", ridge, PENALISED, lags=False, every=True, rank=40, **SHARED),
    "ridge_lags": Family("ridge regression with lags", ridge, PENALISED, lags=True, every=True, rank=41, **SHARED),
    "linear": Family("linear regression", ridge, ({"penalty": 0.0},), lags=False, rank=42, **SHARED),
    "motion": Family("ridge regression without EMG", ridge, PENALISED, muscles=False, every=True, rank=43, **SHARED),
}
