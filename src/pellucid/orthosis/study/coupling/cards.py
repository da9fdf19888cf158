"""Card of an orthosis's actuator: residual motor and gear effects behind its torque loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from math import nan

import numpy as np

from ...._errors import IdentificationError
from ....emg.estimators.causal_map import EmgSettings, fit_causal_map
from ....emg.study.emg_torque.trial_sources import STEP_PROTOCOL, number_repetitions
from ....files.recording import Recording
from ....joint.fit.drive_delay import actuator_residual
from ....models.card import CardParameter
from ....models.parameter_card import ParameterCard
from ....study.study import Study
from ...strap.strap_model import Limb, Orthosis
from ...strap.wearer_coupling import WearerCoupling
from .coupling_table import CouplingTable
from .strapped_trials import strapped_emg_trial

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
