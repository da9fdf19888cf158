"""Control laws of a worn elbow robot, each built from an identified card and the place of its carriage, nothing else.

Three are those of a published comparison [1]_: the constructor's position control (`position_control`), and open-loop
compensation with one set of parameters for each direction, with friction (`full_compensation`) and without
(`partial_compensation`). `transparent` compensates one coherent body with friction that never drives, and takes a force
sensor, EMG or an oscillator where there are any.

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
from ..models.anthropometry import Segment
from ..models.directional_slider import FRICTION_TERMS, GRAVITY_TERMS, INERTIA_TERMS, DirectionalSliderModel
from ..models.joint import GRAVITY, NAMES
from ..models.slider_card import SliderCard
from ..models.slider_joint import SliderJointModel
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


def transparent(
    card: SliderCard,
    slider: float,
    *,
    friction_share: float = 0.95,
    inertia_share: float = 0.4,
    velocity_width: float = 0.08,
    friction_lead: float = 0.0,
    bandwidth: float = 100.0,
    acceleration: float = 25.0,
    limits: Limits = ELBOW_LIMITS,
    period: float = PERIOD,
) -> ElbowLaw:
    """Compensation of one coherent body whose friction, by direction or by load, never drives.

    Of every friction parameter the lower end of its interval is compensated, so that what is left resists.

    Parameters
    ----------
    card : SliderCard
        "consistent" or "load".
    slider : float
        Where the carriage is [m].
    friction_share, inertia_share : float
        Of friction and of inertia times acceleration that are compensated [1].
    velocity_width : float
        Over which friction changes its sign [rad/s].
    friction_lead : float
        How far ahead the velocity is foreseen whose friction is compensated [s].
    bandwidth : float
        Of the Kalman estimator [rad/s].
    acceleration : float
        Largest that is fed forward [rad/s^2].
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
    model = card.model()
    if not isinstance(model, SliderJointModel):
        raise PellucidError(f"card {card.family}: found a model by direction, expected one coherent body")
    lower = card.values.copy()
    for i, parameter in enumerate(card.parameters):
        if parameter.name.startswith(("coulomb", "viscous", "load")):
            lower[i] = max(parameter.interval[0], 0.0)
    body = dict(zip(NAMES, model.vector(lower, slider, velocity_width), strict=True))
    speed = 2.0  # rad/s: as fast as the energy observer lets the robot's own inertia be sped up at once
    values = {
        **body,
        "gravity_share": 1.0,
        "friction_share": friction_share,
        "inertia_share": inertia_share,
        "friction_lead": friction_lead,
        "bandwidth": bandwidth,
        "innovation_gate": 20.0 * period,
        "max_rejections": 20.0,
        "acceleration_limit": acceleration,
        "energy_store": 0.5 * body["inertia"] * speed**2,
        **_no_feedback(),
        **_no_emg(),
        **_no_oscillator(),
        **gate_values(limits, period),
    }
    return ElbowLaw("transparent", {name: float(value) for name, value in values.items()})


def with_force_sensor(
    law: ElbowLaw,
    *,
    proportional: float = 2.5,
    integral: float = 0.0,
    leak: float = 0.5,
    lowpass: float = 200.0,
    drift: float = 0.02,
    limit: float = 3.0,
) -> ElbowLaw:
    """A transparent law that also drives the measured interaction torque to zero.

    Parameters
    ----------
    law : ElbowLaw
        From `transparent`.
    proportional, integral, leak : float
        Gains [1], [1/s] and the rate at which the integral forgets [1/s]. Where a robot sticks, an integral hunts.
    lowpass : float
        Of the sensor [rad/s].
    drift : float
        Rate below which a torque is the sensor's own [rad/s].
    limit : float
        Of what feeds back [N m].

    Returns
    -------
    ElbowLaw
    """
    gains = {"proportional": proportional, "integral": integral, "leak": leak, "sensor_lowpass": lowpass}
    # The store is what may be put in before it is taken back: amplified, the wearer's own work passes through it.
    store = law.values["energy_store"] * (2.0 + proportional)
    changed = law.changed(**gains, sensor_drift=drift, feedback_limit=limit, energy_store=store)
    return replace(changed, sensed=True)


