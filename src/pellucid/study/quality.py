"""Check whether a recording is fit for identification; each fault names file, channel, found and expected values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .._errors import UnfitRecordingError
from ..files.cut import MAX_EVEN_JITTER, sound_samples
from ..files.defects import clipped, limited, sensor_range
from ..files.defects.magnitude import find_implausible, has_constant_speeds, is_tumbling, wrong_ratio
from ..files.defects.watched import WatchedRecording
from ..files.delay import SHIFTED_KIND
from ..files.fault import Fault, fault_of
from ..files.optical_faults import find_optical_faults
from ..files.pieces import breaking_cuts, pieces_between_cuts
from ..files.recording import Recording
from .drive_channel import DRIVE_CHANNELS, command_channel
from .find_defects import (
    MAX_CLIPPED_SHARE,
    find_defects,
    max_bridged_gap,
    needed_kinds,
    regressed_joints,
    watched_part,
)
from .rollover import find_rollover, wrap_setting

if TYPE_CHECKING:
    from .study import Study
    from .study_file import ChannelSpec, JointTable

AddFault = Callable[..., None]
"""Function that adds a fault of a recording: ``add(severity, kind, channel, found=..., expected=...)``."""

# Channels that may rest at their largest value, because commands and switches last as long as they are set.
_RESTING_CHANNELS = {"time", "reference", "enabled", "supply", "temperature"}

# Channels, by the first part of their names, that may roll over. Other quantities with the same units do not turn.
_ROLLING_CHANNELS = {"position", "motor_position", "reference", "angle"}

# Channels, by the first part of their names, that a sensor with an end measures.
_MEASURED_EFFORTS = {"torque", "force", "moment", "interaction"}

EXPECTED_ENTRY = "with its column and unit"
"""End of a message that asks for a channel in study.toml."""

MIN_REMAINING_SAMPLES = 50
"""At least this many samples must remain after trimming and decimation: ten for each of a joint's five parameters."""


def inspect(recording: Recording, study: Study) -> list[Fault]:
    """Find what is wrong with a recording, the refusing faults first.

    A reversed sign or too little excitation shows only in a regression, so that identification finds those.
    """
    faults = cut_faults(recording)

    def add(severity: str, kind: str, channel: str, *, found: str, expected: str) -> None:
        faults.append(fault_of(recording, severity, kind, channel, found=found, expected=expected))

    for joint in study.rig.joints:
        _check_channels(recording, joint, f".{joint.joint}" if len(study.rig.joints) > 1 else "", add)
    processing = study.processing_of(recording)
    watched = watched_part(recording, study.config, study.specs_of(recording), processing)
    _check_missing(watched, add)
    if _check_time(recording, study, add):
        _check_length(recording, study, add)
        if processing.cut == "none":
            for cut in find_defects(watched, needed_kinds(study.config)):
                found = f"{cut.found} at {cut.start:.6g} s ({cut.where})"
                add("refuse", cut.kind, cut.channel, found=found, expected='none, or [processing] cut = "automatic"')
        _check_clipped(watched, add)
        _check_wrap(watched, study.specs_of(recording), add)
    _check_magnitude(watched, study, add)
    faults += share_faults(recording, study) + clock_faults(recording, study)
    if recording.optical is not None:
        faults += find_optical_faults(recording)
    return sorted(faults, key=lambda fault: fault.severity != "refuse")


def cut_faults(recording: Recording) -> list[Fault]:
    """Return a fault for each cut of a recording and of its streams."""
    faults = []
    for part in (recording, *recording.streams.values()):
        for cut in (c for c in part.cuts if c.kind != SHIFTED_KIND):
            found = f"{cut.found} at {cut.start:.6g} s ({cut.where})"
            faults.append(fault_of(part, "cut", cut.kind, cut.channel, found=found, expected="none", end="cut out"))
    return faults


