"""Check whether recordings of a joint are suitable: faults of the files, of the drive's sign, and of the motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError, PellucidError, RecordingError, UnfitRecordingError
from ...files.fault import Fault, warn_if_held_out
from ...files.recording import Recording
from ...models.friction_terms import COULOMB_FRICTION
from ...models.joint import UNITS, JointModel
from ...numerics.motion import differentiate, lowpassed, shortest
from ...numerics.regression import Solution, Stack, stack
from ...study.drive_channel import drive_channel
from ...study.procedures.dead_effort import dead_effort_faults
from ...study.quality import inspect
from ...study.recorded_motions import (
    carries_unknown_payload,
    filtering_of,
    motions_of,
    short_stretch_faults,
    stretches_of,
)
from ...study.study import Study
from ...study.study_file import Processing
from ..fit.friction_solver import solve_family
from ..fit.joint_estimate import measure_excitation
from .aligned_motions import align_recordings, find_alignments, find_clocks, simple_model
from .joint_case import advice, wearer_faults

MIN_ROWS_PER_PARAMETER = 10
"""A single recording's sign is checked only with more than this many rows per parameter."""


MIN_REVERSED_POWER_SHARE = 0.1
"""Friction alone shows that the effort is reversed only if it gives this share of RMS effort times RMS speed. A delay
of some milliseconds makes a few hundredths."""

MAX_REVERSED_UNEXPLAINED_SHARE = 0.1
"""Friction alone shows that the effort is reversed only if the model leaves at most this share of its variance. Chosen
by judgement; no measurement is recorded."""


class ReversedSignError(IdentificationError):
    """The effort of recordings has the opposite sign of their position: `found`, in words, what to `do`, and `advice`
    on what else the recordings may be."""

    def __init__(self, found: str, do: str, advice: str = ""):
        self.found, self.do, self.advice = found, do, f"; {advice}" if advice else ""
        super().__init__(f"{found}: {do}{self.advice}")


def require_sign(model: JointModel, data: Stack, channel: str | None) -> None:
    """Refuse recordings in which the drive's effort has the wrong sign, in all of them or in one."""
    _refuse_reversed(model, data, channel)
    names = dict.fromkeys(m.recording for m in data.motions)
    for name in names if len(names) > 1 else ():
        own = [i for i, m in enumerate(data.motions) if m.recording == name and len(data.targets[i])]
        part = Stack(tuple(data.motions[i] for i in own), tuple(data.targets[i] for i in own))
        if len(part.lengths) and sum(part.lengths) > MIN_ROWS_PER_PARAMETER * len(model.names):
            _refuse_reversed(model, part, channel, name)


def _refuse_reversed(model: JointModel, data: Stack, channel: str | None, alone: str = "") -> None:
    """Refuse data with negative work and a negative inertia; `alone` names a single recording."""
    try:
        found = solve_family(model, data, consistent=False)
    except IdentificationError:
        if alone:
            return  # one recording need not show every parameter
        raise
    values = dict(zip(model.names, found.values, strict=True))
    noise = np.sqrt(np.mean(found.residual**2) / np.maximum(np.sum(found.jacobian**2, axis=0), 1e-300))
    sure = {n for n, v, s in zip(model.names, found.values, noise, strict=True) if v < -10.0 * s}
    work = sum(float(np.sum(m.effort * m.velocity)) / m.fs for m in data.motions)
    evidence = _reversed_parameter(model, data, found, sure) if work < 0.0 else ""
    if not evidence:
        return
    whose = f"recording {alone}: " if alone else ""
    unit = "J" if model.effort_unit in ("N*m", "N") else f"{model.effort_unit}*{UNITS[model.motion]['position']}"
    raise ReversedSignError(
        f"{whose}the drive absorbs {-work:.3g} {unit} of work from the joint, and the estimated {evidence} is negative "
        f"({values[evidence]:.3g} {model.unit(evidence)})",
        f"the sign of the drive or of the position is reversed; set sign = -1 on channel '{channel}' or 'position' "
        "in study.toml",
    )


