"""Cards of an orthosis's actuator and of a wearer's EMG, and the bodies that cards of a worn orthosis describe.

The actuator's card has the residual motor and gear effects behind its torque loop. A wearer who counters the orthosis's
torque gives trials for a causal map of raw EMG.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from math import nan

import numpy as np

from ...._errors import IdentificationError
from ....emg.estimators.causal_map import CAUSAL_FIT, EmgSettings, EmgTrial, fit_causal_map
from ....emg.study.emg_torque.trial_sources import STEP_PROTOCOL, body_of_card, number_repetitions
from ....files.recording import Recording
from ....joint.fit.drive_delay import actuator_residual
from ....models.card import CardParameter
from ....models.friction_terms import COULOMB_FRICTION
from ....models.parameter_card import ParameterCard
from ....study.study import Study
from ...strap.orthosis_alone import strapped_torque
from ...strap.strap_model import PLAIN_NAME, Limb, Orthosis, StrapModel
from ...strap.wearer_coupling import WearerCoupling
from .coupling_table import CouplingTable


def _wearer_torque(recording: Recording, lowpass: float, **bodies) -> np.ndarray:
    """Return the wearer's torque, (n,) [N m]; `bodies` are orthosis, limb and strap, as `strapped_torque` has them."""
    return strapped_torque(recording.time, recording["position"], recording["torque"], lowpass=lowpass, **bodies)


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
    torque = _wearer_torque(recording, CAUSAL_FIT.angle_lowpass_hz, orthosis=orthosis, limb=limb, strap=strap)
    raw = np.column_stack([emg[channel] for channel in emg.channels if channel.startswith("emg.")])
    return EmgTrial(repetition, recording.time, position, torque, emg.time, raw)


@dataclass(frozen=True, eq=False)
class StrappedWearer:
    """Orthosis and limb as two bodies, and the strap between them through which a wearer acts."""

    orthosis: Orthosis
    limb: Limb
    model: StrapModel
    strap: np.ndarray  # Parameters of the strap in the core's order, shape (p,)

    @property
    def words(self) -> str:
        """How the strap is modelled, as a sentence."""
        if not self.model.features:
            return "The wearer's torque is transmitted by the strap, modelled as a spring and a damper."
        return f"The wearer's torque is transmitted by the strap of its model card: {self.model.words}."

    def wearer_torque(self, recording: Recording, lowpass: float) -> np.ndarray:
        """Return the wearer's torque about the joint, shape (n,) [N m], low-passed at `lowpass` [Hz]."""
        return _wearer_torque(recording, lowpass, orthosis=self.orthosis, limb=self.limb, strap=self.strap)


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


CARD_NAME = "actuator"
"""Name of the card's file."""

REQUIRED_CHANNELS = ("command", "torque", "position", "motor_position")
"""Channels that a recording of the actuator must have."""

PARAMETER_UNITS = {
    "actuator_inertia": "kg*m^2",
    "actuator_viscous": "N*m*s/rad",
    "actuator_coulomb": "N*m",
    "actuator_leak": "1/s",
    "actuator_frequency": "rad/s",
    "actuator_damping": "1",
    "spring_stiffness": "N*m/rad",
    "actuator_fit": "1",
}
"""Units of the card's parameters, by their names."""


def actuator_card(study: str, recordings: Sequence[Recording]) -> ParameterCard | None:
    """Identify the actuator from recordings of the orthosis alone; return None if they do not determine it."""
    alone = [
        r
        for r in recordings
        if r.use == "fit" and r.protocol == "sine_tracking" and set(REQUIRED_CHANNELS) <= set(r.channels)
    ]
    if not alone:
        return None
    try:
        found = actuator_residual([tuple(r[c] for c in REQUIRED_CHANNELS) for r in alone], alone[0].fs)
    except IdentificationError:
        return None
    return ParameterCard(
        kind="actuator",
        study=study,
        name=CARD_NAME,
        parameters=tuple(CardParameter(n, PARAMETER_UNITS[n], value, nan, (nan, nan)) for n, value in found.items()),
        settings={"period": 1.0 / alone[0].fs},
        checksums={r.name: r.checksum for r in alone},
        pellucid=version("pellucid"),
    )


def emg_cards(
    study: Study, recordings: Sequence[Recording], orthosis: Orthosis, wearers: Mapping
) -> dict[str, ParameterCard]:
    """Return the cards of all participants who have one, by file name without suffix; `study` has [coupling]."""
    stream, made = study.table(CouplingTable).emg, {}
    for who, stages in wearers.items():
        steps = [r for r in recordings if r.participant == who and r.protocol == STEP_PROTOCOL]
        limb = None if stages.limb is None else stages.limb.limb
        card = emg_card(study.name, who, steps, stream, orthosis=orthosis, limb=limb, coupling=stages.coupling)
        if card is not None:
            made[card.name] = card
    return made


def emg_card(
    study: str,
    who: str,
    steps: Sequence[Recording],
    stream: str,
    *,
    orthosis: Orthosis,
    limb: Limb | None,
    coupling: WearerCoupling,
    settings: EmgSettings | None = None,
) -> ParameterCard | None:
    """Fit one participant's map and return its card; None if it cannot be fitted."""
    steps = [r for r in steps if stream in r.streams]
    if limb is None or not np.isfinite(limb.inertia) or not steps:
        return None
    # The law that the map serves has this strap.
    repetition, strap = number_repetitions(steps), coupling.plain
    trials = [
        strapped_emg_trial(r, stream, str(repetition[r.name]), orthosis=orthosis, limb=limb, strap=strap) for r in steps
    ]
    channels = (name for name in steps[0].streams[stream].channels if name.startswith("emg."))
    try:
        found = fit_causal_map(trials, settings, muscles=[name.removeprefix("emg.") for name in channels])
    except IdentificationError:
        return None
    checksums: Mapping[str, str] = {r.name: r.checksum for r in steps}
    return found.card(study, f"{who}.emg", checksums, participant=who)