def sensor_range_faults(recording: Recording, study: Study) -> list[Fault]:
    """Return a warning for each end of a sensor's range beyond which efforts were, cut out or accepted by the study."""
    processing = study.processing_of(recording)
    watched = watched_part(recording, study.config, study.specs_of(recording), processing)
    is_cut = any(cut.kind == sensor_range.KIND for cut in recording.cuts)
    if not is_cut and not watched.accepted & set(watched.drives.values()):
        return []
    others = tuple(cut for cut in recording.cuts if cut.kind != sensor_range.KIND)
    faults = []
    for drive, end in sensor_range.find_sensor_ends(replace(watched, recording=replace(recording, cuts=others))):
        share = 100.0 * end.samples / len(recording)
        found = f"{end.samples} samples ({share:.2g} %) "
        found += sensor_range.describe_end(end, recording.channels[drive].unit_words)
        is_kept = drive in watched.accepted
        done = (
            f'they are fitted because of clip = "accept" for {drive}' if is_kept else "they are excluded from the fit"
        )
        wanted = f"a sensor with a larger range; {done}"
        faults.append(fault_of(recording, "warn", sensor_range.KIND, drive, found=found, expected=wanted))
    return faults


def clipped_effort_faults(recording: Recording, study: Study) -> list[Fault]:
    """Return a warning for each measured effort that ends at one value, in studies that regress no joint.

    In those, such as of a strap, or of EMG with a reference torque, no model of the motion tells whether the sensor or
    the effort ended there. Studies of joints decide by their motion (`inspect`).
    """
    if regressed_joints(study.config) or study.config.identifies_each_joint:
        return []
    specs, faults = study.specs_of(recording), []
    for part in (recording, *recording.streams.values()):
        for name, channel in part.channels.items():
            is_accepted = name in specs and specs[name].clip == "accept"
            if name.partition(".")[0] not in _MEASURED_EFFORTS or is_accepted:
                continue
            samples = np.where(part.sound & part.enabled, channel.samples, np.nan)
            limits = limited.find_limits(samples)
            if not limits:
                continue
            count = sum(limit.samples for limit in limits)
            values = " and ".join(f"{limit.value:.4g}" for limit in limits)
            found = (
                f"{count} samples ({100.0 * count / len(part):.2g} %) at {values}{channel.unit_words}, as of a sensor "
                "that clips"
            )
            wanted = f'efforts within the range of the sensor, or {name} = {{ clip = "accept" }} if none was larger'
            where = f"{part.path.name} (recording {recording.name}), channel {name}"
            message = f"{where}: found {found}, expected {wanted}"
            faults.append(Fault("warn", clipped.KIND, part.path.name, name, found, wanted, message))
    return faults


def clock_faults(recording: Recording, study: Study) -> list[Fault]:
    """Return the faults of the clocks of a recording and its streams: packets delivered twice, stamps that jitter."""
    repeated = (_repeat_fault(each) for each in (recording, *recording.streams.values()))
    bridged = (_bridged_fault(each) for each in (recording, *recording.streams.values()))
    return [fault for fault in (*repeated, *bridged, _jitter_fault(recording, study)) if fault is not None]


def _repeat_fault(recording: Recording) -> Fault | None:
    if not recording.repeats:
        return None
    rows = len(recording) + recording.repeats
    found = f"{recording.repeats} of {rows} rows that repeat the samples of the row before, at its time or just after"
    wanted = "each packet once"
    end = f"expected {wanted}; the repeated rows are excluded"
    severity = "warn" if recording.repeats > MAX_HARMLESS_REPEATS * rows else "note"
    return fault_of(recording, severity, "repeated_packets", "time", found=found, expected=wanted, end=end)


def _bridged_fault(recording: Recording) -> Fault | None:
    if not recording.bridged:
        return None
    share = 100.0 * recording.bridged / len(recording)
    found = f"{recording.bridged} of {len(recording)} rows with a missing sample ({share:.3g} %)"
    expected = "a number in every sample"
    end = f"expected {expected}; interpolated over"
    return fault_of(recording, "note", "missing_samples", "time", found=found, expected=expected, end=end)


MAX_HARMLESS_REPEATS = 0.05
"""Largest share of repeated, excluded rows without a warning."""

