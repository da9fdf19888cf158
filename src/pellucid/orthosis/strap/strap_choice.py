"""Choose the features of a strap model by backward elimination, judged on held-out blocks of the swings.

The search starts from all features. A feature is significant if the held-out blocks are predicted worse without it
(``block_test``) and the error of the swings, or of the trials with held torques, grows by the share `MIN_IMPROVEMENT`.
Features whose coefficient rests at the bound where it does nothing go first, without a test. All insignificant ones
then go at once, if the blocks are predicted no worse without all of them; otherwise each may imitate another, and the
least important one goes alone. The test has a family-wise level: a strap without features receives one in at most this
share of cases.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from ...joint.fit.discrepancy import excess_covariance, fit_discrepancy_share
from ...models.estimates import Parameter
from ...numerics.block_test import MIN_IMPROVEMENT, p_value_of_larger_loss
from .strap_fit import StrapFit, StrapRecord, fit_strap_model
from .strap_model import FULL_MODEL, KELVIN_VOIGT, STRAP_FEATURES, StrapModel


@dataclass(frozen=True)
class ChoiceThresholds:
    """Thresholds of the choice of a strap model, and of the test of the chosen one."""

    feature_test_level: float = 0.05  # family-wise probability that a feature is chosen although the strap has none
    held_out_blocks_per_swing: int = 4  # each swing is divided into this many blocks, which are held out in turn
    # The model is rejected only if the neglected effects reduce the held-out mean squared error by at least this share.
    # Errors of a magnetometer, a swaying thigh and an oblique mounting allow a reduction of 3 % although the model is
    # right.
    min_discrepancy_gain: float = 0.05
    # A neglected effect is used only if its column keeps at least this share of its norm after projection on the
    # model's span. Otherwise the model represents the effect already.
    min_column_remainder: float = 0.05


CHOICE_THRESHOLDS = ChoiceThresholds()


@dataclass(frozen=True, eq=False)
class StrapChoice:
    """The chosen model's fit, with the fits of all models that were tried."""

    fit: StrapFit
    plain: StrapFit  # fit of the spring and damper alone
    tried: Mapping[str, StrapFit]  # fits by model name
    missed: Mapping[str, float]  # p value, by feature of the chosen model, of predicting no worse without it
    errors: Mapping[str, float]  # RMS error on held-out blocks, by model name [rad]


def held_out_blocks(lengths: Sequence[int]) -> list[slice]:
    """Return the held-out blocks of every swing, as slices of all samples; `lengths` are the samples of each swing."""
    made, begin = [], 0
    for n in lengths:
        edges = (
            begin
            + np.arange(CHOICE_THRESHOLDS.held_out_blocks_per_swing + 1)
            * n
            // CHOICE_THRESHOLDS.held_out_blocks_per_swing
        )
        made += [slice(int(a), int(b)) for a, b in pairwise(edges)]
        begin += n
    return made


def choose_strap(records: Sequence[StrapRecord], gain: Parameter, full: StrapFit) -> StrapChoice:
    """Choose a strap model by removing insignificant features from `full`, the fit of the model with all features."""
    blocks, noise = held_out_blocks(full.lengths), full.noise
    # Swings and held torques are different experiments: what relaxes slowly shows in the latter alone.
    swinging = CHOICE_THRESHOLDS.held_out_blocks_per_swing * sum(not still for still in full.still)
    kinds = [kind for kind in (slice(0, swinging), slice(swinging, len(blocks))) if blocks[kind]]
    tried: dict[str, StrapFit] = {}

    def fitted(model: StrapModel, like: StrapFit) -> StrapFit:
        if model.name not in tried:
            near = {**like.values, "gain": like.gain}
            tried[model.name] = fit_strap_model(model, records, gain=gain, noise=noise, start=near, shifts=like.shifts)
        return tried[model.name]

    def p_without(features: Sequence[str], best: StrapFit, loss: list[np.ndarray]) -> tuple[float, float]:
        """Return the p value of predicting no worse without some features, and the loss without them."""
        without = fitted(StrapModel(tuple(f for f in best.model.features if f not in features)), best).loss(blocks)
        worse = any(
            np.mean(np.concatenate(loss[kind])) < (1.0 - MIN_IMPROVEMENT) ** 2 * np.mean(np.concatenate(without[kind]))
            for kind in kinds
        )
        return (p_value_of_larger_loss(without, loss)[0] if worse else 1.0), float(np.mean(np.concatenate(without)))

    best = fitted(FULL_MODEL, full)
    level = CHOICE_THRESHOLDS.feature_test_level / len(STRAP_FEATURES)
    while idle := [f for f in best.model.features if STRAP_FEATURES[f][0].name in best.at_bound]:
        best = fitted(StrapModel(tuple(f for f in best.model.features if f not in idle)), best)
    while True:
        loss = best.loss(blocks)
        found = {feature: p_without([feature], best, loss) for feature in best.model.features}
        missed = {feature: p for feature, (p, _) in found.items()}
        gone = [feature for feature, p in missed.items() if p >= level]
        if not gone:
            break
        # Several features may be dispensable because each imitates another. The one without which the prediction is
        # best goes first.
        if len(gone) > 1 and p_without(gone, best, loss)[0] < level:
            gone = [max(gone, key=lambda feature: (found[feature][0], -found[feature][1]))]
        best = fitted(StrapModel(tuple(f for f in best.model.features if f not in gone)), best)
    plain = fitted(KELVIN_VOIGT, best)
    fitted(FULL_MODEL.without("tissue"), full)  # the intervals of straps without tissue need it
    errors = {n: float(np.sqrt(np.mean(np.concatenate(f.loss(blocks))))) for n, f in tried.items()}
    return StrapChoice(best, plain, tried, missed, errors)


