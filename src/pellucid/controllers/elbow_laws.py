"""Control laws of a worn elbow robot, each built from an identified card and the place of its carriage, nothing else.

Here are those of a published comparison [1]_: the constructor's position control (`position_control`), and open-loop
compensation with one set of parameters for each direction, with friction (`full_compensation`) and without
(`partial_compensation`). Their corrected forms and extensions are in `transparent_laws`.

The published position control is implemented for the elbow only, because the shoulder is not modelled.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, section 4.2.
"""

from __future__ import annotations

import numpy as np

from .._errors import PellucidError
from ..models.joint import GRAVITY
from ..models.slider_joint import FRICTION_TERMS, GRAVITY_TERMS, INERTIA_TERMS, DirectionalSliderModel, SliderCard
from .control_law import DIRECTIONAL_LAW, POSITION_PREDICTION_LAW, ControlLaw, Limits, gate_values

PUBLISHED_PERIOD_S = 1e-3
"""Period of the control panel for which the laws are published."""

ELBOW_LIMITS: Limits = Limits(effort=10.0, rate=1000.0, velocity=8.0, position=(0.0, 2.6))

LOOP_BANDWIDTH = 100.0
"""Bandwidth of the position loop, whose stiffness is the inertia times its square [rad/s]."""

PUBLISHED_EXPONENTS = (-1.0, -1.9)
"""Exponents k of equation 8, upwards and downwards, as five people chose them on the paper's robot."""


def position_control(
    card: SliderCard,
    slider: float,
    *,
    bandwidth: float = LOOP_BANDWIDTH,
    speed_span: int = 8,
    dead_band: float = 0.02,
    limits: Limits = ELBOW_LIMITS,
    period: float = PUBLISHED_PERIOD_S,
) -> ControlLaw:
    """The constructor's closed-loop position control (CLPC): sent each period to where it would be in one. `slider`
    [m]; `bandwidth` [rad/s]; `dead_band` [rad/s]; `period` [s]."""
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
    return ControlLaw(POSITION_PREDICTION_LAW.name, values)


def full_compensation(
    card: SliderCard,
    slider: float,
    *,
    exponents: tuple[float, float] = PUBLISHED_EXPONENTS,
    speed_span: int = 8,
    dead_band: float = 0.05,
    acceleration: float = 8.0,
    inertia: tuple[float, float] | None = None,
    limits: Limits = ELBOW_LIMITS,
    period: float = PUBLISHED_PERIOD_S,
) -> ControlLaw:
    r"""Open-loop compensation by direction, with friction (FC).

    .. math::
        \tau = g[(s_1 x + s_0)\sin q + c\cos q] + \nu\dot q + \mathrm{sign}(\dot q)\,(\tau_{dry} + J |\dot q|^k).

    `slider` [m]; `dead_band` [rad/s]; `acceleration` [rad/s^2]; `inertia` replaces the card's J upwards and
    downwards, sign and all [kg*m^2]; `period` [s].
    """
    values: dict[str, float] = {}
    largest = 0.0
    sets = _sets(card, ("dissociated", "dissociated_at_once"))
    # A J that an identification made negative would brake; so does that of the paper's own table.
    given = [max(_inertia(one, slider), 0.0) for one in sets] if inertia is None else inertia
    for name, one, k, own in zip(("up", "down"), sets, exponents, given, strict=True):
        largest = max(largest, abs(own))
        sine, cosine = _gravity(one, slider)
        coulomb, viscous = one[FRICTION_TERMS]
        terms = (sine, cosine, coulomb, viscous, own, k)
        keys = ("gravity_sine", "gravity_cosine", "coulomb", "viscous", "inertia", "exponent")
        values |= {f"{key}_{name}": float(value) for key, value in zip(keys, terms, strict=True)}
    values |= {
        "dead_band": dead_band,
        "inertia_limit": largest * acceleration,
        "speed_span": float(speed_span),
        **gate_values(limits, period),
    }
    return ControlLaw(DIRECTIONAL_LAW.name, values)


def partial_compensation(card: SliderCard, slider: float, **settings) -> ControlLaw:
    """Open-loop compensation by direction without friction (PCFr). `slider` [m]."""
    law = full_compensation(card, slider, **settings)
    return law.changed(coulomb_up=0.0, coulomb_down=0.0, viscous_up=0.0, viscous_down=0.0)


def _sets(card: SliderCard, families: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    model = card.model()
    if card.family not in families or not isinstance(model, DirectionalSliderModel):
        raise PellucidError(f'found the model card of the family "{card.family}", expected "{families[0]}"')
    return model.up, model.down


def _gravity(one: np.ndarray, slider: float) -> tuple[float, float]:
    slope, moment, cross = one[GRAVITY_TERMS]
    return float(GRAVITY * (slope * slider + moment)), float(GRAVITY * cross)


def _inertia(one: np.ndarray, slider: float) -> float:
    a0, a1, a2 = one[INERTIA_TERMS]
    return float(a0 + a1 * slider + a2 * slider**2)
