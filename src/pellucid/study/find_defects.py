"""Search a recording for each kind of defect in turn, and cut out what is found."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING

from ..files.cut import BRIDGED_LOWPASS_PERIODS, Cut
from ..files.defects import clipped, dropouts, frozen, gaps, missing, sensor_range, silent, spikes
from ..files.defects.watched import WatchedRecording
from ..files.recording import Recording
from .drive_channel import command_channel

if TYPE_CHECKING:
    from .study_file import ChannelSpec, JointTable, Processing, StudyFile

KINDS: tuple[ModuleType, ...] = (missing, gaps, silent, dropouts, spikes, sensor_range, clipped, frozen)
"""Modules that find one kind of defect each, with ``KIND`` and ``find(watched)``. A later module does not see the
samples that an earlier one has cut. Other defects are no stretch of a channel: rows of garbage, another clock, a
constant, echoed or worn recording. `recording_steps`, the procedures and `files.log` search for them."""

SIGNAL_KINDS: tuple[ModuleType, ...] = (dropouts, spikes)
"""Modules that search when every procedure of the study bridges missing samples by itself."""

MAX_CLIPPED_SHARE = 0.02
"""At most this share of a recording's samples may be clipped. More of them are part of the motion, not a disturbance.
Chosen by judgement; no measurement is recorded."""


def watched_part(
    recording: Recording,
    config: StudyFile,
    specs: Mapping[str, ChannelSpec],
    processing: Processing,
    *,
    stream: str = "",
) -> WatchedRecording:
    """Return the part of a recording, or of one of its streams, that the procedures of a study read."""
    own = regressed_joints(config) if not stream or config.streams[stream].join else ()
    names: set[str] = set()
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
            # The drive itself sets a duty: at its largest value it gave just that, and no sensor ended there.
            accepted |= {drive} if drive.partition(".")[0] == "duty" else set()
    regressed = names & set(recording.channels)
    names |= {n for n in recording.channels for t in config.procedures.values() if t.reads(n, stream)}
    bridged = max_bridged_gap(processing, recording.fs) if processing.resample is not None else 0.0
    readers = [t for t in config.procedures.values() if any(t.reads(n, stream) for n in recording.channels)]
    if readers and not own:
        bridged = max(bridged, min(table.max_interpolated_gap(stream, names) for table in readers))
    return WatchedRecording(
        recording,
        tuple(n for n in recording.channels if n in names and n != "time"),
        drives,
        limits,
        frozenset(accepted),
        bridged,
        regressed=frozenset(regressed),
    )


def regressed_joints(config: StudyFile) -> tuple[JointTable, ...]:
    """Return the joints whose position and drive command a regression reads; () if no procedure regresses."""
    joints, tables = config.rig.joints, config.procedures.values()
    if any(joint.drive is None for joint in joints):
        return ()
    if any(table.several for table in tables):
        return tuple(joints)
    return tuple(joints) if len(joints) == 1 and not any(table.alone for table in tables) else ()


def max_bridged_gap(processing: Processing, fs: float) -> float:
    """Return the longest gap [s] over which interpolation loses nothing that the filter would keep; `fs` [Hz]."""
    return BRIDGED_LOWPASS_PERIODS / processing.lowpass if processing.lowpass else 3.0 / fs


def needed_kinds(config: StudyFile) -> tuple[ModuleType, ...]:
    """Return the modules that find the defects which matter to a study."""
    needs_all = bool(regressed_joints(config)) or any(not table.bridges for table in config.procedures.values())
    return KINDS if needs_all else SIGNAL_KINDS


def find_defects(watched: WatchedRecording, which: tuple[ModuleType, ...] = KINDS) -> list[Cut]:
    """Return a cut for every defect that the modules `which` find, in order of time."""
    cuts: list[Cut] = []
    for kind in which:
        found = list(kind.find(watched))
        # One cause gives one cut: a clipped signal also rests.
        watched = watched.without(found)
        if kind is not clipped or sum(cut.samples for cut in found) <= MAX_CLIPPED_SHARE * len(watched.recording):
            cuts += found
    return sorted(cuts, key=lambda cut: (cut.first, cut.last))


def find_cuts(
    recording: Recording,
    config: StudyFile,
    specs: Mapping[str, ChannelSpec],
    processing: Processing,
    *,
    stream: str = "",
) -> tuple[Cut, ...]:
    """Return the automatic cuts of a recording, or of one of its streams; none if its time is unfit."""
    if processing.cut == "none" or len(recording) < 2 or not recording.advances:
        return ()
    watched = watched_part(recording, config, specs, processing, stream=stream)
    return tuple(find_defects(watched, needed_kinds(config))) if watched.channels else ()
