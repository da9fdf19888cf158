"""Laws that carry the orthosis's own body by a model, from the encoder alone: what reviews call model-based control.

The law is the elbow's (`control.transparent_laws`) with the identified orthosis, and the share of motor and gear that
its torque loop lets through. Three variants are known under names of their own: an adaptive oscillator leads the
acceleration; learnt rules add torque beyond the model; sensitivity amplification carries the whole inverse model but
for one part in alpha.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pellucid.controllers.control_law import ControlLaw, Limits
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.transparent_laws import of_body, with_oscillator, with_rules
from pellucid.numerics.filters import zero_phase_lowpass

from ...learnt_rules import LearntRules, RecordedResidual, RuleKind, learn_rules

RULE_LOWPASS_HZ = 8.0
"""Angles and commands pass this zero-phase low-pass before rules are learnt from them."""

OSCILLATOR_START_RAD_S = 5.0
"""Frequency at which the adaptive oscillator starts."""

RULE_SAMPLE_STEP = 10
"""Rules are learnt from every tenth sample."""


class BodyLaw:
    """A law of the core that reads the encoder alone, called as the orthosis calls its controllers."""

    def __init__(self, law: ControlLaw):
        self.law = law
        self._running = law.start()

    @property
    def fault(self) -> str:
        """Fault that the law's safety gate has latched; "none" if there is none."""
        return self._running.fault

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """Return the command [N m] of one control period. `time` [s], `position` [rad], `torque` [N m]."""
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
    """Return the law that carries shares of gravity, friction and inertia of the orthosis and its actuator.

    `period` [s]; `gravity`, `friction`, `inertia` are shares [1]; `width`, `bandwidth` [rad/s].
    """
    m = coupling
    body = {
        "inertia": m.orthosis_inertia + m.actuator_inertia,
        "gravity_sine": m.orthosis_gravity,
        "coulomb_positive": m.coulomb + m.actuator_coulomb,
        "coulomb_negative": m.coulomb + m.actuator_coulomb,
        "viscous_positive": m.orthosis_viscous + m.actuator_viscous,
        "viscous_negative": m.orthosis_viscous + m.actuator_viscous,
        "velocity_width": width,
    }
    return of_body(
        body, fastest=4.0, limits=limits or Limits(), period=period, gravity_share=gravity, friction_share=friction,
        inertia_share=inertia, bandwidth=bandwidth, acceleration_limit=60.0,
    )  # fmt: skip


def amplification_law(coupling: Coupling, period: float, *, alpha: float, **settings: float) -> ControlLaw:
    """Return sensitivity amplification, which carries the inverse model but for one part in `alpha`. `period` [s]."""
    share = 1.0 - 1.0 / alpha
    return body_law(coupling, period, gravity=1.0, friction=share, inertia=share, **settings)


def law_with_oscillator(
    coupling: Coupling, period: float, *, share: float, lead: float, **settings: float
) -> ControlLaw:
    """Return the body's law, its acceleration led by an oscillator that learns the swing. `period`, `lead` [s]."""
    return with_oscillator(
        body_law(coupling, period, **settings), share=share, lead=lead, frequency=OSCILLATOR_START_RAD_S
    )


def residuals_beyond_law(
    law: ControlLaw, swings: Sequence[tuple[np.ndarray, np.ndarray]], fs: float
) -> list[RecordedResidual]:
    """Return the command of the empty orthosis beyond a law's terms, in swings of angle [rad] and command [N m].

    Each swing has arrays of shape (n,) at a rate `fs` [Hz]. The inertia is subtracted whole, because rules of angle and
    speed contain no acceleration.
    """
    v, made = law.values, []
    for position, command in swings:
        q, u = (zero_phase_lowpass(x, RULE_LOWPASS_HZ, 2, fs) for x in (position, command))
        speed = np.gradient(q) * fs
        sign = np.tanh(speed / v["velocity_width"])
        modelled = v["gravity_share"] * v["gravity_sine"] * np.sin(q) + v["inertia"] * np.gradient(speed) * fs
        modelled += v["friction_share"] * (v["coulomb_positive"] * sign + v["viscous_positive"] * speed)
        inside = slice(round(fs), -round(fs), RULE_SAMPLE_STEP)
        made.append(RecordedResidual(q[inside], speed[inside], (u - modelled)[inside]))
    return made


def learn_orthosis_rules(
    kind: RuleKind,
    coupling: Coupling,
    period: float,
    swings: Sequence[tuple[np.ndarray, np.ndarray]],
    body: Mapping[str, float],
) -> LearntRules:
    """Learn rules of one kind from an empty orthosis's swings, beyond the law with the settings of `body`. `period`
    [s]."""
    return learn_rules(residuals_beyond_law(body_law(coupling, period, **body), swings, 1.0 / period), kind)


def law_with_rules(
    coupling: Coupling, period: float, rules: LearntRules, body: Mapping[str, float], *, share: float
) -> ControlLaw:
    """Return the body's law with a `share` of the torque that learnt rules add. `period` [s]."""
    return with_rules(body_law(coupling, period, **body), rules.numbers(share))
