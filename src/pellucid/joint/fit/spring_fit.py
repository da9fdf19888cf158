r"""Identify a spring on the bench, such as a series-elastic element whose far end is locked.

.. math::
   \tau = k q + d \dot q + f z + J \ddot q + \tau_0 \; (+ k_3 q^3)

with q the deflection, f half the width of its hysteresis and J what moves with the end that is driven. z moves by dq/w
and stays within -1 and 1 (an elastic-plastic element), so that hysteresis builds up over the way w. A spring that
hardens or softens has a cubic term. A spring with backlash does not pull while q is within a gap; beyond the gap, q
counts from the gap's edge. Either is fitted if it passes the test that chooses friction families: it must save 5 % of
the cross-validated error, with a p value below 5 %. The deflection counts from 0, or from the middle of its range if
that range does not contain 0, as with an angle whose zero is elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...numerics.block_test import compare_held_out
from ...numerics.motion import Motion, require_fitted
from ...numerics.regression import Solution, column_norms, triangular_factor
from ...numerics.uncertainty import sandwich_covariance
from .friction_solver import cross_validated_residuals

SPRING_PARAMETERS = ("stiffness", "damping", "hysteresis", "inertia", "offset")
"""Names of a linear spring's parameters, in the order of its columns."""

CUBIC_PARAMETER = "cubic_stiffness"
"""Name of the parameter of a spring that hardens (> 0) or softens (< 0)."""

BACKLASH_PARAMETER = "backlash"
"""Name of the parameter of a spring that does not pull within a gap: the width of the gap."""

SPRING_SHAPES = ("linear", "cubic", "backlash")
"""Shapes of a spring, the simplest first."""

FIRST_GAP_SHARES = (0.03, 0.1, 0.25, 0.5)
"""Widths of the gap from which its edges are searched, divided by the range of the deflection."""

MAX_GAP_SHARE = 0.8
"""A gap is at most this share of the range: beyond its edges the spring must be seen."""

GAP_ITERATION_COUNT = 30
"""Largest number of Gauss-Newton steps of the search for the gap's edges; it needs about ten."""

FULL_STEP_COUNT = 12
"""Steps after this number are halved."""

GAP_TOLERANCE = 1e-4
"""The search ends when the edges move by less than this share of the range."""

MASS_UNITS = {("N*m", "rad"): "kg*m^2", ("N", "m"): "kg"}
"""Unit of an inertia by those of effort and deflection, where it has a name of its own."""

WAY_SHARE_GRID = np.geomspace(2e-4, 0.05, 17)
"""Ways over which hysteresis may build up, divided by the range of the deflection. The smallest is as good as none."""

NEGLECTED_WAY_RATIOS = (0.25, 0.5, 2.0, 4.0)
"""Other displacements over which hysteresis builds up, relative to the fitted one; real hysteresis has several."""

INERTIA_REFUSAL = "hysteresis at reversals resembles inertia"
"""Reason for refusing the interval of the inertia: with hysteresis of another law (a bristle of Dahl, 24 draws) it held
in 15 of 24, where intervals of stiffness, damping and offset held in all and of hysteresis in 22."""

MIN_OWN_COLUMN_SHARE = 0.05
"""Smallest share of a column's norm that must be independent of the other columns."""


@dataclass(frozen=True)
class SpringFit:
    """A spring's parameters, and what they leave unexplained.

    Attributes
    ----------
    parameters : tuple of Parameter
        Stiffness, damping, hysteresis, inertia, offset, and the cubic stiffness or the backlash of a spring that is not
        linear. Their intervals allow for coloured residuals and for physics that the model has not: see `fit_spring`.
    shape : str
        ``"linear"``, ``"cubic"`` or ``"backlash"``.
    deflection : tuple of float
        Smallest and largest fitted deflection [rad or m].
    effort_error : float
        100 ||effort - model|| / ||effort|| over the fitted samples [%].
    linear_error : float
        The same of the spring without a cubic term and without a gap [%].
    """

    parameters: tuple[Parameter, ...]
    shape: str
    deflection: tuple[float, float]
    effort_error: float
    linear_error: float
    way: float  # way over which hysteresis builds up from its middle [rad or m]
    geometry: SpringGeometry
    values: np.ndarray = field(repr=False)  # (p,) coefficients of the columns

    @property
    def is_linear(self) -> bool:
        """Whether the spring has neither a cubic term nor a gap."""
        return self.shape == "linear"

    def predict(self, motion: Motion) -> np.ndarray:
        """Return the effort in the rows of a motion, fitted or held out, shape (m,), in the effort's unit."""
        return spring_columns(motion, self.way, self.geometry, cubic=self.shape == "cubic") @ self.values


