"""An exported controller compiled into this process, stepped through its C interface."""

import ctypes
import subprocess
import tempfile
from functools import cache
from hashlib import sha256
from pathlib import Path
from unittest.mock import patch

import numpy as np

from pellucid import _core
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.export.c_folder import write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.controllers.export.replay_vector import SUPERVISOR_VARIANTS
from pellucid.controllers.supervised import SUPERVISOR_NAMES


@cache
def libraries() -> tempfile.TemporaryDirectory:
    """The folder of all controllers that this process compiled."""
    return tempfile.TemporaryDirectory(prefix="exported-")


def compiled_library(folder: Path) -> Path:
    """An exported controller as a library; folders that differ in their constants alone share one."""
    source = folder / "pellucid_controller.cpp"
    code = [source, folder / "pellucid_controller.h", *sorted((folder / "include" / "pellucid").iterdir())]
    library = Path(libraries().name) / f"{sha256(b''.join(path.read_bytes() for path in code)).hexdigest()[:20]}.so"
    if not library.exists():
        options = ["-std=c++17", "-O2", "-ffp-contract=off", "-fno-exceptions", "-fno-rtti", "-shared", "-fPIC"]
        where = [f"-I{folder / 'include'}", f"-I{folder}"]
        subprocess.run(["c++", *options, *where, str(source), "-o", str(library)], check=True)
    return library


def written(values: ControllerValues, folder: Path) -> Path:
    """An exported folder whose test vector is not played: for what is stepped here, and not by its own Makefile."""
    with patch("pellucid.controllers.export.c_folder.record_outputs", return_value=[]):
        return write_c_folder("bench", values, folder)


class Sample(ctypes.Structure):
    _fields_ = (
        ("value", ctypes.c_float),
        ("sequence", ctypes.c_uint32),
        ("time_us", ctypes.c_int64),
        ("valid", ctypes.c_uint32),
    )


class Output(ctypes.Structure):
    _fields_ = (
        ("effort", ctypes.c_float),
        *((name, ctypes.c_uint32) for name in ("fault", "steps", "enable", "mode", "challenge")),
    )


class Logged(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_uint32) for name in ("step", "fault", "mode"))


class Loaded:
    """An exported controller in this process."""

    def __init__(self, folder: Path, values: ControllerValues):
        law = LAWS[values.law]
        self.core = ctypes.CDLL(str(compiled_library(folder)))

        class Input(ctypes.Structure):
            _fields_ = (
                ("now_us", ctypes.c_int64),
                *((s.name, Sample) for s in law.sensors),
                ("drive", Sample),
                ("joint", Sample),
                ("token", ctypes.c_uint32),
            )

        class Config(ctypes.Structure):
            _fields_ = tuple((name, ctypes.c_float) for name in (*law.parameters, *SUPERVISOR_NAMES))

        self.law, self.values, self.input_type, self.config_type = law, values, Input, Config
        self.core.pellucid_log.restype = Logged
        # The law's own faults, unless a test asks for more.
        self.numbers = {**values.numbers, **values.supervised.supervision, **SUPERVISOR_VARIANTS["law"]}
        self.context = (ctypes.c_uint64 * (1 + _core.supervised_storage(values.law) // 8))()
        self.period = round(1e6 * values.numbers["period"])
        self.now, self.count = 10**6, 0

    def init(self, *, power_on: bool = True, **changed: float) -> int:
        """Start with numbers `changed`, from a memory that is zero at `power_on`."""
        if power_on:
            ctypes.memset(self.context, 0, ctypes.sizeof(self.context))
        config = self.config_type(*({**self.numbers, **changed}[n] for n in (*self.law.parameters, *SUPERVISOR_NAMES)))
        return self.core.pellucid_init(self.context, ctypes.byref(config))

    def step(self, *readings: float, token: int = 0, drive: float | None = None, **changed) -> Output:
        """One period on; `changed` alters the first sample, or `now_us`."""
        self.now, self.count = self.now + self.period, self.count + 1
        read = self.input_type(self.now, *(Sample(x, self.count, self.now - 50, 1) for x in readings))
        read.token = token
        if drive is not None:
            read.drive = Sample(drive, self.count, self.now - 50, 1)
        for name, value in changed.items():
            setattr(read if name == "now_us" else read.position, name, value)
        output = Output()
        assert self.core.pellucid_step(self.context, ctypes.byref(read), ctypes.byref(output)) == output.fault
        return output

    def probe_answer(self) -> tuple[tuple[float, ...], int]:
        """What the robot has answered the probe, and from how many windows that was learnt."""
        answer = (ctypes.c_float * 6)()
        windows = self.core.pellucid_probe_answer(self.context, answer)
        return tuple(answer), windows


def nonsense(robot: Loaded, rng: np.random.Generator, cycles: int = 20_000) -> None:
    """NaN, infinities, jumps, clocks and numbers that leap: every effort finite, within its limit and its rate."""
    n = robot.values.numbers
    limit, change = np.float32(n["effort_limit"]), n["rate_limit"] * n["period"] * (1 + 1e-5) + 1e-6
    odd = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-42, 0.0])
    last, moved, faults = 0.0, 0, 0
    for i in range(cycles):
        if i % 20 == 0:
            assert robot.init() == 0
            last, phase = 0.0, rng.uniform(0, 6)
        changed = {}
        draw = rng.random()
        if draw < 0.03:
            changed["value"] = float(rng.choice(odd))
        elif draw < 0.04:
            changed["time_us"] = int(rng.integers(-(2**63), 2**63 - 1))
        elif draw < 0.05:
            changed["sequence"] = int(rng.integers(0, 2**32))
        elif draw < 0.06:
            changed["now_us"] = int(rng.integers(-(2**63), 2**63 - 1))
        position = 0.5 + 0.5 * np.sin(phase + 3.0 * robot.count * n["period"])
        others = [float(rng.choice(odd)) if rng.random() < 0.02 else rng.normal() for _ in robot.law.sensors[1:]]
        out = robot.step(position, *others, **changed)
        assert abs(out.effort) <= limit
        # At a stop the effort into it is cut at once.
        if abs(out.effort) > abs(last) or out.effort * last < 0:
            assert abs(out.effort - last) <= change
        if out.fault:
            assert abs(out.effort) <= abs(last)
        last, moved, faults = out.effort, moved + (out.effort != 0), faults + (out.fault != 0)
    assert moved > cycles // 4
    assert faults > cycles // 100
