"""Controllers compared on the virtual orthosis, built from a wearer's card and from chosen constants.

The constants are in ``pellucid_lab/knee/chosen.toml``, as `tuning` chose them on simulated wearers; there is no other
free constant.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.residual_compensator import (
    ResidualDesign,
    weakenings,
)
from pellucid.controllers.stability import bears

from ...knee.chosen_constants import (
    MARGIN_SPEEDS_RAD_S,
    REQUIRED_DELAY_MARGIN_S,
    REQUIRED_GAIN_MARGIN_DB,
    ChosenConstants,
    design_reproduced_law,
    uncertain_straps,
)
from ...knee.identified_wearer import WearerCard
from ...knee.loop_margins import Margins, margins, worst, worst_margins
from ...knee.trial import Controller
from ...knee.worn_compensator import WornCompensator
from .body_laws import BodyLaw, amplification_law, body_law, law_with_oscillator, law_with_rules, learn_orthosis_rules
from .fuzzy import FuzzyCompensation
from .pid_tuning import tune_pid
from .rbf import RbfCompensation
from .strap_disturbance import StrapDisturbance

CONTROLLER_WORDS: Mapping[str, str] = {
    "zero_impedance": "zero impedance",
    "no_control": "no control",
    "residual": "residual compensator",
    "residual_no_emg": "the same without EMG",
    "residual_strap_learnt": "the same, strap learnt online",
    "residual_by_phase": "the same, gain by phase",
    "pid": "PID",
    "disturbance_observer": "disturbance observer",
    "fuzzy": "fuzzy",
    "rbf": "neural (RBF)",
}
"""Words for the controllers that a reproduction compares, by their name in ids."""

BODY_LAW_WORDS: Mapping[str, str] = {
    "body": "body by model",
    "oscillator": "body, led by an adaptive oscillator",
    "body_fuzzy": "body, and fuzzy rules learnt beyond it",
    "body_neural": "body, and a network learnt beyond it",
    "amplification": "sensitivity amplification",
}
"""Words for the controllers that carry the orthosis's body from its encoder alone (`body_laws`), by their name in ids.

`ranking` compares them too.
"""


@dataclass(frozen=True)
class BuiltController:
    """A controller for one wearer."""

    build: Callable[[], Controller | None]  # Makes a fresh controller; it returns None for zero-impedance mode
    # Gives the smallest margins over the plants that it was built for; None if the controller has no linear form
    margins: Callable[[], Margins] | None = None


def design_by_phase(
    made: ResidualDesign,
    gains: Sequence[float],
    swing: tuple[float, float],
    plants: Sequence[Coupling] | None = None,
) -> ResidualDesign:
    """Return a design with `gains` [1] over a swing, limited so that the largest one alone keeps the margins.

    `swing` has the swing's centre [rad] and its angular frequency [rad/s]. The margins hold on `plants`, or on
    `uncertain_straps`.
    """
    plants = uncertain_straps(made.coupling) if plants is None else plants
    for most in (1.25, 1.2, 1.15, 1.1, 1.05, 1.0):
        lowered = tuple(min(float(gain), most) for gain in gains)
        largest = replace(made, law=replace(made.law, phase_gain=(max(lowered),) * 8))
        if all(
            bears(
                plant,
                largest.linear(speed, trust),
                made.period,
                gain_db=REQUIRED_GAIN_MARGIN_DB,
                delay=REQUIRED_DELAY_MARGIN_S,
                speed=speed,
            )
            for plant in plants
            for speed in MARGIN_SPEEDS_RAD_S
            for trust in (0.0, 1.0)
        ):
            break
    return replace(made, swing=swing, law=replace(made.law, phase_gain=lowered))


def disturbance_observer(
    coupling: Coupling, period: float, constants: ChosenConstants, plants: Sequence[Coupling]
) -> StrapDisturbance:
    """Return the disturbance observer, its gain and friction lowered until it has the required margins on `plants`;
    `period` [s]."""
    wanted = StrapDisturbance(coupling, period, **constants.observer)
    cases = [(plant, speed) for speed in MARGIN_SPEEDS_RAD_S[::-1] for plant in plants]
    for rubbed, pulled in weakenings():
        weaker = replace(wanted, gain=pulled * wanted.gain, friction=rubbed * wanted.friction)
        borne = (
            bears(
                plant,
                weaker.linear(speed),
                period,
                gain_db=REQUIRED_GAIN_MARGIN_DB,
                delay=REQUIRED_DELAY_MARGIN_S,
                speed=speed,
            )
            for plant, speed in cases
        )
        failing = next((i for i, holds in enumerate(borne) if not holds), None)
        if failing is None:
            break
        cases.insert(0, cases.pop(failing))
    return weaker
    return weaker


def observer_margins(observer: StrapDisturbance, plants: Sequence[Coupling]) -> Margins:
    """Return an observer's smallest margins over `plants` and `MARGIN_SPEEDS_RAD_S`."""
    return worst(
        [
            margins(plant, observer.linear(speed), observer.period, speed=speed)
            for plant in plants
            for speed in MARGIN_SPEEDS_RAD_S
        ]
    )


