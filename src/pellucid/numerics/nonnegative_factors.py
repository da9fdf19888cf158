"""Non-negative factors of a matrix by coordinate descent [1]_, which starts from its singular vectors [2]_.

The numbers are those of scikit-learn's ``NMF``, which takes a second to load.

.. [1] A. Cichocki, A. H. Phan, "Fast local algorithms for large scale nonnegative matrix and tensor factorizations",
   IEICE Transactions on Fundamentals E92-A, 2009.
.. [2] C. Boutsidis, E. Gallopoulos, "SVD based initialization: a head start for nonnegative matrix factorization",
   Pattern Recognition 41, 2008.
"""

from __future__ import annotations

import numpy as np

MAX_LEFT_VIOLATION = 1e-4
"""The descent ends where the projected gradient has fallen to this share of its first size."""


def nonnegative_factors(x: np.ndarray, number: int, max_iterations: int) -> tuple[np.ndarray, np.ndarray]:
    """Return w, shape (n, number), and h, shape (number, m), whose product is close to `x`, shape (n, m)."""
    w, turned = _start(x, number)
    first = 0.0
    for _ in range(max_iterations):
        violation = _descend(x, w, turned) + _descend(x.T, turned, w)
        first = first or violation
        if violation <= MAX_LEFT_VIOLATION * first:
            break
    return w, turned.T


def _descend(x: np.ndarray, w: np.ndarray, turned: np.ndarray) -> float:
    """Improve `w`, shape (n, r), column by column, with the other factor `turned`, shape (m, r).

    Return the size of the projected gradient.
    """
    squares, wanted, violation = turned.T @ turned, x @ turned, 0.0
    for t, row in enumerate(squares):
        column = w[:, t]
        gradient = w @ row - wanted[:, t]
        violation += float(np.abs(np.where(column == 0.0, np.minimum(gradient, 0.0), gradient)).sum())
        if row[t] != 0.0:
            np.maximum(column - gradient / row[t], 0.0, out=column)
    return violation


def _start(x: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first factors, shapes (n, number) and (m, number): parts of singular vectors, the mean for zeros."""
    u, s, vt = np.linalg.svd(x, full_matrices=False)
    w, turned = np.zeros((len(x), number)), np.zeros((x.shape[1], number))
    for j in range(number):
        best = 0.0
        # The first pair of singular vectors has one sign.
        parts = [(np.abs(u[:, 0]), np.abs(vt[0]))] if j == 0 else [
            (np.maximum(sign * u[:, j], 0.0), np.maximum(sign * vt[j], 0.0)) for sign in (-1.0, 1.0)
        ]  # fmt: skip
        for left, right in parts:
            length, other = np.linalg.norm(left), np.linalg.norm(right)
            if length * other > best:
                best = float(length * other)
                w[:, j], turned[:, j] = (np.sqrt(s[j] * best) * part for part in (left / length, right / other))
    for factor in (w, turned):
        factor[factor < 1e-6] = x.mean()
    return w, turned
