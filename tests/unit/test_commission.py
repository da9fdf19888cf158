"""Commissioning: sign, gain and delay of a drive from starts, and what is written into study.toml."""

import errno
import math
import re
import threading
import time
from dataclasses import dataclass, replace

import numpy as np
import pytest
from research.evidence._commissioned import DrawnRobot, draw_robot, play_start
from typer.testing import CliRunner

import pellucid
from pellucid._errors import PellucidError
from pellucid.cli import app
from pellucid.controllers.commissioning import (
    START_COUNT,
    Answers,
    DriveCheck,
    StartLog,
    answers,
    drive_check,
    drive_reading,
    mean_error,
    record_starts,
    require_enough,
    shows_empty_robot,
)
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.export.controller_values import protect_wearer
from pellucid.controllers.export.export import values_for
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.study import commission as commission_module
from pellucid.controllers.study.commission import Commissioning, read_starts, state_answers, with_keys
from pellucid.controllers.supervised import supervised
from pellucid.live.udp import UdpBoard
from pellucid.live.udp_robot import UdpRobot
from pellucid_lab.commissioned_robot import JointNumbers, VirtualRobot, virtual_robot

NUMBERS = {
    "inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 10.0,
    "rate_limit": 1000.0, "velocity_limit": 8.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005,
    "period": 0.001,
}  # fmt: skip
JOINT = JointNumbers(0.05, 1.5, 0.0, 0.25, 0.02, 0.6, 5e-5)


def law(**instruments):
    given = ControlLaw("joint", LAWS["joint"].defaults | NUMBERS)
    body = dict.fromkeys(("gravity_cosine", "offset"), 0.0) | {"inertia": 0.05, "gravity_sine": 1.5, "coulomb": 0.2}
    return supervised(given, instruments=Instruments(probe=True, **instruments), body=body)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("commissioned") / "bench"
    pellucid.init(folder, rig="bench-joint")
    pellucid.simulate(folder)
    study = pellucid.open(folder)
    pellucid.identify(study).save(study)
    return study


@pytest.mark.parametrize("index", range(4))
def test_a_rigid_robots_drive_is_told(index):
    robot = replace(draw_robot(index, 3), rotor_share=0.0)
    found = drive_check([play_start(robot, index, k, 3) for k in range(5)], robot.model_inertia)
    assert found.sign == np.sign(robot.gain)
    assert found.gain == pytest.approx(abs(robot.gain), rel=0.05)
    assert found.delay == pytest.approx(robot.delay + robot.lag, abs=2.5e-3)
    assert found.is_right == (robot.gain > 0.0 and abs(found.gain - 1.0) <= 0.15)


def play_sinking_start(gain, position):
    """Return a start of a joint of 30 N m that sinks before the wave."""
    effort = np.zeros(400)
    effort[200:264] = 40.0 * np.sin(np.pi * np.arange(1, 65) / 32.0)
    at, speed, seen = position, 0.0, []
    for asked in effort:
        torque = gain * asked - 30.0 * np.sin(at) - 0.2 * np.tanh(100.0 * speed) - 20.0 * speed
        speed += 1e-3 * torque / 1.9
        at += 1e-3 * speed
        seen.append(4e-4 * np.round(at / 4e-4))
    return StartLog("s", 1e-3 * np.arange(400), np.array(seen), effort)


@pytest.mark.parametrize("gain", [-1.0, -0.5, 0.5, 0.6, 1.0])
def test_a_joint_that_sinks_before_the_wave_keeps_its_sign(gain):
    """A drive with half of its gain was called reversed where the joint sank against the wave."""
    found = drive_check([play_sinking_start(gain, 0.02 * k) for k in range(1, 11)], 1.9)
    assert found.sign == np.sign(gain)


def test_ten_starts_that_differ_too_much_tell_no_gain():
    """A gain of 1.3 was accepted as 1.135 from ten starts whose mean was known within 36 %."""
    found = drive_check([play_sinking_start(0.6 + 0.8 * (k % 2), 0.004 * k) for k in range(1, 11)], 1.9)
    assert found.sign == 1
    assert mean_error(found.gain_spread, 10) > 0.15 * 1.1
    assert math.isnan(found.gain)


