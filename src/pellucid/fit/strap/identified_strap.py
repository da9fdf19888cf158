"""A strap as its recordings show it: which model, how stiff where it begins to pull, over which range, and how sure.

Stiffness is the tangent where the strap begins to pull, of what stays: a branch that relaxes adds its own, for a while.
How far features move it that were not missed, and physics that no model has, is part of its interval; where that leaves
nothing worth reading, the interval is refused in words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from ..._errors import IdentificationError
from ..parameter import Parameter
from ..uncertainty import correlation_time
from .coupled_impedance import DECAY, CouplingFit, Instrument
from .strap_choice import StrapChoice, choose_strap
from .strap_discrepancy import strap_discrepancy
from .strap_fit import StrapFit, StrapRecord, fit_strap
from .strap_model import FULL, KELVIN_VOIGT, StrapModel
from .strap_torque import StrappedSwing, StrapTorque

GAIN = Parameter("gain", "1", 1.0, 0.005)
"""What is known of an IMU's angle before: filters that turn by rates are right to half a per cent."""
SPRING = 0.003
"""Share by which a common error of all torques, the spring's, may scale a strap: a calibration with weights."""
WIDEST = 0.10
"""Share of the stiffness from which on a standard error says nothing."""
NOISE = 1e-3
"""Of the IMU's angle, an independent sample's, before anything is fitted [rad^2]."""
LATE = 0.1
"""How far clocks differ from trial to trial where the motion does not tell them [s]."""
CLOCK_STEPS = 4
LEVEL = 0.05
"""Of the test whether the model holds."""
RANGE = (1.0, 99.0)
"""Percentiles of the stretch between which a strap was seen."""


@dataclass(frozen=True, eq=False)
class IdentifiedStrap:
    """What is known of one strap."""

    model: StrapModel
    stiffness: Parameter  # The tangent where it begins to pull, of what stays [N m/rad]
    damping: Parameter
    others: tuple[Parameter, ...]  # Of its features
    covariance: np.ndarray = field(repr=False)  # (k, k) Of these, in this order
    range: tuple[float, float]  # Of stretches seen [rad]
    ends: tuple[Parameter, Parameter]  # Tangents there [N m/rad]
    holds: float  # P value of no physics beside the model being missed
    errors: Mapping[str, float]  # Of blocks held out, by model [rad]
    missed: Mapping[str, float]  # By feature: p value of predicting no worse without it
    # (m,) Mismatch by the IMU, as it is without askewness [rad], and what stays of the torque there [N m]
    seen: tuple[np.ndarray, np.ndarray] = field(repr=False)
    plain: StrapFit = field(repr=False)  # By Kelvin and Voigt
    fit: StrapFit = field(repr=False)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All of them."""
        return (self.damping, self.stiffness, *self.others)

    @property
    def fits(self) -> bool:
        """Whether the model holds."""
        return self.holds >= LEVEL

    def mismatch(self, swing: StrappedSwing, torque: StrapTorque, *, plain: bool = False) -> np.ndarray:
        """Limb less orthosis at the actuator's times, (n,) [rad], as this strap, or the plain one, answers a torque."""
        fit = self.plain if plain else self.fit
        record = StrapRecord(swing, torque, fit.shifts[0], 0.0)
        limb = record.response(fit.model, fit.values)[0]
        return CubicSpline(record.time, limb - record.robot)(np.clip(swing.time, record.time[0], record.time[-1]))

    def instrument(self, swing: StrappedSwing, torque: StrapTorque, clock: float) -> Instrument:
        """Clock and mounting of the IMU in a trial, the strap held; its clock is about a `clock` ahead [s]."""
        record = StrapRecord(swing, torque, clock, 0.0)
        path = CubicSpline(record.time, record.response(self.fit.model, self.fit.values)[0])
        shift, offset = clock, 0.0
        for _ in range(CLOCK_STEPS):
            at = np.clip(record.seen_time + shift, record.time[0], record.time[-1])
            off = record.seen - self.fit.gain * path(at)
            rate = self.fit.gain * path(at, 1)
            step = record.swiftly(np.column_stack([off, rate]))
            shift += float(step[:, 0] @ step[:, 1] / max(float(step[:, 1] @ step[:, 1]), 1e-12))
            offset = float(np.mean(off))
        return Instrument(shift, offset, self.fit.gain)

    def torque(self, stretch: np.ndarray) -> np.ndarray:
        """What it carries in the end at a mismatch, (n,) [rad], its slack included; gives (n,) [N m]."""
        half = 0.5 * self.fit.values.get("slack", 0.0)
        e = stretch - np.clip(stretch, -half, half)
        return self.fit.values["stiffness"] * e * (1.0 + self.fit.values.get("hardening", 0.0) * e**2 / 3.0)


def identify_strap(
    swings: Sequence[StrappedSwing],
    torques: Sequence[StrapTorque],
    coupling: CouplingFit,
    steps: Sequence[StrappedSwing] = (),
    step_torques: Sequence[StrapTorque] = (),
) -> IdentifiedStrap:
    """Choose a model on swings, and on trials in which torques are held; `coupling` is where the search begins."""
    start = {"stiffness": coupling.stiffness.value, "damping": coupling.damping.value}
    records, full = _records(swings, torques, coupling, start, steps, step_torques)
    return _known(choose_strap(records, GAIN, full), records, held=len(records) > len(swings))


