"""A small neural network: the reconstruction of M-BP."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..features import Features, FeatureSet
from .family import Family, Regressor


def make_network(settings: Mapping[str, Any], seen: Features) -> Regressor:
    """Make a network with one hidden layer."""
    from ..neural_network import NeuralNetwork

    return NeuralNetwork(settings["penalty"])


FAMILIES = {
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
}
