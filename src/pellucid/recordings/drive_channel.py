"""Which channel carries the drive's command."""

from __future__ import annotations

from collections.abc import Container
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .recording import Recording
    from .study import Study

DRIVE_CHANNELS = {"torque": ("torque", "force"), "current": ("current",), "voltage": ("voltage", "duty")}
"""Kind of drive -> channels that may carry its command, the first one present counting."""


def command_channel(channels: Container[str], kind: str, ending: str = "") -> str | None:
    """Name of the one of `channels` that carries the command of a drive of a `kind`; None if there is none. `ending` is
    what a joint's channels end in, where there are several: ``".elbow"``."""
    return next((name + ending for name in DRIVE_CHANNELS[kind] if name + ending in channels), None)


def drive_channel(recording: Recording, study: Study) -> str | None:
    """Name of the channel that carries the drive's command, None if the recording has none."""
    drive = study.rig.drive
    return command_channel(recording, drive.kind) if drive else None
