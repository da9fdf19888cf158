"""What goes wrong in a live session: pages that close or hang, an engine that is silent, a recorder that ends or whose
disk is full. The law is disarmed, the page says why, the session goes on, and what was recorded is kept.

Each test runs the virtual knee's engine in real time.
"""

import os
import resource
import signal
import time

import pytest
from live_rig import HELD_TORQUE, live_rig
from real_time import held

from pellucid.controllers.session_state import UNPOWERED
from pellucid.files.xdf_writer import scan_xdf
from pellucid.live.replay import read_session
from pellucid.live.session import live_session
from pellucid.live.session.live_session import OPERATOR_AWAY_S

DISARMED_S = 0.5
"""A law is without effort and power at most this long after what disarms it [s]."""

pytestmark = pytest.mark.real_time

pytest.importorskip("websockets", reason="not installed: websockets")


@pytest.fixture
def rig(tmp_path, monkeypatch):
    with live_rig(tmp_path / "s", monkeypatch) as made:
        yield made


def is_off(rig):
    status = rig.engine.status()
    return (status.state == UNPOWERED or status.state.needs_reset) and not status.enable and rig.effort() == 0.0


def texts(rig):
    return [fault.text for fault in rig.session.faults]


def test_a_law_is_disarmed_when_its_trial_ends(rig):
    rig.open_both()
    rig.until_powered()
    assert rig.operator.state["engine"]["armed"]
    assert rig.operator.act("end_trial")[0] == {"type": "done", "action": "end_trial"}
    assert rig.until(lambda: is_off(rig)) < DISARMED_S
    for page in rig.pages:
        page.close()
    rig.until(lambda: rig.session.phase == "judged")
    assert is_off(rig)
    assert not rig.engine.region.last_command()["run"]


def test_a_law_that_is_armed_again_begins_without_the_torque_of_the_last_trial(rig):
    rig.open_both()
    rig.until_powered()
    rig.operator.act("end_trial")
    rig.until(lambda: rig.session.phase == "judged" and is_off(rig))
    count = rig.engine.region.record_count
    rig.operator.act("repeat")
    rig.until(lambda: rig.operator.act("start")[0]["type"] == "done")
    rig.until(lambda: rig.session.phase == "running")
    torque = rig.engine.read_since(count).channels["torque"]
    assert abs(torque).max() == 0.0


def test_a_trial_that_ends_by_itself_disarms_its_law(rig):
    rig.open_both()
    rig.until_powered()
    task = rig.session.attempt.task
    task.finished = task.begun  # the task is over
    rig.until(lambda: rig.session.phase != "running")
    assert rig.until(lambda: is_off(rig)) < DISARMED_S


@pytest.mark.parametrize("how", ["closes", "hangs"])
def test_a_law_needs_an_operator_who_is_there(rig, how):
    rig.open_both()
    rig.until_powered()
    begun = time.monotonic()
    if how == "closes":
        rig.operator.close()
    else:
        rig.operator.pulse = False
    rig.until(lambda: is_off(rig))
    assert time.monotonic() - begun < OPERATOR_AWAY_S + 1.0
    assert rig.session.attempt.interrupted == "no operator's page was open"
    rig.until(lambda: rig.session.phase == "judged")
    if how == "hangs":
        assert any("does not answer" in text for text in texts(rig))
        rig.operator.pulse = True
        rig.operator.act("repeat")  # the page is heard again, and may start
        rig.until_powered()


def test_a_second_operator_is_told_to_both(rig):
    rig.open_both()
    rig.until(lambda: rig.session.pages["operator"] == 1)
    second = rig.open("operator")
    for page in (rig.operator, second):
        page.when(lambda state: any("2 operator's pages are open" in each["text"] for each in state["faults"]))
        assert page.state["pages"]["operator"] == 2
    rig.until_powered()
    rig.operator.close()
    time.sleep(OPERATOR_AWAY_S + 0.5)
    assert rig.session.phase == "running"  # the other one is there
    assert second.act("stop")[0]["type"] == "done"
    assert rig.until(lambda: rig.engine.status().state.needs_reset) < DISARMED_S


