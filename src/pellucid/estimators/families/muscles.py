"""Muscles of Hill's type: calibrated here, and as other authors did."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .family import Family


def _hill(trials: Any, name: str, causal: bool) -> Any:
    from ..hill import fit_hill

    return fit_hill(trials, name=name, causal=causal)


def _reconstruction(fit: str) -> Callable[[Any, str, bool], Any]:
    def whole(trials: Any, name: str, causal: bool) -> Any:
        from .. import reconstructions

        return getattr(reconstructions, fit)(trials, name, causal)

    return whole


FAMILIES = {
    "hill": Family("muscles of Hill's type", smoothing=0.0, whole=_hill, rank=50, reach=0),
    **{
        name: Family(
            f"{words} (reconstruction)",
            smoothing=0.0,
            whole=_reconstruction(f"fit_{name}"),
            rank=rank,
            reach=1,
            told=name == "nmcoa",
            reconstruction=True,
        )
        for rank, name, words in (
            (60, "nmco", "NM-CO, muscles by swarm and conjugate gradients"),
            (61, "nmcoa", "NM-COA, the same told the torque so far: no peer"),
            (62, "nmnc", "NM-NC, muscles without neighbouring joints"),
        )
    },
}
