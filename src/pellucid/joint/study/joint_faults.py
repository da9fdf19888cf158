"""Check whether recordings of a joint are suitable: faults of the files, then faults of the motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..._errors import PellucidError
from ...files.fault import Fault
from ...models.joint import JointModel, joint_model
from ...numerics.regression import Stack, stack
from ...study.effort import drive_model
from ...study.procedures.dead_effort import dead_effort_faults
from ...study.quality import inspect
from ...study.recorded_motions import carries_unknown_payload, motions_of, short_stretch_faults
from ...study.study import Study, drive_channel
from ..fit.excitation import measure_excitation
from ..fit.friction_solver import solve_family
from .aligned_motions import align_recordings, find_alignments
from .drive_sign import require_sign
from .findings.weak_parameter import advice
from .joined_clocks import find_clocks
from .velocity_faults import velocity_faults
from .wearer import wearer_faults

MIN_UNEXPLAINED_SHARE = 0.15
"""A parameter is hidden by others if less than this share of its effort cannot be explained by them."""


def joint_faults(study: Study) -> list[Fault]:
    """Return the faults of every file and, if none refuses, those of delay, sign and excitation."""
    faults = [fault for recording in study.recordings() for fault in inspect(recording, study)]
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    # Said first, for it changes what everything else means.
    faults = [*wearer_faults(study), *faults, *dead_effort_faults(study)]
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    faults += short_stretch_faults(study) + velocity_faults(study)
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    for clock in find_clocks(study):
        found_text, kind = f"{clock.said} {clock.do}", "refuse" if clock.why else "note"
        faults.append(Fault(kind, "clock", clock.file, "time", f"{clock.offset:.6g} s", "its offset", found_text))
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    try:
        fitted = [r for r in align_recordings(study, "fit") if not carries_unknown_payload(r)]
        data = stack(motions_of(fitted, study))
        model = joint_model(
            "symmetric",
            motion=study.rig.motion,
            effort_unit=drive_model(study.rig).effort_unit,
            gravity=study.model.gravity,
            known=study.model.known,
        )
        faults += _integration_notes(study)
        faults.append(_excitation_note(study, model, data))
        solve_family(model, data)
        require_sign(model, data, drive_channel(study.recordings("fit")[0], study))
        faults += _delay_notes(study)
    except PellucidError as error:
        faults.append(
            Fault(
                severity="refuse",
                kind="excitation",
                file="study.toml",
                channel="",
                found=str(error),
                expected="a motion that shows every parameter",
                message=str(error),
            )
        )
    return faults


def _excitation_note(study: Study, model: JointModel, data: Stack) -> Fault:
    """Describe the excitation by the motion, and name the parameters that others hide."""
    found = measure_excitation(model, data)
    rotary = study.rig.motion == "rotary"
    scale, unit = (float(np.degrees(1.0)), "deg") if rotary else (1e3, "mm")
    low, high = (scale * x for x in found.position)
    ranges = (
        f"{'angle' if rotary else 'position'} from {low:.3g} to {high:.3g} {unit}, speed to {scale * found.speed:.3g} "
        f"{unit}/s, acceleration to {scale * found.acceleration:.3g} {unit}/s²"
    )
    weak = [name for name in sorted(found.own, key=found.own.__getitem__) if found.own[name] < MIN_UNEXPLAINED_SHARE]
    text = f"{ranges}; condition number {found.condition:.3g}"
    say = f"what the fitted motion shows, whatever drove it: {text}"
    if weak:
        shares = ", ".join(f"{name.replace('_', ' ')} ({100 * found.own[name]:.2g} %)" for name in weak)
        say += f"; others do nearly all of what these do, which have of their own: {shares}. {advice(weak[0])}"
    else:
        say += "; every parameter shows"
    expected = f"{100 * MIN_UNEXPLAINED_SHARE:.0f} % of what each parameter does to be its own"
    return Fault("note", "excitation", "study.toml", "position", text, expected, say.rstrip())


def _integration_notes(study: Study) -> Iterator[Fault]:
    """Yield a note if angles are integrals of a velocity, whose zero is where each recording starts."""
    given = {"position", "motor_position"}
    integrated = [r.path.name for r in study.recordings() if "position" in r and not given & set(study.specs_of(r))]
    if not integrated or study.rig.motion != "rotary" or study.model.gravity == "none":
        return
    found = "no position: the velocity is integrated from 0 on"
    wanted = "recordings that all start at the same angle, or a position; otherwise the weight is wrong"
    message = f"{integrated[0]}, channel position: found {found}, expected {wanted}"
    if study.model.gravity == "sine":
        message += '. Write gravity = "sine+cosine" in [model] unless the joint hangs at that angle'
    yield Fault("note", "integrated", integrated[0], "position", found, wanted, message)


def _delay_notes(study: Study) -> Iterator[Fault]:
    """Yield a note on each drive whose delay was found."""
    for found in find_alignments(study):
        if found.said:
            of = found.recording or study.recordings("fit")[0].name
            file = study.recording(of).path.name
            late = f"{1e3 * found.moved:.3g} ms"
            yield Fault("note", "delay", file, found.channel, late, "0 s", f"{found.said} {found.do}".rstrip())