def body_controllers(
    card: WearerCard, period: float, constants: ChosenConstants, only: Sequence[str] = tuple(BODY_LAW_WORDS)
) -> dict[str, BuiltController]:
    """Build the controllers of `BODY_LAW_WORDS` that `only` names; `period` [s]."""
    m, body = card.coupling, constants.body
    laws: dict[str, ControlLaw] = {}
    if "body" in only:
        laws["body"] = body_law(m, period, **body)
    if "oscillator" in only:
        laws["oscillator"] = law_with_oscillator(m, period, **{**body, **constants.oscillator})
    for name, kind in (("body_fuzzy", "fuzzy"), ("body_neural", "network")):
        if name in only:
            laws[name] = law_with_rules(
                m, period, learn_orthosis_rules(kind, m, period, card.alone, body), body, **constants.rules
            )
    if "amplification" in only:
        laws["amplification"] = amplification_law(m, period, **constants.amplification)
    return {name: BuiltController(partial(BodyLaw, law)) for name, law in laws.items()}


def controllers(
    card: WearerCard,
    period: float,
    swing: tuple[float, float],
    constants: ChosenConstants,
    only: Sequence[str] = tuple(CONTROLLER_WORDS),
    *,
    residual: ResidualDesign | None = None,
    plants: Sequence[Coupling] | None = None,
) -> dict[str, BuiltController]:
    """Build the controllers that `only` names for one wearer.

    `period` [s]; `swing` has the swing's centre [rad] and its angular frequency [rad/s]. Left out, `residual` is the
    reproduction's design, and `plants`, with which the other linear loops keep their margins, are `uncertain_straps`.
    """
    coupling, plants = card.coupling, uncertain_straps(card.coupling) if plants is None else plants
    found = body_controllers(card, period, constants, only)
    if not set(only) - {*BODY_LAW_WORDS, "zero_impedance"}:
        return {"zero_impedance": BuiltController(lambda: None), **found} if "zero_impedance" in only else found
    made = design_reproduced_law(coupling, period, constants) if residual is None else residual
    found = {"zero_impedance": BuiltController(lambda: None), **found}

    def linear(one: ResidualDesign) -> Callable[[], Margins]:
        return cache(lambda: worst_margins(one, plants, MARGIN_SPEEDS_RAD_S))

    own = linear(made)
    found["residual"] = BuiltController(lambda: WornCompensator(made, card.emg.build()), own)
    found["residual_no_emg"] = BuiltController(lambda: WornCompensator(made), own)
    found["residual_strap_learnt"] = BuiltController(
        lambda: WornCompensator(made, card.emg.build(), constants.learning), own
    )
    if "residual_by_phase" in only:
        phased = design_by_phase(made, constants.phase_gain, swing, plants)
        largest = replace(phased, law=replace(phased.law, phase_gain=(max(phased.law.phase_gain),) * 8))
        found["residual_by_phase"] = BuiltController(lambda: WornCompensator(phased, card.emg.build()), linear(largest))
    if "pid" in only:
        pid = tune_pid(made, plants, gain_db=REQUIRED_GAIN_MARGIN_DB, delay=REQUIRED_DELAY_MARGIN_S)
        found["pid"] = BuiltController(lambda: WornCompensator(pid, card.emg.build()), linear(pid))
    if "disturbance_observer" in only:
        observer = disturbance_observer(coupling, period, constants, plants)
        found["disturbance_observer"] = BuiltController(
            lambda: replace(observer), lambda: observer_margins(observer, plants)
        )
    found["fuzzy"] = BuiltController(lambda: FuzzyCompensation(coupling, period, **constants.fuzzy))
    found["rbf"] = BuiltController(lambda: RbfCompensation(coupling, period, **constants.rbf))
    return {name: built for name, built in found.items() if name in only}
