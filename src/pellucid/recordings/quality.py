"""Is a recording fit to identify from? Every fault names file and channel, what was found and what was expected."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._errors import RecordingError
from .cut import GAP_STEPS
from .delay import MOVED
from .recording import Recording

if TYPE_CHECKING:
    from .study import Study

JITTER_SHARE = 0.1
"""Share of the time step by which 1 sample in 100 may be off before samples count as unevenly spaced."""

MIN_ROWS = 50
"""Samples that must be left after trimming and decimation: ten for each of a joint's five parameters."""

MIN_FRAMES = 200
"""Frames that must see the carriage's marker: a second's worth, which averages its noise to a tenth."""

MIN_SEEN = 0.25
"""Share of the frames that must see the carriage's marker."""

LONG_LOSS = 0.1
"""A marker lost for longer than this [s] is told; motion captures lose every marker now and then."""

FARTHEST = 20.0
"""Largest coordinate of a marker in a room [m]; larger ones are millimetres taken for metres."""

NEAREST = 0.02
"""Where no coordinate of any marker is larger than this [m], metres were taken for millimetres."""

MIN_OVERLAP = 0.5
"""Share of a recording that the motion capture should have seen."""

BREAKAWAY = 0.5
"""How far beyond what moves a joint either way the effort passes before its rest is an encoder's: a share of the
difference between both ways. A joint sticks while it reverses, and more so under a load or where gravity is larger."""

DRIVE_CHANNELS = {"torque": ("torque", "force"), "current": ("current",), "voltage": ("voltage", "duty")}
"""Kind of drive -> channels that may carry its command, the first one present counting."""

# Largest SI magnitude of a wearable joint, and the unit whose numbers pass it when they are taken for SI.
_PLAUSIBLE = {
    ("position", "rad"): (4 * math.pi, "deg"),
    ("reference", "rad"): (4 * math.pi, "deg"),
    ("position", "m"): (10.0, "mm"),
    ("reference", "m"): (10.0, "mm"),
    ("velocity", "rad/s"): (200.0, "deg/s"),
    ("velocity", "m/s"): (50.0, "mm/s"),
    ("current", "A"): (200.0, "mA"),
    ("voltage", "V"): (1000.0, "mV"),
    ("torque", "N*m"): (2000.0, "N*mm"),
    ("duty", "1"): (1.5, "%"),
}
_EMG_PLAUSIBLE = (0.05, "mV")

# A rest or a switch lasts in these as long as it is commanded to.
_MAY_REST = {"time", "reference", "enabled", "supply", "temperature"}


@dataclass(frozen=True)
class Fault:
    """Something wrong or remarkable in a recording.

    Attributes
    ----------
    severity : str
        ``"refuse"``: nothing may be identified from it; ``"cut"``: used, but without it; ``"note"``: told, and used.
    kind : str
        ``"missing_channel"``, ``"missing_samples"``, ``"time_order"``, ``"sampling_jitter"``, ``"gap"``, ``"rate"``,
        ``"too_few_samples"``, ``"clipped"``, ``"frozen_encoder"``, ``"wrap"`` or ``"magnitude"``; of markers also
        ``"lost_marker"`` and ``"overlap"``.
    file, channel : str
        Where; of a motion capture's file, the marker or ``"time"``.
    found, expected : str
        What, in words.
    message : str
        All of it in one line.
    """

    severity: str
    kind: str
    file: str
    channel: str
    found: str
    expected: str
    message: str


def drive_channel(recording: Recording, study: Study) -> str | None:
    """Name of the channel that carries the drive's command, None if the recording has none."""
    drive = study.rig.drive
    return next((name for name in DRIVE_CHANNELS[drive.kind] if name in recording), None) if drive else None


