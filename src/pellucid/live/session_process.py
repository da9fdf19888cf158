"""Whether the process of a session still lives: its children end by themselves after its death, however it died.

A child knows its session by the number of the process that started it. The system gives a child whose parent died
another parent, so that a look is one call, and no pipe or signal has to be kept. After the session's death a child goes
on for `ORPHAN_S`: the engine stops its law meanwhile, as after any silence, and the recorder writes what there is.
"""

from __future__ import annotations

import os
import time

SESSION_VARIABLE = "PELLUCID_SESSION_PROCESS"
"""Variable of the environment that tells a child the number of its session's process; the engine reads it, too."""

ORPHAN_S = 2.0
"""Time for which a child goes on after its session's death [s]: a law is stopped after 1 s of silence."""


class SessionProcess:
    """The process that started this one as a part of a session; there may be none."""

    def __init__(self) -> None:
        self._number = int(os.environ.get(SESSION_VARIABLE, "0"))
        self._gone_since: float | None = None

    def gone_for(self) -> float:
        """Return for how long the session's process has been seen to be dead [s]; 0 while it lives."""
        if self._number == 0 or os.getppid() == self._number:
            return 0.0
        if self._gone_since is None:
            self._gone_since = time.monotonic()
        return time.monotonic() - self._gone_since

    def is_over(self) -> bool:
        """Return whether a child should end now."""
        return self.gone_for() > ORPHAN_S
