"""Read files in a separate process if their library may crash on a damaged file, so that only that process dies.

A program has one such process. It starts at the first such file, and again after a file that made it crash. Its
memory and time are limited by the caps on a file. A request is a line of JSON on a pipe; an answer is a line of JSON,
followed by the numbers themselves.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import subprocess
import sys
import threading
from importlib import import_module
from io import BufferedReader, BufferedWriter
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ..personal_fields import PersonalField
from ._caps import max_reading_time, max_unpacked_bytes, require_few_columns, require_unpacked_size
from ._columns import Columns

MAX_COPY_COUNT = 5
"""The process may use memory for this many copies of a file's numbers. Chosen by judgement; no measurement is
recorded."""

MAX_START_S = 120.0
"""The process must start within this time [s], which leaves room for a busy machine."""

_lock = threading.Lock()
_running: dict[int, subprocess.Popen] = {}


def read_apart(reader: str, path: Path) -> Columns:
    """Return the columns that the module `reader`, by its full name, reads from a file, in a separate process."""
    seconds = max_reading_time(path)
    request = {
        "reader": reader,
        "path": str(path.absolute()),
        "memory": MAX_COPY_COUNT * max_unpacked_bytes(path),
        "seconds": seconds,
    }
    with _lock:
        process = _process()
        try:
            answer = _request_answer(process, request, path)
            values = _receive_numbers(process, answer, path)
        except BaseException:
            # The next request must not read the rest of this answer.
            _end(process)
            raise
    if "error" in answer:
        raise RecordingError(answer["error"])
    return Columns(
        path,
        values,
        answer["angle_unit"],
        answer["units"],
        answer["facts"],
        tuple(PersonalField(*found) for found in answer["personal"]),
        damaged=answer["damaged"],
        recordings=tuple(answer["recordings"]),
    )


def start_reading_process() -> None:
    """Start the process before it is needed, so that the first file is read at once."""
    with _lock:
        _process()


def _process() -> subprocess.Popen:
    """Return this program's reading process, and start it if necessary; a forked program starts its own."""
    process = _running.get(os.getpid())
    if process is None or process.poll() is not None:
        root = str(Path(__file__).parents[3])
        # Nothing is imported from the working directory, because that may be a stranger's folder.
        code = f"import sys; sys.path.insert(0, {root!r}); from {__name__} import serve; serve()"
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, env=environment, start_new_session=True,
        )  # fmt: skip
        _running[os.getpid()] = process
        atexit.register(_end, process)
        if not _next_line(process, MAX_START_S):
            raise RecordingError(
                "the process that reads files of this kind did not start; close other programs and try again"
            )
    return process


def _pipes(process: subprocess.Popen) -> tuple[BufferedWriter, BufferedReader]:
    """Return the pipe to a process and the one from it."""
    assert isinstance(process.stdin, BufferedWriter)
    assert isinstance(process.stdout, BufferedReader)
    return process.stdin, process.stdout


def _request_answer(process: subprocess.Popen, request: dict[str, Any], path: Path) -> dict[str, Any]:
    to_process, _ = _pipes(process)
    to_process.write(json.dumps(request).encode() + b"\n")
    to_process.flush()
    late = threading.Event()
    # Loading the libraries has a time limit of its own.
    line = _next_line(process, MAX_START_S) and _next_line(process, request["seconds"], late)
    if line.endswith(b"\n"):
        return json.loads(line)
    why = f"crashed on it (status {_end(process)})"
    if late.is_set():
        why = f"took more than {request['seconds']:.3g} s; to wait longer: PELLUCID_MOST_SECONDS=NUMBER"
    raise RecordingError(f"{path.name}: not readable, truncated or damaged: what reads such files {why}")


def _next_line(process: subprocess.Popen, seconds: float, late: threading.Event | None = None) -> bytes:
    """Return the next line from a process; empty if it dies. After `seconds` it is killed, and `late` is set."""

    def stop() -> None:
        if late is not None:
            late.set()
        process.kill()

    timer = threading.Timer(seconds, stop)
    timer.start()
    try:
        return _pipes(process)[1].readline()
    finally:
        timer.cancel()


