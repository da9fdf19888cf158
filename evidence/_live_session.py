"""A session without a page that only keeps its engine alive: the process that `evidence live` kills.

``python -m evidence._live_session FOLDER CARDS [--attach]`` starts or goes on with a session of the virtual elbow in a
folder. It arms the law and gives the wearer a sine to follow, and says "ready" when that is done.
"""

import pickle
import sys
import time
from pathlib import Path

from pellucid.lab.live import virtual_elbow
from pellucid.live.engine import LiveEngine
from pellucid.live.setup import EngineSetup

BEAT_S = 0.1
"""Time between two signs of life."""

MOTION = (1.2, 0.4, 0.35)
"""Centre [rad], amplitude [rad] and frequency [Hz] of the sine that the wearer follows."""


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
    """Reset what is stopped, arm the law and let the wearer move; whether the law runs."""
    until = time.monotonic() + patience_s
    while time.monotonic() < until:
        state = engine.status().state
        if state == "running":
            engine.set_tracking(*MOTION)
            return True
        if state == "stopped":
            engine.reset()
        elif state == "idle":
            engine.arm()
        rest(engine, 0.2)
    return False


def main() -> None:
    folder, cards, *more = sys.argv[1:]
    setup = session_setup(Path(cards))
    engine = LiveEngine.attach(setup, folder) if "--attach" in more else LiveEngine.start(setup, folder)
    begin_motion(engine)
    print("ready", flush=True)
    while True:
        rest(engine, 1.0)


if __name__ == "__main__":
    main()
