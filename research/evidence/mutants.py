"""Mutants of the safety code that no test kills: what `make test` would not notice if it were broken.

Mutants are made by rule (`_source_mutants.py`) from the headers of gate, watches and supervisors and from the Python
that sets their thresholds. Each is a patch of a copy in a temporary folder, for which only the tests that can see its
file are built and run (`JUDGES`). A static assertion, a failing test or a test that does not end kills a mutant. One
that does not compile is no mutant: another is drawn in its place. `make evidence` draws 60 by a seed; a nightly test
draws a dozen by the commit.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

from ._source_mutants import Mutant, mutants_of

ROOT = Path(__file__).parents[2]

COUNT = sized(170, smallest=2)
"""Number of mutants that are tried."""

SEED_VARIABLE = "PELLUCID_MUTANT_SEED"
"""Variable of the environment that states another seed."""

SEED = int(os.environ.get(SEED_VARIABLE, "20261123"))
"""Seed of the draw in `make evidence`."""

WORKERS = min(os.cpu_count() or 1, 8)
"""Number of mutants that are tried at once."""

LONGEST_TEST_S = 60.0
"""A test that takes longer than this does not end: a counter of the mutant has no bound."""

JUDGES: dict[str, tuple[str, ...]] = {
    "body_residual": ("body_residual",),
    "damped_stop": ("damped_stop",),
    "drive_delay_watch": ("drive_delay_watch",),
    "drive_watch": ("drive_thresholds", "drive_watch"),
    "encoder_watch": ("encoder_watch",),
    "energy_budget": ("energy_budget",),
    "energy_observer": ("energy_observer",),
    "incident_recorder": ("incident_recorder",),
    "integrity": ("integrity",),
    "momentum_observer": ("momentum_observer", "tree_law"),
    "probe_watch": ("probe_watch",),
    "rate_watch": ("rate_watch",),
    "resistance": ("resistance",),
    "ringing_watch": ("ringing_watch",),
    "safety": ("safety_thresholds", "safety"),
    "sample": ("sample", "rate_watch"),
    "sensor_watch": ("sensor_watch",),
    "shaking_watch": ("shaking_watch",),
    "start_up_test": ("start_up_wave",),
    "still_watch": ("still_watch",),
    "supervisor": ("supervisor_states", "supervisor"),
    "supervisor_watches": ("supervisor_watches", "incident_recorder"),
    "tree_force_watch": ("tree_force_watch",),
    "tree_gate": ("tree_gate", "tree_law"),
    "tree_law": ("tree_gate", "tree_law"),
    "tree_supervisor": ("tree_supervisor", "tree_law"),
    "unexplained_energy_watch": ("unexplained_energy_watch",),
    "watchdog": ("watchdog",),
}
"""Tests of tests/core for each header of include/pellucid, the quickest first. rest.hpp is not among them: it
solves for the friction of virtual joints at rest, and no supervisor uses it."""

PYTHON_JUDGES: dict[str, tuple[frozenset[str] | None, tuple[str, ...]]] = {
    "supervised": (None, ("test_supervisor_thresholds", "test_supervised", "test_probe")),
    "worn": (frozenset({"watched_worn"}), ("test_supervisor_thresholds",)),
    "joint_compensation": (
        frozenset({"compensation", "carried_body", "known_speed", "suggested_limits", "carried", "_body_of"}),
        ("test_supervisor_thresholds",),
    ),
    "control_law": (frozenset({"Limits", "gate_values"}), ("test_supervisor_thresholds",)),
    "tree_laws": (
        frozenset(
            {"carried", "instruments_of", "reach_of", "suggested_limits", "with_force_sensor", "_test", "_watch"}
        ),
        ("test_supervisor_thresholds",),
    ),
}
"""Mutated functions and classes of each module of pellucid.controllers (None: all), and their tests in tests/unit.

