r"""Fit any strap model by output error: the limb's angle predicted from the strap's torque against the IMU's angle.

.. math::
    y(t_i) = d(t_i) + g\,q_k(t_i + \delta) + e_i, \qquad q_k = \text{the core's response to } \tau_c, \theta_e

The torque comes from encoders and is nearly free of noise; the IMU's angle is not. Output error places the noise on the
output, so no regressor has errors that would bias the stiffness. The thigh sways and the gyroscope drifts more slowly
than the limb swings. Therefore d is an arbitrary drift of low frequency in each trial. This gives up the information of
slow creep, and keeps the sway out of the intervals. Where the strap transmits almost no torque, slack would leave the
limb's angle undetermined. These samples are excluded for every model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from ... import _core
from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...numerics.uncertainty import correlation_time, long_run_covariance
from .strap_model import CONTACT_NAMES, CORE_NAMES, StrapModel, StrappedSwing, StrapTorque
from .strap_search import SEARCH_SETTINGS


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
