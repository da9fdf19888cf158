"""Scale of envelopes from raw EMG of maximal contractions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import RecordingError
from .emg_chain import EmgChain, emg_chain
from .envelope import envelope

MAX_CONTRACTION_COUNT = 100
"""More contractions than this are samples that were meant as one array."""


def maximal_envelope(
    contractions: Sequence[ArrayLike], *, rate: float, chain: str | EmgChain = "able"
) -> np.ndarray | float:
    """Return the largest envelope of maximal voluntary contractions (MVC): what 1 stands for in `envelope`.

    Parameters
    ----------
    contractions : sequence of array_like, each of shape (n,) or (n, muscles)
        Raw EMG of one contraction after another [V]; their lengths may differ. A muscle's largest value may be in any.
    rate : float
        Sampling rate [Hz].
    chain : str or EmgChain
        Chain of the envelopes that are to be relative; as in `envelope`.

    Returns
    -------
    ndarray of shape (muscles,), or float
        Largest envelope of each muscle [V]; a number for contractions of shape (n,).

    Raises
    ------
    RecordingError
        If there is no contraction, their numbers of muscles differ, the chain does not make envelopes relative, or
        `envelope` refuses one.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(0)
    >>> mvc, task = (1e-4 * effort * rng.standard_normal(8000) for effort in (1.0, 0.4))
    >>> top = pl.maximal_envelope([mvc], rate=2000.0, chain="hill")
    >>> relative = pl.envelope(task, rate=2000.0, chain="hill", maximum=top)
    >>> bool(0.25 < np.median(relative) < 0.45)
    True
    """
    count = len(contractions)
    if not 0 < count <= MAX_CONTRACTION_COUNT or np.ndim(contractions[0]) == 0:
        raise RecordingError(
            f"maximal_envelope: found {count} contractions, expected a list of 1 to {MAX_CONTRACTION_COUNT} arrays, "
            "one for each contraction"
        )
    asked = emg_chain(chain) if isinstance(chain, str) else chain
    if not any(stage.kind == "normalise" for stage in asked.stages):
        raise RecordingError(
            f"maximal_envelope: found the chain {asked.name}, expected one whose envelopes are relative, such as hill"
        )
    tops = []
    for i, contraction in enumerate(contractions):
        try:
            # Over a maximum of 1 V a relative envelope is one in V.
            tops.append(envelope(contraction, rate=rate, chain=asked, maximum=1.0).max(axis=0))
        except RecordingError as error:
            raise RecordingError(f"maximal_envelope, contraction {i}: {error}") from None
    shapes = sorted({top.shape for top in tops})
    if len(shapes) > 1:
        raise RecordingError(
            f"maximal_envelope: found contractions of {' and '.join(str(s[0] if s else 1) for s in shapes)} muscles, "
            "expected the same muscles in each"
        )
    top = np.max(tops, axis=0)
    return float(top) if top.ndim == 0 else top
