"""Run one foreign law in a process of its own: it reads samples from one pipe and writes efforts to another.

This file is run by itself, ``python -I foreign_worker.py LAW IN OUT MEMORY``, and imports nothing of the package: a
stranger's code gets an interpreter with limited memory and no standard output, and can end nothing but itself. It is
not a sandbox against malice: the code may read files and use the network as its user may.
"""

import ctypes
import importlib.util
import os
import resource
import struct
import sys
from pathlib import Path

REQUEST_FORMAT = struct.Struct("<4d")
"""What is asked once a period: 1 to reset or 0 to step, time [s], position [rad], torque of the spring [N m]."""

REPLY_FORMAT = struct.Struct("<d")
"""The effort that the law asks for [N m]."""

READY_MESSAGE = b"ready"
"""What the worker writes once the law is loaded."""


def load_python(path: Path):
    """Return `step` and `reset` of the class ``Law`` of a Python file."""
    spec = importlib.util.spec_from_file_location("foreign_law", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path}: found no way to load it, expected a file of Python")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    law = module.Law()
    return law.step, law.reset


def load_library(path: Path):
    """Return `step` and `reset` of a shared library: ``law_step`` of three doubles, and ``law_reset``."""
    library = ctypes.CDLL(str(path))
    library.law_step.restype = ctypes.c_double
    library.law_step.argtypes = [ctypes.c_double] * 3
    library.law_reset.restype = None
    return library.law_step, library.law_reset


def main() -> None:
    """Answer requests until the pipe is closed."""
    path, requests, replies, memory = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    step, reset = load_python(path) if path.suffix == ".py" else load_library(path)
    os.write(replies, READY_MESSAGE)
    while True:
        request = os.read(requests, REQUEST_FORMAT.size)
        if len(request) < REQUEST_FORMAT.size:
            return
        kind, time, position, torque = REQUEST_FORMAT.unpack(request)
        if kind:
            reset()
            os.write(replies, REPLY_FORMAT.pack(0.0))
        else:
            os.write(replies, REPLY_FORMAT.pack(float(step(time, position, torque))))


if __name__ == "__main__":
    main()
