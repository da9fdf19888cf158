"""Recordings of a wearer against an orthosis's torque, ready for a causal map of raw EMG."""

from __future__ import annotations

import numpy as np

from ...estimators.causal_map import ANGLE_LOWPASS_HZ, EmgTrial
from ...estimators.strapped_reference import strapped_torque
from ...fit.strap.strap_torque import Limb, Orthosis
from ...recordings.recording import Recording


def strapped_emg_trial(
    recording: Recording,
    stream: str,
    repetition: str,
    *,
    orthosis: Orthosis,
    limb: Limb,
    strap: np.ndarray,
) -> EmgTrial:
    """A recording of torques that a wearer counteracts, ready for `causal_map.fit_causal_map`. `strap` (p,) as
    the core names it."""
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
