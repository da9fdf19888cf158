"""A study's motions with its drive where it belongs: recorded late against the encoder, it is moved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError
from ...fit.delay import Delay
from ...fit.joint.drive_delay import estimate_drive_delay
from ...recordings.delay import shift_channels, undo_lags
from ...recordings.drive_channel import drive_channel
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...signals.effort import drive_model
from ...signals.motion import Motion
from .first_look import MOST, simple_model, some_of
from .joined_clocks import clocks_to_find, rejoined
from .recorded_motions import motions_of

CONTRADICTS = 0.25
"""Share of a delay by which another recording's must certainly differ before they are not one: what friction models
lack moves each a little."""


@dataclass(frozen=True)
class Alignment:
    """What was found of a drive's delay, of one recording or, without a name, of all: `moved` [s] is by how much its
    channel was moved; `asked` in study.toml."""

    channel: str
    delay: Delay | None
    moved: float
    asked: bool
    recording: str = ""

    @property
    def said(self) -> str:
        """One sentence; empty where there is nothing to tell."""
        d, where = self.delay, f" in recording {self.recording}" if self.recording else ""
        if d is None:
            what = f"The delay of {self.channel} against position was not found: nothing in these recordings shows it."
            return what if self.asked else ""
        interval = f"95 % interval {1e3 * d.low:.3g} to {1e3 * d.high:.3g} ms"
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
        """What to write."""
        if self.delay is None or not (self.moved or self.recording):
            return ""
        key = f'{"lag" if self.delay.lag else "delay"} = "{1e3 * self.delay.value:.3g} ms"'
        if self.recording:
            keep = f"channels.{self.channel} = {{ {key} }} at this recording to "
        else:
            keep = f"{self.channel} = {{ {key} }} in [channels] to "
        return f"Write {keep}" + (
            'keep it, or delay = "0 s" to use the channel as recorded.' if self.moved else "move it."
        )


def motions(study: Study, use: str | None = None) -> tuple[Motion, ...]:
    """Every stretch of every recording of a study in which nothing was cut out and the drive was enabled, its drive
    moved to where it belongs, filtered and differentiated."""
    return motions_of(aligned(study, use), study)


def aligned(study: Study, use: str | None = None) -> list[Recording]:
    """A study's recordings with their streams joined by the clocks found, and the drive where it belongs."""
    return [_aligned(rejoined(r, study), study) for r in study.recordings(use)]


def alignments(study: Study) -> tuple[Alignment, ...]:
    """The drive's delay against the encoder, from the fitted recordings: one for all, or, where they contradict each
    other, of each that is late; and of each held out that is late by itself. Empty where study.toml states them."""
    if "alignments" not in study.found:
        study.found["alignments"] = tuple(_alignments(study))
    return study.found["alignments"]


def _aligned(recording: Recording, study: Study) -> Recording:
    found = {a.recording: a for a in alignments(study) if a.moved} if _open(recording, study) else {}
    late = found.get(recording.name, found.get(""))
    if late is None:
        return recording
    return (undo_lags if late.delay.lag else shift_channels)(recording, {late.channel: late.moved})


def _open(recording: Recording, study: Study) -> bool:
    """Whether a recording's delay is to be estimated: study.toml gives none."""
    spec = study.specs_of(recording).get(drive_channel(recording, study) or "")
    given = spec is None or isinstance(spec.delay, float) or spec.lag is not None
    return not given and not clocks_to_find(recording, study)


def _alignments(study: Study) -> Iterator[Alignment]:
    every = [r for r in study.recordings() if "position" in r and _open(r, study)]
    fitted = [r for r in every if r.use == "fit"]
    if not fitted:
        return
    channel = drive_channel(fitted[0], study)
    asked = any(study.specs_of(r)[channel].delay == "auto" for r in fitted if channel in r)
    step = max(1.0 / r.fs for r in every)
    pooled = _estimated(fitted, study, step)
    alone = every if len(fitted) > 1 else [r for r in every if r.use != "fit"]
    each = {r.name: _estimated([r], study, step, MOST // len(every)) for r in alone}
    own = {r.name: d for r in fitted if (d := each.get(r.name)) is not None}
    late = {name: d for name, d in own.items() if d.clear(step)}

    def apart(one: Delay, value: float) -> bool:
        return abs(one.beyond(value)) > max(step, CONTRADICTS * abs(value))

    if any(apart(other, d.value) for d in late.values() for other in own.values()):
        yield from (Alignment(channel, d, d.value, asked, name) for name, d in late.items())
        by = 0.0
    else:
        certain = pooled is not None and (pooled.clear(step) or (asked and pooled.beyond(0.0) != 0.0))
        by = pooled.value if certain else 0.0
        yield Alignment(channel, pooled, by, asked)
    for r in every:
        d = each.get(r.name)
        if r.use != "fit" and d is not None and d.clear(step) and apart(d, by):
            yield Alignment(channel, d, 0.0, asked, r.name)


def _estimated(recordings: Sequence[Recording], study: Study, step: float, most: int = MOST) -> Delay | None:
    back_emf = drive_model(study.rig).back_emf
    try:
        made = motions_of(some_of(recordings, most), study)
        return estimate_drive_delay(simple_model(study), made, back_emf, quantile=1.96, step=step)
    except (PellucidError, np.linalg.LinAlgError):
        return None  # what is wrong with them is told by those who fit
