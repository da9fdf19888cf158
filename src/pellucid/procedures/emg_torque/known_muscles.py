"""What a study knows of the muscles across a joint: lengths and moment arms recorded, or those of a model of a leg."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...estimators.muscle_source import FIBRE_DAMPING, SEATED, STANDING, MuscleSource
from ...models.hill import HillMuscle
from ...models.muscle_geometry import muscle_table
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...recordings.study_muscles import study_muscles
from ...signals.emg_chain import emg_chain


def muscle_source(study: Study, recording: Recording, joint: str) -> MuscleSource | None:
    """What a study knows of the muscles across a joint, in one of its recordings.

    Lengths and moment arms that were recorded are taken; without them, those of a model of a leg.

    `study` [emg_torque].
    """
    table = muscle_table()
    constants = {name: replace(m, damping=FIBRE_DAMPING) for name, m in table.constants.items()}
    for name, found in study_muscles(study).items():
        constants[name] = HillMuscle(
            name, found.optimal_fibre_length, found.tendon_slack_length, found.largest_force, found.pennation,
            damping=FIBRE_DAMPING,
        )  # fmt: skip
    recorded = _recorded(recording, joint)
    if not recorded and not any(joint in path.angles for path in table.geometry.values()):
        return None
    own = [r for r in study.recordings() if r.participant == recording.participant]
    return MuscleSource(
        constants,
        recorded,
        maximal=study.config.emg_torque.chain == "none" or any(r.protocol == "mvc" for r in own),
        sign=-1.0 if joint == "knee" and study.config.rig.lifts == "flexion" else 1.0,
        relative=study.config.emg_torque.chain == "none" or _normalises(study.config.emg_torque.chain),
        posture=SEATED if recording.protocol in ("leg_extension", "seated_swing") else STANDING,
    )


def _normalises(chain: str) -> bool:
    return any(stage.kind == "normalise" for stage in emg_chain(chain).stages)


def _recorded(recording: Recording, joint: str) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Muscles with a length, a rate and a moment arm about the joint among the streams, on the recording's clock."""
    every = {
        name: (stream.time, channel.samples)
        for stream in recording.streams.values()
        for name, channel in stream.channels.items()
    }
    heads = ("length.", "lengthening.", f"moment_arm.{joint}.")
    muscles = [name.removeprefix("length.") for name in every if name.startswith("length.")]
    return {
        muscle: tuple(np.interp(recording.time, *every[head + muscle]) for head in heads)
        for muscle in muscles
        if all(head + muscle in every for head in heads)
    }
