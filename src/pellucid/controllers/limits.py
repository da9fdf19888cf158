"""What a controller may ask for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """What the safety gate of a control law lets through, and what an EMG torque may be.

    Attributes
    ----------
    effort, rate : float
        Of the command [N m], [N m/s]; N and N/s where a joint is prismatic.
    velocity : float
        Of the joint; beyond is a fault [rad/s].
    position : tuple of float
        The stops [rad].
    stop_margin : float
        Over which the effort into a stop falls to 0 [rad].
    emg_torque : float
        Largest believable muscle torque [N m].

    Examples
    --------
    >>> import pellucid as pl
    >>> pl.Limits(effort=5.0, velocity=10.0).rate
    300.0
    """

    effort: float = 10.0
    rate: float = 300.0
    velocity: float = 15.0
    position: tuple[float, float] = (-0.6, 2.2)
    stop_margin: float = 0.1
    emg_torque: float = 40.0
