"""The server of the operator's and the participant's page: files and two kinds of websocket, on this computer alone.

Every request must name this computer as its host, and every page and socket must know the session's token. A socket
must also come from a page of this server: a foreign origin is refused. Nothing is compressed, and nothing is loaded
from anywhere else.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from .._errors import PellucidError, missing_package
from .live_session import LiveSession, Phase

HOST_ADDRESS = "127.0.0.1"
"""Address that the server listens on: this computer alone."""

STEP_S = 1.0 / 60.0
"""Time between two steps of the session [s]; each sends a message to the participant's page."""

SAMPLES_INTERVAL_S = 0.05
"""Time between two packets of samples to the operator's page [s]."""

STATE_INTERVAL_S = 0.2
"""Time between two states that the operator's page is told [s]."""

HEALTH_INTERVAL_S = 0.5
"""Time between two accounts of the engine's cycles and of clocks [s]."""

MAX_MESSAGE_BYTES = 20_000
"""A page's message is at most this long [B]."""

MAX_QUEUED_BYTES = 4_000_000
"""A page that falls behind by more than this is left out until it has caught up [B]."""

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
    frames: list[float] = field(default_factory=list)


class PageServer:
    """Serves a session's pages until it is told to stop.

    Parameters
    ----------
    session : LiveSession
    port : int
        0 takes a free one.
    token : str, optional
        Secret that pages must know; drawn if left out.
    """

    def __init__(self, session: LiveSession, port: int = 0, token: str | None = None):
        self.session, self.port = session, port
        self.token = secrets.token_urlsafe(24) if token is None else token
        self.clients: set[Client] = set()
        self.frame_intervals: list[float] = []  # times between frames of the participant's page [s]
        self.foreign_origins = 0  # sockets of foreign origins that were refused
        self.stopped = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.ends_with_session = False  # whether the server stops by itself once the session is over

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
        parts = urlsplit(request.path)
        query = parse_qs(parts.query)
        hosts = {f"{HOST_ADDRESS}:{self.port}", f"localhost:{self.port}"}
        if request.headers.get("Host") not in hosts:
            return self._refuse(connection, HTTPStatus.FORBIDDEN, "this server answers to this computer's name alone")
        known = secrets.compare_digest(query.get("token", [""])[0], self.token)
        if parts.path.startswith("/socket/"):
            origin = request.headers.get("Origin")
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
        if parts.path == "/report" and self.session.report is not None:
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
            from ..drawing.style import SANS_SERIF_FONTS, css_variables

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
        client = Client(socket, role)
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
            self.session.page_closed(role)

    async def _take(self, client: Client, message: str | bytes) -> None:
        """Take a page's message; one that is not understood is answered, and changes nothing."""
        try:
            told = json.loads(message)
            kind = told["type"]
        except (ValueError, TypeError, KeyError):
            await client.socket.send(json.dumps({"type": "refused", "why": "found no message of this server's pages"}))
            return
        if kind == "ping":
            await client.socket.send(json.dumps({"type": "pong", "page": told.get("page"), "host": time.monotonic()}))
        elif kind == "frames" and client.role == "participant":
            self._take_frames(told)
        elif kind == "act":
            value = told.get("value")
            value = float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None
            try:
                why = self.session.act(client.role, str(told.get("action")), value)
            except PellucidError as error:
                why = str(error)
            if why:
                await client.socket.send(json.dumps({"type": "refused", "why": why}))
            self._tell_plan()

    def _take_frames(self, told: Mapping[str, Any]) -> None:
        """Record the times of the participant's frames, and of the frames in which a cue was first drawn."""
        intervals = [float(x) for x in told.get("intervals", ()) if isinstance(x, (int, float))][:400]
        self.frame_intervals += [1e-3 * x for x in intervals]
        data = {"first": told.get("first"), "offset": told.get("offset"), "rtt": told.get("rtt"),
                "intervals": [round(x, 1) for x in intervals], "cues": list(told.get("cues", ()))[:20]}  # fmt: skip
        self.session.engine.mark("frames", data)

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
        while True:
            now = time.monotonic()
            self.session.step()
            self._broadcast("participant", json.dumps(self.session.participant_state()))
            if now >= due["samples"]:
                due["samples"] = now + SAMPLES_INTERVAL_S
                for client in [c for c in self.clients if c.role == "operator"]:
                    self._send_samples(client)
            if now >= due["state"]:
                due["state"] = now + STATE_INTERVAL_S
                self._broadcast("operator", json.dumps(self.session.operator_state()))
                if plan_at != f"{self.session.phase} {self.session.index}":
                    plan_at = f"{self.session.phase} {self.session.index}"
                    self._tell_plan()
            if now >= due["health"]:
                due["health"] = now + HEALTH_INTERVAL_S
                health = health_numbers(self.session.engine.health())
                self._broadcast("operator", json.dumps({"type": "health", **health}))
            if self.ends_with_session and self.session.phase == Phase.finished:
                self.stopped.set()
            following = max(following + STEP_S, now)
            await asyncio.sleep(max(following - time.monotonic(), 0.001))

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