MAX_HARMLESS_SHIFT = 0.1
"""Stamps that smoothing moved by less than this share of a sampling period (RMS) are no reason for doubt."""


def _jitter_fault(recording: Recording, study: Study) -> Fault | None:
    if not recording.advances or (recording.jitter <= MAX_EVEN_JITTER and not recording.stamped_evenly):
        return None
    clock, smoothed, step = recording.clock, recording.stamped_evenly, 1.0 / recording.fs
    own_rate = 1.0 / float(np.median(np.diff(clock.time))) if smoothed else recording.fs
    rate = study.processing_of(recording).resample or own_rate
    found = f"irregular steps, off by {100 * recording.jitter:.3g} % of {step:.4g} s in 1 of 100 samples (jitter)"
    if recording.loses_samples:
        found = f"steps of several times {step:.4g} s, because samples are lost"
    way = f"interpolated to {rate:.6g} Hz"
    if smoothed:
        why = "as smooth_stamps asks" if recording.smooth_stamps == "always" else "which fit the motion better"
        way = (
            f"stamps smoothed over {clock.window} samples, {why}: they moved by "
            f"{1e3 * clock.moved:.3g} ms RMS, {1e3 * clock.farthest:.3g} ms at most; then {way}"
        )
    is_moved = smoothed and clock.moved > MAX_HARMLESS_SHIFT * step
    severity, wanted = "warn" if is_moved else "note", f"an even clock; {way}"
    return fault_of(recording, severity, "sampling_jitter", "time", found=found, expected=wanted)


def share_faults(recording: Recording, study: Study) -> list[Fault]:
    """Return a fault for a recording, and for each of its streams, of which more is cut out than ``cut_share``
    allows."""
    faults, share = [], study.processing_of(recording).cut_share
    for part in (recording, *recording.streams.values()):
        # What is within a sensor's range is sound, however much is beyond it.
        uncounted = (SHIFTED_KIND, sensor_range.KIND)
        found = [cut for cut in part.cuts if cut.by == "automatic" and cut.kind not in uncounted]
        if not found:
            continue
        on = int(part.enabled.sum())
        lost = int((part.enabled & ~sound_samples(len(part), found)).sum())
        if lost <= share * on:
            continue
        causes = {}
        for cut in sorted(found, key=lambda cut: -cut.samples):
            causes.setdefault((cut.kind, cut.channel), f"{cut.found} in {cut.channel} from sample {cut.first} on")
        text = f"{lost} of {on} samples bad ({100 * lost / on:.3g} %): {'; '.join(causes.values())}"
        wanted = f"at most {100 * share:.3g} %; a window without them, or [processing] cut_share"
        channel = found[0].channel
        faults.append(fault_of(part, "refuse", "too_much_cut", channel, found=text, expected=wanted, of_channel=False))
    return faults


def left_out_fault(
    recording: Recording, study: Study, whole: bool, shortest_piece: float | None = None
) -> Fault | None:
    """Return why a study excludes a recording: too much of it is cut, or anything if it must be `whole`.

    With `shortest_piece` [s], pieces between cuts that are at least this long are used.
    """
    cuts = breaking_cuts(recording)
    too_much = share_faults(recording, study)
    if too_much:
        return replace(too_much[0], severity="warn", message=f"{too_much[0].message}: the recording is excluded")
    if not cuts or not whole:
        return None
    expected = "samples without a break, or a window of them"
    if shortest_piece is not None:
        if pieces_between_cuts(recording, shortest_piece):
            return None
        expected = f"{shortest_piece:g} s of samples without a break"
    first = cuts[0]
    found = f"{first.found} in {first.channel} at {first.start:.6g} s"
    if len(cuts) > 1:
        found += f" and {len(cuts) - 1} further breaks"
    end = f"expected {expected}: the recording is excluded"
    return fault_of(
        recording, "warn", "left_out", first.channel, found=found, expected=expected, end=end, of_channel=False
    )


