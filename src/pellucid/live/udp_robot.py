"""A robot to be commissioned over a network: its readings and commands, in the packets of a live session."""

from __future__ import annotations

import math
import socket
import struct
from collections.abc import Mapping
from contextlib import suppress
from types import TracebackType
from typing import Self

from .._errors import PellucidError
from . import layout
from .udp import ASKED_FORMAT, ASKED_MAGIC, READING_FORMAT, READING_MAGIC, packet_sum

READING_TIMEOUT_S = 2.0
"""Longest time to wait for a reading."""

MAX_PACKETS = 20_000
"""Largest number of packets that are read at once: those of 20 s at 1 kHz."""


class UdpRobot:
    """A robot that sends readings to an address, and does what it is asked in return.

    Parameters
    ----------
    address : str
        ``HOST:PORT`` to listen at.

    Raises
    ------
    PellucidError
        If nobody can listen there.
    """

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(READING_TIMEOUT_S)
        try:
            self._socket.bind((host, int(port)))
        except (OSError, ValueError, OverflowError) as error:
            self._socket.close()
            raise PellucidError(f"udp: found the address {address}, expected HOST:PORT to listen at: {error}") from None
        self._address, self._peer = address, None
        self._beat = self._answers = 0

    def read(self) -> tuple[float, Mapping[str, float]]:
        """Wait for the next whole reading; return its time on the robot's clock [s] and its values by name, SI."""
        found = None
        while found is None:
            found = self._newest()
        time_us, values = found
        return 1e-6 * time_us, values

    def _newest(self) -> tuple[int, dict[str, float]] | None:
        """Wait for a packet, and return the newest whole reading that has arrived; None where there is none."""
        try:
            packets = [self._socket.recvfrom(256)]
        except TimeoutError:
            raise PellucidError(
                f"udp: found no reading at {self._address} for {READING_TIMEOUT_S:g} s, expected one in each period"
            ) from None
        self._socket.setblocking(False)
        with suppress(BlockingIOError):
            while len(packets) < MAX_PACKETS:
                packets.append(self._socket.recvfrom(256))
        self._socket.settimeout(READING_TIMEOUT_S)
        for data, peer in reversed(packets):
            if len(data) != READING_FORMAT.size:
                continue
            magic, sequence, valid, _, time_us, *values, total = READING_FORMAT.unpack(data)
            if magic != READING_MAGIC or total != packet_sum(data[:-8]) or self._peer not in (None, peer):
                continue
            self._peer, self._answers = peer, sequence
            named = enumerate(zip(layout.VALUE_NAMES, values, strict=True))
            return time_us, {name: x for i, (name, x) in named if valid >> i & 1 and math.isfinite(x)}
        return None

    def write(self, effort: float, *, enable: bool) -> None:
        """Ask for an effort [N m or N]; without `enable` the drive must have no power."""
        if self._peer is None:
            return
        self._beat = (self._beat + 1) & 0xFFFFFFFF
        words = ASKED_FORMAT.pack(ASKED_MAGIC, self._beat, int(enable), self._answers, 0, effort, 0)[:-8]
        self._socket.sendto(words + struct.pack("<Q", packet_sum(words)), self._peer)

    def close(self) -> None:
        """Take the power off and close the socket."""
        self.write(0.0, enable=False)
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
