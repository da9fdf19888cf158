"""What a whole command costs on EMPS: processor seconds of a fresh process, start-up and reading included.

Beside them stand what no program that loads NumPy can go below, and the plainest identification that one would write:
load, filter, differentiate, decimate, solve, without a study, an interval or a picture. Everything runs in turn,
so that a slow moment of the machine meets all; figures are medians of the operating system's own accounts.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pellucid.joint.study.aligned_motions import aligned_motions
from pellucid.study.recorded_motions import drive_model

from ._size import sized
from .identification import study_at

REPEAT_COUNT = sized(5, smallest=1)
"""Number of runs of each command."""

COMMANDS = ("check", "identify", "report")
"""Commands that are timed, in the order in which they run."""

COMMAND_LINE = "from pellucid.__main__ import main; main()"
"""Python code that runs Pellucid's command line."""

PLAIN_FIT = """
import sys
import numpy as np
from scipy import signal
told = np.load(sys.argv[1])
fs, gain, lowpass = (float(told[name]) for name in ("fs", "gain", "lowpass"))
b, a = signal.butter(int(told["order"]), lowpass, fs=fs)
q, effort = signal.filtfilt(b, a, told["position"]), signal.filtfilt(b, a, gain * told["command"])
v = np.gradient(q, 1.0 / fs)
block = np.column_stack([np.gradient(v, 1.0 / fs), v, np.sign(v), np.ones_like(v), np.sin(q), effort])
block = signal.decimate(block, int(told["decimate"]), axis=0, zero_phase=True)
print(np.linalg.lstsq(block[:, :-1], block[:, -1], rcond=None)[0])
"""
"""Python code of the same fit with NumPy and SciPy alone."""


MEASURED_RUN = """
import json, os, subprocess, sys
started = subprocess.Popen([sys.executable, *sys.argv[1:]], stdout=subprocess.DEVNULL)
_, status, used = os.wait4(started.pid, 0)
started.returncode = os.waitstatus_to_exitcode(status)
unit = 1 if sys.platform == "darwin" else 1024
print(json.dumps([started.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss * unit]))
"""
"""Python code that runs Python and prints exit status, processor seconds and peak memory [bytes].

The system counts the memory of the starting process as the started one's peak, so that a small process starts it."""


@dataclass(frozen=True)
class Use:
    """Resources that one run of a program used."""

    seconds: float  # user and system time of the process and those that it started and awaited [s]
    peak_bytes: int  # largest resident memory of one of these processes


def run_measured(*arguments: str) -> Use:
    """Run this Python once, with its byte code kept as an installed package's is, and return what it used."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, "-S", "-c", MEASURED_RUN, *arguments],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env={"OPENBLAS_NUM_THREADS": "1", **kept},
    )
    status, seconds, peak_bytes = json.loads(done.stdout)
    if status:
        raise RuntimeError(f"{' '.join(arguments)}: exit status {status}")
    return Use(seconds, peak_bytes)


def processor_seconds(*arguments: str) -> float:
    """Return user and system seconds of one run of this Python."""
    return run_measured(*arguments).seconds


def run() -> list[dict]:
    """One row for each command, for all of them together, and for what they are measured by."""
    with tempfile.TemporaryDirectory() as folder:
        study = study_at(Path(folder))
        arrays, motion, processing = Path(folder) / "recording.npz", aligned_motions(study, "fit")[0], study.processing
        np.savez(
            arrays, position=motion.raw_position, command=motion.command, fs=motion.fs,
            gain=drive_model(study.rig).gain, order=processing.order, lowpass=processing.lowpass,
            decimate=processing.decimate,
        )  # fmt: skip
        jobs = {
            "start-up: import numpy": ("-c", "import numpy"),
            "plain NumPy and SciPy: least squares": ("-c", PLAIN_FIT, str(arrays)),
            **{f"pellucid {name}": ("-c", COMMAND_LINE, name, str(study.folder)) for name in COMMANDS},
        }
        taken: dict[str, list[float]] = {name: [] for name in jobs}
        for repeat in range(REPEAT_COUNT + 1):  # the first one writes byte code and the fonts' cache
            for name, arguments in jobs.items():
                seconds = processor_seconds(*arguments)
                if repeat:
                    taken[name].append(seconds)
    medians = {name: statistics.median(values) for name, values in taken.items()}
    rows = []
    for name, values in taken.items():
        spread = f"{min(values):.3g} to {max(values):.3g} in {REPEAT_COUNT} runs"
        note = f"processor, a fresh process on '{study.name}'; {spread}"
        shown = f"identify {study.name.upper()}" if name == "pellucid identify" else name
        rows.append({"name": shown, "value": medians[name], "unit": "s", "note": note})
    together = sum(medians[f"pellucid {name}"] for name in COMMANDS)
    rows.append({"name": f"pellucid {', '.join(COMMANDS)}", "value": together, "unit": "s", "note": "sum of the three"})
    ratio = together / medians["plain NumPy and SciPy: least squares"]
    rows.append({"name": f"{study.name.upper()} three over plain", "value": ratio, "unit": "1", "note": "medians"})
    return rows
