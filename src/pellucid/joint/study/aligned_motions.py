"""Bring a study's motions onto one clock.

The clocks of joined instruments, and the delay between drive and encoder, are estimated from the motion that the drive
causes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import PellucidError, RecordingError
from ...files.delay import initial_offset, recording_part, shift_channels, undo_lags
from ...files.recording import Recording
from ...models.joint import JointModel, joint_model
from ...numerics.delay import Delay, find_likely_delays
from ...numerics.motion import Motion
from ...study.drive_channel import drive_channel
from ...study.quality import DRIVE_CHANNELS
from ...study.recorded_motions import carries_unknown_payload, command_of, drive_model, motions_of
from ...study.study import Study
from ..fit.drive_delay import estimate_drive_delay
from ..fit.recording_agreement import StatedValueError
from .joint_case import is_worn

MAX_SAMPLES = 200_000
"""Largest number of samples that are checked, at the recordings' rate. Of longer recordings stretches are used."""

STRETCH_COUNT = 4
"""Number of stretches that are used of a long recording."""


@dataclass(frozen=True)
class ClockSearch:
    """Settings of the search for the offset and the drift of a joined clock."""

    max_offset_distance_s: float = 60.0  # Largest distance of an offset from the first guess in the search [s]
    # Distance of neighbouring offsets in the search [s]. Joints swing slower than ten times a second.
    offset_step_s: float = 0.01
    # Another offset is ambiguous if its residual share is below this multiple of the best one's.
    ambiguity_ratio: float = 1.2
    max_unexplained_share: float = 0.5  # An offset is refused if more than this share of the effort remains unexplained
    trial_sample_count: int = 1500  # Approximate number of samples with which offsets are tried
    # A clock drift is used only if it differs from zero by more than this many standard errors.
    min_drift_standard_errors: float = 4.0
    max_refinements: int = 3  # Largest number of refinements of an offset
    offset_tolerance_s: float = 1e-4  # Refinement stops when the offset changes by less than this [s]


CLOCK_SEARCH = ClockSearch()