Constants are always mutated."""


@dataclass(frozen=True)
class Equivalent:
    """Mutants that change nothing that a test could see, and why."""

    file: str  # stem of the file's name
    source: str  # part of the mutated line, which says where it is
    changes: tuple[str, ...]  # what becomes what
    reason: str


FINITE = "a difference of two numbers is finite where their sum is, but for overflow"
EQUAL = "both branches give the same where the two sides are equal"
NESTED = "the next clamp brings what is beyond the limit back to it"
NOT_A_NUMBER = "the effort is within the limit already, so that the check is for NaN, which either half finds"
EQUIVALENT: tuple[Equivalent, ...] = (
    Equivalent("body_residual", "if (p.square_root > S(0))", ("p.square_root > S(0) -> true", "> -> >="),
               "a coefficient of 0 adds 0"),
    Equivalent("body_residual", "velocity < S(0) ? -sliding : sliding", ("< -> <=",), "at rest nothing slides"),
    Equivalent("body_residual", "if (!is_finite(s.momentum", ("+ -> -",), FINITE),
    Equivalent("drive_delay_watch", "if (!is_finite(s.asked + s.given", ("+ -> -",), FINITE),
    Equivalent("tree_force_watch", "if (!is_finite(s.felt + s.contradiction", ("+ -> -",), FINITE),
    Equivalent("drive_watch", "const S meant = (asked - s.due) * moved > S(0)", ("> -> >=",),
               "where nothing moved no energy counts, and otherwise both are the same"),
    Equivalent("drive_watch", ": s.agreed < lone_reading_gap ? s.agreed + 1",
               ("< -> <=", "lone_reading_gap -> (2 * (lone_reading_gap))",
                "lone_reading_gap -> (3 * (lone_reading_gap) / 2)"),
               "every count from the gap on says the same"),
    Equivalent("drive_watch", "return s.surplus <= s.inert_surplus", ("<= -> <",), EQUAL),
    Equivalent("encoder_watch", "const bool jitters = !steady", ("!steady && ->", "!steady -> true"),
               "both velocities are the same where the gap is steady"),
    Equivalent("incident_recorder", "if (r.filled == 0 && r.whole == places)", ("r.filled == 0 && ->",
               "r.filled == 0 -> true"), "a record that was begun has made its room already"),
    Equivalent("incident_recorder", "return places < 0x7fffffffu", ("< -> <=",), EQUAL),
    Equivalent("incident_recorder", "const float single = !is_finite(x)", ("> -> >=",), "what is not finite is not 0"),
    Equivalent("incident_recorder", ": x < S(0) ? -std::numeric_limits", ("< -> <=",), "what is not finite is not 0"),
    Equivalent("incident_recorder", ": x > S(most)", ("> -> >=",), EQUAL),
    Equivalent("incident_recorder", ": x < S(-most)", ("< -> <=",), EQUAL),
    Equivalent("incident_recorder", "bound == WatchBound::size && value < 0.0f", ("< -> <=",), EQUAL),
    Equivalent("incident_recorder", "bound == WatchBound::size && other < 0.0f", ("< -> <=",), EQUAL),
    Equivalent("incident_recorder", "put(ring.decimation, decimation < 1", ("< -> <=", "> -> >="), EQUAL),
    Equivalent("integrity", "words - at < words_a_step", ("< -> <=",), EQUAL),
    Equivalent("momentum_observer", "whole = whole && is_finite", ("+ -> -",), FINITE),
    Equivalent("resistance", "exp(static_cast<S>(k) * log(x))", ("> -> >=",), "the power of 0 is 0 by logarithms, too"),
    Equivalent("resistance", "coefficient < S(0) ? -coefficient", ("< -> <=",), EQUAL),
    Equivalent("resistance", "size > larger[i] ? size", ("> -> >=",), EQUAL),
    Equivalent("safety", "p.stop_margin > S(0) ? S(1) / p.stop_margin", ("p.stop_margin > S(0) -> true", "> -> >="),
               "1 / 0 is infinite"),
    Equivalent("safety", "c.valid && most < static_cast<S>(p.max_repeats)", ("c.valid && ->",),
               "a gate that is not valid is shut whatever its rules are"),
    Equivalent("safety", "c.valid && most < static_cast<S>(p.max_repeats)", ("< -> <=",),
               "equal counts differ by how the last bit of the age is rounded"),
    Equivalent("safety", "c.rules.max_repeats + 1) * p.period <= p.max_age",
               ("static_cast<S>(c.rules.max_repeats + 1) * p.period <= p.max_age -> true", "+ -> -", "<= -> >=",
                "p.max_age -> (2 * (p.max_age))", "p.max_age -> (3 * (p.max_age) / 2)"),
               "the next line takes one back where it is one too many"),
    Equivalent("safety", "return share < S(1) ? share", ("< -> <=",), EQUAL),
    Equivalent("safety", "clamp(input.command, -limit, limit)",
               ("clamp(input.command, -limit, limit) -> max<S>(input.command, -limit)",
                "clamp(input.command, -limit, limit) -> min<S>(input.command, limit)"), NESTED),
    Equivalent("safety", "state.output = !(output >= -limit && output <= limit)",
               ("output >= -limit -> true", "output >= -limit && ->", "-limit -> (2 * (-limit))",
                "-limit -> (3 * (-limit) / 2)", "&& output <= limit ->", "output <= limit -> true",
                "limit -> (2 * (limit))", "limit -> (3 * (limit) / 2)"), NOT_A_NUMBER),
    Equivalent("start_up_test", "s.middle >= c.params.least", ("c.params.least -> ((c.params.least) / 2)",),
               "what lies between hardly moved the joint, which is no wrong answer"),
    Equivalent("supervisor", "p.reset_delay < S(1e6) * c.period", ("< -> <=",), EQUAL),
    Equivalent("supervisor", "return ago < log.faults",
               ("< -> <=", "ago < log.faults -> true", "ago < log.faults && ->", "log.faults -> (2 * (log.faults))",
                "log.faults -> (3 * (log.faults) / 2)"), "entries before the first are empty"),
    Equivalent("supervisor", "is_stopped(now) && now >= wanted", ("is_stopped(now) && ->", ">= -> >"),
               "of modes that are not stopped none is wanted but degraded, which is the same"),
    Equivalent("supervisor", "(now == Mode::degraded && next == now)",
               ("now == Mode::degraded -> true", "now == Mode::degraded && ->"),
               "no other mode that is not stopped is entered"),
    Equivalent("supervisor", "if (p.drive.expected != 0) {", ("p.drive.expected != 0 -> true",),
               "the watch itself says nothing of a drive that is not expected"),
    Equivalent("supervisor", "if (!is_finite(state.output) || mode_of(state) == Mode::latched)",
               ("!is_finite(state.output) || ->",),
               "the last effort is a number, and so is what is clamped to it"),
    Equivalent("supervisor", "if (before == Mode::damped_stop && (runs_away",
               ("before == Mode::damped_stop -> true", "before == Mode::damped_stop && ->"),
               "a mode that is stopped harder is not entered again"),
    Equivalent("supervised", "lower = {n: power for n, (power, loaded)",
               ("power <= speed and loaded == 0.0 -> (power <= speed)", "loaded == 0.0 -> (True)"),
               "of terms with equal powers of speed the one without a load comes first"),
    Equivalent("supervised", "left = max(weight - min(v.get(",
               ("1.0 -> (2.0)", "1.0 -> (1.5)",
                'max(weight - min(v.get("gravity_share", 1.0) * weight, effort), 0.0) -> '
                '(weight - min(v.get("gravity_share", 1.0) * weight, effort))'),
               "no law carries more than the weight, and less than nothing is left to nobody"),
    Equivalent("supervised", '"power_limit": effort * speed,',
               tuple(f"effort * speed -> ({factor} * (effort * speed))" for factor in ("0.5", "1.5", "2")),
               "it stays only where the velocity has no limit"),
    Equivalent("supervised", '"degrades": float(v.get("gravity_share", 1.0) > 0.5)', ("1.0 -> (2.0)", "1.0 -> (1.5)"),
               "all of the weight is more than half, too"),
    Equivalent("worn", "return supervised(law, instruments=measured, body=nothing", ("False -> (True)",),
               "without a body there is no test at start-up"),
    Equivalent("joint_compensation", "place_on_rail(card, slider), 1.0)",
               ("1.0 -> (0.5)", "1.0 -> (1.5)", "1.0 -> (2.0)"), "the width is replaced below"),
    Equivalent("tree_laws", '"force_excess": FORCE_LOUDNESS}',
               tuple(f"FORCE_LOUDNESS -> ({factor} * (FORCE_LOUDNESS))" for factor in ("0.5", "1.5", "2")),
               "it is 0, and so is any multiple"),
    Equivalent("supervisor_watches", "return earlier <= 0x7fffffffu ?", ("<= -> <",), EQUAL),
    Equivalent("tree_gate", "c.joints = joints < N ? joints : N", ("< -> <=",), EQUAL),
    Equivalent("tree_gate", "S share = S(1);", ("S(1) -> S(1 * 1.5)", "S(1) -> S(1 * 2)"),
               "a share of 1 or more gives 0 either way, and a smaller one does not depend on where it began"),
    Equivalent("tree_gate", "share = c.joint[k].max_change / abs(output[k])", ("<= -> <",), EQUAL),
    Equivalent("tree_gate", "output[k] - share * output[k] : S(0)",
               ("share < S(1) -> true", "< -> <=", "S(1) -> S(1 * 1.5)", "S(1) -> S(1 * 2)"),
               "the share is at most 1, and all of an effort taken from it is 0"),
    Equivalent("tree_gate", "return output >= -limit && output <= limit",
               ("output >= -limit -> true", "output >= -limit && ->", "-limit -> (2 * (-limit))",
                "-limit -> (3 * (-limit) / 2)", "&& output <= limit ->", "output <= limit -> true",
                "limit -> (2 * (limit))", "limit -> (3 * (limit) / 2)"), NOT_A_NUMBER),
    Equivalent("tree_gate", "clamp(wanted[k], -limit, limit)",
               ("clamp(wanted[k], -limit, limit) -> max<S>(wanted[k], -limit)",
                "clamp(wanted[k], -limit, limit) -> min<S>(wanted[k], limit)"), NESTED),
    Equivalent("tree_gate", "power = power + next[k] * velocity[k];", ("+ -> -",), "only the size of power counts"),
    Equivalent("tree_law", "w.valid && is_finite(w.force.x", ("+ -> -",), FINITE),
    Equivalent("tree_law", "if (n > 0) {", ("n > 0 -> true", "> -> >="), "a law without joints is not valid"),
    Equivalent("tree_supervisor", "whole.end_link > 0 && c.whole.speed", ("whole.end_link > 0 && ->",
               "whole.end_link > 0 -> true", "> -> >="), "a point of no link has no speed"),
    Equivalent("tree_supervisor", "whole.end_link > 0 && c.whole.speed", ("< -> <=",),
               "no speed is beyond the largest number"),
    Equivalent("tree_supervisor", "whole.end_link > 0 && c.whole.speed",
               ("&& c.whole.speed < S(std::numeric_limits<S>::max()) ->",
                "c.whole.speed < S(std::numeric_limits<S>::max()) -> true",
                "S(std::numeric_limits<S>::max()) -> (2 * (S(std::numeric_limits<S>::max())))",
                "S(std::numeric_limits<S>::max()) -> (3 * (S(std::numeric_limits<S>::max())) / 2)",
                "S(std::numeric_limits<S>::max()) -> ((S(std::numeric_limits<S>::max())) / 2)"),
               "no speed is beyond a limit of half the largest number or more"),
    Equivalent("tree_supervisor", "const Mode next = again && now >= wanted", ("again && ->", ">= -> >"),
               "no mode that is not stopped is wanted"),
    Equivalent("tree_supervisor", "if (again && next == now) return;", ("again && ->",),
               "no mode that is not stopped is wanted"),
    Equivalent("tree_supervisor", "if (fault == SafetyFault::none) return;", ("fault == SafetyFault::none -> false",),
               "nothing is written down of no fault, and the next one takes its place"),
    Equivalent("tree_supervisor", "if (fault != SafetyFault::none && first.fault == SafetyFault::none)",
               ("fault != SafetyFault::none -> true", "fault != SafetyFault::none && ->"),
               "a fault that is none leaves room for the next"),
    Equivalent("tree_supervisor", "power = power + state.output[k] * velocity[k];", ("+ -> -",),
               "only the size of power counts"),
    Equivalent("tree_supervisor", "if (drive.expected == 0) continue;", ("drive.expected == 0 -> false",),
               "the watch itself says nothing of a drive that is not expected"),
    Equivalent("tree_supervisor", "mode_of(state) == Mode::latched || !is_finite(next)", ("|| !is_finite(next) ->",),
               "the last effort is a number, and so is what is clamped to it"),
    Equivalent("tree_supervisor", "&& runs_away) enter(state, found, Mode::zero)",
               ("mode_of(state) == Mode::damped_stop -> true", "mode_of(state) == Mode::damped_stop && ->"),
               "a mode that is stopped harder is not entered again"),
    Equivalent("tree_supervisor", "p.whole.reset_delay < S(1e6) * c.period", ("< -> <=",), EQUAL),
    Equivalent("supervisor_watches", "if (later <= 0x7fffffffu)", ("<= -> <",), EQUAL),
    Equivalent("supervisor_watches", "next.pushed = (pushed < S(0)", ("< -> <=",), EQUAL),
    Equivalent("supervisor_watches", "const auto size = [](S x)", ("< -> <=",), EQUAL),
    Equivalent("supervisor_watches", "latest = s.probe.sum[k] > latest", ("> -> >=",), EQUAL),
    Equivalent("unexplained_energy_watch", "is_finite(energy + kinetic)", ("+ -> -",), FINITE),
)  # fmt: skip
"""Mutants that no test can kill, by file, source text and change."""


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant."""

    mutant: Mutant
    killed_by: str  # the test that failed; empty if it survives, "invalid" if it does not compile
    seconds: float


