"""Cost of whole commands and of the usual alternatives: processor seconds of fresh processes, by turns.

- `version` and, in an unchanged study, `report`, each compared with an empty program.
- `identify` of one long recording of a virtual joint, compared with pandas, which reads the same file, and a
  least-squares fit in NumPy and SciPy.
- `simulate` of six people who point, compared with the same movements in memory; `assess` of them, compared with
  PyArrow, which reads the same files.
- second call of `fit_joint`, compared with a filter and NumPy's least squares on the same arrays; and the first call in
  a fresh process.
- `audit` of a file with 1,000 columns, most of which are sums and differences of others.

Peak memory is that of the largest process of a command.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy import signal

import pellucid as pl

from ._size import sized
from .commands import COMMAND_LINE, Use, processor_seconds, run_measured
from .identification import study_at
from .people import COMMON_EXPONENTS

REPEAT_COUNT = sized(3, smallest=1)
"""Number of runs of each pair of programs."""

LONG_SAMPLE_COUNTS = sized((100_000, 7_200_000), smallest=(20_000,))
"""Samples of the long recordings, at 1 kHz."""

LONG_COLUMN_COUNT = 3
"""Columns of the long recordings."""

SAMPLING_RATE_HZ = 1000.0
"""Sampling rate of the long recordings [Hz]."""

LONG_STUDY = """
name = "long"
[rig]
motion = "rotary"
drive = { kind = "torque" }
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "tau", unit = "N*m" }
[processing]
lowpass = "20 Hz"
decimate = 10
[[recordings]]
name = "long"
file = "recordings/long.csv"
use = "fit"
"""
"""The study of a long recording."""

PANDAS_FIT = f"""
import sys
import numpy as np
import pandas
from scipy import signal
table = pandas.read_csv(sys.argv[1])
b, a = signal.butter(4, 20.0, fs={SAMPLING_RATE_HZ})
q, effort = signal.filtfilt(b, a, table["q"]), signal.filtfilt(b, a, table["tau"])
v = np.gradient(q, 1.0 / {SAMPLING_RATE_HZ})
block = np.column_stack([np.gradient(v, 1.0 / {SAMPLING_RATE_HZ}), v, np.sign(v), np.ones_like(v), np.sin(q), effort])
block = signal.decimate(block, 10, axis=0, zero_phase=True)
print(np.linalg.lstsq(block[:, :-1], block[:, -1], rcond=None)[0])
"""
"""Python code that reads a recording with pandas and fits a joint."""

IN_MEMORY = f"""
import numpy as np
from pellucid_lab.pointing.conditions import identify_cards, published_conditions
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_people
from pellucid_lab.pointing.session import simulate_session
rig = elbow_people()
conditions = published_conditions(identify_cards(rig.robot), {COMMON_EXPONENTS})
for i, person in enumerate(draw_people(rig, np.random.default_rng(1))):
    for j, (name, make) in enumerate(conditions.items()):
        law = None if make is None else make(person, person.slider(rig))
        simulate_session(rig, person, name, law, np.random.default_rng([1, i, j]))
"""
"""Python code that plays the movements of a study of people in memory."""

FIRST_FIT = """
import sys
import numpy as np
import pellucid as pl
t, q, effort = np.load(sys.argv[1])
pl.fit_joint(t, q, effort, lowpass=20.0, decimate=10)
"""
"""Python code of the first fit of a process."""

MARKER_COUNT = 30
"""Markers of the audited file; its other columns are sums and differences of their coordinates."""

AUDITED_COLUMN_COUNT = sized(1000, smallest=100)
"""Columns of the audited file in addition to its time."""

READ_FILES = """
import sys
from pathlib import Path
from pyarrow import csv
for path in sorted(Path(sys.argv[1]).rglob("*")):
    if path.name.endswith((".csv", ".csv.gz")):
        csv.read_csv(path)
"""
"""Python code that reads every file of a study."""


def run() -> Iterator[dict]:
    """Rows of name, value, unit, note."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for rows in (short_commands, audits, fits, long_recordings, studies_of_people):
            yield from rows(folder)


