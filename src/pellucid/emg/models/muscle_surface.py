r"""Length of a muscle with its tendon over one or two angles, in the form that a robot steps.

Cubic splines on an even grid, :math:`l = \sum_{ij} c_{ij} B(u_1 - i) B(u_2 - j)`, straight beyond it
(``include/pellucid/muscle_path.hpp``). A `MuscleGeometry` with even knots becomes the same function exactly; lengths
that were recorded with angles are fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from .muscle_geometry import LengthOverAngles, MuscleGeometry


@dataclass(frozen=True)
class SurfaceFit:
    """Grid and smoothness of a surface."""

    # Number of cells of a fitted surface along a joint's own angle, and along a neighbour's
    fitted_cell_counts: tuple[int, int] = (10, 4)
    range_margin_share: float = 0.05  # A fitted surface goes on beyond the angles seen by this share of their range
    sampled_cell_count: int = 12  # Cells along each angle of a surface through another function's values
    roughness_weight: float = 1e-6  # Weight of a fitted surface's bending: what angles seen leave open is straight


SURFACE = SurfaceFit()


@dataclass(frozen=True)
class SurfaceAxis:
    """One angle of a surface and its grid."""

    angle: str  # Joint; empty: no angle, the surface is taken at `offset`
    sign: float  # -1 where the surface's angle grows the other way
    offset: float  # Added to it [rad]
    start: float  # start, step: Of the grid [rad]
    step: float
    cells: int


@dataclass(frozen=True)
class MuscleSurface:
    """Length over one or two angles."""

    axes: tuple[SurfaceAxis, ...]
    coefficients: tuple[float, ...]  # cells + 3 along each axis, the last fastest [m]

    def rows(self, angles: Sequence[str]) -> np.ndarray:
        """The core's rows, shape (2, 6), for angles in this order."""
        made = np.zeros((2, 6))
        for row, a in zip(made, self.axes, strict=False):
            place = list(angles).index(a.angle) if a.angle in angles else -1
            row[:] = (place, a.sign, a.offset, a.start, a.step, a.cells)
        return made

    def path(self, angles: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray], dict]:
        """Length (n,) [m], its slope by each angle (n,) [m/rad], its bend by each pair (n,) [m/rad^2]. `angles` (n,)
        [rad].
        """
        names = list(angles)
        length, slope, bend = _core.muscle_path(
            self.rows(names), np.array(self.coefficients), np.array([angles[n] for n in names], float)
        )
        own = [(i, a.angle) for i, a in enumerate(self.axes) if a.angle in names]
        return length, {a: slope[i] for i, a in own}, {(a, b): bend[i, j] for i, a in own for j, b in own}

    def held(self, angles: Mapping[str, float]) -> MuscleSurface:
        """The same with some angles held where they are said to be [rad], in the surface's own signs."""
        axes = tuple(replace(a, angle="", offset=angles[a.angle]) if a.angle in angles else a for a in self.axes)
        return replace(self, axes=axes)


def surface_from_geometry(geometry: MuscleGeometry, signs: Mapping[str, float] | None = None) -> MuscleSurface:
    """The same function as a geometry whose knots are even; `signs` of its angles."""
    coefficients, axes = geometry.coefficients, []
    for k, (angle, knots) in enumerate(zip(geometry.angles, geometry.knots, strict=True)):
        cells = len(knots) - 7
        start, step = float(knots[0]), float(knots[-1] - knots[0]) / cells
        if not np.allclose(knots[3:-3], start + step * np.arange(cells + 1), atol=1e-9):
            raise ValueError(f"{geometry.muscle}, {angle}: found knots that are not even, expected even ones")
        change = _even_knots_matrix(knots, start, step, cells)
        coefficients = np.moveaxis(np.tensordot(change, coefficients, axes=(1, k)), 0, k)
        axes.append(SurfaceAxis(angle, (signs or {}).get(angle, 1.0), 0.0, start, step, cells))
    return MuscleSurface(tuple(axes), tuple(coefficients.ravel().tolist()))


def sampled_surface(path: LengthOverAngles, moved: Sequence[str], held: Mapping[str, float]) -> MuscleSurface:
    """The surface through a path's lengths over one or two of its angles; its others are `held` [rad]."""
    axes, at = [], []
    for angle in moved:
        low, high = path.range(angle)
        step = (high - low) / SURFACE.sampled_cell_count
        axes.append(SurfaceAxis(angle, 1.0, 0.0, low, step, SURFACE.sampled_cell_count))
        at.append(
            np.sort(
                np.concatenate(
                    (np.linspace(low, high, SURFACE.sampled_cell_count + 1), [low + 0.5 * step, high - 0.5 * step])
                )
            )
        )
    grid = np.meshgrid(*at, indexing="ij")
    every = {a: q.ravel() for a, q in zip(moved, grid, strict=True)}
    every |= {a: np.full(grid[0].size, held[a]) for a in path.angles if a not in moved}
    coefficients = path.length(every).reshape(grid[0].shape)
    for k, (axis, q) in enumerate(zip(axes, at, strict=True)):
        found = np.linalg.solve(_basis(axis, q)[0], np.moveaxis(coefficients, k, 0))
        coefficients = np.moveaxis(found, 0, k)
    return MuscleSurface(tuple(axes), tuple(coefficients.ravel().tolist()))