def test_a_silent_engine_is_told_at_once_and_a_stop_is_answered(rig):
    rig.open_both()
    process = rig.engine.processes["engine"]
    lags = []
    for _ in range(3):  # a busy computer may be late itself
        begun = time.monotonic()
        with held(process):
            lags.append(rig.operator.when(lambda state: state["engine"]["state"]["name"] == "silent", begun) - begun)
        rig.operator.when(lambda state: state["engine"]["state"]["name"] == "disarmed", time.monotonic())
    assert min(lags) < 0.1
    rig.until_powered()
    begun = time.monotonic()
    with held(process):
        rig.operator.when(lambda state: state["engine"]["state"]["name"] == "silent", begun)
        answer, _ = rig.operator.act("stop")
        assert answer["type"] == "refused"
        assert "engine is silent" in answer["why"]
        assert "switch off the robot's power" in answer["why"]
        rig.until(lambda: rig.session.phase == "judged")
        assert rig.session.reason in ("the engine is silent", "the robot was stopped by hand")
        assert rig.operator.act("repeat")[0]["type"] == "done"
        assert rig.operator.act("start")[0]["why"] == "the engine is silent"
        time.sleep(1.5)  # longer than a session may be silent
    rig.until(lambda: rig.engine.status().state.needs_reset)
    rig.until(lambda: any(text.startswith("the engine continues") for text in texts(rig)))
    assert "stopped by hand" in texts(rig)
    assert not any("busy" in text or "did not respond" in text for text in texts(rig))
    rig.until(lambda: is_off(rig))
    rig.until_powered()


def test_an_engine_that_ended_ends_the_trial_and_the_session_can_be_finished(rig):
    rig.open_both()
    rig.until_powered()
    os.kill(rig.engine.processes["engine"], signal.SIGKILL)
    rig.until(lambda: rig.session.phase == "judged")
    assert rig.session.reason == "the engine has ended"
    rig.operator.act("repeat")
    assert "the engine has ended" in rig.operator.act("start")[0]["why"]
    assert rig.operator.act("finish")[0]["type"] == "done"
    rig.until(lambda: rig.session.phase == "finished")


def test_a_stop_during_a_reset_wins(rig):
    rig.open_both()
    rig.until_powered()
    rig.operator.act("stop")
    rig.until(lambda: rig.session.phase == "judged")
    assert rig.engine.status().state.needs_reset
    # Until the law gave its torque, a busy computer may have stopped it, and the rig reset that stop.
    before = len(texts(rig))
    rig.operator.act("reset")
    rig.until(lambda: rig.engine.region.last_command()["token"] != 0)
    rig.participant.act("stop")
    assert rig.engine.region.last_command()["token"] == 0
    time.sleep(3.0)  # longer than the delay of a reset
    assert rig.engine.status().state.needs_reset
    assert "the stop was reset" not in texts(rig)[before:]
    rig.operator.act("reset")
    rig.until(lambda: "the stop was reset" in texts(rig)[before:])
    assert rig.engine.status().state.name == "disarmed"
    assert "no stop to reset" in rig.operator.act("reset")[0]["why"]


@pytest.mark.parametrize("when", [pytest.param("waiting", marks=pytest.mark.nightly), "running", "saving"])
def test_a_killed_recorder_is_told_disarms_the_law_and_is_started_again(rig, when):
    rig.open_both()
    if when != "waiting":
        rig.until_powered()
    if when == "saving":
        os.kill(rig.engine.processes["recorder"], signal.SIGSTOP)
        rig.operator.act("end_trial")
        rig.until(lambda: rig.session.phase == "saving")
    begun = time.monotonic()
    os.kill(rig.engine.processes["recorder"], signal.SIGKILL)
    rig.operator.when(lambda state: "signal 9" in state["recorder"], begun)
    assert rig.until(lambda: is_off(rig)) < DISARMED_S
    rig.until(lambda: "the recorder records again" in texts(rig))
    if when == "waiting":
        rig.until_powered()
        return
    file = rig.session.attempt.file
    rig.until(lambda: rig.session.phase == "judged")
    assert rig.session.reason.startswith("the recorder has ended" if when == "running" else "the operator ended")
    assert scan_xdf(file).footers
    assert max(stream.count for stream in scan_xdf(file).streams.values()) > 500
    assert rig.operator.act("repeat")[0]["type"] == "done"
    rig.until_powered()


