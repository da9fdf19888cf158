"""Control laws of a worn elbow robot, each built from an identified card and the place of its carriage, nothing else.

Here are those of a published comparison [1]_: the constructor's position control (`position_control`), and open-loop
compensation with one set of parameters for each direction, with friction (`full_compensation`) and without
(`partial_compensation`). Their corrected forms, and what goes beyond them, are in `transparent_laws`.

Of the published position control only the elbow is here: the shoulder, which it could not lock, is not modelled.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, section 4.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .. import _core
from .._errors import PellucidError
from ..models.directional_slider import FRICTION_TERMS, GRAVITY_TERMS, INERTIA_TERMS, DirectionalSliderModel
from ..models.joint import GRAVITY
from ..models.slider_card import SliderCard
from .limits import Limits

PERIOD = 1e-3
"""Of the control panel that the laws are published for [s]."""

ELBOW_LIMITS = Limits(effort=10.0, rate=1000.0, velocity=8.0, position=(0.0, 2.6))

PUBLISHED_EXPONENTS = (-1.0, -1.9)
"""k of equation 8, upwards and downwards, as five people chose it on the paper's robot."""

LAW_NAMES: Mapping[str, tuple[str, ...]] = {
    "position_prediction": tuple(_core.POSITION_PREDICTION_PARAMETER_NAMES),
    "directional": tuple(_core.DIRECTIONAL_PARAMETER_NAMES),
    "transparent": tuple(_core.TRANSPARENT_PARAMETER_NAMES),
}
"""Parameters of each law, in the core's order."""


@dataclass(frozen=True)
class ElbowLaw:
    """A law as the core takes it.

    Attributes
    ----------
    kind : str
        One of `LAW_NAMES`.
    values : mapping of str to float
        By name, SI.
    sensed, emg : bool
        Whether it needs a force sensor, or EMG.
    """

    kind: str
    values: Mapping[str, float]
    sensed: bool = False
    emg: bool = False

    @property
    def parameters(self) -> np.ndarray:
        """Shape (k,), in the core's order."""
        return np.array([self.values[name] for name in LAW_NAMES[self.kind]])

    def changed(self, **values: float) -> ElbowLaw:
        """The same law with some of its parameters changed.

        Parameters
        ----------
        **values : float
            By name, SI.

        Returns
        -------
        ElbowLaw

        Raises
        ------
        PellucidError
            If the law has no such parameter.
        """
        unknown = [name for name in values if name not in self.values]
        if unknown:
            raise PellucidError(f"law {self.kind}: found no parameter {', '.join(unknown)}")
        return replace(self, values={**self.values, **values})


def position_control(
    card: SliderCard,
    slider: float,
    *,
    bandwidth: float = 100.0,
    speed_span: int = 8,
    dead_band: float = 0.02,
    limits: Limits = ELBOW_LIMITS,
    period: float = PERIOD,
) -> ElbowLaw:
    """The constructor's closed-loop position control (CLPC): sent each period to where it would be in one.

    Parameters
    ----------
    card : SliderCard
        "pooled": one set for both directions. Its gravity and Coulomb friction are compensated, nothing else.
    slider : float
        Where the carriage is [m].
    bandwidth : float
        Of the loop, stiffness over inertia to the half [rad/s]; the paper gives no gain.
    speed_span : int
        Samples that the velocity's difference reaches back.
    dead_band : float
        Speeds below are rest [rad/s].
    limits : Limits
    period : float
        [s]

    Returns
    -------
    ElbowLaw

    Raises
    ------
    PellucidError
        If the card is of another family.
    """
    up = _sets(card, ("pooled", "pooled_at_once"))[0]
    sine, cosine = _gravity(up, slider)
    values = {
        "gravity_sine": sine,
        "gravity_cosine": cosine,
        "coulomb": max(up[FRICTION_TERMS][0], 0.0),
        "stiffness": max(_inertia(up, slider), 0.0) * bandwidth**2,
        "dead_band": dead_band,
        "speed_span": float(speed_span),
        **gate_values(limits, period),
    }
    return ElbowLaw("position_prediction", values)


