r"""What a recording says of muscles, and what it does not: information, covariance, profiles, and verdicts.

With J the Jacobian of the errors in the cost, S the long-run covariance of the scores (errors are coloured), anatomy
pulling by :math:`\lambda^2`, an estimate differs from the truth by what noise pushes and by what anatomy pulls away:

.. math::
   C = H^{-1} (S + \lambda^4 I) H^{-1}, \qquad H = J^T J + \lambda^2 I

in standard deviations among people squared: 1 is what is known without a recording. Where priors are coupled, the
inverse of their correlations stands for I.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..parameter import Parameter, Verdict
from ..searches.bounded_least_squares import bounded_least_squares
from ..uncertainty import block_length, correlation_time, freedom_of, long_run_covariance
from .muscle_calibration import MuscleFit

KNOWN = 0.7
"""A parameter whose standard error is more than this share of the spread among people is not identified."""

MOST_NAMED = 6
"""Parameters that a verdict lists where there are more than twice as many."""

BOUND = "on a physiological bound: not identifiable"
"""Why a parameter that ended on one has no standard error: another bound would have been another number."""


@dataclass(frozen=True, eq=False)
class CostProfile:
    """How the cost rises as one parameter is held and all others are found again."""

    name: str
    values: np.ndarray  # (k,) Of the parameter, in its unit
    costs: np.ndarray  # (k,) The lowest with it held


def information(fit: MuscleFit) -> np.ndarray:
    """Fisher information of the recording alone, per squared standard deviation among people. Gives (p, p)."""
    data, scores, _ = told_by_recording(fit)
    inverse = np.linalg.pinv(scores, hermitian=True, rcond=1e-10)
    return data @ inverse @ data


def covariance(fit: MuscleFit) -> np.ndarray:
    """Covariance of the estimate, in standard deviations among people. Gives (p, p)."""
    _, scores, _ = told_by_recording(fit)
    pull = fit.problem.weight**2
    free = np.flatnonzero(~fit.at_bound)
    inverse = np.linalg.inv(fit.normal[np.ix_(free, free)])
    result = np.zeros_like(fit.normal)
    inner = np.ix_(free, free)
    result[inner] = inverse @ (scores[inner] + pull**2 * fit.problem.hold[inner]) @ inverse
    return result


def muscle_parameters(fit: MuscleFit) -> tuple[Parameter, ...]:
    """Parameters with standard errors; unidentifiable ones are marked, and one on a bound has none."""
    sd, gains, values = np.sqrt(np.diag(covariance(fit))), fit.problem.gains(fit.z), fit.problem.values(fit.z)
    return tuple(
        Parameter(
            name, unit, float(x), float("nan" if b else s * g), bool(b), bool(s < KNOWN and not b),
            refused=BOUND if b else "",
        )
        for name, unit, x, s, g, b in zip(
            fit.problem.names, fit.problem.units, values, sd, gains, fit.at_bound, strict=True
        )
    )  # fmt: skip


def reported_covariance(fit: MuscleFit) -> np.ndarray:
    """Covariance in the parameters' units, (p, p); NaN in rows and columns of what ended on a bound."""
    gains = np.where(fit.at_bound, np.nan, fit.problem.gains(fit.z))
    return covariance(fit) * np.outer(gains, gains)


def bounds_told_as_estimates(fit: MuscleFit, reported: Sequence[Parameter]) -> int:
    """How many of the parameters `reported` stand on a bound of the fit and are given as if they had been found."""
    found = {p.name: p for p in reported}
    return sum(
        found[name].identifiable or found[name].trusted or bool(np.isfinite(found[name].standard_error))
        for name in np.array(fit.problem.names)[fit.at_bound]
    )


def profile(fit: MuscleFit, name: str, values: np.ndarray) -> CostProfile:
    """Hold one parameter at one value after another and find all others again. `values` (k,)."""
    problem, i = fit.problem, fit.problem.names.index(name)
    costs = []
    for value in np.asarray(values, float):
        held = problem.values(fit.z)
        held[i] = value
        low, high = problem.lower.copy(), problem.upper.copy()
        low[i] = high[i] = np.clip(problem.deviations(held)[i], low[i], high[i])
        costs.append(bounded_least_squares(problem.equations, fit.z, low, high).cost)
    return CostProfile(name, np.asarray(values, float), np.array(costs))


def muscle_verdicts(fit: MuscleFit, what: str) -> tuple[Verdict, ...]:
    """Sentences on what a recording does not show."""
    found = muscle_parameters(fit)
    bound = [p for p in found if p.at_bound]
    unknown = [p for p in found if not p.at_bound and not p.identifiable]
    said = []
    if bound:
        names = ", ".join(f"{p.name} ({p.value:.3g}{'' if p.unit == '1' else ' ' + p.unit})" for p in bound)
        said.append(
            Verdict(
                "warning",
                f"{what}, muscles: {len(bound)} of {len(found)} parameters ended on a physiological bound and are "
                f"undetermined: {names}. The torque is what was fitted; these numbers measure nothing of the person.",
            )
        )
    if unknown:
        said.append(
            Verdict(
                "note",
                f"{what}, muscles: the recording does not identify {_listed([p.name for p in unknown])}: each stays "
                "within what people differ by about its anatomical value.",
            )
        )
    if not said:
        said.append(Verdict("good", f"{what}, muscles: all {len(found)} parameters are identified, none on a bound."))
    return tuple(said)


def _listed(names: Sequence[str]) -> str:
    """Parameters by name, the first of them where they are too many to be read."""
    if len(names) <= 2 * MOST_NAMED:
        return ", ".join(names)
    return f"{', '.join(names[:MOST_NAMED])} and {len(names) - MOST_NAMED} more"


def told_by_recording(fit: MuscleFit) -> tuple[np.ndarray, np.ndarray, float]:
    """J'J of the recording alone, the long-run covariance of its scores, each (p, p), and the degrees of freedom of
    that."""
    problem = fit.problem
    error, slopes = problem.weighed(fit.z)
    weight = np.atleast_2d(problem.samples.weight)
    counted = np.any(weight > 0.0, axis=0)
    starts = (*problem.samples.data.starts, weight.shape[1])
    lengths = [n for n in (int(counted[a:b].sum()) for a, b in pairwise(starts)) if n]
    rows = np.atleast_2d(error)
    # Joints err at the same time: their scores are one sum, which remembers as long as the slowest of them.
    scores = (slopes * error).reshape(len(slopes), len(rows), -1).sum(axis=1)[:, counted].T
    memory = max(correlation_time(row[counted], lengths) for row in rows)
    flat = slopes.reshape(len(slopes), -1)
    freedom = freedom_of(block_length(memory, len(scores)), len(scores))
    return flat @ flat.T, long_run_covariance(scores, rows[0][counted], lengths, memory), freedom
