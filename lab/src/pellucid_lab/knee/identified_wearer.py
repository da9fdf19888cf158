"""Inputs of a wearer's compensator: identified cards of both bodies, strap and actuator, and a causal EMG map.

Nothing of the simulation's truth enters, only its instruments' recordings. One number is not identified: the dead time
of the torque loop, which is a property of the actuator's hardware that its maker states.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pellucid._errors import IdentificationError
from pellucid.controllers.coupling import Coupling
from pellucid.emg.estimators.causal_map import CausalMap, EmgSettings, EmgTrial, fit_causal_map
from pellucid.joint.fit.drive_delay import actuator_residual
from pellucid.orthosis.study.coupling.cards import REQUIRED_CHANNELS, strapped_emg_trial
from pellucid.orthosis.study.coupling.identify_coupling import identify_worn

from .recorded_session import STRAP_PROTOCOLS, take
from .rig import KneeRig

ACTUATOR_DEAD_SAMPLES = 1
"""Dead time of the actuator's torque loop, from reading to current, in samples, as the actuator's maker states it."""


@dataclass(frozen=True)
class WearerCard:
    """One wearer in one orthosis."""

    coupling: Coupling  # Orthosis, actuator, strap and limb
    emg: CausalMap  # Map from raw EMG to torque
    alone: tuple[tuple[np.ndarray, np.ndarray], ...] = ()  # Sines of the empty orthosis, as in `IdentifiedWearer`


@dataclass(frozen=True, eq=False)
class IdentifiedWearer:
    """One identified wearer, with the recordings to which EMG maps are fitted."""

    name: str  # Name of the wearer
    rig: KneeRig  # Rig in which the wearer swings afterwards
    seed: int  # Seed of the recordings, and of the instruments' mounting
    coupling: Coupling  # Model from the cards of orthosis, limb and strap, and from the actuator's sines
    steps: tuple[EmgTrial, ...]  # Torque steps with EMG
    # Angle [rad] and command [N m], (n,) each, of sines of the empty orthosis, from which rules are learnt
    alone: tuple[tuple[np.ndarray, np.ndarray], ...] = ()

    def card(self, settings: EmgSettings | None = None) -> WearerCard:
        """Return all that a controller may use, with the EMG map fitted under `settings`."""
        return WearerCard(self.coupling, fit_causal_map(self.steps, settings), self.alone)


def identify_wearer_of(rig: KneeRig, name: str, seed: int) -> IdentifiedWearer:
    """Record one wearer in every protocol, and identify orthosis, limb, strap and actuator."""
    taken = take(rig, seed, [name], protocols=(*STRAP_PROTOCOLS, "mvc", "torque_steps"))
    used = [r for r in taken.recordings if r.protocol != "torque_steps"]  # torque steps serve the EMG map alone
    findings = identify_worn(taken.config, used)
    cards, stages = findings.cards, findings.wearers.get(name)
    if f"{name}.limb" not in cards:
        why = findings.refused.get(name) or "; ".join(stages.notes)
        raise IdentificationError(f"{name}: found no card of limb and strap, expected both: {why}")
    sines = taken.of("sine_tracking", "fit")
    actuator = actuator_residual([tuple(r[c] for c in REQUIRED_CHANNELS) for r in sines], sines[0].fs)
    actuator |= {"delay": ACTUATOR_DEAD_SAMPLES / sines[0].fs}
    coupling = Coupling.of_cards(cards["orthosis"], cards[f"{name}.limb"], cards[f"{name}.coupling"], actuator)
    known = {"orthosis": findings.orthosis.orthosis, "limb": stages.limb.limb, "strap": stages.coupling.plain}
    steps = [strapped_emg_trial(r, "emg", r.name.rsplit("_", 1)[-1], **known) for r in taken.of("torque_steps")]
    alone = tuple((r["position"], r["command"]) for r in sines)
    return IdentifiedWearer(name, rig, seed, coupling, tuple(steps), alone)


def card_with_coupling_errors(card: WearerCard, **factors: float) -> WearerCard:
    """Return a card whose coupling has some parameters multiplied by `factors` [1]."""
    return replace(card, coupling=card.coupling.scaled(**factors))


def card_with_channel_gains(card: WearerCard, factors: Mapping[int, float]) -> WearerCard:
    """Return a card whose EMG map weighs channels too much or too little, as after new electrodes or fatigue.

    `factors` has a factor [1] on the weight of each channel that it names.
    """
    weights = card.emg.weights.copy()
    for channel, factor in factors.items():
        weights[1 + channel] *= factor
    return replace(card, emg=replace(card.emg, weights=weights))
