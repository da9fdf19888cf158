"""A joint's parameters as draws: least squares' own rows, physics that its family lacks, bounds that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ..discrepancy import Neglected, neglected
from ..joint.joint_estimate import JointEstimate, joint_states
from ..regression import Stack, effort_rows, rows_of
from ..uncertainty import block_length, correlation_time, freedom_of, student_over_normal
from .ensemble import SEED, Draws, drawn
from .marginal_likelihood import MarginalLikelihood, Noise, Prior
from .posterior import Posterior, summary

WEAK_EFFORT = 10.0
"""Standard deviation of what a parameter makes, in efforts as large as the recorded one, before any data."""

CHECKED = 1000
"""Draws of a family that is not linear whose effort is computed as it is, and by which they are weighed."""

MOST_SAMPLES = 200_000
"""Of recordings from which such a family's draws are weighed: a posterior is for small data."""


def joint_posterior(estimate: JointEstimate, data: Stack, **sampling) -> Posterior:
    """Draws of a least-squares `estimate`'s parameters from the rows it was found from; `sampling` is what `drawn`
    takes."""
    model, values = estimate.model, estimate.array
    samples = sum(len(m.effort) for m in data.motions)
    if not model.linear and samples > MOST_SAMPLES:
        raise IdentificationError(
            f"{samples} samples were fitted, expected at most {MOST_SAMPLES}: a posterior is for small data, and "
            f"{model.family} friction is not linear in its parameters"
        )
    jacobian, effort = rows_of(model, values, data)
    residual = data.target - effort
    states = joint_states(model, data, values)
    lacks = neglected(model.names, values, jacobian, residual, states, estimate.statistical)
    if lacks is None:
        raise IdentificationError("too few samples move, or nothing is left over, to tell the noise")
    likelihood = joint_likelihood(estimate, data, lacks, residual)
    free, scale = np.flatnonzero(lacks.free), lacks.scale
    covariance = estimate.covariance[np.ix_(free, free)] * np.outer(scale, scale)
    found = drawn(likelihood, likelihood.start(values[free] * scale, covariance), **sampling)
    if not model.linear and not found.unsettled:
        found = _weighed(found, estimate, data, lacks, likelihood)
    names = [model.names[i] for i in free]
    units = [model.unit(name) for name in names]
    title = f"Posterior of a joint with {model.family} friction"
    return summary(names, units, found, likelihood.prior, scale=scale, level=estimate.confidence, title=title)


def joint_likelihood(
    estimate: JointEstimate, data: Stack, lacks: Neglected, residual: np.ndarray
) -> MarginalLikelihood:
    """Of parameters in units of the effort that they make; `residual`, (m,), at the estimate."""
    free, scale = np.flatnonzero(lacks.free), lacks.scale
    lower, upper = (bound[free] * scale for bound in estimate.model.bounds())
    size = float(np.linalg.norm(data.target))
    prior = Prior(lower, upper, np.zeros(len(free)), np.full(len(free), WEAK_EFFORT * size))
    freedom = freedom_of(block_length(correlation_time(residual, data.lengths), len(residual)), len(residual))
    # Student's tails come with the freedom here, not with the variance.
    noise = Noise(lacks.noise / student_over_normal(freedom) ** 2, freedom)
    x, y, q = lacks.both, lacks.target, len(free)
    gram, along, square = x.T @ x, x.T @ y, float(y @ y)
    least = square - along @ np.linalg.lstsq(gram, along, rcond=None)[0]
    centre = estimate.array[free] * scale

    def misfit(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        step = values - centre
        left = square - 2.0 * step @ along[:q] + np.einsum("wi,ij,wj->w", step, gram[:q, :q], step)
        return left, along[q:] - step @ gram[:q, q:], gram[q:, q:]

    return MarginalLikelihood(misfit, prior, noise, least, x.shape[1], lacks.tied)


def _weighed(
    found: Draws, estimate: JointEstimate, data: Stack, lacks: Neglected, likelihood: MarginalLikelihood
) -> Draws:
    """Draws of a family that was taken as linear, drawn again by what its effort really is."""
    rng = np.random.default_rng(SEED)
    some = found.values[rng.choice(len(found.values), CHECKED, replace=False)]
    free, q = np.flatnonzero(lacks.free), len(lacks.scale)
    gram = lacks.columns.T @ lacks.columns
    left = []
    for place in some:
        values = estimate.array.copy()
        values[free] = place[:q] / lacks.scale
        effort = np.concatenate([effort_rows(estimate.model, values, m) for m in data.motions])
        left.append((data.target - effort)[lacks.rows])
    left = np.array(left)
    exact = replace(likelihood, misfit=lambda values: (np.sum(left**2, axis=1), left @ lacks.columns, gram))
    logs = exact(some) - likelihood(some)
    weights = np.exp(logs - logs.max())
    share = float(weights.sum() ** 2 / np.sum(weights**2) / CHECKED)
    chosen = some[rng.choice(CHECKED, CHECKED, p=weights / weights.sum())]
    return replace(found, values=chosen, independent=found.independent, weighed=share)
