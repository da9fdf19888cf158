"""The orthosis's own body carried by model, from the encoder alone: what reviews call model-based control.

The law is the elbow's (`control.transparent_laws`) on the orthosis as it was identified, with what its torque loop lets
through of motor and gear. Led by an adaptive oscillator, with rules learnt beyond the model, or as sensitivity
amplification, which carries all but one part in alpha of the inverse model, it is each of the strategies so called.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...control.control_law import ControlLaw
from ...control.coupling import Coupling
from ...control.limits import Limits
from ...control.transparent_laws import of_body, with_oscillator, with_rules
from ...estimators.learnt_rules import LearntRules, RecordedResidual, RuleKind, learn_rules
from ...signals.filters import zero_phase_lowpass

LOWPASS = 8.0
"""Of angles and torques that rules are learnt from [Hz]."""

SWING_FREQUENCY = 5.0
"""Where the oscillator starts [rad/s]."""

EVERY = 10
"""Of these samples one is kept to learn from."""


class BodyLaw:
    """A law of the core that reads the encoder alone, called as the orthosis calls its controllers."""

    def __init__(self, law: ControlLaw):
        self._running = law.start()

    @property
    def fault(self) -> str:
        """As of its gate."""
        return self._running.fault

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """One control period. `time`, `position`, `torque` [s], [rad], [N m]; gives [N m]."""
        return self._running.step(time, position)


def body_law(
    coupling: Coupling,
    period: float,
    *,
    gravity: float = 1.0,
    friction: float = 0.6,
    inertia: float = 0.3,
    width: float = 0.3,
    bandwidth: float = 60.0,
    limits: Limits | None = None,
) -> ControlLaw:
    """Gravity, friction and inertia of the orthosis and of what its actuator lets through, in shares. `period` [s];
    `width`, `bandwidth` [rad/s]."""
    m = coupling
    own = {
        "inertia": m.orthosis_inertia + m.actuator_inertia,
        "gravity_sine": m.orthosis_gravity,
        "coulomb_positive": m.coulomb + m.actuator_coulomb,
        "coulomb_negative": m.coulomb + m.actuator_coulomb,
        "viscous_positive": m.orthosis_viscous + m.actuator_viscous,
        "viscous_negative": m.orthosis_viscous + m.actuator_viscous,
        "velocity_width": width,
    }
    return of_body(
        own, fastest=4.0, limits=limits or Limits(), period=period, gravity_share=gravity, friction_share=friction,
        inertia_share=inertia, bandwidth=bandwidth, acceleration_limit=60.0,
    )  # fmt: skip


def amplification(coupling: Coupling, period: float, *, alpha: float, **settings: float) -> ControlLaw:
    """Of the whole inverse model all but one part in `alpha`. `period` [s]."""
    share = 1.0 - 1.0 / alpha
    return body_law(coupling, period, gravity=1.0, friction=share, inertia=share, **settings)


def oscillating(coupling: Coupling, period: float, *, share: float, lead: float, **settings: float) -> ControlLaw:
    """The body, its acceleration led by an oscillator that learns the swing. `period`, `lead` [s]."""
    return with_oscillator(body_law(coupling, period, **settings), share=share, lead=lead, frequency=SWING_FREQUENCY)


def left_alone(law: ControlLaw, swings: Sequence[tuple[np.ndarray, np.ndarray]], fs: float) -> list[RecordedResidual]:
    """What the orthosis alone asked for beyond a law's own terms, in swings of angle [rad] and command [N m], shape
    (n,) each, at a rate [Hz]; the inertia whole, since of angle and speed rules can know no acceleration."""
    v, made = law.values, []
    for position, command in swings:
        q, u = (zero_phase_lowpass(x, LOWPASS, 2, fs) for x in (position, command))
        speed = np.gradient(q) * fs
        sign = np.tanh(speed / v["velocity_width"])
        own = v["gravity_share"] * v["gravity_sine"] * np.sin(q) + v["inertia"] * np.gradient(speed) * fs
        own += v["friction_share"] * (v["coulomb_positive"] * sign + v["viscous_positive"] * speed)
        inside = slice(round(fs), -round(fs), EVERY)
        made.append(RecordedResidual(q[inside], speed[inside], (u - own)[inside]))
    return made


def rules_of(
    kind: RuleKind,
    coupling: Coupling,
    period: float,
    swings: Sequence[tuple[np.ndarray, np.ndarray]],
    body: Mapping[str, float],
) -> LearntRules:
    """Rules of a kind for an orthosis, from its swings alone, beyond the law with the settings of `body`. `period`
    [s]."""
    return learn_rules(left_alone(body_law(coupling, period, **body), swings, 1.0 / period), kind)


def learnt(
    coupling: Coupling, period: float, rules: LearntRules, body: Mapping[str, float], *, share: float
) -> ControlLaw:
    """The body, and a share of what rules say beyond it. `period` [s]."""
    return with_rules(body_law(coupling, period, **body), rules.numbers(share))
