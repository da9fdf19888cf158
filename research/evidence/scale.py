"""Hours of recordings: cost of `pellucid identify` and of plain NumPy and SciPy, each in fresh processes.

A virtual joint follows two hours of movements at 1 kHz; its CSV file (time, position, current) is identified with all
five friction families and intervals, first as it is and then again from what was kept of it. The reference is the least
code that a user would write: read the file, filter, differentiate, solve one family. All processor time counts, of
children too, start-up included.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pellucid._atomic import write_text_atomically
from pellucid.models.joint import DEFAULT_FAMILIES
from pellucid.numerics.protocols.excitation import multisine, point_to_point
from pellucid.study.procedures.registry import open_study
from pellucid.study.recorded_motions import drive_model
from pellucid.study.results import ResultRow
from pellucid.study.study import STUDY_FILE
from pellucid_lab.bench.rig import BenchRig, bench_joint
from pellucid_lab.rig import Trial
from pellucid_lab.study_text import study_text
from research.benchmarks._size import sized

SEED = 20261121
"""Seed of every random draw."""

LONG_RECORDING_HOURS = sized(2.0, smallest=0.1)
"""Duration of the long recording [h]."""

SHORT_RECORDING_S = sized(100.0, smallest=60.0)
"""Duration of the short recording [s]."""

PART_DIVISOR = sized(6, smallest=2)
"""The part of the long recording that is identified too is one over this number."""

REPEAT_COUNT = sized(3, smallest=1)
"""Number of runs on the short recording, and of empty starts."""

COMMAND_LINE = "from pellucid.__main__ import main; main()"
"""Python code that runs Pellucid's command line."""

START_UP = "import pellucid.cli, pellucid.study.procedures.run, pellucid.joint.study.identify_joint, scipy.optimize"
"""Python code that imports what `identify` needs, and does nothing."""

PLAIN_FIT = """
import sys
import numpy as np
from scipy import signal
time, position, current = np.loadtxt(sys.argv[1], delimiter=",", skiprows=2).T
lowpass, order, trim, gain = map(float, sys.argv[2:])
fs = (len(time) - 1) / (time[-1] - time[0])
sos = signal.butter(int(order), lowpass, fs=fs, output="sos")
q, effort = signal.sosfiltfilt(sos, position), signal.sosfiltfilt(sos, gain * current)
v = np.gradient(q, 1.0 / fs)
inner = slice(int(trim), len(q) - int(trim))
w = np.column_stack([np.gradient(v, 1.0 / fs), np.sin(q), v, np.sign(v), np.ones_like(v)])[inner]
values, rest, *_ = np.linalg.lstsq(w, effort[inner], rcond=None)
print(values, 1.96 * np.sqrt(np.diag(np.linalg.inv(w.T @ w)) * rest / len(w)))
"""
"""Python code of the same fit with NumPy and SciPy alone."""


def movements(rig: BenchRig, duration: float, rng: np.random.Generator) -> np.ndarray:
    """A reference, (n,) [rad], of a `duration` [s]: minutes of moves between targets and minutes of waves in turn."""
    span = rig["motion_range"]
    centre, half = 0.5 * (span["low"] + span["high"]), 0.5 * (span["high"] - span["low"])
    steps = point_to_point(duration, rig.rate, dwell=0.2, rng=rng, **span)
    waves = multisine(60.0, rig.rate, fundamental=0.1, harmonics=12, amplitude=half, centre=centre, rng=rng)
    minute, made = round(60.0 * rig.rate), steps
    ease = np.minimum(1.0, np.minimum(np.arange(minute), np.arange(minute)[::-1]) / rig.rate)
    for first in range(minute, len(made) - minute + 1, 3 * minute):
        # From the steps into the waves and back within a second.
        made[first : first + minute] = (1.0 - ease) * steps[first : first + minute] + ease * waves
    return made


def record(folder: Path, seconds: float) -> Path:
    """A study in a `folder` whose only recording is a CSV file of `seconds`: time, position, current."""
    rig, rng = bench_joint(), np.random.default_rng(SEED)
    reference = movements(rig, seconds, rng)
    read = rig.play(reference, 1, rng)
    columns = np.column_stack([read["time"], read["position"][0], read["current"][0]])
    said = rig.study([rig.record(Trial("long", reference=reference[:1000]), rng)])
    del said["channels"]["reference"], said["rig"]["loop"]
    said["model"]["families"] = list(DEFAULT_FAMILIES)
    path = folder / said["recordings"][0]["file"]
    path.parent.mkdir(parents=True)
    with path.open("w", encoding="utf-8") as file:
        file.write("# units: time [s], position [rad], current [A]\ntime,position,current\n")
        for first in range(0, len(columns), 100_000):
            rows = columns[first : first + 100_000]
            file.write(("%.3f,%.6f,%.4f\n" * len(rows)) % tuple(rows.ravel().tolist()))
    write_text_atomically(folder / STUDY_FILE, study_text({**said, "name": "hours"}, rig.comments))
    return path


