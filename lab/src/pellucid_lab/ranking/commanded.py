"""An effort that something else computes, behind the same supervisor that every exported law has.

The supervised law is a joint's compensation without a body, whose constant offset is set to the wanted effort in each
period. Front, gate, watches, stops and the log are those of the core, and nothing of them knows where the effort is
from.
"""

from __future__ import annotations

import numpy as np

from pellucid.controllers.control_law import LAWS, ControlLaw, Limits, gate_values
from pellucid.controllers.supervised import SupervisedLaw

LAW_KIND = "joint"
"""Kind of the law that carries the effort: of one encoder, with a constant `offset`."""


def commanded_law(limits: Limits, period: float) -> ControlLaw:
    """Return a law that asks for no effort until `CommandedLaw` gives it one; `period` [s]."""
    own = {"velocity_width": 0.1, "stribeck_velocity": 0.1}
    return ControlLaw(LAW_KIND, {**LAWS[LAW_KIND].defaults, **own, **gate_values(limits, period)})


class CommandedLaw:
    """A supervised `commanded_law` that receives its effort in each period.

    Parameters
    ----------
    supervised : SupervisedLaw
        A law of `commanded_law` under its supervisor, for example of `watched_worn`.

    Raises
    ------
    ValueError
        If it is a law of another kind.

    Examples
    --------
    >>> import pellucid as pl
    >>> from pellucid.controllers.control_law import Limits
    >>> law = CommandedLaw(pl.supervised(commanded_law(Limits(effort=5.0), 0.002), start_up=False))
    >>> efforts = [law.step(0.002 * i, 0.5 + 1e-4 * i, 1.0) for i in range(100)]
    >>> efforts[-1], law.fault
    (1.0, 'none')
    """

    def __init__(self, supervised: SupervisedLaw) -> None:
        if supervised.kind != LAW_KIND:
            raise ValueError(f"commanded law: found the kind {supervised.kind!r}, expected {LAW_KIND!r}")
        self._law = supervised.law
        self._core = supervised.start()
        names = list(supervised.law.values)
        self._parameters = np.array(supervised.law.parameters, float)
        self._offset = names.index("offset")

    @property
    def fault(self) -> str:
        """Fault that the supervisor has latched."""
        return self._core.fault

    def stop(self) -> None:
        """Ask the supervisor to stop from the next period on."""
        self._core.stop()

    def step(
        self, time: float, position: float, command: float, *, drive: float | None = None, joint: float | None = None
    ) -> float:
        """Return the effort of one period [N m]; `command` is what is wanted.

        `time` [s]; `position` [rad] and `joint`, a second encoder's; `drive` is the drive's measurement [N m]. A
        command that is no number stops the law.
        """
        if np.isfinite(command):
            self._parameters[self._offset] = command
            self._core.adjust(self._parameters)
        else:
            self._core.stop()
        return self._core.step(time, position, drive=drive, joint=joint)
