"""Are movements labelled with another one's amplitude, or did people miss? Only the first makes a recording unusable.

Labels that were mixed up send movements exactly to other labels; people who miss end anywhere. Three things tell the
first: all movements of one label go to the same other one; most of those that end nearer to another label than to their
own hit it; movements that were to go further go no further.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from ..units import COORDINATES, Coordinate

OWN = 0.01
"""A label is a movement's own within this [rad]: it may have been rounded."""

RANDOM = 12
"""With more amplitudes than this they were random: they lie too close for a movement to be taken for another's."""

MISTAKEN = 0.1
"""Share of a recording's movements that may end nearer to another label than to their own, or hit another."""

HIT = 1 / 3
"""Share of the way to the border between two labels within which a movement hit one."""

HITS = 0.6
"""Share of hits among movements nearer to another label from which on they were aimed there."""

WHOLE = 0.8
"""Share of a label's movements from which on all of them went to another."""

ORDERED = 0.5
"""Rank correlation of labelled and measured amplitudes below which they have nothing to do with each other."""


@dataclass(frozen=True)
class Strays:
    """Movements that end nearer to another label than to their own."""

    wrong: np.ndarray  # (n,)
    nearest: np.ndarray  # (n,) The label that each movement ends nearest to [rad]
    mislabelled: str  # Why they are labelled wrongly; empty where people may just have missed
    along: Coordinate = COORDINATES["rad"]  # What they go along: of a length all that is [rad] here is [m]

    def commonest(self, label: np.ndarray) -> str:
        """The commonest mistake of movements with these labels [rad], in words."""
        pairs = zip(label[self.wrong], self.nearest[self.wrong], strict=True)
        shown = (tuple(round(self.along.factor * float(x), 1) for x in p) for p in pairs)
        (own, other), count = Counter(shown).most_common(1)[0]
        unit = self.along.shown
        return f"nearer to another amplitude than to their label ({count} labelled {own:g} {unit} go {other:g} {unit})"


def strays(reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate = COORDINATES["rad"]) -> Strays:
    """Movements nearer to another label than to their own, and whether that is the labels' fault. `reach`, `label`
    (n,) [rad]; `labels` (k,) [rad]."""
    nearest = labels[np.argmin(np.abs(reach[:, None] - labels[None, :]), axis=1)]
    wrong = np.abs(nearest - label) > OWN * along.radian
    if len(labels) > RANDOM:
        wrong[:] = False
        return Strays(wrong, nearest, _disordered(reach, label), along)
    said = _whole_label(reach, label, labels, along) or _aimed(reach, label, labels, along)
    return Strays(wrong, nearest, said, along)


def _to_labels(
    reach: np.ndarray, label: np.ndarray, labels: np.ndarray, own: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nearest label, whether it is another, and whether it was hit, once what everybody falls short by is taken out."""
    scaled = reach / np.median(reach / label)
    at = np.argmin(np.abs(scaled[:, None] - labels[None, :]), axis=1)
    gap = np.array([np.min(np.abs(np.delete(labels, i) - each)) for i, each in enumerate(labels)])
    hit = np.abs(scaled - labels[at]) < HIT * 0.5 * gap[at]
    return labels[at], np.abs(labels[at] - label) > own, hit


def _whole_label(reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate) -> str:
    if len(labels) < 2:
        return ""
    nearest, wrong, hit = _to_labels(reach, label, labels, OWN * along.radian)
    for own in labels:
        of = np.abs(label - own) <= OWN * along.radian
        if of.sum() < 2:
            continue
        for other in labels:
            there = of & wrong & (nearest == other)
            if there.sum() >= WHOLE * of.sum() and np.mean(hit[there]) >= 0.5:
                said, went = (f"{along.factor * each:.4g} {along.shown}" for each in (own, other))
                return f"{there.sum()} of {of.sum()} movements labelled {said} go {went}"
    return ""


def _aimed(reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate) -> str:
    if len(labels) < 2:
        return ""
    _, wrong, hit = _to_labels(reach, label, labels, OWN * along.radian)
    aimed = int((wrong & hit).sum())
    if aimed >= 2 and aimed > MISTAKEN * len(reach) and aimed > HITS * wrong.sum():
        return f"{aimed} of {len(reach)} movements exactly as far as another label says"
    return ""


def _disordered(reach: np.ndarray, label: np.ndarray) -> str:
    if len(reach) < 10:
        return ""
    order = float(np.corrcoef(rankdata(reach), rankdata(label))[0, 1])
    return f"a rank correlation of {order:.2f} between labelled and measured amplitudes" if order < ORDERED else ""
