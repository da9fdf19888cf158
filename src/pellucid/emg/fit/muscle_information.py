r"""Information that a recording contains on calibrated muscles: covariance, cost profiles and verdicts.

With J the Jacobian of the errors in the cost, S the long-run covariance of the scores (errors are coloured) and
:math:`\lambda` the weight of anatomy, the covariance of an estimate is the sum of the effects of noise and of the
prior:

.. math::
   C = H^{-1} (S + \lambda^4 I) H^{-1}, \qquad H = J^T J + \lambda^2 I

in squared standard deviations among people, so that 1 is the variance without any recording. For coupled priors the
inverse of their correlation matrix replaces I.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...models.parameter import Parameter, Verdict
from ...numerics.searches.bounded_least_squares import bounded_least_squares
from ...numerics.uncertainty import block_length, correlation_time, degrees_of_freedom, long_run_covariance
from .muscle_calibration import MuscleFit

MAX_IDENTIFIED_SPREAD_SHARE = 0.7
"""A parameter is not identified if its standard error exceeds this share of the standard deviation among people."""

MAX_NAMED_PARAMETERS = 6
"""A verdict names at most this many parameters where there are more than twice as many."""

AT_BOUND_REFUSAL = "on a physiological bound: not identifiable"
"""Reason why a parameter on a bound has no standard error: its value follows from the choice of the bound."""


@dataclass(frozen=True, eq=False)
class CostProfile:
    """Profile of the cost along one parameter, with all others refitted."""

    name: str
    values: np.ndarray  # (k,) values at which the parameter was fixed, in its unit
    costs: np.ndarray  # (k,) lowest cost at each of them


def information(fit: MuscleFit) -> np.ndarray:
    """Return the Fisher information of the recording alone, per squared standard deviation among people, (p, p)."""
    data, scores, _ = recording_information(fit)
    inverse = np.linalg.pinv(scores, hermitian=True, rcond=1e-10)
    return data @ inverse @ data


def covariance(fit: MuscleFit) -> np.ndarray:
    """Return the covariance of the estimate in squared standard deviations among people, shape (p, p)."""
    _, scores, _ = recording_information(fit)
    pull = fit.problem.weight**2
    free = np.flatnonzero(~fit.at_bound)
    inverse = np.linalg.inv(fit.normal[np.ix_(free, free)])
    result = np.zeros_like(fit.normal)
    inner = np.ix_(free, free)
    result[inner] = inverse @ (scores[inner] + pull**2 * fit.problem.hold[inner]) @ inverse
    return result


def muscle_parameters(fit: MuscleFit) -> tuple[Parameter, ...]:
    """Return the parameters with standard errors; unidentified ones are marked, and those on a bound have none."""
    sd, gains, values = np.sqrt(np.diag(covariance(fit))), fit.problem.gains(fit.z), fit.problem.values(fit.z)
    return tuple(
        Parameter(
            name, unit, float(x), float("nan" if b else s * g), bool(b),
            identifiable=bool(s < MAX_IDENTIFIED_SPREAD_SHARE and not b),
            refused=AT_BOUND_REFUSAL if b else "",
        )
        for name, unit, x, s, g, b in zip(
            fit.problem.names, fit.problem.units, values, sd, gains, fit.at_bound, strict=True
        )
    )  # fmt: skip


def reported_covariance(fit: MuscleFit) -> np.ndarray:
    """Return the covariance in the parameters' units, (p, p); NaN in rows and columns of parameters on a bound."""
    gains = np.where(fit.at_bound, np.nan, fit.problem.gains(fit.z))
    return covariance(fit) * np.outer(gains, gains)


def count_bounds_reported_as_estimates(fit: MuscleFit, reported: Sequence[Parameter]) -> int:
    """Count the parameters among `reported` that ended on a bound and are reported as if they had been estimated."""
    found = {p.name: p for p in reported}
    return sum(
        found[name].identifiable or found[name].trusted or bool(np.isfinite(found[name].standard_error))
        for name in np.array(fit.problem.names)[fit.at_bound]
    )


def cost_profile(fit: MuscleFit, name: str, values: np.ndarray) -> CostProfile:
    """Fix one parameter at each of `values`, shape (k,), and refit all others."""
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
    """Return the verdicts on parameters that the recording does not determine; `what` names the calibration."""
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
    """Join parameters' names, only the first ones where they are too many to be read."""
    if len(names) <= 2 * MAX_NAMED_PARAMETERS:
        return ", ".join(names)
    return f"{', '.join(names[:MAX_NAMED_PARAMETERS])} and {len(names) - MAX_NAMED_PARAMETERS} more"


def recording_information(fit: MuscleFit) -> tuple[np.ndarray, np.ndarray, float]:
    """Return J'J of the recording alone, the long-run covariance of its scores, each (p, p), and its degrees of
    freedom."""
    problem = fit.problem
    error, slopes = problem.weighed(fit.z)
    weight = np.atleast_2d(problem.samples.weight)
    counted = np.any(weight > 0.0, axis=0)
    starts = (*problem.samples.data.starts, weight.shape[1])
    lengths = [n for n in (int(counted[a:b].sum()) for a, b in pairwise(starts)) if n]
    rows = np.atleast_2d(error)
    # Errors of several joints are correlated, so their scores are summed, and the longest correlation time is used.
    scores = (slopes * error).reshape(len(slopes), len(rows), -1).sum(axis=1)[:, counted].T
    memory = max(correlation_time(row[counted], lengths) for row in rows)
    flat = slopes.reshape(len(slopes), -1)
    freedom = degrees_of_freedom(block_length(memory, len(scores)), len(scores))
    return flat @ flat.T, long_run_covariance(scores, rows[0][counted], lengths, memory), freedom
