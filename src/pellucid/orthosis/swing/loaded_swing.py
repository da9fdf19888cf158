r"""Identify inertia and gravity of an exoskeleton's shank, empty and with a leg in it; design swings that show them.

The paper `hill` writes a swing as (its eqs. 9 and 10)

.. math::  T = p \ddot\theta - q g \sin\theta, \qquad p = m d^2, \quad q = m d

which is unstable where a leg hangs. The corrected equation, around the angle of rest and with friction and offset, is

.. math::  T = p \ddot\theta + q g \sin(\theta - \theta_0) + b \dot\theta + c \,\mathrm{sign}\,\dot\theta + T_0

Both are linear in the unknowns (q cos theta_0 and q sin theta_0 if the angle of rest is unknown), so least squares have
a closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import Estimates, Parameter
from ...models.filtered_dynamics import filtered_effort, filtered_jacobian
from ...models.joint import GRAVITY, NAMES, PARAMETER_INDEX
from ...numerics.filters import zero_phase_lowpass
from ...numerics.gravity_holds import phasor_parameters
from ...numerics.motion import Filtering, Motion
from ...numerics.regression import (
    least_squares_within,
    make_parameters,
    regression_rows,
    require_full_rank,
    snap_to_bounds,
    stack,
)
from ...numerics.searches.adam import AdamPath, adam
from ...numerics.uncertainty import sandwich_covariance

COEFFICIENT_UNITS = {
    "inertia": "kg*m^2",
    "weight_moment": "kg*m",
    "weight_moment_sine": "kg*m",
    "weight_moment_cosine": "kg*m",
    "viscous": "N*m*s/rad",
    "coulomb": "N*m",
    "offset": "N*m",
}
"""Units of the linear coefficients of both forms. The paper's p and q are the first two."""

NON_NEGATIVE_TERMS = ("inertia", "viscous", "coulomb")
"""Coefficients that are bounded to be non-negative in the corrected form."""


@dataclass(frozen=True, eq=False)
class Swing:
    """One filtered swing with the samples that are fitted."""

    whole: Motion  # all samples, through one zero-phase low-pass
    kept: slice  # samples that are fitted

    @property
    def recording(self) -> str:
        """Name of the recording."""
        return self.whole.recording

    @property
    def fs(self) -> float:
        """Rate of the fitted samples [Hz]."""
        return self.whole.fs / self.kept.step

    @cached_property
    def time(self) -> np.ndarray:
        """Time of the fitted samples, shape (n,) [s]."""
        return self.rows(self.whole.time)

    @cached_property
    def position(self) -> np.ndarray:
        """Angle at the fitted samples, shape (n,) [rad]."""
        return self.rows(self.whole.position)

    @cached_property
    def velocity(self) -> np.ndarray:
        """Velocity at the fitted samples, shape (n,) [rad/s]."""
        return self.rows(self.whole.velocity)

    @cached_property
    def acceleration(self) -> np.ndarray:
        """Acceleration at the fitted samples, shape (n,) [rad/s^2]."""
        return self.rows(self.whole.acceleration)

    @cached_property
    def torque(self) -> np.ndarray:
        """Torque at the fitted samples, shape (n,) [N m]."""
        return self.rows(self.whole.effort)

    @property
    def effort(self) -> np.ndarray:
        """Torque of all samples [N m]."""
        return self.whole.effort

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """Return the fitted samples of an array over all samples, (m,) or (m, k)."""
        return samples[self.kept]

    def __len__(self) -> int:
        return len(self.time)


