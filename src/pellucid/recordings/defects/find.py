"""Every kind of defect looked for in a recording, one after the other, and cut out."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING

from ..cut import Cut
from ..drive_channel import command_channel
from ..recording import Recording
from . import clipped, dropouts, frozen, gaps, missing, spikes
from .watched import Watched

if TYPE_CHECKING:
    from ..study_file import ChannelSpec, Processing, StudyFile

KINDS: tuple[ModuleType, ...] = (missing, gaps, dropouts, spikes, clipped, frozen)
"""Each has ``KIND`` and ``find(watched)``; those that come later see nothing of what was found before."""

OF_A_SIGNAL: tuple[ModuleType, ...] = (dropouts, spikes)
"""What is looked for where a procedure bridges what is missing by itself."""

MOST_CLIPPED = 0.02
"""Share of a recording's samples that may be clipped; more are not noise on top of a motion but a part of it."""


def watched(
    recording: Recording,
    config: StudyFile,
    specs: Mapping[str, ChannelSpec],
    processing: Processing,
    stream: str = "",
) -> Watched:
    """What the procedures of a study read of a recording, or of one of its streams."""
    rig = config.rig.joints[0] if len(config.rig.joints) == 1 else None
    own = reads_joint(config) and (not stream or config.streams[stream].join)
    drive = command_channel(recording, rig.drive.kind) if own else None
    names = {n for n in recording.channels for t in config.procedures.values() if t.reads(n, stream)}
    limits: list[float | None] = []
    if own:
        loop = rig.loop
        names |= {"position", drive or "position"} | ({"supply"} if drive == "duty" else set())
        names |= {"velocity"} if processing.velocity == "recorded" else set()
        names |= {"reference", loop.injected or "reference"} if loop is not None else set()
        limits = [rig.drive.limit, loop.limit if loop else None]
    accepted = {name for name, spec in specs.items() if spec.clip == "accept"}
    if own and rig.loop is not None and rig.loop.injected:
        accepted.add(rig.loop.injected)
    return Watched(
        recording,
        tuple(n for n in recording.channels if n in names and n != "time"),
        drive,
        tuple(limit for limit in limits if limit is not None),
        frozenset(accepted),
        bridgeable(processing, recording.fs) if processing.resample is not None else 0.0,
    )


def reads_joint(config: StudyFile) -> bool:
    """Whether the position and the drive's command of a joint are read, by a regression over its samples."""
    alone = any(table.alone for table in config.procedures.values())
    return not alone and len(config.rig.joints) == 1 and config.rig.joints[0].drive is not None


def bridgeable(processing: Processing, fs: float) -> float:
    """Longest stretch [s] without samples over which interpolation loses nothing the filter would keep; `fs` [Hz]."""
    return 0.5 / processing.lowpass if processing.lowpass else 3.0 / fs


def kinds(config: StudyFile) -> tuple[ModuleType, ...]:
    """What is to be looked for in the recordings of a study."""
    every = reads_joint(config) or any(not table.bridges for table in config.procedures.values())
    return KINDS if every else OF_A_SIGNAL


def find(looked: Watched, which: tuple[ModuleType, ...] = KINDS) -> list[Cut]:
    """Every defect of the kinds named."""
    cuts: list[Cut] = []
    for kind in which:
        found = list(kind.find(looked))
        # One cause is told once: what is clipped rests too.
        looked = looked.without(found)
        if kind is not clipped or sum(cut.samples for cut in found) <= MOST_CLIPPED * len(looked.recording):
            cuts += found
    return sorted(cuts, key=lambda cut: (cut.first, cut.last))


def cut_out(
    recording: Recording,
    config: StudyFile,
    specs: Mapping[str, ChannelSpec],
    processing: Processing,
    stream: str = "",
) -> tuple[Cut, ...]:
    """What is cut out of a recording, or of one of its streams, without being asked; nothing where time is unfit."""
    if processing.cut == "none" or len(recording) < 2 or not recording.advances:
        return ()
    looked = watched(recording, config, specs, processing, stream)
    return tuple(find(looked, kinds(config))) if looked.channels else ()
