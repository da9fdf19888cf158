"""Both pages of a session: a scripted browser plays through it, and what must not connect is refused."""

import asyncio
import json
import time
import urllib.error
import urllib.request
from dataclasses import dataclass, field

import numpy as np
import pytest
from scripted_browser import Players, browser, served
from test_live_session import session_of

from pellucid.procedures.registry import open_study
from pellucid.session.new_session import start_session_study
from pellucid.session.page_server import sample_packet, shown_histogram

SPEED = 3.0
"""How much faster the stand-in's clock runs than a real one."""


@dataclass
class FastClock:
    """A monotonic clock that runs faster than this computer's."""

    begun: float = field(default_factory=time.monotonic)

    @property
    def now(self) -> float:
        return self.begun + SPEED * (time.monotonic() - self.begun)

    def __call__(self) -> float:
        return self.now


def short_session(folder, session, **engine):
    """A study with few and short trials, and its session on the stand-in's fast clock."""
    path = start_session_study(folder, session, f"my-{session}")
    text = path.read_text(encoding="utf-8")
    for old, new in (
        ('"12 deg", "36 deg", "60 deg"', '"36 deg"'), ('hold = "1 s"', 'hold = "0.5 s"'),
        ("PCFr = \"PCFr\"\n", ""), ('CLPC = "CLPC"\n', ""), ('angles = ["30 deg", "60 deg"]', 'angles = ["45 deg"]'),
        ('duration = "10 s"', 'duration = "4 s"'), ('pause = "3 s"', 'pause = "20 s"'),
        ('pause = "5 s"', 'pause = "20 s"'),
    ):  # fmt: skip
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return session_of(folder, session, clock=FastClock(), **engine)


@pytest.mark.nightly
def test_a_scripted_browser_plays_a_short_elbow_session(tmp_path):
    session, engine, _ = short_session(tmp_path / "s", "elbow")
    with served(session) as server, browser() as opened:
        players = Players(opened, server)
        players.until_running(0.4)
        players.operator.keyboard.press("Space")
        players.until_judged()
        players.wait(lambda: "stopped" in players.operator.inner_text("#judged"))
        players.wait(lambda: "Stopped" in players.participant.inner_text("#message"))
        players.do("repeat")
        players.wait(lambda: players.operator.is_visible("#reset"))
        players.do("reset")
        players.until_running(0.2)
        players.do("end_trial")
        players.until_judged()
        players.wait(lambda: "the operator ended the trial" in players.operator.inner_text("#judged"))
        players.do("repeat")
        players.until_running(0.4)
        assert players.participant.evaluate("document.body.classList.contains('still')")
        players.take_pictures("elbow")
        players.until_judged()
        players.wait(lambda: "nothing speaks against it" in players.operator.inner_text("#judged"))
        players.do("accept")
        players.wait(lambda: session.phase == "rest")
        players.wait(lambda: "Rest" in players.participant.inner_text("#message"))
        players.until_finished()
        players.wait(lambda: "over" in players.operator.inner_text("#headline"))
        players.wait(lambda: "Thank you" in players.participant.inner_text("#message"))
        players.wait(lambda: players.operator.is_visible("#indices-panel"))
        players.wait(lambda: "Median duration" in players.operator.inner_text("#indices"))
        players.wait(lambda: "cannot say yet" in players.operator.inner_text("#verdicts"))
        assert players.operator.locator("#traces canvas").count() == 5
        assert players.errors == []
    study = open_study(tmp_path / "s")
    assert [entry.condition for entry in study.config.recordings] == [trial.condition for trial in session.plan]
    frames = [data for _, kind, data in engine.events if kind == "frames"]
    assert sum(len(each["intervals"]) for each in frames) > 50
    shown = {cue[0] for each in frames for cue in each["cues"]}
    cues = {data["cue"] for _, kind, data in engine.events if kind == "cue"}
    assert shown <= cues
    assert len(shown) > 0.5 * len(cues)


@pytest.mark.nightly
def test_a_scripted_browser_plays_a_short_knee_session(tmp_path):
    session, _engine, _ = short_session(tmp_path / "s", "knee")
    with served(session) as server, browser() as opened:
        players = Players(opened, server)
        while session.trial.task.kind != "holding":
            players.until_running(0.2)
            players.until_judged()
            players.do("accept")
            players.wait(lambda: session.phase != "judged")
        players.until_running(0.1)
        players.wait(lambda: players.operator.is_visible("#torque"))
        players.operator.fill("#torque", "7.5")
        players.wait(lambda: session.attempt.task.by_hand == 7.5)
        players.take_pictures("knee")
        players.until_finished()
        assert players.errors == []
    held = open_study(tmp_path / "s").recording("P1_03_held_worn")
    assert np.isclose(held["command"], 7.5).any()
    assert {entry.protocol for entry in open_study(tmp_path / "s").config.recordings} == {
        "mvc", "held_angle", "followed_angle"
    }  # fmt: skip


