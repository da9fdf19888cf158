"""A study's motions after correction of the delay between drive and encoder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError
from ...files.delay import shift_channels, undo_lags
from ...files.recording import Recording
from ...numerics.delay import Delay
from ...numerics.motion import Motion
from ...study.recorded_motions import carries_unknown_payload, drive_model, motions_of
from ...study.study import Study, drive_channel
from ..fit.drive_delay import estimate_drive_delay
from .joined_clocks import MAX_SAMPLES, clocks_to_find, rejoin_streams, simple_model, thin_recordings
from .joint_case import is_worn

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

    @property
    def said(self) -> str:
        """The finding in one sentence; empty if there is none."""
        d, where = self.delay, f" in recording {self.recording}" if self.recording else ""
        if d is None:
            what = f"The delay of {self.channel} against position was not found: nothing in these recordings shows it."
            return what if self.asked else ""
        interval = f"95 % interval {1e3 * d.low:.3g} to {1e3 * d.high:.3g} ms"
        if d.doubt:
            return (
                f"A shift of {self.channel} by {1e3 * d.value:.3g} ms{where} would fit better ({interval}), but "
                f"{d.doubt}: it is no delay that these recordings show, and nothing was moved."
            )
        if not (self.moved or self.recording):
            return f"No delay of {self.channel} against position is certain ({interval})." if self.asked else ""
        first, second = (self.channel, "position") if d.value > 0.0 else ("position", self.channel)
        if d.lag:
            done = "this was undone before anything else" if self.moved else "it is held out and stays so"
            return (
                f"{self.channel} lags{where} behind what moves the joint, as a filter with a time constant of "
                f"{1e3 * d.value:.3g} ms does ({interval}), which is no mere delay: {done}."
            )
        done = f"{self.channel} was moved by that before anything else" if self.moved else "it is held out and stays so"
        return (
            f"{first} comes {1e3 * abs(d.value):.3g} ms late{where}, against {second} ({interval} for {self.channel}): "
            f"{done}."
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
    if late is None:
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
        certain = pooled is not None and (pooled.clear(step) or (asked and pooled.beyond(0.0) != 0.0))
        certain = certain and not pooled.doubt
        by = pooled.value if certain else 0.0
        yield Alignment(channel, pooled, by, asked)
    for r in judged:
        d = each.get(r.name)
        if d is not None and d.clear(1.0 / r.fs) and apart(d, by):
            yield Alignment(channel, d, 0.0, asked, r.name)


def _estimate_delay(
    recordings: Sequence[Recording], study: Study, step: float, most: int = MAX_SAMPLES
) -> Delay | None:
    back_emf = drive_model(study.rig).back_emf
    try:
        made = motions_of(thin_recordings(recordings, most), study)
        return estimate_drive_delay(simple_model(study), made, back_emf, quantile=1.96, step=step)
    except (PellucidError, np.linalg.LinAlgError):
        return None  # the fit that follows reports the error
