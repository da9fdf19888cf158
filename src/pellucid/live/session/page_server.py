"""The server of the operator's and the participant's page: files and two kinds of websocket, on this computer alone.

Every request must name this computer as its host, and every page and socket must know the session's token. A socket
must also come from a page of this server: a foreign origin is refused. Nothing is compressed, and nothing is loaded
from anywhere else.
"""

from __future__ import annotations

import asyncio
import json
import math
import secrets
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from ..._errors import PellucidError, missing_package
from .live_session import LiveSession, Phase

HOST_ADDRESS = "127.0.0.1"
"""Address that the server listens on: this computer alone."""

STEP_S = 1.0 / 60.0
"""Time between two steps of the session [s]; each sends a message to the participant's page."""

SAMPLES_INTERVAL_S = 0.05
"""Time between two packets of samples to the operator's page [s]."""

STATE_INTERVAL_S = 0.2
"""Interval at which the state is sent to the operator's page [s]."""

HEALTH_INTERVAL_S = 0.5
"""Time between two accounts of the engine's cycles and of clocks [s]."""

MAX_MESSAGE_BYTES = 20_000
"""A page's message is at most this long [B]."""

MAX_WORD_CHARACTERS = 40
"""Longest name of an action."""

MAX_FRAME_INTERVALS = 400
"""A message about frames has at most this many intervals: one a second, and six times as many frames."""

MAX_FRAME_CUES = 20
"""A message about frames has at most this many cues."""

MAX_PAGE_TIME_MS = 1e8
"""Largest time that a page may tell [ms]: it has then been open for a day."""

PAGE_SILENCE_S = 0.4
"""An operator's page that gave no sign of life for this time does not answer [s]; it gives ten a second."""

PING_INTERVAL_S = 0.1
"""Time between two pings to a program that is connected as an operator and sends no signs of life [s]."""

MAX_QUEUED_BYTES = 4_000_000
"""Largest backlog of a page; beyond it, the page receives no more data until it has caught up [B]."""

SHOWN_LATENESS_S = (8e-6, 2e-2)
"""The histogram of the operator's page reaches from here to there [s]."""

EMG_EVERY = 2
"""The operator's page gets one of this many EMG samples: 1,024 of 2,048 a second."""

ROBOT_TRACES = ("position", "limb", "velocity", "torque", "interaction", "drive", "target", "lateness", "estimate",
                "estimate_low", "estimate_high")  # fmt: skip
"""Channels of the robot that the operator's page draws."""

MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml", ".json": "application/json", ".csv": "text/csv; charset=utf-8", ".pdf": "application/pdf",
    ".png": "image/png", ".txt": "text/plain; charset=utf-8",
}  # fmt: skip

SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self' ws://127.0.0.1:* ws://localhost:*; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}

REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'unsafe-inline'; frame-ancestors 'none'"
)
"""What a report may load: it is one file with its scripts in it."""

PAGE_FILES = {"/operator": "operator.html", "/participant": "participant.html"}
"""Pages that need the token, by their paths."""

OPEN_FILES = {"/static/style.css", "/static/operator.js", "/static/participant.js", "/static/frames.js",
              "/static/socket.js", "/static/uPlot.iife.min.js", "/static/uPlot.min.css", "/bare"}  # fmt: skip
"""Files without anything of a study in them, which need no token. The bare page only counts its own frames."""


@dataclass(eq=False)
class Client:
    """One page that is connected."""

    socket: Any
    role: str
    robot_cursor: int = 0
    emg_cursor: int = 0
    heard: float = 0.0  # time of the last sign of life, on the session's clock [s]
    is_present: bool = True  # whether the session counts it
    has_pulse: bool = False  # whether it gives signs of life by itself, as the operator's page does
    pinged: float = 0.0  # time of the last ping [s]


