"""Every controller that is compared on the virtual orthosis, built from a wearer's card and from chosen constants.

The constants stand in ``chosen.toml``, as `tuning` chose them on drawn wearers; none else is free.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from importlib.resources import files

from ...control.control_law import ControlLaw
from ...control.coupling import Coupling
from ...control.residual_compensator import (
    Law,
    Noise,
    ResidualDesign,
    design,
    weakenings,
    within,
    worst,
    worst_margins,
)
from ...control.stability import Margins, bears, margins
from ...control.worn import StrapLearning, WornCompensator
from ...estimators.causal_map import EmgSettings
from ...lab.knee.trial import Controller
from .body_laws import BodyLaw, amplification, body_law, learnt, oscillating, rules_of
from .cards import WearerCard
from .fuzzy import FuzzyCompensation
from .pid_tuning import tune_pid
from .rbf import RbfCompensation
from .strap_disturbance import StrapDisturbance

SPEEDS = (0.1, 0.5, 1.5, 4.0)
"""At which friction is linearised for the margins [rad/s]."""

GAIN_DB, DELAY = 6.0, 0.020
"""Margins that are asked of every controller [dB], [s]."""

NAMES: Mapping[str, str] = {
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
"""Controllers that a reproduction compares, by their place in ids."""

BODY_NAMES: Mapping[str, str] = {
    "body": "body by model",
    "oscillator": "body, led by an adaptive oscillator",
    "body_fuzzy": "body, and fuzzy rules learnt beyond it",
    "body_neural": "body, and a network learnt beyond it",
    "amplification": "sensitivity amplification",
}
"""Those that carry the orthosis's body from its encoder alone (`body_laws`); `ranking` compares them too."""


@dataclass(frozen=True)
class Chosen:
    """All free constants."""

    law: Law = field(default_factory=Law)  # Of the residual compensator
    noise: Noise = field(default_factory=Noise)  # Of its observer
    # ``width`` and ``assist_width`` of friction [rad/s]
    widths: Mapping[str, float] = field(default_factory=lambda: {"width": 0.05, "assist_width": 0.6})
    emg: EmgSettings = field(default_factory=EmgSettings)
    phase_gain: tuple[float, ...] = (1.0,) * 8  # Over a swing, learnt on other wearers [1]
    learning: StrapLearning = field(default_factory=StrapLearning)
    # observer, fuzzy, rbf: Of the disturbance observer, the fuzzy rules and the radial basis functions, by their
    # classes' names.
    observer: Mapping[str, float] = field(default_factory=dict)
    fuzzy: Mapping[str, float] = field(default_factory=dict)
    rbf: Mapping[str, float] = field(default_factory=dict)
    # body, oscillator, rules, amplification: Of `body_laws`; what is not said of the last three is the body's
    body: Mapping[str, float] = field(default_factory=dict)
    oscillator: Mapping[str, float] = field(default_factory=dict)
    rules: Mapping[str, float] = field(default_factory=dict)
    amplification: Mapping[str, float] = field(default_factory=dict)

    def tables(self) -> dict[str, dict]:
        """By table, as they stand in the file."""
        made = {name: dict(value) if isinstance(value, Mapping) else value for name, value in vars(self).items()}
        for name in ("law", "noise", "emg", "learning"):
            made[name] = asdict(made[name])
        law = made["law"]
        del law["phase_gain"], law["preview"]  # its own, and the actuator's
        return {**made, "phase_gain": {"gains": list(self.phase_gain)}}


@cache
def chosen() -> Chosen:
    """The constants of ``chosen.toml``."""
    return parse_chosen((files(__package__) / "chosen.toml").read_text(encoding="utf-8"))


def parse_chosen(text: str) -> Chosen:
    """Constants from TOML, table by table as `Chosen.tables` has them."""
    t = tomllib.loads(text)
    pairs = {n: tuple(v) if isinstance(v, list) else v for n, v in t["learning"].items()}
    return Chosen(
        Law(**t["law"]), Noise(**t["noise"]), t["widths"], EmgSettings(**t["emg"]), tuple(t["phase_gain"]["gains"]),
        StrapLearning(**pairs), t["observer"], t["fuzzy"], t["rbf"], t["body"], t["oscillator"], t["rules"],
        t["amplification"],
    )  # fmt: skip


@dataclass(frozen=True)
class Built:
    """A controller for one wearer."""

    build: Callable[[], Controller | None]  # Makes a fresh one; None stands for zero-impedance mode
    # Its margins on every strap of `uncertain_straps`; None where it has no linear form
    margins: Callable[[], Margins] | None = None


def uncertain_straps(coupling: Coupling) -> list[Coupling]:
    """The coupling, and with stiffness and damping of the strap 30 % off in each combination."""
    return [coupling] + [coupling.scaled(strap_stiffness=k, strap_damping=b) for k in (0.7, 1.3) for b in (0.7, 1.3)]


def for_wearer(coupling: Coupling, period: float, constants: Chosen, law: Law | None = None) -> ResidualDesign:
    """The chosen law on one wearer's card, weakened until the margins are there; period [s]."""
    made = design(coupling, period, law=law or constants.law, noise=constants.noise, **constants.widths)
    return within(made, uncertain_straps(coupling), gain_db=GAIN_DB, delay=DELAY, speeds=SPEEDS)


