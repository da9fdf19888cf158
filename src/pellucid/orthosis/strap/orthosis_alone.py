r"""Identify the orthosis without a wearer, and compute a wearer's torque through an identified strap.

Gravity comes from holds, inertia and friction from sinusoidal motions.

Two models are fitted to the same sines and evaluated on sines of another amplitude. The published model is a transfer
function with two poles and no zeros, in which a spring takes the place of gravity. The other is a pendulum with
friction, whose gravity is known from the holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from ... import _core
from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...numerics.filters import central_difference, decimate, zero_phase_lowpass
from ...numerics.gravity_holds import GravityFit, find_holds, fit_gravity, phasor_parameters
from ...numerics.uncertainty import sandwich_covariance
from ..input_output import InputOutput
from ..transfer.fit_transfer_function import Response, TransferFit, evaluate_transfer_function, fit_records
from ..transfer.pendulum_fit import PendulumFit, evaluate_pendulum, fit_pendulum
from .strap_fit import RECORD_SETTINGS
from .strap_model import CORE_NAMES, Limb, Orthosis, StrappedSwing, from_orthosis

SPRING_HOLD = "first"
"""The torque is that of a spring, so it is interpolated linearly between samples (first-order hold)."""

FREE_PENDULUM_PARAMETERS = ("inertia", "damping", "coulomb", "offset")
"""Parameters of the pendulum that the sines determine. Gravity is known from the holds."""

COVARIANCE_ORDER = ("inertia", "damping", "gravity", "coulomb")
"""Order of the parameters in the orthosis's covariance."""

PUBLISHED_POLE_COUNT = 2
"""Number of poles of the published transfer function."""

PUBLISHED_ZERO_COUNT = 0
"""Number of zeros of the published transfer function."""

SINE_FIT_RATE_HZ = 100.0
"""Sines are decimated to about this rate before the fit, torque and angle through the same filter."""

HANGING_ANGLE_LOWPASS_HZ = 10.0
"""Cut-off of the low-pass before differentiation, in the estimate of the hanging angle."""

MIN_FRICTION_SPEED = 0.1
"""Slower samples are excluded, because the sign of friction is unknown there [rad/s]."""


@dataclass(frozen=True, eq=False)
class OrthosisFit:
    """The identified orthosis without a wearer."""

    gravity: GravityFit  # gravity from the holds
    pendulum: PendulumFit  # pendulum fitted to all sines for fitting, with gravity known
    linear: TransferFit  # published transfer function, fitted to the same sines
    # responses of the pendulum to held-out sines, by recording; each initial state is estimated
    checks: Mapping[str, Response]
    linear_checks: Mapping[str, Response]  # responses of the published transfer function to held-out sines
    # (4, 4) covariance in `COVARIANCE_ORDER`; it includes the effect of gravity's error on the other parameters
    covariance: np.ndarray = field(repr=False)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Gravity, then inertia and friction, with the standard errors of `covariance`."""
        sd = dict(zip(COVARIANCE_ORDER, np.sqrt(np.diag(self.covariance)), strict=True))
        free = (replace(p, standard_error=float(sd.get(p.name, p.standard_error))) for p in self.pendulum.parameters)
        return (*self.gravity.parameters[:1], *free)

    @property
    def orthosis(self) -> Orthosis:
        """The parameters as the strap's torque needs them."""
        inertia, damping, coulomb = self.pendulum.complete[:3]
        zero = self.gravity.zero
        return Orthosis(
            inertia,
            damping,
            self.gravity.gravity.value,
            coulomb,
            self.covariance,
            0.0 if zero is None else zero.value,
            float(self.pendulum.complete[5]),
        )

    def mean_fit(self, split: str = "heldout", *, linear: bool = False) -> float:
        """Return the mean fit over the records of a `split` [%], of the pendulum or of the published `linear` model."""
        fitted = (self.linear if linear else self.pendulum).responses
        found = fitted if split == "fitted" else (self.linear_checks if linear else self.checks).values()
        fits = [r.fit for r in found]
        return float(np.mean(fits)) if fits else float("nan")


def fit_orthosis(
    held: Sequence[InputOutput], sines: Sequence[InputOutput], checks: Sequence[InputOutput] = ()
) -> OrthosisFit:
    """Identify the orthosis from static holds and sines; `checks` are sines that only evaluate the models."""
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
    linear = fit_records(sines, PUBLISHED_POLE_COUNT, PUBLISHED_ZERO_COUNT, hold=SPRING_HOLD, units=("N*m", "rad"))
    return OrthosisFit(
        gravity,
        pendulum,
        linear,
        {r.recording: evaluate_pendulum(pendulum, r) for r in checks},
        {r.recording: evaluate_transfer_function(linear.transfer_function, r, hold=SPRING_HOLD) for r in checks},
        _covariance(sines, pendulum, gravity.gravity),
    )