def _receive_numbers(process: subprocess.Popen, answer: dict[str, Any], path: Path) -> dict[str, np.ndarray | str]:
    lengths = answer.get("lengths", {})
    require_few_columns(path, len(lengths))
    require_unpacked_size(path, sum(n for n in lengths.values() if not isinstance(n, str)))
    values: dict[str, np.ndarray | str] = {}
    for name, n in lengths.items():
        if isinstance(n, str):
            values[name] = n
            continue
        numbers = values[name] = np.empty(n)
        if n and _pipes(process)[1].readinto(numbers.data) != numbers.nbytes:
            raise RecordingError(f"{path.name}: not readable: the process that reads it ended early")
    return values


def _end(process: subprocess.Popen) -> int | None:
    if _running.get(os.getpid()) is not process:
        return None  # it has ended before, or belongs to the program that this one was forked from
    del _running[os.getpid()]
    process.kill()
    for pipe in _pipes(process):
        pipe.close()
    return process.wait()


def serve() -> None:
    """Answer requests until the pipe is closed."""
    # A library's own output must not mix with the answers.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    _send(out, "ready")
    for line in sys.stdin.buffer:
        request = json.loads(line)
        module = import_module(request["reader"])
        _import_libraries(module.APART)
        with contextlib.suppress(Exception):  # the reader itself says what is wrong with the file
            _import_libraries(module.extra_libraries(Path(request["path"])))
        _send(out, "begun")
        answer, arrays = _answer_request(module, request)
        _send(out, answer, arrays)


def _send(out, answer: object, arrays: tuple[np.ndarray, ...] = ()) -> None:
    out.write(json.dumps(answer).encode() + b"\n")
    for array in arrays:
        out.write(array)
    out.flush()


def _answer_request(module: ModuleType, request: dict[str, Any]) -> tuple[dict[str, Any], tuple[np.ndarray, ...]]:
    path = Path(request["path"])
    _limit_resources(request["memory"], request["seconds"])
    try:
        columns = module.read(path)
        samples = {name: x if isinstance(x, str) else np.asarray(x) for name, x in columns.values.items()}
        arrays = tuple(np.ascontiguousarray(x, np.float64) for x in samples.values() if not isinstance(x, str))
    except RecordingError as error:
        return {"error": str(error)}, ()
    except MemoryError:
        said = f"{path.name}: found more than {1e-6 * request['memory']:.3g} MB to unpack, truncated or damaged"
        return {"error": f"{said}; to read it all the same: PELLUCID_MOST_BYTES=NUMBER"}, ()
    except Exception as error:  # a library may raise anything on unexpected bytes
        return {"error": f"{path.name}: not readable, truncated or damaged: {error!r}"}, ()
    finally:
        _limit_resources(None, None)
    lengths = {name: x if isinstance(x, str) else len(x) for name, x in samples.items()}
    answer = {
        "lengths": lengths,
        "angle_unit": columns.angle_unit,
        "units": dict(columns.units),
        "facts": dict(columns.facts),
        "personal": [(found.kind, found.label, found.place) for found in columns.personal],
        "damaged": columns.damaged,
        "recordings": columns.recordings,
    }
    return answer, arrays


def _import_libraries(libraries: tuple[str, ...]) -> None:
    for library in libraries:
        try:
            import_module(library)
        except ImportError:
            continue  # the reader's own message names the missing library


def _limit_resources(memory: float | None, seconds: float | None) -> None:
    """Limit the memory [B] and processor time [s] used from now on, if the system can; None removes the limit."""
    try:
        import resource

        with open("/proc/self/statm", "rb") as file:
            held = int(file.read().split()[0]) * resource.getpagesize()
        ran = resource.getrusage(resource.RUSAGE_SELF)
        limits = {
            resource.RLIMIT_CORE: 0,
            resource.RLIMIT_AS: memory and held + memory,
            resource.RLIMIT_CPU: seconds and ran.ru_utime + ran.ru_stime + seconds + 1.0,
        }
        for what, limit in limits.items():
            hard = resource.getrlimit(what)[1]
            resource.setrlimit(what, (hard if limit is None else int(limit), hard))
    except (ImportError, OSError, ValueError):
        return