def inspect(recording: Recording, study: Study) -> list[Fault]:
    """Find what is wrong with a recording, the refusing faults first.

    A reversed sign or too little excitation shows only in a regression; identification looks for those.
    """
    faults = cut_faults(recording)

    def add(severity: str, kind: str, channel: str, found: str, expected: str) -> None:
        where = f"{recording.path.name} (recording {recording.name}), channel {channel}"
        message = f"{where}: found {found}, expected {expected}"
        faults.append(Fault(severity, kind, recording.path.name, channel, found, expected, message))

    drive = drive_channel(recording, study)
    _check_channels(recording, study, drive, add)
    _check_missing(recording, study, drive, add)
    if _check_time(recording, study, add):
        _check_length(recording, study, add)
        _check_clipped(recording, study, drive, add)
        cut = any(fault.kind == "clipped" and fault.channel == "position" for fault in faults)
        # One cause is told once: a cut position rests too, and a freezing one jumps.
        if "position" in recording and not cut and not _check_frozen(recording, drive, add):
            _check_wrap(recording, add)
    _check_magnitude(recording, add)
    if recording.optical is not None:
        faults += _optical_faults(recording)
    return sorted(faults, key=lambda fault: fault.severity != "refuse")


def cut_faults(recording: Recording) -> list[Fault]:
    """What was cut out of a recording, and of what other instruments recorded with it."""
    faults = []
    for of in (recording, *recording.streams.values()):
        for cut in (c for c in of.cuts if c.kind != MOVED):
            found = f"{cut.found} at {cut.start:.6g} s ({cut.where})"
            message = f"{of.path.name} (recording {of.name}), channel {cut.channel}: found {found}, cut out"
            faults.append(Fault("cut", cut.kind, of.path.name, cut.channel, found, "none", message))
    return faults


def grouped(faults: Sequence[Fault], most: int = 3, most_cuts: int = 10) -> list[str]:
    """Messages of what does not refuse; of many that differ only in their file, the first, and how many more there
    are."""
    kinds: dict[tuple[str, ...], list[str]] = {}
    for fault in faults:
        if fault.severity == "cut":
            kinds.setdefault((fault.kind, fault.channel, fault.file), []).append(fault.message)
        elif fault.severity != "refuse":
            what = (fault.kind, fault.channel) if len(faults) > most else (fault.message, "")
            kinds.setdefault(what, []).append(fault.message)
    said = []
    for what, messages in kinds.items():
        # A cut is told with its place; where there are many of one kind in one file, the first ones are.
        told = most_cuts if len(what) == 3 else 1
        if len(messages) <= max(most, told):
            said += messages
        else:
            said += [*messages[: told - 1], f"{messages[told - 1]} (and {len(messages) - told} more like it)"]
    return said


def require_sound(recording: Recording, study: Study) -> None:
    """Do nothing for a recording without a refusing fault."""
    refused = [fault.message for fault in inspect(recording, study) if fault.severity == "refuse"]
    if refused:
        raise RecordingError("\n".join(refused))


def _check_channels(recording, study, drive, add) -> None:
    present = ", ".join(recording.channels)
    if "position" not in recording:
        add("refuse", "missing_channel", "position", f"only {present}", "a channel position with its column and unit")
    if drive is None:
        kind = study.rig.drive.kind
        wanted = " or ".join(DRIVE_CHANNELS[kind])
        add("refuse", "missing_channel", wanted, f"only {present}", f'a channel {wanted} for a drive of kind "{kind}"')
    if drive == "duty" and study.rig.drive.supply is None and "supply" not in recording:
        add(
            "refuse",
            "missing_channel",
            "supply",
            "a duty but no supply voltage",
            "[rig.drive] supply or such a channel",
        )


def _needed(study, drive) -> set[str]:
    return {"time", "position", "reference" if study.rig.loop else "position", drive or "position"}


def _check_missing(recording, study, drive, add) -> None:
    for name, channel in recording.channels.items():
        starts, lengths = _runs(~np.isfinite(channel.samples))
        if starts.size == 0:
            continue
        longest = int(np.argmax(lengths))
        total = int(lengths.sum())
        found = f"{total} missing sample{'s' if total > 1 else ''} (NaN), the first at index {starts[0]}, " + (
            f"the longest run {lengths[longest]} from index {starts[longest]}"
        )
        expected = "a number in every sample"
        if name in _needed(study, drive):
            add("refuse", "missing_samples", name, found, f"{expected}; choose a window without them")
        else:
            add("note", "missing_samples", name, found, expected)