def hanging_angle(sines: Sequence[InputOutput]) -> Parameter:
    """Estimate the angle at which the orthosis hangs from motions to both sides of it [rad].

    The torque is regressed on acceleration, velocity, its sign, the sine and cosine of the angle, and a constant. Holds
    on one side could not separate the cosine from the constant.
    """
    blocks, targets = [], []
    for r in sines:
        fs = (len(r) - 1) / float(r.time[-1] - r.time[0])
        torque, q = zero_phase_lowpass(np.column_stack([r.input, r.output]), HANGING_ANGLE_LOWPASS_HZ, 2, fs).T
        rate = central_difference(q, fs)
        columns = [central_difference(rate, fs), rate, np.sign(rate), np.sin(q), np.cos(q), np.ones(len(q))]
        inside = slice(round(0.5 * fs), len(q) - round(0.5 * fs), max(1, round(fs / SINE_FIT_RATE_HZ)))
        moving = np.abs(rate[inside]) > MIN_FRICTION_SPEED
        blocks.append(np.column_stack(columns)[inside][moving])
        targets.append(torque[inside][moving])
    w, y = np.vstack(blocks), np.concatenate(targets)
    values, *_ = np.linalg.lstsq(w, y, rcond=None)
    covariance = sandwich_covariance(w, y - w @ values, [len(t) for t in targets])[3:5, 3:5]
    return phasor_parameters(values[3:5], covariance)[1]


def _thinned(record: InputOutput, zero: float) -> InputOutput:
    """Decimate torque and angle through the same filter, and measure the angle from the hanging angle `zero`."""
    fs = (len(record) - 1) / float(record.time[-1] - record.time[0])
    factor = max(1, round(fs / SINE_FIT_RATE_HZ))
    torque, angle = decimate(np.column_stack([record.input, record.output]), factor).T
    return replace(record, time=record.time[::factor], input=torque, output=angle - zero)


def _pendulum(sines: Sequence[InputOutput], gravity: float) -> PendulumFit:
    return fit_pendulum(sines, hold=SPRING_HOLD, free=FREE_PENDULUM_PARAMETERS, known={"gravity": gravity})


def _covariance(sines: Sequence[InputOutput], found: PendulumFit, gravity: Parameter) -> np.ndarray:
    """Return the covariance of the four parameters: that of the sines, and the effect of an error of gravity."""
    names = [p.name for p in found.parameters]
    step = max(gravity.standard_error, 1e-4 * gravity.value)
    moved = _pendulum(sines, gravity.value + step)
    slope = {n: (moved[n].value - found[n].value) / step for n in names}
    slope["gravity"] = 1.0
    covariance = np.zeros((4, 4))
    for i, a in enumerate(COVARIANCE_ORDER):
        for j, b in enumerate(COVARIANCE_ORDER):
            covariance[i, j] = slope[a] * slope[b] * gravity.standard_error**2
            if a in names and b in names:
                covariance[i, j] += found.covariance[names.index(a), names.index(b)]
    return covariance


GAP_TORQUE_SHARE = 0.02
"""A slack strap is in its gap if its torque is at most this share of the torque's standard deviation.

Chosen by judgement; no measurement is recorded.
"""


def strapped_torque(
    time: np.ndarray,
    position: np.ndarray,
    torque: np.ndarray,
    *,
    orthosis: Orthosis,
    limb: Limb,
    strap: np.ndarray,
    lowpass: float,
) -> np.ndarray:
    """Return the wearer's torque about the joint, shape (n,) [N m].

    `time` [s], the orthosis's `position` [rad] and its `torque` [N m] have shape (n,). `strap` holds the strap's
    parameters in the core's order (``StrapModel.core``), shape (p,). `lowpass` is a cut-off [Hz].
    """
    nowhere = np.zeros(0)
    trial = StrappedSwing("", "fitted", time, position, torque, nowhere, nowhere)
    limb_position, _, against, _ = _core.strap_response(
        strap, position, from_orthosis(trial, orthosis).torque, period=1.0 / trial.fs, still=0.0, active=[]
    )
    if strap[CORE_NAMES.index("strap_slack")] > 0.0:
        limb_position = position + _interpolate_gap(limb_position - position, against, trial.fs)
    angle, through = zero_phase_lowpass(np.column_stack([limb_position, against]), lowpass, 4, trial.fs).T
    velocity = central_difference(angle, trial.fs)
    own = limb.inertia * central_difference(velocity, trial.fs) + limb.viscous * velocity
    return own + limb.gravity * np.sin(angle - limb.zero) + through


def _interpolate_gap(ahead: np.ndarray, against: np.ndarray, fs: float) -> np.ndarray:
    """Return the limb's angle relative to the orthosis, interpolated where the strap is in its gap, shape (n,) [rad].

    `ahead` is this angle by the strap's model, and `against` the strap's torque, both of shape (n,).
    """
    reach = max(1, round(RECORD_SETTINGS.reversal_margin_s * fs))
    free = np.convolve(np.abs(against) <= GAP_TORQUE_SHARE * np.std(against), np.ones(2 * reach + 1), "same") > 0.5
    on_flank = np.flatnonzero(~free)
    if not free.any() or len(on_flank) < 2:
        return ahead
    at = np.clip(np.arange(len(ahead)), on_flank[0], on_flank[-1])
    return np.where(free, PchipInterpolator(on_flank, ahead[on_flank])(at), ahead)
