"""Both pages of a session: a scripted browser plays through it, and what must not connect is refused."""

import asyncio
import json
import re
import socket
import threading
import urllib.error
import urllib.request
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scripted_browser import NARROW_PX, PATIENCE_S, Players, browser, served
from test_live_session import session_of

from pellucid.live.session import run_session
from pellucid.live.session.page_server import sample_packet, shown_histogram
from pellucid.live.session.run_session import start_session_study
from pellucid.live.shared_memory import Region
from pellucid.study.procedures.registry import open_study

CONTROLS = {
    "elbow": {"yes", "full", "start", "stop", "reset", "repeat", "end_trial", "accept", "skip_rest", "participant-link",
              "report"},
    "knee": {"yes", "start", "accept", "torque", "skip_rest", "report"},
    "short": {"yes", "start", "accept", "torque", "stop", "reset", "repeat", "finish"},
}  # fmt: skip
"""Controls of both pages that the scripted browser uses in each session."""

SHORT_CHANGES = (
    ('levels = [1.0]\nduration = "2 s"\nrest = "1 s"', 'levels = [1.0]\nduration = "1 s"\nrest = "0.5 s"'),
    ('torques = ["0 N*m", "5 N*m", "10 N*m", "0 N*m", "-5 N*m", "-10 N*m"]', 'torques = ["0 N*m"]'),
    ('angles = ["30 deg", "60 deg"]', 'angles = ["30 deg"]'), ('trials = 2', 'trials = 1'),
    ('duration = "2 s"\nramp = "0.5 s"', 'duration = "4 s"\nramp = "0 s"'), ('slider_rate = "5 N*m/s"', ""),
    ('pause = "3 s"', 'pause = "0 s"'),
)  # fmt: skip
"""What makes the knee's session so short that every run of the tests plays it."""


def short_session(folder, session):
    """A study with a session, on the stand-in."""
    start_session_study(folder, session, f"my-{session}")
    return session_of(folder, session)


@contextmanager
def played(folder, monkeypatch, *, evaluated=True):
    """Run `pellucid live` on the virtual rig's engine in real time, with a scripted browser at both pages."""
    if not evaluated:
        monkeypatch.setattr(run_session, "evaluate", lambda study, tell: (None, ["not evaluated"]))
    ready, servers, made = threading.Event(), [], []

    def run():
        try:
            made.append(run_session.live(folder, on_ready=lambda server: (servers.append(server), ready.set())))
        except BaseException as error:
            made.append(error)
            ready.set()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert ready.wait(PATIENCE_S)
        assert servers, made
        with browser() as opened:
            yield Players(opened, servers[0]), made
    finally:
        for server in servers:
            server.end()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
    assert not isinstance(made[0], BaseException), made[0]


def recorded_events(folder, name):
    """Return the events in a trial's file, as kinds and data."""
    import pyxdf

    streams, _ = pyxdf.load_xdf(str(folder / "recordings" / f"{name}.xdf"))
    texts = next(s for s in streams if s["info"]["name"][0] == "events")["time_series"]
    told = [json.loads(row[0]) for row in texts]
    return [(each.pop("kind"), each) for each in told]


def test_every_control_of_both_pages_is_used_by_the_scripted_browser():
    pages = files("pellucid.live.session").joinpath("page")
    text = "".join(pages.joinpath(f"{role}.html").read_text(encoding="utf-8") for role in ("operator", "participant"))
    there = set(re.findall(r"<(?:button|input|a)\b[^>]*?\bid=\"([^\"]+)\"", text))
    assert set().union(*CONTROLS.values()) == there


