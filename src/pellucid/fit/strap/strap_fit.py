r"""A strap of any model by output error: the limb's angle that its torque asks for, against the one that the IMU saw.

.. math::
    y(t_i) = d(t_i) + g\,q_k(t_i + \delta) + e_i, \qquad q_k = \text{the core's response to } \tau_c, \theta_e

The torque comes from encoders and is all but free of noise; the IMU's angle is not. With the noise where it is, in the
output, no error is in a regressor, and none bends the stiffness. A thigh sways and a gyroscope drifts slower than
anybody swings: d is any drift below `SLOWEST`, a trial's own, in place of an offset. It costs what a slow creep would
tell of the strap, and spares the intervals the sway. Next to where the strap pulls neither way, a gap would leave the
limb's angle to chance: those samples are left out for every model alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from ... import _core
from ..._errors import IdentificationError
from ..parameter import Parameter
from ..uncertainty import correlation_time, long_run_covariance
from .strap_model import NAMES, StrapModel
from .strap_search import EDGE, FEWEST
from .strap_torque import StrappedSwing, StrapTorque

RATE = 125.0
"""Torque and angle are taken so often, of what was low-passed at 15 Hz [Hz]."""
SLOWEST = 0.25
"""Below this a trial's residual may drift as it likes [Hz]."""
STILL = 0.05
"""Share of its spread below which the strap's torque says nothing of the side it pulls to."""
SETTLING = 0.04
"""As long before and after that, the low-pass mixes both [s]."""
ITERATIONS = 40
TOLERANCE = 1e-6


class StrapRecord:
    """One trial, ready for repeated evaluation, its IMU's clock a `shift` behind, known to `late` [s]; `slowest` [Hz]
    is what below the residual may drift, 0 of one that may not."""

    def __init__(
        self,
        swing: StrappedSwing,
        torque: StrapTorque,
        shift: float,
        decay: float,
        *,
        slowest: float = SLOWEST,
        late: float = float("inf"),
    ):
        step = max(1, round(swing.fs / RATE))
        self.name, self.shift, self.late, self.weight = swing.name, shift, late, 1.0
        self.steady = slowest == 0.0
        self.period = step / swing.fs
        self.time, self.robot = swing.time[::step], swing.position[::step]
        self.torque, self.sensitivity, self.body = torque.torque[::step], torque.sensitivity[::step], torque.covariance
        self.still = STILL * float(np.std(self.torque))
        reach = max(1, round(SETTLING / self.period))
        quiet = np.convolve(np.abs(self.torque) <= self.still, np.ones(2 * reach + 1), "same") > 0.5
        memory = np.ones(1 + max(1, round(decay / self.period)))
        doubtful = np.convolve(~torque.known[::step], memory)[: len(quiet)] > 0.5
        seen = swing.imu_time + shift
        kept = np.isfinite(swing.imu_angle) & (seen >= self.time[0] + EDGE) & (seen <= self.time[-1] - EDGE)
        kept &= np.interp(seen, self.time, (quiet | doubtful).astype(float)) == 0.0
        if kept.sum() < FEWEST:
            raise IdentificationError(
                f"{swing.name}: found {int(kept.sum())} samples of the IMU while the strap pulls, expected {FEWEST} or "
                "more: swing further"
            )
        self.seen_time, self.seen = swing.imu_time[kept], swing.imu_angle[kept]
        span = seen[kept] - seen[kept][0]
        count = 1 + int(2.0 * slowest * span[-1])
        drift = np.cos(np.pi * np.outer(span / span[-1], np.arange(count)))
        self._drift = np.linalg.qr(drift)[0]

    def swiftly(self, columns: np.ndarray) -> np.ndarray:
        """Columns, (m,) or (m, k), without what drifts, in units of the first record's noise."""
        return self.weight * (columns - self._drift @ (self._drift.T @ columns))

    def response(self, model: StrapModel, values: Mapping[str, float], torque: np.ndarray | None = None):
        """The limb's angle, (n,), its stretch, (n,), and derivatives by the model's coefficients, (n, k)."""
        core, coefficients = model.core(values), model.coefficients
        active = [NAMES.index(c.field) for c in coefficients]
        limb, stretch, _, slopes = _core.strap_response(
            core, self.robot, self.torque if torque is None else torque, period=self.period, still=self.still,
            active=active,
        )  # fmt: skip
        return limb, stretch, slopes * [c.slope(values[c.name]) for c in coefficients]

    def at_imu(self, series: np.ndarray, shift: float) -> np.ndarray:
        """Series, (n, k), at the IMU's samples."""
        place = np.clip((self.seen_time + shift - self.time[0]) / self.period, 0.0, len(self.time) - 1.001)
        low = place.astype(int)
        part = (place - low)[:, None]
        return series[low] * (1.0 - part) + series[low + 1] * part