def test_before_a_soft_transmission_the_sign_alone_is_told():
    robot = replace(draw_robot(1, 3), rotor_share=0.2)
    robot = replace(robot, stiffness=robot.inertia * 0.16 * (2.0 * math.pi * 35.0) ** 2)
    found = drive_check([play_start(robot, 1, k, 3) for k in range(4)], robot.model_inertia)
    assert found.sign == np.sign(robot.gain)
    assert math.isnan(found.gain)
    assert math.isnan(found.delay)  # it was told, and wrong by up to 24 ms


def play_logged_start(monkeypatch, bits, gain, start, rest=None):
    """Play the start of a knee that an exported controller logs, whose wave is half as long."""
    monkeypatch.setattr("research.evidence._commissioned.DRIVE_WAVE_FACTOR", 1)
    quantum = 2.0 * math.pi / 2**bits
    knee = DrawnRobot(0.06, 0.0, 0.0, 2.2, 0.3, 1.1, 0.15, gain, 1e-3, 1e-3, quantum, 2e-5, 0.06, 2.15)
    return play_start(knee, 0, start if rest is None else rest, 6)


@pytest.mark.parametrize("bits", [13, 14, 16])
@pytest.mark.parametrize("gain", [1.0, 1.4, 0.6])
def test_a_coarse_encoder_shows_the_gain(monkeypatch, bits, gain):
    """Rounding left more than the share that a soft transmission leaves, so that no gain was told."""
    found = drive_check([play_logged_start(monkeypatch, bits, gain, k) for k in range(10)], 0.06)
    assert found.gain == pytest.approx(gain, abs=max(0.05 * gain, 2.0 * found.gain_spread))
    assert found.gain_spread < 0.1 * max(gain, 1.0)
    assert found.is_right == (gain == 1.0)


def test_an_encoder_that_is_too_coarse_is_named(monkeypatch):
    """Starts from one position repeat one rounding: their spread is small, and their mean is wrong."""
    found = drive_check([play_logged_start(monkeypatch, 13, 1.0, k, rest=0) for k in range(10)], 0.06)
    assert found.is_open
    said = "\n".join(Commissioning("logs", found, Answers(None, np.nan, None, 0, 10), ()).lines())
    assert re.search(r"gain: not identifiable: the wave moves the joint by only \d+ steps of the encoder", said)
    assert "compliant" not in said


def test_starts_that_the_supervisor_stopped_are_refused():
    """A drive with half of its gain met its measurement's check in the wave; the rest told a compliant transmission."""
    robot = replace(draw_robot(0, 3), rotor_share=0.0)
    starts = [play_start(robot, 0, k, 3) for k in range(5)]
    first = int(np.flatnonzero(starts[0].effort)[0])
    kept = np.arange(len(starts[0].effort)) < first + 20
    cut = [replace(start, effort=np.where(kept, start.effort, 0.0)) for start in starts]
    with pytest.raises(PellucidError, match="found 0 of 5 starts with a whole wave, expected at least 3: the others"):
        drive_check(cut, robot.model_inertia)


def test_a_drive_that_gives_nothing_within_the_wave_has_no_sign():
    """Its joint moves by the noise of the encoder; that counted as the wrong way."""
    robot = replace(draw_robot(0, 3), rotor_share=0.0, gain=1e-9)
    starts = [play_start(robot, 0, k, 3) for k in range(5)]
    with pytest.raises(PellucidError, match=r"first half of the wave does .* of the work .* on a free joint"):
        drive_check(starts, robot.model_inertia)


def test_a_wave_that_a_limit_of_the_rate_makes_smaller_is_whole():
    robot = replace(draw_robot(0, 3), rotor_share=0.0)
    starts = [play_start(robot, 0, k, 3) for k in range(5)]
    uneven = [replace(start, effort=np.maximum(start.effort, 0.94 * start.effort.min())) for start in starts]
    assert drive_check(uneven, robot.model_inertia).starts == 5