def used(*arguments: str) -> tuple[float, float, float]:
    """Processor seconds of one run of this Python, of its children too, its wall seconds, and its largest memory
    [MB]."""
    # Byte code is kept, as an installed package's is.
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    began = time.perf_counter()
    started = subprocess.Popen(
        [sys.executable, *arguments],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={"OPENBLAS_NUM_THREADS": "1", **kept},
    )
    _, status, spent = os.wait4(started.pid, 0)
    wall = time.perf_counter() - began
    started.returncode = os.waitstatus_to_exitcode(status)
    if started.returncode:
        raise RuntimeError(f"{' '.join(arguments)}: exit status {started.returncode}")
    return spent.ru_utime + spent.ru_stime, wall, spent.ru_maxrss / 1024.0


def identified(folder: Path) -> tuple[float, float, float]:
    """What `pellucid identify` of a study takes, as `used` tells it."""
    return used("-c", COMMAND_LINE, "identify", str(folder))


def plain(folder: Path, path: Path) -> tuple[float, float, float]:
    """What plain NumPy and SciPy take for one family of it."""
    study = open_study(folder)
    p = study.processing
    told = (p.lowpass, p.order, p.trim, drive_model(study.rig).gain)
    return used("-c", PLAIN_FIT, str(path), *map(str, told))


def rows() -> Iterator[ResultRow]:
    """Yield processor time relative to the reference method's, memory, seconds of 100 s of data, and seconds per hour
    of 20 min over 2 h.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "hours"
        path = record(folder, 3600.0 * LONG_RECORDING_HOURS)
        # In turn, so that a slow moment of the machine meets both.
        rivals = [plain(folder, path)]
        first = identified(folder)
        rivals.append(plain(folder, path))
        again = identified(folder)
        rivals.append(plain(folder, path))
        theirs = sorted(rivals)[1]
        size = path.stat().st_size
        short, part = Path(place) / "short", Path(place) / "part"
        record(short, SHORT_RECORDING_S)
        record(part, 3600.0 * LONG_RECORDING_HOURS / PART_DIVISOR)
        started = [used("-c", START_UP)[1] for _ in range(REPEAT_COUNT)]
        taken = [identified(short)[1] for _ in range(REPEAT_COUNT)]
        shorter = identified(part)
    families = f"{len(DEFAULT_FAMILIES)} families with intervals"
    told = f"{LONG_RECORDING_HOURS:g} h at 1 kHz, CSV of {size / 1e6:.0f} MB, {families}"
    rival = "over numpy.loadtxt, sosfiltfilt and lstsq of one family"
    wall = statistics.median(taken) - statistics.median(started)
    beside = f"{theirs[2]:.0f} MB with NumPy"
    spread = f"median of {min(r[0] for r in rivals):.1f} to {max(r[0] for r in rivals):.1f} s"
    yield _row(
        "numpy.cpu",
        theirs[0],
        "s",
        f"loadtxt, sosfiltfilt, lstsq of one family, {LONG_RECORDING_HOURS:g} h at 1 kHz; {spread}",
    )
    for name, (cpu, seconds, memory) in (("first", first), ("again", again)):
        yield _row(f"identify.cpu.{name}", cpu, "s", f"{told}; {seconds:.0f} s of wall time, {memory:.0f} MB")
        yield _row(f"identify.over_numpy.{name}", cpu / theirs[0], "1", f"{told}; processor, {rival}")
    yield _row("identify.memory", max(first[2], again[2]), "MB", f"{told}; largest resident set, {beside}")
    spread = f"{min(taken):.1f} to {max(taken):.1f} s with start-up"
    yield _row(
        "identify.short.wall",
        wall,
        "s",
        f"{SHORT_RECORDING_S:g} s at 1 kHz after start-up, median of {REPEAT_COUNT}; {spread}",
    )
    growth = first[0] / shorter[0]
    yield _row(
        "identify.growth", growth, "1", f"processor of {LONG_RECORDING_HOURS:g} h over that of a {PART_DIVISOR}th of it"
    )


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"scale.{name}", value, unit, "evidence", "simulated", None, note)