@pytest.mark.nightly
@pytest.mark.real_time
def test_a_scripted_browser_plays_a_whole_elbow_session_on_the_engine(tmp_path, monkeypatch):
    folder = tmp_path / "s"
    path = start_session_study(folder, "elbow", "my-elbow")
    path.write_text(path.read_text(encoding="utf-8").replace('pause = "5 s"', 'pause = "60 s"'), encoding="utf-8")
    with played(folder, monkeypatch) as (players, made):
        session = players.session
        players.until_running(0.3)
        players.operator.keyboard.press("Space")
        players.until_judged()
        players.wait(lambda: "stopped" in players.operator.inner_text("#judged"))
        players.wait(lambda: "Stopped" in players.participant.inner_text("#message"))
        players.do("repeat")
        players.wait(lambda: players.operator.is_visible("#reset"))
        players.do("reset")
        players.until_running(0.1)
        players.participant.keyboard.press("Space")
        players.until_judged()
        players.do("repeat")
        players.until_running(0.1)
        players.do("stop")
        players.until_judged()
        players.do("repeat")
        players.until_running(0.1)
        players.do("end_trial")
        players.until_judged()
        players.wait(lambda: "the operator ended the trial" in players.operator.inner_text("#judged"))
        players.do("repeat")
        players.until_running(0.4)
        assert players.participant.evaluate("document.body.classList.contains('still')")
        players.take_pictures("elbow")
        players.until_judged()
        players.accept_or_repeat()
        players.wait(lambda: session.phase == "rest")
        players.wait(lambda: "Rest" in players.participant.inner_text("#message"))
        players.participant.click("#full")
        players.used.add("full")
        players.follow("participant-link", "Full screen")
        players.until_finished(20.0 * 60.0)
        players.wait(lambda: "over" in players.operator.inner_text("#headline"))
        players.wait(lambda: "Thank you" in players.participant.inner_text("#message"))
        players.wait(lambda: "Median duration" in players.operator.inner_text("#indices"))
        players.wait(lambda: "cannot say yet" in players.operator.inner_text("#verdicts"))
        players.wait(lambda: players.operator.is_visible("#report"))
        players.follow("report", "my-elbow")
        assert players.operator.locator("#traces canvas").count() == 5
        assert players.errors == []
        assert players.used >= CONTROLS["elbow"]
    assert made[0].done == made[0].planned == 3
    study = open_study(folder)
    assert {entry.condition for entry in study.config.recordings} == {"Ctrl", "FC", "CLPC"}
    names = [Path(entry.file).stem for entry in study.config.recordings]
    events = [event for name in names for event in recorded_events(folder, name)]
    frames = [data for kind, data in events if kind == "frames"]
    cues = {data["cue"] for kind, data in events if kind == "cue"}
    shown = {cue[0] for each in frames for cue in each["cues"]}
    assert sum(len(each["intervals"]) for each in frames) > 50
    assert len(shown & cues) > 0.5 * len(cues)
    assert (folder / "report" / "index.html").exists()


@pytest.mark.nightly
@pytest.mark.real_time
def test_a_scripted_browser_plays_a_whole_knee_session_on_the_engine(tmp_path, monkeypatch):
    folder = tmp_path / "s"
    path = start_session_study(folder, "knee", "my-knee")
    text = path.read_text(encoding="utf-8").replace('slider_rate = "5 N*m/s"', 'slider_rate = "30 N*m/s"')
    path.write_text(text, encoding="utf-8")
    with played(folder, monkeypatch) as (players, made):
        session = players.session
        while session.trial.task.kind != "holding":
            players.until_running(0.2)
            players.until_judged()
            players.accept_or_repeat()
        players.until_running(0.02)
        players.wait(lambda: players.operator.is_visible("#torque"))
        players.slide(2.5)
        players.wait(lambda: session.attempt.task.torque == 2.5)
        players.take_pictures("knee")
        players.until_finished(20.0 * 60.0)
        players.wait(lambda: players.operator.is_visible("#report"))
        players.follow("report", "my-knee")
        assert players.errors == []
        assert players.used >= CONTROLS["knee"]
        assert np.isfinite(session.estimator.error)
    assert made[0].done == made[0].planned == 7
    study = open_study(folder)
    # The plan's ramps pass that torque within a few samples; the slider holds it.
    assert np.count_nonzero(np.isclose(study.recording("P1_03_held_worn")["command"], 2.5)) > 200
    assert {entry.protocol for entry in study.config.recordings} == {"mvc", "held_angle", "followed_angle"}


