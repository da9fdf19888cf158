r"""Fit any strap model by output error, choose its features, and test the chosen model.

The limb's angle is predicted from the strap's torque and compared with the IMU's angle:

.. math::
    y(t_i) = d(t_i) + g\,q_k(t_i + \delta) + e_i, \qquad q_k = \text{the core's response to } \tau_c, \theta_e

The torque comes from encoders and is nearly free of noise; the IMU's angle is not. Output error places the noise on the
output, so no regressor has errors that would bias the stiffness. The thigh sways and the gyroscope drifts more slowly
than the limb swings. Therefore d is an arbitrary drift of low frequency in each trial. This gives up the information of
slow creep, and keeps the sway out of the intervals. Where the strap transmits almost no torque, slack would leave the
limb's angle undetermined. These samples are excluded for every model.

**Choice.** Backward elimination chooses the features by their errors on held-out blocks of the swings. The search
starts from all features. A feature is significant if the held-out blocks are predicted worse without it
(``block_test``) and the error of the swings, or of the trials with held torques, grows by the share `MIN_IMPROVEMENT`.
Features whose coefficient reaches the bound where it has no effect are removed first, without a test. Then all
insignificant features are removed together, if the prediction of the blocks is no worse without all of them. Otherwise
each may imitate another, and only the least important one is removed. The test has a family-wise level: a strap without
features receives one in at most this share of cases.

**Test.** Effects that the model neglects join it as further columns. The model is rejected if held-out blocks are
predicted better with them; the changes that they could cause widen the covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from ... import _core
from ..._errors import IdentificationError
from ...joint.fit.discrepancy import excess_covariance, fit_discrepancy_share
from ...models.estimates import Parameter
from ...numerics.block_test import MIN_IMPROVEMENT, p_value_of_larger_loss
from ...numerics.uncertainty import correlation_time, long_run_covariance
from .coupled_impedance import SEARCH_SETTINGS
from .strap_model import (
    CONTACT_NAMES,
    CORE_NAMES,
    FULL_MODEL,
    KELVIN_VOIGT,
    STRAP_FEATURES,
    StrapModel,
    StrappedSwing,
    StrapTorque,
)


@dataclass(frozen=True)
class RecordSettings:
    """What of a trial is fitted, and when the search ends."""

    evaluation_rate_hz: float = 125.0  # torque and angle, low-passed at 15 Hz, are resampled to this rate
    # Below this frequency the residual of a trial may drift freely, so it carries no information.
    min_residual_frequency_hz: float = 0.25
    # Below this share of its standard deviation the torque does not show to which side the strap pulls.
    min_torque_share: float = 0.05
    # Samples this close to such a reversal are excluded too, because the low-pass mixes both sides.
    reversal_margin_s: float = 0.04
    max_iterations: int = 40  # largest number of Levenberg-Marquardt steps
    cost_tolerance: float = 1e-6  # the search stops when a step reduces the cost by less than this share


RECORD_SETTINGS = RecordSettings()


class StrapRecord:
    """One trial, prepared for repeated evaluation.

    The IMU's clock is `shift` behind, with a prior standard deviation of `late` [s]. The residual may drift below
    `slowest` [Hz]; 0 allows no drift.
    """

    def __init__(
        self,
        swing: StrappedSwing,
        torque: StrapTorque,
        shift: float,
        decay: float,
        *,
        slowest: float = RECORD_SETTINGS.min_residual_frequency_hz,
        late: float = float("inf"),
    ):
        step = max(1, round(swing.fs / RECORD_SETTINGS.evaluation_rate_hz))
        self.name, self.shift, self.late, self.weight = swing.name, shift, late, 1.0
        self.steady = slowest == 0.0
        self.period = step / swing.fs
        self.time, self.robot = swing.time[::step], swing.position[::step]
        self.torque, self.sensitivity, self.body = torque.torque[::step], torque.sensitivity[::step], torque.covariance
        self.still = RECORD_SETTINGS.min_torque_share * float(np.std(self.torque))
        reach = max(1, round(RECORD_SETTINGS.reversal_margin_s / self.period))
        quiet = np.convolve(np.abs(self.torque) <= self.still, np.ones(2 * reach + 1), "same") > 0.5
        memory = np.ones(1 + max(1, round(decay / self.period)))
        doubtful = np.convolve(~torque.known[::step], memory)[: len(quiet)] > 0.5
        seen = swing.imu_time + shift
        kept = (
            np.isfinite(swing.imu_angle)
            & (seen >= self.time[0] + SEARCH_SETTINGS.trial_edge_s)
            & (seen <= self.time[-1] - SEARCH_SETTINGS.trial_edge_s)
        )
        kept &= np.interp(seen, self.time, (quiet | doubtful).astype(float)) == 0.0
        if kept.sum() < SEARCH_SETTINGS.min_imu_samples:
            raise IdentificationError(
                f"{swing.name}: found {int(kept.sum())} samples of the IMU while the strap pulls, expected "
                f"{SEARCH_SETTINGS.min_imu_samples} or more: swing further"
            )
        self.seen_time, self.seen = swing.imu_time[kept], swing.imu_angle[kept]
        span = seen[kept] - seen[kept][0]
        count = 1 + int(2.0 * slowest * span[-1])
        drift = np.cos(np.pi * np.outer(span / span[-1], np.arange(count)))
        self._drift = np.linalg.qr(drift)[0]

    def swiftly(self, columns: np.ndarray) -> np.ndarray:
        """Remove the drift from columns, (m,) or (m, k), and scale them to the first record's noise."""
        return self.weight * (columns - self._drift @ (self._drift.T @ columns))

    def response(self, model: StrapModel, values: Mapping[str, float], torque: np.ndarray | None = None):
        """Return the limb's angle, (n,), the stretch, (n,), and the angle's derivatives by the coefficients, (n, k)."""
        core, coefficients = model.core(values), model.coefficients
        active = [(*CORE_NAMES, *CONTACT_NAMES).index(c.field) for c in coefficients]
        limb, stretch, _, slopes = _core.strap_response(
            core, self.robot, self.torque if torque is None else torque, period=self.period, still=self.still,
            active=active, contact=model.contact(values),
        )  # fmt: skip
        return limb, stretch, slopes * [c.slope(values[c.name]) for c in coefficients]

    def at_imu(self, series: np.ndarray, shift: float) -> np.ndarray:
        """Interpolate series, shape (n, k), at the IMU's samples."""
        place = np.clip((self.seen_time + shift - self.time[0]) / self.period, 0.0, len(self.time) - 1.001)
        low = place.astype(int)
        part = (place - low)[:, None]
        return series[low] * (1.0 - part) + series[low + 1] * part


