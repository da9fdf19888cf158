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
    from ..study_file import ChannelSpec, JointTable, Processing, StudyFile

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
    own = read_joints(config) if not stream or config.streams[stream].join else ()
    names = {n for n in recording.channels for t in config.procedures.values() if t.reads(n, stream)}
    accepted = {name for name, spec in specs.items() if spec.clip == "accept"}
    drives, limits = {}, {}
    for joint in own:
        ending = f".{joint.joint}" if len(own) > 1 else ""
        places = (f"position{ending}", f"motor_position{ending}")
        position = next((name for name in places if name in recording), places[0])
        drive = command_channel(recording, joint.drive.kind, ending)
        names |= {position, drive or position} | ({f"supply{ending}"} if drive == f"duty{ending}" else set())
        names |= {f"velocity{ending}"} if processing.velocity == "recorded" else set()
        known = [joint.drive.limit]
        if joint.loop is not None:
            injected = f"{joint.loop.injected}{ending}" if joint.loop.injected else f"reference{ending}"
            names |= {f"reference{ending}", injected}
            accepted |= {injected} if joint.loop.injected else set()
            known.append(joint.loop.limit)
        if drive is not None:
            drives[position] = drive
            limits[drive] = tuple(limit for limit in known if limit is not None)
    return Watched(
        recording,
        tuple(n for n in recording.channels if n in names and n != "time"),
        drives,
        limits,
        frozenset(accepted),
        bridgeable(processing, recording.fs) if processing.resample is not None else 0.0,
    )


def read_joints(config: StudyFile) -> tuple[JointTable, ...]:
    """Joints whose position and drive's command are read, by a regression over its samples."""
    joints, tables = config.rig.joints, config.procedures.values()
    if any(joint.drive is None for joint in joints):
        return ()
    if any(table.several for table in tables):
        return tuple(joints)
    return tuple(joints) if len(joints) == 1 and not any(table.alone for table in tables) else ()


def bridgeable(processing: Processing, fs: float) -> float:
    """Longest stretch [s] without samples over which interpolation loses nothing the filter would keep; `fs` [Hz]."""
    return 0.5 / processing.lowpass if processing.lowpass else 3.0 / fs


def kinds(config: StudyFile) -> tuple[ModuleType, ...]:
    """What is to be looked for in the recordings of a study."""
    every = bool(read_joints(config)) or any(not table.bridges for table in config.procedures.values())
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
