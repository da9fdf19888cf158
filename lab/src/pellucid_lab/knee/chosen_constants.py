"""Constants of the knee orthosis's controllers, chosen on simulated wearers, and the residual compensator.

The constants are in ``chosen.toml``, as `papers.knee.tuning` chose them on simulated wearers; there is no other free
constant. No export uses them: exports contain `controllers.worn.design_worn_law`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path

from pellucid.controllers.coupling import Coupling
from pellucid.controllers.residual_compensator import Law, Noise, ResidualDesign, design, within
from pellucid.emg.estimators.causal_map import EmgSettings

from .worn_compensator import StrapLearning

CONSTANTS_FILE = Path(__file__).with_name("chosen.toml")
"""File of the constants."""

MARGIN_SPEEDS_RAD_S = (0.1, 0.5, 1.5, 4.0)
"""Speeds at which friction is linearised for the stability margins."""

REQUIRED_GAIN_MARGIN_DB = 6.0
"""Gain margin that every controller must have."""

REQUIRED_DELAY_MARGIN_S = 0.020
"""Delay margin that every controller must have."""


@dataclass(frozen=True)
class ChosenConstants:
    """All free constants."""

    law: Law = field(default_factory=Law)  # Constants of the residual compensator
    noise: Noise = field(default_factory=Noise)  # Noise that its observer assumes
    # ``width`` and ``assist_width`` of friction's smooth sign [rad/s]
    widths: Mapping[str, float] = field(default_factory=lambda: {"width": 0.05, "assist_width": 0.6})
    emg: EmgSettings = field(default_factory=EmgSettings)
    phase_gain: tuple[float, ...] = (1.0,) * 8  # Gain in each eighth of a swing, learnt on other wearers [1]
    learning: StrapLearning = field(default_factory=StrapLearning)
    observer: Mapping[str, float] = field(default_factory=dict)  # Fields of `StrapDisturbance`
    fuzzy: Mapping[str, float] = field(default_factory=dict)  # Fields of `FuzzyCompensation`
    rbf: Mapping[str, float] = field(default_factory=dict)  # Fields of `RbfCompensation`
    # Arguments of the laws in `body_laws`. The other three take the body's where they have none of their own.
    body: Mapping[str, float] = field(default_factory=dict)
    oscillator: Mapping[str, float] = field(default_factory=dict)
    rules: Mapping[str, float] = field(default_factory=dict)
    amplification: Mapping[str, float] = field(default_factory=dict)

    def tables(self) -> dict[str, dict]:
        """Return the constants by table, as the file has them."""
        made = {name: dict(value) if isinstance(value, Mapping) else value for name, value in vars(self).items()}
        for name in ("law", "noise", "emg", "learning"):
            made[name] = asdict(made[name])
        law = made["law"]
        del law["phase_gain"], law["preview"]  # the first has a table of its own, the second is the actuator's
        return {**made, "phase_gain": {"gains": list(self.phase_gain)}}


@cache
def chosen() -> ChosenConstants:
    """Return the constants of ``chosen.toml``."""
    return parse_chosen(CONSTANTS_FILE.read_text(encoding="utf-8"))


def parse_chosen(text: str) -> ChosenConstants:
    """Return constants from TOML, table by table as `ChosenConstants.tables` has them."""
    t = tomllib.loads(text)
    pairs = {n: tuple(v) if isinstance(v, list) else v for n, v in t["learning"].items()}
    return ChosenConstants(
        Law(**t["law"]), Noise(**t["noise"]), t["widths"], EmgSettings(**t["emg"]), tuple(t["phase_gain"]["gains"]),
        StrapLearning(**pairs), t["observer"], t["fuzzy"], t["rbf"], t["body"], t["oscillator"], t["rules"],
        t["amplification"],
    )  # fmt: skip


def uncertain_straps(coupling: Coupling) -> list[Coupling]:
    """Return the coupling, and four with the strap's stiffness and damping 30 % off in each combination."""
    return [coupling] + [coupling.scaled(strap_stiffness=k, strap_damping=b) for k in (0.7, 1.3) for b in (0.7, 1.3)]


def design_reproduced_law(
    coupling: Coupling, period: float, constants: ChosenConstants, law: Law | None = None
) -> ResidualDesign:
    """Design the law that the reproduction compares on one wearer's card, until it has the margins; `period` [s].

    It is stronger than what `export` writes: it knows the orthosis's inertia, and no strap that is more than 30 % off.
    """
    made = design(coupling, period, law=law or constants.law, noise=constants.noise, **constants.widths)
    return within(
        made,
        uncertain_straps(coupling),
        gain_db=REQUIRED_GAIN_MARGIN_DB,
        delay=REQUIRED_DELAY_MARGIN_S,
        speeds=MARGIN_SPEEDS_RAD_S,
    )