@dataclass(frozen=True, eq=False)
class StrapFit:
    """One strap model fitted to recordings."""

    model: StrapModel
    values: Mapping[str, float]  # value of each coefficient, by name
    gain: float  # gain of the IMU
    shifts: tuple[float, ...]  # clock shift of the IMU in each trial [s]
    at_bound: frozenset[str]  # names of the coefficients held by a bound
    residual: np.ndarray = field(repr=False)  # (m,) residual without drift [rad]
    jacobian: np.ndarray = field(repr=False)  # (m, p) derivatives by coefficients, gain and shifts, without drift
    prior: np.ndarray = field(repr=False)  # (p,) prior information on each, in units of the residual's
    penalty: float = 0.0  # cost of the prior, in units of the residual's [rad^2]
    lengths: tuple[int, ...] = ()  # number of samples of each trial
    still: tuple[bool, ...] = ()  # whether a torque is held in the trial; such trials come last
    converged: bool = True

    @property
    def free(self) -> tuple[str, ...]:
        """Names of coefficients and gain, in the order of the Jacobian's first columns."""
        return (*(c.name for c in self.model.coefficients), "gain")

    @property
    def rms(self) -> float:
        """RMS of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def held(self) -> np.ndarray:
        """Whether each parameter is held by a bound, shape (p,)."""
        count = self.jacobian.shape[1] - len(self.free)
        return np.array([name in self.at_bound for name in self.free] + [False] * count)

    def curvature(self) -> np.ndarray:
        """Return the information matrix of data and prior, shape (p, p)."""
        return self.jacobian.T @ self.jacobian + np.diag(self.prior)

    def covariance(self) -> np.ndarray:
        """Return the covariance of coefficients, gain and shifts, shape (p, p), which allows for coloured residuals.

        Parameters held by a bound have zero variance.
        """
        open_ = ~self.held
        z = self.jacobian[:, open_]
        scale = np.linalg.norm(z, axis=0)
        spread = np.linalg.inv(self.curvature()[np.ix_(open_, open_)] / np.outer(scale, scale))
        swings = len(self.residual) - sum(n for n, still in zip(self.lengths, self.still, strict=True) if still)
        lengths = [n for n, still in zip(self.lengths, self.still, strict=True) if not still]
        unit, r = z / scale, self.residual
        meat = long_run_covariance(unit[:swings] * r[:swings, None], r[:swings], lengths)
        # In trials with held torques the scores vary slowly, so few blocks are independent; the noise's correlation
        # time is used instead.
        begin = swings
        for n in self.lengths[len(lengths) :]:
            rows = slice(begin, begin + n)
            meat = meat + (2.0 * correlation_time(r[rows], [n]) * np.mean(r[rows] ** 2)) * unit[rows].T @ unit[rows]
            begin += n
        # The prior's information has the variance that it states.
        meat = meat + np.diag((self.prior[open_] / scale**2) * self.noise)
        found = np.zeros((len(open_), len(open_)))
        found[np.ix_(open_, open_)] = spread @ meat @ spread / np.outer(scale, scale)
        return found

    def moved_by_body(self, records: Sequence[StrapRecord]) -> np.ndarray:
        """Return the part of the covariance that is due to the uncertain body whose balance gave the torque."""
        open_ = ~self.held
        moved, body = self.body_columns(records)
        z = self.jacobian[:, open_]
        push = np.zeros((len(open_), moved.shape[1]))
        push[open_] = -np.linalg.solve(self.curvature()[np.ix_(open_, open_)], z.T @ moved)
        return push @ body @ push.T

    def body_columns(self, records: Sequence[StrapRecord]) -> tuple[np.ndarray, np.ndarray]:
        """Return how one standard error of each uncertain constant of the body moves the limb's angle, shape (m, b),
        without drift, and the correlation of these errors, shape (b, b)."""
        sd = np.sqrt(np.diag(records[0].body))
        known = np.flatnonzero(sd > 0.0)
        moved = []
        for record, shift in zip(records, self.shifts, strict=True):
            limb = record.response(self.model, self.values)[0]
            off = [
                record.response(self.model, self.values, record.torque + record.sensitivity[:, i] * sd[i])[0] - limb
                for i in known
            ]
            columns = np.column_stack(off) if off else np.zeros((len(limb), 0))
            moved.append(record.swiftly(self.gain * record.at_imu(columns, shift)))
        return np.vstack(moved), records[0].body[np.ix_(known, known)] / np.outer(sd[known], sd[known])

    @property
    def noise(self) -> float:
        """Variance of an equivalent independent sample [rad^2]."""
        return 2.0 * correlation_time(self.residual, self.lengths) * self.rms**2

    def loss(self, blocks: Sequence[slice]) -> list[np.ndarray]:
        """Return the squared held-out residuals of each block, plus each sample's share of the prior's cost.

        A block's held-out residual follows from one Gauss-Newton step without the block.
        """
        open_ = ~self.held
        whole = self.curvature()[np.ix_(open_, open_)]
        made = []
        for block in blocks:
            z, r = self.jacobian[block][:, open_], self.residual[block]
            left = r + z @ np.linalg.solve(whole - z.T @ z, z.T @ r)
            made.append(left**2 + self.penalty / len(self.residual))
        return made


def fit_strap_model(
    model: StrapModel,
    records: Sequence[StrapRecord],
    *,
    gain: Parameter,
    noise: float,
    start: Mapping[str, float],
    shifts: Sequence[float] | None = None,
) -> StrapFit:
    """Fit a strap model by bounded least squares (Levenberg-Marquardt).

    `start` gives first values by coefficient, at least stiffness and damping. `gain` is the prior of the IMU's gain,
    and `noise` the variance of an independent sample [rad^2].
    """
    search = _Search(model, records, gain, noise)
    return search.run(search.begin(start, shifts))


class _Search:
    def __init__(self, model: StrapModel, records: Sequence[StrapRecord], gain: Parameter, noise: float):
        self.model, self.records, self.gain = model, records, gain
        self.coefficients = model.coefficients
        self.k = len(self.coefficients)
        self.size = self.k + 1 + len(records)
        clocks = np.zeros(len(records))
        of = self.coefficients
        self.lower = np.array([*(c.sought(c.lower) for c in of), 0.5, *(clocks - np.inf)])
        self.upper = np.array([*(c.sought(c.upper) for c in of), 2.0, *(clocks + np.inf)])
        self.prior = noise / np.array([*(c.spread for c in of), gain.standard_error, *(r.late for r in records)]) ** 2
        self.expected = np.array([*(c.sought(c.start) for c in of), gain.value, *(r.shift for r in records)])

    def begin(self, start: Mapping[str, float], shifts: Sequence[float] | None) -> np.ndarray:
        first = [
            c.sought(start.get(c.name, c.start * (start["stiffness"] if c.per_stiffness else 1.0)))
            for c in self.coefficients
        ]
        clocks = [r.shift for r in self.records] if shifts is None else list(shifts)
        return np.array([*first, start.get("gain", self.gain.value), *clocks])

    def values(self, x: np.ndarray) -> dict[str, float]:
        """Return the coefficients by name, from a point of the search."""
        return {c.name: c.value(v) for c, v in zip(self.coefficients, x, strict=False)}

    def run(self, x: np.ndarray) -> StrapFit:
        residual, jacobian, cost = self.evaluate(x)
        damp, converged = 1e-4, False
        for _ in range(RECORD_SETTINGS.max_iterations):
            slope = jacobian.T @ residual + self.prior * (self.expected - x)
            held = ((x <= self.lower) & (slope < 0.0)) | ((x >= self.upper) & (slope > 0.0))
            open_ = ~held
            gram = (jacobian.T @ jacobian + np.diag(self.prior))[np.ix_(open_, open_)]
            # A parameter without effect and without a prior, such as the way of no friction, stays where it is.
            scale = np.sqrt(np.diag(gram))
            scale = np.where(scale > 0.0, scale, 1.0)
            unit, ahead = gram / np.outer(scale, scale), slope[open_] / scale
            while damp < 1e8:
                y = x.copy()
                y[open_] += np.linalg.solve(unit + damp * np.eye(len(scale)), ahead) / scale
                y = np.clip(y, self.lower, self.upper)
                there = self.evaluate(y)
                if there[2] <= cost:
                    break
                damp *= 8.0
            else:
                converged = True
                break
            gained = cost - there[2]
            x, (residual, jacobian, cost), damp = y, there, max(damp / 10.0, 1e-10)
            if gained <= RECORD_SETTINGS.cost_tolerance * cost:
                converged = True
                break
        slope = jacobian.T @ residual + self.prior * (self.expected - x)
        held = ((x <= self.lower) & (slope <= 0.0)) | ((x >= self.upper) & (slope >= 0.0))
        names = [c.name for c in self.coefficients]
        return StrapFit(
            self.model,
            self.values(x),
            float(x[self.k]),
            tuple(float(s) for s in x[self.k + 1 :]),
            frozenset(n for n, h in zip(names, held, strict=False) if h),
            residual,
            jacobian,
            self.prior,
            self.known(x),
            tuple(len(r.seen) for r in self.records),
            tuple(r.steady for r in self.records),
            converged,
        )

    def known(self, x: np.ndarray) -> float:
        """Return the prior's cost of a point of the search."""
        return float(self.prior @ (self.expected - x) ** 2)

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the residual and the model's Jacobian, both without drift, and the cost."""
        values = self.values(x)
        gain, residuals, jacobians = x[self.k], [], []
        for i, record in enumerate(self.records):
            shift = x[self.k + 1 + i]
            limb, _, slopes = record.response(self.model, values)
            path = CubicSpline(record.time, limb)
            at = np.clip(record.seen_time + shift, record.time[0], record.time[-1])
            angle, rate = path(at), path(at, 1)
            j = np.zeros((len(at), self.size))
            j[:, : self.k] = gain * record.at_imu(slopes, shift)
            j[:, self.k] = angle
            j[:, self.k + 1 + i] = gain * rate
            both = record.swiftly(np.column_stack([record.seen - gain * angle, j]))
            residuals.append(both[:, 0])
            jacobians.append(both[:, 1:])
        residual = np.concatenate(residuals)
        cost = float(residual @ residual) + self.known(x)
        return residual, np.vstack(jacobians), cost if np.isfinite(cost) else np.inf


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
