"""Linear and ridge regression, with earlier envelopes or without, and without EMG at all."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from ..features import Features
from .family import Family, Regressor

PENALTY_CANDIDATES = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
"""Candidate penalties of ridge regression."""

RIDGE_SETTINGS = tuple(
    {"products": products, "penalty": a} for products in ("none", "motion", "all") for a in PENALTY_CANDIDATES
)
"""Candidate settings of ridge regression: which products of features it adds, with every penalty."""


def make_ridge(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make a ridge regression on features, and on products of none of them, of motion's features, or of all."""
    from ..neural_network import Ridge

    products = settings.get("products", "none")
    columns = {"none": (), "motion": seen.motion, "all": tuple(range(len(seen.names)))}[products]
    return Ridge(settings["penalty"], columns)


linear_family = partial(
    Family, shared_setting="penalty", smoothing=0.0, extrapolation_rank=2, weight_argument="row_weight"
)
"""Constructor of a family with the fields that all families of this module have in common."""

FAMILIES = {
    "ridge": linear_family(
        "ridge regression",
        make_ridge,
        RIDGE_SETTINGS,
        lags=False,
        tries_all_pairs=True,
        rank=40,
        colour="heldout",
        rivals_muscles=True,
        scored_causally=True,
        runs_live=True,
    ),
    "ridge_lags": linear_family(
        "ridge regression with lags",
        make_ridge,
        RIDGE_SETTINGS,
        lags=True,
        tries_all_pairs=True,
        rank=41,
        short="ridge with lags",
        colour="stribeck",
        rivals_muscles=True,
    ),
    "linear": linear_family(
        "linear regression", make_ridge, ({"penalty": 0.0},), lags=False, rank=42, colour="combined"
    ),
    "motion": linear_family(
        "ridge regression without EMG",
        make_ridge,
        RIDGE_SETTINGS,
        muscles=False,
        tries_all_pairs=True,
        rank=43,
        short="angles alone",
        colour="symmetric",
    ),
}
