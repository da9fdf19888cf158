"""What a controller of a worn orthosis may ask for, and the gate that sees to it."""

from __future__ import annotations

from dataclasses import dataclass

from .. import _core


@dataclass(frozen=True)
class Limits:
    """What the safety gate lets through, and what the inputs may be.

    Attributes
    ----------
    effort, rate : float
        Of the command [N m], [N m/s].
    velocity : float
        Of the joint; beyond is a fault [rad/s].
    position : tuple of float
        The stops [rad].
    stop_margin : float
        Over which the torque into a stop falls to 0 [rad].
    emg_torque : float
        Largest believable muscle torque [N m].
    """

    effort: float = 10.0
    rate: float = 300.0
    velocity: float = 15.0
    position: tuple[float, float] = (-0.6, 2.2)
    stop_margin: float = 0.1
    emg_torque: float = 40.0

    def gate(self, period: float) -> _core.SafetyGate:
        """The last step of a controller.

        Parameters
        ----------
        period : float
            [s].

        Returns
        -------
        _core.SafetyGate
            Open.
        """
        return _core.SafetyGate(
            effort_limit=self.effort,
            rate_limit=self.rate,
            velocity_limit=self.velocity,
            position_min=self.position[0],
            position_max=self.position[1],
            stop_margin=self.stop_margin,
            max_age=5 * period,
            max_repeats=2,
            period=period,
        )
