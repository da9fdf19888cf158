"""The residual compensator of a worn orthosis as a simulation calls it: raw EMG in, torque out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pellucid import _core
from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.residual_compensator import ResidualDesign
from pellucid.controllers.worn import watched_worn


@dataclass(frozen=True)
class StrapLearning:
    """How the strap is estimated while it is worn; bounds are factors on what was identified, where margins hold."""

    bandwidth: float = 100.0  # bandwidth, slowest: The band that is fitted [rad/s]
    slowest: float = 1.0
    forgetting: float = 10.0  # [s]
    # prior_mismatch, excitation: RMS mismatch that weighs as much as the start, and below which nothing is learnt [rad]
    prior_mismatch: float = 0.1
    excitation: float = 0.01
    stiffness: tuple[float, float] = (0.7, 1.3)  # stiffness, damping: Bounds [1]
    damping: tuple[float, float] = (0.7, 1.3)


class WornCompensator:
    """A residual compensator with its EMG chain, called once a period."""

    def __init__(
        self,
        design: ResidualDesign,
        emg: _core.EmgTorque | None = None,
        learning: StrapLearning | None = None,
        instruments: Instruments | None = None,
    ):
        self.design = design
        self._law = design.control_law()
        self._spring_is_watched = instruments is not None and instruments.drive
        self.core = watched_worn(self._law, instruments).start()
        self._emg = emg
        self._strap = None
        if learning is not None:
            m, numbers = design.coupling, design.control_law().values
            chosen = {
                "bandwidth": learning.bandwidth,
                "slowest": learning.slowest,
                "forgetting": learning.forgetting,
                "prior_mismatch": learning.prior_mismatch,
                "excitation": learning.excitation,
                "stiffness_min": learning.stiffness[0] * m.strap_stiffness,
                "stiffness_max": learning.stiffness[1] * m.strap_stiffness,
                "damping_min": learning.damping[0] * m.strap_damping,
                "damping_max": learning.damping[1] * m.strap_damping,
                "period": design.period,
            }
            names = _core.STRAP_ESTIMATOR_PARAMETER_NAMES
            self._strap = _core.StrapEstimator([chosen[n] if n in chosen else numbers[n] for n in names])
        self.strap = (design.coupling.strap_stiffness, design.coupling.strap_damping)

    @property
    def law(self) -> ControlLaw:
        """Law of the core, with the strap as it is taken to be now."""
        return self._law

    @property
    def listens(self) -> bool:
        """Whether the law gets torque from EMG."""
        return self._emg is not None

    @property
    def learns(self) -> bool:
        """Whether the strap is estimated while it is worn."""
        return self._strap is not None

    @property
    def fault(self) -> str:
        """Fault of its supervisor."""
        return self.core.fault

    def step(
        self,
        time: float,
        position: float,
        torque: float,
        emg: Sequence[tuple[float, float]] = (),
        *,
        motor_position: float | None = None,
    ) -> float:
        """One control period. `time`, `position`, `torque` [s], [rad], [N m]; `emg` [V]; gives [N m].

        `motor_position` is the second encoder's [rad], where the instruments have one.
        """
        muscle, heard = 0.0, False
        if self._emg is not None:
            if len(emg):
                self._emg.listen(emg)
            muscle, heard = self._emg.torque(position), self._emg.valid
        return self.step_with_torque(time, position, torque, muscle, heard, motor_position=motor_position)

    def step_with_torque(
        self,
        time: float,
        position: float,
        torque: float,
        muscle: float,
        heard: bool = True,
        *,
        motor_position: float | None = None,
    ) -> float:
        """One control period, with the muscles' torque already estimated. `time`, `position`, `torque` [s], [rad],
        [N m]; `muscle` [N m]; `motor_position` [rad]; gives [N m]."""
        if self._strap is not None:
            stiffness, damping, learns = self._strap.step(position, torque, muscle, heard)
            if learns:
                self.strap = (stiffness, damping)
                self._law = self._law.changed(strap_stiffness=stiffness, strap_damping=damping)
                self.core.adjust(self._law.parameters)
        # A spring whose torque is watched is the drive's measurement.
        drive = torque if self._spring_is_watched else None
        return self.core.step(time, position, torque, muscle if heard else None, drive=drive, joint=motor_position)