def test_a_recorder_that_hangs_is_told_and_started_again(rig):
    rig.open_both()
    rig.until_powered()
    begun = time.monotonic()
    os.kill(rig.engine.processes["recorder"], signal.SIGSTOP)
    rig.operator.when(lambda state: state["recorder"] == "is silent", begun)
    assert rig.until(lambda: is_off(rig)) < DISARMED_S
    file = rig.session.attempt.file
    rig.until(lambda: rig.session.phase == "judged")
    assert rig.session.reason == "the recorder is silent"
    assert scan_xdf(file).footers


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="needs prlimit")
@pytest.mark.parametrize(
    "when",
    [
        pytest.param("preparing", marks=pytest.mark.nightly),
        "running",
        pytest.param("saving", marks=pytest.mark.nightly),
    ],
)
def test_a_full_disk_is_named_disarms_the_law_and_ends_nothing_else(rig, when, monkeypatch):
    def fill():
        # The recorder, and every one that is started again, can write no further byte.
        size = rig.engine.session_file.stat().st_size
        start = rig.engine.restart_recorder

        def start_limited():
            start()
            limit(size)

        monkeypatch.setattr(rig.engine, "restart_recorder", start_limited)
        limit(size)

    def limit(size):
        process = rig.engine.processes["recorder"]
        resource.prlimit(process, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    monkeypatch.setattr(live_session, "SAVING_LIMIT_S", 3.0)
    monkeypatch.setattr(live_session, "RECORDER_RESTART_INTERVAL_S", 2.0)
    rig.open_both()
    if when == "preparing":
        rig.until(lambda: rig.session.phase == "instructions")
        rig.participant.act("ready")
        fill()
    else:
        rig.until_powered()
        file = rig.session.attempt.file
        if when == "saving":
            rig.operator.act("end_trial")
        fill()
    begun = time.monotonic()
    rig.operator.when(lambda state: "File too large" in state["recorder"], begun)
    assert rig.until(lambda: is_off(rig)) < DISARMED_S
    if when != "preparing":
        rig.until(lambda: rig.session.phase == "judged")
        assert rig.session.attempt.judged is not None
        assert max(stream.count for stream in scan_xdf(file).streams.values()) > 500
        assert rig.operator.act("repeat")[0]["type"] == "done"
    told = rig.operator.act("start")[0]
    assert told["type"] == "refused"
    assert "the recorder" in told["why"]
    monkeypatch.undo()
    monkeypatch.setattr("pellucid.live.session.run_session.evaluate", lambda study: (None, []))
    rig.until(lambda: rig.session._recorder_problem == "")  # there is room again
    rig.until_powered()
    rig.operator.act("end_trial")
    rig.until(lambda: rig.session.phase == "judged")
    assert scan_xdf(rig.session.attempt.file).footers
    _, records = read_session(rig.engine.session_file)
    assert abs(records["effort"].max() - HELD_TORQUE) < 0.1


def test_a_trial_whose_file_cannot_be_made_does_not_begin(rig):
    rig.open_both()
    (rig.session.study.folder / "recordings").write_text("a file in the folder's place")
    rig.until(lambda: rig.session.phase == "instructions")
    rig.participant.act("ready")
    rig.operator.act("start")
    rig.until(lambda: any(text.startswith("the recording could not begin") for text in texts(rig)))
    assert rig.session.phase == "waiting"
    assert rig.until(lambda: is_off(rig)) < DISARMED_S
