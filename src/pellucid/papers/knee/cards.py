"""What a wearer's compensator is built from: identified cards of both bodies, strap and actuator, and a causal EMG map.

Nothing of the simulation's truth enters: only what its instruments wrote. One number is not identified, the dead time
of the torque loop, which is a property of the actuator's hardware that its maker states: one sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...control.coupling import Coupling
from ...estimators.causal_map import CausalMap, EmgSettings, EmgTrial, fit_causal_map
from ...fit.joint.actuator_residual import actuator_residual
from ...lab.knee.rig import KneeRig
from ...procedures.coupling.actuator_card import REQUIRED_CHANNELS
from ...procedures.coupling.identify_coupling import identify_worn
from ...procedures.emg_torque.strapped_trials import strapped_emg_trial
from .trials import STRAP_ONLY, take

DEAD_SAMPLES = 1
"""Of the actuator's torque loop, from reading to current, as its maker states."""


@dataclass(frozen=True)
class WearerCard:
    """One wearer in one orthosis."""

    coupling: Coupling  # Orthosis, actuator, strap and limb
    emg: CausalMap  # From raw EMG to torque
    alone: tuple[tuple[np.ndarray, np.ndarray], ...] = ()  # As of `Identified`


@dataclass(frozen=True, eq=False)
class Identified:
    """What was identified of a wearer, and the recordings that EMG maps are fitted to."""

    name: str  # The wearer
    rig: KneeRig  # In which to swing afterwards
    seed: int  # Of the recordings, and of how the instruments sit
    coupling: Coupling  # By the cards of orthosis, limb and strap, and by the actuator's sines
    steps: tuple[EmgTrial, ...]
    # Angle [rad] and command [N m], (n,) each, of sines of the orthosis alone, that rules are learnt from
    alone: tuple[tuple[np.ndarray, np.ndarray], ...] = ()

    def card(self, settings: EmgSettings | None = None) -> WearerCard:
        """Everything a controller may know, the EMG chain with some settings."""
        return WearerCard(self.coupling, fit_causal_map(self.steps, settings), self.alone)


def identify_wearer_of(rig: KneeRig, name: str, seed: int) -> Identified:
    """Record everything that one wearer does, and identify it."""
    taken = take(rig, seed, [name], protocols=(*STRAP_ONLY, "mvc", "torque_steps"))
    used = [r for r in taken.recordings if r.protocol != "torque_steps"]  # for the EMG map alone
    findings = identify_worn(taken.config, used)
    cards, stages = findings.cards, findings.wearers.get(name)
    if f"{name}.limb" not in cards:
        why = findings.refused.get(name) or "; ".join(stages.notes)
        raise IdentificationError(f"{name}: found no card of limb and strap, expected both: {why}")
    sines = taken.of("sine_tracking", "fit")
    actuator = actuator_residual([tuple(r[c] for c in REQUIRED_CHANNELS) for r in sines], sines[0].fs)
    actuator |= {"delay": DEAD_SAMPLES / sines[0].fs}
    coupling = Coupling.of_cards(cards["orthosis"], cards[f"{name}.limb"], cards[f"{name}.coupling"], actuator)
    known = {"orthosis": findings.orthosis.orthosis, "limb": stages.limb.limb, "strap": stages.coupling.plain}
    steps = [strapped_emg_trial(r, "emg", r.name.rsplit("_", 1)[-1], **known) for r in taken.of("torque_steps")]
    alone = tuple((r["position"], r["command"]) for r in sines)
    return Identified(name, rig, seed, coupling, tuple(steps), alone)


def mistaken(card: WearerCard, **factors: float) -> WearerCard:
    """A card with some parameters wrong; factors [1]."""
    return replace(card, coupling=card.coupling.scaled(**factors))


def weakened(card: WearerCard, factors: Mapping[int, float]) -> WearerCard:
    """A card whose EMG map takes channels for stronger or weaker than they are: as after new electrodes, or fatigue.

    factors [1].
    """
    weights = card.emg.weights.copy()
    for channel, factor in factors.items():
        weights[1 + channel] *= factor
    return replace(card, emg=replace(card.emg, weights=weights))