@dataclass(frozen=True)
class SpringGeometry:
    """The position from which a deflection counts, and the gap in which the spring does not pull [rad or m]."""

    origin: float = 0.0  # position at which the deflection is 0
    gap: tuple[float, float] | None = None  # lower and upper edge of the gap, as positions

    def deflection(self, motion: Motion) -> np.ndarray:
        """Return the deflection in a motion, shape (n,), without what lies within the gap."""
        if self.gap is None:
            return motion.position - self.origin
        return motion.position - motion.smooth(np.clip(motion.position, *self.gap))

    def edge_columns(self, motion: Motion) -> np.ndarray:
        """Return whether each row of a motion is below, and whether it is above the gap, shape (m, 2)."""
        assert self.gap is not None
        sides = np.column_stack([motion.position < self.gap[0], motion.position > self.gap[1]]).astype(float)
        return motion.rows(np.column_stack([motion.smooth(side) for side in sides.T]))


def spring_columns(motion: Motion, way: float, geometry: SpringGeometry, *, cubic: bool) -> np.ndarray:
    """Return the columns of a spring in the rows of a motion, shape (m, 5), or (m, 6) with a `cubic` term.

    Hysteresis builds up over the `way` [rad or m].
    """
    deflection = geometry.deflection(motion)
    columns = [
        deflection,
        motion.velocity,
        motion.smooth(bending(motion.position, way)),
        motion.acceleration,
        np.ones_like(motion.position),
    ]
    if cubic:
        columns.append(deflection**3)
    return motion.rows(np.column_stack(columns))


def bending(position: np.ndarray, way: float) -> np.ndarray:
    """Return an elastic-plastic element along a deflection, both (n,): 1 more over a `way`, but no more than 1."""
    bend = np.zeros(len(position))
    now = 0.0
    for i, step in enumerate((np.diff(position) / way).tolist(), 1):
        now = min(max(now + step, -1.0), 1.0)
        bend[i] = now
    return bend


