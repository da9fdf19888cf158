"""Trials for a causal map of raw EMG, made of recordings of a wearer who counters an orthosis's torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....emg.estimators.causal_map import ANGLE_LOWPASS_HZ, EmgTrial
from ....emg.study.emg_torque.trial_sources import body_of_card
from ....files.recording import Recording
from ....models.friction_terms import COULOMB_FRICTION
from ....models.parameter_card import ParameterCard
from ...strap.orthosis_alone import StrappedBodies, strapped_torque
from ...strap.strap_model import PLAIN_NAME, Limb, Orthosis, StrapModel


def strapped_emg_trial(
    recording: Recording,
    stream: str,
    repetition: str,
    *,
    orthosis: Orthosis,
    limb: Limb,
    strap: np.ndarray,
) -> EmgTrial:
    """Return a recording as a trial for `causal_map.fit_causal_map`, with the wearer's torque as the reference.

    `strap` holds the strap's parameters in the core's order, shape (p,).
    """
    emg, position = recording.streams[stream], recording["position"]
    torque = strapped_torque(
        recording.time,
        position,
        recording["torque"],
        orthosis=orthosis,
        limb=limb,
        strap=strap,
        lowpass=ANGLE_LOWPASS_HZ,
    )
    raw = np.column_stack([emg[channel] for channel in emg.channels if channel.startswith("emg.")])
    return EmgTrial(repetition, recording.time, position, torque, emg.time, raw)


class StrappedWearer(StrappedBodies):
    """Bodies on which a wearer acts through a strap, as `calibrate` uses them."""

    @property
    def words(self) -> str:
        """How the strap is modelled, as a sentence."""
        if not self.model.features:
            return "the torque of the wearer goes through a spring and a damper for the strap."
        return f"the torque of the wearer goes through the strap of its card: {self.model.words}."

    def wearer_torque(self, recording: Recording, lowpass: float) -> np.ndarray:
        """Return the wearer's torque about the joint, shape (n,) [N m], low-passed at `lowpass` [Hz]."""
        return strapped_torque(
            recording.time, recording["position"], recording["torque"], orthosis=self.orthosis, limb=self.limb,
            strap=self.strap, lowpass=lowpass,
        )  # fmt: skip


def strapped_wearer(
    orthosis: ParameterCard, limb: ParameterCard, cards: Sequence[ParameterCard]
) -> tuple[StrappedWearer, ParameterCard] | None:
    """Return the bodies and the strap's card, the first of `cards` that the core can compute; None without one."""
    straps = [c for kind in ("strap", "coupling") for c in cards if c.kind == kind and _strap_of_card(c).in_core]
    if not straps:
        return None
    robot, leg, model = body_of_card(orthosis), body_of_card(limb), _strap_of_card(straps[0])
    bodies = StrappedWearer(
        Orthosis(
            robot.inertia, robot.viscous, robot.gravity, orthosis.values.get(COULOMB_FRICTION.name, 0.0),
            zero=robot.zero, offset=robot.offset,
        ),
        Limb(leg.inertia, leg.gravity, leg.viscous, zero=leg.zero),
        model,
        model.core(straps[0].values),
    )  # fmt: skip
    return bodies, straps[0]


def _strap_of_card(card: ParameterCard) -> StrapModel:
    """Return the strap's model that a card names; a card without a name is of a spring and a damper."""
    return StrapModel.named(str(card.settings.get("model", PLAIN_NAME)))
