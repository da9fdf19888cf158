r"""Whether a body can have its ten numbers: the pseudo-inertia of a rigid body [1]_.

With mass m, first moments h and inertia I about one origin,

.. math::
   P = \begin{pmatrix} \tfrac12\mathrm{tr}(I)\,1 - I & h \\ h^\top & m \end{pmatrix}
     = \int \begin{pmatrix} r \\ 1 \end{pmatrix}\begin{pmatrix} r \\ 1 \end{pmatrix}^{\!\top} \rho(r)\,dr

so that some distribution of mass has these numbers exactly where P is positive semidefinite: the mass is not negative,
moments about the centre of mass neither, and no moment is larger than the other two together. P is linear in the ten.

.. [1] P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial parameter
   identification", IEEE Robot. Autom. Lett. 3, 2018.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

SCALING_LENGTH_M = 0.1
"""Length that makes masses and first moments comparable with moments of inertia [m]; no verdict depends on it."""

MIN_EIGENVALUE = 1e-8
"""Eigenvalue that a consistent body's pseudo-inertia has at least, with `SCALING_LENGTH_M` [kg m^2]: 1 mg at 10 cm."""


def pseudo_inertia(bodies: np.ndarray) -> np.ndarray:
    """P of bodies, shape (..., 10) in the order of `kinematic_tree.BODY`; gives (..., 4, 4) in SI."""
    m, hx, hy, hz, xx, xy, xz, yy, yz, zz = np.moveaxis(np.asarray(bodies, float), -1, 0)
    half = 0.5 * (xx + yy + zz)
    rows = [[half - xx, -xy, -xz, hx], [-xy, half - yy, -yz, hy], [-xz, -yz, half - zz, hz], [hx, hy, hz, m]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def bodies_from_pseudo_inertia(pseudo: np.ndarray) -> np.ndarray:
    """The ten numbers whose pseudo-inertia this is, (..., 4, 4); gives (..., 10)."""
    p = np.asarray(pseudo, float)
    trace = p[..., 0, 0] + p[..., 1, 1] + p[..., 2, 2]
    moments = [trace - p[..., 0, 0], -p[..., 0, 1], -p[..., 0, 2], trace - p[..., 1, 1], -p[..., 1, 2],
               trace - p[..., 2, 2]]  # fmt: skip
    return np.stack([p[..., 3, 3], p[..., 0, 3], p[..., 1, 3], p[..., 2, 3], *moments], axis=-1)


def scaled_pseudo_inertia(bodies: np.ndarray) -> np.ndarray:
    """P with masses times `SCALING_LENGTH_M`^2 and first moments times `SCALING_LENGTH_M`, (..., 4, 4) [kg m^2]."""
    scale = np.array([1.0, 1.0, 1.0, SCALING_LENGTH_M])
    return pseudo_inertia(bodies) * np.outer(scale, scale)


@cache
def triangle_matrix() -> np.ndarray:
    """Return the matrix from the ten numbers to the upper triangle of `scaled_pseudo_inertia`, shape (10, 10).

    The triangle is read column by column. Entries off the diagonal are multiplied by the root of 2, so that the norm of
    the result is the Frobenius norm.
    """
    column, row = np.tril_indices(4)
    root = np.where(row == column, 1.0, np.sqrt(2.0))
    return np.stack([scaled_pseudo_inertia(unit)[row, column] * root for unit in np.eye(10)], axis=-1)


def least_eigenvalue(bodies: np.ndarray) -> np.ndarray:
    """Return the least eigenvalue of `scaled_pseudo_inertia`, (...,) [kg m^2]; below 0 no body has these numbers."""
    return np.linalg.eigvalsh(scaled_pseudo_inertia(bodies))[..., 0]


@dataclass(frozen=True)
class Consistency:
    """Physical consistency of links: `eigenvalues` are the least of each link's pseudo-inertia [kg m^2]."""

    names: tuple[str, ...]
    eigenvalues: np.ndarray

    @property
    def consistent(self) -> bool:
        """Whether all of them could."""
        return not self.wrong

    @property
    def wrong(self) -> tuple[str, ...]:
        """Names of links that no body can be; a body of one point, or none, is just allowed."""
        return tuple(
            n for n, value in zip(self.names, self.eigenvalues, strict=True) if not value > -EIGENVALUE_TOLERANCE
        )


EIGENVALUE_TOLERANCE = 1e-12  # kg m^2


def consistency(names: Sequence[str], bodies: np.ndarray) -> Consistency:
    """Return the consistency of links from their ten numbers, shape (links, 10)."""
    return Consistency(tuple(names), least_eigenvalue(bodies))