@dataclass(frozen=True, eq=False)
class StrapFit:
    """One model of a strap, as recordings show it."""

    model: StrapModel
    values: Mapping[str, float]  # By coefficient
    gain: float  # Of the IMU
    shifts: tuple[float, ...]  # Of its clock, for each swing [s]
    at_bound: frozenset[str]  # Coefficients that a bound holds
    residual: np.ndarray = field(repr=False)  # (m,) Without drift [rad]
    jacobian: np.ndarray = field(repr=False)  # (m, p) Of coefficients, gain and shifts, likewise
    prior: np.ndarray = field(repr=False)  # (p,) Information on each, over the residual's
    penalty: float = 0.0  # What the coefficients cost by what is known before, over the residual's [rad^2]
    lengths: tuple[int, ...] = ()  # Samples of each trial
    still: tuple[bool, ...] = ()  # Whether a torque is held in it; those come last
    converged: bool = True

    @property
    def free(self) -> tuple[str, ...]:
        """Coefficients and gain, in the order of the Jacobian's first columns."""
        return (*(c.name for c in self.model.coefficients), "gain")

    @property
    def rms(self) -> float:
        """Of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def held(self) -> np.ndarray:
        """(p,) Whether a bound holds it."""
        count = self.jacobian.shape[1] - len(self.free)
        return np.array([name in self.at_bound for name in self.free] + [False] * count)

    def curvature(self) -> np.ndarray:
        """Information of the data and of what is known before, (p, p)."""
        return self.jacobian.T @ self.jacobian + np.diag(self.prior)

    def covariance(self) -> np.ndarray:
        """Of coefficients, gain and shifts, (p, p), by the coloured residual; 0 of what a bound holds."""
        open_ = ~self.held
        z = self.jacobian[:, open_]
        scale = np.linalg.norm(z, axis=0)
        spread = np.linalg.inv(self.curvature()[np.ix_(open_, open_)] / np.outer(scale, scale))
        swings = len(self.residual) - sum(n for n, still in zip(self.lengths, self.still, strict=True) if still)
        lengths = [n for n, still in zip(self.lengths, self.still, strict=True) if not still]
        unit, r = z / scale, self.residual
        meat = long_run_covariance(unit[:swings] * r[:swings, None], r[:swings], lengths)
        # Where a torque is held, score and noise are both slow, and few blocks tell their spread.
        begin = swings
        for n in self.lengths[len(lengths) :]:
            rows = slice(begin, begin + n)
            meat = meat + (2.0 * correlation_time(r[rows], [n]) * np.mean(r[rows] ** 2)) * unit[rows].T @ unit[rows]
            begin += n
        # What is known before errs as it says.
        meat = meat + np.diag((self.prior[open_] / scale**2) * self.noise)
        found = np.zeros((len(open_), len(open_)))
        found[np.ix_(open_, open_)] = spread @ meat @ spread / np.outer(scale, scale)
        return found

    def moved_by_body(self, records: Sequence[StrapRecord]) -> np.ndarray:
        """The same covariance, of what is not known of the body whose balance gave the torque."""
        open_ = ~self.held
        sd = np.sqrt(np.diag(records[0].body))
        moved = []
        for record, shift in zip(records, self.shifts, strict=True):
            limb = record.response(self.model, self.values)[0]
            off = [
                record.response(self.model, self.values, record.torque + column * step)[0] - limb
                for column, step in zip(record.sensitivity.T, sd, strict=True)
            ]
            moved.append(record.swiftly(self.gain * record.at_imu(np.column_stack(off), shift)))
        z = self.jacobian[:, open_]
        push = np.zeros((len(open_), len(sd)))
        push[open_] = -np.linalg.solve(self.curvature()[np.ix_(open_, open_)], z.T @ np.vstack(moved))
        body = records[0].body / np.outer(np.where(sd > 0.0, sd, 1.0), np.where(sd > 0.0, sd, 1.0))
        return push @ body @ push.T

    @property
    def noise(self) -> float:
        """Of one sample that were independent of the others [rad^2]."""
        return 2.0 * correlation_time(self.residual, self.lengths) * self.rms**2

    def loss(self, blocks: Sequence[slice]) -> list[np.ndarray]:
        """Squared residuals of each block, had it not been fitted (a step of Gauss and Newton without it), and each
        sample's share of what the coefficients cost."""
        open_ = ~self.held
        whole = self.curvature()[np.ix_(open_, open_)]
        made = []
        for block in blocks:
            z, r = self.jacobian[block][:, open_], self.residual[block]
            left = r + z @ np.linalg.solve(whole - z.T @ z, z.T @ r)
            made.append(left**2 + self.penalty / len(self.residual))
        return made


def fit_strap(
    model: StrapModel,
    records: Sequence[StrapRecord],
    *,
    gain: Parameter,
    noise: float,
    start: Mapping[str, float],
    shifts: Sequence[float] | None = None,
) -> StrapFit:
    """Least squares by Levenberg and Marquardt, within bounds, from a `start` by coefficient (a stiffness and a damping
    at least). `gain` is what is known of the IMU's; `noise` [rad^2] what an independent sample would weigh."""
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
        """Coefficients by name."""
        return {c.name: c.value(v) for c, v in zip(self.coefficients, x, strict=False)}

    def run(self, x: np.ndarray) -> StrapFit:
        residual, jacobian, cost = self.evaluate(x)
        damp, converged = 1e-4, False
        for _ in range(ITERATIONS):
            slope = jacobian.T @ residual + self.prior * (self.expected - x)
            held = ((x <= self.lower) & (slope < 0.0)) | ((x >= self.upper) & (slope > 0.0))
            open_ = ~held
            gram = (jacobian.T @ jacobian + np.diag(self.prior))[np.ix_(open_, open_)]
            scale = np.sqrt(np.diag(gram))
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
            if gained <= TOLERANCE * cost:
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
        """What a point costs by what is known before."""
        return float(self.prior @ (self.expected - x) ** 2)

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Residual, Jacobian of the model, both without drift, and the cost."""
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
