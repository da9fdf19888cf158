r"""A linear recursion over many samples, without a loop in Python.

.. math::
   x_{k+1} = \Phi_k x_k + v_k

is a lower triangular system of equations with a unit diagonal and a narrow band: forward substitution is the recursion
itself, sample after sample, and BLAS does it.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dtbsv


def march(transition: np.ndarray, forcing: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """States of a linear recursion at every sample. `transition` (n - 1, d, d); `forcing` (n - 1, d, r); `initial`
    (d, r); gives (n, d, r)."""
    steps, d, r = forcing.shape
    band = np.zeros((2 * d, (steps + 1) * d), order="F")
    band[0] = 1.0
    transition = np.broadcast_to(transition, (steps, d, d))
    columns = band[:, : steps * d].reshape(2 * d, d, steps, order="F")  # a view: entry (offset, j, k)
    for i in range(d):
        for j in range(d):
            columns[d + i - j, j] = -transition[:, i, j]
    right = np.empty((r, steps + 1, d))
    right[:, 0] = initial.T
    right[:, 1:] = np.moveaxis(forcing, 2, 0)
    solved = [dtbsv(2 * d - 1, band, column.ravel(), lower=1, diag=1, overwrite_x=1) for column in right]
    return np.stack(solved, axis=-1).reshape(steps + 1, d, r)