def simple_model(study: Study) -> JointModel:
    """Return the model with symmetric friction; payloads are part of the joint if the drive constant is unknown.

    It is an error if every parameter of it is known.
    """
    unit = drive_model(study.rig).effort_unit
    made = joint_model(
        "symmetric",
        motion=study.rig.motion,
        effort_unit=unit,
        gravity=study.model.gravity,
        known=study.model.known,
    )
    if not made.names:
        raise StatedValueError(
            f"known: found every parameter of a joint with symmetric friction ({', '.join(study.model.known)}), "
            "expected at least one that is to be estimated"
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


@dataclass(frozen=True)
class Clock:
    """A joined stream's clock, which shows time * (1 + `drift`) + `offset` [s]."""

    recording: str
    stream: str  # name of the joined stream
    file: str  # file of the joined stream
    offset: float  # [s]
    low: float = float("nan")  # lower end of the offset's 95 % interval [s]
    high: float = float("nan")  # upper end of that interval [s]
    drift: float = 0.0  # relative drift; 0 if it is not significant
    drift_error: float = float("nan")  # standard error of the drift
    others: tuple[float, ...] = ()  # other offsets that fit about as well [s]
    why: str = ""  # reason why no offset was found; empty if one was

    @property
    def said(self) -> str:
        """The finding in one sentence."""
        clocks = f"the clock of {self.file}", f"that of recording {self.recording}"
        if self.why:
            return f"The offset between {clocks[0]} and {clocks[1]} was not found: {self.why}."
        runs = alike = ""
        if self.drift:
            runs = f" and runs faster by {1e6 * self.drift:.3g} ± {1.96e6 * self.drift_error:.2g} ppm"
        elif np.isfinite(self.drift_error):
            least = CLOCK_SEARCH.min_drift_standard_errors * 1e6 * self.drift_error
            runs = f"; a drift below {least:.2g} ppm would not be detected"
        if self.others:
            alike = ", ".join(f"{x:.2f} s" for x in self.others[:4]) + (" and more" if len(self.others) > 4 else "")
            alike = (
                f" The motion is periodic, and {alike} would fit equally well; the offset nearest to the first guess "
                "is used."
            )
        return (
            f"T{clocks[0][1:]} is {self.offset:.4f} s later than {clocks[1]} (95 % interval {self.low:.4f} to "
            f"{self.high:.4f} s){runs}: its channels were joined by that.{alike}"
        )

    @property
    def do(self) -> str:
        """The entry to write into study.toml, in a sentence."""
        if self.why:
            return f'Write offsets = {{ {self.stream} = "... s" }} at this recording.'
        return f'Write offsets = {{ {self.stream} = "{self.offset:.4f} s" }} at this recording to keep it.'


def clocks_to_find(recording: Recording, study: Study) -> tuple[str, ...]:
    """Return the joined streams of a recording whose offset study.toml does not state."""
    entry = study.config.entry_of(recording.name)
    if entry is None:
        return ()
    joined = [stream for stream in entry.streams if study.config.streams[stream].join]
    return tuple(s for s in joined if study.config.streams[s].offset == "auto" and s not in entry.offsets)


def find_clocks(study: Study) -> tuple[Clock, ...]:
    """Estimate every clock that study.toml leaves open, in every recording."""
    return tuple(clock for recording in study.recordings() for clock in _clocks_of(recording, study))


def require_clocks(study: Study) -> None:
    """Refuse recordings whose drive and position could not be brought onto one clock."""
    unknown = [f"{clock.said} {clock.do}" for clock in find_clocks(study) if clock.why]
    if unknown:
        raise RecordingError("\n".join(unknown))


def rejoin_streams(recording: Recording, study: Study) -> Recording:
    """Return a recording with its streams joined by the estimated clocks."""
    found = {clock.stream: (clock.offset, clock.drift) for clock in _clocks_of(recording, study) if not clock.why}
    kept = study.found.setdefault("rejoined", {})
    if found and recording.name not in kept:
        kept[recording.name] = study.rejoined(recording.name, found)
    return kept.get(recording.name, recording)


def _clocks_of(recording: Recording, study: Study) -> tuple[Clock, ...]:
    kept = study.found.setdefault("clocks", {})
    if recording.name not in kept:
        kept[recording.name] = tuple(
            _find_clock(recording, stream, study) for stream in clocks_to_find(recording, study)
        )
    return kept[recording.name]


def _find_clock(recording: Recording, name: str, study: Study) -> Clock:
    stream, apart = recording.streams[name], study.apart(recording.name)
    first, drift = initial_offset(apart, stream), study.config.streams[name].drift
    given = 0.0 if drift == "auto" else drift

    def unknown(why: str) -> Clock:
        return Clock(recording.name, name, stream.path.name, first, drift=given, why=why)

    assert study.rig.drive is not None  # without a drive no joint is identified
    # A positive delay means that the drive's file is late, or that the position's file is early.
    sense = 1.0 if any(channel in stream for channel in DRIVE_CHANNELS[study.rig.drive.kind]) else -1.0
    try:
        rough, left = _search_offsets(recording, apart, stream, first, sense, study)
        if not len(left) or left[0] > CLOCK_SEARCH.max_unexplained_share:
            return unknown("its drive does not explain the recorded motion")
        alike = rough[left < CLOCK_SEARCH.ambiguity_ratio * left[0]]
        # A periodic motion has several possible offsets; the one nearest to the first guess is chosen.
        offset, *others = alike[np.argsort(np.abs(alike - first), kind="stable")].tolist()
        found: Delay | None = None
        for _ in range(CLOCK_SEARCH.max_refinements):
            joined = study.rejoined(recording.name, {name: (offset, given)})
            found = _delay_of([joined], study, 1.0 / joined.fs)
            if found is None:
                return unknown("its motion does not show it")
            offset += sense * found.value
            if abs(found.value) < CLOCK_SEARCH.offset_tolerance_s:
                break
        assert found is not None  # there is at least one refinement
        low, high = sorted(offset + sense * (end - found.value) for end in (found.low, found.high))
        clock = Clock(recording.name, name, stream.path.name, offset, low, high, given, others=tuple(others))
        return _with_drift(clock, recording, sense, study) if drift == "auto" else clock
    except (PellucidError, np.linalg.LinAlgError) as error:
        return unknown(str(error))


def _search_offsets(
    recording: Recording, apart: Recording, stream: Recording, first: float, sense: float, study: Study
) -> tuple[np.ndarray, np.ndarray]:
    """Return offsets [s], accurate to some milliseconds, the best first, with the effort share each leaves
    unexplained."""
    model, made = simple_model(study), motions_of(thin_recordings([recording]), study)
    regressors, times = [], []
    for motion in made:
        kept = motion.kept
        regressors.append(model.jacobian(np.zeros(len(model.names)), motion)[1][kept])
        times.append(motion.time[kept])
    w, at = np.concatenate(regressors), np.concatenate(times)
    some = slice(None, None, max(len(at) // CLOCK_SEARCH.trial_sample_count, 1))
    source = stream if sense > 0.0 else apart
    command = command_of(source, study.rig)
    # The command is averaged over one step of the search, to remove noise faster than the motion.
    width = max(int(CLOCK_SEARCH.offset_step_s * source.fs), 1)
    smooth = np.convolve(command, np.ones(width) / width, mode="same")
    reach = min(CLOCK_SEARCH.max_offset_distance_s, max(np.ptp(apart.time), np.ptp(stream.time)))
    tried = np.arange(-reach, reach + CLOCK_SEARCH.offset_step_s, CLOCK_SEARCH.offset_step_s)
    start = first if sense > 0.0 else 0.0

    def effort(t: np.ndarray) -> np.ndarray:
        return np.interp(t, source.time, smooth, left=np.nan, right=np.nan)

    delays, left = find_likely_delays(w[some], effort, at[some] + start, tried)
    return first + sense * delays, left


def _delay_of(recordings: Sequence[Recording], study: Study, step: float, most: int = MAX_SAMPLES) -> Delay | None:
    """Estimate the drive's delay in recordings whose samples are a `step` [s] apart."""
    motions = motions_of(thin_recordings(recordings, most), study)
    back_emf = drive_model(study.rig).back_emf
    return estimate_drive_delay(simple_model(study), motions, back_emf, quantile=1.96, step=step)


def _with_drift(clock: Clock, recording: Recording, sense: float, study: Study) -> Clock:
    """Return the clock with its drift, estimated from both halves of the recording."""
    from ...numerics.clocks import Alignment, clock_drift  # imported late, because it loads SciPy's optimisers

    whole = study.rejoined(recording.name, {clock.stream: (clock.offset, 0.0)})
    n, halves = len(whole), []
    for first, stop in ((0, n // 2), (n // 2, n)):
        half = recording_part(whole, first, stop)
        found = _delay_of([half], study, 1.0 / half.fs)
        if found is None:
            return clock
        at = 0.5 * float(whole.time[first] + whole.time[stop - 1])
        halves.append(Alignment(sense * found.value, found.error, 1.0, 0.0, 1.0, at))
    drift, error = clock_drift(*halves)
    if abs(drift) <= CLOCK_SEARCH.min_drift_standard_errors * error:
        return replace(clock, drift_error=error)
    # The offset refers to time zero, while the estimates refer to the middle of each half.
    at = 0.5 * float(whole.time[0] + whole.time[-1])
    moved = -drift * at + 0.5 * (halves[0].delay + halves[1].delay)
    ends = {key: getattr(clock, key) + moved for key in ("offset", "low", "high")}
    return replace(clock, **ends, drift=drift, drift_error=error)


MIN_DELAY_DIFFERENCE_SHARE = 0.25
"""Two recordings have different delays only if these certainly differ by more than this share. Friction errors shift
each estimate a little."""


@dataclass(frozen=True)
class Alignment:
    """Estimated delay of a drive, and its correction."""

    channel: str  # channel of the drive
    delay: Delay | None  # estimated delay; None if the recordings do not determine it
    moved: float  # time by which the channel was shifted [s]; 0 if it was not
    asked: bool  # whether study.toml asks for an estimate
    recording: str = ""  # recording concerned; empty for all recordings
    step: float = 0.0  # sampling period [s]

    @property
    def is_within_period(self) -> bool:
        """Whether the channel was moved by at most a sampling period, as where an effort is held between samples."""
        return 0.0 < abs(self.moved) <= self.step

    @property
    def said(self) -> str:
        """The finding in one sentence; empty if there is none."""
        d, where = self.delay, f" in recording {self.recording}" if self.recording else ""
        if d is None:
            what = f"The delay of {self.channel} relative to position is not identifiable from these recordings."
            return what if self.asked else ""
        interval = f"95 % interval {1e3 * d.low:.3g} to {1e3 * d.high:.3g} ms"
        if d.doubt:
            return (
                f"A shift of {self.channel} by {1e3 * d.value:.3g} ms{where} would fit better ({interval}), but "
                f"{d.doubt}. The recordings do not prove a delay, and the channel was not shifted."
            )
        if not (self.moved or self.recording):
            said = f"The recordings do not prove a delay of {self.channel} relative to position ({interval})."
            return said if self.asked else ""
        uncorrected = "it was not corrected in held-out recordings"
        if d.lag:
            done = "it was corrected before the fit" if self.moved else uncorrected
            return (
                f"{self.channel} has the lag of a first-order filter{where}, with a time constant of "
                f"{1e3 * d.value:.3g} ms ({interval}), rather than a pure delay; {done}."
            )
        done = f"{self.channel} was shifted before the fit" if self.moved else uncorrected
        first, second = (self.channel, "position") if d.value > 0.0 else ("position", self.channel)
        return (
            f"{first} is delayed by {1e3 * abs(d.value):.3g} ms{where} relative to {second} ({interval} for "
            f"{self.channel}); {done}."
        )

    @property
    def do(self) -> str:
        """The entry to write into study.toml, in a sentence."""
        if self.delay is None or self.delay.doubt or not (self.moved or self.recording):
            return ""
        key = f'{"lag" if self.delay.lag else "delay"} = "{1e3 * self.delay.value:.3g} ms"'
        if self.recording:
            keep = f"channels.{self.channel} = {{ {key} }} at this recording to "
        else:
            keep = f"{self.channel} = {{ {key} }} in [channels] to "
        return f"Write {keep}" + (
            'keep it, or delay = "0 s" to use the channel as recorded.' if self.moved else "move it."
        )


def aligned_motions(study: Study, use: str | None = None) -> tuple[Motion, ...]:
    """Return the motion of every uncut stretch with the drive enabled, aligned with the drive, filtered and
    differentiated."""
    return motions_of(align_recordings(study, use), study)


def align_recordings(study: Study, use: str | None = None) -> list[Recording]:
    """Return a study's recordings with joined streams on one clock and the drive's delay corrected."""
    return [_align(rejoin_streams(r, study), study) for r in study.recordings(use)]


def find_alignments(study: Study) -> tuple[Alignment, ...]:
    """Estimate the drive's delay against the encoder; return nothing if study.toml states it.

    There is one delay for all fitted recordings. If they contradict each other, each late recording has its own. A
    held-out recording with a different delay is reported too, and decides nothing.
    """
    if "alignments" not in study.found:
        study.found["alignments"] = tuple(_estimate_alignments(study))
    return study.found["alignments"]


def _align(recording: Recording, study: Study) -> Recording:
    found = {a.recording: a for a in find_alignments(study) if a.moved} if _has_open_delay(recording, study) else {}
    late = found.get(recording.name, found.get(""))
    if late is None or late.delay is None:
        return recording
    return (undo_lags if late.delay.lag else shift_channels)(recording, {late.channel: late.moved})


def _has_open_delay(recording: Recording, study: Study) -> bool:
    """Return whether a recording's delay is to be estimated, because study.toml states none."""
    spec = study.specs_of(recording).get(drive_channel(recording, study) or "")
    given = spec is None or isinstance(spec.delay, float) or spec.lag is not None
    return not given and not clocks_to_find(recording, study)


def _estimate_alignments(study: Study) -> Iterator[Alignment]:
    every = [
        r
        for r in study.recordings()
        if "position" in r and _has_open_delay(r, study) and not carries_unknown_payload(r)
    ]
    fitted, judged = ([r for r in every if r.use == use] for use in ("fit", "validate"))
    # A wearer's torque leads or follows the motion; nothing of that is a drive's delay.
    if not fitted or is_worn(study):
        return
    channel = drive_channel(fitted[0], study)
    assert channel is not None  # a recording without the drive's command is refused before
    asked = any(study.specs_of(r)[channel].delay == "auto" for r in fitted if channel in r)
    step = max(1.0 / r.fs for r in fitted)
    pooled = _estimate_delay(fitted, study, step)
    alone = fitted if len(fitted) > 1 else []
    each = {r.name: _estimate_delay([r], study, step, MAX_SAMPLES // len(fitted)) for r in alone}
    each |= {r.name: _estimate_delay([r], study, 1.0 / r.fs, MAX_SAMPLES // len(every)) for r in judged}
    own = {r.name: d for r in fitted if (d := each.get(r.name)) is not None}
    late = {name: d for name, d in own.items() if d.clear(step)}

    def apart(one: Delay, value: float) -> bool:
        return abs(one.beyond(value)) > max(step, MIN_DELAY_DIFFERENCE_SHARE * abs(value))

    if any(apart(other, d.value) for d in late.values() for other in own.values()):
        yield from (Alignment(channel, d, d.value, asked, name) for name, d in late.items())
        by = 0.0
    else:
        by = 0.0
        if pooled is not None and not pooled.doubt and (pooled.clear(step) or (asked and pooled.beyond(0.0) != 0.0)):
            by = pooled.value
        yield Alignment(channel, pooled, by, asked, step=step)
    for r in judged:
        d = each.get(r.name)
        if d is not None and d.clear(1.0 / r.fs) and apart(d, by):
            yield Alignment(channel, d, 0.0, asked, r.name)


def _estimate_delay(
    recordings: Sequence[Recording], study: Study, step: float, most: int = MAX_SAMPLES
) -> Delay | None:
    try:
        return _delay_of(recordings, study, step, most)
    except (PellucidError, np.linalg.LinAlgError):
        return None  # the fit that follows reports the error
