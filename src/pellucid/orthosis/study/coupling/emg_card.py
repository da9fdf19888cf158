"""Card of a wearer's causal EMG map: torque from raw EMG in real time, from the limb's dynamics behind the strap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...._errors import IdentificationError
from ....emg.estimators.causal_map import EmgSettings, fit_causal_map
from ....emg.study.emg_torque.trial_sources import STEP_PROTOCOL, number_repetitions
from ....files.recording import Recording
from ....models.parameter_card import ParameterCard
from ....study.study import Study
from ...strap.strap_torque import Limb, Orthosis
from ...strap.wearer_coupling import WearerCoupling
from .coupling_table import CouplingTable
from .strapped_trials import strapped_emg_trial


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
