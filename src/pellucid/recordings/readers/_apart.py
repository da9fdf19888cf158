"""Files whose libraries may crash on a damaged one are read by a process of their own, which may die alone.

One such process serves a program: it starts at the first such file, and again after one that brought it down. Its
memory and time are limited by what a file may hold. A request is a line of JSON, an answer a line of JSON and then the
numbers themselves, on a pipe.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import threading
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._caps import most_bytes, most_seconds, require_few, require_small
from ._columns import Columns

COPIES = 5
"""How many times a reader may hold a file's numbers at once."""

START = 120.0
"""In which the process must have started [s]; a busy machine may take long."""

_lock = threading.Lock()
_running: dict[int, subprocess.Popen] = {}


def read_apart(reader: str, path: Path) -> Columns:
    """What the module `reader` of this package reads of a file."""
    seconds = most_seconds(path)
    request = {"reader": reader, "path": str(path.absolute()), "memory": COPIES * most_bytes(path), "seconds": seconds}
    with _lock:
        process = _process()
        try:
            answer = _answer(process, request, path)
            values = _numbers(process, answer, path)
        except BaseException:
            # Whoever asks next must not read what is left of this answer.
            _end(process)
            raise
    if "error" in answer:
        raise RecordingError(answer["error"])
    return Columns(path, values, answer["angle_unit"], answer["units"])


def _process() -> subprocess.Popen:
    """The process that reads for this one; a fork starts its own."""
    process = _running.get(os.getpid())
    if process is None or process.poll() is not None:
        root = str(Path(import_module(__package__.partition(".")[0]).__file__).parents[1])
        # Nothing is imported from where the user stands: that may be a stranger's folder.
        code = f"import sys; sys.path.insert(0, {root!r}); from {__name__} import serve; serve()"
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, env=environment, start_new_session=True,
        )  # fmt: skip
        _running[os.getpid()] = process
        atexit.register(_end, process)
        if not _line(process, START):
            raise RecordingError("the process that reads files of this kind did not start")
    return process


def _answer(process: subprocess.Popen, request: dict[str, Any], path: Path) -> dict[str, Any]:
    process.stdin.write(json.dumps(request).encode() + b"\n")
    process.stdin.flush()
    late = threading.Event()
    # Its libraries take their own time to load.
    line = _line(process, START) and _line(process, request["seconds"], late)
    if line.endswith(b"\n"):
        return json.loads(line)
    why = f"crashed on it (status {_end(process)})"
    if late.is_set():
        why = f"took more than {request['seconds']:.3g} s; to wait longer: PELLUCID_MOST_SECONDS=NUMBER"
    raise RecordingError(f"{path.name}: not readable, truncated or damaged: what reads such files {why}")


def _line(process: subprocess.Popen, seconds: float, late: threading.Event | None = None) -> bytes:
    """The next line that a process says; empty if it dies, which it does after so long, and then `late` is set."""

    def stop() -> None:
        if late is not None:
            late.set()
        process.kill()

    timer = threading.Timer(seconds, stop)
    timer.start()
    try:
        return process.stdout.readline()
    finally:
        timer.cancel()


def _numbers(process: subprocess.Popen, answer: dict[str, Any], path: Path) -> dict[str, np.ndarray | str]:
    lengths = answer.get("lengths", {})
    require_few(path, len(lengths))
    require_small(path, sum(n for n in lengths.values() if not isinstance(n, str)))
    values: dict[str, np.ndarray | str] = {}
    for name, n in lengths.items():
        values[name] = n if isinstance(n, str) else np.empty(n)
        if isinstance(n, int) and n and process.stdout.readinto(values[name]) != values[name].nbytes:
            raise RecordingError(f"{path.name}: not readable: the process that reads it ended early")
    return values


def _end(process: subprocess.Popen) -> int | None:
    if _running.get(os.getpid()) is not process:
        return None  # another's, inherited by a fork, or ended before
    del _running[os.getpid()]
    process.kill()
    process.stdin.close()
    process.stdout.close()
    return process.wait()


def serve() -> None:
    """Answer requests until there are no more."""
    # What a library prints must not come between the answers.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    _say(out, "ready")
    for line in sys.stdin.buffer:
        request = json.loads(line)
        module = import_module(f".{request['reader']}", __package__)
        _load(module.APART)
        _say(out, "begun")
        answer, arrays = _served(module, request)
        _say(out, answer, arrays)


def _say(out, answer: object, arrays: tuple[np.ndarray, ...] = ()) -> None:
    out.write(json.dumps(answer).encode() + b"\n")
    for array in arrays:
        out.write(array)
    out.flush()


def _served(module: ModuleType, request: dict[str, Any]) -> tuple[dict[str, Any], tuple[np.ndarray, ...]]:
    path = Path(request["path"])
    _limit(request["memory"], request["seconds"])
    try:
        columns = module.read(path)
        samples = {name: x if isinstance(x, str) else np.asarray(x) for name, x in columns.values.items()}
        arrays = tuple(np.ascontiguousarray(x, np.float64) for x in samples.values() if not isinstance(x, str))
    except RecordingError as error:
        return {"error": str(error)}, ()
    except MemoryError:
        said = f"{path.name}: found more than {1e-6 * request['memory']:.3g} MB to unpack, truncated or damaged"
        return {"error": f"{said}; to read it all the same: PELLUCID_MOST_BYTES=NUMBER"}, ()
    except Exception as error:  # whatever a library raises on bytes that it did not expect
        return {"error": f"{path.name}: not readable, truncated or damaged: {error!r}"}, ()
    finally:
        _limit(None, None)
    lengths = {name: x if isinstance(x, str) else len(x) for name, x in samples.items()}
    return {"lengths": lengths, "angle_unit": columns.angle_unit, "units": dict(columns.units)}, arrays


def _load(libraries: tuple[str, ...]) -> None:
    for library in libraries:
        try:
            import_module(library)
        except ImportError:
            continue  # the reader itself says what it lacks


def _limit(memory: float | None, seconds: float | None) -> None:
    """So much more memory [B] and processor time [s], where the system can limit them; None: as much as there is."""
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