def _check_time(recording, study, add) -> bool:
    """Whether time advances, so that the other checks mean something."""
    time = recording.time
    if not np.isfinite(time).all() or len(time) < 2:
        if len(time) < 2:
            add("refuse", "too_few_samples", "time", f"{len(time)} sample", "a recorded movement")
        return False
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        i = int(back[0])
        what = "repeated" if steps[i] == 0 else "running back"
        add(
            "refuse",
            "time_order",
            "time",
            f"time {what} at index {i + 1} ({time[i]:.6g} s, then {time[i + 1]:.6g} s), {back.size} times in all",
            "time that increases with every sample",
        )
        return False
    step = 1.0 / recording.fs
    gaps = np.flatnonzero(steps > GAP_STEPS * step)
    resampled = study.processing.resample is not None
    if gaps.size:
        worst = int(gaps[np.argmax(steps[gaps])])
        found = (
            f"{gaps.size} gap{'s' if gaps.size > 1 else ''}, the longest {steps[worst]:.4g} s after {time[worst]:.6g} s"
        )
        bridged = resampled and steps[worst] <= _bridgeable(recording, study)
        expected = f"a sample every {step:.4g} s"
        add(
            "note" if bridged else "refuse", "gap", "time", found, expected + ("" if bridged else _resample_hint(study))
        )
    within = steps[steps <= GAP_STEPS * step]
    off = float(np.quantile(np.abs(within - step), 0.99)) / step
    if off > JITTER_SHARE:
        add(
            "note" if resampled else "refuse",
            "sampling_jitter",
            "time",
            f"steps off by {100 * off:.3g} % of {step:.4g} s in 1 of 100 samples",
            f"at most {100 * JITTER_SHARE:g} %" + ("" if resampled else _resample_hint(study)),
        )
    return True


def _resample_hint(study) -> str:
    if study.processing.resample is not None:
        return ", or a window without the gap"
    return ', or [processing] resample = "... Hz"'


def _bridgeable(recording, study) -> float:
    """Longest stretch [s] without samples over which interpolation loses nothing the filter would keep."""
    lowpass = study.processing.lowpass
    return 0.5 / lowpass if lowpass else 3.0 / recording.fs


def _rate(recording) -> float | None:
    try:
        return recording.fs
    except RecordingError:
        return None


def _check_length(recording, study, add) -> None:
    processing = study.processing
    fs = processing.resample or recording.fs
    n = len(recording) * fs / recording.fs
    if processing.lowpass is not None and processing.lowpass > 0.49 * fs:
        add(
            "refuse",
            "rate",
            "time",
            f"a rate of {fs:.5g} Hz",
            f"more than twice the low-pass of {processing.lowpass:g} Hz, so that the filter exists",
        )
    # A zero-phase filter needs as many samples to start from as it has memory, at either end.
    needed = max(2 * processing.trim + MIN_ROWS * processing.decimate, 6 * (processing.order + 1))
    if n < needed:
        add(
            "refuse",
            "too_few_samples",
            "time",
            f"{len(recording)} samples ({len(recording) / recording.fs:.4g} s)",
            f"at least {math.ceil(needed * recording.fs / fs)}: {MIN_ROWS} are to be left after trim = "
            f"{processing.trim} and decimate = {processing.decimate}",
        )


def _check_frozen(recording, drive, add) -> bool:
    """Refuse a position that stays the same bits while the machine must have moved."""
    q, fs = recording["position"], recording.fs
    effort = np.where(recording.enabled, recording[drive], np.nan) if drive else None
    reference = recording.channels.get("reference")
    # A velocity loop's reference says nothing about where the position should be.
    same = reference is not None and reference.unit == recording.channels["position"].unit
    reference = reference.samples if same else None
    if not np.isfinite(q).any():
        return False
    if np.nanmin(q) == np.nanmax(q):
        moves = [
            s for s in (effort, reference) if s is not None and np.isfinite(s).any() and np.nanmax(s) > np.nanmin(s)
        ]
        if moves:
            add("refuse", "frozen_encoder", "position", f"the one value {q[0]:.6g} in all samples", _MOVES)
        return bool(moves)
    step = _Steps(q)
    starts, lengths = _runs(np.diff(q) == 0.0)
    for start, length in zip(starts, lengths + 1, strict=True):
        if length < max(20, 0.1 * fs):
            continue
        why = _why_frozen(q, effort, reference, step, int(start), int(start + length - 1))
        if why:
            add(
                "refuse",
                "frozen_encoder",
                "position",
                f"the one value {q[start]:.6g} for {length} samples from index {start} "
                f"({recording.time[start]:.6g} s), while {why}",
                _MOVES,
            )
            return True
    return False