def full_compensation(
    card: SliderCard,
    slider: float,
    *,
    exponents: tuple[float, float] = PUBLISHED_EXPONENTS,
    speed_span: int = 8,
    dead_band: float = 0.05,
    acceleration: float = 8.0,
    limits: Limits = ELBOW_LIMITS,
    period: float = PERIOD,
) -> ElbowLaw:
    r"""Open-loop compensation by direction, with friction (FC).

    .. math::
        \tau = g[(s_1 x + s_0)\sin q + c\cos q] + \nu\dot q + \mathrm{sign}(\dot q)\,(\tau_{dry} + J |\dot q|^k)

    Parameters
    ----------
    card : SliderCard
        "dissociated": one set for each direction.
    slider : float
        Where the carriage is [m].
    exponents : tuple of float
        k of equation 8, upwards and downwards.
    speed_span : int
        Samples that the velocity's difference reaches back.
    dead_band : float
        Speeds below are rest [rad/s].
    acceleration : float
        The inertia's term is never more than the inertia takes at this [rad/s^2].
    limits : Limits
    period : float
        [s]

    Returns
    -------
    ElbowLaw

    Raises
    ------
    PellucidError
        If the card is of another family.
    """
    values: dict[str, float] = {}
    largest = 0.0
    for name, one, k in zip(
        ("up", "down"), _sets(card, ("dissociated", "dissociated_at_once")), exponents, strict=True
    ):
        # An inertia that an identification made negative would brake.
        inertia = max(_inertia(one, slider), 0.0)
        largest = max(largest, inertia)
        sine, cosine = _gravity(one, slider)
        coulomb, viscous = one[FRICTION_TERMS]
        terms = (sine, cosine, coulomb, viscous, inertia, k)
        keys = ("gravity_sine", "gravity_cosine", "coulomb", "viscous", "inertia", "exponent")
        values |= {f"{key}_{name}": float(value) for key, value in zip(keys, terms, strict=True)}
    values |= {
        "dead_band": dead_band,
        "inertia_limit": largest * acceleration,
        "speed_span": float(speed_span),
        **gate_values(limits, period),
    }
    return ElbowLaw("directional", values)


def partial_compensation(card: SliderCard, slider: float, **settings) -> ElbowLaw:
    """Open-loop compensation by direction without friction (PCFr).

    Parameters
    ----------
    card : SliderCard
        "dissociated".
    slider : float
        Where the carriage is [m].
    **settings
        As `full_compensation` takes them.

    Returns
    -------
    ElbowLaw

    Raises
    ------
    PellucidError
        If the card is of another family.
    """
    law = full_compensation(card, slider, **settings)
    return law.changed(coulomb_up=0.0, coulomb_down=0.0, viscous_up=0.0, viscous_down=0.0)


def gate_values(limits: Limits, period: float) -> dict[str, float]:
    """The last nine parameters of every law: what the safety gate lets through.

    Parameters
    ----------
    limits : Limits
    period : float
        [s]

    Returns
    -------
    dict of str to float
        By name, SI.
    """
    return {
        "effort_limit": limits.effort,
        "rate_limit": limits.rate,
        "velocity_limit": limits.velocity,
        "position_min": limits.position[0],
        "position_max": limits.position[1],
        "stop_margin": limits.stop_margin,
        "max_age": 5.0 * period,
        "max_repeats": 2.0,
        "period": period,
    }


def _sets(card: SliderCard, families: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    model = card.model()
    if card.family not in families or not isinstance(model, DirectionalSliderModel):
        raise PellucidError(f'card {card.family}: expected one of "{families[0]}", as this law has it')
    return model.up, model.down


def _gravity(one: np.ndarray, slider: float) -> tuple[float, float]:
    slope, moment, cross = one[GRAVITY_TERMS]
    return float(GRAVITY * (slope * slider + moment)), float(GRAVITY * cross)


def _inertia(one: np.ndarray, slider: float) -> float:
    a0, a1, a2 = one[INERTIA_TERMS]
    return float(a0 + a1 * slider + a2 * slider**2)