def _reversed_parameter(model: JointModel, data: Stack, found: Solution, negative: set[str]) -> str:
    """Return which of the `negative` parameters, `found` without bounds, shows that the effort is reversed; else "".

    It is the inertia; or dry friction, if it gives much of the power and the model explains the effort. Where a person
    drives the joint, the model does not. A delay makes viscous friction alone negative.
    """
    if "inertia" in negative:
        return "inertia"
    dry = next((name for name in model.names if name in negative and name.startswith(COULOMB_FRICTION.name)), "")
    effort, velocity = data.target, data.reduced([m.velocity for m in data.motions])
    share = float(np.mean(effort * velocity)) / float(np.sqrt(np.mean(effort**2) * np.mean(velocity**2)))
    unexplained_share = float(np.sum(found.residual**2)) / float(np.sum((effort - effort.mean()) ** 2))
    is_sure = share < -MIN_REVERSED_POWER_SHARE and unexplained_share < MAX_REVERSED_UNEXPLAINED_SHARE
    return dry if is_sure else ""


MIN_CORRELATION = 0.7
"""A velocity follows the position if its correlation with the position's derivative is at least this."""

MAX_SCALE_DIFFERENCE = 0.1
"""Largest relative difference of a velocity's scale from that of the position's derivative."""

MAX_DELAY_S = 0.1
"""Largest delay in the search [s]."""

MAX_COMPARED_SAMPLES = 10_000
"""Number of samples that are compared, from the middle of the longest stretch."""

UNIT_CONFUSIONS = {
    math.degrees(1.0): "deg/s given as rad/s", math.radians(1.0): "rad/s given as deg/s", 1e3: "mm/s given as m/s",
    1e-3: "m/s given as mm/s", 60.0 / (2.0 * math.pi): "rpm given as rad/s", math.pi / 30.0: "rad/s given as rpm",
}  # fmt: skip
"""Confusions of units, by the factor by which they enlarge the velocity."""

MAX_STEADY_SPREAD_SHARE = 0.02
"""A speed counts as one throughout if its standard deviation is below this share of its mean."""


def velocity_faults(study: Study) -> list[Fault]:
    """Return the faults of every recorded velocity."""
    return [
        warn_if_held_out(fault, recording.use)
        for recording in study.recordings()
        if "velocity" in recording and "position" in study.specs_of(recording)
        for fault in _faults(recording, study.processing_of(recording))
    ]


def require_velocity(study: Study) -> None:
    """Refuse recorded velocities that are to be used but do not follow the position."""
    refused = [fault.message for fault in velocity_faults(study) if fault.severity == "refuse"]
    if refused:
        raise UnfitRecordingError("\n".join(refused))


