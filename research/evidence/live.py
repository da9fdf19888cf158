"""Does a live session keep its deadlines, stay safe and lose nothing?

- soak: pairs of runs at 1 kHz, in turn. A bare loop sleeps until each deadline and does nothing else. The live run has
  the virtual elbow with its law and supervisor, EMG of 8 channels at 2,048 Hz as a stream that is taken in, the
  recorder, and the page where there is one. The permitted increase over the bare loop is stated: half as many late
  cycles again and five more, half the 99th percentile again and 50 us. Rows say by how much the worst pair is beyond
  that.
- faults: one every 10 s, in turn, while the wearer moves: numbers that are none, a frozen encoder, a clock that jumps
  ahead or back, silence, an engine that does not run, a session that is silent, and a source of EMG that is killed and
  started again. Safe is a supervisor that has stopped within the stated bound and stays so until the operator's reset;
  where the law needs nothing of what was lost, it is one that runs on within its limits.
- states: sequences of actions on the engine's state, every short one on a simulated clock and drawn ones on processes.
- killed: engine, recorder and session at random moments. After each the trial's file is read with pyxdf, and data in
  shared memory that the file lacks count as lost. A killed session's processes must
  end by themselves.
- replay: every command of the sessions above, computed again by the core's Python module from session.xdf.
- udp: the virtual elbow in a process of its own behind UDP, on another clock. Commands of its drive are
  compared with those of the law in this process from the same readings.
- logs: stops of the supervisor on logs that another lab published, in samples, because the logs have no clock.

Engine and replay compile the same headers; that the supervisor's thresholds are right is shown elsewhere (`safety`).
The figures hold for this machine at its load. The reference method is the bare loop.
"""

import json
import os
import pickle
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pellucid.controllers.control_law import Limits
from pellucid.controllers.session_state import SESSION_STATES, UNPOWERED
from pellucid.files.xdf_writer import scan_xdf
from pellucid.live import layout
from pellucid.live.engine import LiveEngine, engine_program
from pellucid.live.log_verdict import ASSUMED_RATES_HZ, given_energy, judge_log, largest_gift
from pellucid.live.replay import read_session, replay_session
from pellucid.live.setup import DeviceNumbers, EngineSetup, settings_text
from pellucid.live.shared_memory import Region
from pellucid.live.udp import ASKED_FORMAT, unpack_asked
from pellucid.study.results import ResultRow, read_rows, write_rows
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.pointing.conditions import identify_cards
from pellucid_lab.session_devices import VIRTUAL_MAX_GAP_S, bridge_stalls
from research.benchmarks._size import sized

from ._engine_states import PATH_LENGTH, REAL_PATH_COUNT, REAL_PATH_LENGTH, explore, try_on_processes
from ._live_session import begin_motion, rest, session_setup

PAIR_COUNT = sized(5, smallest=1)
"""Number of pairs of a bare loop and a live run."""

RUN_S = sized(120.0, smallest=4.0)
"""Duration of each run."""

FAULT_COUNT = sized(64, smallest=8)
"""Number of faults: each kind as often as the others."""

FAULT_INTERVAL_S = sized(10.0, smallest=5.0)
"""Time from one fault to the next."""

KILL_COUNT = sized(42, smallest=3)
"""Number of kills: a third each of engine, session and recorder."""

KILL_WINDOW_S = sized((1.0, 4.0), smallest=(0.5, 1.0))
"""Shortest and longest time from the beginning of a motion to a kill."""

ORPHAN_PATIENCE_S = 10.0
"""Time after which no process of a killed session may run any more."""

UDP_S = sized(30.0, smallest=3.0)
"""Duration of the run behind UDP."""

MAX_LATE_RATIO = 1.5
"""Late cycles and 99th percentile of a live run may be this many times those of the bare loop."""

EXTRA_LATE_CYCLES = 5
"""Late cycles that come on top of that."""

EXTRA_P99_US = 50.0
"""Lateness that comes on top of that."""

FAULT_KINDS = ("not_a_number", "frozen", "clock_ahead", "clock_back", "silent", "starved", "session_silent", "source")
"""Faults, in turn."""

