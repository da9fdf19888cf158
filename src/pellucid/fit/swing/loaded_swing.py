r"""An exoskeleton's shank swung empty and with a relaxed leg in it: inertia, gravity, and the leg by difference.

The paper `hill` writes a swing as (its eqs. 9 and 10)

.. math::  T = p \ddot\theta - q g \sin\theta, \qquad p = m d^2, \quad q = m d

which falls over where a leg hangs. Corrected, about the angle of rest and with what else takes torque:

.. math::  T = p \ddot\theta + q g \sin(\theta - \theta_0) + b \dot\theta + c \,\mathrm{sign}\,\dot\theta + T_0

Both are linear in what is unknown (with q cos theta_0 and q sin theta_0 where the angle of rest is), so that least
squares are in closed form. A body of at most the mass m has p >= q^2 / m, by the Cauchy-Schwarz inequality; where a
swing would have it otherwise, the fit is the best one on that bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import cycle

import numpy as np
from scipy.optimize import brentq, lsq_linear

from ..._errors import IdentificationError
from ...models.joint import GRAVITY
from ...signals.filters import zero_phase_lowpass
from ..joint.gravity_holds import phasor_parameters
from ..parameter import Parameter
from ..searches.adam import AdamPath, adam
from ..uncertainty import sandwich

UNITS = {
    "p": "kg*m^2",
    "q": "kg*m",
    "q_sine": "kg*m",
    "q_cosine": "kg*m",
    "viscous": "N*m*s/rad",
    "coulomb": "N*m",
    "offset": "N*m",
}
"""Linear coefficients of either form, and their units."""

NEVER_NEGATIVE = ("p", "viscous", "coulomb")


@dataclass(frozen=True, eq=False)
class Swing:
    """One swing, position and torque through the same zero-phase low-pass.

    Attributes
    ----------
    recording : str
    fs : float
        [Hz]
    time, position, velocity, acceleration, torque : ndarray, shape (n,)
        [s], [rad], [rad/s], [rad/s^2], [N m].
    direction : ndarray, shape (n,)
        Sign of the velocity, through the same low-pass.
    """

    recording: str
    fs: float
    time: np.ndarray = field(repr=False)
    position: np.ndarray = field(repr=False)
    velocity: np.ndarray = field(repr=False)
    acceleration: np.ndarray = field(repr=False)
    torque: np.ndarray = field(repr=False)
    direction: np.ndarray = field(repr=False)

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
    """Make a recording of a swing ready: filter both sides alike, differentiate, cut the borders.

    Parameters
    ----------
    time, position, torque : ndarray, shape (n,)
        Evenly sampled [s], [rad], [N m].
    lowpass : float
        Cut-off of the zero-phase Butterworth filter [Hz].
    order : int
        Of one pass.
    trim : int, optional
        Samples cut off at either border; two periods of the cut-off if left out.
    every : int
        One sample in so many is kept; at least 4 for each period of the cut-off lose nothing.
    recording : str
        For messages.

    Returns
    -------
    Swing

    Raises
    ------
    IdentificationError
        If nothing is left between the borders.
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
    # A second difference of the angle, not of the velocity, spans three samples and not five.
    acceleration = np.zeros_like(angle)
    acceleration[1:-1] = (angle[2:] - 2.0 * angle[1:-1] + angle[:-2]) * fs**2
    direction = zero_phase_lowpass(np.sign(velocity), lowpass, order, fs)
    filtered = zero_phase_lowpass(torque, lowpass, order, fs)
    kept = slice(max(border, 1), len(time) - max(border, 1), every)
    columns = (time, angle, velocity, acceleration, filtered, direction)
    return Swing(recording, fs / every, *(np.asarray(column, dtype=float)[kept] for column in columns))


@dataclass(frozen=True)
class SwingForm:
    """Which equation is fitted.

    Attributes
    ----------
    terms : tuple of str
        Linear coefficients, of `UNITS`.
    hanging : float
        Angle of rest [rad], where it is not among the coefficients.
    sign : float
        Of the gravity term: 1, or -1 as published.
    """

    terms: tuple[str, ...]
    hanging: float = 0.0
    sign: float = 1.0

    def regressor(self, motion: Swing) -> np.ndarray:
        """Torque that one unit of each coefficient takes, shape (n, k), along a swing of n samples."""
        angle = motion.position - self.hanging
        columns = {
            "p": motion.acceleration,
            "q": self.sign * GRAVITY * np.sin(angle),
            "q_sine": GRAVITY * np.sin(angle),
            "q_cosine": GRAVITY * np.cos(angle),
            "viscous": motion.velocity,
            "coulomb": motion.direction,
            "offset": np.ones(len(motion)),
        }
        return np.column_stack([columns[name] for name in self.terms])


