"""A few seconds of a live session, recorded on the spot with the virtual elbow's engine and computed again."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pellucid._errors import PellucidError
from pellucid.controllers.session_state import UNPOWERED
from pellucid.live import layout
from pellucid.live.engine import LiveEngine
from pellucid.live.replay import Replay, read_session, replay_records

from ..live import virtual_elbow
from ..session_devices import bridge_stalls

TARGETS_RAD = (1.45, 1.0)
"""Targets of the session, one after another [rad]."""

MOVEMENT_S = 1.6
"""Time for each of them [s]."""

MAX_START_S = 5.0
"""Longest time for the law to run [s]."""

SETTLING_S = 1.0
"""Time in which the wearer comes to rest under the law before the first target [s]."""

STEP_S = 0.05
"""Time between two signs of life of the session [s]."""


@dataclass(frozen=True)
class ReplayedSession:
    """A recorded session and what computing it again found."""

    law: str  # name of its condition
    replay: Replay
    time: np.ndarray  # shape (n,), from the first target [s]
    angle: np.ndarray  # angle of the forearm, shape (n,) [rad]
    target: np.ndarray  # shape (n,) [rad]
    command: np.ndarray  # shape (n,) [N m]
    interaction: np.ndarray  # torque between robot and person, shape (n,) [N m]


def record_and_replay(cards: Mapping, law: str, folder: Path) -> ReplayedSession:
    """Run the engine with a law on the virtual elbow for some seconds, and compute its commands again.

    Raises
    ------
    PellucidError
        If this system has no engine, or the law did not run.
    """
    setup = bridge_stalls(virtual_elbow(conditions=(law,), cards=dict(cards)))
    with LiveEngine.start(setup, folder, streams=False) as engine:
        path = engine.session_file
        until = time.monotonic() + MAX_START_S
        while not engine.status().state.in_force:
            if time.monotonic() > until:
                raise PellucidError(f"a session of {law}: the law did not run within {MAX_START_S:g} s")
            if engine.status().state == UNPOWERED:
                engine.arm()
            elif engine.status().state.needs_reset:  # a busy computer paused the engine, and the supervisor stopped it
                engine.reset()
            _rest(engine, STEP_S)
        _rest(engine, SETTLING_S)
        begun = time.monotonic()
        for target in TARGETS_RAD:
            engine.set_target(target)
            _rest(engine, MOVEMENT_S)
    conditions, records = read_session(path)
    shown = records[1e-9 * records["time"] >= begun]
    return ReplayedSession(
        law, replay_records(conditions, records), 1e-9 * shown["time"] - begun, shown["limb_position"], shown["target"],
        shown["effort"], shown["value"][:, layout.VALUE_NAMES.index("interaction")],
    )  # fmt: skip


def _rest(engine: LiveEngine, seconds: float) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        engine.beat()
        time.sleep(STEP_S)