MAX_AGE_CYCLES = 4
"""A law whose samples may be 5 ms old goes on after gaps of this many cycles, and stops after longer ones."""

SAFE_CYCLES = 2
"""Cycles after which an output must be safe where nothing else is stated."""

STATED_BOUNDS_S = {"frozen": 0.022, "session_silent": 0.55}
"""Bounds of faults that nobody can see at once: 20 ms of motion without a change, and 0.5 s without a session."""

FROZEN_SPEED_RAD_S = 0.55
"""Speed above which an encoder is frozen in the tests: its watch sees a frozen one from 0.5 rad/s on."""

STARVED_S = 0.05
"""Time for which the engine does not run: a drive's watchdog has then long taken the power off."""

ELBOW_LOG_LIMITS = Limits(effort=5.0, rate=300.0, velocity=8.0, position=(-0.5, 2.6))
"""Limits for a worn elbow suit whose motor is cut at 4.1 N m, as an elbow's range and a quick movement are."""

CARDS_FILE = "cards.pickle"
"""File of the proof's folder with the identified cards of the virtual robot."""

Page = AbstractContextManager[Any]


def rows() -> Iterator[ResultRow]:
    """Every figure: each part runs in a process of its own, within a time limit, and keeps the rows that it came to."""
    folder, failed = Path(tempfile.mkdtemp(prefix="pellucid-evidence-live-")), []
    begun = time.monotonic()
    try:
        (folder / CARDS_FILE).write_bytes(pickle.dumps(identify_cards(able_elbow())))
        for name, part in PARTS.items():
            tell(f"{name}: begins after {time.monotonic() - begun:.0f} s, takes at most {part.max_s:.0f} s")
            if not _run_part(name, part.max_s, folder):
                failed.append(name)
            path = folder / f"{name}.json"
            yield from read_rows(path) if path.exists() else ()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    tell(f"done after {time.monotonic() - begun:.0f} s")
    if failed:
        raise RuntimeError(f"parts of the proof that failed or took too long: {', '.join(failed)}")


def tell(text: str) -> None:
    """Print how far the proof has come."""
    print(f"live: {text}", flush=True)


def _run_part(name: str, max_s: float, folder: Path) -> bool:
    """Run one part in a process of its own; return whether it came to its end in time."""
    words = [sys.executable, "-m", "research.evidence.live", name, str(folder)]
    process = subprocess.Popen(words, start_new_session=True)
    try:
        return process.wait(max_s) == 0
    except subprocess.TimeoutExpired:
        tell(f"{name}: is ended after {max_s:.0f} s")
        return False
    finally:
        # A browser that the part had opened is of its group; a session's engine ends by itself.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def main() -> None:
    """Run one part, and write each row as soon as it is known."""
    name, folder = sys.argv[1], Path(sys.argv[2])
    made = []
    for row in PARTS[name].rows(folder, folder / CARDS_FILE):
        made.append(row)
        write_rows(folder / f"{name}.json", "evidence", made)


def _row(name: str, value: float, unit: str, note: str = "", split: str = "simulated") -> ResultRow:
    return ResultRow(f"live.{name}", float(value), unit, "evidence", split, None, note)


# --- soak ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deadlines:
    """How a loop kept its deadlines."""

    cycles: int
    late: int
    p99_us: float
    worst_us: float


def bare_loop(seconds: float) -> Deadlines:
    """Run the loop that does nothing."""
    words = [str(engine_program()), "--bare", "1000000", str(seconds)]
    said = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    return Deadlines(said["cycles"], said["late"], 1e-3 * said["p99"], 1e-3 * said["worst"])


@dataclass(frozen=True)
class LiveRun:
    """One live run."""

    deadlines: Deadlines
    lost: int  # samples that were sent and are not on the disk
    growth_mb: float  # memory that the session's processes took from the first quarter to the end
    fifo: bool
    faults: tuple[str, ...]


