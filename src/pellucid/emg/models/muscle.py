r"""One muscle over arrays: force from activation, length and velocity, on a rigid or an elastic tendon.

.. math::
   F = F_0 \max\left(0,\; a f_l(\tilde l) f_v(\tilde v) + f_p(l/l_o) + \beta\tilde v\right)\cos\varphi, \qquad
   \tilde l = \frac{l}{l_o(\lambda(1 - a) + 1)}, \quad \tilde v = \frac{\dot l}{v_{max} l_o}

The physics is the core's (``include/pellucid/muscle.hpp``, ``elastic_muscle.hpp``, ``activation.hpp``); muscles of a
joint whose numbers are identified are `hill.HillMuscle`.

Calibrated muscles as a card's settings: all their numbers in SI, what drives each, the joints that they move.

A card's parameters are what was fitted, as factors of an anatomical model; who exports or simulates needs the muscles
themselves. Keys of ``settings``: ``joints`` and ``muscles`` (names between commas), ``muscle.<muscle>.<quantity>`` for
every quantity of the core, ``driven.<muscle>`` (EMG channels whose mean drives it), ``tissue.<joint>.<number>`` for the
joint's own offset, stiffness and damping, and ``effort``, the share of a maximal contraction for an envelope of 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import _core
from ..._errors import PellucidError
from ...models.parameter_card import ParameterCard
from .hill import MUSCLE_QUANTITIES, HillMuscle


@dataclass(frozen=True, kw_only=True)
class Muscle:
    """A muscle of Hill's type.

    Parameters
    ----------
    max_isometric_force : float
        F_0 [N], > 0.
    optimal_fibre_length : float
        l_o, where the fully active fibre is strongest [m], > 0.
    tendon_slack_length : float
        l_ts [m], at least 0; above 0 with an elastic tendon.
    pennation : float
        Angle of the fibre to the tendon at l_o [rad], from 0 to below pi/2.
    max_velocity : float
        v_max, of shortening without load, in l_o per second [1/s], > 0.
    damping : float
        beta, of the fibre, in F_0 per v_max l_o [1], at least 0.
    tendon_strain : float or None
        Of the tendon under F_0 [1], > 0: 0.033 is usual. None: the tendon is rigid.
    optimal_length_shift : float
        lambda, by how much longer l_o is without activation [1], at least 0; 0 takes it for constant.

    Raises
    ------
    PellucidError
        If a number is not finite or out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> muscle = pl.Muscle(max_isometric_force=1000.0, optimal_fibre_length=0.10, tendon_slack_length=0.20)
    >>> length = 0.20 + np.array([0.08, 0.10, 0.12])
    >>> muscle.force(activation=1.0, length=length).round(0)
    array([ 915., 1000.,  967.])
    >>> muscle.force(activation=1.0, length=0.30, velocity=[-0.5, 0.0, 0.5]).round(0)
    array([ 167., 1000., 1417.])
    """

    max_isometric_force: float
    optimal_fibre_length: float
    tendon_slack_length: float
    pennation: float = 0.0
    max_velocity: float = 10.0
    damping: float = 0.0
    tendon_strain: float | None = None
    optimal_length_shift: float = 0.15

    def __post_init__(self):
        positive = ["max_isometric_force", "optimal_fibre_length", "max_velocity"]
        positive += [] if self.tendon_strain is None else ["tendon_strain", "tendon_slack_length"]
        for name in ("tendon_slack_length", "pennation", "damping", "optimal_length_shift", *positive):
            value = getattr(self, name)
            if not np.isfinite(value) or value < 0.0 or (name in positive and value == 0.0):
                least = "above 0" if name in positive else "of at least 0"
                raise PellucidError(f"muscle, {name}: found {value!r}, expected a finite number {least}, in SI")
        if self.pennation >= 0.5 * np.pi:
            raise PellucidError(f"muscle, pennation: found {self.pennation:g} rad, expected less than pi/2")

    def force(self, activation: ArrayLike, length: ArrayLike, velocity: ArrayLike = 0.0) -> np.ndarray:
        """Force in the tendon; arguments broadcast against each other.

        Parameters
        ----------
        activation : array_like
            a [1]; clipped to [0, 1].
        length : array_like
            Of muscle and tendon together [m].
        velocity : array_like
            How fast that grows [m/s]. On an elastic tendon it must be 0: how it is shared between fibre and tendon
            depends on what was before, which `simulate` follows.

        Returns
        -------
        ndarray, of the arguments' common shape
            [N], at least 0; NaN where an argument is not finite.

        Raises
        ------
        PellucidError
            If shapes do not fit, or a velocity is asked for on an elastic tendon.

        Examples
        --------
        >>> import pellucid as pl
        >>> soleus = pl.Muscle(
        ...     max_isometric_force=3500.0, optimal_fibre_length=0.05, tendon_slack_length=0.25, pennation=0.4,
        ...     tendon_strain=0.033,
        ... )
        >>> soleus.force(activation=[0.0, 0.5, 1.0], length=0.30).round(0)
        array([  30., 1569., 3144.])
        """
        try:
            a, at, v = np.broadcast_arrays(*(np.asarray(x, float) for x in (activation, length, velocity)))
        except ValueError:
            shapes = [np.shape(x) for x in (activation, length, velocity)]
            raise PellucidError(
                f"muscle: found activation, length and velocity of the shapes {shapes}, expected ones that broadcast"
            ) from None
        if self.tendon_strain is None:
            return self._states(a, at, v)[0].reshape(a.shape)
        if np.any(v != 0.0):
            raise PellucidError(
                "muscle: found a velocity other than 0 on an elastic tendon, expected none: use simulate(activation, "
                "length, period=), which keeps the state of the tendon"
            )
        at_rest, finite = self._elastic(1e-3), np.isfinite(a) & np.isfinite(at)
        forces = [at_rest.rest(x, y) if ok else np.nan for x, y, ok in zip(a.flat, at.flat, finite.flat, strict=True)]
        return np.array(forces, float).reshape(a.shape)

    def simulate(self, activation: ArrayLike, length: ArrayLike, *, period: float) -> tuple[np.ndarray, np.ndarray]:
        """Force and fibre length while length and activation change; starts at rest.

        Parameters
        ----------
        activation : array_like, shape (n,) or a number
            a [1]; clipped to [0, 1].
        length : array_like, shape (n,)
            Of muscle and tendon together [m].
        period : float
            From one sample to the next [s], > 0.

        Returns
        -------
        force, fibre_length : ndarray, shape (n,)
            [N] and [m].

        Raises
        ------
        PellucidError
            If there are fewer than two samples, shapes do not fit, or the period is not above 0.

        Examples
        --------
        >>> import numpy as np
        >>> import pellucid as pl
        >>> muscle = pl.Muscle(
        ...     max_isometric_force=1000.0, optimal_fibre_length=0.10, tendon_slack_length=0.20, damping=0.1,
        ...     tendon_strain=0.033,
        ... )
        >>> activation = muscle.activation(np.ones(500), period=1e-3)
        >>> force, fibre_length = muscle.simulate(activation, np.full(500, 0.30), period=1e-3)
        >>> bool(force[0] < 100.0), round(float(force[-1])), round(1e3 * float(fibre_length[-1]), 1)
        (True, 990, 93.4)
        """
        at = np.asarray(length, float)
        a = np.broadcast_to(np.asarray(activation, float), at.shape) if np.ndim(activation) == 0 else activation
        a = np.ascontiguousarray(a, float)
        if at.ndim != 1 or len(at) < 2 or a.shape != at.shape or not period > 0.0:
            raise PellucidError(
                f"muscle: found activation of shape {a.shape}, length of shape {at.shape} and the period {period!r}, "
                "expected (n,) of both, n at least 2, and a period above 0"
            )
        if self.tendon_strain is None:
            return self._states(a, at, np.gradient(at, period))
        elastic = self._elastic(period)
        elastic.rest(0.0, float(at[0]))
        return elastic.run(a, at)

    def activation(
        self,
        excitation: ArrayLike,
        *,
        period: float,
        activation_time: float = 0.010,
        deactivation_time: float = 0.040,
        start: float = 0.0,
    ) -> np.ndarray:
        """Activation from excitation: a first-order lag that is quicker while activation rises.

        Parameters
        ----------
        excitation : array_like, shape (n,)
            [1]; clipped to [0, 1], constant over each period.
        period : float
            [s], > 0.
        activation_time, deactivation_time : float
            Time constants at half activation, about [s], > 0.
        start : float
            Activation before the first sample [1].

        Returns
        -------
        ndarray, shape (n,)
            At the end of each period [1].

        Raises
        ------
        PellucidError
            If the excitation is no row of numbers, or a time is not above 0.

        Examples
        --------
        >>> import numpy as np
        >>> import pellucid as pl
        >>> muscle = pl.Muscle(max_isometric_force=1000.0, optimal_fibre_length=0.10, tendon_slack_length=0.20)
        >>> muscle.activation(np.ones(4), period=0.01).round(2)
        array([0.86, 0.92, 0.95, 0.97])
        """
        try:
            return _core.activation_dynamics(
                excitation, period=period, activation_time=activation_time, deactivation_time=deactivation_time,
                start=start,
            )  # fmt: skip
        except (ValueError, TypeError) as error:
            raise PellucidError(f"muscle, activation: {error}") from None

    def force_length(self, fibre_length: ArrayLike) -> np.ndarray:
        """Active force of the fully active fibre over its length, without velocity.

        Parameters
        ----------
        fibre_length : array_like
            In l_o [1]; below 0.1 as at 0.1.

        Returns
        -------
        ndarray, of the argument's shape
            In F_0 [1].

        Examples
        --------
        >>> import pellucid as pl
        >>> muscle = pl.Muscle(max_isometric_force=1000.0, optimal_fibre_length=0.10, tendon_slack_length=0.20)
        >>> muscle.force_length([0.5, 1.0, 1.5]).round(2)
        array([0.57, 1.  , 0.57])
        """
        return self._curve(1.0, fibre_length, 0.0, passive_scale=0.0)

    def passive_force_length(self, fibre_length: ArrayLike) -> np.ndarray:
        """Force of the passive fibre over its length, without velocity.

        Parameters
        ----------
        fibre_length : array_like
            In l_o [1].

        Returns
        -------
        ndarray, of the argument's shape
            In F_0 [1].

        Examples
        --------
        >>> import pellucid as pl
        >>> muscle = pl.Muscle(max_isometric_force=1000.0, optimal_fibre_length=0.10, tendon_slack_length=0.20)
        >>> muscle.passive_force_length([1.0, 1.3, 1.6]).round(2)
        array([0.  , 0.12, 1.  ])
        """
        return self._curve(0.0, fibre_length, 0.0)

    def force_velocity(self, fibre_velocity: ArrayLike) -> np.ndarray:
        """Active force of the fully active fibre at l_o over its velocity.

        Parameters
        ----------
        fibre_velocity : array_like
            In v_max l_o [1], lengthening positive.

        Returns
        -------
        ndarray, of the argument's shape
            In F_0 [1].

        Examples
        --------
        >>> import pellucid as pl
        >>> muscle = pl.Muscle(max_isometric_force=1000.0, optimal_fibre_length=0.10, tendon_slack_length=0.20)
        >>> muscle.force_velocity([-1.0, -0.5, 0.0, 0.5]).round(2)
        array([0.  , 0.17, 1.  , 1.42])
        """
        return self._curve(1.0, 1.0, fibre_velocity, passive_scale=0.0)

    def _vector(self, **other: float) -> np.ndarray:
        """The core's numbers, envelope and activation passing as they are."""
        own = {
            "optimal_fibre_length": self.optimal_fibre_length, "tendon_slack_length": self.tendon_slack_length,
            "max_isometric_force": self.max_isometric_force, "pennation": self.pennation, "damping": self.damping,
            "max_velocity": self.max_velocity, "optimal_length_shift": self.optimal_length_shift,
        }  # fmt: skip
        straight = {"shape": 0.0, "time_constant_1": 0.0, "time_constant_2": 0.0, "delay": 0.0}
        return HillMuscle("", **{**straight, **own, **other}).vector()

    def _states(self, a: np.ndarray, length: np.ndarray, velocity: np.ndarray, **other: float):
        """Force [N] and fibre length [m] on a rigid tendon, each of shape (n,)."""
        rows = [np.ascontiguousarray(x, float).reshape(1, -1) for x in (a, length, velocity)]
        # Samples know nothing of each other: one that is missing must not stay in a delay line, and a period is none.
        missing = ~np.isfinite(rows).all(axis=(0, 1))
        _, force, fibre_length, _ = _core.hill_states(
            self._vector(**other)[np.newaxis], *np.where(missing, 0.0, rows), period=1.0
        )
        return tuple(np.where(missing, np.nan, x[0]) for x in (force, fibre_length))

    def _elastic(self, period: float) -> _core.ElasticMuscle:
        assert self.tendon_strain is not None  # callers treat a rigid tendon before
        return _core.ElasticMuscle(self._vector(), tendon_strain=self.tendon_strain, period=period)

    def _curve(self, activation: float, length: ArrayLike, velocity: ArrayLike, **other: float) -> np.ndarray:
        """Force of a fibre of length and strength 1 that lies along a tendon of no length, in F_0."""
        plain = {"optimal_fibre_length": 1.0, "tendon_slack_length": 0.0, "max_isometric_force": 1.0, "pennation": 0.0,
                 "damping": 0.0, "max_velocity": 1.0}  # fmt: skip
        at, v = np.broadcast_arrays(np.asarray(length, float), np.asarray(velocity, float))
        return self._states(np.full(at.shape, activation), at, v, **plain, **other)[0].reshape(at.shape)