@pytest.mark.real_time
def test_a_scripted_browser_plays_a_short_session_on_the_engine(tmp_path, monkeypatch):
    folder = tmp_path / "s"
    path = start_session_study(folder, "knee", "my-knee")
    text = path.read_text(encoding="utf-8")
    for old, new in SHORT_CHANGES:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    with played(folder, monkeypatch, evaluated=False) as (players, made):
        session = players.session
        players.wait(lambda: players.participant.is_visible("#yes"))
        assert players.cut_elements(NARROW_PX) == []
        heads = [page.inner_text(".role") for page in (players.operator, players.participant)]
        assert [head.lower() for head in heads] == ["operator", "participant"]
        grounds = [
            page.evaluate("getComputedStyle(document.querySelector('header')).backgroundColor")
            for page in (players.operator, players.participant)
        ]
        assert grounds[0] != grounds[1]
        players.until_running(0.1)
        players.do("stop")
        players.until_judged()
        assert players.cut_elements(NARROW_PX) == []
        players.do("repeat")
        players.wait(lambda: players.operator.is_visible("#reset"))
        players.do("reset")
        while session.trial.task.kind != "holding":
            players.until_running(0.2)
            players.until_judged()
            players.accept_or_repeat()
        accepted = False
        while not accepted:  # a busy computer's silence may have spoilt the trial, which is then repeated
            players.until_running(0.05)
            players.wait(lambda: players.operator.is_visible("#torque"))
            players.slide(2.0)
            players.until_judged()
            accepted = not session.reason
            players.accept_or_repeat()
        players.wait(lambda: session.phase in ("waiting", "instructions"))
        players.do("finish")
        players.wait(lambda: session.phase == "finished")
        assert players.errors == []
        assert players.used >= CONTROLS["short"]
    assert (made[0].done, made[0].planned) == (3, 4)
    assert np.count_nonzero(np.isclose(open_study(folder).recording("P1_03_held_worn")["command"], 2.0)) > 200


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


STRANGE_MESSAGES = (
    "", "null", "1e999", "[[]]", "[" * 15000, '{"type": null}', '{"type": ["act"]}', '{"type": "\\ud800"}',
    '{"type": "x"}', '{"type": "act", "action": null}', '{"type": "act", "action": {"stop": 1}}',
    '{"type": "act", "action": "\\udfff"}', '{"type": "act", "action": "' + "stop" * 4000 + '"}',
    '{"type": "act", "action": "st\u00f6p"}', '{"type": "act", "action": "torque", "value": NaN}',
    '{"type": "act", "action": "torque", "value": -Infinity}',
    '{"type": "act", "action": "torque", "value": 1' + "0" * 400 + "}",
    '{"type": "act", "action": "torque", "value": []}', '{"type": "ping", "page": "now"}',
    '{"type": "ping", "page": NaN}', '{"type": "ping", "page": 1' + "0" * 400 + "}",
    '{"type": "frames", "intervals": 5}', '{"type": "frames", "intervals": {}}',
    '{"type": "frames", "intervals": [NaN]}', '{"type": "frames", "intervals": [1' + "0" * 400 + "]}",
    '{"type": "frames", "intervals": [1e300]}', '{"type": "frames", "cues": 3}', '{"type": "frames", "cues": [3]}',
    '{"type": "frames", "cues": [[1, NaN]]}', '{"type": "frames", "cues": ["' + "x" * 9000 + '"]}',
    '{"type": "frames", "first": {}}', '{"type": "frames", "rtt": NaN}', b"\xff\xfe\x00",
    b'{"type": "frames", "offset": true}',
)  # fmt: skip
"""Messages of which none is one of a page."""