def short_commands(folder: Path) -> list[dict]:
    """Rows of `version`, and of a report that is drawn again."""
    study = study_at(folder).folder
    for name in ("check", "identify", "report"):
        processor_seconds("-c", COMMAND_LINE, name, str(study))
    python = ("-c", "pass")
    return [
        *ratio_rows("version over python", uses_by_turns(("-c", COMMAND_LINE, "--version"), python)),
        *ratio_rows("report again over python", uses_by_turns(("-c", COMMAND_LINE, "report", str(study)), python)),
    ]


def audits(folder: Path) -> list[dict]:
    """Rows of the audit of many smooth columns that depend on each other."""
    path, pages = folder / "markers.csv", folder / "audit"
    write_markers(path, AUDITED_COLUMN_COUNT)
    arguments = ("-c", COMMAND_LINE, "audit", str(path), "--out", str(pages))
    used = [processor_seconds(*arguments) for _ in range(REPEAT_COUNT)]
    note = f"processor, 3,000 rows: {MARKER_COUNT} markers, sums and differences; {len(used)} runs"
    name = f"audit of {AUDITED_COLUMN_COUNT:,} columns"
    return [{"name": name, "value": statistics.median(used), "unit": "s", "note": note}]


def write_markers(path: Path, count: int) -> None:
    """Write `count` columns at 100 Hz: smooth coordinates of markers, then their sums and differences."""
    t, rng = np.arange(3_000) / 100.0, np.random.default_rng(1)
    waves = rng.uniform((50.0, 0.2, 0.0), (200.0, 1.5, 6.0), (MARKER_COUNT, 3, 3)).transpose(2, 0, 1)[..., None]
    columns = list(np.sum(waves[0] * np.sin(2.0 * np.pi * waves[1] * t + waves[2]), axis=1))
    for one, other in combinations(range(MARKER_COUNT), 2):
        columns += [columns[one] + columns[other], columns[one] - columns[other]]
    for one, other in combinations(range(MARKER_COUNT, len(columns)), 2):
        if len(columns) >= count:
            break
        columns.append(columns[one] + columns[other])
    header = ",".join(["time [s]", *(f"M{i + 1}.x [mm]" for i in range(count))])
    table = np.column_stack([t, *columns[:count]])
    np.savetxt(path, table, "%.3f", ",", header=header, comments="")


def long_recordings(folder: Path) -> list[dict]:
    """Rows of the identification of long recordings."""
    rows = []
    for count in LONG_SAMPLE_COUNTS:
        study = folder / f"long-{count}"
        (study / "recordings").mkdir(parents=True)
        (study / "study.toml").write_text(LONG_STUDY, encoding="utf-8")
        path = study / "recordings" / "long.csv"
        write_recording(path, count)
        rival = ("-c", PANDAS_FIT, str(path))
        name = f"identify {count:.3g}".replace("e+05", "e5").replace("e+06", "e6").replace("e+04", "e4")
        uses = uses_by_turns(("-c", COMMAND_LINE, "identify", str(study)), rival)
        rows += ratio_rows(f"{name} over pandas", uses)
        column_bytes = count * LONG_COLUMN_COUNT * np.dtype(float).itemsize
        share = statistics.median(ours.peak_bytes for ours, _ in uses) / column_bytes
        note = f"{LONG_COLUMN_COUNT} columns of float64, {1e-6 * column_bytes:.3g} MB"
        rows.append({"name": f"{name}, peak memory over columns", "value": share, "unit": "1", "note": note})
        path.unlink()
    return rows


def write_recording(path: Path, count: int) -> None:
    """Write a joint's recording with gravity, dry and viscous friction, and noise."""
    t = np.arange(count) / SAMPLING_RATE_HZ
    rng = np.random.default_rng(1)
    q, v, a = np.zeros(count), np.zeros(count), np.zeros(count)
    for amplitude, frequency, phase in ((0.5, 0.131, 0.0), (0.3, 0.471, 1.0), (0.15, 1.113, 2.0)):
        w = 2.0 * np.pi * frequency
        q += amplitude * np.sin(w * t + phase)
        v += amplitude * w * np.cos(w * t + phase)
        a -= amplitude * w**2 * np.sin(w * t + phase)
    effort = 0.05 * a + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v + 0.01 * rng.standard_normal(count)
    with path.open("w", encoding="utf-8") as file:
        file.write("t,q,tau\n")
        for begin in range(0, count, 200_000):
            part = slice(begin, begin + 200_000)
            rows = np.column_stack([t[part], q[part], effort[part]])
            np.savetxt(file, rows, fmt=("%.3f", "%.6g", "%.6g"), delimiter=",")