def rows() -> Iterator[ResultRow]:
    """Yield the mutation score, the survivors and the time."""
    verdicts = judged(all_mutants(), COUNT, SEED)
    yield from score_rows(verdicts)


def score_rows(verdicts: Sequence[Verdict]) -> Iterator[ResultRow]:
    """Yield the figures of mutants that were tried."""
    survivors = [v.mutant for v in verdicts if not v.killed_by]
    told = [m for m in survivors if not reason_of(m)]
    explained = [f"{described(m)} ({reason_of(m)})" for m in survivors if reason_of(m)]
    counted = len(verdicts) - len(explained)
    note = f"not equivalent, of {len(verdicts)} tried, seed {SEED}, of {len(all_mutants())}"
    yield _row("count", len(verdicts) - len(explained), note)
    killed = 100.0 * (counted - len(told)) / max(counted, 1)
    yield _row("killed", killed, f"of {counted} that are not equivalent", "%")
    yield _row("survivors", len(told), "; ".join(map(described, told)))
    yield _row("equivalent", len(explained), "; ".join(explained))
    seconds = float(np.median([v.seconds for v in verdicts])) if verdicts else 0.0
    yield ResultRow("mutants.seconds", seconds, "s", "evidence", "simulated", None, "median of a mutant, this machine")