def as_published(zero: float = 0.0) -> SwingForm:
    """Equations 9 and 10 to the letter.

    Parameters
    ----------
    zero : float
        Position at which the paper's angle is 0 [rad], where this package's 0 is hanging. The paper has it vertical
        (0 or pi: up or down is not said), and at a straight knee (rest is then at -85 degrees).

    Returns
    -------
    SwingForm
    """
    return SwingForm(("p", "q"), zero, -1.0)


def corrected(
    hanging: float | None = 0.0, *, friction: bool = True, viscous: bool = True, offset: bool = True
) -> SwingForm:
    """The pendulum that hangs, with friction and an offset of the torque's zero.

    Parameters
    ----------
    hanging : float or None
        Angle of rest [rad]; None to estimate it, which takes a wide swing beside an offset.
    friction, viscous, offset : bool
        Whether these are estimated.

    Returns
    -------
    SwingForm
    """
    gravity = ("q",) if hanging is not None else ("q_sine", "q_cosine")
    rest = [n for n, wanted in (("viscous", viscous), ("coulomb", friction), ("offset", offset)) if wanted]
    return SwingForm(("p", *gravity, *rest), 0.0 if hanging is None else hanging)


@dataclass(frozen=True, eq=False)
class SwingFit:
    """What a swing says of what swings.

    Attributes
    ----------
    form : SwingForm
    coefficients : ndarray, shape (k,)
        Of the form's terms.
    covariance : ndarray, shape (k, k)
        Theirs; allows for coloured residuals.
    p, q : Parameter
        m d^2 and m d [kg m^2], [kg m].
    others : tuple of Parameter
        The angle of rest, friction and the offset, where they were estimated.
    residual_rms : float
        [N m]
    correlation : float
        Of the columns of inertia and gravity along the swing.
    condition : float
        Of the regressor.
    mass_bound : float or None
        The mass that p >= q^2 / m was held to [kg].
    """

    form: SwingForm
    coefficients: np.ndarray
    covariance: np.ndarray = field(repr=False)
    p: Parameter
    q: Parameter
    others: tuple[Parameter, ...]
    residual_rms: float
    correlation: float
    condition: float
    mass_bound: float | None = None

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All that was estimated."""
        return (self.p, self.q, *self.others)

    @property
    def mass(self) -> float:
        """Of the point that has this p and q: q^2 / p [kg]."""
        return self.q.value**2 / self.p.value

    @property
    def distance(self) -> float:
        """Of that point from the axis: p / q [m]."""
        return self.p.value / self.q.value

    def torque(self, motion: Swing) -> np.ndarray:
        """Torque that a swing of n samples takes, shape (n,) [N m]."""
        return self.form.regressor(motion) @ self.coefficients


def fit_swings(swings: Sequence[Swing], form: SwingForm, *, mass_bound: float | None = None) -> SwingFit:
    """Least squares in closed form, within what a body can be.

    Parameters
    ----------
    swings : sequence of Swing
        Of the same body.
    form : SwingForm
        Of `corrected` or `as_published`. As published there are no bounds, whatever `mass_bound`.
    mass_bound : float, optional
        More mass than the moving body can have [kg].

    Returns
    -------
    SwingFit

    Raises
    ------
    IdentificationError
        If the swings do not tell the coefficients apart.
    """
    matrix, torque = _stacked(swings, form)
    size = np.linalg.norm(matrix, axis=0)
    if not np.all(size > 0.0) or np.linalg.cond(matrix / size) > 1e8:
        raise IdentificationError(
            f"{', '.join(s.recording or 'a swing' for s in swings)}: found no motion that tells "
            f"{', '.join(form.terms)} apart, expected one: swing wider and faster"
        )
    literal = form.sign < 0.0
    values, held, bound = (
        (np.linalg.lstsq(matrix / size, torque, rcond=None)[0] / size, np.zeros(len(size), bool), False)
        if literal
        else _bounded(matrix, torque, form, mass_bound)
    )
    free = ~held
    if bound:
        free[form.terms.index("p")] = False
    residual = torque - matrix @ values
    covariance = sandwich(matrix, residual, [len(s) for s in swings], free=free)
    if bound:
        covariance = _on_the_bound(covariance, values, form, mass_bound)
    return _fit(form, values, covariance, held, residual, matrix, mass_bound if bound else None)


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
    """The same mean square of the torque's error, by Adam (eqs. 13 to 15 of the paper, divided by the samples).

    The paper counts its iterations in seconds, as if they went along with the swing, and does not say on how many
    samples each one's gradient rests: all of them, or `batch` at a time in their order, over and over.

    Parameters
    ----------
    swings : sequence of Swing
    form : SwingForm
    rate, final_rate : float
        See `adam`.
    iterations : int
    start : ndarray, shape (k,), optional
        Of the form's terms; 0 if left out.
    batch : int, optional
        Samples of each iteration's gradient; all if left out. The path's costs are then those of each one's samples.

    Returns
    -------
    AdamPath
        Values in the order of `form.terms`.
    """
    matrix, torque = _stacked(swings, form)
    parts = range(0, len(torque), batch or len(torque))[1:]
    pairs = zip(np.split(matrix, parts), np.split(torque, parts), strict=True)
    # The cost is a quadratic form: one pass over the samples serves all iterations.
    forms = cycle([(w.T @ w / len(y), w.T @ y / len(y), float(y @ y) / len(y)) for w, y in pairs])

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        gram, moment, power = next(forms)
        pull = gram @ x
        return float(x @ pull - 2.0 * (moment @ x)) + power, 2.0 * (pull - moment)

    first = np.zeros(len(form.terms)) if start is None else start
    return adam(cost, first, rate=rate, final_rate=final_rate, iterations=iterations)


def _stacked(swings: Sequence[Swing], form: SwingForm) -> tuple[np.ndarray, np.ndarray]:
    return np.vstack([form.regressor(s) for s in swings]), np.concatenate([s.torque for s in swings])


def _bounded(matrix, torque, form, mass_bound):
    """Coefficients, which of them are held at 0, and whether the mass bound holds p."""
    size = np.linalg.norm(matrix, axis=0)
    scaled = matrix / size
    gram, moment = scaled.T @ scaled, scaled.T @ torque
    low = np.array([0.0 if name in NEVER_NEGATIVE else -np.inf for name in form.terms])
    gravity = np.array([name.startswith("q") for name in form.terms])
    inertia = form.terms.index("p")

    def solved(weight: float) -> np.ndarray:
        # Lagrange: the bound's square joins the Gram matrix, its linear part the moment.
        curved = gram + np.diag(np.where(gravity, weight / (mass_bound or 1.0) / size**2, 0.0))
        pulled = moment.copy()
        pulled[inertia] += 0.5 * weight / size[inertia]
        root = np.linalg.cholesky(curved)
        target = np.linalg.solve(root, pulled)
        return lsq_linear(root.T, target, (low, np.full(len(low), np.inf)), method="bvls", tol=1e-14).x / size

    def beyond(values: np.ndarray) -> float:
        return float(np.sum(values[gravity] ** 2) / mass_bound - values[inertia])

    values = solved(0.0)
    bound = mass_bound is not None and beyond(values) > 0.0
    if bound:
        most = float(size[inertia] ** 2 * max(abs(beyond(values)), 1e-9))
        while beyond(solved(most)) > 0.0:
            most *= 4.0
        values = solved(brentq(lambda weight: beyond(solved(weight)), 0.0, most, xtol=1e-12 * most, rtol=1e-12))
    held = (values <= low + 1e-12 / size) & np.isfinite(low)
    return values, held, bound


def _on_the_bound(covariance: np.ndarray, values: np.ndarray, form: SwingForm, mass_bound: float) -> np.ndarray:
    """The covariance with p's, which on the bound is a function of the gravity terms."""
    slope = np.eye(len(values))
    i = form.terms.index("p")
    slope[i] = [2.0 * v / mass_bound if n.startswith("q") else 0.0 for n, v in zip(form.terms, values, strict=True)]
    return slope @ covariance @ slope.T


