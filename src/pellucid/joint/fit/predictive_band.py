r"""Conformal prediction band around a model's effort, from blocks that the model was not fitted to.

The half width is a quantile [1]_ of the absolute errors on blocks of the fitted recordings, each predicted from all the
others [2]_. Autocorrelated samples count once in two correlation times. With m independent samples, the quantile at
:math:`(1 + 1/m)` times the level covers the next sample with at least that level, whatever the errors' distribution, as
long as it does not change.

Held-out recordings have no part in the band; what it covers of them tests it. Its coverage of the fitted recordings is
measured by cross-validation: each block is compared with a band made from the other blocks.

.. [1] H. Papadopoulos, K. Proedrou, V. Vovk, A. Gammerman, "Inductive confidence machines for regression", ECML 2002.
.. [2] V. Vovk, "Cross-conformal predictors", Ann. Math. Artif. Intell. 74, 2015.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...numerics.motion import Motion
from ...numerics.posterior.posterior import LinearisedModel, Noise, Posterior, Prior, summary
from ...numerics.regression import Stack, predict_effort_rows, regression_rows
from ...numerics.uncertainty import block_length, correlation_time, degrees_of_freedom, student_to_normal_ratio
from .discrepancy import neglected_columns
from .joint_estimate import JointEstimate, joint_states
from .replay import Prediction

MIN_CONDITION_SAMPLES = 30
"""Smallest number of samples for which the coverage under a condition is reported."""

MAX_BLOCKS = 50
"""Largest number of blocks that are left out in turn. Longer recordings get longer blocks."""


@dataclass(frozen=True)
class ConditionCoverage:
    """Cross-validated coverage of a band under one condition."""

    kind: str  # "direction", "speed", "position" or "recording"
    condition: str  # "slow", "positive", ..., or the recording's name
    coverage: float  # share of samples inside the band
    samples: int  # number of samples under this condition


@dataclass(frozen=True)
class PredictiveBand:
    """A prediction band of constant width, with its cross-validated coverage."""

    half_width: float  # half the width of the band, in the effort's unit
    by_recording: dict[str, float]  # coverage of each recording from which the band was made
    conditions: tuple[ConditionCoverage, ...] = ()  # coverage by condition


def conformal_half_width(errors: np.ndarray, level: float, independent: float) -> float:
    """Return the quantile of absolute `errors`, (n,), that covers the next error with probability `level`.

    `independent` is the effective number of independent errors.
    """
    return float(np.quantile(errors, _quantile_level(level, independent), method="higher"))


def _quantile_level(level: float, independent: float) -> float:
    """Return the level of the quantile that covers with probability `level`, from `independent` samples."""
    return min(1.0, level * (1.0 + 1.0 / max(independent, 1.0)))


def make_predictive_band(
    predictions: Sequence[Prediction], crossed: Sequence[np.ndarray], level: float
) -> PredictiveBand | None:
    """Make a band from `crossed` residuals of the fitted recordings, whose `predictions` say when they moved how.

    `crossed` has one array for each stretch, in their order. Returns None if there is none.
    """
    own = [p for p in predictions if p.split == "fitted"]
    errors = _residuals_by_recording(own, crossed)
    if not errors or not sum(map(len, errors)):
        return None
    lengths = [len(e) for e in errors]
    together = np.concatenate(errors)
    time = correlation_time(together, lengths)
    size, block = np.abs(together), max(block_length(time, len(together)), len(together) // MAX_BLOCKS)
    # No block spans two recordings.
    owner = np.concatenate([np.full(n, i) for i, n in enumerate(lengths)])
    before = np.cumsum([0, *(-(-n // block) for n in lengths)])
    blocks = np.concatenate([first + np.arange(n) // block for first, n in zip(before, lengths, strict=False)])
    order = np.argsort(size)  # sorted once: the errors without one block are sorted too
    ordered, owned = size[order], blocks[order]
    grouped = np.argsort(owned, kind="stable")  # places of each block among the sorted errors, in order
    ends = np.searchsorted(owned[grouped], np.arange(blocks.max() + 2))
    worth = len(size) / max(2.0 * time, 1.0)
    inside = np.empty(len(size), bool)
    for b in range(blocks.max() + 1):
        mine = grouped[ends[b] : ends[b + 1]]
        rest = len(size) - len(mine) or len(size)
        share = _quantile_level(level, worth * rest / len(size))
        place = int(np.ceil(share * (rest - 1)))  # among the errors without this block
        if rest < len(size):
            place += int(np.searchsorted(mine - np.arange(len(mine)), place, side="right"))
        inside[order[mine]] = ordered[mine] <= ordered[place]
    by_recording = {p.recording: float(inside[owner == i].mean()) for i, p in enumerate(own)}
    return PredictiveBand(
        conformal_half_width(size, level, worth),
        by_recording,
        tuple(_coverage_by_condition(own, inside)),
    )


def apply_band(predictions: Sequence[Prediction], band: PredictiveBand) -> tuple[Prediction, ...]:
    """Return the predictions with the band's half width and coverage.

    The coverage of recordings from which the band was made is cross-validated.
    """
    return tuple(
        replace(
            p,
            half_width=band.half_width,
            coverage=band.by_recording.get(
                "" if p.split == "heldout" else p.recording,
                float(np.mean(np.abs(p.residual) <= band.half_width)),
            ),
        )
        for p in predictions
    )


def _residuals_by_recording(own: Sequence[Prediction], crossed: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the cross-validated residuals as one array for each recording.

    If their number does not match, the fitted residuals are returned instead.
    """
    total = np.concatenate(crossed) if crossed else np.zeros(0)
    if len(total) != sum(len(p.effort) for p in own):
        return [p.residual for p in own]
    return np.split(total, np.cumsum([len(p.effort) for p in own])[:-1])


def _coverage_by_condition(own: Sequence[Prediction], inside: np.ndarray) -> Iterator[ConditionCoverage]:
    """Yield the coverage by direction, speed, position and recording; `inside`, (n,), marks the covered samples."""
    velocity, position = (np.concatenate([getattr(p, n) for p in own]) for n in ("velocity", "position"))
    kinds: list[tuple[str, np.ndarray, tuple[str, ...]]] = [
        ("direction", (velocity > 0.0).astype(int), ("negative", "positive"))
    ]
    for kind, values, thirds in (
        ("speed", np.abs(velocity), ("slow", "middle", "fast")),
        ("position", position, ("low", "middle", "high")),
    ):
        kinds.append((kind, np.searchsorted(np.quantile(values, [1.0 / 3.0, 2.0 / 3.0]), values), thirds))
    owner = np.repeat(np.arange(len(own)), [len(p.effort) for p in own])
    for kind, label, words in (*kinds, ("recording", owner, tuple(p.recording for p in own))):
        for i, word in enumerate(words):
            mine = label == i
            if mine.sum() >= MIN_CONDITION_SAMPLES:
                yield ConditionCoverage(kind, word, float(inside[mine].mean()), int(mine.sum()))


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