def _row(name: str, value: float, note: str, unit: str = "1") -> ResultRow:
    return ResultRow(f"mutants.{name}", float(value), unit, "evidence", "simulated", None, note)


@cache
def source_of(file: str) -> str:
    """Return the source of a file by its path from the root."""
    return (ROOT / file).read_text(encoding="utf-8")


def described(mutant: Mutant) -> str:
    """Return file, line and change of a mutant."""
    return mutant.described(source_of(mutant.file))


def is_one_of(mutant: Mutant, equivalent: Equivalent) -> bool:
    """Whether a mutant is one of those that are said to change nothing."""
    source = source_of(mutant.file)
    was = " ".join(source[mutant.start : mutant.end].split())
    change = f"{was} -> {' '.join(mutant.text.split())}".strip()
    same_place = Path(mutant.file).stem == equivalent.file and equivalent.source in mutant.line(source)
    return same_place and change in equivalent.changes


def reason_of(mutant: Mutant) -> str:
    """Return why a mutant changes nothing; empty if nothing is known of it."""
    return next((each.reason for each in EQUIVALENT if is_one_of(mutant, each)), "")


@cache
def all_mutants() -> tuple[Mutant, ...]:
    """Return every mutant of the safety code."""
    made: list[Mutant] = []
    for header in JUDGES:
        file = f"include/pellucid/{header}.hpp"
        made += mutants_of(file, source_of(file))
    for module, (functions, _) in PYTHON_JUDGES.items():
        file = f"src/pellucid/controllers/{module}.py"
        made += mutants_of(file, source_of(file), functions)
    return tuple(made)


