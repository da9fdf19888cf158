"""States of a session's engine, as the core has them: `include/pellucid/session_state.hpp`.

An engine that runs no cycles has none of them: it is lost, silent while its process lives.
"""

from __future__ import annotations

from dataclasses import dataclass

from .. import _core


@dataclass(frozen=True)
class SessionState:
    """A state of a live session, with its effect on the robot."""

    name: str
    words: str  # for a page
    in_force: bool = False  # whether a law may move the robot as it is meant to
    needs_reset: bool = False  # whether nothing runs before an operator's reset
    next: tuple[str, ...] = ()  # names of the states that may follow within a cycle
    is_lost: bool = False  # whether the engine runs no cycles


SESSION_STATES: tuple[SessionState, ...] = tuple(SessionState(**state) for state in _core.session_states())
"""States of the engine, in the order of their codes."""

UNPOWERED: SessionState = SESSION_STATES[0]
"""State in which an engine begins: no law, and no power."""

SILENT = SessionState("silent", "the engine is silent", is_lost=True)
"""A living engine that runs no cycles."""

ENDED = SessionState("ended", "the engine has ended", is_lost=True)
"""An engine whose process has ended, or that ended in order."""