_MOVES = "a position that follows the machine's movement"


class _Steps:
    """How a signal moves over a stride long enough that its resolution does not matter."""

    def __init__(self, x: np.ndarray):
        finite = x[np.isfinite(x)]
        self.range = float(np.ptp(finite))
        levels = np.diff(np.unique(finite))
        levels = levels[levels > 1e-9 * self.range]
        self.resolution = float(levels.min()) if levels.size else 0.0
        self.stride, self.typical = 1, 0.0
        while True:
            moved = np.abs(x[self.stride :] - x[: -self.stride])
            moved = moved[np.isfinite(moved)]
            self.typical = float(np.quantile(moved, 0.99)) if moved.size else 0.0
            if self.typical >= 20 * self.resolution or 2 * self.stride > max(1, len(x) // 50):
                break
            self.stride *= 2

    @property
    def resolved(self) -> bool:
        return self.typical >= 8 * self.resolution > 0.0


def _why_frozen(q, effort, reference, step: _Steps, first: int, last: int) -> str | None:
    n, stride = len(q), step.stride
    low, high = np.nanmin(q), np.nanmax(q)
    # A machine rests at its end stop, and arrives there at speed.
    margin = max(0.01 * step.range, 2.5 * step.resolution)
    inside = low + margin < q[first] < high - margin
    moved = np.abs(np.diff(q))
    elsewhere = np.delete(moved, slice(max(first - 1, 0), last + 1))
    elsewhere = elsewhere[np.isfinite(elsewhere)]
    largest = float(elsewhere.max()) if elsewhere.size else 0.0
    if last + 1 < n and moved[last] > max(3 * largest, 3 * step.resolution) and largest > 0:
        return f"it then jumps by {moved[last]:.4g} in one sample"
    if inside and step.resolved and first > 3 * stride:
        # Two strides at speed up to the last sample: a single step may be two recordings joined into one.
        approach = np.diff(q[first - 1 - 2 * stride : first : stride])
        speed = np.abs(approach).min()
        lost = speed / stride * (last - first)
        if speed > 0.35 * step.typical and lost > 8 * step.resolution:
            return "the samples before it move at speed"
    if reference is not None:
        error = np.abs(reference - q)
        other = np.delete(error, slice(first, last + 1))
        if other.size > n // 4:
            usual, worst = np.nanmax(other), np.nanmax(error[first : last + 1])
            if worst > 5 * usual and worst > 0.1 * step.range:
                return f"the reference departs from it by {worst:.4g}, elsewhere by at most {usual:.4g}"
    if effort is not None and (swings := _swings(effort, first, last)) >= 3:
        # Fewer may be a test for the effort at which a joint breaks away.
        return f"the effort swings {swings} times through most of its range"
    if effort is not None and step.resolved:
        velocity = np.zeros(n)
        velocity[stride:] = q[stride:] - q[:-stride]
        forth, back = effort[velocity > 0.25 * step.typical], effort[velocity < -0.25 * step.typical]
        run = effort[first + 1 : last]
        if np.isfinite(forth).any() and np.isfinite(back).any() and np.isfinite(run).any():
            up, down = np.nanmedian(forth), np.nanmedian(back)
            # A joint that reverses sticks until the effort breaks it away, which takes a little more than to move it.
            more = BREAKAWAY * (up - down)
            if up > down and np.nanmax(run) > up + more and np.nanmin(run) < down - more:
                return f"the effort passes from {np.nanmin(run):.4g} to {np.nanmax(run):.4g}, which moves it elsewhere"
    return None


def _swings(effort: np.ndarray, first: int, last: int) -> int:
    """How many times in a row, up and down, the effort moves by 60 % of its whole range between two samples."""
    if not np.isfinite(effort).any():
        return 0
    enough = 0.6 * float(np.nanmax(effort) - np.nanmin(effort))
    run = effort[first : last + 1]
    run = run[np.isfinite(run)]
    swings, way = 0, 0
    low = high = run[0] if run.size else 0.0
    for value in run[np.flatnonzero(np.diff(run, prepend=np.nan))].tolist():
        low, high = min(low, value), max(high, value)
        if way <= 0 and value - low >= enough > 0.0:
            swings, way, high = swings + 1, 1, value
        elif way >= 0 and high - value >= enough > 0.0:
            swings, way, low = swings + 1, -1, value
    return swings


def _check_wrap(recording, add) -> None:
    if not np.isfinite(recording["position"]).all():
        return
    q = recording["position"]
    moved, span = np.abs(np.diff(q)), float(np.ptp(q))
    jumps = np.flatnonzero(moved > 0.5 * span)
    if jumps.size == 0 or jumps.size > len(q) // 20:
        return
    others = np.delete(moved, jumps)
    if others.size == 0 or others.max() > 0.1 * span:
        return
    i = int(jumps[0])
    add(
        "refuse",
        "wrap",
        "position",
        f"a jump from {q[i]:.4g} to {q[i + 1]:.4g} at index {i + 1}, {jumps.size} in all",
        "a continuous position: an encoder that rolls over needs wrap_bits",
    )


def _check_clipped(recording, study, drive, add) -> None:
    specs = study.specs_of(recording)
    loop = study.rig.loop
    limits = [limit for limit in (study.rig.drive.limit, loop.limit if loop else None) if limit is not None]
    for name, channel in recording.channels.items():
        if name in _MAY_REST or (loop and name == loop.injected) or not np.isfinite(channel.samples).any():
            continue
        for sign, end in ((1.0, "largest"), (-1.0, "smallest")):
            count, runs = _clipped(sign * channel.samples)
            if count == 0:
                continue
            value = sign * float(np.nanmax(sign * channel.samples))
            found = f"{count} samples in {runs} flat runs at the {end} value {value:.6g} {channel.unit}"
            known = name == drive and any(abs(value) >= 0.98 * limit for limit in limits)
            accepted = name in specs and specs[name].clip == "accept"
            if known or accepted:
                add("note", "clipped", name, found, "none, but the limit is known" if known else "none, but accepted")
            else:
                add(
                    "refuse",
                    "clipped",
                    name,
                    found,
                    f'no flat tops; if it is a limit that is meant to act, say so: {name} = {{ clip = "accept" }}'
                    + (" or [rig.drive] limit" if name == drive else ""),
                )


def _clipped(x: np.ndarray) -> tuple[int, int]:
    """Samples and runs in which `x` is cut off at its maximum: flat, and steep before and after."""
    step = _Steps(x)
    if step.range == 0.0 or step.typical == 0.0:
        return 0, 0
    top = np.nanmax(x)
    starts, lengths = _runs(x >= top - 1e-9 * step.range)
    count = runs = 0
    k = step.stride
    for start, length in zip(starts, lengths, strict=True):
        if length < 3:
            continue
        before, after = start - 1, start + length
        if before - k < 0 or after + k >= len(x):
            continue  # at a border there is no telling a cut from a rest
        slope = min(x[before] - x[before - k], x[after] - x[after + k])
        # Slope into the run times its length is how far the peak was cut; a peak's own width costs one resolution.
        if slope > 0.1 * step.typical and slope / k * length / 4 > 2 * step.resolution:
            count, runs = count + int(length), runs + 1
    return (count, runs) if count >= 5 else (0, 0)


def _check_magnitude(recording, add) -> None:
    for name, channel in recording.channels.items():
        limit, looks = _PLAUSIBLE.get((name, channel.unit), (None, None))
        if name.startswith("emg."):
            limit, looks = _EMG_PLAUSIBLE
        finite = channel.samples[np.isfinite(channel.samples)]
        if limit is None or finite.size == 0:
            continue
        largest = float(np.abs(finite).max())
        if largest > limit:
            found = f"a magnitude of {largest:.4g} {channel.unit}, which looks like {looks}"
            add("note", "magnitude", name, found, f"at most {limit:.4g} {channel.unit}")
    rate = _rate(recording)
    if rate is not None and rate < 5.0:
        add("note", "magnitude", "time", f"a step of {1 / rate:.4g} s, which looks like ms", "at most 0.2 s")


def _optical_faults(recording: Recording) -> list[Fault]:
    optical = recording.optical
    faults: list[Fault] = []

    def add(severity: str, kind: str, channel: str, found: str, expected: str) -> None:
        what = "time" if channel == "time" else f"marker {channel}"
        message = f"{optical.path.name} (recording {recording.name}), {what}: found {found}, expected {expected}"
        faults.append(Fault(severity, kind, optical.path.name, channel, found, expected, message))

    for marker in optical.markers:
        _check_seen(optical, marker, add)
    if _check_optical_time(optical, add):
        _check_overlap(recording, add)
    _check_room(optical, add)
    return faults


def _check_seen(optical, marker, add) -> None:
    seen, n = optical.seen(marker), len(optical)
    count = int(seen.sum())
    # Only the carriage's marker is needed: others tell of the axis, which other recordings tell too.
    needed = marker == optical.carriage
    if count == 0 or (needed and (count < MIN_FRAMES or count < MIN_SEEN * n)):
        enough = f"at least {max(MIN_FRAMES, math.ceil(MIN_SEEN * n))}" if needed else "some"
        add(
            "refuse" if needed else "note",
            "lost_marker",
            marker,
            f"it in {count} of {n} frames",
            f"{enough}: a column of another name, or a marker that was hidden",
        )
        return
    starts, lengths = _runs(~seen)
    if starts.size == 0 or not np.isfinite(optical.time).all():
        return
    ends = np.minimum(starts + lengths, n - 1)
    longest = int(np.argmax(optical.time[ends] - optical.time[starts]))
    lasted = float(optical.time[ends[longest]] - optical.time[starts[longest]])
    if lasted > LONG_LOSS:
        found = (
            f"it lost in {int(lengths.sum())} of {n} frames, the longest loss {lasted:.3g} s after "
            f"{optical.time[starts[longest]]:.6g} s"
        )
        add("note", "lost_marker", marker, found, "it in every frame; frames without it are left out")


def _check_optical_time(optical, add) -> bool:
    time = optical.time
    missing = int(np.sum(~np.isfinite(time)))
    if missing or len(time) < 2:
        found = f"{missing} missing samples (NaN)" if missing else f"{len(time)} frame"
        add("refuse", "missing_samples" if missing else "too_few_samples", "time", found, "a time for every frame")
        return False
    back = np.flatnonzero(np.diff(time) <= 0)
    if back.size:
        i = int(back[0])
        add(
            "refuse",
            "time_order",
            "time",
            f"{time[i]:.6g} s, then {time[i + 1]:.6g} s at index {i + 1}, {back.size} such steps in all",
            "time that increases with every frame",
        )
        return False
    return True


def _check_overlap(recording, add) -> None:
    robot, optical = recording.time, recording.optical.time
    if not np.isfinite(robot).all() or robot[-1] <= robot[0]:
        return
    common = min(robot[-1], optical[-1]) - max(robot[0], optical[0])
    if common >= MIN_OVERLAP * (robot[-1] - robot[0]):
        return
    found = f"{optical[0]:.4g} s to {optical[-1]:.4g} s"
    theirs = f"the recording's {robot[0]:.4g} s to {robot[-1]:.4g} s"
    if common <= 0:
        add("refuse", "overlap", "time", found, f"some of {theirs}: clocks that start together")
    else:
        add("note", "overlap", "time", found, f"most of {theirs}")


def _check_room(optical, add) -> None:
    largest = {m: float(np.nanmax(np.abs(p))) for m, p in optical.markers.items() if optical.seen(m).any()}
    if not largest:
        return
    farthest = max(largest, key=largest.get)
    value = largest[farthest]
    if value > FARTHEST:
        found = f"a coordinate of {value:.4g} m, which looks like mm taken for m"
        add("refuse", "magnitude", farthest, found, f"at most {FARTHEST:g} m: the unit [optical] states")
    elif value < NEAREST:
        found = f"no coordinate of any marker beyond {value:.4g} m, which looks like m taken for mm"
        add("refuse", "magnitude", farthest, found, f"markers farther apart than {NEAREST:g} m: the unit")


def _runs(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First index and length of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return edges[::2], np.diff(edges)[::2]
