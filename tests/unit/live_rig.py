"""A live session on the virtual knee's engine in real time, with programs in place of the pages' browsers."""

import asyncio
import json
import re
import threading
import time
from contextlib import contextmanager

from pellucid.live.engine import LiveEngine
from pellucid.live.session import run_session
from pellucid.live.session.run_session import start_session_study
from pellucid_lab.live import virtual_knee
from pellucid_lab.session_devices import bridge_stalls

PATIENCE_S = 60.0
HELD_TORQUE = 2.0
"""Torque of the law while the trial runs [N m]."""


def held_study(folder):
    """A study whose first trial holds an angle against a torque for long, without consent and streams."""
    path = start_session_study(folder, "knee", "made")
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"consent = \[.*?\n\]\n", "", text, flags=re.DOTALL)
    tasks = text.index("[[session.tasks]]"), text.index('[[session.tasks]]\nname = "held"')
    text = text[: tasks[0]] + text[tasks[1] :]
    text = re.sub(r"streams = \[.*", "streams = []", text)
    text = re.sub(r"torques = \[.*", f'torques = ["{HELD_TORQUE:g} N*m"]', text)
    text = re.sub(r'duration = "[^"]*"\nramp = "[^"]*"', 'duration = "30 s"\nramp = "0 s"', text)
    text = re.sub(r'pause = "[^"]*"', 'pause = "0 s"', text)
    path.write_text(text, encoding="utf-8")
    return folder


class Page:
    """A program that is connected as one of the pages, in a thread of its own."""

    def __init__(self, server, role, *, pulse=True):
        self.server, self.role, self.pulse = server, role, pulse
        self.heard: list[tuple[float, dict]] = []  # time on the monotonic clock [s], and message
        self._send, self._ends = None, None
        self._open = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._talk()))
        self._thread.start()
        assert self._open.wait(PATIENCE_S)

    async def _talk(self):
        from websockets.asyncio.client import connect

        base = f"127.0.0.1:{self.server.port}"
        address = f"ws://{base}/socket/{self.role}?token={self.server.token}"
        self._ends, self._loop = asyncio.Event(), asyncio.get_running_loop()
        # Without a pulse it answers no ping either: such as a browser that hangs.
        async with connect(address, origin=f"http://{base}", ping_interval=None) as socket:
            self._socket = socket
            self._open.set()
            reading = asyncio.create_task(self._read(socket))
            await self._ends.wait()
            reading.cancel()

    async def _read(self, socket):
        async for message in socket:
            if isinstance(message, str):
                told = json.loads(message)
                self.heard.append((time.monotonic(), told))
                if self.pulse and told["type"] == "state":
                    await socket.send('{"type": "alive"}')

    def send(self, message):
        """Send a text, or an object as JSON."""
        text = message if isinstance(message, (str, bytes)) else json.dumps(message)
        asyncio.run_coroutine_threadsafe(self._socket.send(text), self._loop).result(PATIENCE_S)

    def act(self, action, value=None):
        """Do what a control of the page does, and return the server's answer and after which time it came [s]."""
        begun, count = time.monotonic(), len(self.heard)
        self.send({"type": "act", "action": action, "value": value})
        while True:
            for at, told in self.heard[count:]:
                if told["type"] in ("done", "refused"):
                    return told, at - begun
            assert time.monotonic() - begun < PATIENCE_S
            time.sleep(0.002)

    def when(self, holds, since=0.0):
        """Return when a state came first of which something holds [s], waiting for it."""
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            for at, told in list(self.heard):
                if at >= since and told["type"] == "state" and holds(told):
                    return at
            time.sleep(0.005)
        raise AssertionError(self.state)

    @property
    def state(self):
        """The last state that was told."""
        return next(told for _, told in reversed(self.heard) if told["type"] == "state")

    def close(self):
        """Close the page."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._ends.set)
            self._thread.join(PATIENCE_S)


class Rig:
    """A session that is served, its engine and its pages."""

    def __init__(self, server):
        self.server, self.session = server, server.session
        self.engine = self.session.engine
        self.pages: list[Page] = []

    def open(self, role, **options):
        """Open a page."""
        self.pages.append(Page(self.server, role, **options))
        return self.pages[-1]

    def until(self, holds, patience=PATIENCE_S):
        """Wait until something holds, and return after which time [s]."""
        begun = time.monotonic()
        while not holds():
            assert time.monotonic() - begun < patience, (self.session.phase, self.session.faults, self.session.reason)
            time.sleep(0.005)
        return time.monotonic() - begun

    def effort(self):
        """What the drive is asked for now [N m]."""
        return self.engine.read_since(self.engine.region.record_count - 1).channels["torque"][-1]

    def until_powered(self):
        """Start a trial, again where a busy computer's silence stopped it, until the law gives its torque."""
        operator, participant = self.operator, self.participant

        def powered():
            phase, state = self.session.phase, self.engine.status().state
            if phase == "instructions":
                participant.act("ready")
            elif phase == "waiting":
                operator.act("reset" if self.session.is_stopped else "start")
            elif phase == "judged":
                operator.act("repeat")
            return phase == "running" and state.in_force and abs(self.effort() - HELD_TORQUE) < 0.1

        self.until(powered)

    def open_both(self, **options):
        """Open both pages."""
        self.operator, self.participant = self.open("operator", **options), self.open("participant")


@contextmanager
def live_rig(folder, monkeypatch, *, recorder=True):
    """Run `pellucid live` on the virtual knee, and yield the rig."""
    monkeypatch.setattr(run_session, "evaluate", lambda study, tell: (None, ["not evaluated"]))
    held_study(folder)
    ready, servers, made = threading.Event(), [], []

    def start(study, plan):
        setup = bridge_stalls(virtual_knee(conditions=("torque",)))
        return LiveEngine.start(setup, folder / "run", streams=False, recorder=recorder)

    def run():
        try:
            opened = lambda server: (servers.append(server), ready.set())  # noqa: E731
            made.append(run_session.live(folder, on_ready=opened, engine=start))
        except BaseException as error:
            made.append(error)
        finally:
            ready.set()

    thread = threading.Thread(target=run)
    thread.start()
    assert ready.wait(PATIENCE_S)
    assert servers, made
    rig = Rig(servers[0])
    try:
        yield rig
    finally:
        for page in rig.pages:
            page.close()
        servers[0].end()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
    assert not isinstance(made[0], BaseException), made[0]