def test_an_answer_holds_for_the_wave_that_gave_it():
    own = law().supervision["test_effort"]
    known = law(start_up_answer=0.02, start_up_wave=own).supervision
    other = law(start_up_answer=0.02, start_up_wave=1.4 * own).supervision
    unknown = law().supervision
    assert (other["test_least"], other["test_most"]) == (unknown["test_least"], unknown["test_most"])
    assert known["test_most"] == pytest.approx(1.75 * 0.02)
    assert law(start_up_answer=0.02).supervision["test_most"] == known["test_most"]


def test_an_answer_of_the_probe_holds_for_the_windows_that_gave_it():
    """Longer windows have waves of other frequencies, and a robot answers these otherwise."""
    answer = (1.0, 0.0, 2.0, 0.0, 3.0, 0.0)
    own = law().supervision["probe_samples"] * NUMBERS["period"]
    assert law(probe_answer=answer, probe_window=own).supervision["probe_answer_high_real"] == 3.0
    assert law(probe_answer=answer).supervision["probe_answer_error"] == (0.1 if own == 0.12 else 0.0)
    assert law(probe_answer=answer, probe_window=1.2 * own).supervision["probe_answer_error"] == 0.0


def test_a_loop_of_another_rate_is_commissioned_with_its_period(bench, tmp_path):
    """A log of a controller at 500 Hz was refused, and nothing told how to state its period."""
    values = values_for(bench, period=0.002)
    slow = protect_wearer(values, unmeasured=True).supervised
    starts = record_starts(virtual_robot(bench.folder)(False, 0.002), slow, 10, worn=False)
    files = []
    for k, start in enumerate(starts):
        files.append(tmp_path / f"start{k}.csv")
        columns = np.column_stack([start.time, start.position, start.effort, *start.others.values()])
        header = ",".join(("time", "position", "effort", *start.others))
        np.savetxt(files[-1], columns, "%.9g", ",", header=header, comments="")
    with pytest.raises(PellucidError, match=r"period of 0.001 s: log one row each period, or give --period"):
        pellucid.commission(bench, logs=files)
    done = pellucid.commission(bench, logs=files, period=0.002)
    assert done.drive.is_right
    assert "--period 0.002" in done.answer.next_command