def used_mb(processes: Iterable[int]) -> float:
    """Return the memory that processes use together, each page that they share counted once.

    Resident memory will not do: the region's rings have a fixed size, and each process counts a page of them once it
    has read it, so that four processes seem to grow by a ring each until the rings have been filled once.
    """
    kilobytes = 0
    for process in processes:
        with suppress(OSError):
            said = Path(f"/proc/{process}/smaps_rollup").read_text()
            kilobytes += sum(int(line.split()[1]) for line in said.splitlines() if line.startswith("Pss:"))
    return kilobytes / 1e3


def live_run(folder: Path, cards: Path, seconds: float) -> LiveRun:
    """Run a whole session with everything on."""
    setup = bridge_stalls(session_setup(cards))  # as `pellucid live` starts its virtual rigs
    with LiveEngine.start(setup, folder) as engine, _opened_page(engine):
        wait_for_streams(engine)
        begin_motion(engine)
        trial = folder / "soak.xdf"
        engine.begin_recording(trial, {"protocol": "soak"})
        before, first = engine.region.status(), engine.region.record_count
        late, cursor = [], first
        settled, children = 0.0, [os.getpid(), *engine.processes.values()]
        begun = time.monotonic()
        while time.monotonic() - begun < seconds:
            rest(engine, min(1.0, max(0.01, begun + seconds - time.monotonic())))
            samples = engine.read_since(cursor)
            cursor = samples.cursor
            late.append(samples.channels["lateness"].copy())  # not a view, which keeps whole records
            if settled == 0.0 and time.monotonic() - begun > 0.25 * seconds:
                settled = used_mb(children)
            if engine.status().state.needs_reset or engine.status().state == UNPOWERED:
                begin_motion(engine)
        growth = used_mb(children) - settled
        after, health = engine.region.status(), engine.health()
        engine.end_recording()
        lateness = np.concatenate(late)
        lost = lost_samples(trial)
        return LiveRun(
            Deadlines(
                len(lateness), int(after["late"] - before["late"]), 1e6 * float(np.percentile(lateness, 99)),
                1e6 * float(lateness.max()),
            ),
            lost, growth, health.fifo, tuple(name for _, name in health.faults),
        )  # fmt: skip


def wait_for_streams(engine: LiveEngine, count: int = 3, patience_s: float = 120.0) -> None:
    """Wait until so many streams are taken in."""
    until = time.monotonic() + patience_s
    while len(engine.streams) < count:
        if time.monotonic() > until:
            raise RuntimeError(f"found {len(engine.streams)} streams after {patience_s} s, expected {count}")
        rest(engine, 0.2)


def lost_samples(path: Path) -> int:
    """Return how many samples of the evenly sampled streams a trial's file lacks, by their times and numbers."""
    import pyxdf

    streams, _ = pyxdf.load_xdf(str(path), dejitter_timestamps=False)
    lost = 0
    for stream in streams:
        rate, times = float(stream["info"]["nominal_srate"][0]), np.asarray(stream["time_stamps"])
        if rate > 0.0 and len(times):
            lost += round((times[-1] - times[0]) * rate) + 1 - len(times)
    return lost