def solve_spring(
    columns: np.ndarray, effort: np.ndarray, lengths: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the solution (p,), its covariance (p, p) and the residual (m,) of an `effort` (m,) by `columns` (m, p)."""
    scale = np.maximum(column_norms(columns), np.finfo(float).tiny)
    factor = triangular_factor(columns, effort)
    solution = np.linalg.lstsq(factor[:, :-1] / scale, factor[:, -1], rcond=1e-10)[0] / scale
    residual = effort - columns @ solution
    return solution, sandwich_covariance(columns, residual, lengths), residual


def fit_spring(motions: Sequence[Motion], *, coordinate: str, effort: str) -> SpringFit:
    """Fit a spring to motions, and choose whether it is linear.

    The standard errors have two parts: that of coloured residuals, and how far each parameter moves, and how much less
    sure it is, if the spring may harden, pull harder one way, have a damping that declines with speed and a hysteresis
    that builds up over other ways too.

    Parameters
    ----------
    motions : sequence of Motion
        Fitted motions; the position is the deflection.
    coordinate, effort : str
        Units: "rad" or "m", and "N*m", "N", "A" or "V".

    Returns
    -------
    SpringFit

    Raises
    ------
    IdentificationError
        If no sample is left, or the motion does not tell stiffness, damping and hysteresis apart.
    """
    require_fitted(motions, "fit_spring")
    target = np.concatenate([m.rows(m.effort) for m in motions]) if motions else np.zeros(0)
    lengths = [len(m.rows(m.effort)) for m in motions]
    size = float(np.linalg.norm(target))
    if len(target) < 10 * (len(SPRING_PARAMETERS) + 1) or not size > 0.0:
        raise IdentificationError(
            f"found {len(target)} samples in which the spring moves, expected {10 * (len(SPRING_PARAMETERS) + 1)} or "
            "more with an effort: deflect the spring in both directions, slowly and fast"
        )
    position = np.concatenate([m.position for m in motions])
    low, high = float(position.min()), float(position.max())
    span = high - low
    if not span > 0.0:
        raise IdentificationError("found a constant deflection, expected one that changes in both directions")
    plain = SpringGeometry(0.0 if low <= 0.0 <= high else 0.5 * (low + high))

    def stacked(way: float, geometry: SpringGeometry = plain, *, cubic: bool = False) -> np.ndarray:
        return np.concatenate([spring_columns(m, way, geometry, cubic=cubic) for m in motions])

    left = [float(np.sum(solve_spring(stacked(span * w, cubic=True), target, lengths)[2] ** 2)) for w in WAY_SHARE_GRID]
    way = span * float(WAY_SHARE_GRID[int(np.argmin(left))])
    tried = {"linear": stacked(way), "cubic": stacked(way, cubic=True)}
    _require_told_apart(tried["linear"])
    gap = _find_gap(motions, target, lengths, way, (low, high))
    geometries = dict.fromkeys(SPRING_SHAPES, plain)
    if gap is not None:
        geometries["backlash"] = gap
        # Beside the spring the edges of its gap are free, which either side shows.
        tried["backlash"] = np.hstack([stacked(way, gap), _edges(motions, gap)])
    crossed = {name: cross_validated_residuals(_as_solution(x, target, lengths), lengths) for name, x in tried.items()}
    shape = compare_held_out(crossed).first(tuple(tried))
    geometry, columns = geometries[shape], tried[shape]
    values, statistical, residual = solve_spring(columns, target, lengths)
    q, v = stacked(way, geometry)[:, 0], columns[:, 1]
    other_ways = [stacked(ratio * way)[:, 2] - columns[:, 2] for ratio in NEGLECTED_WAY_RATIOS]
    hardens = [] if shape == "cubic" else [q**3]
    richer = np.column_stack([columns, *hardens, q * np.abs(q), v * np.abs(v), *other_ways])
    others, unsure, _ = solve_spring(richer, target, lengths)
    count = len(values)
    unsure = unsure[:count, :count]
    if gap is not None and shape == "backlash":
        to_backlash = np.zeros(count)
        to_backlash[-2:] = 1.0 / values[0], -1.0 / values[0]  # a side that pulls less has its edge farther out
        statistical, unsure = (_with_backlash(c, to_backlash) for c in (statistical, unsure))
        width = gap.gap[1] - gap.gap[0] if gap.gap else 0.0
        others = np.append(others[: count - 2], width + to_backlash @ others[:count])
        values = np.append(values[:-2], width)
        columns = np.column_stack([columns[:, :-2], values[0] * (columns[:, -2] - columns[:, -1]) / 2.0])
        count -= 1
    errors = np.sqrt(np.maximum(np.diag(statistical), 0.0))
    # Physics that may be there moves a parameter, and makes it less sure.
    total = np.sqrt((others[:count] - values) ** 2 + np.maximum(errors**2, np.diag(unsure)))
    more = {"linear": (), "cubic": (CUBIC_PARAMETER,), "backlash": (BACKLASH_PARAMETER,)}[shape]
    names = (*SPRING_PARAMETERS, *more)
    rate = {"damping": f"*s/{coordinate}", "inertia": f"*s^2/{coordinate}", CUBIC_PARAMETER: f"/{coordinate}^3"}
    added = {"hysteresis": "", "offset": "", "stiffness": f"/{coordinate}"} | rate
    units = {name: f"{effort}{more}" for name, more in added.items()} | {BACKLASH_PARAMETER: coordinate}
    if (effort, coordinate) in MASS_UNITS:
        units["inertia"] = MASS_UNITS[effort, coordinate]
    return SpringFit(
        tuple(
            Parameter(
                name, units[name], float(value), float(whole),
                identifiable=bool(abs(value) > 1.96 * whole), statistical_error=float(own),
                influence=float(np.linalg.norm(columns[:, i]) / size),
                refused=INERTIA_REFUSAL if name == "inertia" else "",
            )
            for i, (name, value, whole, own) in enumerate(zip(names, values, total, errors, strict=True))
        ),
        shape,
        (low, high),
        100.0 * float(np.linalg.norm(residual)) / size,
        100.0 * float(np.linalg.norm(solve_spring(tried["linear"], target, lengths)[2])) / size,
        way,
        geometry,
        values[: 6 if shape == "cubic" else 5],
    )  # fmt: skip


def _find_gap(
    motions: Sequence[Motion], target: np.ndarray, lengths: Sequence[int], way: float, ends: tuple[float, float]
) -> SpringGeometry | None:
    """Return the gap with which a spring explains the effort best, None if no start leads to one.

    A side on which the spring pulls more or less than its edge says moves that edge (Gauss-Newton).
    """
    span, best, least = ends[1] - ends[0], None, np.inf
    middle = _zero_crossing(motions, ends)
    for share in FIRST_GAP_SHARES:
        edges = np.array([middle - 0.5 * share * span, middle + 0.5 * share * span])
        for i in range(GAP_ITERATION_COUNT):
            gap = SpringGeometry(gap=(float(edges[0]), float(edges[1])))
            spring = np.concatenate([spring_columns(m, way, gap, cubic=False) for m in motions])
            columns = np.hstack([spring, _edges(motions, gap)])
            if not all(np.any(side > 0.5) for side in columns[:, -2:].T):
                break
            values, _, _ = solve_spring(columns, target, lengths)
            if not values[0] > 0.0:
                break
            moved = -values[-2:] / values[0]
            # Whole steps may lead to and fro between two pairs of edges.
            edges = np.clip(edges + moved * (1.0 if i < FULL_STEP_COUNT else 0.5), *ends)
            if not 0.0 < edges[1] - edges[0] < MAX_GAP_SHARE * span:
                break
            if np.abs(moved).max() < GAP_TOLERANCE * span:
                left = float(np.sum(solve_spring(spring, target, lengths)[2] ** 2))
                if left < least:
                    best, least = gap, left
                break
    return best


def _zero_crossing(motions: Sequence[Motion], ends: tuple[float, float]) -> float:
    """Return the position at which the spring pulls neither way, by a straight line of effort over position."""
    q, effort = (np.concatenate([getattr(m, name) for m in motions]) for name in ("position", "effort"))
    slope, start = np.polyfit(q - q.mean(), effort - 0.5 * (effort.max() + effort.min()), 1)
    return float(np.clip(q.mean() - start / slope if slope else q.mean(), *ends))


def _edges(motions: Sequence[Motion], gap: SpringGeometry) -> np.ndarray:
    return np.concatenate([gap.edge_columns(m) for m in motions])


def _with_backlash(covariance: np.ndarray, to_backlash: np.ndarray) -> np.ndarray:
    """Return a covariance with the gap's width instead of the last two coefficients, those of its edges."""
    to_own = np.eye(len(covariance))[:-2]
    change = np.vstack([to_own, to_backlash])
    return change @ covariance @ change.T


def _require_told_apart(columns: np.ndarray) -> None:
    """Refuse columns of which one is nearly made up of the others."""
    for i in range(3):
        others = np.delete(columns, i, axis=1)
        own = columns[:, i] - others @ np.linalg.lstsq(others, columns[:, i], rcond=1e-10)[0]
        norm = float(np.linalg.norm(columns[:, i]))
        if not np.linalg.norm(own) > MIN_OWN_COLUMN_SHARE * norm:
            share = 100.0 * float(np.linalg.norm(own)) / norm if norm else 0.0
            raise IdentificationError(
                f"found an independent share of {share:.1f} % for the effect of {SPRING_PARAMETERS[i]}, expected "
                f"{100.0 * MIN_OWN_COLUMN_SHARE:.0f} % or more: deflect the spring in both directions, at two or more "
                "speeds"
            )


def _as_solution(columns: np.ndarray, effort: np.ndarray, lengths: Sequence[int]) -> Solution:
    """Return the solution of an `effort` (m,) by `columns` (m, p) as cross-validation takes it."""
    values, _, residual = solve_spring(columns, effort, lengths)
    return Solution(values, columns, residual, np.ones(len(effort)), np.zeros(len(values), bool), 1, True)
