r"""Compensation of one coherent body whose friction never drives, and what may be added to it.

`transparent` is the corrected form of full compensation: friction changes its sign smoothly, acceleration comes from a
Kalman filter, what drives passes an energy observer. With `friction_share` 0 it is the corrected partial compensation.
It takes a force sensor, EMG, an oscillator, a disturbance observer or dither, in any combination; `zero_impedance` and
`sensitivity_amplification` are the same chain with other shares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .._errors import PellucidError
from ..models.anthropometry import Segment
from ..models.fields import largest_friction
from ..models.joint import NAMES
from ..models.slider_joint import SliderCard, SliderJointModel
from .control_law import LAWS, RULES_LAW, TRANSPARENT_LAW, ControlLaw, Limits, gate_values
from .elbow_laws import ELBOW_LIMITS, PUBLISHED_PERIOD_S
from .joint_compensation import carried


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
    period: float = PUBLISHED_PERIOD_S,
) -> ControlLaw:
    """Compensation of one coherent body whose friction, by direction or by load, never drives.

    Of friction is compensated what exceeds the true one in one case of twenty at most, so that what is left resists.

    `slider` [m]; `velocity_width` [rad/s]; `friction_lead` [s]; `bandwidth` [rad/s]; `acceleration` [rad/s^2];
    `period` [s].
    """
    model = card.model()
    if not isinstance(model, SliderJointModel):
        raise PellucidError(
            f"model card '{card.family}': found one model for each direction, expected one model for both"
        )
    values = np.array([carried(p) for p in card.parameters])
    body = dict(zip(NAMES, model.vector(values, slider, velocity_width), strict=True))
    return of_body(
        body, fastest=2.0, limits=limits, period=period, friction_share=friction_share, inertia_share=inertia_share,
        friction_lead=friction_lead, bandwidth=bandwidth, acceleration_limit=acceleration,
    )  # fmt: skip


def of_body(
    body: Mapping[str, float], *, fastest: float, limits: Limits, period: float, **settings: float
) -> ControlLaw:
    """The law of a `body`, its numbers by the core's names, SI, with other numbers of the law as `settings`.

    `fastest`: to which the energy observer lets the robot's own inertia be sped up at once [rad/s]; `period` [s].
    """
    values = {
        **TRANSPARENT_LAW.defaults,
        **body,
        "gravity_share": 1.0,
        "innovation_gate": 20.0 * period,
        "max_rejections": 20.0,
        "energy_store": 0.5 * body["inertia"] * fastest**2,
        **settings,
        **gate_values(limits, period),
    }
    return ControlLaw(TRANSPARENT_LAW.name, {name: float(value) for name, value in values.items()})


def with_force_sensor(
    law: ControlLaw,
    *,
    proportional: float = 2.5,
    integral: float = 0.0,
    leak: float = 0.5,
    lowpass: float = 200.0,
    drift: float = 0.1,
    limit: float = 3.0,
) -> ControlLaw:
    """A transparent law that also drives the measured interaction torque to zero. `proportional`, `integral`, `leak`
    [1/s]; `lowpass` [rad/s]; `drift` [rad/s]; `limit` [N m]."""
    gains = {"proportional": proportional, "integral": integral, "leak": leak, "sensor_lowpass": lowpass}
    # The store is what may be put in before it is taken back: amplified, the wearer's own work passes through it.
    store = law.values["energy_store"] * (2.0 + proportional)
    changed = law.changed(**gains, sensor_drift=drift, feedback_limit=limit, energy_store=store)
    return changed.using("interaction")


MAX_FORCE_GAIN_ON_ANY_TRANSMISSION = 0.5
"""Largest gain on the measured interaction torque where the transmission is not known [1].

On 300 foreign plants (`evidence._exported`, seed 20261101) whose rotor and link resonate at 25 to 70 Hz, or are rigid,
none rang with it under any law with a force sensor; with 0.75 one did, with 1.0 four, with 1.5 six."""

MIN_STIFF_RESONANCE_HZ = 45.0
"""Lowest resonance of a transmission that bears a gain of 1.5.

With half as much again, 2.25, plants of the same 300 rang whose resonance was up to 42.1 Hz."""


MAX_EXPORTED_OBSERVER_SHARE = 1.0 / 3.0
"""Largest share of the disturbance observer in an export [1]; with it the loop has a gain of 0.5.