def studies_of_people(folder: Path) -> list[dict]:
    """Rows of a study of six people, simulated and assessed."""
    study = folder / "people"
    processor_seconds("-c", COMMAND_LINE, "init", str(study), "--rig", "elbow-people")
    simulate = ("-c", COMMAND_LINE, "simulate", str(study))
    pairs = {
        "simulate over in memory": (simulate, ("-c", IN_MEMORY)),
        "assess over reading": (("-c", COMMAND_LINE, "assess", str(study)), ("-c", READ_FILES, str(study))),
    }
    rows = []
    for name, (ours, rival) in pairs.items():
        uses = uses_by_turns(ours, rival, repeats=1)
        rows += ratio_rows(name, uses)
        peak = 1e-6 * max(use.peak_bytes for use, _ in uses)
        command = name.partition(" over ")[0]
        rows.append({"name": f"{command}, peak memory", "value": peak, "unit": "MB", "note": "2,400 movements"})
    return rows


def fits(folder: Path) -> list[dict]:
    """Rows of the first and the second call of `fit_joint` on twenty seconds at 1 kHz."""
    t = np.arange(20_000) / SAMPLING_RATE_HZ
    q = 0.5 * np.sin(2.0 * np.pi * 0.13 * t) + 0.3 * np.sin(2.0 * np.pi * 0.47 * t + 1.0)
    v = np.gradient(q, t)
    effort = 0.05 * np.gradient(v, t) + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v
    effort += 0.01 * np.random.default_rng(1).standard_normal(len(t))
    b, a = signal.butter(4, 20.0, fs=SAMPLING_RATE_HZ)

    def plain() -> np.ndarray:
        position, torque = signal.filtfilt(b, a, q), signal.filtfilt(b, a, effort)
        velocity = np.gradient(position, t)
        columns = [np.gradient(velocity, t), velocity, np.sign(velocity), np.ones_like(t), np.sin(position)]
        return np.linalg.lstsq(np.column_stack(columns)[::10], torque[::10], rcond=None)[0]

    def ours() -> object:
        return pl.fit_joint(t, q, effort, lowpass=20.0, decimate=10)

    ours()
    pairs = [(call_seconds(ours), call_seconds(plain)) for _ in range(4 * REPEAT_COUNT)]
    arrays = folder / "joint.npy"
    np.save(arrays, np.stack([t, q, effort]))
    first = [processor_seconds("-c", FIRST_FIT, str(arrays)) for _ in range(2 * REPEAT_COUNT)]
    note = f"processor, the whole of a fresh process; {len(first)} runs"
    row = {"name": "first fit_joint", "value": statistics.median(first), "unit": "s", "note": note}
    return [row, *told("fit_joint second over lstsq", pairs)]


def call_seconds(call: Callable[[], object]) -> float:
    """Processor seconds of one call."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def uses_by_turns(
    ours: tuple[str, ...], rival: tuple[str, ...], *, repeats: int = REPEAT_COUNT
) -> list[tuple[Use, Use]]:
    """Run two programs by turns, and return what both used."""
    return [(run_measured(*ours), run_measured(*rival)) for _ in range(repeats)]


def ratio_rows(name: str, uses: list[tuple[Use, Use]]) -> list[dict]:
    """Return rows of the processor seconds of two programs and of their ratio."""
    return told(name, [(ours.seconds, rival.seconds) for ours, rival in uses])


def told(name: str, pairs: list[tuple[float, float]]) -> list[dict]:
    """Return rows of the medians of pairs of seconds and of the median ratio."""
    mine, rival = name.split(" over ")
    note = f"processor, {len(pairs)} pairs by turns on {os.cpu_count()} cores, Python {sys.version_info.minor}"
    return [
        {"name": f"{name}: {mine}", "value": statistics.median(a for a, _ in pairs), "unit": "s", "note": note},
        {"name": f"{name}: {rival}", "value": statistics.median(b for _, b in pairs), "unit": "s", "note": note},
        {"name": name, "value": statistics.median(a / b for a, b in pairs), "unit": "1", "note": "median of pairs"},
    ]
