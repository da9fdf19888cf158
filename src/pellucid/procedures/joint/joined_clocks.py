"""How a joined instrument's clock lies against the recording's: found from what the drive does to the joint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._errors import PellucidError, RecordingError
from ...fit.delay import Delay, find_likely_delays
from ...fit.joint.drive_delay import estimate_drive_delay
from ...recordings.delay import recording_part
from ...recordings.joined_stream import initial_offset
from ...recordings.quality import DRIVE_CHANNELS
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...signals.effort import command_of, drive_model
from .first_look import simple_model, some_of
from .recorded_motions import motions_of

FARTHEST = 60.0
"""Offsets are looked for up to here from the first guess [s]."""

STEP = 0.01
"""Offsets that are tried lie so far apart [s]: joints swing slower than ten times a second."""

SURER = 1.2
"""By how much more another offset must leave unexplained, or it fits alike."""

UNLIKE = 0.5
"""Share of the effort that no offset may leave unexplained."""

ROWS = 1500
"""Samples with which offsets are tried."""

SURE = 4.0
"""Standard errors by which a drift is off zero before it is used."""

SETTLED, NEAR = 3, 1e-4
"""Times that an offset is found anew from where it was found last, unless it was so near [s]."""


@dataclass(frozen=True)
class Clock:
    """A joined stream's clock: it shows time * (1 + `drift`) + `offset` [s]; the interval holds the offset [s]; `why`
    is why it was not found."""

    recording: str
    stream: str
    file: str
    offset: float
    low: float = float("nan")
    high: float = float("nan")
    drift: float = 0.0
    drift_error: float = float("nan")
    others: tuple[float, ...] = ()  # Offsets that fit alike [s]
    why: str = ""

    @property
    def said(self) -> str:
        """One sentence."""
        clocks = f"the clock of {self.file}", f"that of recording {self.recording}"
        if self.why:
            return f"How {clocks[0]} lies against {clocks[1]} was not found: {self.why}."
        runs = alike = ""
        if self.drift:
            runs = f" and runs faster by {1e6 * self.drift:.3g} ± {1.96e6 * self.drift_error:.2g} millionths"
        elif np.isfinite(self.drift_error):
            runs = f"; a drift below {SURE * 1e6 * self.drift_error:.2g} millionths would not show"
        if self.others:
            alike = ", ".join(f"{x:.2f} s" for x in self.others[:4]) + (" and more" if len(self.others) > 4 else "")
            alike = (
                f" The motion repeats itself, and {alike} would fit alike: the nearest to the first guess was taken."
            )
        return (
            f"T{clocks[0][1:]} is {self.offset:.4f} s later than {clocks[1]} (95 % interval {self.low:.4f} to "
            f"{self.high:.4f} s){runs}: its channels were joined by that.{alike}"
        )

    @property
    def do(self) -> str:
        """What to write."""
        if self.why:
            return f'Write offsets = {{ {self.stream} = "... s" }} at this recording.'
        return f'Write offsets = {{ {self.stream} = "{self.offset:.4f} s" }} at this recording to keep it.'


def clocks_to_find(recording: Recording, study: Study) -> tuple[str, ...]:
    """Joined streams of a recording whose offset study.toml leaves open."""
    entry = study.config.entry_of(recording.name)
    tables = study.config.streams
    return tuple(
        stream
        for stream in (entry.streams if entry is not None else ())
        if tables[stream].join and tables[stream].offset == "auto" and stream not in entry.offsets
    )


def clocks(study: Study) -> tuple[Clock, ...]:
    """Every clock that was to be found, of every recording."""
    return tuple(clock for recording in study.recordings() for clock in _clocks_of(recording, study))


def require_clocks(study: Study) -> None:
    """Refuse recordings whose drive cannot be brought together with their position."""
    unknown = [f"{clock.said} {clock.do}" for clock in clocks(study) if clock.why]
    if unknown:
        raise RecordingError("\n".join(unknown))


def rejoined(recording: Recording, study: Study) -> Recording:
    """A recording with its streams joined by the clocks that were found."""
    found = {clock.stream: (clock.offset, clock.drift) for clock in _clocks_of(recording, study) if not clock.why}
    kept = study.found.setdefault("rejoined", {})
    if found and recording.name not in kept:
        kept[recording.name] = study.rejoined(recording.name, found)
    return kept.get(recording.name, recording)


def _clocks_of(recording: Recording, study: Study) -> tuple[Clock, ...]:
    kept = study.found.setdefault("clocks", {})
    if recording.name not in kept:
        kept[recording.name] = tuple(_clock(recording, stream, study) for stream in clocks_to_find(recording, study))
    return kept[recording.name]


def _clock(recording: Recording, name: str, study: Study) -> Clock:
    stream, apart = recording.streams[name], study.apart(recording.name)
    first, drift = initial_offset(apart, stream), study.config.streams[name].drift
    given = 0.0 if drift == "auto" else drift

    def unknown(why: str) -> Clock:
        return Clock(recording.name, name, stream.path.name, first, drift=given, why=why)

    drives = DRIVE_CHANNELS[study.rig.drive.kind]
    # The drive's file is late by what is found; the position's is early by it.
    sense = 1.0 if any(channel in stream for channel in drives) else -1.0
    try:
        rough, left = _roughly(recording, apart, stream, first, sense, study)
        if not len(left) or left[0] > UNLIKE:
            return unknown("its drive explains no motion that was recorded")
        alike = rough[left < SURER * left[0]]
        # Of swings that are all the same, the one for which the loggers were started together.
        offset, *others = alike[np.argsort(np.abs(alike - first), kind="stable")].tolist()
        for _ in range(SETTLED):
            found = _delay(study.rejoined(recording.name, {name: (offset, given)}), study)
            if found is None:
                return unknown("its motion does not show it")
            offset += sense * found.value
            if abs(found.value) < NEAR:
                break
        low, high = sorted(offset + sense * (end - found.value) for end in (found.low, found.high))
        found = Clock(recording.name, name, stream.path.name, offset, low, high, given, others=tuple(others))
        return _drifting(found, recording, sense, study) if drift == "auto" else found
    except (PellucidError, np.linalg.LinAlgError) as error:
        return unknown(str(error))


def _roughly(
    recording: Recording, apart: Recording, stream: Recording, first: float, sense: float, study: Study
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets [s] to some milliseconds, the likeliest first, and the share of the effort that each leaves."""
    model, made = simple_model(study), motions_of(some_of([recording]), study)
    regressors, times = [], []
    for motion in made:
        kept = motion.kept
        regressors.append(model.jacobian(np.zeros(len(model.names)), motion)[1][kept])
        times.append(motion.time[kept])
    w, at = np.concatenate(regressors), np.concatenate(times)
    some = slice(None, None, max(len(at) // ROWS, 1))
    source = stream if sense > 0.0 else apart
    command = command_of(source, study.rig)
    # Noise beyond the motion would only blur it: a step's mean is enough.
    width = max(int(STEP * source.fs), 1)
    smooth = np.convolve(command, np.ones(width) / width, mode="same")
    reach = min(FARTHEST, max(np.ptp(apart.time), np.ptp(stream.time)))
    tried = np.arange(-reach, reach + STEP, STEP)
    start = first if sense > 0.0 else 0.0

    def effort(t: np.ndarray) -> np.ndarray:
        return np.interp(t, source.time, smooth, left=np.nan, right=np.nan)

    delays, left = find_likely_delays(w[some], effort, at[some] + start, tried)
    return first + sense * delays, left


def _delay(recording: Recording, study: Study) -> Delay | None:
    drive = drive_model(study.rig)
    return estimate_drive_delay(
        simple_model(study),
        motions_of(some_of([recording]), study),
        drive.back_emf,
        quantile=1.96,
        step=1.0 / recording.fs,
    )


def _drifting(clock: Clock, recording: Recording, sense: float, study: Study) -> Clock:
    """The same with its drift, from both halves of the recording."""
    from ...signals.clocks import Alignment, clock_drift  # with SciPy's optimisers: only where files were joined

    whole = study.rejoined(recording.name, {clock.stream: (clock.offset, 0.0)})
    n, halves = len(whole), []
    for first, stop in ((0, n // 2), (n // 2, n)):
        found = _delay(recording_part(whole, first, stop), study)
        if found is None:
            return clock
        at = 0.5 * float(whole.time[first] + whole.time[stop - 1])
        halves.append(Alignment(sense * found.value, found.error, 1.0, 0.0, 1.0, at))
    drift, error = clock_drift(*halves)
    if abs(drift) <= SURE * error:
        return replace(clock, drift_error=error)
    # The offset is the clock's at time zero; what was found is that of the middle.
    at = 0.5 * float(whole.time[0] + whole.time[-1])
    moved = -drift * at + 0.5 * (halves[0].delay + halves[1].delay)
    ends = {key: getattr(clock, key) + moved for key in ("offset", "low", "high")}
    return replace(clock, **ends, drift=drift, drift_error=error)