class PageServer:
    """Server of a session's pages, which runs until it is stopped.

    Parameters
    ----------
    session : LiveSession
    port : int
        0 takes a free one.
    token : str, optional
        Secret that pages must know; by default a random one.
    """

    def __init__(self, session: LiveSession, port: int = 0, token: str | None = None):
        self.session, self.port = session, port
        self.token = secrets.token_urlsafe(24) if token is None else token
        self.clients: set[Client] = set()
        self.frame_intervals: list[float] = []  # times between frames of the participant's page [s]
        self.foreign_origins = 0  # sockets of foreign origins that were refused
        self.stopped = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._watched = 0.0  # when the operator's pages were looked at last [s]
        self._pings: set[asyncio.Future] = set()
        self.farewell: float | None = None  # time that pages are served once the session is over [s]; None: for ever
        self._over: float | None = None  # when the session was first seen to be over [s]

    def address(self, page: str) -> str:
        """Return the address of a page, ``"operator"`` or ``"participant"``, with the token."""
        return f"http://{HOST_ADDRESS}:{self.port}/{page}?token={self.token}"

    def end(self) -> None:
        """Stop serving; may be called from another thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self.stopped.set)

    async def run(self, opened: Callable[[PageServer], None] | None = None) -> None:
        """Serve until `stopped` is set; `opened` is called once pages can be opened."""
        self._loop = asyncio.get_running_loop()
        try:
            from websockets.asyncio.server import serve
        except ImportError:
            raise missing_package("live", "websockets", "live") from None

        async with serve(
            self._talk, HOST_ADDRESS, self.port, process_request=self._answer, compression=None,
            max_size=MAX_MESSAGE_BYTES, ping_interval=5, ping_timeout=20,
        ) as server:  # fmt: skip
            self.port = next(iter(server.sockets)).getsockname()[1]
            if opened is not None:
                opened(self)
            stepping = asyncio.create_task(self._step_on())
            ending = asyncio.create_task(self.stopped.wait())
            await asyncio.wait({stepping, ending}, return_when=asyncio.FIRST_COMPLETED)
            if stepping.done():  # an error in the session's own steps is told, not swallowed
                stepping.result()
            stepping.cancel()

    # Requests.

    def _answer(self, connection: Any, request: Any) -> Any:
        """Answer a plain request, refuse a socket that may not connect, or let one through (None)."""
        try:
            parts = urlsplit(request.path)
            query = parse_qs(parts.query)
            said = [text for pair in request.headers.raw_items() for text in pair]
            is_plain = all(text.isascii() for text in (request.path, *said))
        except ValueError:
            is_plain = False
        if not is_plain:
            return self._refuse(connection, HTTPStatus.BAD_REQUEST, "found an invalid address or header")
        hosts = {f"{HOST_ADDRESS}:{self.port}", f"localhost:{self.port}"}
        if only(request.headers.get_all("Host")) not in hosts:
            return self._refuse(connection, HTTPStatus.FORBIDDEN, "this server accepts local requests only")
        told = query.get("token", [""])[0]
        known = secrets.compare_digest(told.encode("utf-8", "surrogatepass"), self.token.encode())
        if parts.path.startswith("/socket/"):
            origin = only(request.headers.get_all("Origin"))
            if origin not in {f"http://{host}" for host in hosts}:
                self.foreign_origins += 1
                return self._refuse(connection, HTTPStatus.FORBIDDEN, f"origin {origin!r} is not a page of this server")
            if not known:
                return self._refuse(connection, HTTPStatus.FORBIDDEN, "wrong token")
            if parts.path.removeprefix("/socket/") not in ("operator", "participant"):
                return self._refuse(connection, HTTPStatus.NOT_FOUND, "no such socket")
            return None
        if parts.path in OPEN_FILES:
            name = "bare.html" if parts.path == "/bare" else parts.path.removeprefix("/static/")
            return self._file(connection, files(__package__).joinpath("page", name).read_bytes(), Path(name).suffix)
        if not known:
            return self._refuse(connection, HTTPStatus.FORBIDDEN, "wrong token")
        if parts.path in PAGE_FILES:
            page = files(__package__).joinpath("page", PAGE_FILES[parts.path]).read_bytes()
            return self._file(connection, page, ".html")
        if parts.path == "/report" and self.session.report is not None and self.session.report.is_file():
            return self._file(connection, self.session.report.read_bytes(), ".html", own_scripts=True)
        return self._refuse(connection, HTTPStatus.NOT_FOUND, "no such page")

    @staticmethod
    def _refuse(connection: Any, status: HTTPStatus, why: str) -> Any:
        return connection.respond(status, f"{why}\n")

    @staticmethod
    def _file(connection: Any, content: bytes, suffix: str, *, own_scripts: bool = False) -> Any:
        from websockets.datastructures import Headers
        from websockets.http11 import Response

        if suffix == ".css":
            from ...study.drawing.style import SANS_SERIF_FONTS, css_variables

            look = f":root {{ {css_variables()} --sans: {SANS_SERIF_FONTS}; }}\n"
            look += f"@media (prefers-color-scheme: dark) {{ :root {{ {css_variables(dark=True)} }} }}\n"
            content = look.encode() + content
        policy = {"Content-Security-Policy": REPORT_POLICY} if own_scripts else {}
        headers = Headers({**SECURITY_HEADERS, **policy})
        headers["Content-Type"] = MEDIA_TYPES.get(suffix, "application/octet-stream")
        headers["Content-Length"] = str(len(content))
        headers["Connection"] = "close"
        return Response(200, "OK", headers, content)

    # Sockets.

    async def _talk(self, socket: Any) -> None:
        role = urlsplit(socket.request.path).path.removeprefix("/socket/")
        client = Client(socket, role, heard=self.session.clock())
        self.clients.add(client)
        self.session.page_opened(role)
        if role == "operator":
            await socket.send(json.dumps({"type": "plan", "rows": self.session.plan_rows()}))
        try:
            async for message in socket:
                await self._take(client, message)
        except Exception as error:  # a page that vanishes may break its socket in any way
            from websockets.exceptions import ConnectionClosed

            if not isinstance(error, ConnectionClosed):
                raise
        finally:
            self.clients.discard(client)
            if client.is_present:
                self.session.page_closed(role)

    async def _take(self, client: Client, message: str | bytes) -> None:
        """Take a page's message; one that is not understood is answered, and changes nothing."""
        self._hear(client)
        answer: dict[str, Any] | None = None
        try:
            told = read_message(message)
            if told.kind == "ping":
                answer = {"type": "pong", "page": told.number("page"), "host": time.monotonic()}
            elif told.kind == "alive":
                client.has_pulse = True
            elif told.kind == "frames" and client.role == "participant":
                self._take_frames(told)
            elif told.kind == "act":
                action = told.word("action")
                why = self.session.act(client.role, action, told.value("value"))
                answer = {"type": "refused", "why": why} if why else {"type": "done", "action": action}
            else:
                raise PellucidError(f"found a message of the type {told.kind!r:.40}, expected one of this page")
        except PellucidError as error:
            answer = {"type": "refused", "why": str(error)}
        if answer is not None:
            await client.socket.send(json.dumps(answer))
        if answer is not None and answer["type"] == "done":
            self._tell_state()
            self._tell_plan()

    def _take_frames(self, told: PageMessage) -> None:
        """Record the times of the participant's frames, and of the frames in which a cue was first drawn."""
        intervals = told.numbers("intervals")[:MAX_FRAME_INTERVALS]
        cues = told.pairs("cues")[:MAX_FRAME_CUES]
        self.frame_intervals += [1e-3 * x for x in intervals]
        data = {"first": told.number("first"), "offset": told.number("offset"), "rtt": told.number("rtt"),
                "intervals": [round(x, 1) for x in intervals], "cues": cues}  # fmt: skip
        self.session.engine.mark("frames", data)

    def _hear(self, client: Client) -> None:
        """Note a sign of life of a page."""
        client.heard = self.session.clock()
        if not client.is_present and client in self.clients:
            client.is_present = True
            self.session.page_opened(client.role)

    def _watch_operators(self, now: float) -> None:
        """Report to the session which operator's pages do not respond, and ping programs without a heartbeat.

        After a pause of this program, pages are not checked, because their heartbeats may still be unread.
        """
        paused, self._watched = now - self._watched > 0.5 * PAGE_SILENCE_S, now
        for client in [c for c in self.clients if c.role == "operator"]:
            if not client.has_pulse and now - client.pinged > PING_INTERVAL_S:
                client.pinged = now
                task = asyncio.ensure_future(self._ping(client))
                self._pings.add(task)
                task.add_done_callback(self._pings.discard)
            if client.is_present and not paused and self.session.clock() - client.heard > PAGE_SILENCE_S:
                client.is_present = False
                self.session.page_closed(client.role, heard=client.heard, is_silent=True)

    async def _ping(self, client: Client) -> None:
        from websockets.exceptions import ConnectionClosed

        with suppress(ConnectionClosed):
            await (await client.socket.ping())
            if not client.has_pulse:
                self._hear(client)

    def _tell_state(self) -> None:
        self._broadcast("operator", json.dumps(self.session.operator_state()))

    def _tell_plan(self) -> None:
        text = json.dumps({"type": "plan", "rows": self.session.plan_rows()})
        self._broadcast("operator", text)

    def _broadcast(self, role: str, message: str | bytes) -> None:
        from websockets.asyncio.server import broadcast

        ready = [c.socket for c in self.clients if c.role == role and _queued(c.socket) < MAX_QUEUED_BYTES]
        if ready:
            broadcast(ready, message)

    # The loop.

    async def _step_on(self) -> None:
        due = {"samples": 0.0, "state": 0.0, "health": 0.0}
        following = time.monotonic()
        plan_at = ""
        told: tuple[object, ...] = ()
        while True:
            now = time.monotonic()
            self._watch_operators(now)
            self.session.step()
            self._broadcast("participant", json.dumps(self.session.participant_state()))
            if now >= due["samples"]:
                due["samples"] = now + SAMPLES_INTERVAL_S
                for client in [c for c in self.clients if c.role == "operator"]:
                    self._send_samples(client)
            if now >= due["state"] or told != self.session.urgent:
                due["state"], told = now + STATE_INTERVAL_S, self.session.urgent
                self._tell_state()
                if plan_at != f"{self.session.phase} {self.session.index}":
                    plan_at = f"{self.session.phase} {self.session.index}"
                    self._tell_plan()
            if now >= due["health"]:
                due["health"] = now + HEALTH_INTERVAL_S
                health = health_numbers(self.session.engine.health())
                self._broadcast("operator", json.dumps({"type": "health", **health}))
            if self._has_said_farewell(now):
                self.stopped.set()
            following = max(following + STEP_S, now)
            await asyncio.sleep(max(following - time.monotonic(), 0.001))

    def _has_said_farewell(self, now: float) -> bool:
        """Return whether the session is over and its pages are closed, or have been served for the time of farewell."""
        if self.farewell is None or self.session.phase != Phase.finished:
            return False
        if self._over is None:
            self._over = now
            self._tell_state()
        return not self.clients or now - self._over >= self.farewell

    def _send_samples(self, client: Client) -> None:
        """Send the samples since the last packet; a page that was away starts with the newest second."""
        session = self.session
        if _queued(client.socket) > MAX_QUEUED_BYTES:
            return
        robot = session.engine.read_since(client.robot_cursor)
        first = client.robot_cursor == 0
        client.robot_cursor = robot.cursor
        packet = sample_packet(0, robot.time, robot.channels, ROBOT_TRACES, last=1000 if first else None)
        self._send(client, packet)
        first = client.emg_cursor == 0
        client.emg_cursor, time, emg = session.emg.read_since(client.emg_cursor)
        thin = {f"emg.{name}": samples[::EMG_EVERY] for name, samples in emg.items()}
        self._send(client, sample_packet(1, time[::EMG_EVERY], thin, tuple(thin), last=1000 if first else None))

    def _send(self, client: Client, packet: bytes) -> None:
        from websockets.asyncio.server import broadcast

        if packet:
            broadcast([client.socket], packet)


