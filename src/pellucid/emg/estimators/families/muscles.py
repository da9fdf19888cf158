"""Muscles of Hill's type: calibrated by Pellucid's method, and by reconstructions of other authors' methods."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .family import Family


def _fit_hill(trials: Any, name: str, causal: bool) -> Any:
    """Calibrate muscles on trials."""
    from ..hill import fit_hill

    return fit_hill(trials, name=name, causal=causal)


def _make_reconstruction_fit(fit: str) -> Callable[[Any, str, bool], Any]:
    """Return a function that fits trials by the function called `fit` in `reconstructions`."""

    def whole(trials: Any, name: str, causal: bool) -> Any:
        from .. import adaptive_correction as reconstructions

        return getattr(reconstructions, fit)(trials, name, causal)

    return whole


def _correct_nmco(base: Any, trials: Any, name: str, causal: bool) -> Any:
    """Fit NM-COA on a fit of NM-CO."""
    from ..adaptive_correction import correct_nmco

    return correct_nmco(base, trials, name, causal)


FAMILIES = {
    "hill": Family(
        "muscles of Hill's type",
        smoothing=0.0,
        fit_trials=_fit_hill,
        rank=50,
        is_anatomical=True,
        short="muscles",
        colour="good",
        shows_muscles=True,
        scored_causally=True,
        runs_live=True,
    ),
    **{
        name: Family(
            f"{words} (reconstruction)",
            smoothing=0.0,
            fit_trials=_make_reconstruction_fit(f"fit_{name}"),
            rank=rank,
            sees_measured_torque=sees_torque,
            reconstruction=True,
            short=short,
            corrects="nmco" if name == "nmcoa" else "",
            correct_fit=_correct_nmco if name == "nmcoa" else None,
        )
        for rank, name, short, sees_torque, words in (
            (60, "nmco", "NM-CO", False, "NM-CO, muscles by swarm and conjugate gradients"),
            (61, "nmcoa", "", True, "NM-COA, the same told the torque so far: no peer"),
            (62, "nmnc", "NM-NC", False, "NM-NC, muscles without neighbouring joints"),
        )
    },
}
