"""The example adapter for a motor on a CAN bus, against a motor that speaks its protocol; never tried on hardware."""

import importlib.util
import socket
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from pellucid.live.udp import ASKED_FORMAT, ASKED_MAGIC, READING_FORMAT, UdpBoard, packet_sum

PATH = Path(__file__).parents[2] / "examples" / "devices" / "can_motor.py"


@pytest.fixture(scope="module")
def adapter():
    spec = importlib.util.spec_from_file_location("can_motor", PATH)
    module = importlib.util.module_from_spec(spec)
    sys.modules["can_motor"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["can_motor"]


class PlayedMotor:
    """A motor of 12.5 rad, 50 rad/s and 12 N m that gives what it is asked for while it has power."""

    def __init__(self):
        self.powered, self.torque, self.position, self.answers = False, 0.0, 0.7, []

    def send(self, message):
        data = bytes(message.data)
        if data[:7] == b"\xff" * 7:
            self.powered = data[7] == 0xFC
            return
        self.torque = 12.0 * (2.0 * ((data[6] & 15) << 8 | data[7]) / 4095.0 - 1.0)
        given = self.torque if self.powered else 0.0
        q, v, t = round((self.position + 12.5) / 25.0 * 65535), 2048, round((given + 12.0) / 24.0 * 4095)
        self.answers.append(bytes([1, q >> 8, q & 255, v >> 4, (v & 15) << 4 | t >> 8, t & 255]))

    def recv(self, timeout):
        return SimpleNamespace(data=self.answers.pop(0)) if self.answers else None


class Engine:
    """The engine's end of the network."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(2.0)

    def hear(self):
        data, self.peer = self.socket.recvfrom(256)
        return READING_FORMAT.unpack(data)

    def ask(self, effort, enable, beat):
        words = ASKED_FORMAT.pack(ASKED_MAGIC, beat, enable, 0, 0, effort, 0)[:-8]
        self.socket.sendto(words + packet_sum(words).to_bytes(8, "little"), self.peer)


@pytest.fixture
def chain(adapter):
    engine, played = Engine(), PlayedMotor()
    board = UdpBoard(engine.socket.getsockname())
    yield engine, played, adapter.CanMotor(played, 1, board, SimpleNamespace)
    board.close()
    engine.socket.close()


def test_a_motor_is_heard_and_gives_what_the_engine_asks(chain):
    engine, played, motor = chain
    motor.step(0.0)
    _, _, valid, _, time_us, position, torque, *_ = engine.hear()
    assert (valid, time_us, played.powered) == (0b010011, 0, False)
    assert position == pytest.approx(0.7, abs=25.0 / 65535)
    assert torque == pytest.approx(0.0, abs=24.0 / 4095)
    for k in range(3):
        engine.ask(3.0, 1, k)
        motor.step(0.001 * (k + 1))
        heard = engine.hear()
    assert played.powered
    assert played.torque == pytest.approx(3.0, abs=24.0 / 4095)
    assert heard[6] == pytest.approx(3.0, abs=24.0 / 4095)


def test_a_motor_lets_go_without_an_engine_and_when_it_is_told(chain):
    engine, played, motor = chain
    motor.step(0.0)
    engine.hear()
    engine.ask(3.0, 1, 1)
    motor.step(0.001)
    assert played.powered
    motor.step(0.049)
    assert played.powered
    motor.step(0.052)
    assert not played.powered
    assert played.torque == pytest.approx(0.0, abs=24.0 / 4095)
    engine.ask(3.0, 1, 2)
    motor.step(0.06)
    assert played.powered
    engine.ask(3.0, 0, 3)
    motor.step(0.061)
    assert not played.powered


@pytest.mark.parametrize(("wanted", "sent"), [(99.0, 12.0), (-99.0, -12.0), (float("nan"), 0.0)])
def test_a_torque_beyond_the_motor_or_no_number_stays_within(adapter, wanted, sent):
    data = adapter.torque_frame(wanted, adapter.Scale())
    assert adapter.from_bits((data[6] & 15) << 8 | data[7], 12.0, 12) == pytest.approx(sent, abs=24.0 / 4095)