@dataclass(frozen=True)
class StrapStates:
    """States of the strap in one trial according to its model: arrays of shape (n,), SI."""

    stretch: np.ndarray
    rate: np.ndarray
    robot: np.ndarray
    torque: np.ndarray
    period: float

    def relaxed(self, time: float) -> np.ndarray:
        """Return the stretch of a spring in series with a dashpot that relaxes with a time constant `time` [s]."""
        from scipy.signal import lfilter

        keep = np.exp(-self.period / time)
        return self.stretch - lfilter([1.0 - keep], [1.0, -keep], self.stretch - self.stretch[0]) - self.stretch[0]


def _root_mean_square(values: np.ndarray) -> float:
    """Return the root mean square, at least 1e-12, so that it may be divided by."""
    return max(float(np.sqrt(np.mean(values**2))), 1e-12)


NEGLECTED_TORQUES: Mapping[str, Callable[[StrapStates], np.ndarray]] = {
    "a strap that pulls harder one way": lambda w: w.stretch * np.abs(w.stretch) * np.sign(w.stretch),
    "a strap that hardens otherwise": lambda w: w.stretch * w.stretch**4,
    "a strap that hardens from the start": lambda w: w.stretch * np.abs(w.stretch),
    "cloth that rubs": lambda w: np.tanh(w.rate / (0.1 * _root_mean_square(w.rate))),
    "damping that grows with the stretch": lambda w: w.rate * w.stretch**2,
    "damping that declines with speed": lambda w: w.rate * np.abs(w.rate),
    "something that relaxes within a swing": lambda w: w.relaxed(0.15),
    "something that relaxes over a few swings": lambda w: w.relaxed(3.0),
    "a stiffness that changes along the travel": lambda w: w.stretch * (w.robot - w.robot.mean()),
}
"""Torques of the effects that a strap model may neglect, up to a factor."""

CREEP_WORDS = "creep under a large torque"
"""Name of the one neglected effect that adds to the angle instead of the torque."""


@dataclass(frozen=True)
class StrapDiscrepancy:
    """Discrepancy of a strap model: its part of the covariance, and the test of the model."""

    covariance: np.ndarray  # (p, p) discrepancy part of the covariance
    causes: tuple[str, ...]  # the neglected effect that influences each coefficient most
    holds: float  # p value of the model predicting held-out blocks no worse than with the neglected effects


