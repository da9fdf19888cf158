"""Sequences of actions on the engine's state: every short one on a simulated clock, drawn ones on real processes."""

from __future__ import annotations

import random
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from pellucid.controllers.session_state import ENDED
from pellucid.live.engine import LiveEngine
from pellucid.live.setup import SESSION_TIMEOUT_S
from research.benchmarks._size import sized

ROOT = Path(__file__).parents[2]
"""Root folder of the repository."""

PATH_LENGTH = sized(4, smallest=2)
"""Number of actions of a path on the simulated clock; from power-on and from a running law there are 2 * 12^n."""

REAL_PATH_COUNT = sized(200, smallest=5)
"""Number of drawn paths on real processes."""

REAL_PATH_LENGTH = 5
"""Number of actions of each of them."""

MAX_POWERED_S = 0.6
"""Longest time with power after the last sign of life of a session."""

ACTIONS = ("arm", "disarm", "stop", "reset", "silent", "frozen", "not_a_number", "condition", "away")
"""What is done to the engine: by a session, by a fault in its inputs, or by a session that gives no sign of life."""

SOURCES = ("tests/core/engine_paths.cpp", "engine/loop.cpp", "engine/laws.cpp", "engine/region.cpp")
"""Files of the program that explores."""


def explore(length: int = PATH_LENGTH) -> dict[str, float]:
    """Return what every path of a length came to on the engine's own code: paths, violations, powered_s, stop_ms."""
    compiler = shutil.which("c++")
    if compiler is None:
        return {}
    with TemporaryDirectory() as folder:
        program = Path(folder) / "paths"
        flags = ["-std=c++17", "-O2", "-ffp-contract=off", f"-I{ROOT / 'include'}"]
        subprocess.run([compiler, *flags, *(str(ROOT / name) for name in SOURCES), "-o", str(program)], check=True)
        said = subprocess.run([str(program), str(length)], capture_output=True, text=True).stdout
    return {name: float(value) for name, value in (line.split() for line in said.splitlines() if ":" not in line)}


def try_on_processes(engine: LiveEngine, count: int = REAL_PATH_COUNT, seed: int = 20290801) -> Iterator[str]:
    """Try drawn paths on a real engine, and yield what did not hold, a sentence each."""
    rng = random.Random(seed)
    others = len(engine.setup.conditions)
    for number in range(count):
        path = [rng.choice(ACTIONS) for _ in range(REAL_PATH_LENGTH)]
        stopped_token: int | None = None
        for action in path:
            away = action == "away"
            if action == "arm":
                engine.arm()
            elif action == "disarm":
                engine.disarm()
            elif action == "stop":
                was_running = engine.status().state.in_force
                engine.stop()
                stopped_token = 0 if was_running else None
            elif action == "reset":
                engine.reset()
                stopped_token = None
            elif action == "condition":
                engine.set_condition(rng.randrange(others))
            elif not away:
                engine.inject(action, 0.03)
            until = time.monotonic() + (SESSION_TIMEOUT_S + 0.15 if away else 0.05)
            while time.monotonic() < until:
                if not away:
                    engine.beat()
                time.sleep(0.01)
            status = engine.status()
            if away and status.enable and status.mode not in ("damped_stop", "zero", "latched"):
                yield f"path {number} {path}: power {SESSION_TIMEOUT_S + 0.15:g} s after the last sign of life"
            if stopped_token is not None and status.state.in_force:
                yield f"path {number} {path}: a stop was forgotten"
            if status.state == ENDED:
                yield f"path {number} {path}: {status.state.words}"
        engine.disarm()
