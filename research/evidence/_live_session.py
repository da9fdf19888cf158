"""A session without a page that only keeps its engine alive: the process that `evidence live` kills.

``python -m research.evidence._live_session FOLDER CARDS TRIAL`` starts a session of the virtual elbow in a folder and
records a trial. It arms the law and gives the wearer a sine to follow. It says as JSON where the region is and which
processes run.
"""

import json
import pickle
import sys
import time
from pathlib import Path

from pellucid.controllers.session_state import UNPOWERED
from pellucid.live.engine import LiveEngine
from pellucid.live.setup import EngineSetup
from pellucid_lab.live import virtual_elbow

BEAT_S = 0.1
"""Time between two signs of life."""

MOTION = (1.2, 0.4, 0.35)
"""Centre [rad], amplitude [rad] and frequency [Hz] of the sine that the wearer follows."""

REST = (1.2, 0.0, 0.35)
"""The same for a wearer who waits at its centre."""


def session_setup(cards: Path, conditions: tuple[str, ...] = ("FC",)) -> EngineSetup:
    """Return the virtual elbow, whose identified cards lie in a file."""
    return virtual_elbow(conditions=conditions, cards=pickle.loads(cards.read_bytes()))


def rest(engine: LiveEngine, seconds: float) -> None:
    """Wait so long, and say that the session is alive meanwhile."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        engine.beat()
        time.sleep(min(BEAT_S, max(until - time.monotonic(), 0.0)))


def begin_motion(engine: LiveEngine, patience_s: float = 20.0) -> bool:
    """Reset what is stopped, arm the law and let the wearer move; whether the law runs.

    The wearer is asked to rest first: no reset is granted while the joint moves.
    """
    until = time.monotonic() + patience_s
    while time.monotonic() < until:
        state = engine.status().state
        if state.in_force:
            engine.set_tracking(*MOTION)
            return True
        if state.needs_reset:
            engine.set_tracking(*REST)
            engine.reset()
        elif state == UNPOWERED:
            engine.arm()
        rest(engine, 0.2)
    return False


def main() -> None:
    folder, cards, trial = map(Path, sys.argv[1:])
    engine = LiveEngine.start(session_setup(cards), folder)
    begin_motion(engine)
    engine.begin_recording(trial, {"protocol": "killed"})
    while not trial.exists():
        rest(engine, 0.1)
    print(json.dumps({"region": str(engine.region.path), "processes": engine.processes}), flush=True)
    while True:
        rest(engine, 1.0)


if __name__ == "__main__":
    main()
