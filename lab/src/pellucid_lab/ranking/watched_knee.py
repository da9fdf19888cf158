"""Every controller that is ranked at the knee, of the toolkit and foreign, under the same supervisor.

It is the supervisor that `export` puts around a law of this orthosis, with the instruments that the rig states: both
encoders, the spring as the drive's measurement, limits of effort, rate, speed and angle, and every check.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pellucid.controllers.control_law import ControlLaw, Limits
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.supervised import SupervisedLaw
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.controllers.worn import watched_worn

from ..knee.machine import KneeMachine
from ..knee.trial import Controller
from .commanded import CommandedLaw, commanded_law


@dataclass(frozen=True)
class IdentifiedDrive:
    """What the supervisor of every law knows of the orthosis's drive, as it was identified.

    These are not the numbers of the simulated drive: its torque loop compensates a part of the motor's inertia and
    friction. A supervisor that expects more inertia than the loop leaves counts energy that the drive never gave.
    """

    coulomb: float  # dry friction that the torque loop leaves [N m]
    inertia: float  # inertia that the torque loop leaves [kg m^2]

    @classmethod
    def from_coupling(cls, coupling: Coupling) -> IdentifiedDrive:
        """Return the drive of an identified orthosis and wearer."""
        return cls(coulomb=coupling.actuator_coulomb, inertia=coupling.actuator_inertia)


def watched(law: ControlLaw, rig: KneeMachine, drive: IdentifiedDrive) -> SupervisedLaw:
    """Return a law of the core under the supervisor that an exported law has at the knee."""
    known = {"actuator_coulomb": drive.coulomb, "actuator_inertia": drive.inertia}
    return watched_worn(law, rig.instruments, actuator=known)


def watched_command(rig: KneeMachine, drive: IdentifiedDrive) -> SupervisedLaw:
    """Return a law of commanded effort at the knee under the same supervisor."""
    return watched(commanded_law(Limits(), rig.period), rig, drive)


class WatchedController:
    """Any controller of the knee orthosis under the supervisor that an exported law has there.

    Parameters
    ----------
    controller : Controller
        It gets the spring's torque and raw EMG, and answers the torque that the spring is to have.
    rig : KneeMachine
        Orthosis, whose instruments the supervisor knows.
    drive : IdentifiedDrive
        What was identified of its drive.
    """

    reads_motor_encoder = True

    def __init__(self, controller: Controller, rig: KneeMachine, drive: IdentifiedDrive) -> None:
        self._controller = controller
        self._supervised = CommandedLaw(watched_command(rig, drive))
        self._drive_is_measured = rig.instruments.drive

    @property
    def fault(self) -> str:
        """Why the controller was stopped: its own fault, or else the supervisor's."""
        own = getattr(self._controller, "fault", NO_FAULT)
        return own if own != NO_FAULT else self._supervised.fault

    def step(
        self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = (), *,
        motor_position: float | None = None,
    ) -> float:  # fmt: skip
        """Return the torque for the spring [N m]; `time` [s], `position`, `motor_position` [rad], `torque` [N m]."""
        # A controller that was stopped is not asked again, so that the first cause remains.
        command = self._controller.step(time, position, torque, emg) if self.fault == NO_FAULT else 0.0
        if getattr(self._controller, "fault", NO_FAULT) != NO_FAULT:
            self._supervised.stop()
        drive = torque if self._drive_is_measured else None
        return self._supervised.step(time, position, command, drive=drive, joint=motor_position)
