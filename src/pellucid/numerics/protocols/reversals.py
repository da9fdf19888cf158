r"""Small slow reversals of growing size: the motion that shows presliding friction.

Contacts that give before they slip look like springs in strokes shorter than their travel, and like friction in longer
ones. A ladder of strokes from the one to the other, around several angles, shows both and where one becomes the other
[1]_. It needs an encoder some ten times finer than the travel, strokes slow enough that inertia is small beside
friction, and the largest stroke several travels wide. Under a position controller without integral action the joint
follows only once the controller's effort exceeds friction, so that references grow until it does: from a hundredth of a
degree in stiff loops up to a few degrees in soft ones. Of an effort instead of a position, the same ladder goes from a
tenth of the friction's level to one and a half times of it.

.. [1] V. Lampaert, J. Swevers, F. Al-Bender, "Modification of the Leuven integrated friction model structure", IEEE
   Trans. Automatic Control 47(4), 2002.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._errors import IdentificationError

REVERSALS_NAME = "reversals"
"""Name of this motion in study.toml, as the `protocol` of a recording."""

MOVE_DURATION_S = 1.0
"""Time for the move to the next centre, including a rest in its last fifth [s]."""


def reversals(
    duration: float,
    fs: float,
    *,
    smallest: float,
    largest: float,
    frequency: float,
    centres: Sequence[float],
) -> np.ndarray:
    """Return a position or an effort, (n,): whole sines around each of the `centres` in turn.

    Each sine is larger than the last by the same factor.

    `duration`, `fs` [s], [Hz]; `smallest`, `largest` amplitude and `centres` [rad or m]; `frequency` [Hz]; gives (n,).
    """
    share = duration / max(len(centres), 1)
    strokes = int((share - MOVE_DURATION_S) * frequency)
    if len(centres) == 0 or strokes < 3 or not 0.0 < smallest < largest:
        raise IdentificationError(
            f"reversals: found {strokes} strokes from {smallest:g} to {largest:g} around {len(centres)} centres, "
            "expected 3 or more that grow around 1 or more"
        )
    sizes = np.geomspace(smallest, largest, strokes)
    ends = np.round(np.linspace(0.0, duration * fs, len(centres) + 1)).astype(int)
    pieces, here = [], centres[0]
    for centre, first, last in zip(centres, ends, ends[1:], strict=False):
        time = np.arange(last - first) / fs
        ease = np.clip(time / (0.8 * MOVE_DURATION_S), 0.0, 1.0)
        turns = np.maximum(time - MOVE_DURATION_S, 0.0) * frequency
        size = np.append(sizes, 0.0)[np.minimum(turns.astype(int), strokes)]
        moved = (centre - here) * ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
        pieces.append(here + moved + size * np.sin(2.0 * np.pi * turns))
        here = centre
    return np.concatenate(pieces)
