"""A study of several joints as a study of each: one joint's channels under the names that a single joint's have.

What is done with one joint is thereby done by the same code, whether its study names others or not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ...study.study import Study
from ...study.study_file import JOINT_CHANNELS, ChannelSpec, Processing, RecordingEntry, RigJoint, Stream, StudyFile
from ...study.study_place import KeptRecordings


def joint_views(study: Study) -> Mapping[str, Study]:
    """Return a study of each joint, by its name; their own names are ``<study>.<joint>``.

    Each reads its own channels of the files and has its own cuts, since what is cut out depends on the joint.
    """
    key = ("joint_views", study.left_out)
    if key not in study.found:
        study.found[key] = {joint.name: _view(study, joint) for joint in _joints(study.config)}
    return study.found[key]


def _joints(config: StudyFile) -> tuple[RigJoint, ...]:
    return tuple(joint for joint in config.rig.joints if isinstance(joint, RigJoint))


def _view(study: Study, joint: RigJoint) -> Study:
    kept = KeptRecordings(digests=study.kept.digests)
    return replace(study, config=_config_of(study.config, joint), kept=kept, found={})


def _config_of(config: StudyFile, joint: RigJoint) -> StudyFile:
    """Return what study.toml would say of one joint alone."""
    streams = {name: _stream_of(stream, config, joint) for name, stream in config.streams.items()}
    # A joined stream that holds only other joints would have to be set in time by nothing.
    streams = {name: stream for name, stream in streams.items() if not stream.join or set(stream.channels) > {"time"}}
    slides = joint.motion == "prismatic"
    return config.model_copy(
        update={
            "name": f"{config.name}.{joint.joint}",
            "rig": joint,
            "channels": _channels_of(config.channels, config, joint),
            "streams": streams,
            "processing": _processing_of(config.processing, joint),
            "model": config.model.model_copy(update={"gravity": "none"}) if slides else config.model,
            "recordings": tuple(_entry_of(entry, config, joint, streams) for entry in config.recordings),
        }
    )


def _channels_of(channels: Mapping[str, ChannelSpec], config: StudyFile, joint: RigJoint) -> dict[str, ChannelSpec]:
    """Return channels without those of other joints; the joint's own ones lose its name."""
    made = {}
    for name, spec in channels.items():
        head, _, last = name.rpartition(".")
        owner = next((other for other in _joints(config) if other.name == last), None)
        if owner is None or not (head in JOINT_CHANNELS or (owner.loop is not None and head == owner.loop.injected)):
            made[name] = spec
        elif owner.name == joint.name:
            made[head] = spec.model_copy(update={"name": head})
    return made


def _stream_of(stream: Stream, config: StudyFile, joint: RigJoint) -> Stream:
    return stream.model_copy(update={"channels": _channels_of(stream.channels, config, joint)})


def _processing_of(processing: Processing, joint: RigJoint) -> Processing:
    return processing if joint.dead_band is None else processing.model_copy(update={"dead_band": joint.dead_band})


def _entry_of(
    entry: RecordingEntry, config: StudyFile, joint: RigJoint, streams: Mapping[str, Stream]
) -> RecordingEntry:
    own = entry.processing
    return entry.model_copy(
        update={
            "channels": _channels_of(entry.channels, config, joint),
            "processing": None if own is None else _processing_of(own, joint),
            "streams": {name: file for name, file in entry.streams.items() if name in streams},
            "offsets": {name: offset for name, offset in entry.offsets.items() if name in streams},
        }
    )