def with_emg(law: ElbowLaw, limb: Segment, *, share: float = 0.5, viscous: float = 0.1, slow: float = 0.5) -> ElbowLaw:
    """A transparent law whose inertia is led by EMG.

    Parameters
    ----------
    law : ElbowLaw
        From `transparent`.
    limb : Segment
        Of the wearer, from a tape and a scale.
    share : float
        Of the acceleration that is EMG's [1].
    viscous : float
        Of the wearer's joint [N m s/rad].
    slow : float
        Rate below which EMG's torque is an error [rad/s].

    Returns
    -------
    ElbowLaw
    """
    left = (1.0 - law.values["inertia_share"]) * law.values["inertia"]
    changed = law.changed(
        limb_inertia=limb.inertia + left, limb_gravity=limb.gravity(), limb_viscous=viscous, emg_slow=slow,
        emg_limit=law.values["acceleration_limit"], emg_share=share,
    )  # fmt: skip
    return replace(changed, emg=True)


def with_oscillator(law: ElbowLaw, *, share: float = 0.8, lead: float = 0.02, frequency: float = 4.0) -> ElbowLaw:
    """A transparent law whose inertia is led by an oscillator that learns periodic motions.

    Parameters
    ----------
    law : ElbowLaw
        From `transparent`.
    share : float
        Of the acceleration that is the oscillator's where the motion is periodic [1].
    lead : float
        How far ahead it looks [s].
    frequency : float
        Where it starts [rad/s]; it follows from a quarter to four times that.

    Returns
    -------
    ElbowLaw
    """
    return law.changed(
        oscillator_share=share, oscillator_lead=lead, frequency=frequency, frequency_min=0.25 * frequency,
        frequency_max=4.0 * frequency,
    )  # fmt: skip


def sensitivity_amplification(card: SliderCard, slider: float, *, amplification: float = 2.0, **settings) -> ElbowLaw:
    r"""The wearer's torque amplified: of the whole inverse model all but one part in :math:`\alpha`.

    .. math::
        \tau = G(q) + (1 - 1/\alpha)\,(J\hat{\ddot q} + f(\hat{\dot q}))

    H. Kazerooni, R. Steger, L. Huang, "Hybrid control of the Berkeley lower extremity exoskeleton (BLEEX)",
    International Journal of Robotics Research 25(5-6), 2006.

    Parameters
    ----------
    card : SliderCard
        "consistent" or "load".
    slider : float
        Where the carriage is [m].
    amplification : float
        alpha, >= 1.
    **settings
        As `transparent` takes them.

    Returns
    -------
    ElbowLaw

    Raises
    ------
    PellucidError
        If the amplification is below 1.
    """
    if not amplification >= 1.0:
        raise PellucidError(f"amplification: found {amplification}, expected 1 or more")
    share = 1.0 - 1.0 / amplification
    return transparent(card, slider, **{"friction_share": share, "inertia_share": share, **settings})


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


def _no_feedback() -> dict[str, float]:
    return {"proportional": 0.0, "integral": 0.0, "leak": 0.0, "sensor_lowpass": 100.0, "sensor_drift": 0.0,
            "feedback_limit": 0.0}  # fmt: skip


def _no_emg() -> dict[str, float]:
    return {"limb_inertia": 1.0, "limb_gravity": 0.0, "limb_viscous": 0.0, "emg_slow": 0.5, "emg_limit": 0.0,
            "emg_share": 0.0}  # fmt: skip


def _no_oscillator() -> dict[str, float]:
    return {
        **{"frequency": 4.0, "frequency_min": 1.0, "frequency_max": 16.0, "phase_rate": 8.0, "frequency_rate": 8.0},
        **{"amplitude_rate": 2.0, "least_amplitude": 0.02, "oscillator_share": 0.0, "oscillator_lead": 0.0},
    }