@dataclass(frozen=True)
class PageMessage:
    """A message of a page: an object of JSON with a type. Everything else in it may be anything."""

    kind: str
    content: Mapping[str, Any]

    def word(self, key: str) -> str:
        """Return a short text."""
        found = self.content.get(key)
        if not isinstance(found, str) or len(found) > MAX_WORD_CHARACTERS:
            raise PellucidError(f"{self.kind}: found no {key}, expected a word")
        return found

    def value(self, key: str) -> float | None:
        """Return a number as float; None where there is none or it is not finite."""
        return finite_number(self.content.get(key))

    def number(self, key: str) -> float | None:
        """Return a time or a duration of the page; None where there is none.

        Raises
        ------
        PellucidError
            If there is something else.
        """
        found = self.content.get(key)
        return None if found is None else self._page_time(key, found)

    def numbers(self, key: str) -> list[float]:
        """Return a list of times of the page."""
        return [self._page_time(key, each) for each in self._list(key)]

    def pairs(self, key: str) -> list[list[float]]:
        """Return a list of pairs of a number and a time of the page."""
        found = self._list(key)
        if not all(isinstance(each, list) and len(each) == 2 for each in found):
            raise PellucidError(f"{self.kind}: found {key} that are no pairs, expected pairs of numbers")
        return [[self._page_time(key, number) for number in each] for each in found]

    def _list(self, key: str) -> list[Any]:
        found = self.content.get(key, [])
        if not isinstance(found, list):
            raise PellucidError(f"{self.kind}: found {key} that is no list, expected a list of numbers")
        return found

    def _page_time(self, key: str, found: object) -> float:
        number = finite_number(found)
        if number is None or abs(number) > MAX_PAGE_TIME_MS:
            raise PellucidError(f"{self.kind}: found {key} that is no time of a page, expected a number")
        return number


