"""Where each word of the region lies that engine, recorder and session share: `engine/layout.hpp`, said to NumPy."""

from __future__ import annotations

import numpy as np

REGION_MAGIC = b"PELLLIVE"
"""First eight bytes of the region."""

REGION_VERSION = 2
"""Version of the layout that this module knows."""

STATUS_OFFSET = 4096
"""Place of the engine's status [B]."""

COMMAND_OFFSET = 8192
"""Place of the session's command [B]."""

RECORDER_OFFSET = 12288
"""Place of the recorder's status [B]."""

EVENT_OFFSET = 16384
"""Place of the first event [B]."""

EVENT_BYTES = 4096
"""Size of an event [B]."""

EVENT_CAPACITY = 256
"""Number of events that the region keeps."""

RECORD_OFFSET = EVENT_OFFSET + EVENT_BYTES * EVENT_CAPACITY
"""Place of the first record [B]."""

RECORD_CAPACITY = 65536
"""Number of records that the region keeps: 65 s at 1 kHz."""

VALUE_NAMES = ("position", "torque", "interaction", "muscle", "drive", "joint")
"""Quantities of a record, in order: inputs of a control law, the measured effort of the drive, a second encoder."""

MODES = ("start_up", "running", "degraded", "damped_stop", "zero", "latched")
"""What a supervisor does, in the order of the core's codes; "latched" also stands where no law runs."""

TASK_KINDS = ("hold", "reach", "track", "contract", "relax")
"""Tasks of a simulated wearer, in the order of their codes."""

INJECTION_KINDS = ("none", "not_a_number", "frozen", "clock_ahead", "clock_back", "silent", "starved")
"""Faults that tests may put into the inputs, in the order of their codes."""

FLAG_LATE = 1
"""The cycle began later than the stated bound."""

FLAG_BEGAN = 2
"""The law began anew in this cycle."""

FLAG_STEPPED = 4
"""The law was stepped in this cycle."""

FLAG_STOP_ASKED = 8
"""The control law received a stop request before its step."""

FLAG_ADJUSTED = 16
"""A number of the law was changed before it was stepped."""

FLAG_INJECTED = 32
"""A fault was put into the inputs."""

FLAG_TORN = 64
"""The command block could not be read, and the last one held."""

HEADER_TYPE = np.dtype(
    [
        ("magic", "S8"),
        ("version", "<u4"),
        ("value_count", "<u4"),
        ("record_bytes", "<u4"),
        ("record_capacity", "<u4"),
        ("event_bytes", "<u4"),
        ("event_capacity", "<u4"),
        ("epoch", "<i8"),
        ("period", "<i8"),
        ("records", "<u8"),
        ("events", "<u8"),
    ]
)
"""Head of the region; times in ns of the monotonic clock."""

RECORD_TYPE = np.dtype(
    [
        ("number", "<u8"),
        ("cycle", "<u8"),
        ("time", "<i8"),
        ("deadline", "<i8"),
        ("now_us", "<i8"),
        ("value", "<f8", (6,)),
        ("stamp_us", "<i8", (6,)),
        ("sequence", "<u4", (6,)),
        ("valid", "<u4"),
        ("flags", "<u4"),
        ("law", "<u4"),
        ("token", "<u4"),
        ("effort", "<f8"),
        ("fault", "u1"),
        ("mode", "u1"),
        ("enable", "u1"),
        ("state", "u1"),
        ("beat", "<u4"),
        ("challenge", "<u4"),
        ("task", "<u4"),
        ("target", "<f8"),
        ("limb_position", "<f8"),
        ("limb_velocity", "<f8"),
        ("muscle_torque", "<f8"),
        ("flexor", "<f8"),
        ("extensor", "<f8"),
        ("drive_torque", "<f8"),
        ("velocity", "<f8"),
        ("adjusted_value", "<f8"),
        ("adjusted_field", "<u4"),
        ("task_kind", "<u4"),
        ("compute", "<u4"),
        ("reserved", "<u4"),
        ("torque_estimate", "<f8"),
        ("torque_half_width", "<f8"),
        ("spare", "<f8", (1,)),
        ("number_again", "<u8"),
    ]
)
"""One cycle of the engine: measurements, commands to the drive, and the actions of a simulated wearer."""