def swing(
    time: np.ndarray,
    position: np.ndarray,
    torque: np.ndarray,
    *,
    lowpass: float,
    order: int = 4,
    trim: int | None = None,
    every: int = 1,
    recording: str = "",
) -> Swing:
    """Prepare a recorded swing: filter angle and torque alike, differentiate, and cut the borders.

    `time` [s], `position` [rad] and `torque` [N m] have shape (n,). `lowpass` is the cut-off [Hz]; one sample in
    `every` is fitted.
    """
    fs = (len(time) - 1) / float(time[-1] - time[0])
    border = round(2.0 * fs / lowpass) if trim is None else trim
    if len(time) <= 2 * border + 10:
        raise IdentificationError(
            f"{recording or 'the swing'}: found {len(time)} samples, expected more than {2 * border + 10}: the filter "
            "takes as many to settle"
        )
    angle = zero_phase_lowpass(position, lowpass, order, fs)
    velocity = np.gradient(angle, 1.0 / fs)
    # The second difference of the angle spans three samples; differentiating the velocity again would span five.
    acceleration = np.zeros_like(angle)
    acceleration[1:-1] = (angle[2:] - 2.0 * angle[1:-1] + angle[:-2]) * fs**2
    filtered = zero_phase_lowpass(torque, lowpass, order, fs)
    whole = Motion(
        fs, np.asarray(time, float), angle, velocity, acceleration, filtered, Filtering(lowpass, order), recording
    )
    return Swing(whole, slice(max(border, 1), len(time) - max(border, 1), every))


@dataclass(frozen=True)
class SwingForm:
    """The equation that is fitted to a swing."""

    terms: tuple[str, ...]  # linear coefficients, among `COEFFICIENT_UNITS`
    hanging: float = 0.0  # angle of rest, where it is not estimated [rad]
    sign: float = 1.0  # sign of the gravity term: 1, or -1 as published
    linear = True
    label = "a swing"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the linear coefficients."""
        return self.terms

    def unit(self, name: str) -> str:
        """Return the SI unit of a coefficient."""
        return COEFFICIENT_UNITS[name]

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper bounds, each (k,), SI; the published form has none."""
        lower = [0.0 if n in NON_NEGATIVE_TERMS and self.sign > 0.0 else -np.inf for n in self.terms]
        return np.array(lower), np.full(len(lower), np.inf)

    def selection(self) -> np.ndarray:
        """Return the matrix, (core parameters, k), with core vector = selection @ coefficients."""
        targets = {
            "inertia": {"inertia": 1.0},
            "weight_moment": {"gravity_sine": self.sign * GRAVITY},
            "weight_moment_sine": {"gravity_sine": GRAVITY},
            "weight_moment_cosine": {"gravity_cosine": GRAVITY},
            "viscous": {"viscous_positive": 1.0, "viscous_negative": 1.0},
            "coulomb": {"coulomb_positive": 1.0, "coulomb_negative": 1.0},
            "offset": {"offset": 1.0},
        }
        matrix = np.zeros((len(NAMES), len(self.terms)))
        for column, name in enumerate(self.terms):
            for target, gain in targets[name].items():
                matrix[PARAMETER_INDEX[target], column] = gain
        return matrix

    def effort(self, values: np.ndarray, motion: Swing) -> np.ndarray:
        """Return the torque at all samples of a swing, (m,) [N m], for coefficients `values`, (k,)."""
        return filtered_effort(self.selection() @ values, self._about_rest(motion))

    def jacobian(self, values: np.ndarray, motion: Swing) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque at all samples, (m,), and its derivatives by the coefficients, (m, k)."""
        chosen = self.selection()
        return filtered_jacobian(chosen @ values, chosen, self._about_rest(motion))

    def regressor(self, motion: Swing) -> np.ndarray:
        """Return the torque per unit of each coefficient at the fitted samples, shape (n, k)."""
        return motion.rows(self.jacobian(np.zeros(len(self.terms)), motion)[1])

    def _about_rest(self, motion: Swing) -> Motion:
        return replace(motion.whole, position=motion.whole.position - self.hanging)


def published_form(zero: float = 0.0) -> SwingForm:
    """Return the form of equations 9 and 10 as printed; `zero` is the angle of rest [rad]."""
    return SwingForm(("inertia", "weight_moment"), zero, -1.0)


def corrected_form(
    hanging: float | None = 0.0, *, friction: bool = True, viscous: bool = True, offset: bool = True
) -> SwingForm:
    """Return the form of a hanging pendulum with friction and a torque offset.

    `hanging` is the angle of rest [rad]; None estimates it.
    """
    gravity = ("weight_moment",) if hanging is not None else ("weight_moment_sine", "weight_moment_cosine")
    rest = [n for n, wanted in (("viscous", viscous), ("coulomb", friction), ("offset", offset)) if wanted]
    return SwingForm(("inertia", *gravity, *rest), 0.0 if hanging is None else hanging)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SwingFit(Estimates):
    """Inertia m d^2 and weight moment m d of a swinging body, with angle of rest, friction and offset if estimated."""

    form: SwingForm
    coefficients: np.ndarray  # (k,) coefficients of the form's terms, to which the covariance (k, k) belongs
    residual_rms: float  # root mean square of the residual [N m]
    correlation: float  # correlation between the columns of inertia and gravity
    condition: float  # condition number of the regressor

    @property
    def inertia(self) -> Parameter:
        """m d^2 [kg m^2], the paper's p."""
        return self["inertia"]

    @property
    def weight_moment(self) -> Parameter:
        """m d [kg m], the paper's q."""
        return self["weight_moment"]

    @property
    def others(self) -> tuple[Parameter, ...]:
        """The angle of rest, friction and the offset, where they were estimated."""
        return self.parameters[2:]

    @property
    def mass(self) -> float:
        """Mass of the point mass with this inertia and weight moment [kg]."""
        return self.weight_moment.value**2 / self.inertia.value

    @property
    def distance(self) -> float:
        """Distance of that point mass from the axis [m]."""
        return self.inertia.value / self.weight_moment.value

    def torque(self, motion: Swing) -> np.ndarray:
        """Predict the torque of a swing at its n fitted samples, shape (n,) [N m]."""
        return self.form.regressor(motion) @ self.coefficients