def soak_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """Pairs of a bare loop and a live run, in turn."""
    pairs = []
    for i in range(PAIR_COUNT):
        try:
            pairs.append((bare_loop(RUN_S), live_run(folder / f"soak{i}", cards, RUN_S)))
        except Exception:  # the other pairs still say something
            traceback.print_exc()
            continue
        bare, live = pairs[-1]
        tell(f"soak: pair {i + 1} of {PAIR_COUNT}: late {bare.late} and {live.deadlines.late}, "
             f"99 % within {bare.p99_us:.0f} and {live.deadlines.p99_us:.0f} us, lost {live.lost}")  # fmt: skip
    if not pairs:
        raise RuntimeError("no pair of a bare loop and a live run came to its end")
    late = [live.deadlines.late - (MAX_LATE_RATIO * bare.late + EXTRA_LATE_CYCLES) for bare, live in pairs]
    p99 = [live.deadlines.p99_us - (MAX_LATE_RATIO * bare.p99_us + EXTRA_P99_US) for bare, live in pairs]
    bare_said = ", ".join(f"{b.late} and {live.deadlines.late} of {live.deadlines.cycles}" for b, live in pairs)
    p99_said = ", ".join(f"{b.p99_us:.0f} and {live.deadlines.p99_us:.0f} us" for b, live in pairs)
    worst_said = ", ".join(f"{b.worst_us:.0f} and {live.deadlines.worst_us:.0f} us" for b, live in pairs)
    load = f"load of {os.getloadavg()[1]:.1f} on {os.cpu_count()} cores"
    granted = "with SCHED_FIFO" if all(live.fifo for _, live in pairs) else "without SCHED_FIFO, which is not permitted"
    yield _row("soak.seconds", len(pairs) * RUN_S, "s", f"live, and a bare loop of equal duration; {granted}, {load}")
    yield _row(
        "late_cycles.beyond_bound",
        max(0.0, *late),
        "1",
        f"bare and live: {bare_said}",
    )
    yield _row("p99.beyond_bound", max(p99), "us", f"bare and live: {p99_said}; worst {worst_said}")
    yield _row("samples_lost", sum(live.lost for _, live in pairs), "1", "of EMG, markers and encoder that were sent")
    yield _row(
        "memory_growth",
        max(live.growth_mb for _, live in pairs),
        "MB",
        "all processes and this one that is the session, shared pages once; from a quarter of the run to its end",
    )
    faults = [name for _, live in pairs for name in live.faults]
    yield _row(
        "soak.stops",
        len(faults),
        "1",
        f"times that the supervisor stopped a healthy session, whose law may go {VIRTUAL_MAX_GAP_S * 1e3:g} ms without "
        f"a sample as on every virtual rig: {', '.join(faults) or 'none'}",
    )


# --- faults --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FaultOutcome:
    """What followed one fault."""

    kind: str
    is_safe: bool
    safe_after_s: float  # NaN where nothing had to stop
    resumed: bool
    said: str


def _is_stopped(records: np.ndarray) -> np.ndarray:
    """Whether each record's output is that of a stopped supervisor, or of no law."""
    unpowered = records["state"] == SESSION_STATES.index(UNPOWERED)
    return (records["mode"] >= layout.MODES.index("damped_stop")) | unpowered


def try_fault(engine: LiveEngine, kind: str, rng: random.Random) -> FaultOutcome:
    """Put one fault in while the law runs and the wearer moves, and see what follows."""
    if kind == "frozen":
        wait_for_speed(engine)
    before = engine.region.record_count
    child = engine.processes
    if kind == "starved":
        os.kill(child["engine"], signal.SIGSTOP)
        time.sleep(STARVED_S)
        os.kill(child["engine"], signal.SIGCONT)
    elif kind == "session_silent":
        time.sleep(1.3)
    elif kind == "source":
        os.kill(child["streams"], signal.SIGKILL)
        rest(engine, 0.5)
        engine.restart_streams()
    else:
        engine.inject(kind, 0.2)
    rest(engine, 1.0)
    _, records, _ = engine.region.records_since(before)
    stopped = _is_stopped(records)
    limit = engine.status().effort_limit
    within = bool(np.all(np.abs(records["effort"]) <= limit) and np.all(np.isfinite(records["effort"])))
    seconds = 1e-9 * records["time"].astype(float)
    if kind == "source":  # the law hears no EMG: it must run on, unless a gap in the cycles stopped it as it should
        gaps = bool(np.any(np.diff(records["cycle"].astype(np.int64)) > MAX_AGE_CYCLES))
        is_safe, after = within and (not stopped.any() or gaps), float("nan")
    else:
        onset = _onset(records, kind)
        bound = STATED_BOUNDS_S.get(kind, SAFE_CYCLES * engine.setup.period)
        first = onset + int(np.argmax(stopped[onset:])) if stopped[onset:].any() else None
        after = float("inf") if first is None else float(seconds[first] - seconds[onset])
        is_safe = first is not None and within and bool(stopped[first:].all())
        is_safe &= after <= bound + 0.5 * engine.setup.period
        if kind == "starved":  # while nobody asked, the drive's own watchdog has taken the power off
            is_safe &= float(records["drive_torque"][onset]) == 0.0
    codes = sorted(set(records["fault"].tolist()) - {0})
    name = ", ".join(layout_fault(code) for code in codes) or "none"
    resumed = begin_motion(engine)
    return FaultOutcome(kind, bool(is_safe), after, resumed, name)