def read_message(text: str | bytes) -> PageMessage:
    """Return a page's message.

    Raises
    ------
    PellucidError
        If it is no object of JSON with a type.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        content = None
    kind = content.get("type") if isinstance(content, dict) else None
    if not isinstance(kind, str):
        raise PellucidError("found an unknown message, expected a JSON object with a type")
    return PageMessage(kind, content)


def only(values: Sequence[str]) -> str | None:
    """Return the value of a header that is there once; None for one that is missing or there again."""
    return values[0] if len(values) == 1 else None


def finite_number(found: object) -> float | None:
    """Return a number of JSON as float; None for anything else, and for one that no float holds."""
    if not isinstance(found, (int, float)) or isinstance(found, bool):
        return None
    try:
        number = float(found)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _queued(socket: Any) -> int:
    """Return how much of what was sent to a page still waits [B]."""
    transport = getattr(socket, "transport", None)
    return 0 if transport is None else transport.get_write_buffer_size()


def sample_packet(
    kind: int, time: np.ndarray, channels: Mapping[str, np.ndarray], names: tuple[str, ...], *, last: int | None = None
) -> bytes:
    """Return samples as a page reads them; nothing if there are none.

    Three 32-bit numbers (kind, number of samples n, number of channels k) and the length of the names, the names as
    JSON padded to 8 bytes, n times as float64 [s], then k times n values as float32.
    """
    shown = [name for name in names if name in channels]
    part = slice(None) if last is None else slice(-last, None)
    at = np.asarray(time, np.float64)[part]
    if not len(at) or not shown:
        return b""
    told = json.dumps(shown).encode()
    told += b" " * (-len(told) % 8)
    values = np.array([np.asarray(channels[name], np.float32)[part] for name in shown], np.float32)
    return struct.pack("<4I", kind, len(at), len(shown), len(told)) + told + at.tobytes() + values.tobytes()


def health_numbers(health: Any) -> dict[str, Any]:
    """Return the engine's health as JSON has it."""
    clocks = getattr(health, "clocks", {}) or {}
    edges, counts = shown_histogram(health.jitter_edges, health.jitter_counts)
    return {
        "cycles": int(health.cycles),
        "late": int(health.late_cycles),
        "missed": int(getattr(health, "missed", 0)),
        "worst": _number(getattr(health, "worst_lateness", float("nan"))),
        "p99": _number(getattr(health, "p99", float("nan"))),
        "edges": edges,
        "counts": counts,
        "fifo": bool(getattr(health, "fifo", False)),
        "locked": bool(getattr(health, "locked", False)),
        "why_not": str(getattr(health, "why_not", "")),
        "clocks": {
            name: {key: _number(getattr(clock, key, float("nan")))
                   for key in ("offset", "drift", "jumps", "batches", "lost", "rate")}
            for name, clock in clocks.items()
        },
    }  # fmt: skip


def shown_histogram(edges: np.ndarray, counts: np.ndarray) -> tuple[list[float], list[int]]:
    """Return the lower edges of the bins that the page draws [s], and their counts.

    What lies below or beyond the drawn range is counted in its first or last bin.
    """
    edges, counts = np.asarray(edges, float), np.asarray(counts, np.int64)
    if not len(counts):
        return [], []
    low, high = SHOWN_LATENESS_S
    first = max(int(np.searchsorted(edges, low, "right")) - 1, 0)
    last = min(max(int(np.searchsorted(edges, high, "right")) - 1, first), len(counts) - 1)
    shown = counts[first : last + 1].copy()
    shown[0] += counts[:first].sum()
    shown[-1] += counts[last + 1 :].sum()
    return edges[first : last + 1].tolist(), shown.tolist()


def _number(value: Any) -> float | None:
    try:
        found = float(value)
    except (TypeError, ValueError):
        return None
    return found if np.isfinite(found) else None