def short_piece_fault(recording: Recording, shortest_piece: float) -> Fault | None:
    """Return what of a recording is lost because pieces between cuts are shorter than `shortest_piece` [s]."""
    kept = pieces_between_cuts(recording, shortest_piece)
    every = pieces_between_cuts(recording, 0.0)
    if not kept or len(kept) == len(every):
        return None
    lasts = [sum(float(piece.time[-1] - piece.time[0]) for piece in pieces) for pieces in (every, kept)]
    found = f"{len(every) - len(kept)} pieces between cuts, {lasts[0] - lasts[1]:.3g} s of {lasts[0]:.3g} s"
    expected = f"at least {shortest_piece:g} s each"
    end = f"expected {expected}: these are excluded"
    return fault_of(recording, "cut", "short_piece", "time", found=found, expected=expected, end=end, of_channel=False)


def require_sound(recording: Recording, study: Study) -> None:
    """Raise an UnfitRecordingError that names every refusing fault of a recording; do nothing without one."""
    refused = [fault.message for fault in inspect(recording, study) if fault.severity == "refuse"]
    if refused:
        raise UnfitRecordingError("\n".join(refused))


def _check_channels(recording: Recording, joint: JointTable, ending: str, add: AddFault) -> None:
    """Add a fault if a joint lacks its drive's channel, or its position and also a motor position that replaces it.

    The joint's channels end in `ending`.
    """
    present = ", ".join(recording.channels)
    places = [f"{'motor_' if getattr(joint, 'turns', None) else ''}position{ending}", f"position{ending}"]
    if not any(name in recording for name in places):
        entry = f"a channel {places[0]} {EXPECTED_ENTRY}"
        add("refuse", "missing_channel", places[0], found=f"only {present}", expected=entry)
    kind = joint.drive.kind
    drive = command_channel(recording, kind, ending)
    if drive is None:
        wanted = " or ".join(f"{name}{ending}" for name in DRIVE_CHANNELS[kind])
        entry = f'a channel {wanted} for a drive of kind "{kind}"'
        add("refuse", "missing_channel", wanted, found=f"only {present}", expected=entry)
    if drive == f"duty{ending}" and joint.drive.supply is None and f"supply{ending}" not in recording:
        found, wanted = "a duty but no supply voltage", "[rig.drive] supply or such a channel"
        add("refuse", "missing_channel", f"supply{ending}", found=found, expected=wanted)


def _check_missing(watched: WatchedRecording, add: AddFault) -> None:
    """Note missing samples in the channels that the study does not read."""
    for name, channel in watched.recording.channels.items():
        missing = int(np.sum(~np.isfinite(channel.samples)))
        if missing and name not in watched.channels and name != "time":
            first = int(np.flatnonzero(~np.isfinite(channel.samples))[0])
            many = f"{missing} missing sample{'s' if missing > 1 else ''} (NaN), the first at index {first}"
            add("note", "missing_samples", name, found=many, expected="a number in every sample")


def _check_time(recording: Recording, study: Study, add: AddFault) -> bool:
    """Return whether time increases with every step, without which other checks mean nothing; note bridged gaps."""
    if recording.advances and recording.steps_within(recording.longest_step):
        return True
    known = np.flatnonzero(np.isfinite(recording.time))
    time = recording.time[known]
    if len(time) < 2:
        add("refuse", "too_few_samples", "time", found=f"{len(time)} sample", expected="a recorded movement")
        return False
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        i = int(back[0])
        what = "repeated" if steps[i] == 0 else "running back"
        place = f"index {known[i + 1]} ({time[i]:.6g} s, then {time[i + 1]:.6g} s)"
        found = f"time {what} at {place}, {back.size} times in all"
        add("refuse", "time_order", "time", found=found, expected="time that increases with every sample")
        return False
    processing = study.processing_of(recording)
    bridged = max_bridged_gap(processing, recording.fs)
    long = steps[(steps > recording.longest_step) & (steps <= bridged)]
    if long.size and processing.resample is not None:
        found = f"{'a gap' if long.size == 1 else f'{long.size} gaps'} of up to {long.max():.4g} s"
        add("note", "gap", "time", found=found, expected="a sample at every step; interpolated over")
    return True