def wait_for_speed(engine: LiveEngine, patience_s: float = 5.0) -> None:
    """Wait until the joint moves faster than `FROZEN_SPEED_RAD_S`: an encoder at rest is not known to be frozen."""
    until = time.monotonic() + patience_s
    while time.monotonic() < until:
        engine.beat()
        _, last, _ = engine.region.records_since(max(engine.region.record_count - 20, 0))
        if len(last) and np.all(np.abs(last["limb_velocity"]) > FROZEN_SPEED_RAD_S):
            return
        time.sleep(0.005)


def layout_fault(code: int) -> str:
    """Return the name of a fault."""
    from pellucid.controllers.supervisor_faults import FAULT_NAMES

    return FAULT_NAMES[code]


def _onset(records: np.ndarray, kind: str) -> int:
    """Return the first record that a fault could be seen in."""
    if kind == "starved":
        return int(
            np.argmax(np.diff(records["cycle"].astype(np.int64), prepend=records["cycle"][0]) > 1000 * STARVED_S / 2)
        )
    if kind == "session_silent":
        return 0
    return int(np.argmax((records["flags"] & layout.FLAG_INJECTED) != 0))


def fault_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """One fault after another in one session."""
    rng, run = random.Random(20261127), folder / "faults"
    outcomes = []
    with LiveEngine.start(session_setup(cards), run) as engine:
        wait_for_streams(engine)
        trial = run / "faults.xdf"
        engine.begin_recording(trial, {"protocol": "faults"})
        begin_motion(engine)
        for i in range(FAULT_COUNT):
            begun = time.monotonic()
            rest(engine, rng.uniform(1.0, 2.0))
            if not engine.status().state.in_force:
                begin_motion(engine)
            outcomes.append(try_fault(engine, FAULT_KINDS[i % len(FAULT_KINDS)], rng))
            found = outcomes[-1]
            safe = "safe" if found.is_safe else "NOT SAFE"
            tell(f"fault {i + 1} of {FAULT_COUNT}: {found.kind}, {safe} ({found.said})")
            rest(engine, max(0.0, FAULT_INTERVAL_S - (time.monotonic() - begun)))
        engine.end_recording()
    unsafe = [f"{o.kind} ({o.said}, after {o.safe_after_s:.4f} s)" for o in outcomes if not o.is_safe]
    worst = {
        kind: max((o.safe_after_s for o in outcomes if o.kind == kind), default=float("nan")) for kind in FAULT_KINDS
    }
    said = "; ".join(f"{kind} {1e3 * after:.1f} ms" for kind, after in worst.items() if np.isfinite(after))
    yield _row("faults.injected", len(outcomes), "1", f"of {len(FAULT_KINDS)} kinds, one every {FAULT_INTERVAL_S:g} s")
    yield _row("faults.unsafe", len(unsafe), "1", "; ".join(unsafe) or f"slowest of each kind: {said}")
    stuck = [o.kind for o in outcomes if not o.resumed]
    note = f"sessions that did not go on after a reset: {', '.join(stuck) or 'none'}"
    yield _row("faults.not_resumed", len(stuck), "1", note)
    _, records = read_session(run / "session.xdf")
    missing = int(np.count_nonzero(np.diff(records["number"].astype(np.int64)) != 1))
    yield _row("faults.lost_on_disk", missing, "1", "records of the engine that session.xdf lacks")


# --- kills ---------------------------------------------------------------------------------------------------------