def _records(swings, torques, coupling, start, steps, step_torques) -> tuple[list[StrapRecord], StrapFit]:
    """Trials, the clocks of swings found by their motion, each weighing what its noise allows; and a first fit."""
    decay = DECAY * start["damping"] / start["stiffness"]
    clocks = [i.shift for i in coupling.instruments]
    # Which samples are left out follows the clock.
    records = [StrapRecord(s, t, c, decay) for s, t, c in zip(swings, torques, clocks, strict=True)]
    clocks = fit_strap(KELVIN_VOIGT, records, gain=GAIN, noise=NOISE, start=start).shifts
    records = [StrapRecord(s, t, c, decay) for s, t, c in zip(swings, torques, clocks, strict=True)]
    usual = float(np.mean(clocks))
    for swing, torque in zip(steps, step_torques, strict=True):
        try:
            records.append(StrapRecord(swing, torque, usual, decay, slowest=0.0, late=LATE))
        except IdentificationError:
            continue  # too little of it is known to the strap: the swings stand alone
    first = fit_strap(FULL, records, gain=GAIN, noise=NOISE, start=start)
    ends = np.cumsum(first.lengths)
    residuals = [first.residual[e - n : e] for e, n in zip(ends, first.lengths, strict=True)]
    noise = [2.0 * correlation_time(r, [len(r)]) * float(np.mean(r**2)) for r in residuals]
    usual = float(np.mean(noise[: len(swings)]))
    for record, own in zip(records, noise, strict=True):
        record.weight = float(np.sqrt(usual / own))
    near = {**first.values, "gain": first.gain}
    return records, fit_strap(FULL, records, gain=GAIN, noise=usual, start=near, shifts=first.shifts)


def _known(choice: StrapChoice, records: Sequence[StrapRecord], *, held: bool) -> IdentifiedStrap:
    fit = choice.fit
    statistical = fit.covariance() + fit.moved_by_body(records)
    beside = strap_discrepancy(fit, records, statistical)
    count = len(fit.model.coefficients)
    total = (statistical + beside.covariance)[:count, :count].copy()
    values = np.array([c.sought(fit.values[c.name]) for c in fit.model.coefficients])
    total[:2, :2] += SPRING**2 * np.outer(values[:2], values[:2])
    # Features that were not missed may be there all the same.
    full = choice.tried[FULL.name]
    if full is not fit:
        other = full.covariance() + full.moved_by_body(records)
        for i in range(2):
            apart = full.values[fit.free[i]] - fit.values[fit.free[i]]
            total[i, i] += apart**2 + max(other[i, i] - statistical[i, i], 0.0)
    error, own = np.sqrt(np.diag(total)), np.sqrt(np.diag(statistical)[:count])
    parameters = []
    for i, c in enumerate(fit.model.coefficients):
        value, unit = fit.values[c.name], c.value(values[i]) if c.searched == "logarithm" else 1.0
        refused = ""
        # Swings take what relaxes in seconds for what stays.
        if c.name == "stiffness" and (not held or error[i] > WIDEST * value):
            refused = "these motions do not tell the strap's stiffness from what relaxes or gives in it; hold torques"
        bound = c.name in fit.at_bound
        told = not bound and abs(value) > 1.96 * error[i] * unit
        parameters.append(
            Parameter(c.name, c.unit, value, error[i] * unit, bound, told, statistical_error=own[i] * unit,
                      refused=refused)
        )  # fmt: skip
    seen = np.concatenate([r.response(fit.model, fit.values)[1] for r in records])
    low, high = (float(v) for v in np.percentile(seen, RANGE))
    return IdentifiedStrap(
        fit.model, parameters[0], parameters[1], tuple(parameters[2:]), total, (low, high),
        (_tangent(parameters, total, low), _tangent(parameters, total, high)), beside.holds, choice.errors,
        choice.missed, _seen(fit, records), choice.plain, fit,
    )  # fmt: skip


def _seen(fit: StrapFit, records: Sequence[StrapRecord]) -> tuple[np.ndarray, np.ndarray]:
    """Where the IMU saw the limb on the strap's curve: the residual is the angle's."""
    places, torques = [], []
    half, ends = 0.5 * fit.values.get("slack", 0.0), np.cumsum(fit.lengths)
    for record, shift, n, end in zip(records, fit.shifts, fit.lengths, ends, strict=True):
        stretch = record.at_imu(record.response(fit.model, fit.values)[1][:, None], shift)[:, 0]
        side = np.sign(record.at_imu(record.torque[:, None], shift)[:, 0])
        places.append(stretch + half * side + fit.residual[end - n : end] / (fit.gain * record.weight))
        curved = 1.0 + fit.values.get("hardening", 0.0) * stretch**2 / 3.0
        torques.append(fit.values["stiffness"] * stretch * curved)
    return np.concatenate(places), np.concatenate(torques)


def _tangent(parameters: Sequence[Parameter], covariance: np.ndarray, stretch: float) -> Parameter:
    """Stiffness at a stretch [rad]."""
    k, u, slope = parameters[0].value, 0.0, np.zeros(len(parameters))
    for i, p in enumerate(parameters):
        if p.name == "hardening":
            u, slope[i] = p.value, k * stretch**2
    slope[0] = 1.0 + u * stretch**2
    error = float(np.sqrt(slope @ covariance @ slope))
    return Parameter("tangent", "N*m/rad", k * slope[0], error, refused=parameters[0].refused)
