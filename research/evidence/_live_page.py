"""Measurements of a session's pages in a browser: times of frames, permitted connections, and effect of a closed page.

A page cannot measure when light leaves the screen. The measured time is that at which the browser drew a frame.
"""

import asyncio
import json
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pellucid.live.engine import LiveEngine
from pellucid.live.session.live_session import LiveSession, Phase
from pellucid.live.session.page_server import PageServer
from pellucid.live.session.run_session import choose_participant, start_session_study
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import ResultRow
from pellucid_lab.session_devices import virtual_knee
from research.benchmarks._size import sized

PAIR_COUNT = sized(5, smallest=1)
"""Number of alternating pairs of a bare page and the session's pages."""

PAGE_S = sized(20.0, smallest=2.0)
"""Time for which each page is measured [s]."""

SETTLING_S = 1.0
"""Time after a page was opened that does not count [s]."""

PATIENCE_S = 120.0
"""Longest time that anything is waited for [s]."""

FOREIGN_ORIGINS = (None, "null", "http://evil.example", "https://127.0.0.1:{port}", "http://127.0.0.1:1", "file://")
"""Origins that are no pages of the server."""


class WatchedEngine:
    """An engine that somebody else drives: a page may look at it, and gives it nothing."""

    def __init__(self, engine: LiveEngine):
        self._engine = engine

    def __getattr__(self, name: str) -> Any:
        if name in ("status", "read_since", "health", "recorder_health", "emg", "alive", "setup", "heard_streams"):
            return getattr(self._engine, name)
        return lambda *given, **named: None


def chromium() -> str:
    """Return the path of this system's browser."""
    found = next((path for name in ("chromium", "chromium-browser", "chrome") if (path := shutil.which(name))), None)
    if found is None:
        raise RuntimeError("found no Chromium, expected one on the path")
    return found


@contextmanager
def served(session: LiveSession) -> Iterator[PageServer]:
    """Serve a session's pages from a thread."""
    server, ready = PageServer(session), threading.Event()
    thread = threading.Thread(target=lambda: asyncio.run(server.run(lambda server: ready.set())))
    thread.start()
    try:
        if not ready.wait(PATIENCE_S):
            raise RuntimeError("the pages' server did not start")
        yield server
    finally:
        server.end()
        thread.join(PATIENCE_S)


@contextmanager
def knee_session(engine: Any, folder: Path) -> Iterator[LiveSession]:
    """A session of the short knee study on an engine."""
    start_session_study(folder, "knee", "pages")
    study = open_study(folder)
    who, plan, left = choose_participant(study, None)
    with ThreadPoolExecutor(1) as executor:
        yield LiveSession(study, engine, left, who, executor=executor, finish=lambda study: (None, []), total=len(plan))


@contextmanager
def opened(engine: LiveEngine) -> Iterator[None]:
    """Open the operator's page on an engine that somebody else drives, in a browser without a window."""
    from playwright.sync_api import sync_playwright

    leave, ready = threading.Event(), threading.Event()

    def look(server: PageServer) -> None:
        # Playwright's objects belong to the thread that made them.
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox", "--disable-gpu"])
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.goto(server.address("operator"), timeout=1e3 * PATIENCE_S)
            ready.set()
            while not leave.is_set():
                page.wait_for_timeout(200)
            browser.close()

    with (
        tempfile.TemporaryDirectory() as folder,
        knee_session(WatchedEngine(engine), Path(folder) / "s") as session,
        served(session) as server,
    ):
        looking = threading.Thread(target=look, args=(server,))
        looking.start()
        try:
            ready.wait(PATIENCE_S)
            yield
        finally:
            leave.set()
            looking.join(PATIENCE_S)


def rows() -> Iterator[ResultRow]:
    """Frame times against a bare page, refused connections, and closed pages."""
    with tempfile.TemporaryDirectory() as folder:
        setup = virtual_knee(conditions=("torque",), place=0, seed=1)
        with (
            LiveEngine.start(setup, Path(folder) / "run") as engine,
            knee_session(engine, Path(folder) / "s") as session,
            served(session) as server,
        ):
            yield from connection_rows(server)
            yield from browser_rows(server)