class KilledSession:
    """A session whose own process is a child, so that it can be killed; it records a trial."""

    def __init__(self, folder: Path, cards: Path, trial: Path) -> None:
        words = [sys.executable, "-m", "research.evidence._live_session", str(folder), str(cards), str(trial)]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line.startswith("{"):
            raise RuntimeError("the session did not begin")
        said = json.loads(line)
        self.region = Region(Path(said["region"]))
        self.children: dict[str, int] = said["processes"]

    def left_running(self, patience_s: float) -> list[str]:
        """Return the session's processes that still run after this time [s]."""
        until = time.monotonic() + patience_s
        while (left := [name for name, number in self.children.items() if _is_running(number)]) != []:
            if time.monotonic() > until:
                break
            time.sleep(0.1)
        return left

    def end(self) -> None:
        """End the session's process, if it still runs; its children follow."""
        self.process.kill()
        self.process.wait()


def _is_running(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def lost_by_kill(region: Region, trial: Path, victim: str, process: int) -> tuple[bool, float]:
    """Kill one process now; return whether the trial's file can be read as it lies, and how much of it is lost [s]."""
    held = 1e-9 * int(region.records_since(max(region.record_count - 1, 0))[1]["deadline"][-1])
    os.kill(process, signal.SIGKILL)
    if victim != "recorder":
        time.sleep(0.1)  # the recorder still runs, and writes what was there
    copy = trial.with_name("killed.xdf")
    shutil.copy(trial, copy)
    try:
        import logging

        import pyxdf

        logging.getLogger("pyxdf.pyxdf").disabled = True
        streams, _ = pyxdf.load_xdf(str(copy))
        robot = next(s for s in streams if s["info"]["name"][0] == "robot")
        last = float(robot["time_stamps"][-1])
        return True, max(0.0, held - last)
    except Exception as error:  # whatever a reader stumbles over is a file that is not readable
        print(f"killed {victim}: not readable: {error}", file=sys.stderr)
        return False, float("inf")


def kill_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """Kill engine, recorder and session, each at a random moment."""
    rng = random.Random(20261128)
    readable: list[bool] = []
    lost: dict[str, list[float]] = {"engine": [], "recorder": [], "session": []}
    gaps, run = 0, folder / "killed"
    with LiveEngine.start(session_setup(cards), run) as engine:
        for i in range(KILL_COUNT - KILL_COUNT // 3):
            victim = ("engine", "recorder")[i % 2]
            trial = run / f"trial{i}.xdf"
            engine.begin_recording(trial, {"protocol": "killed"})
            begin_motion(engine)
            rest(engine, rng.uniform(*KILL_WINDOW_S))
            whole, missing = lost_by_kill(engine.region, trial, victim, engine.processes[victim])
            readable.append(whole)
            lost[victim].append(missing)
            engine.restart_engine() if victim == "engine" else engine.restart_recorder()
            rest(engine, 0.5)
            engine.end_recording(timeout=20.0)
            gaps += _record_gaps(trial) if victim == "recorder" else 0
            tell(f"killed {victim}: {1e3 * missing:.0f} ms lost")
    left: list[str] = []
    for i in range(KILL_COUNT // 3):
        run = folder / f"killed{i}"
        trial = run / "trial.xdf"
        session = KilledSession(run, cards, trial)
        try:
            time.sleep(rng.uniform(*KILL_WINDOW_S))
            whole, missing = lost_by_kill(session.region, trial, "session", session.process.pid)
            readable.append(whole)
            lost["session"].append(missing)
            left += session.left_running(ORPHAN_PATIENCE_S)
        finally:
            session.end()
        tell(f"killed session: {1e3 * missing:.0f} ms lost, {len(left)} processes left so far")
    said = ", ".join(f"{victim} {1e3 * max(missing, default=0.0):.0f} ms" for victim, missing in lost.items())
    yield _row("killed.count", len(readable), "1", "a third each of engine, recorder and session, at random moments")
    yield _row("killed.unreadable", readable.count(False), "1", "files of trials as they lay there, read with pyxdf")
    largest = max(value for missing in lost.values() for value in missing)
    yield _row("killed.lost", largest, "s", f"of what the region held at the kill, largest; {said}")
    yield _row("killed.lost_for_good", gaps, "1", "records that a trial lacks after its recorder was started again")
    note = f"processes that still ran {ORPHAN_PATIENCE_S:g} s after their session was killed"
    yield _row("killed.left_running", len(left), "1", note)
    yield _row("interrupted.count", len(readable), "1", "the same recordings")
    yield _row("interrupted.readable", 100.0 * readable.count(True) / len(readable), "%", "as they lay there")
    yield _row("interrupted.lost", largest, "s", f"largest; {said}")


def state_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """Try sequences of actions on the engine's state."""
    found = explore()
    with LiveEngine.start(session_setup(cards), folder / "states") as engine:
        wrong = list(try_on_processes(engine))
    for sentence in wrong[:5]:
        tell(sentence)
    note = f"every sequence of {PATH_LENGTH} of 12 actions, from power-on and a running law, on a simulated clock"
    yield _row("states.paths", found.get("paths"), "1", note)
    yield _row("states.paths_on_engine", REAL_PATH_COUNT, "1", f"drawn, {REAL_PATH_LENGTH} actions, real processes")
    violations = found["violations"] + len(wrong) if found else None
    yield _row("states.violations", violations, "1", "lease, stop, table, finite, whole")
    yield _row("powered_without_lease", found.get("powered_s"), "s", "after the last sign of life, simulated clock")
    yield _row("stop_to_no_effort", found.get("stop_ms"), "ms",
               "from a stop to the end of the law's effort; a damped stop then acts against the motion")  # fmt: skip


def _record_gaps(path: Path) -> int:
    """Return how many records a trial lacks, by the times of the cycles that the engine had."""
    found = scan_xdf(path)
    stream = next(found.streams[i] for i in found.headers if found.name(i) == "robot")
    expected = round((stream.last - stream.first) * 1000.0) + 1
    return max(0, expected - stream.count - _missed_cycles(path))


def _missed_cycles(path: Path) -> int:
    """Return how many deadlines the engine missed during a trial, from the session's file."""
    _, records = read_session(path.with_name("session.xdf"))
    stream = next(iter(scan_xdf(path).streams.values()))
    seconds = 1e-9 * records["deadline"].astype(float)
    inside = records[(seconds >= stream.first - 1e-4) & (seconds <= stream.last + 1e-4)]
    return int(np.sum(np.diff(inside["cycle"].astype(np.int64)) - 1)) if len(inside) else 0


# --- replay, UDP, logs, page ---------------------------------------------------------------------------------------


def replay_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """Compute every command of the sessions above again."""
    found = []
    for path in sorted([*folder.glob("soak*/session.xdf"), *folder.glob("faults/session.xdf")]):
        found.append(replay_session(path))
        tell(f"replay: {path.parent.name}: {found[-1].wrong_bits} of {found[-1].compared} commands with wrong bits")
    if not found:
        raise RuntimeError("found no recorded session to compute again")
    compared = sum(one.compared for one in found)
    yield _row("replay.commands", compared, "1", f"in {len(found)} sessions, faults, stops and resets among them")
    yield _row(
        "replay.wrong_bits", sum(one.wrong_bits for one in found), "1", "bits of commands, modes and faults that differ"
    )
    yield _row(
        "replay.unknown", sum(one.unknown for one in found), "1", "cycles of a law whose beginning was not recorded"
    )


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def udp_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """The virtual elbow behind UDP on a clock of its own, and the law in this process on the same readings."""
    run, port = folder / "udp", _free_port()
    virtual = session_setup(cards)
    board_file, log = folder / "board.txt", folder / "asked.bin"
    board_file.write_text(settings_text(virtual))
    setup: EngineSetup = replace(virtual, device=DeviceNumbers("udp", f"127.0.0.1:{port}"), streams=None, wearer=None)
    with LiveEngine.start(setup, run, streams=False) as engine:
        words = [str(engine_program()), "--board", str(board_file), f"127.0.0.1:{port}", str(log)]
        board = subprocess.Popen(words)
        try:
            until = time.monotonic() + UDP_S
            while time.monotonic() < until:
                rest(engine, 0.2)
                state = engine.status().state
                if state == UNPOWERED:
                    engine.arm()
                elif state.needs_reset:
                    engine.reset()
        finally:
            board.terminate()
            board.wait()
    data = log.read_bytes()
    size = ASKED_FORMAT.size
    packets = [unpack_asked(data[i : i + size]) for i in range(0, len(data), size)]
    asked = {one.beat: one.effort for one in packets if one is not None}
    conditions, records = read_session(run / "session.xdf")
    by_beat = {int(beat): float(effort) for beat, effort in zip(records["beat"], records["effort"], strict=True)}
    wire = sum(effort != by_beat.get(beat, float("nan")) for beat, effort in asked.items())
    found = replay_session(run / "session.xdf")
    moving = int(np.count_nonzero(records["effort"]))
    note = f"{len(asked)} datagrams, {found.compared} steps of {len(conditions)} law, {moving} of them with an effort"
    yield _row("udp.commands", len(asked), "1", note)
    yield _row(
        "udp.wrong_bits", wire + found.wrong_bits, "1", "between what the drive was sent and the law in this process"
    )


def log_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """Logs of a worn elbow suit that another lab published, without a clock."""
    data = os.environ.get("PELLUCID_DATA")
    root = Path(data or ".") / "elbow_exosuit"
    if not root.exists():
        return
    for mode in ("emg_threshold", "preplanned_threshold"):
        stopped, samples, gifts, cut, places = 0, 0, [], 0, []
        paths = sorted(root.glob(f"{mode}/P*/trial_*.csv"))
        for path in paths:
            table = np.genfromtxt(path, delimiter=",", names=True)
            angle = np.deg2rad(table["Desired_Position_deg"]) - table["Position_Error_rad"]
            asked = table["Feedforward_Torque_Nm"] + table["Feedback_Torque_Nm"]
            verdicts = judge_log(angle, asked, limits=ELBOW_LOG_LIMITS)
            at = [verdict.stopped_at for verdict in verdicts]
            stopped += None not in at
            places += [place for place in at if place is not None]
            samples += verdicts[0].samples
            cut += verdicts[0].cut
            gifts.append(largest_gift(given_energy(angle, table["Applied_Torque_Nm"])))
        rates = f"{ASSUMED_RATES_HZ[0]:g} to {ASSUMED_RATES_HZ[-1]:g} Hz"
        where = f", at samples {min(places)} to {max(places)}" if places else ""
        note = f"of {len(paths)} logs, at every assumed rate of {rates}{where}; {cut} of {samples} samples cut"
        yield _row(f"logs.{mode}.stopped", stopped, "1", note, "heldout")
        given = "that the applied torque gave between two samples of a log, whatever its rate"
        yield _row(f"logs.{mode}.largest_gift", max(gifts), "J", given, "heldout")


def _opened_page(engine: LiveEngine) -> Page:
    """Open the operator's page on an engine, where this installation has one."""
    try:
        from . import _live_page
    except ImportError:
        return nullcontext()
    return _live_page.opened(engine)


def page_rows(folder: Path, cards: Path) -> Iterator[ResultRow]:
    """What a browser measures of the pages."""
    try:
        from . import _live_page
    except ImportError:
        return
    yield from _live_page.rows()


@dataclass(frozen=True)
class Part:
    """One part of the proof."""

    rows: Callable[[Path, Path], Iterator[ResultRow]]  # from the folder of the run, and the robot's cards
    max_s: float  # longest time that it may take [s]


PARTS = {
    "soak": Part(soak_rows, 300.0 + PAIR_COUNT * (2.5 * RUN_S + 60.0)),
    "faults": Part(fault_rows, 300.0 + FAULT_COUNT * (FAULT_INTERVAL_S + 8.0)),
    "killed": Part(kill_rows, 300.0 + KILL_COUNT * 40.0),
    "states": Part(state_rows, 600.0 + 2.0 * REAL_PATH_COUNT),
    "udp": Part(udp_rows, 300.0 + 3.0 * UDP_S),
    "pages": Part(page_rows, 900.0),
    "replay": Part(replay_rows, 1200.0),
    "logs": Part(log_rows, 600.0),
}
"""Parts by name, in the order in which they run: what needs a quiet machine comes first."""


if __name__ == "__main__":
    main()
