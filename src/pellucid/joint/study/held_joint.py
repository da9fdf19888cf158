"""Decide whether a study's recordings are postures, in which its joint is only held, or of a locked spring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._errors import PellucidError
from ...files.fault import Fault
from ...files.recording import LOCKED_SPRING_PROTOCOL, Recording
from ...numerics.spring_evidence import spring_evidence
from ...study.array_study import ArrayStudy
from ...study.recorded_motions import motions_of
from ...study.study import Study

MAX_POSTURE_RANGE_RAD = np.radians(0.5)
"""A joint whose angle stays within this range in a recording is held there [rad]."""


def is_locked_spring(study: Study) -> bool:
    """Whether every recording that a study fits is said to be of a locked spring."""
    fitted = [entry.protocol for entry in study.config.recordings if entry.use == "fit"]
    return bool(fitted) and all(protocol == LOCKED_SPRING_PROTOCOL for protocol in fitted)


def spring_advice(study: Study) -> str:
    """Return how to state a spring on the bench, for studies that are refused as those of a joint; empty for others.

    It may be one if the joint is only held, or if the effort follows the position of all fitted recordings together.
    """
    if is_locked_spring(study) or not (is_held_throughout(study) or _follows_position(study)):
        return ""
    done = f'state protocol = "{LOCKED_SPRING_PROTOCOL}" in every [[recordings]]'
    if isinstance(study, ArrayStudy):  # it has no file in which to state a protocol
        done = "pellucid.propose writes a study of it from the same columns"
    return f"if one end of a spring is locked, {done}"


def with_spring_advice(study: Study, faults: Sequence[Fault]) -> list[Fault]:
    """Return faults in which a refusal of the motion says how to state a spring on the bench, if it may be one."""
    refused = [fault for fault in faults if fault.severity == "refuse" and fault.kind == "excitation"]
    advice = spring_advice(study) if refused else ""
    if not advice:
        return list(faults)
    return [replace(fault, message=f"{fault.message}; {advice}") if fault in refused else fault for fault in faults]


def _follows_position(study: Study) -> bool:
    try:
        motions = motions_of(study.recordings("fit"), study)
    except PellucidError:
        return False
    if not motions:
        return False
    names = ("position", "velocity", "acceleration", "effort")
    found = spring_evidence(*(np.concatenate([getattr(m, name) for m in motions]) for name in names))
    return found is not None and found.follows


def is_held_throughout(study: Study) -> bool:
    """Whether a study's recordings are postures of one rotary joint, in which nothing ever moves."""
    if study.rig.motion != "rotary":
        return False
    recordings = study.recordings()
    return len(recordings) > 0 and all(_is_posture(recording) for recording in recordings)


def _is_posture(recording: Recording) -> bool:
    if "position" not in recording:
        return False
    angle = recording["position"][recording.sound & recording.enabled]
    angle = angle[np.isfinite(angle)]
    return angle.size > 0 and float(np.ptp(angle)) <= MAX_POSTURE_RANGE_RAD