def _check_length(recording, study, add) -> None:
    processing = study.processing_of(recording)
    fs = processing.resample or recording.fs
    n = len(recording) * fs / recording.fs
    if processing.lowpass is not None and processing.lowpass > 0.49 * fs:
        wanted = f"more than twice the low-pass of {processing.lowpass:g} Hz, so that the filter exists"
        add("refuse", "rate", "time", found=f"a rate of {fs:.5g} Hz", expected=wanted)
    # A zero-phase filter needs as many samples at either end as it has memory.
    needed = max(2 * processing.trim + MIN_REMAINING_SAMPLES * processing.decimate, 6 * (processing.order + 1))
    if n < needed:
        found = f"{len(recording)} samples ({len(recording) / recording.fs:.4g} s)"
        wanted = (
            f"at least {math.ceil(needed * recording.fs / fs)}: {MIN_REMAINING_SAMPLES} are to be left after "
            f"trim = {processing.trim} and decimate = {processing.decimate}"
        )
        add("refuse", "too_few_samples", "time", found=found, expected=wanted)


def _check_clipped(watched: WatchedRecording, add: AddFault) -> None:
    """Add a fault for flat tops that were not cut out: a note at known and accepted limits, a refusal elsewhere."""
    cut = {(c.channel, c.kind) for c in watched.recording.cuts}
    for name, channel in watched.recording.channels.items():
        if name.partition(".")[0] in _RESTING_CHANNELS or (name, clipped.KIND) in cut:
            continue
        x = watched.samples(name)
        for sign, end in ((1.0, "largest"), (-1.0, "smallest")):
            first, length = clipped.flat_tops(sign * x)
            ends = first + length - 1
            kept = [
                not clipped.is_dwell(watched, name, a, b) for a, b in zip(first.tolist(), ends.tolist(), strict=True)
            ]
            first, length = first[kept], length[kept]
            if first.size == 0:
                continue
            count, value = int(length.sum()), float(x[first[0]])
            runs = "one flat run" if first.size == 1 else f"{first.size} flat runs"
            found = f"{count} samples clipped, in {runs} at the {end} value {value:.6g}{channel.unit_words}"
            severity = "note"
            if clipped.is_at_limit(watched, name, value):
                wanted = "none, but the limit is known"
            elif name in watched.accepted:
                wanted = "none, but accepted"
            elif name not in watched.channels:
                wanted = "none"
            else:
                severity = "refuse"
                wanted = (
                    f"flat tops in at most {100 * MAX_CLIPPED_SHARE:g} % of the samples, which are cut out; if it is a "
                    f'limit that is meant to act, say so: {name} = {{ clip = "accept" }}'
                ) + " or [rig.drive] limit" * watched.is_drive(name)
            add(severity, clipped.KIND, name, found=found, expected=wanted)


def _check_wrap(watched: WatchedRecording, specs: Mapping[str, ChannelSpec], add: AddFault) -> None:
    for name, channel in watched.recording.channels.items():
        if name.partition(".")[0] not in _ROLLING_CHANNELS or channel.unit not in ("rad", "m"):
            continue
        x = watched.samples(name)
        found = find_rollover(x)
        write = wrap_setting(found, specs[name]) if found is not None and name in specs else ""
        if write:
            first = watched.recording.time[found.jumps[0]]
            times = "once" if len(found.jumps) == 1 else f"{len(found.jumps)} times"
            what = f"a value that rolls over by {found.period:.4g}{channel.unit_words} {times}, first at {first:.6g} s"
            wanted = f"a continuous one: {name} = {{ {write} }} in [channels]"
            add("refuse" if name in watched.channels else "note", "wrap", name, found=what, expected=wanted)
        elif name.partition(".")[0] == "position" and name in watched.channels:
            parted = [span.start - 1 for span in watched.recording.spans if span.start > 0]
            _check_jump(name, x, parted, add)