def fit_muscle_surface(
    length: np.ndarray, angles: Mapping[str, np.ndarray], arms: Mapping[str, np.ndarray]
) -> tuple[MuscleSurface, float, float]:
    """The surface nearest to lengths (n,) [m] and arms by joint (n,) [m] that were recorded with angles (n,) [rad].

    Over one joint and the neighbour that explains most of what it leaves; gives the RMSE of length and of arms too [m].
    """
    own = tuple(arms)
    if not 1 <= len(own) <= 2 or any(name not in angles for name in own):
        raise ValueError(f"found arms about {', '.join(own) or 'no joint'}, expected one or two joints with angles")
    best: tuple[MuscleSurface, float, float] | None = None
    for others in ((), *((name,) for name in angles if len(own) == 1 and name not in own)):
        found = _fit_surface(length, {n: angles[n] for n in (*own, *others)}, arms)
        if best is None or found[1] + found[2] < 0.8 * (best[1] + best[2]):
            best = found
    assert best is not None  # the first is without a neighbour, and becomes the best
    return best


def _fit_surface(
    length: np.ndarray, angles: Mapping[str, np.ndarray], arms: Mapping[str, np.ndarray]
) -> tuple[MuscleSurface, float, float]:
    axes = []
    for (name, q), cells in zip(
        angles.items(),
        SURFACE.fitted_cell_counts if len(arms) == 1 else SURFACE.fitted_cell_counts[:1] * 2,
        strict=False,
    ):
        low, high = float(q.min()), float(q.max())
        more = SURFACE.range_margin_share * max(high - low, 0.1)
        axes.append(SurfaceAxis(name, 1.0, 0.0, low - more, (high - low + 2.0 * more) / cells, cells))
    bases = [_basis(a, angles[a.angle]) for a in axes]

    def product(bent: int | None) -> np.ndarray:
        parts = [basis[int(k == bent)] for k, basis in enumerate(bases)]
        return parts[0] if len(parts) == 1 else np.einsum("ni,nj->nij", *parts).reshape(len(length), -1)

    # One metre of length and one metre per radian count alike; differences of third order keep it smooth.
    names = [a.angle for a in axes]
    rows, told = [product(None)], [length]
    for joint, arm in arms.items():
        rows.append(product(names.index(joint)))
        told.append(-arm)
    smooth: list[np.ndarray] = [np.diff(np.eye(a.cells + 3), 3, axis=0) for a in axes]
    if len(axes) == 2:
        first, second = (np.eye(a.cells + 3) for a in axes)
        smooth = [np.kron(smooth[0], second), np.kron(first, smooth[1])]
    weight = np.sqrt(SURFACE.roughness_weight * len(length))
    a = np.vstack([*rows, *(weight * s for s in smooth)])
    b = np.concatenate([*told, np.zeros(sum(len(s) for s in smooth))])
    coefficients = np.linalg.lstsq(a, b, rcond=None)[0]
    left = [row @ coefficients - x for row, x in zip(rows, told, strict=True)]
    surface = MuscleSurface(tuple(axes), tuple(coefficients.tolist()))
    of_length, of_arms = (float(np.sqrt(np.mean(np.square(e)))) for e in (left[0], left[1:]))
    return surface, of_length, of_arms


def _basis(axis: SurfaceAxis, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and slopes of every spline of an axis at angles `q` (n,) [rad]; (n, cells + 3) each."""
    from scipy.interpolate import BSpline

    knots = axis.start + axis.step * np.arange(-3, axis.cells + 4)
    spline = BSpline(knots, np.eye(axis.cells + 3), 3)
    return spline(q), spline(q, 1)


def _even_knots_matrix(knots: np.ndarray, start: float, step: float, cells: int) -> np.ndarray:
    """What turns coefficients of a spline with repeated knots at its ends into those of even knots, (n, n)."""
    from scipy.interpolate import BSpline

    even = start + step * np.arange(-3, cells + 4)
    at = start + step * cells * (0.5 - 0.5 * np.cos(np.pi * np.arange(4 * (cells + 3)) / (4 * (cells + 3) - 1)))
    old, new = (BSpline(t, np.eye(cells + 3), 3)(np.clip(at, start, start + step * cells)) for t in (knots, even))
    return np.linalg.lstsq(new, old, rcond=None)[0]