def _faults(recording: Recording, processing: Processing) -> Iterator[Fault]:
    from ...numerics.clocks import align  # imported late, because it loads SciPy's optimisers

    longest = max(stretches_of(recording, processing), key=lambda s: len(s.time), default=None)
    filtering = filtering_of(processing)
    if longest is None or len(longest.time) < shortest(filtering):
        return
    measured, fs = longest.recording, longest.fs
    try:
        expected = differentiate(measured["position"], fs, filtering)[1]
        recorded = lowpassed(measured["velocity"], fs, filtering)
    except ValueError:
        return  # too short for its filter, which is reported elsewhere
    used = processing.velocity == "recorded"
    thin = max(int(fs / (10.0 * filtering.lowpass)), 1) if filtering.lowpass else 1
    first = max((len(expected) - MAX_COMPARED_SAMPLES * thin) // 2, 0)
    part = slice(first, first + MAX_COMPARED_SAMPLES * thin, thin)
    time, expected, recorded = longest.time[part], expected[part], recorded[part]

    def fault(kind: str, found: str, wanted: str, severity: str = "refuse" if used else "note") -> Fault:
        message = (
            f"{recording.path.name} (recording {recording.name}), channel velocity: found {found}, expected {wanted}"
        )
        return Fault(severity, kind, recording.path.name, "velocity", found, wanted, message)

    if all(float(np.std(x)) < MAX_STEADY_SPREAD_SHARE * abs(float(np.mean(x))) for x in (expected, recorded)):
        return  # one speed throughout, as in a map of friction: nothing varies that could be compared
    moving = float(np.std(expected)) > 0.0 and float(np.std(recorded)) > 0.0
    try:
        lies = align(time, expected, time, recorded, longest=MAX_DELAY_S) if moving else None
    except RecordingError:
        lies = None
    if lies is None or abs(lies.correlation) < MIN_CORRELATION:
        found = f"a correlation of {lies.correlation:.2f} with" if lies is not None else "no correlation with"
        yield fault("velocity_mismatch", f"{found} the position's derivative", "a velocity that follows the position")
        return
    size = abs(lies.gain)
    if lies.gain < 0.0:
        yield fault(
            "velocity_sign", "the position's derivative reversed", "its sign: set sign = -1 on channel velocity"
        )
    if abs(size - 1.0) > MAX_SCALE_DIFFERENCE:
        like = next(
            (
                f", which looks like {text}"
                for by, text in UNIT_CONFUSIONS.items()
                if abs(size / by - 1.0) < MAX_SCALE_DIFFERENCE
            ),
            "",
        )
        yield fault(
            "velocity_scale", f"{size:.4g} times the position's derivative{like}", "the same: its unit or scale"
        )
    late = lies.delay
    if abs(late) > 1.0 / recording.fs and abs(late) > 4.0 * lies.delay_error:
        what = f"a {'delay' if late > 0.0 else 'lead'} of {1e3 * abs(late):.3g} ms relative to the position"
        reach = f"(95 % interval {1e3 * (late - 1.96 * lies.delay_error):.3g} to "
        reach += f"{1e3 * (late + 1.96 * lies.delay_error):.3g} ms)"
        write = f'none, or velocity = {{ delay = "{1e3 * late:.3g} ms" }} in [channels]'
        yield fault("velocity_delay", f"{what} {reach}", write, "note")


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
        model = replace(simple_model(study), payload_scale=1.0)
        faults += _integration_notes(study)
        faults.append(_excitation_note(study, model, data))
        solve_family(model, data)
        require_sign(model, data, drive_channel(study.recordings("fit")[0], study))
        faults += _delay_notes(study)
    except PellucidError as error:
        wanted = "a motion that shows every parameter"
        faults.append(Fault("refuse", "excitation", "study.toml", "", str(error), wanted, str(error)))
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
    say = f"excitation by the fitted motion: {text}"
    if weak:
        shares = ", ".join(f"{name.replace('_', ' ')} ({100 * found.own[name]:.2g} %)" for name in weak)
        say += f"; nearly collinear with others (share of the effect that is independent): {shares}. {advice(weak[0])}"
    else:
        say += "; every parameter is excited"
    expected = f"an independent share of {100 * MIN_UNEXPLAINED_SHARE:.0f} % for each parameter"
    return Fault("note", "excitation", "study.toml", "position", text, expected, say.rstrip())


def _integration_notes(study: Study) -> Iterator[Fault]:
    """Yield a note if angles are integrals of a velocity, whose zero is where each recording starts."""
    given = {"position", "motor_position"}
    integrated = [r.path.name for r in study.recordings() if "position" in r and not given & set(study.specs_of(r))]
    if not integrated or study.rig.motion != "rotary" or study.model.gravity == "none":
        return
    found = "no position, so that the velocity is integrated from 0"
    wanted = "recordings that all start at the same angle, or a position; otherwise gravity is wrong"
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