def fit_swings(swings: Sequence[Swing], form: SwingForm) -> SwingFit:
    """Fit swings by least squares in closed form, bounded to physical values."""
    matrix, torque = _stacked_rows(swings, form)
    require_full_rank(form.terms, matrix, ", ".join(s.recording or "a swing" for s in swings))
    values = least_squares_within(matrix, torque, *form.bounds())
    values, held = snap_to_bounds(values, *form.bounds(), matrix, torque - matrix @ values)
    residual = torque - matrix @ values
    covariance = sandwich_covariance(matrix, residual, [len(s) for s in swings], free=~held)
    return _swing_fit(form, values, covariance, held, residual, matrix)


def adam_swings(
    swings: Sequence[Swing],
    form: SwingForm,
    *,
    rate: float,
    final_rate: float | None = None,
    iterations: int,
    start: np.ndarray | None = None,
    batch: int | None = None,
) -> AdamPath:
    """Minimise the same mean squared torque error by Adam (eqs. 13 to 15 of the paper, divided by the samples).

    The paper counts its iterations in seconds, as if they ran along with the swing, and does not state on how many
    samples each gradient is computed. Here it is all samples, or `batch` samples at a time in their order, cyclically.
    `start` has shape (k,).
    """
    matrix, torque = _stacked_rows(swings, form)
    parts = range(0, len(torque), batch or len(torque))[1:]
    pairs = zip(np.split(matrix, parts), np.split(torque, parts), strict=True)
    # The cost is a quadratic form, so one pass over the samples serves all iterations.
    forms = cycle([(w.T @ w / len(y), w.T @ y / len(y), float(y @ y) / len(y)) for w, y in pairs])

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        gram, moment, power = next(forms)
        pull = gram @ x
        return float(x @ pull - 2.0 * (moment @ x)) + power, 2.0 * (pull - moment)

    first = np.zeros(len(form.terms)) if start is None else start
    return adam(cost, first, rate=rate, final_rate=final_rate, iterations=iterations)


def _stacked_rows(swings: Sequence[Swing], form: SwingForm) -> tuple[np.ndarray, np.ndarray]:
    """Return the regressor, (n, k), and the torque, (n,), of all swings."""
    data = stack(swings)
    return regression_rows(form, np.zeros(len(form.terms)), data)[0], data.target


