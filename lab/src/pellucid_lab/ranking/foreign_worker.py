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

JOINT_COUNTS = {"knee": 1, "elbow": 1, "arm": 4}
"""Number of joints of each robot that a law may be for, in the order of robots' numbers in requests."""

ROBOT_NAMES = tuple(JOINT_COUNTS)
"""Names of these robots."""

MAX_JOINTS = max(JOINT_COUNTS.values())
"""Number of joints for which requests and replies have room."""

PYTHON_METHODS = {"knee": "step", "elbow": "elbow_step", "arm": "arm_step"}
"""Method of the class ``Law`` for each robot."""

C_FUNCTIONS = {"knee": "law_step", "elbow": "elbow_step", "arm": "arm_step"}
"""Function of a library for each robot."""

RESET_REQUEST = -1.0
"""Request that replaces a robot's number to reset the law."""

REQUEST_FORMAT = struct.Struct(f"<{2 + 2 * MAX_JOINTS}d")
"""What is asked once a period: a robot's number or `RESET_REQUEST`, time [s], positions [rad], torques [N m].

The torque is that of the spring at the knee, and what force sensors read of the wearer elsewhere. Joints that a robot
lacks have 0."""

REPLY_FORMAT = struct.Struct(f"<{MAX_JOINTS}d")
"""The efforts that the law asks for [N m]."""


def load_python(path: Path):
    """Return the functions by robot and `reset` of the class ``Law`` of a Python file."""
    spec = importlib.util.spec_from_file_location("foreign_law", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path}: found no way to load it, expected a file of Python")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    law = module.Law()
    found = {robot: getattr(law, name) for robot, name in PYTHON_METHODS.items() if hasattr(law, name)}
    return {robot: step if JOINT_COUNTS[robot] > 1 else of_one_joint(step) for robot, step in found.items()}, law.reset


def load_library(path: Path):
    """Return the functions by robot and ``law_reset`` of a shared library.

    A function for one joint is of three doubles; one for several joints is of the time and three arrays, of which it
    fills the last with efforts.
    """
    library = ctypes.CDLL(str(path))
    found = {robot: getattr(library, name) for robot, name in C_FUNCTIONS.items() if hasattr(library, name)}
    steps = {}
    for robot, step in found.items():
        if JOINT_COUNTS[robot] == 1:
            step.restype = ctypes.c_double
            step.argtypes = [ctypes.c_double] * 3
            steps[robot] = of_one_joint(step)
        else:
            steps[robot] = of_several_joints(step, ctypes.c_double * JOINT_COUNTS[robot])
    library.law_reset.restype = None
    return steps, library.law_reset


def of_one_joint(step):
    """Return a function of lists of one joint that calls a function of numbers."""
    return lambda time, position, torque: [step(time, position[0], torque[0])]


def of_several_joints(step, array):
    """Return a function of lists that calls a library's function of arrays of a type."""
    step.restype = None
    step.argtypes = [ctypes.c_double, array, array, array]

    def asked(time, position, torque):
        efforts = array(*[float("nan")] * len(position))
        step(time, array(*position), array(*torque), efforts)
        return list(efforts)

    return asked


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
        kind, time, *read = REQUEST_FORMAT.unpack(request)
        efforts, joints = [], 0
        if kind == RESET_REQUEST:
            reset()
        else:
            robot = ROBOT_NAMES[int(kind)]
            joints = JOINT_COUNTS[robot]
            efforts = [float(x) for x in steps[robot](time, read[:joints], read[MAX_JOINTS : MAX_JOINTS + joints])]
        if len(efforts) != joints:
            raise ValueError(f"{path}: found {len(efforts)} efforts, expected {joints}, one for each joint")
        os.write(replies, REPLY_FORMAT.pack(*efforts, *[0.0] * (MAX_JOINTS - joints)))


if __name__ == "__main__":
    main()
