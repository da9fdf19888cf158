"""A foreign law on the elbow robot, behind the supervisor that every law of this robot has in the lab."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from pellucid.controllers.elbow_laws import ELBOW_LIMITS
from pellucid.controllers.supervised import SupervisedLaw

from ..safety.worn_robot import WornRobot
from .commanded import commanded_law
from .foreign_law import ForeignProcess


@dataclass(frozen=True)
class CommandedElbowLaw(SupervisedLaw):
    """A supervised law whose effort a function gives; it reads encoder and force sensor."""

    command: Callable[[float, float, float], float] = field(default=lambda time, position, torque: 0.0, compare=False)

    @property
    def sensed(self) -> bool:
        """The law gets the force sensor."""
        return True

    @property
    def uses(self) -> tuple[str, ...]:
        """Return the sensors other than the encoder that the law reads and whose faults are tested."""
        return ("interaction",)


def elbow_law_of(process: ForeignProcess, worn: WornRobot, *, start_up: bool) -> CommandedElbowLaw:
    """Return a foreign law on one robot and wearer, supervised as every other law there.

    It is reset whenever time begins anew.
    """
    plain = commanded_law(ELBOW_LIMITS, worn.rig.period)
    watched = worn.watched(plain.using("interaction"), start_up=start_up)
    return CommandedElbowLaw(watched.law, watched.supervision, process.command_of("elbow"))
