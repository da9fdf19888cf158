"""Identify each joint of a study that has several and no table that takes them together.

A joint at rest or with a constant effort cannot be identified and is listed as such. A joint with unsuitable recordings
is excluded with the reason. Neither prevents the identification of the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError, PellucidError
from ...files.fault import Fault
from ...models.estimates import Verdict, rank_verdicts
from ...models.robot import MIN_MOVING_RANGE
from ...study.procedures.dead_effort import dead_effort_faults
from ...study.procedures.procedure import Progress, quiet
from ...study.procedures.result import Result
from ...study.quality import clipped_effort_faults, cut_faults, sensor_range_faults
from ...study.study import Study
from ...study.study_file import JOINT_CHANNELS
from . import procedure
from .each_joint_result import EachJointResult, complete_each_joint
from .held_joint import MAX_POSTURE_RANGE_RAD
from .joint_coupling import coupling_verdicts
from .joint_views import joint_views

MIN_MOVED_RANGE = {"rotary": MAX_POSTURE_RANGE_RAD, "prismatic": MIN_MOVING_RANGE[True]}
"""A joint counts as moving only if its range over all fitted recordings exceeds this [rad; m]."""


def each_joint_faults(study: Study) -> list[Fault]:
    """Return the faults of every joint; a fault that rejects one joint alone is a warning that it is excluded."""
    found: dict[str, list[Fault]] = {}
    resting: list[Fault] = []
    for joint, view in joint_views(study).items():
        why = resting_text(view)
        if why:
            resting.append(_resting_fault(view, joint, why))
        else:
            found[joint] = procedure.faults(view)
    refused = [joint for joint, faults in found.items() if any(fault.severity == "refuse" for fault in faults)]
    if len(refused) < len(found):
        for joint in refused:
            found[joint] = [_left_out(fault, joint) for fault in found[joint] if fault.severity == "refuse"]
    elif not found:
        resting = [replace(fault, severity="refuse") for fault in resting]
    return [*_of_joints(found), *resting]


def each_joint_notes(study: Study) -> list[Fault]:
    """Return what is cut out of the recordings of each joint that moves, and further notes on them."""
    found = {}
    for joint, view in joint_views(study).items():
        if resting_text(view):
            continue
        faults = procedure.notes(view)
        for recording in view.recordings():
            faults += cut_faults(recording)
            faults += sensor_range_faults(recording, view) + clipped_effort_faults(recording, view)
        found[joint] = faults
    return _of_joints(found)


JOINTS_SHARE = 0.95
"""Share of the work that the joints take, each on its own."""


def identify_each_joint(
    study: Study, tell: Progress = quiet, *, families: Sequence[str] | None = None, thorough: bool = True
) -> EachJointResult:
    """Identify each joint of a study as a study of that joint alone would."""
    joints: dict[str, Result] = {}
    resting, left_out = dict[str, str](), dict[str, str]()
    views = joint_views(study)
    for i, (joint, view) in enumerate(views.items()):

        def tell_part(text: str, share: float, i: int = i, joint: str = joint) -> None:
            tell(f"{joint}: {text}", JOINTS_SHARE * (i + share) / len(views))

        why = resting_text(view)
        if why:
            resting[joint] = why
            continue
        try:
            joints[joint] = procedure.run(view, tell_part, families=families, thorough=thorough)
        except PellucidError as error:
            left_out[joint] = str(error)
    if not joints:
        raise IdentificationError(_no_joint_text(study, resting, left_out))
    tell("coupling between joints", JOINTS_SHARE)
    verdicts = [
        *coupling_verdicts({joint: views[joint] for joint in joints}, joints),
        *(Verdict("warning", f"{joint} is excluded: {why}", finding="left_out") for joint, why in left_out.items()),
        *(Verdict("note", f"{joint} not identified: found {why}.", finding="rest") for joint, why in resting.items()),
        *_verdicts_of(joints),
    ]
    return complete_each_joint(study, joints, resting, left_out, rank_verdicts(verdicts))


def resting_text(view: Study) -> str:
    """Return in words why the recordings of a joint show nothing of it; "" if it moves under an effort that changes."""
    if "resting" not in view.found:
        view.found["resting"] = _resting_text(view)
    return view.found["resting"]


def _resting_text(view: Study) -> str:
    fitted = [recording for recording in view.recordings("fit") if "position" in recording]
    # A joint that is locked looks like a frozen encoder, so that what is cut out counts, too.
    places = [recording["position"][recording.enabled] for recording in fitted]
    known = np.concatenate([place[np.isfinite(place)] for place in places]) if places else np.zeros(0)
    if known.size and float(np.ptp(known)) <= MIN_MOVED_RANGE[view.rig.motion]:
        scale, unit = (np.degrees(1.0), "deg") if view.rig.motion == "rotary" else (1e3, "mm")
        return f"a position within {scale * float(np.ptp(known)):.2g} {unit} in all that is fitted"
    try:
        refused = [fault for fault in dead_effort_faults(view) if fault.severity == "refuse"]
    except PellucidError:
        return ""  # what is wrong with the recordings is a fault of its own
    return next((f"an effort of {fault.found}" for fault in refused if fault.kind == "dead_effort"), "")


def _resting_fault(view: Study, joint: str, found: str) -> Fault:
    file = next((recording.path.name for recording in view.recordings("fit")), "study.toml")
    wanted = "a joint that moves under a varying effort; the joint is not identified"
    message = f"{joint}: found {found}, expected {wanted}"
    return Fault("note", "resting_joint", file, f"position.{joint}", found, wanted, message)


def _left_out(fault: Fault, joint: str) -> Fault:
    return replace(fault, severity="warn", message=f"excluded, because it cannot be identified: {fault.message}")


def _of_joints(found: Mapping[str, Sequence[Fault]]) -> list[Fault]:
    """Return the faults of all joints under the names of study.toml; one that all joints share stands once."""
    counts: dict[Fault, int] = {}
    for faults in found.values():
        for fault in dict.fromkeys(faults):
            counts[fault] = counts.get(fault, 0) + 1
    made = []
    for joint, faults in found.items():
        for fault in faults:
            if len(found) > 1 and counts[fault] == len(found):
                made.append(fault)
                continue
            channel = f"{fault.channel}.{joint}" if fault.channel in JOINT_CHANNELS else fault.channel
            made.append(replace(fault, channel=channel, message=f"{joint}: {fault.message}"))
    return list(dict.fromkeys(made))


def _verdicts_of(joints: Mapping[str, Result]) -> list[Verdict]:
    """Return the verdicts on all joints, each with its joint; one that all joints share stands once."""
    shared = set.intersection(*({v.said for v in found.verdicts} for found in joints.values()))
    made: dict[str, Verdict] = {}
    for joint, found in joints.items():
        for verdict in found.verdicts:
            is_shared = len(joints) > 1 and verdict.said in shared
            text = verdict.text if is_shared else f"{joint}: {verdict.text}"
            made.setdefault(f"{text} {verdict.do}", replace(verdict, text=text))
    return list(made.values())


def _no_joint_text(study: Study, resting: Mapping[str, str], left_out: Mapping[str, str]) -> str:
    reasons = [f"{joint}: {why}" for joint, why in left_out.items()]
    reasons += [f"{joint}: found {why}, expected a joint that moves" for joint, why in resting.items()]
    return f"{study.folder}: none of {len(reasons)} joints can be identified: {'; '.join(reasons)}"
