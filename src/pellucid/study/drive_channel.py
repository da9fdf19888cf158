"""Find the channel that carries the drive's command."""

from __future__ import annotations

from collections.abc import Container
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..files.recording import Recording
    from .study_place import StudySource

DRIVE_CHANNELS = {"torque": ("torque", "force"), "current": ("current",), "voltage": ("voltage", "duty")}
"""Channels that may carry the command of each kind of drive; the first one that is recorded counts."""


def command_channel(channels: Container[str], kind: str, ending: str = "") -> str | None:
    """Return the name of the channel with the command of a drive of a `kind`; None if `channels` have none.

    Channels of a rig with several joints have the joint's name as their `ending`, such as ``".elbow"``.
    """
    return next((name + ending for name in DRIVE_CHANNELS[kind] if name + ending in channels), None)


def drive_channel(recording: Recording, study: StudySource) -> str | None:
    """Return the name of the channel with the drive's command; None if the recording has none."""
    drive = study.config.rig.drive
    return command_channel(recording, drive.kind) if drive else None
