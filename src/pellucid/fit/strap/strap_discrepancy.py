r"""What a strap's model leaves out, and how far that may have moved its coefficients.

As ``fit/discrepancy.py`` for joints: each physics that straps have and the model does not is a column beside the
model's span, as large as what least squares leaves over; one likeliest size is found for all of them; what of the
posterior exceeds the statistical covariance is the discrepancy part. Whether blocks held out are predicted better with
those columns says whether the model holds at all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..block_test import p_of_worse
from ..discrepancy import beyond, likeliest_share
from .strap_choice import blocks_of
from .strap_fit import StrapFit, StrapRecord

MATTERS = 0.05
"""Share of the mean square in blocks held out that physics beside the model must save: a magnetometer, a thigh that
sways and a mounting that is not square leave 3 % to be saved where the model is the strap."""
OWN = 0.05  # share of a column beside the model's span below which the model has this physics itself


@dataclass(frozen=True)
class Worked:
    """How a strap was worked in one trial, as its model sees it: each (n,), SI."""

    stretch: np.ndarray
    rate: np.ndarray
    robot: np.ndarray
    torque: np.ndarray
    period: float

    def relaxed(self, time: float) -> np.ndarray:
        """The stretch less what a dashpot has given, whose relaxation takes a time [s]."""
        from scipy.signal import lfilter

        keep = np.exp(-self.period / time)
        return self.stretch - lfilter([1.0 - keep], [1.0, -keep], self.stretch - self.stretch[0]) - self.stretch[0]


def _size(values: np.ndarray) -> float:
    return max(float(np.sqrt(np.mean(values**2))), 1e-12)


NEGLECTED: Mapping[str, Callable[[Worked], np.ndarray]] = {
    "a strap that pulls harder one way": lambda w: w.stretch * np.abs(w.stretch) * np.sign(w.stretch),
    "a strap that hardens otherwise": lambda w: w.stretch * w.stretch**4,
    "a strap that hardens from the start": lambda w: w.stretch * np.abs(w.stretch),
    "cloth that rubs": lambda w: np.tanh(w.rate / (0.1 * _size(w.rate))),
    "damping that grows with the stretch": lambda w: w.rate * w.stretch**2,
    "damping that declines with speed": lambda w: w.rate * np.abs(w.rate),
    "something that relaxes within a swing": lambda w: w.relaxed(0.15),
    "something that relaxes over a few swings": lambda w: w.relaxed(3.0),
    "a stiffness that changes along the travel": lambda w: w.stretch * (w.robot - w.robot.mean()),
}
"""Torque of physics that a model lacks, of any size."""
CREEP = "creep under a large torque"
"""What adds to the angle, not to the torque."""


@dataclass(frozen=True)
class StrapDiscrepancy:
    """The discrepancy part of a covariance, (p, p), for each coefficient what moves it most, and the p value of the
    model predicting blocks held out no worse than with neglected physics beside it."""

    covariance: np.ndarray
    causes: tuple[str, ...]
    holds: float


def neglected(fit: StrapFit, records: Sequence[StrapRecord]) -> tuple[np.ndarray, tuple[str, ...]]:
    """Columns of neglected physics in the limb's angle, (m, k), without drift, and their words."""
    parts = []
    for record, shift in zip(records, fit.shifts, strict=True):
        limb, stretch, _ = record.response(fit.model, fit.values)
        worked = Worked(stretch, np.gradient(stretch, record.period), record.robot, record.torque, record.period)
        small = 1e-3 * _size(record.torque)
        columns = []
        for physics in NEGLECTED.values():
            column = physics(worked)
            size = _size(column)
            moved = record.response(fit.model, fit.values, record.torque - small * column / size)[0]
            columns.append((moved - limb) / small * size)
        held = 0.5 * float(np.max(np.abs(record.torque)))
        over = record.torque - np.clip(record.torque, -held, held)
        columns.append(np.cumsum(over) * record.period)
        parts.append(record.swiftly(fit.gain * record.at_imu(np.column_stack(columns), shift)))
    return np.vstack(parts), (*NEGLECTED, CREEP)


def strap_discrepancy(fit: StrapFit, records: Sequence[StrapRecord], statistical: np.ndarray) -> StrapDiscrepancy:
    """How far what the model leaves out may have moved it beyond its `statistical` covariance, (p, p)."""
    open_ = ~fit.held
    count, size = int(open_.sum()), fit.rms
    scale = np.linalg.norm(fit.jacobian[:, open_], axis=0)
    w = fit.jacobian[:, open_] / scale
    known = fit.prior[open_] / scale**2
    found, words = neglected(fit, records)
    basis = np.linalg.qr(w)[0]
    beside = np.linalg.norm(found - basis @ (basis.T @ found), axis=0)
    new = beside > OWN * np.linalg.norm(found, axis=0)
    columns = found[:, new] * (size * np.sqrt(len(w)) / beside[new])
    words = tuple(word for word, is_new in zip(words, new, strict=True) if is_new)
    error = np.sqrt(np.diag(statistical)[open_]) * scale
    noise = float(np.median(error**2 / np.diag(np.linalg.inv(w.T @ w + np.diag(known)))))
    x = np.hstack([w, columns])
    gram, moment = x.T @ x / noise, x.T @ fit.residual / noise
    gram[:count, :count] += np.diag(known) / noise
    # The residual is the optimum's: what is known before pulls against the data's slope.
    moment[:count] = 0.0
    share = likeliest_share(gram, moment, count)
    prior = np.concatenate([np.zeros(count), np.full(len(words), share**-2.0)])
    posterior = np.linalg.inv(gram + np.diag(prior))
    shift = -(posterior @ moment)[:count]
    units = np.outer(scale, scale)
    part = np.outer(shift, shift) + beyond(posterior[:count, :count], statistical[np.ix_(open_, open_)] * units)
    covariance = np.zeros_like(statistical)
    covariance[np.ix_(open_, open_)] = part / units
    effect = posterior[:count, count:] * np.sqrt(prior[count:])
    cause = iter(np.argmax(np.abs(effect), axis=1)) if words else iter(())
    causes = tuple(words[next(cause)] if is_open and words else "" for is_open in open_)
    return StrapDiscrepancy(covariance, causes, _holds(fit, x, np.concatenate([known, noise * prior[count:]])))


def _holds(fit: StrapFit, x: np.ndarray, prior: np.ndarray) -> float:
    """P value of the model predicting blocks held out no worse than with the columns beside it, x (m, p + k)."""
    blocks = blocks_of(fit.lengths)
    alone = fit.loss(blocks)
    whole, moment = x.T @ x + np.diag(prior), x.T @ fit.residual
    moment[: len(prior) - (x.shape[1] - int((~fit.held).sum()))] = 0.0
    beside = []
    for block in blocks:
        z, r = x[block], fit.residual[block]
        step = np.linalg.solve(whole - z.T @ z, moment - z.T @ r)
        beside.append((r - z @ step) ** 2 + fit.penalty / len(x))
    if np.mean(np.concatenate(beside)) >= (1.0 - MATTERS) * np.mean(np.concatenate(alone)):
        return 1.0
    return p_of_worse(alone, beside)[0]