def browser_rows(server: PageServer) -> Iterator[ResultRow]:
    """Frame times of the participant's page and of a bare page in alternating pairs, and what closed pages do."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox", "--disable-gpu"])
        bare, live = [], []
        for _ in range(PAIR_COUNT):
            bare.append(frame_times(browser, f"http://127.0.0.1:{server.port}/bare"))
            live.append(frame_times(browser, server.address("participant"), server.address("operator")))
        ratios = [float(own.mean() / other.mean()) for own, other in zip(live, bare, strict=True)]
        note = (
            f"mean time of a frame of the participant's page, with the operator's page open, over a bare page's; "
            f"median of {PAIR_COUNT} alternating pairs of {PAGE_S:g} s, {min(ratios):.3f} to {max(ratios):.3f}; bare "
            f"{1e3 * np.concatenate(bare).mean():.1f} ms"
        )
        yield _row("frame_time_over_bare_page", float(np.median(ratios)), "1", note)
        for name, frames in (("participant", live), ("bare", bare)):
            whole = np.concatenate(frames)
            yield _row(f"frame_time.{name}.p95", float(np.percentile(whole, 95)), "s", f"of {len(whole)} frames")
        yield from closed_page_rows(browser, server)
        browser.close()


def frame_times(browser: Any, address: str, beside: str | None = None) -> np.ndarray:
    """Return the times between a page's frames, (n,) [s], optionally with another page (`beside`) open."""
    pages = []
    for each in (beside, address):
        if each is not None:
            page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
            page.goto(each, timeout=1e3 * PATIENCE_S)
            pages.append(page)
    pages[-1].wait_for_timeout(1e3 * SETTLING_S)
    first = pages[-1].evaluate("frameTimes.all.length")
    pages[-1].wait_for_timeout(1e3 * PAGE_S)
    found = pages[-1].evaluate("frameTimes.all")[first:]
    for page in pages:
        page.context.close()
    return 1e-3 * np.array(found, float)


def closed_page_rows(browser: Any, server: PageServer) -> Iterator[ResultRow]:
    """How long after a page was closed the trial ends, and whether the robot is then without power or under its law."""
    session = server.session
    for role in ("participant", "operator"):
        pages = {}
        for each in ("operator", "participant"):
            page = browser.new_context().new_page()
            page.goto(server.address(each), timeout=1e3 * PATIENCE_S)
            pages[each] = page
        _wait(pages["operator"], lambda: session.pages["operator"] == 1 and session.pages["participant"] == 1)
        _play_to_running(session, pages["operator"])
        closed = time.monotonic()
        pages.pop(role).context.close()
        (left,) = pages.values()
        _wait(left, lambda: session.phase != Phase.running)
        seconds = time.monotonic() - closed
        _wait(left, lambda: session.phase in (Phase.judged, Phase.waiting))
        state = session.engine.status().state.name
        left.context.close()
        note = f"from closing the {role}'s page until its trial ends; the engine is then {state}"
        yield _row(f"page_closed.{role}", seconds, "s", note)


def _play_to_running(session: LiveSession, page: Any) -> None:
    """Answer what the session asks until a trial runs."""

    def runs() -> bool:
        answers = {"consent": ("participant", "consent"), "instructions": ("participant", "ready"),
                   "waiting": ("operator", "start"), "judged": ("operator", "repeat")}  # fmt: skip
        if session.engine.status().state.needs_reset:
            session.act("operator", "reset")
        elif session.phase in answers:
            session.act(*answers[session.phase])
        return session.phase == Phase.running and session.attempt is not None and session.attempt.task.progress > 0.1

    _wait(page, runs)


def _wait(page: Any, done: Any) -> None:
    until = time.monotonic() + PATIENCE_S
    while not done():
        if time.monotonic() > until:
            raise RuntimeError("a page's session did not go on")
        page.wait_for_timeout(20)


def connection_rows(server: PageServer) -> Iterator[ResultRow]:
    """Try to connect from foreign origins and with wrong tokens."""
    base = f"http://127.0.0.1:{server.port}"
    foreign = [origin if origin is None else origin.format(port=server.port) for origin in FOREIGN_ORIGINS]
    tries = [(origin, server.token, role) for origin in foreign for role in ("operator", "participant")]
    accepted = [asyncio.run(connects(server, *each)) for each in tries]
    yield _row("foreign_origin_accepted", sum(accepted), "1", f"of {len(tries)} tries with the right token")
    wrong = [(base, token, role) for token in ("", "wrong", server.token[:-1]) for role in ("operator", "participant")]
    accepted = [asyncio.run(connects(server, *each)) for each in wrong]
    yield _row("wrong_token_accepted", sum(accepted), "1", f"of {len(wrong)} tries from the server's own origin")
    if not asyncio.run(connects(server, base, server.token, "operator")):
        raise RuntimeError("the server refused its own page, so that what it refuses shows nothing")


async def connects(server: PageServer, origin: str | None, token: str, role: str) -> bool:
    """Return whether a socket is let through and told something."""
    from websockets.asyncio.client import connect
    from websockets.exceptions import InvalidStatus

    try:
        address = f"ws://127.0.0.1:{server.port}/socket/{role}?token={token}"
        async with connect(address, origin=origin) as socket:
            return bool(json.loads(await asyncio.wait_for(socket.recv(), PATIENCE_S)))
    except InvalidStatus:
        return False


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"live.{name}", float(value), unit, "evidence", "simulated", None, note)