def _fit(form, values, covariance, held, residual, matrix, mass_bound) -> SwingFit:
    sd = np.sqrt(np.diag(covariance))
    found = {
        name: Parameter(
            name, UNITS[name], float(values[i]), float(sd[i]),
            at_bound=bool(held[i]) or (name == "p" and mass_bound is not None),
            identifiable=bool(abs(values[i]) > 1.96 * sd[i] > 0.0),
        )
        for i, name in enumerate(form.terms)
    }  # fmt: skip
    others = tuple(p for name, p in found.items() if not name.startswith(("p", "q")))
    if "q" in found:
        q, gravity = found["q"], found["q"]
        column = matrix[:, form.terms.index("q")]
    else:
        chosen = [form.terms.index("q_sine"), form.terms.index("q_cosine")]
        gravity, zero = phasor_parameters(values[chosen], covariance[np.ix_(chosen, chosen)])
        q = Parameter("q", UNITS["q"], gravity.value, gravity.standard_error)
        others = (Parameter("hanging", "rad", zero.value, zero.standard_error), *others)
        column = matrix[:, chosen] @ values[chosen]
    inertia = matrix[:, form.terms.index("p")]
    return SwingFit(
        form, values, covariance, found["p"], q, others, float(np.sqrt(np.mean(residual**2))),
        float(np.corrcoef(inertia, column)[0, 1]), float(np.linalg.cond(matrix)), mass_bound,
    )  # fmt: skip
