"""Trials for a causal map of raw EMG, made of recordings of a wearer who counters an orthosis's torque."""

from __future__ import annotations

import numpy as np

from ....emg.estimators.causal_map import ANGLE_LOWPASS_HZ, EmgTrial
from ....files.recording import Recording
from ...strap.strap_torque import Limb, Orthosis
from ...strap.strapped_reference import strapped_torque


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
