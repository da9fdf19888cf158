"""Packets between the engine and a device behind a network, for devices that are written in Python, and for tests.

`engine/udp_packets.hpp` has the same in C++, and docs/design/live-engine.md the layout for any other language.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from . import layout

READING_MAGIC = 0x31524C50
"""First word of a reading: the bytes "PLR1"."""

ASKED_MAGIC = 0x31414C50
"""First word of what is asked: the bytes "PLA1"."""

READING_FORMAT = struct.Struct("<IIIIq6dQ")
"""A reading: magic, sequence, valid bits, 0, device's time [us], six values, checksum."""

ASKED_FORMAT = struct.Struct("<IIIIqdQ")
"""What is asked: magic, beat, enable, sequence that it answers, engine's time [us], effort [N m], checksum."""


@dataclass(frozen=True)
class Asked:
    """What the engine asks of a drive."""

    beat: int  # counts the engine's cycles
    enable: bool  # False: the drive must take its power off
    answers: int  # sequence of the newest reading that the engine knew
    time_us: int  # since the engine's epoch
    effort: float  # [N m]


def packet_sum(data: bytes) -> int:
    """Return the checksum of a packet without its last word."""
    return layout.checksum(np.frombuffer(data, "<u8"))


def pack_reading(sequence: int, time_us: int, values: Mapping[str, float]) -> bytes:
    """Return the datagram of a reading; missing quantities are marked as not valid.

    Parameters
    ----------
    sequence : int
        Number of the reading, counting up.
    time_us : int
        When it was measured, on any clock that only goes on [us].
    values : mapping of str to float
        Some of `layout.VALUE_NAMES`, SI.
    """
    valid = sum(1 << i for i, name in enumerate(layout.VALUE_NAMES) if name in values)
    numbers = [float(values.get(name, 0.0)) for name in layout.VALUE_NAMES]
    words = READING_FORMAT.pack(READING_MAGIC, sequence & 0xFFFFFFFF, valid, 0, time_us, *numbers, 0)[:-8]
    return words + struct.pack("<Q", packet_sum(words))


def unpack_asked(data: bytes) -> Asked | None:
    """Return what a datagram asks for, or None if it is damaged or something else."""
    if len(data) != ASKED_FORMAT.size:
        return None
    magic, beat, enable, answers, time_us, effort, total = ASKED_FORMAT.unpack(data)
    if magic != ASKED_MAGIC or total != packet_sum(data[:-8]):
        return None
    return Asked(beat, bool(enable), answers, time_us, effort)


class UdpBoard:
    """A device of a few lines: it sends readings to an engine, and keeps what it is asked for.

    Parameters
    ----------
    address : tuple of (str, int)
        Where the engine listens.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._address = address
        self._sequence = 0
        self.asked: list[Asked] = []

    def send(self, time_us: int, **values: float) -> None:
        """Send a reading measured at the device's time [us]: quantities of `layout.VALUE_NAMES` by name, SI."""
        self._sequence += 1
        self._socket.sendto(pack_reading(self._sequence, time_us, values), self._address)

    def receive(self) -> list[Asked]:
        """Return what was asked for since the last call; it is kept in `asked`, too."""
        found = []
        while True:
            try:
                one = unpack_asked(self._socket.recv(256))
            except BlockingIOError:
                break
            if one is not None:
                found.append(one)
        self.asked += found
        return found

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