def by_phase(made: ResidualDesign, gains: Sequence[float], swing: tuple[float, float]) -> ResidualDesign:
    """Gains over a swing, the large ones lowered until their largest, all through the swing, leaves the margins.

    gains [1], swing [rad], [rad/s].
    """
    for most in (1.25, 1.2, 1.15, 1.1, 1.05, 1.0):
        lowered = tuple(min(float(gain), most) for gain in gains)
        largest = replace(made, law=replace(made.law, phase_gain=(max(lowered),) * 8))
        if all(
            bears(plant, largest.linear(speed, trust), made.period, gain_db=GAIN_DB, delay=DELAY, speed=speed)
            for plant in uncertain_straps(made.coupling)
            for speed in SPEEDS
            for trust in (0.0, 1.0)
        ):
            break
    return replace(made, swing=swing, law=replace(made.law, phase_gain=lowered))


def disturbance_observer(coupling: Coupling, period: float, constants: Chosen) -> StrapDisturbance:
    """The disturbance observer, its gain and its friction lowered until the margins are there; period [s]."""
    wanted = StrapDisturbance(coupling, period, **constants.observer)
    cases = [(plant, speed) for speed in SPEEDS[::-1] for plant in uncertain_straps(coupling)]
    for rubbed, pulled in weakenings():
        weaker = replace(wanted, gain=pulled * wanted.gain, friction=rubbed * wanted.friction)
        borne = (
            bears(plant, weaker.linear(speed), period, gain_db=GAIN_DB, delay=DELAY, speed=speed)
            for plant, speed in cases
        )
        failing = next((i for i, holds in enumerate(borne) if not holds), None)
        if failing is None:
            break
        cases.insert(0, cases.pop(failing))
    return weaker
    return weaker


def observer_margins(observer: StrapDisturbance) -> Margins:
    """Its smallest margins on the straps of `uncertain_straps`, over the speeds of friction."""
    return worst(
        [
            margins(plant, observer.linear(speed), observer.period, speed=speed)
            for plant in uncertain_straps(observer.coupling)
            for speed in SPEEDS
        ]
    )


def body_controllers(
    card: WearerCard, period: float, constants: Chosen, only: Sequence[str] = tuple(BODY_NAMES)
) -> dict[str, Built]:
    """Those of `BODY_NAMES` that are asked for; period [s]."""
    m, body = card.coupling, constants.body
    laws: dict[str, ControlLaw] = {}
    if "body" in only:
        laws["body"] = body_law(m, period, **body)
    if "oscillator" in only:
        laws["oscillator"] = oscillating(m, period, **{**body, **constants.oscillator})
    for name, kind in (("body_fuzzy", "fuzzy"), ("body_neural", "network")):
        if name in only:
            laws[name] = learnt(m, period, rules_of(kind, m, period, card.alone, body), body, **constants.rules)
    if "amplification" in only:
        laws["amplification"] = amplification(m, period, **constants.amplification)
    return {name: Built(partial(BodyLaw, law)) for name, law in laws.items()}


def controllers(
    card: WearerCard, period: float, swing: tuple[float, float], constants: Chosen, only: Sequence[str] = tuple(NAMES)
) -> dict[str, Built]:
    """What is compared, on one wearer; period [s], swing [rad], [rad/s]."""
    coupling, plants = card.coupling, uncertain_straps(card.coupling)
    found = body_controllers(card, period, constants, only)
    if not set(only) - {*BODY_NAMES, "zero_impedance"}:
        return {"zero_impedance": Built(lambda: None), **found} if "zero_impedance" in only else found
    made = for_wearer(coupling, period, constants)
    found = {"zero_impedance": Built(lambda: None), **found}

    def linear(one: ResidualDesign) -> Callable[[], Margins]:
        return cache(lambda: worst_margins(one, plants, SPEEDS))

    own = linear(made)
    found["residual"] = Built(lambda: WornCompensator(made, card.emg.build()), own)
    found["residual_no_emg"] = Built(lambda: WornCompensator(made), own)
    found["residual_strap_learnt"] = Built(lambda: WornCompensator(made, card.emg.build(), constants.learning), own)
    if "residual_by_phase" in only:
        phased = by_phase(made, constants.phase_gain, swing)
        largest = replace(phased, law=replace(phased.law, phase_gain=(max(phased.law.phase_gain),) * 8))
        found["residual_by_phase"] = Built(lambda: WornCompensator(phased, card.emg.build()), linear(largest))
    if "pid" in only:
        pid = tune_pid(made, plants, gain_db=GAIN_DB, delay=DELAY)
        found["pid"] = Built(lambda: WornCompensator(pid, card.emg.build()), linear(pid))
    if "disturbance_observer" in only:
        observer = disturbance_observer(coupling, period, constants)
        found["disturbance_observer"] = Built(lambda: replace(observer), lambda: observer_margins(observer))
    found["fuzzy"] = Built(lambda: FuzzyCompensation(coupling, period, **constants.fuzzy))
    found["rbf"] = Built(lambda: RbfCompensation(coupling, period, **constants.rbf))
    return {name: built for name, built in found.items() if name in only}
