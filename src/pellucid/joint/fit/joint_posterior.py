"""Posterior of a joint's parameters: its least-squares rows, the physics that its family neglects, and bounds."""

from __future__ import annotations

import numpy as np

from ..._errors import IdentificationError
from ...numerics.motion import Motion
from ...numerics.posterior.marginal_likelihood import Noise, Prior
from ...numerics.posterior.posterior import Posterior, summary
from ...numerics.posterior.straight import LinearisedModel
from ...numerics.regression import Stack, predict_effort_rows, regression_rows
from ...numerics.uncertainty import block_length, correlation_time, degrees_of_freedom, student_to_normal_ratio
from .discrepancy import neglected_columns
from .joint_estimate import JointEstimate, joint_states

PRIOR_EFFORT_SPREAD = 10.0
"""Prior standard deviation of the effort that one parameter produces, divided by the recorded effort."""

MAX_NONLINEAR_SAMPLES = 200_000
"""A nonlinear family is sampled only up to this many samples: reweighting computes every sample for every draw."""


def joint_posterior(estimate: JointEstimate, data: Stack[Motion], **sampling) -> Posterior:
    """Return the posterior of a least-squares `estimate`, from the rows that it was fitted to.

    `sampling` is passed on to `drawn`.
    """
    model, values, lengths = estimate.model, estimate.array, data.lengths
    samples = sum(len(m.effort) for m in data.motions)
    if not model.linear and samples > MAX_NONLINEAR_SAMPLES:
        raise IdentificationError(
            f"{samples} samples were fitted, expected at most {MAX_NONLINEAR_SAMPLES}: a posterior is for small data, "
            f"and {model.family} friction is not linear in its parameters"
        )
    jacobian, effort = regression_rows(model, values, data)
    residual = data.target - effort
    states = joint_states(model, data, values)
    lacks = neglected_columns(model.names, values, jacobian, residual, states, estimate.statistical)
    if lacks is None:
        raise IdentificationError("too few samples move, or nothing is left over, to tell the noise")
    # Parameters are scaled to the effort that they produce.
    free, scale = np.flatnonzero(lacks.free), lacks.scale
    lower, upper = (bound[free] * scale for bound in model.bounds())
    weak = np.full(len(free), PRIOR_EFFORT_SPREAD * float(np.linalg.norm(data.target)))
    prior = Prior(lower, upper, np.zeros(len(free)), weak)
    freedom = degrees_of_freedom(block_length(correlation_time(residual, lengths), len(residual)), len(residual))
    # The degrees of freedom already widen the tails here, so the factor in the variance is taken out.
    noise = Noise(lacks.noise / student_to_normal_ratio(freedom) ** 2, freedom)
    straight = LinearisedModel(
        values[free] * scale, lacks.own, lacks.target, lacks.columns, np.ones(len(lacks.words)), lacks.tied
    )

    def left_over(place: np.ndarray) -> np.ndarray:
        at = values.copy()
        at[free] = place / scale
        return (data.target - np.concatenate([predict_effort_rows(model, at, m) for m in data.motions]))[lacks.rows]

    covariance = estimate.covariance[np.ix_(free, free)] * np.outer(scale, scale)
    bent = None if model.linear else left_over
    found = straight.draws(straight.likelihood(prior, noise), covariance, bent, **sampling)
    names = [model.names[i] for i in free]
    title = f"Posterior of a joint with {model.family} friction"
    units = [model.unit(name) for name in names]
    return summary(names, units, found, prior, scale=scale, level=estimate.confidence, title=title)