CARD_KIND = "muscles"

TISSUE_QUANTITIES = ("offset", "stiffness", "damping")
"""Numbers of a joint's own tissue: torque = offset - stiffness * angle - damping * speed, in N m, rad and s."""


@dataclass(frozen=True)
class CalibratedMuscles:
    """Muscles as they were calibrated, with what a reader needs to use them."""

    muscles: tuple[HillMuscle, ...]  # SI; one set, whatever joints they move
    driven: Mapping[str, tuple[str, ...]]  # EMG channels by muscle, whose mean is its excitation
    tissue: Mapping[str, tuple[float, float, float]]  # By joint, in the order of `TISSUE_QUANTITIES`
    effort: float = 1.0  # Share of a maximal contraction that an envelope of 1 stands for

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that the muscles move."""
        return tuple(self.tissue)

    def settings(self) -> dict[str, str | float]:
        """Settings, in the form in which a card stores them."""
        said: dict[str, str | float] = {
            "joints": ", ".join(self.joints),
            "muscles": ", ".join(m.name for m in self.muscles),
            "effort": self.effort,
        }
        for muscle in self.muscles:
            said[f"driven.{muscle.name}"] = ", ".join(self.driven[muscle.name])
            said |= {
                f"muscle.{muscle.name}.{quantity}": float(x)
                for quantity, x in zip(MUSCLE_QUANTITIES, muscle.vector(), strict=True)
            }
        for joint, numbers in self.tissue.items():
            said |= {f"tissue.{joint}.{name}": float(x) for name, x in zip(TISSUE_QUANTITIES, numbers, strict=True)}
        return said


def calibrated_muscles(card: ParameterCard) -> CalibratedMuscles:
    """The muscles that a card keeps."""
    if card.kind != CARD_KIND:
        raise PellucidError(f"the card {card.name}: found a card of {card.kind}, expected one of {CARD_KIND}")

    def asked(key: str) -> str | float:
        if key not in card.settings:
            raise PellucidError(f"the card {card.name}: found no setting {key}, expected it; calibrate again")
        return card.settings[key]

    def tissue(joint: str) -> tuple[float, float, float]:
        offset, stiffness, damping = (float(asked(f"tissue.{joint}.{number}")) for number in TISSUE_QUANTITIES)
        return offset, stiffness, damping

    names, joints = _names(asked("muscles")), _names(asked("joints"))
    return CalibratedMuscles(
        tuple(HillMuscle(name, **{q: float(asked(f"muscle.{name}.{q}")) for q in MUSCLE_QUANTITIES}) for name in names),
        {name: _names(asked(f"driven.{name}")) for name in names},
        {joint: tissue(joint) for joint in joints},
        float(asked("effort")),
    )


def _names(said: str | float) -> tuple[str, ...]:
    return tuple(part.strip() for part in str(said).split(",") if part.strip())
