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

ROBOT_NAMES = ("knee", "elbow")
"""Robots that a law may be for, in the order of their numbers in requests."""

PYTHON_METHODS = {"knee": "step", "elbow": "elbow_step"}
"""Method of the class ``Law`` for each robot."""

C_FUNCTIONS = {"knee": "law_step", "elbow": "elbow_step"}
"""Function of a library for each robot."""

RESET_REQUEST = -1.0
"""What is asked in place of a robot's number to reset the law."""

REQUEST_FORMAT = struct.Struct("<4d")
"""What is asked once a period: a robot's number or `RESET_REQUEST`, time [s], position [rad] and torque [N m].

The torque is that of the spring at the knee, that of the force sensor at the elbow."""

REPLY_FORMAT = struct.Struct("<d")
"""The effort that the law asks for [N m]."""


def load_python(path: Path):
    """Return the functions by robot and `reset` of the class ``Law`` of a Python file."""
    spec = importlib.util.spec_from_file_location("foreign_law", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path}: found no way to load it, expected a file of Python")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    law = module.Law()
    return {robot: getattr(law, name) for robot, name in PYTHON_METHODS.items() if hasattr(law, name)}, law.reset


def load_library(path: Path):
    """Return the functions by robot, of three doubles each, and ``law_reset`` of a shared library."""
    library = ctypes.CDLL(str(path))
    found = {robot: getattr(library, name) for robot, name in C_FUNCTIONS.items() if hasattr(library, name)}
    for step in found.values():
        step.restype = ctypes.c_double
        step.argtypes = [ctypes.c_double] * 3
    library.law_reset.restype = None
    return found, library.law_reset


def main() -> None:
    """Answer requests until the pipe is closed."""
    path, requests, replies, memory = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    steps, reset = load_python(path) if path.suffix == ".py" else load_library(path)
    if not steps:
        raise LookupError(f"{path}: found none of {', '.join(C_FUNCTIONS.values())}, expected one of them")
    # Once the law is loaded: for which robots it has a function.
    os.write(replies, bytes(robot in steps for robot in ROBOT_NAMES))
    while True:
        request = os.read(requests, REQUEST_FORMAT.size)
        if len(request) < REQUEST_FORMAT.size:
            return
        kind, time, position, torque = REQUEST_FORMAT.unpack(request)
        if kind == RESET_REQUEST:
            reset()
            os.write(replies, REPLY_FORMAT.pack(0.0))
        else:
            effort = steps[ROBOT_NAMES[int(kind)]](time, position, torque)
            os.write(replies, REPLY_FORMAT.pack(float(effort)))


if __name__ == "__main__":
    main()