@pytest.mark.parametrize("role", ["operator", "participant"])
def test_every_strange_message_is_answered_and_a_stop_still_works(tmp_path, role, capfd):
    session, engine, _ = short_session(tmp_path / "s", "elbow")
    engine.mark = Region.create(tmp_path / "region", 1_000_000).write_event  # which refuses what JSON cannot hold
    with served(session) as server:

        async def talk():
            from websockets.asyncio.client import connect

            base = f"127.0.0.1:{server.port}"
            address = f"ws://{base}/socket/{role}?token={server.token}"
            async with connect(address, origin=f"http://{base}") as socket:

                async def answer_to(message):
                    await socket.send(message)
                    while True:
                        told = await asyncio.wait_for(socket.recv(), 30)
                        found = json.loads(told, parse_constant=pytest.fail) if isinstance(told, str) else {"type": ""}
                        if found["type"] in ("refused", "done", "pong"):
                            return found

                for message in STRANGE_MESSAGES:
                    told = await answer_to(message)
                    assert told["type"] == "refused", (message[:80], told)
                    assert len(told["why"]) < 300
                whole = {"type": "frames", "first": 1.5, "offset": -2.25, "rtt": None}
                await socket.send(json.dumps(whole | {"intervals": [16.7] * 500, "cues": [[7, 7654321.1]] * 300}))
                told = await answer_to('{"type": "act", "action": "stop", "value": NaN}')
                while told["type"] != "done":
                    told = await answer_to('{"type": "act", "action": "stop"}')

        asyncio.run(talk())
    assert engine.state == "stopped"
    assert session.phase == "consent"
    assert "Traceback" not in "".join(capfd.readouterr())


STRANGE_REQUESTS = (
    (b"GET /operator?token=%C3%BC HTTP/1.1\r\nHost: {host}\r\n", 403),
    (b"GET /operator?token=\xc3\xbc HTTP/1.1\r\nHost: {host}\r\n", None),
    (b"GET /operator?token=%ff%00 HTTP/1.1\r\nHost: {host}\r\n", 403),
    (b"GET /operator?token={token}&token=x HTTP/1.1\r\nHost: {host}\r\n", 200),
    (b"GET //[?token={token} HTTP/1.1\r\nHost: {host}\r\n", 400),
    (b"GET /operator?token={token} HTTP/1.1\r\n", 403),
    (b"GET /operator?token={token} HTTP/1.1\r\nHost: {host}\r\nHost: evil\r\n", 403),
    (b"GET /operator?token={token} HTTP/1.1\r\nHost: {host}\r\nX: \xff\r\n", 400),
    (b"GET /static/../../secret HTTP/1.1\r\nHost: {host}\r\n", 403),
    (b"GET /socket/operator?token={token} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n", 426),
    (b"GET /socket/operator?token={token} HTTP/1.1\r\nHost: {host}\r\nOrigin: a\r\nOrigin: http://{host}\r\n", 403),
    (b"GET /socket/operator?token={token} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nUpgrade: websocket\r\n"
     b"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: \xe9\r\n", 400),
    (b"GET /socket/operator?token={token}%C3%BC HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n", 403),
    (b"\x16\x03\x01\x02\x00\x01", None),
    (b"GET \xff\xff\r\n", None),
)  # fmt: skip
"""Requests as bytes, and the status of their answers; None where the connection may just end."""


def test_every_strange_request_is_answered_without_a_traceback(tmp_path, capfd):
    session, *_ = short_session(tmp_path / "s", "elbow")
    with served(session) as server:
        host = f"127.0.0.1:{server.port}".encode()
        for request_bytes, status in STRANGE_REQUESTS:
            sent = request_bytes.replace(b"{host}", host).replace(b"{token}", server.token.encode()) + b"\r\n"
            with socket.create_connection(("127.0.0.1", server.port), timeout=30) as connection:
                connection.sendall(sent)
                said = connection.recv(65536) if status is not None else b""
            assert said[:12] == f"HTTP/1.1 {status}".encode() or status is None, (request_bytes, said[:80])
        assert status_of(f"http://127.0.0.1:{server.port}/bare")[0] == 200
    assert "Traceback" not in "".join(capfd.readouterr())


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
