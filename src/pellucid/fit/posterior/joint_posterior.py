"""A joint's parameters as draws: least squares' own rows, physics that its family lacks, bounds that hold."""

from __future__ import annotations

import numpy as np

from ..._errors import IdentificationError
from ..discrepancy import neglected
from ..joint.joint_estimate import JointEstimate, joint_states
from ..regression import Stack, effort_rows, rows_of
from ..uncertainty import block_length, correlation_time, freedom_of, student_over_normal
from .marginal_likelihood import Noise, Prior
from .posterior import Posterior, summary
from .straight import Straight

WEAK_EFFORT = 10.0
"""Standard deviation of what a parameter makes, in efforts as large as the recorded one, before any data."""

MOST_SAMPLES = 200_000
"""Of recordings from which draws of a family that is not linear are weighed: a posterior is for small data."""


def joint_posterior(estimate: JointEstimate, data: Stack, **sampling) -> Posterior:
    """Draws of a least-squares `estimate`'s parameters from the rows it was found from; `sampling` is what `drawn`
    takes."""
    model, values, lengths = estimate.model, estimate.array, data.lengths
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
    # Parameters in units of the effort that they make.
    free, scale = np.flatnonzero(lacks.free), lacks.scale
    lower, upper = (bound[free] * scale for bound in model.bounds())
    weak = np.full(len(free), WEAK_EFFORT * float(np.linalg.norm(data.target)))
    prior = Prior(lower, upper, np.zeros(len(free)), weak)
    freedom = freedom_of(block_length(correlation_time(residual, lengths), len(residual)), len(residual))
    # Student's tails come with the freedom here, not with the variance.
    noise = Noise(lacks.noise / student_over_normal(freedom) ** 2, freedom)
    straight = Straight(
        values[free] * scale, lacks.own, lacks.target, lacks.columns, np.ones(len(lacks.words)), lacks.tied
    )

    def left_over(place: np.ndarray) -> np.ndarray:
        at = values.copy()
        at[free] = place / scale
        return (data.target - np.concatenate([effort_rows(model, at, m) for m in data.motions]))[lacks.rows]

    covariance = estimate.covariance[np.ix_(free, free)] * np.outer(scale, scale)
    bent = None if model.linear else left_over
    found = straight.draws(straight.likelihood(prior, noise), covariance, bent, **sampling)
    names = [model.names[i] for i in free]
    title = f"Posterior of a joint with {model.family} friction"
    units = [model.unit(name) for name in names]
    return summary(names, units, found, prior, scale=scale, level=estimate.confidence, title=title)
