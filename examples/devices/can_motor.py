"""Connect a motor on a CAN bus, whose drive speaks the MIT protocol (CubeMars AK, mjbots in that mode), to the engine.

Not tried on hardware: the test plays a motor that speaks the protocol. The frames are those of the makers' manuals:
position 16 bits, velocity, gains and torque 12 bits each, between the ends of `Scale`, which differ between motors.

    pip install python-can
    python examples/devices/can_motor.py can0 1 127.0.0.1:5005

Start it beside an engine whose device is "udp 127.0.0.1:5005". A motor that is asked for nothing for 50 ms is told to
let go, whatever the engine does.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from typing import Any, Protocol

from pellucid.live.udp import UdpBoard

POWER_ON_FRAME = bytes([0xFF] * 7 + [0xFC])
"""Frame that takes the motor's power on."""

POWER_OFF_FRAME = bytes([0xFF] * 7 + [0xFD])
"""Frame that takes its power off."""

MAX_SILENCE_S = 0.05
"""The motor lets go if the engine asked for nothing for this time."""

PERIOD_S = 0.001
"""Time between two frames."""


@dataclass(frozen=True)
class Scale:
    """Ends of the numbers in a motor's frames: those of an AK80-6."""

    position: float = 12.5  # [rad]
    velocity: float = 50.0  # [rad/s]
    torque: float = 12.0  # [N m]


class Bus(Protocol):
    """What `can.Bus` has, and what the test's motor has."""

    def send(self, message: Any) -> None: ...

    def recv(self, timeout: float) -> Any: ...


def to_bits(value: float, end: float, bits: int) -> int:
    """Return a number between -end and end as an unsigned integer; what is no number becomes that of 0."""
    share = 0.5 * (value / end + 1.0) if value == value else 0.5
    return round(min(max(share, 0.0), 1.0) * ((1 << bits) - 1))


def from_bits(number: int, end: float, bits: int) -> float:
    """Return the number that an unsigned integer stands for."""
    return end * (2.0 * number / ((1 << bits) - 1) - 1.0)


def torque_frame(torque: float, scale: Scale) -> bytes:
    """Return the frame that asks for a torque alone: position, velocity and both gains are 0."""
    q, v, t = to_bits(0.0, 1.0, 16), to_bits(0.0, 1.0, 12), to_bits(torque, scale.torque, 12)
    return bytes([q >> 8, q & 255, v >> 4, (v & 15) << 4, 0, 0, t >> 8, t & 255])


def read_frame(data: bytes, scale: Scale) -> tuple[float, float, float]:
    """Return position [rad], velocity [rad/s] and torque [N m] of a motor's answer."""
    q, v, t = data[1] << 8 | data[2], data[3] << 4 | data[4] >> 4, (data[4] & 15) << 8 | data[5]
    return from_bits(q, scale.position, 16), from_bits(v, scale.velocity, 12), from_bits(t, scale.torque, 12)


class CanMotor:
    """One motor: it is asked for a torque, and its answer is sent to the engine."""

    def __init__(self, bus: Bus, identity: int, board: UdpBoard, message: Any, scale: Scale | None = None) -> None:
        self._bus, self._identity, self._board = bus, identity, board
        self._message, self._scale = message, scale or Scale()
        self._torque, self._heard, self._powered = 0.0, -1.0, False

    def step(self, now: float) -> None:
        """One period at a time [s]: take what the engine asks, ask the motor, and send what it measured."""
        for asked in self._board.receive():
            self._torque = asked.effort if asked.enable else 0.0
            self._heard = now if asked.enable else -1.0
        wanted = self._heard >= 0.0 and now - self._heard < MAX_SILENCE_S
        if wanted != self._powered:
            self._powered = wanted
            self._send(POWER_ON_FRAME if wanted else POWER_OFF_FRAME)
        self._send(torque_frame(self._torque if wanted else 0.0, self._scale))
        answer = self._bus.recv(timeout=PERIOD_S)
        if answer is not None:
            position, _, torque = read_frame(bytes(answer.data), self._scale)
            self._board.send(round(1e6 * now), position=position, torque=torque, drive=torque)

    def _send(self, data: bytes) -> None:
        self._bus.send(self._message(arbitration_id=self._identity, data=data, is_extended_id=False))


def main() -> None:
    """Run one motor until the program is interrupted."""
    import can

    channel, identity, address = sys.argv[1:]
    host, _, port = address.rpartition(":")
    bus = can.Bus(channel=channel, interface="socketcan")
    motor = CanMotor(bus, int(identity), UdpBoard((host, int(port))), can.Message)
    try:
        while True:
            motor.step(time.monotonic())
    finally:
        bus.send(can.Message(arbitration_id=int(identity), data=POWER_OFF_FRAME, is_extended_id=False))


if __name__ == "__main__":
    main()
