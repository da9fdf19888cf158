r"""The orthosis without a wearer: gravity from holds, inertia and friction from sines, judged at another amplitude.

Two models of the same sines stand side by side: the published one, a transfer function with two poles and no zeros, in
which gravity has to pass for a spring, and a pendulum with friction, its gravity known from the holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import IdentificationError
from ...signals.filters import central_difference, decimate, zero_phase_lowpass
from ...signals.input_output import InputOutput
from ..joint.gravity_holds import GravityFit, find_holds, fit_gravity, phasor_parameters
from ..parameter import Parameter
from ..transfer.pendulum_fit import PendulumFit, evaluated_pendulum, fit_pendulum
from ..transfer.transfer_function_fit import Response, TransferFit, evaluated, fit_records
from ..uncertainty import sandwich
from .strap_torque import Orthosis

HOLD = "first"
"""The torque is that of a spring: between samples it goes straight."""
FREE = ("inertia", "damping", "coulomb", "offset")
ORDER = ("inertia", "damping", "gravity", "coulomb")
"""Of the orthosis's covariance."""
POLES, ZEROS = 2, 0
RATE = 100.0
"""Sines are fitted on about so many samples a second, torque and angle through the same filter."""
LOWPASS = 10.0
"""Ahead of derivatives, for the angle of rest [Hz]."""
SLOW = 0.1
"""Slower samples tell nothing of friction's side [rad/s]."""


@dataclass(frozen=True, eq=False)
class OrthosisFit:
    """What was found of the orthosis alone."""

    gravity: GravityFit  # From holds
    pendulum: PendulumFit  # From all fitted sines together, gravity known
    linear: TransferFit  # The published form, from the same
    # Held-out sines by the pendulum, each with its initial state estimated; by recording
    checks: Mapping[str, Response]
    linear_checks: Mapping[str, Response]  # The same by the published form
    # (4, 4) Of inertia, damping, gravity and Coulomb friction; what is not known of gravity is in all of them
    covariance: np.ndarray = field(repr=False)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Gravity first, then inertia and friction, with standard errors of `covariance`."""
        sd = dict(zip(ORDER, np.sqrt(np.diag(self.covariance)), strict=True))
        free = (replace(p, standard_error=float(sd.get(p.name, p.standard_error))) for p in self.pendulum.parameters)
        return (*self.gravity.parameters[:1], *free)

    @property
    def orthosis(self) -> Orthosis:
        """Ready for the strap's torque."""
        values = dict(zip(("inertia", "damping", "coulomb"), self.pendulum.complete[:3], strict=True))
        return Orthosis(
            values["inertia"],
            values["damping"],
            self.gravity.gravity.value,
            values["coulomb"],
            self.covariance,
            self.gravity.zero.value,
            float(self.pendulum.complete[5]),
        )

    def mean_fit(self, split: str = "heldout", *, linear: bool = False) -> float:
        """Mean fit over the records of a `split` [%], by the pendulum or by the published `linear` form."""
        fitted = (self.linear if linear else self.pendulum).responses
        found = fitted if split == "fitted" else (self.linear_checks if linear else self.checks).values()
        fits = [r.fit for r in found]
        return float(np.mean(fits)) if fits else float("nan")


def fit_orthosis(
    held: Sequence[InputOutput], sines: Sequence[InputOutput], checks: Sequence[InputOutput] = ()
) -> OrthosisFit:
    """Identify the orthosis alone."""
    if not held or not sines:
        raise IdentificationError(
            f"the orthosis alone: found {len(held)} recordings of holds and {len(sines)} of sines, expected one or "
            "more of each to fit"
        )
    zero = hanging_angle(sines)
    holds = [h for r in held for h in find_holds(r.time, r.output, r.input, recording=r.recording)]
    gravity = fit_gravity(holds, zero=zero)
    sines, checks = ([_thinned(r, zero.value) for r in group] for group in (sines, checks))
    pendulum = _pendulum(sines, gravity.gravity.value)
    linear = fit_records(sines, POLES, ZEROS, hold=HOLD, units=("N*m", "rad"))
    return OrthosisFit(
        gravity,
        pendulum,
        linear,
        {r.recording: evaluated_pendulum(pendulum, r) for r in checks},
        {r.recording: evaluated(linear.transfer_function, r, hold=HOLD) for r in checks},
        _covariance(sines, pendulum, gravity.gravity),
    )


def hanging_angle(sines: Sequence[InputOutput]) -> Parameter:
    """Angle at which the orthosis hangs, from motions to both sides of it.

    Least squares of the torque on acceleration, velocity, its sign, the sine and cosine of the angle, and 1. Holds on
    one side hardly tell a cosine from an offset; motions to both sides do.

    Gives [rad].
    """
    blocks, targets = [], []
    for r in sines:
        fs = (len(r) - 1) / float(r.time[-1] - r.time[0])
        torque, q = zero_phase_lowpass(np.column_stack([r.input, r.output]), LOWPASS, 2, fs).T
        rate = central_difference(q, fs)
        columns = [central_difference(rate, fs), rate, np.sign(rate), np.sin(q), np.cos(q), np.ones(len(q))]
        inside = slice(round(0.5 * fs), len(q) - round(0.5 * fs), max(1, round(fs / RATE)))
        moving = np.abs(rate[inside]) > SLOW
        blocks.append(np.column_stack(columns)[inside][moving])
        targets.append(torque[inside][moving])
    w, y = np.vstack(blocks), np.concatenate(targets)
    values, *_ = np.linalg.lstsq(w, y, rcond=None)
    covariance = sandwich(w, y - w @ values, [len(t) for t in targets])[3:5, 3:5]
    return phasor_parameters(values[3:5], covariance)[1]


def _thinned(record: InputOutput, zero: float) -> InputOutput:
    """At a lower rate, torque and angle alike, the angle from where it hangs."""
    fs = (len(record) - 1) / float(record.time[-1] - record.time[0])
    factor = max(1, round(fs / RATE))
    torque, angle = decimate(np.column_stack([record.input, record.output]), factor).T
    return replace(record, time=record.time[::factor], input=torque, output=angle - zero)


def _pendulum(sines: Sequence[InputOutput], gravity: float) -> PendulumFit:
    return fit_pendulum(sines, hold=HOLD, free=FREE, known={"gravity": gravity})


def _covariance(sines: Sequence[InputOutput], found: PendulumFit, gravity: Parameter) -> np.ndarray:
    """Of all four: the sines' own, and what a wrong gravity does to the others."""
    names = [p.name for p in found.parameters]
    step = max(gravity.standard_error, 1e-4 * gravity.value)
    moved = _pendulum(sines, gravity.value + step)
    slope = {n: (moved[n].value - found[n].value) / step for n in names}
    slope["gravity"] = 1.0
    covariance = np.zeros((4, 4))
    for i, a in enumerate(ORDER):
        for j, b in enumerate(ORDER):
            covariance[i, j] = slope[a] * slope[b] * gravity.standard_error**2
            if a in names and b in names:
                covariance[i, j] += found.covariance[names.index(a), names.index(b)]
    return covariance
