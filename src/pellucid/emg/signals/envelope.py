"""EMG over an array to envelopes, by one of the published chains."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import RecordingError
from .emg_chain import EmgChain, emg_chain


def envelope(
    emg: ArrayLike,
    *,
    rate: float,
    chain: str | EmgChain = "able",
    maximum: ArrayLike | None = None,
    causal: bool = False,
) -> np.ndarray:
    """Envelopes of raw EMG.

    Parameters
    ----------
    emg : array_like, shape (n,) or (n, muscles)
        Raw EMG [V].
    rate : float
        Its sampling rate [Hz].
    chain : str or EmgChain
        ``"able"``: band-pass 20 to 450 Hz, rectified, relative, 0.1 s later, so that it lines up with the motion;
        ``"knee"``: band-pass 10 to 500 Hz, rectified, low-pass at 2 Hz, in V; ``"hill"``: notch at 50 Hz, high-pass at
        30 Hz, rectified, low-pass at 5 Hz, relative.
    maximum : array_like, optional
        A number, or shape (muscles,): what 1 stands for in a relative chain, the largest value of a maximal
        contraction in V. Left out, the largest of these samples, muscle by muscle.
    causal : bool
        From the past alone, as in real time, and late; otherwise every filter runs both ways. A relative chain then
        needs `maximum`: the largest value to come is not known.

    Returns
    -------
    ndarray, of the shape of `emg`
        [1] where the chain makes it relative, otherwise [V].

    Raises
    ------
    RecordingError
        If there is no such chain, a cut-off does not fit the rate, a sample is missing, there are too few, or a
        maximum is needed or none.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(0)
    >>> effort = np.clip(np.sin(np.pi * np.arange(8000) / 2000.0), 0.0, None)
    >>> emg = 1e-4 * (0.05 + effort) * rng.standard_normal(8000)
    >>> made = pl.envelope(emg, rate=2000.0, chain="hill")
    >>> made.shape, float(made.max())
    ((8000,), 1.0)
    >>> bool(np.corrcoef(made, effort)[0, 1] > 0.95)
    True
    """
    x = np.asarray(emg, dtype=np.float64)
    if x.ndim not in (1, 2):
        raise RecordingError(f"envelope: found EMG of shape {x.shape}, expected (n,) or (n, muscles)")
    passed = emg_chain(chain) if isinstance(chain, str) else chain
    run = passed.causal if causal else passed.zero_phase
    columns = x.reshape(len(x), -1).T
    try:
        tops = [None] * len(columns) if maximum is None else np.broadcast_to(maximum, len(columns)).tolist()
    except ValueError:
        found = np.asarray(maximum).shape
        raise RecordingError(
            f"envelope: found maxima of shape {found}, expected one for each of {len(columns)} muscles"
        ) from None
    made = []
    for i, (column, top) in enumerate(zip(columns, tops, strict=True)):
        try:
            made.append(run(column, rate, maximum=top))
        except RecordingError as error:
            if x.ndim == 1:
                raise
            raise RecordingError(f"muscle {i} (column): {error}") from None
    return np.stack(made, axis=-1).reshape(x.shape)
