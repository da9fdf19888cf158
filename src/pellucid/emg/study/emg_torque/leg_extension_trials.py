r"""Repetitions of a leg extended from sitting without a recorded torque. The reference is computed from the motion.

A shank that hangs at rest and is extended by :math:`\alpha` needs the torque (eq. 12 of the paper `hill`, with the
angle at rest taken for the hanging angle)

.. math::  \frac{\tau}{m g l} = \frac{I}{m g l}\,\ddot\alpha + \sin\alpha

where :math:`I/(m g l)` follows from the shank's length alone by anthropometric shares. The mass is unknown, so the
torque is relative.
"""

from __future__ import annotations

import numpy as np

from ....models.anthropometry import shank_length, winter
from ....numerics.filters import central_difference, zero_phase_lowpass
from ....study.study import Study
from ...estimators.features import MOTION_LOWPASS_HZ
from ...estimators.torque_trial import TorqueTrial
from ...signals.repetitions import find_repetitions
from .known_muscles import muscle_source
from .relative_envelopes import find_maxima, relative_envelopes
from .trial_sources import KEPT_RATE_HZ

EXTENSION_PROTOCOL = "leg_extension"
"""Protocol in which a sitting person extends the leg, again and again."""

DEFAULT_MASS_AND_HEIGHT = (70.0, 1.7)
"""Mass [kg] and height [m] of a person without a stated body. Height sets I/(m g l); mass sets a unit that cancels."""

EMG_LEAD_S = 0.3
"""Duration of the EMG before each repetition that is passed to muscles [s], since their force depends on it."""


def leg_extension_trials(study: Study, participant: str | None) -> tuple[list[TorqueTrial], float]:
    """Return one person's repetitions, each a trial and a group of its own, and the weight torque of the leg [N m].

    `study` [emg_torque].
    """
    own = [r for r in study.recordings() if r.participant == participant]
    found = [r for r in own if r.protocol == EXTENSION_PROTOCOL]
    person = study.config.participants.get(participant) if participant else None
    mass = getattr(person, "mass", None) or DEFAULT_MASS_AND_HEIGHT[0]
    height = getattr(person, "height", None) or DEFAULT_MASS_AND_HEIGHT[1]
    leg = winter(mass, shank_length(height))
    sign = 1.0 if study.config.rig.lifts == "flexion" else -1.0
    top = find_maxima(study, participant, found)
    trials = []
    for recording in found:
        where = f"{recording.path.name} (recording {recording.name}), channel angle.knee"
        repetitions = find_repetitions(recording["angle.knee"], recording.fs, where=where)
        angle = zero_phase_lowpass(recording["angle.knee"], MOTION_LOWPASS_HZ, 4, recording.fs)
        extension = -sign * (angle - repetitions.rest)
        acceleration = central_difference(central_difference(extension, recording.fs), recording.fs)
        torque = -sign * (leg.inertia * acceleration + leg.gravity() * np.sin(extension))
        flexion = sign * (0.5 * np.pi - extension)
        envelopes = relative_envelopes(study, recording, top, causal=False)
        every = max(1, round(recording.fs / KEPT_RATE_HZ))
        reach = round(EMG_LEAD_S * recording.fs)
        for i, repetition in enumerate(repetitions.each, start=1):
            kept = slice(repetition.start, repetition.end, every)
            ahead = np.arange(repetition.start - every, max(repetition.start - reach, -1), -every)[::-1]
            trials.append(
                TorqueTrial(
                    name=f"{recording.name}_{i}",
                    joint="knee",
                    time=recording.time[kept],
                    envelopes={muscle: x[kept] for muscle, x in envelopes.items()},
                    angles={"knee": flexion[kept]},
                    torque=torque[kept],
                    group=f"{recording.name}_{i}",
                    participant=participant,
                    checksum=recording.checksum,
                    muscles=muscle_source(study, recording, "knee"),
                    lead={muscle: x[ahead] for muscle, x in envelopes.items()} if len(ahead) else {},
                )
            )
    return trials, leg.gravity()
