r"""Identify a spring on the bench, such as a series-elastic element whose far end is locked.

.. math::
   \tau = k q + d \dot q + f z + J \ddot q + \tau_0 \; (+ k_3 q^3)

with q the deflection, f half the width of its hysteresis and J what moves with the end that is driven. z moves by dq/w
and stays within -1 and 1 (an elastic-plastic element), so that hysteresis builds up over the way w. A spring that
hardens or softens has a cubic term, which is fitted if it is told by the test that chooses friction families: it must
save 5 % of the error on blocks left out, and its p value must be below 5 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from ...signals.judged import require_fitted
from ...signals.motion import Motion
from ..block_test import compare_held_out
from ..crossed_residuals import cross_validated_residuals
from ..parameter import Parameter
from ..regression import Solution
from ..uncertainty import sandwich_covariance

SPRING_PARAMETERS = ("stiffness", "damping", "hysteresis", "inertia", "offset")
"""Names of a linear spring's parameters, in the order of its columns."""

CUBIC_PARAMETER = "cubic_stiffness"
"""Name of the parameter of a spring that hardens (> 0) or softens (< 0)."""

MASS_UNITS = {("N*m", "rad"): "kg*m^2", ("N", "m"): "kg"}
"""Unit of an inertia by those of effort and deflection, where it has a name of its own."""

WAY_SHARE_GRID = np.geomspace(2e-4, 0.05, 17)
"""Ways over which hysteresis may build up, divided by the range of the deflection. The smallest is as good as none."""

NEGLECTED_WAY_RATIOS = (0.25, 0.5, 2.0, 4.0)
"""Ways beside the fitted one, divided by it: hysteresis builds up over several at once."""

INERTIA_REFUSAL = "what hysteresis does where it turns round looks like inertia"
"""Reason for refusing the interval of the inertia: with hysteresis of another law (a bristle of Dahl, 24 draws) it held
in 15 of 24, where intervals of stiffness, damping and offset held in all and of hysteresis in 22."""

MIN_OWN_COLUMN_SHARE = 0.05
"""Columns are told apart if each keeps at least this share of its norm beside the others."""


@dataclass(frozen=True)
class SpringFit:
    """A spring's parameters, and what they leave unexplained.

    Attributes
    ----------
    parameters : tuple of Parameter
        Stiffness, damping, hysteresis, inertia, offset, and the cubic stiffness of a spring that is not linear. Their
        intervals allow for coloured residuals and for physics that the model has not: see `fit_spring`.
    is_linear : bool
        Whether the spring has no cubic term.
    deflection : tuple of float
        Smallest and largest fitted deflection [rad or m].
    effort_error : float
        100 ||effort - model|| / ||effort|| over the fitted samples [%].
    linear_error : float
        The same of the spring without a cubic term [%].
    """

    parameters: tuple[Parameter, ...]
    is_linear: bool
    deflection: tuple[float, float]
    effort_error: float
    linear_error: float
    way: float  # way over which hysteresis builds up from its middle [rad or m]
    values: np.ndarray = field(repr=False)  # (p,) parameters

    def predict(self, motion: Motion) -> np.ndarray:
        """Return the effort in the rows of a motion, fitted or held out, shape (m,), in the effort's unit."""
        return spring_columns(motion, self.way, cubic=not self.is_linear) @ self.values