def _check_jump(name: str, q: np.ndarray, parted: list[int], add: AddFault) -> None:
    """Refuse a position, shape (n,), that leaps; a step from one of the samples `parted` to the next crosses a cut."""
    moved = np.diff(q)
    np.abs(moved, out=moved)
    moved[parted] = 0.0
    known = np.isfinite(q)
    span = float(np.ptp(q if known.all() else q[known])) if known.any() else 0.0
    jumps = np.flatnonzero(moved > 0.5 * span)
    if jumps.size == 0 or jumps.size > len(q) // 20:
        return
    moved[jumps] = 0.0
    if not 0.0 < np.nanmax(moved) <= 0.1 * span:
        return
    i = int(jumps[0])
    found = f"a leap from {q[i]:.4g} to {q[i + 1]:.4g} at index {i + 1}, {jumps.size} in all"
    wanted = "a continuous position: an encoder that rolls over needs wrap_bits or wrap"
    add("refuse", "wrap", name, found=found, expected=wanted)


def _check_magnitude(watched: WatchedRecording, study: Study, add: AddFault) -> None:
    recording = watched.recording
    known = {drive: max(limits, default=0.0) for drive, limits in watched.limits.items()}
    for joint in study.rig.joints:
        limits = [abs(x) for x in (joint.limits.position_min, joint.limits.position_max) if x]
        ending = f".{joint.joint}" if len(study.rig.joints) > 1 else ""
        known |= dict.fromkeys((f"position{ending}", f"reference{ending}"), max(limits, default=0.0))
    specs = study.specs_of(recording)
    for name, channel in recording.channels.items():
        if name.partition(".")[0] == "position" and name not in specs:
            continue  # the integral of a velocity, which is looked at itself
        sound = channel if recording.sound.all() else replace(channel, samples=channel.samples[recording.sound])
        wrong = find_implausible(sound, known.get(name, 0.0))
        if wrong is None or (wrong.probable_unit == "deg" and _turns_on(recording, name, watched)):
            continue
        steady = wrong.probable_unit == "deg" and has_constant_speeds(recording.time, channel.samples)
        unit = wrong.probable_unit
        found = f"a magnitude of {wrong.largest:.4g}{channel.unit_words}"
        found += " of a joint that turns at constant speeds" if steady else ""
        taken = f" taken for{channel.unit_words}" if channel.unit_words else ""
        found += f", which looks like {unit}{taken}" if unit else ", which is nonsense"
        wanted = f"at most {wrong.limit:.4g}{channel.unit_words}"
        if name in watched.channels:
            wanted += f': the unit; write unit = "{unit}"' if unit and wrong.is_typical else ""
            wanted += _override(name, watched.is_drive(name))
        severity = ("warn" if steady else "refuse") if name in watched.channels else "note"
        add(severity, "magnitude", name, found=found, expected=wanted)
    for name in watched.channels:
        reference = watched.reference(name) if name.partition(".")[0] == "position" else None
        if reference is None:
            continue
        kept = recording.sound & recording.enabled
        ratio = wrong_ratio(recording[name][kept], reference.samples[kept])
        if ratio is not None:
            found = f"a motion of {ratio:.2g} times that of its reference, which it follows"
            add("refuse", "magnitude", name, found=found, expected=f"about as much: the units of {name} and reference")
    if recording.advances and recording.fs < 5.0:
        found = f"a step of {1 / recording.fs:.4g} s, which looks like ms taken for s"
        add("note", "magnitude", "time", found=found, expected='at most 0.2 s: the unit; write unit = "ms"')


def _turns_on(recording: Recording, name: str, watched: WatchedRecording) -> bool:
    """Whether gravity says that an angle is in radians, because the joint tumbles through whole turns."""
    drive = watched.drives.get(name)
    if drive is None or not recording.advances:
        return False
    kept = recording.sound & recording.enabled
    return is_tumbling(recording.time[kept], recording[name][kept], recording[drive][kept])


def _override(name: str, is_drive: bool) -> str:
    """Return how study.toml states that the machine does have such values."""
    if name.partition(".")[0] in ("position", "reference"):
        return ", or [rig.limits] position_min and position_max where it moves that far"
    return ", or [rig.drive] limit where the drive is that strong" if is_drive else ""