def status_of(url, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=30) as answer:
            return answer.status, answer.headers
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.headers


def test_only_a_page_of_this_server_with_the_token_is_served(tmp_path):
    session, *_ = short_session(tmp_path / "s", "elbow")
    with served(session) as server:
        base, right = f"http://127.0.0.1:{server.port}", f"?token={server.token}"
        for page in ("operator", "participant"):
            assert status_of(f"{base}/{page}")[0] == 403
            assert status_of(f"{base}/{page}?token=wrong")[0] == 403
            code, headers = status_of(f"{base}/{page}{right}")
            assert code == 200
            assert "default-src 'self'" in headers["Content-Security-Policy"]
        assert status_of(f"{base}/operator{right}", Host="evil.example")[0] == 403
        assert status_of(f"{base}/../study.toml{right}")[0] == 404
        assert status_of(f"{base}/report{right}")[0] == 404
        assert status_of(f"{base}/bare")[0] == 200

        async def connect(origin, token, role="operator"):
            from websockets.asyncio.client import connect
            from websockets.exceptions import InvalidStatus

            address = f"ws://127.0.0.1:{server.port}/socket/{role}?token={token}"
            try:
                async with connect(address, origin=origin) as socket:
                    return json.loads(await asyncio.wait_for(socket.recv(), 30))["type"]
            except InvalidStatus as error:
                return error.response.status_code

        def tried(*arguments):
            return asyncio.run(connect(*arguments))

        assert tried(base, server.token) == "plan"
        assert tried(f"http://localhost:{server.port}", server.token) == "plan"
        for foreign in (None, "null", "http://evil.example", f"https://127.0.0.1:{server.port}", "http://127.0.0.1:1"):
            assert tried(foreign, server.token) == 403
        assert tried(base, "wrong") == 403
        assert tried(base, "") == 403
        assert tried(base, server.token, "root") == 404
        assert server.foreign_origins == 5


def test_nonsense_from_a_page_changes_nothing(tmp_path):
    session, engine, _ = short_session(tmp_path / "s", "elbow")
    with served(session) as server:

        async def talk():
            from websockets.asyncio.client import connect

            base = f"127.0.0.1:{server.port}"
            answers = []
            async with connect(
                f"ws://{base}/socket/participant?token={server.token}", origin=f"http://{base}"
            ) as socket:
                for message in ("nonsense", "[]", "{}", b"\x00\xff", '{"type":"act","action":"start"}',
                                '{"type":"act","action":"__init__"}', '{"type":"frames","intervals":"no"}',
                                '{"type":"act"}'):  # fmt: skip
                    await socket.send(message)
                while len(answers) < 7:
                    told = json.loads(await asyncio.wait_for(socket.recv(), 30))
                    answers += [told["why"]] if told["type"] == "refused" else []
            return answers

        assert len(asyncio.run(talk())) == 7
    assert session.phase == "consent"
    assert not engine.recording


def test_a_packet_of_samples_has_what_the_page_reads():
    time_s = np.arange(5) * 1e-3
    packet = sample_packet(0, time_s, {"b": time_s + 1, "a": time_s}, ("a", "b", "absent"))
    kind, n, k, length = np.frombuffer(packet, np.uint32, 4)
    assert (kind, n, k, length % 8) == (0, 5, 2, 0)
    assert json.loads(packet[16 : 16 + length]) == ["a", "b"]
    assert np.frombuffer(packet, np.float64, 5, 16 + length) == pytest.approx(time_s)
    assert np.frombuffer(packet, np.float32, 10, 16 + length + 40).reshape(2, 5)[1] == pytest.approx(time_s + 1)
    assert sample_packet(0, time_s[:0], {"a": time_s[:0]}, ("a",)) == b""


def test_a_histogram_counts_everything_once():
    edges = np.array([0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, np.inf])
    lows, counts = shown_histogram(edges, np.arange(1, 8))
    assert sum(counts) == 28
    assert np.isfinite(lows).all()
    assert len(lows) == len(counts)
