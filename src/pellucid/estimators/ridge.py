"""Linear and ridge regression in closed form, by singular values.

Features are made comparable (mean 0, variance 1) and the offset is not penalised:

    b(a) = V diag(s / (s² + a)) Uᵀ (y - mean y),   X standardised = U diag(s) Vᵀ
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._errors import IdentificationError

DEPENDENT = 1e-10
"""Singular values below this share of the largest are those of features that others already say."""


class Ridge:
    """Least squares with a penalty on the standardised coefficients; 0 is plain linear regression.

    Parameters
    ----------
    alpha : float
        Penalty, >= 0: on the sum of squared coefficients beside the sum of squared errors.
    products : tuple of int
        Columns whose squares and products are added as features; empty: none.
    """

    def __init__(self, alpha: float = 1.0, products: tuple[int, ...] = ()):
        if not alpha >= 0.0:
            raise IdentificationError(f"ridge: found the penalty {alpha:g}, expected at least 0")
        self.alpha = alpha
        self.products = tuple(products)

    def fit(self, x: np.ndarray, y: np.ndarray) -> Ridge:
        """Find the coefficients.

        Parameters
        ----------
        x : ndarray, shape (n, k)
        y : ndarray, shape (n,)

        Returns
        -------
        Ridge
            Itself.
        """
        x = self._expanded(np.asarray(x, float))
        self.mean, scale = x.mean(axis=0), x.std(axis=0)
        self.scale = np.where(scale > 0.0, scale, 1.0)
        q, r = np.linalg.qr((x - self.mean) / self.scale)
        u, s, vt = np.linalg.svd(r, full_matrices=False)  # as of x itself, and much smaller
        self.offset = float(np.mean(y))
        carried = s > DEPENDENT * s[0]
        gain = np.divide(s, s**2 + self.alpha, out=np.zeros_like(s), where=carried)
        self.coefficients = vt.T @ (gain * (u.T @ (q.T @ (y - self.offset))))
        return self

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Torque for features.

        Parameters
        ----------
        x : ndarray, shape (n, k)

        Returns
        -------
        ndarray, shape (n,)
        """
        return self.offset + ((self._expanded(np.asarray(x, float)) - self.mean) / self.scale) @ self.coefficients

    def plain(self, names: Sequence[str]) -> dict[str, float]:
        """The same map on features as they are: torque = offset + sum of each term times its coefficient.

        Parameters
        ----------
        names : sequence of str
            Of the features.

        Returns
        -------
        dict of str to float
            ``"offset"``, then by feature; a product is named by its two factors with ``" * "`` between.
        """
        chosen = [names[i] for i in self.products]
        terms = [*names, *(f"{chosen[i]} * {chosen[j]}" for i, j in zip(*np.triu_indices(len(chosen)), strict=True))]
        slopes = self.coefficients / self.scale
        return {"offset": self.offset - float(slopes @ self.mean), **dict(zip(terms, slopes.tolist(), strict=True))}

    def _expanded(self, x: np.ndarray) -> np.ndarray:
        if not self.products:
            return x
        chosen = x[:, list(self.products)]
        rows, columns = np.triu_indices(chosen.shape[1])
        return np.hstack([x, chosen[:, rows] * chosen[:, columns]])
