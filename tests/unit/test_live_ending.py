"""A finished session says so and ends: its server stops once its pages are closed, or after a time of farewell."""

import pytest
from test_live_session import session_of

from pellucid.live.session import run_session
from pellucid.live.session.live_session import Phase
from pellucid.live.session.page_server import PageServer
from pellucid.study.procedures.registry import open_study


@pytest.fixture
def server(tmp_path):
    run_session.start_session_study(tmp_path / "s", "elbow", "s")
    session, *_ = session_of(tmp_path / "s")
    made = PageServer(session)
    made.farewell = 60.0
    return made


def test_a_session_that_is_not_over_is_served(server):
    assert not server._has_said_farewell(0.0)
    assert not server._has_said_farewell(1e6)


def test_a_finished_session_ends_once_its_pages_are_closed(server):
    server.session.phase = Phase.finished
    server._tell_state = lambda: None
    server.clients = {object()}
    assert not server._has_said_farewell(10.0)
    server.clients = set()
    assert server._has_said_farewell(11.0)


def test_a_finished_session_ends_although_a_page_stays_open(server):
    """The server of an attended session went on until Ctrl-C."""
    server.session.phase = Phase.finished
    server._tell_state = lambda: None
    server.clients = {object()}
    assert [server._has_said_farewell(now) for now in (10.0, 69.0, 70.0)] == [False, False, True]


def test_the_evaluation_at_the_end_tells_its_progress(tmp_path, monkeypatch):
    run_session.start_session_study(tmp_path / "s", "elbow", "s")
    monkeypatch.setattr(run_session.subprocess, "run", lambda *_, **__: type("Done", (), {"returncode": 0})())
    told = []
    run_session.evaluate(open_study(tmp_path / "s"), lambda text, share: told.append((text, share)))
    assert told[0][1] == 0.0
    assert all(text.startswith("evaluation of the session") for text, _ in told[:-1])
    assert told[-1] == ("done", 1.0)