def _swing_fit(form, values, covariance, held, residual, matrix) -> SwingFit:
    plain = make_parameters(form.terms, [COEFFICIENT_UNITS[n] for n in form.terms], values, covariance, held)
    found = {p.name: p for p in plain}
    others = tuple(p for name, p in found.items() if not name.startswith(("inertia", "weight_moment")))
    if "weight_moment" in found:
        moment = found["weight_moment"]
        column = matrix[:, form.terms.index("weight_moment")]
    else:
        chosen = [form.terms.index("weight_moment_sine"), form.terms.index("weight_moment_cosine")]
        size, zero = phasor_parameters(values[chosen], covariance[np.ix_(chosen, chosen)])
        moment = Parameter("weight_moment", COEFFICIENT_UNITS["weight_moment"], size.value, size.standard_error)
        others = (Parameter("hanging", "rad", zero.value, zero.standard_error), *others)
        column = matrix[:, chosen] @ values[chosen]
    return SwingFit(
        title="What swings",
        parameters=(found["inertia"], moment, *others),
        covariance=covariance,
        form=form,
        coefficients=values,
        residual_rms=float(np.sqrt(np.mean(residual**2))),
        correlation=float(np.corrcoef(matrix[:, form.terms.index("inertia")], column)[0, 1]),
        condition=float(np.linalg.cond(matrix)),
    )


def leg_alone(empty: SwingFit, loaded: SwingFit) -> tuple[Parameter, Parameter]:
    """Return the leg's inertia [kg m^2] and weight moment [kg m], the difference between loaded and empty swings."""

    def less(with_leg: Parameter, without: Parameter) -> Parameter:
        value = with_leg.value - without.value
        sd = float(np.hypot(with_leg.standard_error, without.standard_error))
        held = with_leg.at_bound or without.at_bound
        return Parameter(with_leg.name, with_leg.unit, value, sd, held, abs(value) > 1.96 * sd > 0.0)

    return less(loaded.inertia, empty.inertia), less(loaded.weight_moment, empty.weight_moment)


@dataclass(frozen=True, eq=False)
class WearerTorque:
    """A wearer's torque at the knee from the balance of torques; arrays of shape (n,)."""

    time: np.ndarray  # [s]
    torque: np.ndarray  # [N m]
    standard_error: np.ndarray  # standard error due to the parameters' covariances [N m]


def bare_leg_torque(empty: SwingFit, loaded: SwingFit, motion: Swing) -> WearerTorque:
    """Return the torque that a leg needs to swing by itself: loaded minus empty (eq. 12 of the paper).

    This is the wearer's torque if the exoskeleton takes none of it: it is taken off, or its motor compensates it fully.
    """
    if empty.form != loaded.form:
        raise IdentificationError(
            f"found the terms {', '.join(empty.form.terms)} empty and {', '.join(loaded.form.terms)} loaded, expected "
            "one form for both, with one angle of rest"
        )
    matrix = loaded.form.regressor(motion)
    return _wearer_torque(motion, matrix @ (loaded.coefficients - empty.coefficients), matrix, loaded, empty)


def worn_exoskeleton_torque(loaded: SwingFit, motion: Swing) -> WearerTorque:
    """Return the torque that leg and exoskeleton need to swing, minus the motor's torque.

    This is the wearer's torque in a worn exoskeleton whose motor gives little or no torque.
    """
    matrix = loaded.form.regressor(motion)
    return _wearer_torque(motion, matrix @ loaded.coefficients - motion.torque, matrix, loaded)


def _wearer_torque(motion: Swing, torque: np.ndarray, matrix: np.ndarray, *fits: SwingFit) -> WearerTorque:
    covariance = sum(fit.covariance for fit in fits)
    return WearerTorque(motion.time, torque, np.sqrt(np.einsum("ni,ij,nj->n", matrix, covariance, matrix)))
