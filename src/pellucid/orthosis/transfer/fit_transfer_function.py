"""Identify a transfer function from arrays."""

from __future__ import annotations

import numpy as np

from ...numerics.sampled import sampled
from ..input_output import InputOutput
from .transfer_function_fit import TransferFit, fit_records


def fit_transfer_function(
    time: np.ndarray,
    input: np.ndarray,
    output: np.ndarray,
    *,
    poles: int,
    zeros: int = 0,
    hold: str = "first",
    offset: bool = False,
    units: tuple[str, str] = ("1", "1"),
) -> TransferFit:
    r"""Identify a continuous-time transfer function from a sampled input and the response to it.

    .. math::  y = \frac{b_m s^m + \dots + b_0}{s^n + a_{n-1} s^{n-1} + \dots + a_0}\, u

    The simulated output is fitted to the measured one, from an initial state that is estimated too.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Increasing, evenly spaced or not [s].
    input, output : ndarray, shape (n,) or (n, 1)
        In any unit; see `units`.
    poles, zeros : int
        At least 1 pole, and no more zeros than poles.
    hold : {"first", "zero"}
        What the input does between samples: goes straight to the next one, or stays.
    offset : bool
        Estimate a constant of the output as well.
    units : tuple of str
        Of the input and of the output, for the parameters' units.

    Returns
    -------
    TransferFit
        Coefficients by name (``fit["a0"]``) with intervals; `numerator` and `denominator`, highest power first; of two
        poles and no zeros also ``fit["inertia"]``, ``fit["damping"]`` and ``fit["stiffness"]``.

    Raises
    ------
    RecordingError
        If arrays differ in shape, hold a number that is not finite, or time does not increase.
    IdentificationError
        If there are too few samples, an option is unknown, or the input cannot tell the coefficients apart.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> from scipy.signal import lsim
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> u = np.sin(t) + np.sign(np.sin(0.7 * t))
    >>> _, y, _ = lsim(([2.0], [1.0, 0.8, 9.0]), u, t)
    >>> fit = pl.fit_transfer_function(t, u, y, poles=2)
    >>> fit.numerator.round(3), fit.denominator.round(3)
    (array([2.]), array([1. , 0.8, 9. ]))
    """
    time, input, output = sampled("fit_transfer_function", time, even=False, input=input, output=output)
    record = InputOutput("response", "fitted", time, input, output)
    return fit_records([record], poles, zeros, hold=hold, offset=offset, units=units)