def judged(mutants: Sequence[Mutant], count: int, seed: int) -> list[Verdict]:
    """Return the verdicts on `count` mutants in the random order of a seed; mutants that do not compile are
    excluded.
    """
    order = [mutants[i] for i in np.random.default_rng(seed).permutation(len(mutants))]
    verdicts: list[Verdict] = []
    with tempfile.TemporaryDirectory(prefix="pellucid-mutants-") as folder, ThreadPoolExecutor(WORKERS) as pool:
        while order and len(verdicts) < count:
            batch, order = order[: count - len(verdicts)], order[count - len(verdicts) :]
            tried = pool.map(lambda mutant: judge(mutant, Path(folder)), batch)
            verdicts += [verdict for verdict in tried if verdict.killed_by != "invalid"]
    return verdicts


def judge(mutant: Mutant, folder: Path) -> Verdict:
    """Return what the tests of its file say of one mutant; `folder` holds what is copied for it."""
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(dir=folder) as copy:
        killer = (_cpp_killer if mutant.file.endswith(".hpp") else _python_killer)(mutant, Path(copy))
    return Verdict(mutant, killer, time.monotonic() - begun)


def _cpp_killer(mutant: Mutant, copy: Path) -> str:
    shutil.copytree(ROOT / "include", copy / "include")
    (copy / mutant.file).write_text(mutant.applied(source_of(mutant.file)), encoding="utf-8")
    for test in JUDGES[Path(mutant.file).stem]:
        program = copy / test
        built = subprocess.run(
            [os.environ.get("CXX", "c++"), "-std=c++17", "-O0", "-w", "-ffp-contract=off", "-fno-exceptions",
             "-fno-rtti", "-DEND_AT_FIRST_FAILURE",
             f"-I{copy / 'include'}", str(ROOT / "tests" / "core" / f"{test}_test.cpp"), "-o", str(program)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if built.returncode:
            return f"{test}: static assertion" if "static assertion" in built.stderr else "invalid"
        if _fails([str(program)]):
            return test
    return ""


def _python_killer(mutant: Mutant, copy: Path) -> str:
    import pellucid
    from pellucid import _core

    here = Path(pellucid.__file__).parent
    package = Path(shutil.copytree(here, copy / "pellucid", ignore=shutil.ignore_patterns("__pycache__", "*.so")))
    (package / Path(_core.__file__).name).symlink_to(_core.__file__)
    place = package / "controllers" / Path(mutant.file).name
    place.write_text(mutant.applied(source_of(mutant.file)), encoding="utf-8")
    # An editable install finds the package before any path does.
    code = (
        "import sys; sys.meta_path[:] = [f for f in sys.meta_path if 'Redirecting' not in type(f).__name__]; "
        f"sys.path[:0] = [{str(copy)!r}]; import pytest; sys.exit(pytest.main(sys.argv[1:]))"
    )
    for test in PYTHON_JUDGES[Path(mutant.file).stem][1]:
        path = ROOT / "tests" / "unit" / f"{test}.py"
        asked = ["-qx", "--noconftest", "-c", os.devnull, "-p", "no:cacheprovider", "-k", "not study", str(path)]
        if _fails([sys.executable, "-c", code, *asked]):
            return test
    return ""


def _fails(command: list[str]) -> bool:
    """Whether a test fails or does not end."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        return bool(
            subprocess.run(
                command, capture_output=True, timeout=LONGEST_TEST_S, check=False, env=environment
            ).returncode
        )
    except subprocess.TimeoutExpired:
        return True