def spring_columns(motion: Motion, way: float, *, cubic: bool) -> np.ndarray:
    """Return the columns of a spring in the rows of a motion, shape (m, 5), or (m, 6) with a `cubic` term.

    Hysteresis builds up over the `way` [rad or m].
    """
    columns = [
        motion.position,
        motion.velocity,
        motion.smooth(bending(motion.position, way)),
        motion.acceleration,
        np.ones_like(motion.position),
    ]
    if cubic:
        columns.append(motion.position**3)
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
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    solution = np.linalg.lstsq(columns / scale, effort, rcond=1e-10)[0]
    residual = effort - columns / scale @ solution
    covariance = sandwich_covariance(columns / scale, residual, lengths) / np.outer(scale, scale)
    return solution / scale, covariance, residual


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
            "more with an effort: deflect it both ways, slowly and fast"
        )
    span = float(np.ptp(np.concatenate([m.position for m in motions])))
    if not span > 0.0:
        raise IdentificationError("found a deflection that never changes, expected one that does, both ways")

    def stacked(way: float, *, cubic: bool) -> np.ndarray:
        return np.concatenate([spring_columns(m, way, cubic=cubic) for m in motions])

    left = [float(np.sum(solve_spring(stacked(span * w, cubic=True), target, lengths)[2] ** 2)) for w in WAY_SHARE_GRID]
    way = span * float(WAY_SHARE_GRID[int(np.argmin(left))])
    linear, cubic = stacked(way, cubic=False), stacked(way, cubic=True)
    _require_told_apart(linear)
    crossed = {
        name: cross_validated_residuals(_as_solution(x, target, lengths), lengths)
        for name, x in (("linear", linear), ("cubic", cubic))
    }
    is_linear = compare_held_out(crossed).first(("linear", "cubic")) == "linear"
    columns = linear if is_linear else cubic
    values, statistical, residual = solve_spring(columns, target, lengths)
    q, v = cubic[:, 0], cubic[:, 1]
    other_ways = [stacked(ratio * way, cubic=False)[:, 2] - cubic[:, 2] for ratio in NEGLECTED_WAY_RATIOS]
    richer = np.column_stack([cubic, q * np.abs(q), v * np.abs(v), *other_ways])
    others, unsure, _ = solve_spring(richer, target, lengths)
    count = len(values)
    errors = np.sqrt(np.maximum(np.diag(statistical), 0.0))
    # Physics that may be there moves a parameter, and makes it less sure.
    total = np.sqrt((others[:count] - values) ** 2 + np.maximum(errors**2, np.diag(unsure)[:count]))
    names = SPRING_PARAMETERS if is_linear else (*SPRING_PARAMETERS, CUBIC_PARAMETER)
    rate = {"damping": f"*s/{coordinate}", "inertia": f"*s^2/{coordinate}", CUBIC_PARAMETER: f"/{coordinate}^3"}
    added = {"hysteresis": "", "offset": "", "stiffness": f"/{coordinate}"} | rate
    units = {name: f"{effort}{more}" for name, more in added.items()}
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
        is_linear,
        (float(q.min()), float(q.max())),
        100.0 * float(np.linalg.norm(residual)) / size,
        100.0 * float(np.linalg.norm(solve_spring(linear, target, lengths)[2])) / size,
        way,
        values,
    )  # fmt: skip


def _require_told_apart(columns: np.ndarray) -> None:
    """Refuse columns of which one is nearly made up of the others."""
    for i in range(3):
        others = np.delete(columns, i, axis=1)
        own = columns[:, i] - others @ np.linalg.lstsq(others, columns[:, i], rcond=1e-10)[0]
        norm = float(np.linalg.norm(columns[:, i]))
        if not np.linalg.norm(own) > MIN_OWN_COLUMN_SHARE * norm:
            share = 100.0 * float(np.linalg.norm(own)) / norm if norm else 0.0
            raise IdentificationError(
                f"found {share:.1f} % of what {SPRING_PARAMETERS[i]} does to be its own, expected "
                f"{100.0 * MIN_OWN_COLUMN_SHARE:.0f} % or more: deflect the spring both ways, at two speeds or more"
            )


def _as_solution(columns: np.ndarray, effort: np.ndarray, lengths: Sequence[int]) -> Solution:
    """Return the solution of an `effort` (m,) by `columns` (m, p) as cross-validation takes it."""
    values, _, residual = solve_spring(columns, effort, lengths)
    return Solution(values, columns, residual, np.ones(len(effort)), np.zeros(len(values), bool), 1, True)
