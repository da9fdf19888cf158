"""Linear and ridge regression, with earlier envelopes or without or without EMG, and M-BP, a small network."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from ..torque_trial import Features, FeatureSet
from .family import Family, Regressor

PENALTY_CANDIDATES = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
"""Candidate penalties of ridge regression."""

RIDGE_SETTINGS = tuple(
    {"products": products, "penalty": a} for products in ("none", "motion", "all") for a in PENALTY_CANDIDATES
)
"""Candidate settings of ridge regression: which products of features it adds, with every penalty."""


def make_ridge(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make a ridge regression on features, and on products of none of them, of motion's features, or of all."""
    from ..ridge import Ridge

    products = settings.get("products", "none")
    columns = {"none": (), "motion": seen.motion, "all": tuple(range(len(seen.names)))}[products]
    return Ridge(settings["penalty"], columns)


def make_network(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make a network with one hidden layer."""
    from ..neural_network import NeuralNetwork

    return NeuralNetwork(settings["penalty"])


linear_family = partial(Family, make=make_ridge, shared_setting="penalty", smoothing=0.0, weight_argument="row_weight")
"""Constructor of a family with the fields that all linear families have in common."""

ridge_family = partial(linear_family, settings=RIDGE_SETTINGS, tries_all_pairs=True)
"""Constructor of a family of ridge regressions."""

FAMILIES = {
    "ridge": ridge_family(
        "ridge regression", lags=False, rank=40, colour="heldout", rivals_muscles=True, scored_causally=True,
        runs_live=True,
    ),
    "ridge_lags": ridge_family(
        "ridge regression with lags", lags=True, rank=41, short="ridge with lags", colour="stribeck",
        rivals_muscles=True,
    ),
    "linear": linear_family(
        "linear regression", settings=({"penalty": 0.0},), lags=False, rank=42, colour="combined"
    ),
    "motion": ridge_family(
        "ridge regression without EMG", muscles=False, rank=43, short="angles alone", colour="symmetric",
        scored_causally=True,
    ),
    "mbp": Family(
        "M-BP, a network (reconstruction)",
        make_network,
        tuple({"penalty": a} for a in (0.01, 0.1, 1.0)),
        only_features=FeatureSet(velocities=True),
        reconstruction=True,
        smoothing=0.0,
        rank=70,
        short="M-BP",
    ),
}  # fmt: skip
