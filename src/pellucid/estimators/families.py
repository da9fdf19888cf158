"""Every estimator by its name: what it is, which features and settings it may choose from, how it is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .ensembles import PUBLISHED, QUICK, TUNED, Regressor, make_ensemble
from .features import Features, FeatureSet, feature_sets
from .ridge import Ridge

PENALTIES = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
"""Penalties that ridge regression chooses from."""


@dataclass(frozen=True)
class Family:
    """An estimator that can be asked for by name.

    Parameters
    ----------
    words : str
        What it is.
    make : callable
        From settings and the features it will see to an estimator with ``fit(x, y)`` and ``predict(x)``.
    settings : tuple of Mapping
        Candidates.
    lags : bool or None
        Whether it sees earlier envelopes; None: cross-validation decides.
    muscles : bool
        Whether it sees EMG at all.
    fixed : FeatureSet or None
        The only features it sees, where they are not to be chosen.
    every : bool
        Every pair of features and settings is tried; otherwise features first, then settings.
    quick : Mapping or None
        Settings with which features are chosen, where that is done first; None: the first of `settings`.
    smoothing : float
        Length of the moving average on its output [s]; 0 for none.
    whole : callable or None
        Fits trials itself, where features do not do: from trials, name and whether it is causal to a fitted map.
    """

    words: str
    make: Callable[[Mapping[str, Any], Features], Regressor]
    settings: tuple[Mapping[str, Any], ...] = ({},)
    lags: bool | None = None
    muscles: bool = True
    fixed: FeatureSet | None = None
    every: bool = False
    quick: Mapping[str, Any] | None = None
    smoothing: float = 0.05
    whole: Callable[[Any, str, bool], Any] | None = None

    def candidates(self, *, neighbours: bool) -> tuple[FeatureSet, ...]:
        """Feature sets it may choose from.

        Parameters
        ----------
        neighbours : bool
            Whether other joints' angles are there.

        Returns
        -------
        tuple of FeatureSet
        """
        if self.fixed is not None:
            return (self.fixed,)
        return feature_sets(neighbours=neighbours, lags=self.lags, muscles=self.muscles)


def _ridge(settings: Mapping[str, Any], seen: Features) -> Ridge:
    columns = {"none": (), "motion": seen.motion, "all": tuple(range(len(seen.names)))}[
        settings.get("products", "none")
    ]
    return Ridge(settings["penalty"], columns)


def _trees(kind: str) -> Callable[[Mapping[str, Any], Features], Regressor]:
    return lambda settings, seen: make_ensemble(kind, settings)


def _hill(trials: Any, name: str, causal: bool) -> Any:
    from .hill import fit_hill

    return fit_hill(trials, name=name, causal=causal)


def _reconstruction(fit: str) -> Callable[[Any, str, bool], Any]:
    def whole(trials: Any, name: str, causal: bool) -> Any:
        from . import reconstructions

        return getattr(reconstructions, fit)(trials, name, causal)

    return whole


def _network(settings: Mapping[str, Any], seen: Features) -> Regressor:
    from .neural_network import NeuralNetwork

    return NeuralNetwork(settings["penalty"])


_PENALISED = tuple({"products": products, "penalty": a} for products in ("none", "motion", "all") for a in PENALTIES)

ESTIMATORS: dict[str, Family] = {
    "boost": Family("least-squares boosting", _trees("boost"), TUNED["boost"], quick=QUICK["boost"]),
    "bagging": Family("bagged trees", _trees("bagging"), TUNED["bagging"], quick=QUICK["bagging"]),
    "tree": Family("one tree", _trees("tree"), TUNED["tree"]),
    "ridge": Family("ridge regression", _ridge, _PENALISED, lags=False, every=True, smoothing=0.0),
    "ridge_lags": Family("ridge regression with lags", _ridge, _PENALISED, lags=True, every=True, smoothing=0.0),
    "linear": Family("linear regression", _ridge, ({"penalty": 0.0},), lags=False, smoothing=0.0),
    "motion": Family("ridge regression without EMG", _ridge, _PENALISED, muscles=False, every=True, smoothing=0.0),
    "hill": Family("muscles of Hill's type", lambda settings, seen: None, smoothing=0.0, whole=_hill),
    **{
        name: Family(
            f"{words} (reconstruction)", lambda settings, seen: None, smoothing=0.0, whole=_reconstruction(fit)
        )
        for name, words, fit in (
            ("nmco", "NM-CO, muscles by swarm and conjugate gradients", "fit_nmco"),
            ("nmcoa", "NM-COA, the same told the torque so far", "fit_nmcoa"),
            ("nmnc", "NM-NC, muscles without neighbouring joints", "fit_nmnc"),
        )
    },
    "mbp": Family(
        "M-BP, a network (reconstruction)",
        _network,
        tuple({"penalty": a} for a in (0.01, 0.1, 1.0)),
        fixed=FeatureSet(velocities=True),
        smoothing=0.0,
    ),
    **{
        f"{kind}_published": Family(words, _trees(kind), (PUBLISHED[kind],), fixed=FeatureSet())
        for kind, words in (
            ("boost", "least-squares boosting, MATLAB's defaults"),
            ("bagging", "bagged trees, MATLAB's defaults"),
            ("tree", "one tree, MATLAB's defaults"),
        )
    },
}
"""Name to family; one more estimator is one more line."""
