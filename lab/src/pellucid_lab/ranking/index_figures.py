"""Draw how far indices of transparency agree on the order of controllers."""

from __future__ import annotations

import numpy as np

from pellucid.study.drawing.drawing import Drawing, one_panel

from .transparency_indices import TRANSPARENCY_INDICES, IndexComparison


def agreement_map(compared: IndexComparison, name: str, *, caption: str) -> Drawing:
    """Draw Kendall's tau of every pair of indices as a map, in the order of their kinds."""
    names = [index.name for index in TRANSPARENCY_INDICES]
    tau = np.array([[compared.agreement(one, other) for other in names] for one in names])
    figure, axis = one_panel(0.2 * len(names) + 1.6)
    shown = axis.imshow(np.ma.masked_invalid(tau), cmap="Blues", vmin=-0.2, vmax=1.0, aspect="auto")
    kinds = [index.kind for index in TRANSPARENCY_INDICES]
    for i in range(1, len(kinds)):
        if kinds[i] != kinds[i - 1]:
            axis.axhline(i - 0.5, color="white", linewidth=1.6)
            axis.axvline(i - 0.5, color="white", linewidth=1.6)
    labels = [one.replace("_", " ") for one in names]
    axis.set_yticks(range(len(names)), labels, fontsize=7)
    axis.set_xticks(range(len(names)), labels, rotation=90, fontsize=7)
    axis.tick_params(length=0, pad=2)
    axis.spines[:].set_visible(False)
    figure.colorbar(shown, ax=axis, shrink=0.6, pad=0.02).outline.set_visible(False)
    return Drawing(name, figure, caption)