TEXT_BYTES = EVENT_BYTES - 32
"""Largest text of an event [B]."""

EVENT_TYPE = np.dtype(
    [
        ("number", "<u8"),
        ("time", "<i8"),
        ("length", "<u4"),
        ("reserved", "<u4"),
        ("text", f"V{TEXT_BYTES}"),
        ("number_again", "<u8"),
    ]
)
"""One event: JSON text at a time."""

LATENESS_BIN_COUNT = 128
"""Number of bins of the histogram of lateness."""

STATUS_TYPE = np.dtype(
    [
        ("process", "<u8"),
        ("heartbeat", "<i8"),
        ("cycle", "<u8"),
        ("records", "<u8"),
        ("late", "<u8"),
        ("missed", "<u8"),
        ("worst_lateness", "<i8"),
        ("worst_compute", "<i8"),
        ("command_sequence", "<u8"),
        ("torn_commands", "<u8"),
        ("state", "<u4"),
        ("law", "<u4"),
        ("fault", "<u4"),
        ("mode", "<u4"),
        ("enable", "<u4"),
        ("challenge", "<u4"),
        ("fifo", "<u4"),
        ("locked", "<u4"),
        ("fifo_error", "<i4"),
        ("lock_error", "<i4"),
        ("ended", "<u4"),
        ("reserved", "<u4"),
        ("effort_limit", "<f8"),
        ("rate_limit", "<f8"),
        ("velocity_limit", "<f8"),
        ("position_min", "<f8"),
        ("position_max", "<f8"),
        ("started", "<i8"),
        ("device_silent", "<u8"),
        ("lateness", "<u8", (LATENESS_BIN_COUNT,)),
    ]
)
"""What the engine says of itself."""

COMMAND_TYPE = np.dtype(
    [
        ("sequence", "<u8"),
        ("heartbeat", "<i8"),
        ("law", "<u4"),
        ("run", "<u4"),
        ("stops", "<u4"),
        ("token", "<u4"),
        ("end", "<u4"),
        ("adjusts", "<u4"),
        ("adjusted_field", "<u4"),
        ("adjusted_law", "<u4"),
        ("adjusted_value", "<f8"),
        ("task", "<u4"),
        ("task_kind", "<u4"),
        ("target", "<f8"),
        ("amplitude", "<f8"),
        ("duration", "<f8"),
        ("reaction", "<f8"),
        ("frequency", "<f8"),
        ("share", "<f8"),
        ("load", "<f8", (5,)),
        ("injections", "<u4"),
        ("injection", "<u4"),
        ("injected_for", "<f8"),
        ("torque_estimate", "<f8"),
        ("torque_half_width", "<f8"),
        ("spare", "<f8", (8,)),
        ("checksum", "<u8"),
    ]
)
"""What the session asks of the engine."""

RECORDER_TYPE = np.dtype(
    [
        ("process", "<u8"),
        ("heartbeat", "<i8"),
        ("records", "<u8"),
        ("events", "<u8"),
        ("sealed", "<u8"),
        ("recording", "<u4"),
        ("error", "<u4"),
    ]
)
"""What the recorder says of itself."""

REGION_BYTES = RECORD_OFFSET + RECORD_TYPE.itemsize * RECORD_CAPACITY
"""Size of the region [B]."""

CHECKSUM_START = 14695981039346656037
"""Checksum of nothing (FNV-1a over words of 64 bits)."""

CHECKSUM_FACTOR = 1099511628211
"""Factor of the checksum."""


def checksum(words: np.ndarray) -> int:
    """Return the FNV-1a checksum of words of 64 bits, shape (n,)."""
    total = CHECKSUM_START
    for word in words.tolist():
        total = ((total ^ word) * CHECKSUM_FACTOR) & 0xFFFFFFFFFFFFFFFF
    return total


def lateness_edges() -> np.ndarray:
    """Return the edges of the bins of lateness, shape (129,) [s]: four bins an octave from 1,024 ns on."""
    bins = np.arange(LATENESS_BIN_COUNT - 1)
    lower = (4.0 + bins % 4) * 2.0 ** (bins // 4 + 8)
    return 1e-9 * np.concatenate([[0.0], lower, [np.inf]])
