"""The simplest model and an excerpt of the samples, for checks before any friction family is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...files.delay import recording_part
from ...files.recording import Recording
from ...models.joint import JointModel, joint_model
from ...study.effort import drive_model
from ...study.study import Study

MAX_SAMPLES = 200_000
"""Largest number of samples that are checked, at the recordings' rate. Of longer recordings stretches are used."""

STRETCH_COUNT = 4
"""Number of stretches that are used of a long recording."""


def simple_model(study: Study) -> JointModel:
    """Return the model with symmetric friction; payloads are part of the joint if the drive constant is unknown."""
    unit = drive_model(study.rig).effort_unit
    made = joint_model(
        "symmetric",
        motion=study.rig.motion,
        effort_unit=unit,
        gravity=study.model.gravity,
        known=study.model.known,
    )
    return replace(made, payload_scale=1.0 if unit in ("N*m", "N") else 0.0)


def thin_recordings(recordings: Sequence[Recording], most: int = MAX_SAMPLES) -> list[Recording]:
    """Return the recordings; of long ones return a few evenly spaced stretches."""
    total = sum(len(r) for r in recordings)
    if total <= most:
        return list(recordings)
    length = max(most // (STRETCH_COUNT * len(recordings)), 1)
    made = []
    for recording in recordings:
        starts = np.linspace(0, len(recording), STRETCH_COUNT + 1)[:-1].astype(int) if len(recording) > most else [0]
        ends = [s + length for s in starts] if len(starts) > 1 else [STRETCH_COUNT * length]
        made += [recording_part(recording, s, min(e, len(recording))) for s, e in zip(starts, ends, strict=True)]
    return made