def neglected_columns(fit: StrapFit, records: Sequence[StrapRecord]) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the neglected effects' columns in the limb's angle, shape (m, k), without drift, and their names."""
    parts = []
    for record, shift in zip(records, fit.shifts, strict=True):
        limb, stretch, _ = record.response(fit.model, fit.values)
        worked = StrapStates(stretch, np.gradient(stretch, record.period), record.robot, record.torque, record.period)
        small = 1e-3 * _root_mean_square(record.torque)
        columns = []
        for physics in NEGLECTED_TORQUES.values():
            column = physics(worked)
            size = _root_mean_square(column)
            moved = record.response(fit.model, fit.values, record.torque - small * column / size)[0]
            columns.append((moved - limb) / small * size)
        held = 0.5 * float(np.max(np.abs(record.torque)))
        over = record.torque - np.clip(record.torque, -held, held)
        columns.append(np.cumsum(over) * record.period)
        parts.append(record.swiftly(fit.gain * record.at_imu(np.column_stack(columns), shift)))
    return np.vstack(parts), (*NEGLECTED_TORQUES, CREEP_WORDS)


def strap_discrepancy(fit: StrapFit, records: Sequence[StrapRecord], statistical: np.ndarray) -> StrapDiscrepancy:
    """Estimate the discrepancy of a strap model; `statistical` is the covariance without it, shape (p, p)."""
    open_ = ~fit.held
    count, size = int(open_.sum()), fit.rms
    scale = np.linalg.norm(fit.jacobian[:, open_], axis=0)
    w = fit.jacobian[:, open_] / scale
    known = fit.prior[open_] / scale**2
    found, words = neglected_columns(fit, records)
    basis = np.linalg.qr(w)[0]
    beside = np.linalg.norm(found - basis @ (basis.T @ found), axis=0)
    new = beside > CHOICE_THRESHOLDS.min_column_remainder * np.linalg.norm(found, axis=0)
    columns = found[:, new] * (size * np.sqrt(len(w)) / beside[new])
    words = tuple(word for word, is_new in zip(words, new, strict=True) if is_new)
    error = np.sqrt(np.diag(statistical)[open_]) * scale
    noise = float(np.median(error**2 / np.diag(np.linalg.inv(w.T @ w + np.diag(known)))))
    x = np.hstack([w, columns])
    gram, moment = x.T @ x / noise, x.T @ fit.residual / noise
    gram[:count, :count] += np.diag(known) / noise
    # At the optimum the gradient of the data and that of the prior cancel, so the moment of the model's columns is
    # zero.
    moment[:count] = 0.0
    share = fit_discrepancy_share(gram, moment, count)
    prior = np.concatenate([np.zeros(count), np.full(len(words), share**-2.0)])
    posterior = np.linalg.inv(gram + np.diag(prior))
    shift = -(posterior @ moment)[:count]
    units = np.outer(scale, scale)
    part = np.outer(shift, shift) + excess_covariance(
        posterior[:count, :count], statistical[np.ix_(open_, open_)] * units
    )
    covariance = np.zeros_like(statistical)
    covariance[np.ix_(open_, open_)] = part / units
    effect = posterior[:count, count:] * np.sqrt(prior[count:])
    cause = iter(np.argmax(np.abs(effect), axis=1)) if words else iter(())
    causes = tuple(words[next(cause)] if is_open and words else "" for is_open in open_)
    body, correlation = fit.body_columns(records)
    unsure = noise * np.linalg.pinv(correlation)
    return StrapDiscrepancy(
        covariance, causes, _model_test_p_value(fit, w, columns, body, (np.diag(known), noise * prior[count:], unsure))
    )


def _model_test_p_value(
    fit: StrapFit,
    own: np.ndarray,
    columns: np.ndarray,
    body: np.ndarray,
    priors: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> float:
    """Return the p value of the model predicting held-out blocks no worse than with the neglected effects.

    The arrays hold the columns of the model, (m, p), of the neglected effects, (m, k), and of the uncertain constants
    of the body, (m, b). The last are free on both sides, within their errors: they are the orthosis's, and no fault of
    the strap's model. `priors` are the information matrices of the model and the body, and between them the vector of
    the neglected effects, in units of the residual's.
    """
    blocks = held_out_blocks(fit.lengths)
    known, neglected, unsure = priors
    alone = _held_out_losses(fit, np.hstack([own, body]), (known, unsure), blocks)
    beside = _held_out_losses(fit, np.hstack([own, body, columns]), (known, unsure, np.diag(neglected)), blocks)
    if np.mean(np.concatenate(beside)) >= (1.0 - CHOICE_THRESHOLDS.min_discrepancy_gain) * np.mean(
        np.concatenate(alone)
    ):
        return 1.0
    return p_value_of_larger_loss(alone, beside)[0]


def _held_out_losses(
    fit: StrapFit, x: np.ndarray, priors: Sequence[np.ndarray], blocks: Sequence[slice]
) -> list[np.ndarray]:
    """Return the squared residuals of each held-out block by one step of ridge regression, with the prior's cost.

    The columns `x`, (m, q), begin with those of the model, whose gradient and prior cancel at the optimum.
    """
    whole, moment = x.T @ x + block_diag(*priors), x.T @ fit.residual
    moment[: len(priors[0])] = 0.0
    made = []
    for block in blocks:
        z, r = x[block], fit.residual[block]
        step = np.linalg.solve(whole - z.T @ z, moment - z.T @ r)
        made.append((r - z @ step) ** 2 + fit.penalty / len(x))
    return made