def write_log(path, starts):
    """Write starts as one log, a second apart."""
    tables = [np.column_stack([s.time, s.position, s.effort, *s.others.values()]) for s in starts]
    header = ",".join(("time", "position", "effort", *starts[0].others))
    np.savetxt(path, np.concatenate(tables), "%.9g", ",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def bench_logs(bench, tmp_path_factory):
    """Logs of the empty bench and of a worn one."""
    safe = protect_wearer(values_for(bench), unmeasured=True).supervised
    make, folder = virtual_robot(bench.folder), tmp_path_factory.mktemp("logs")
    empty = write_log(folder / "empty.csv", record_starts(make(False, 1e-3), safe, 10, worn=False))
    return empty, write_log(folder / "worn.csv", record_starts(make(True, 1e-3), safe, 10, worn=True))


def test_a_worn_log_of_an_empty_robot_is_not_accepted(bench, bench_logs):
    """It ended with yes, and its responses were written as those of a wearer."""
    empty, worn = bench_logs
    text = (bench.folder / "study.toml").read_text()
    done = pellucid.commission(bench, logs=[empty], worn_logs=[empty])
    assert (done.answer.badge, done.written, done.is_undecided) == ("Cannot say", (), True)
    assert "show the inertia of the empty robot" in done.answer.reason
    printed = CliRunner().invoke(app, ["commission", str(bench.folder), "--log", str(empty), "--worn", str(empty)])
    assert printed.exit_code == 1
    assert (bench.folder / "study.toml").read_text() == text
    try:
        done = pellucid.commission(bench, logs=[empty], worn_logs=[worn])
        assert (done.answer.badge, done.looks_empty) == ("Yes", False)
        assert "start_up_answer" in done.written
    finally:
        (bench.folder / "study.toml").write_text(text)


def test_worn_starts_that_show_nothing_are_told():
    empty = DriveCheck(1, 1.0, 0.01, 1e-3, 10)
    robot = replace(draw_robot(0, 3), rotor_share=0.0, gain=1.0)
    starts = [play_start(robot, 0, k, 3) for k in range(4)]
    assert shows_empty_robot(empty, starts, robot.inertia) is True
    assert shows_empty_robot(empty, starts, 0.7 * robot.inertia) is False
    assert shows_empty_robot(empty, starts[:2], robot.inertia) is None
    assert shows_empty_robot(replace(empty, gain=math.nan), starts, robot.inertia) is None


def test_few_starts_are_accepted_if_they_agree(bench, bench_logs):
    """The guide asked for ten, and five passed without a word."""
    robot = replace(draw_robot(0, 3), rotor_share=0.0, gain=1.0)
    starts = [play_start(robot, 0, k, 3) for k in range(5)]
    said = Commissioning("logs", drive_check(starts, robot.inertia), Answers(None, np.nan, None, 0, 5), ()).lines()[0]
    assert re.fullmatch(
        r"logs: 5 starts; 10 are usual, and these suffice: mean gain within [0-9.]+ %, at most 15 %", said
    )
    with pytest.raises(PellucidError, match="found 4 starts that tell the gain within 32 %, expected 10 starts, or at"):
        require_enough("gain", 1.0, 0.2, 4)
    require_enough("gain", 1.0, 0.2, START_COUNT)
    assert mean_error(0.2, 4) == pytest.approx(3.182 * 0.1, rel=1e-3)


def test_starts_that_move_nothing_are_refused():
    still = StartLog("s", 1e-3 * np.arange(300), np.zeros(300), np.zeros(300))
    with pytest.raises(PellucidError, match="found 0 starts in which an effort moves the joint, expected at least 3"):
        drive_check([still] * 5, 0.05)
    with pytest.raises(PellucidError, match="expected a known one above 0"):
        drive_check([still] * 5, 0.0)


def test_a_virtual_robot_is_commissioned():
    safe = law()
    empty = record_starts(VirtualRobot(JOINT, worn=False, period=1e-3), safe, 4, worn=False, wave_factor=2)
    assert np.count_nonzero(empty[0].effort) == pytest.approx(4 * safe.supervision["test_samples"], abs=4)
    found = drive_check(empty, 0.05)
    assert (found.sign, found.is_right) == (1, True)
    assert found.gain == pytest.approx(1.0, abs=0.05)
    worn = record_starts(VirtualRobot(JOINT, worn=True, period=1e-3), safe, 2, worn=True)
    told = answers(safe, worn)
    assert told.start_up is None  # two starts have no spread
    worn = record_starts(VirtualRobot(JOINT, worn=True, period=1e-3), safe, 3, worn=True)
    told = answers(safe, worn)
    assert told.start_up > 0.0
    assert told.wave == safe.supervision["test_effort"]
    assert len(told.probe) == 6
    assert told.notes == ()
    # What was told is what the supervisor then takes for right.
    commissioned = law(start_up_answer=told.start_up, probe_answer=told.probe)
    again = record_starts(VirtualRobot(JOINT, worn=True, period=1e-3), commissioned, 1, worn=True)
    assert np.abs(again[0].effort[-500:]).max() > 0.1


def read_late(effort, *, reads, lag, offset):
    """Return the measurement of a drive with a `lag` [periods], one period after the command."""
    read, given = np.empty_like(effort), 0.0
    for k, asked in enumerate(effort):
        read[k] = reads * given + offset
        given = asked + math.exp(-1.0 / lag) * (given - asked)
    return read


@pytest.mark.parametrize("lag", [1.0, 3.5])
@pytest.mark.parametrize("reads", [1.13, 0.9])
def test_what_a_drives_measurement_reads_does_not_depend_on_its_lag(reads, lag):
    robot = replace(draw_robot(0, 3), rotor_share=0.0)
    starts = [play_start(robot, 0, k, 3) for k in range(5)]
    read = [replace(s, others={"drive": read_late(s.effort, reads=reads, lag=lag, offset=0.1)}) for s in starts]
    assert drive_reading(read) == pytest.approx(reads, rel=0.005)
    with pytest.raises(PellucidError, match=r"found no column drive, expected .* study\.toml states"):
        drive_reading(starts)


@dataclass(frozen=True)
class StrongRobot:
    """A virtual robot whose drive gives more than it is asked for, and measures that."""

    robot: VirtualRobot
    gain: float
    sensor: float

    def read(self):
        time, said = self.robot.read()
        return time, {**said, "drive": self.sensor * said["drive"]}

    def write(self, effort, enable):
        self.robot.write(self.gain * effort, enable=enable)


def swing(safe, reads):
    """Return the fault of a joint that somebody swings, whose drive reads so much of its command."""
    played = safe.changed(test_effort=0.0, wearer_torque=math.inf, wearer_push=math.inf, ringing_limit=math.inf).start()
    drive, speed = 0.0, 0.5 * safe.values["velocity_limit"]
    for k in range(20_000):
        drive = reads * played.step(1e-3 * k, 0.5 * math.sin(2e-3 * speed * k), drive=drive)
    return played.fault


@pytest.mark.parametrize(("gain", "sensor"), [(1.11, 1.02), (0.9, 0.97), (1.0, 1.0)])
def test_a_drive_that_commissioning_accepts_stops_nobody(tmp_path, gain, sensor):
    """The energy that a drive adds to its command was held to the error of its measurement alone."""
    pellucid.init(tmp_path / "bench", rig="bench-joint")
    pellucid.simulate(tmp_path / "bench")
    study = pellucid.open(tmp_path / "bench")
    pellucid.identify(study).save(study)
    make = virtual_robot(tmp_path / "bench")
    done = pellucid.commission(study, robot=StrongRobot(make(False, 1e-3), gain, sensor), wearer=False)
    assert done.written[0] == "drive_answer"
    assert done.drive.reading == pytest.approx(gain * sensor, rel=0.005)
    assert f"drive_answer: measured effort {done.drive.reading:.3f} times the command" in done.lines()
    values = values_for(pellucid.open(tmp_path / "bench"))
    safe = protect_wearer(values, place="bench").supervised
    assert safe.supervision["drive_answer"] == pytest.approx(gain * sensor, rel=0.005)
    assert swing(safe, gain * sensor) == "none"
    assert swing(safe.changed(drive_answer=1.0), gain * sensor) == ("drive_effort" if gain > 1.0 else "none")
    assert swing(safe, 1.12 * gain * sensor) == "drive_effort"


@pytest.mark.parametrize("gain", [1.0, math.nan])
def test_a_measurement_that_contradicts_the_motion_is_named(gain):
    found = DriveCheck(1, gain, 0.01, 1e-3, 10, reading=0.333)
    done = Commissioning("logs", found, Answers(None, np.nan, None, 0, 10), (), "arm", gain_checked=math.isnan(gain))
    assert (done.answer.badge, done.answer.reason) == ("No", "its measurement reads 0.333 times the command")
    assert DriveCheck(1, 1.13, 0.01, 1e-3, 10, reading=1.2).is_read_right


def test_one_worn_start_leaves_the_start_up_answer_to_the_empty_robot():
    """It has too few waves for a spread, and the starts that nobody wears were not used."""
    safe = law()
    empty = record_starts(VirtualRobot(JOINT, worn=False, period=1e-3), safe, 3, worn=False)
    worn = record_starts(VirtualRobot(JOINT, worn=True, period=1e-3), safe, 1, worn=True)
    told = answers(safe, worn, empty)
    assert told.start_up == answers(safe, empty).start_up > 0.0
    assert (told.starts, told.notes) == (3, ())
    assert told.probe == answers(safe, worn).probe


@pytest.mark.parametrize("index", range(3))
def test_the_gain_before_a_soft_transmission_is_told(index):
    """With a wave as short as that of the start-up test it was wrong by 13 %, or not told."""
    robot = replace(draw_robot(index, 5), rotor_share=0.2)
    robot = replace(robot, stiffness=robot.inertia * 0.16 * (2.0 * math.pi * 90.0) ** 2)
    found = drive_check([play_start(robot, index, k, 5) for k in range(6)], robot.inertia)
    assert found.gain == pytest.approx(abs(robot.gain), rel=0.05)


def test_another_controllers_log_tells_no_answer_of_the_probe():
    robot = replace(draw_robot(0, 3), rotor_share=0.0)
    told = answers(law(), [play_start(robot, 0, k, 3) for k in range(3)])
    assert (told.start_up, told.probe) == (None, None)
    assert any("differ from those of the exported controller" in note for note in told.notes)


def test_logs_are_cut_into_starts(tmp_path):
    path = tmp_path / "starts.csv"
    rows = [(t, 0.1 * math.sin(t), 0.0) for t in 1e-3 * np.arange(400)]
    rows += [(t + 3.0, x, 0.0) for t, x, _ in rows]
    path.write_text("time [s],position [rad],effort [N*m]\n" + "".join(f"{t:.6f},{x:.6f},{u}\n" for t, x, u in rows))
    assert [len(start.time) for start in read_starts([path], 1e-3)] == [400, 400]
    seconds = read_starts([path], 1e-3)[1]
    table = "".join(f"{1e3 * t:.3f},{math.degrees(x):.6f},{u}\n" for t, x, u in rows)
    path.write_text("time [ms],position_deg,effort (N*m)\n" + table)
    scaled = read_starts([path], 1e-3)[1]
    assert scaled.time == pytest.approx(seconds.time)
    assert scaled.position == pytest.approx(seconds.position, abs=1e-6)
    path.write_text("time [ms],position_deg,effort [mA]\n" + table)
    with pytest.raises(PellucidError, match=r"starts.csv: effort \[mA\].*mA.*N\*m"):
        read_starts([path], 1e-3)
    path.write_text("time,position,effort\n" + table)
    with pytest.raises(PellucidError, match=r"starts.csv: found rows 1 s apart .*, expected the controller's"):
        read_starts([path], 1e-3)
    path.write_text("time [s],position,effort\n" + "".join(f"{2.0 * t},{x},{u}\n" for t, x, u in rows))
    with pytest.raises(PellucidError, match=r"found rows 0.002 s apart .* period of 0.001 s: log one row each period"):
        read_starts([path], 1e-3)
    path.write_text("time,position\n0,0\n0.001,0\n")
    with pytest.raises(PellucidError, match=r"starts.csv: found columns time, position, expected .*: no effort"):
        read_starts([path], 1e-3)


def test_answers_are_written_with_their_spread(tmp_path):
    path = tmp_path / "study.toml"
    text = '[rig]\nmotion = "rotary"\n\n[rig.instruments]\nprobe = true\nprobe_answer = [1, 2]\n\n[channels]\n'
    path.write_text(text)
    found = Answers(0.02, 0.001, (1.0, 0.0, 2.0, 0.0, 3.0, 0.0), 40, 10, wave=2.0, window=0.12)
    assert state_answers(path, found) == ("start_up_answer", "start_up_wave", "probe_answer", "probe_window")
    text = path.read_text()
    assert text.count("probe_answer") == 1
    assert 'probe_window = "0.12 s"' in text
    assert "standard deviation 0.001 J" in text
    assert text.index("start_up_answer") < text.index("[channels]")
    assert with_keys("[rig]\n", "[rig.instruments]", {"probe": "true"}) == "[rig]\n\n[rig.instruments]\nprobe = true\n"


def test_a_robot_behind_udp(tmp_path):
    with UdpRobot("127.0.0.1:0") as robot:
        board = UdpBoard(robot._socket.getsockname())
        board.send(1000, position=0.25)
        board.send(2000, position=0.5)
        time.sleep(0.05)
        assert robot.read() == (0.002, {"position": 0.5})
        robot.write(1.5, enable=True)
        time.sleep(0.05)
        (asked,) = board.receive()
        assert (asked.effort, asked.enable, asked.answers) == (1.5, True, 2)
        threading.Timer(0.1, lambda: board.send(3000, position=0.75)).start()
        assert robot.read()[1] == {"position": 0.75}
    board.close()
    with pytest.raises(PellucidError, match="found the address nowhere, expected HOST:PORT"):
        UdpRobot("nowhere")


@dataclass(frozen=True)
class ReversedRobot:
    """A virtual robot whose drive is wired the wrong way round."""

    robot: VirtualRobot

    def read(self):
        return self.robot.read()

    def write(self, effort, enable):
        self.robot.write(-effort, enable=enable)


def refuse(*given):
    raise PermissionError(errno.EACCES, "Permission denied", "study.toml")


def test_a_spring_is_refused_and_a_virtual_study_is_commissioned(tmp_path, monkeypatch):
    pellucid.init(tmp_path / "bench", rig="bench-joint")
    pellucid.simulate(tmp_path / "bench")
    study = pellucid.open(tmp_path / "bench")
    pellucid.identify(study).save(study)
    done = pellucid.commission(pellucid.open(tmp_path / "bench"))
    assert done.drive.is_right
    assert "start_up_answer" in done.written
    assert re.search(r"^sign: right$", "\n".join(done.lines()), re.M)
    assert (done.answer.badge, done.answer.sentence) == ("Yes", "sign and gain are right")
    assert done.answer.next_command == f"pellucid export {tmp_path / 'bench'}"
    with monkeypatch.context() as patched:
        patched.setattr(commission_module, "write_text_atomically", refuse)
        # The measured numbers were lost.
        unwritten = pellucid.commission(pellucid.open(tmp_path / "bench"))
        assert (unwritten.drive, unwritten.written) == (done.drive, ())
        assert unwritten.problem == f"{tmp_path / 'bench' / 'study.toml'} could not be written: Permission denied"
        printed = CliRunner().invoke(app, ["commission", str(tmp_path / "bench")])
        assert printed.exit_code == 1
        assert "gain: 1.0" in printed.output
        assert "study.toml could not be written" in printed.output.replace("\n", "")
    with pytest.raises(PellucidError, match=r"found a slider of 0.2 m, expected none for the virtual robot"):
        pellucid.commission(study, slider=0.2)
    pellucid.export(pellucid.open(tmp_path / "bench"))
    asked = []
    robot = ReversedRobot(virtual_robot(tmp_path / "bench")(False, 1e-3))
    done = pellucid.commission(pellucid.open(tmp_path / "bench"), robot=robot, ask=asked.append)
    assert (done.drive.is_right, done.written, done.answers.starts) == (False, (), 0)
    assert len(asked) == 1
    assert "Nobody wears the robot" in asked[0]


@pytest.mark.parametrize(
    ("drive", "badge", "reason"),
    [
        (DriveCheck(-1, 1.0, 0.01, 1e-3, 10), "No", "its sign is reversed"),
        (DriveCheck(1, 1.4, 0.01, 1e-3, 10), "No", "its gain is 1.400 times the stated one"),
        (DriveCheck(1, 56.268, 0.5, 1e-3, 10), "No",
         "its gain is 56.268 times the stated one, as if positions were degrees instead of radians"),
        (DriveCheck(1, 1015.0, 5.0, 1e-3, 10), "No",
         "its gain is 1015.000 times the stated one, as if the unit of effort or position were wrong by a factor of "
         "1000"),
        (DriveCheck(1, 198.0, 5.0, 1e-3, 10), "No",
         "its gain is 198.000 times the stated one, beyond any drive: check that log and study are of one robot, and "
         "the units of the columns effort and position of start.csv"),
        (DriveCheck(1, 0.0177, 1e-4, 1e-3, 10), "No",
         "its gain is 0.018 times the stated one, as if positions were radians instead of degrees"),
        (DriveCheck(1, np.nan, np.nan, 1e-3, 10), "Cannot say", "the sign is right; the motion does not show the gain"),
    ],
)  # fmt: skip
def test_a_commissioning_answers_whether_the_drive_follows(drive, badge, reason):
    found = Answers(None, np.nan, None, 0, 10)
    answer = Commissioning("logs", drive, found, (), "arm", files=("start.csv",)).answer
    assert (answer.badge, answer.reason) == (badge, reason)
    assert answer.next_command == ("" if reason else "pellucid export arm")