With a share of 0.5, a gain of 1, two of 60 foreign plants of 20261101 rang while their wearers carried 1.7 and 1.9 kg,
one of them with a rigid transmission; with 0.4 none did."""


def with_borne_force_gain(law: ControlLaw, resonance: float | None) -> ControlLaw:
    """Return a law whose gain on the interaction torque is not above what its robot's transmission bears.

    Parameters
    ----------
    law : ControlLaw
        A law of this file; one without such a gain stays as it is.
    resonance : float or None
        Lowest resonance of rotor and joint behind the transmission [Hz]; None where it is not known.

    Returns
    -------
    ControlLaw
        The law. Its gain is at most `MAX_FORCE_GAIN_ON_ANY_TRANSMISSION` unless the resonance is at least
        `MIN_STIFF_RESONANCE_HZ`: a rotor that swings against its joint answers late, and so does the force. The share
        of a disturbance observer is at most `MAX_EXPORTED_OBSERVER_SHARE` on every transmission.
    """
    share = law.values.get("disturbance_share", 0.0)
    if law.sensed and share > MAX_EXPORTED_OBSERVER_SHARE:
        store = law.values["energy_store"] * (1.0 + 1.0 / (1.0 - MAX_EXPORTED_OBSERVER_SHARE))
        law = law.changed(
            disturbance_share=MAX_EXPORTED_OBSERVER_SHARE, energy_store=store / (1.0 + 1.0 / (1.0 - share))
        )
    gain = law.values.get("proportional", 0.0) if law.sensed else 0.0
    if gain <= MAX_FORCE_GAIN_ON_ANY_TRANSMISSION or (resonance or 0.0) >= MIN_STIFF_RESONANCE_HZ:
        return law
    borne = MAX_FORCE_GAIN_ON_ANY_TRANSMISSION
    return law.changed(proportional=borne, energy_store=law.values["energy_store"] * (2.0 + borne) / (2.0 + gain))


def with_emg(
    law: ControlLaw, limb: Segment, *, share: float = 0.5, viscous: float = 0.1, slow: float = 0.5
) -> ControlLaw:
    """A transparent law whose inertia is led by EMG. `viscous` [N m s/rad]; `slow` [rad/s]."""
    left = (1.0 - law.values["inertia_share"]) * law.values["inertia"]
    changed = law.changed(
        limb_inertia=limb.inertia + left, limb_gravity=limb.gravity(), limb_viscous=viscous, emg_slow=slow,
        emg_limit=law.values["acceleration_limit"], emg_share=share,
    )  # fmt: skip
    return changed.using("muscle")


def with_oscillator(law: ControlLaw, *, share: float = 0.8, lead: float = 0.02, frequency: float = 4.0) -> ControlLaw:
    """A transparent law whose inertia is led by an oscillator that learns periodic motions. `lead` [s]; `frequency`
    [rad/s]."""
    return law.changed(
        oscillator_share=share, oscillator_lead=lead, frequency=frequency, frequency_min=0.25 * frequency,
        frequency_max=4.0 * frequency,
    )  # fmt: skip


def with_disturbance_observer(
    law: ControlLaw,
    *,
    share: float = 0.5,
    lowpass: float = 60.0,
    sensor_delay: float = 0.005,
    sensor_lowpass: float = 500.0,
    drift: float = 0.1,
    limit: float = 3.0,
) -> ControlLaw:
    r"""A transparent law that also feeds forward what resists the robot beyond its model, seen with a force sensor.

    .. math::
        \hat d = \mathrm{lowpass}\,[(u - G - f)(t - \delta) + \tau(t) - J\hat{\ddot q}(t)]

    with the sensor's delay and the lag of its filter in :math:`\delta`. Where the robot sticks, :math:`\hat d` is what
    the wearer pushes with, and a share of 1 would push harder for as long as it lasts: it is below 1.

    `lowpass` [rad/s]; `sensor_delay` [s]; `sensor_lowpass`, `drift` [rad/s]; `limit` [N m].
    """
    changed = law.changed(
        sensor_lowpass=sensor_lowpass, sensor_drift=drift, disturbance_share=share, disturbance_lowpass=lowpass,
        disturbance_delay=sensor_delay + 1.0 / sensor_lowpass, disturbance_limit=limit,
        energy_store=law.values["energy_store"] * (1.0 + 1.0 / (1.0 - share)),
    )  # fmt: skip
    return changed.using("interaction")


DITHER_TRAVEL = 5e-4
"""Longest travel of friction at which dither is offered: up to it the law with dither left less torque than the one
without on each of the ten robots of the choice, and gave no energy; over 1 mrad neither held [rad]."""


def known_travel(card: SliderCard) -> float:
    """The way over which the friction of a card builds up [rad]; refused where it was not measured, or where it may be
    longer than dither frees a robot from."""
    measured = card.presliding_travel
    if measured is None:
        raise PellucidError(
            f"model card '{card.family}': found no presliding_travel, expected one, because the amplitude of dither "
            'depends on it. Record slow reversals (protocol = "reversals") and identify again, or use the controller '
            "transparent"
        )
    if not max(measured.value, measured.interval[1]) <= DITHER_TRAVEL:
        low, high = (1e3 * x for x in measured.interval)
        raise PellucidError(
            f"model card '{card.family}': found a presliding_travel of {1e3 * measured.value:.2g} mrad ({low:.2g} to "
            f"{high:.2g}), expected at most {1e3 * DITHER_TRAVEL:g} for dither, which does not prevent sticking over "
            "a larger displacement. Use the controller transparent"
        )
    return max(measured.value, 0.0)


def with_dither(law: ControlLaw, *, share: float = 2.0, frequency: float = 1000.0) -> ControlLaw:
    r"""A transparent law whose motor trembles, so that the robot does not stick and its encoder sees a wearer push.

    Never stronger than the gate's limit of the torque's rate lets it be at that frequency. Friction that builds up over
    a travel :math:`x_s` turns about altogether only while the rotor swings by :math:`\pm x_s`, and this one swings by
    :math:`A / (J_m \omega^2)`, about 0.1 mrad. Slower it would swing further, and does leave less torque; but on some
    robots of the choice it then gave energy.

    `frequency` [rad/s].
    """
    period = law.values["period"]
    steepest = law.values["rate_limit"] * period / (2.0 * math.sin(0.5 * frequency * period))
    return law.changed(dither=min(share * breakaway(law), steepest), dither_frequency=frequency)


def with_rules(law: ControlLaw, rules: Mapping[str, float]) -> ControlLaw:
    """A transparent law that also carries what rules learnt beyond its body; `rules` are the core's numbers by name,
    SI, as `LearntRules.numbers` gives them."""
    return replace(law, kind=RULES_LAW.name, values={**RULES_LAW.defaults, **law.values, **rules})


def with_load(law: ControlLaw, load: Segment) -> ControlLaw:
    """Return a law that also carries a load which is fastened to the robot: its weight, inertia and friction.

    The supervisor's model of the robot contains the load, so that a load that falls off contradicts the force sensor.

    Parameters
    ----------
    law : ControlLaw
        A law of one coherent body.
    load : Segment
        The load about the joint's axis, as weighed or as `estimate_load` found it.

    Returns
    -------
    ControlLaw

    Raises
    ------
    PellucidError
        If the law does not carry one coherent body, or carries a load already.

    Examples
    --------
    >>> from pellucid.controllers.control_law import TRANSPARENT_LAW, ControlLaw
    >>> from pellucid.controllers.transparent_laws import with_load
    >>> from pellucid.models.anthropometry import point_mass
    >>> law = ControlLaw("transparent", TRANSPARENT_LAW.defaults | {"gravity_sine": 2.0, "inertia": 0.06})
    >>> round(with_load(law, point_mass(1.0, 0.3)).values["gravity_sine"], 3)
    4.942
    """
    _require_body(law, "a load")
    if law.load is not None:
        raise PellucidError(f"law {law.kind}: found a load already, expected none: add the load to the law without one")
    inertia = law.values["inertia"]
    made = law.changed(
        gravity_sine=law.values["gravity_sine"] + load.gravity(),
        inertia=inertia + load.inertia,
        energy_store=law.values["energy_store"] * ((inertia + load.inertia) / inertia if inertia > 0.0 else 1.0),
    )
    return replace(made, load=load)


def with_support(law: ControlLaw, limb: Segment, share: float = 1.0) -> ControlLaw:
    """Return a law that also carries a share of the weight of the wearer's limb, or of a load in the wearer's hand.

    The robot's drive carries it, and so its friction under load is that of both. Inertia is left to the wearer. Neither
    encoder nor force sensor tells whether what is supported is still there: a limb that moves freely presses on the
    strap with what the robot gives, whatever it weighs.

    Parameters
    ----------
    law : ControlLaw
        A law of one coherent body.
    limb : Segment
        The limb, or the load in the hand, about the joint's axis.
    share : float
        Share of its weight that is carried, 0 to 1.

    Returns
    -------
    ControlLaw

    Raises
    ------
    PellucidError
        If the law does not carry one coherent body, or the share is not within 0 and 1.

    Examples
    --------
    >>> from pellucid.controllers.control_law import TRANSPARENT_LAW, ControlLaw
    >>> from pellucid.controllers.transparent_laws import with_support
    >>> from pellucid.models.anthropometry import forearm
    >>> law = ControlLaw("transparent", TRANSPARENT_LAW.defaults | {"gravity_sine": 2.0})
    >>> round(with_support(law, forearm(70.0, 1.75), 0.3).supported, 2)
    0.79
    """
    _require_body(law, "support")
    if not 0.0 <= share <= 1.0:
        raise PellucidError(f"support: found a share of {share:g}, expected 0 to 1")
    given = share * limb.gravity()
    made = law.changed(gravity_sine=law.values["gravity_sine"] + given)
    return replace(made, supported=law.supported + given)


def expecting_load(law: ControlLaw, load: Segment) -> ControlLaw:
    """Return a law whose robot may carry up to a `load` that is not known yet, as for its first lift.

    The law carries nothing of it. Its supervisor allows as much contradiction between force sensor and model, so that
    a force sensor that lies by as much is not found: state the load with `with_load` as soon as it is known.

    Examples
    --------
    >>> from pellucid.controllers.control_law import TRANSPARENT_LAW, ControlLaw
    >>> from pellucid.controllers.transparent_laws import expecting_load
    >>> from pellucid.models.anthropometry import point_mass
    >>> law = ControlLaw("transparent", TRANSPARENT_LAW.defaults | {"gravity_sine": 2.0})
    >>> round(expecting_load(law, point_mass(1.0, 0.3)).unstated, 3)
    2.942
    """
    return replace(law, unstated=load.gravity())


def _require_body(law: ControlLaw, what: str) -> None:
    if not LAWS[law.kind].carries_body or law.values.get("gravity_share") == 0.0:
        raise PellucidError(f"law {law.kind}: found a law without gravity compensation, expected one for {what}")


def breakaway(law: ControlLaw) -> float:
    """Torque that it takes to move the robot of a transparent law from rest, where gravity loads it most [N m]."""
    weight = math.hypot(law.values["gravity_sine"], law.values["gravity_cosine"])
    return float(largest_friction(LAWS[law.kind].fields, law.values, 0.0, weight))


def zero_impedance(card: SliderCard, slider: float, *, proportional: float = 1.5, **settings) -> ControlLaw:
    """The measured interaction torque driven to zero, and nothing else: the robot's weight is the loop's to carry.

    Where a robot has a series spring, zero-impedance mode drives the spring's torque to zero and leaves its wearer with
    what lies behind it. This one has none: its torque loop closes on the force sensor, and what lies behind that is the
    splint alone.

    `slider` [m].
    """
    bare = transparent(card, slider, **{"friction_share": 0.0, "inertia_share": 0.0, **settings})
    return with_force_sensor(bare.changed(gravity_share=0.0), proportional=proportional)


def sensitivity_amplification(card: SliderCard, slider: float, *, amplification: float = 2.0, **settings) -> ControlLaw:
    r"""The wearer's torque amplified: of the whole inverse model all but one part in :math:`\alpha`.

    .. math::
        \tau = G(q) + (1 - 1/\alpha)\,(J\hat{\ddot q} + f(\hat{\dot q}))

    H. Kazerooni, R. Steger, L. Huang, "Hybrid control of the Berkeley lower extremity exoskeleton (BLEEX)",
    International Journal of Robotics Research 25(5-6), 2006.

    `slider` [m].
    """
    if not amplification >= 1.0:
        raise PellucidError(f"amplification: found {amplification}, expected 1 or more")
    share = 1.0 - 1.0 / amplification
    return transparent(card, slider, **{"friction_share": share, "inertia_share": share, **settings})
