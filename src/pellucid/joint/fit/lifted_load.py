r"""Estimate a load that is fastened to a worn robot from its first lift, with an interval from lifts without it.

The robot's balance tells the load, whatever the wearer does, because the force sensor measures the wearer:

.. math::
    w + \tau = J a + G(q) + m\,(g r \sin q + r^2 a), \qquad w + f(v, w) = u,

with the drive's effort u, the wearer's torque :math:`\tau` on the robot and the load's mass m at the distance r from
the axis. Friction depends on the torque w that the transmission passes on, not on what the wearer carries. Errors of
the model and of the sensors give a lift without a load an apparent mass. The mean of these masses is subtracted, and
their spread makes the interval.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from ... import _core
from ..._errors import IdentificationError
from ...models.anthropometry import Segment
from ...models.joint import GRAVITY, NAMES, PARAMETER_INDEX
from ...numerics.filters import central_difference, zero_phase_lowpass

MIN_EMPTY_LIFTS = 3
"""Least number of lifts without a load: fewer give no spread that an interval could come from."""

MIN_LIFT_SPEED = 0.1
"""Samples below this speed are left out [rad/s]: friction at rest may be anything up to its largest value."""

MIN_MOVING_S = 0.1
"""Shortest time above `MIN_LIFT_SPEED` in a lift that tells a load [s]."""

NORMAL_QUANTILE_97_5 = 1.959964
"""Normal quantile of 97.5 %: an interval of 95 % reaches this many standard errors to either side."""

LIFT_FILTER_ORDER = 4
"""Order of the low-pass, which runs both ways."""


@dataclass(frozen=True)
class Lift:
    """One lift: signals of the robot at an even rate."""

    position: np.ndarray  # (n,) encoder, 0 where the joint hangs [rad]
    effort: np.ndarray  # (n,) effort of the drive at the joint [N*m]
    interaction: np.ndarray  # (n,) torque of the wearer on the robot, from the force sensor [N*m]
    fs: float  # sampling rate [Hz]


@dataclass(frozen=True)
class LoadEstimate:
    """A load as one lift tells it."""

    mass: float  # [kg]
    interval: tuple[float, float]  # 95 % interval of the mass [kg]
    distance: float  # from the joint's axis, as stated [m]

    @property
    def load(self) -> Segment:
        """The load as a law takes it."""
        return Segment(self.mass, self.distance, self.mass * self.distance**2)


def estimate_load(
    body: Mapping[str, float],
    empty: Sequence[Lift],
    loaded: Lift,
    *,
    distance: float,
    lowpass: float = 8.0,
    sensor_delay: float = 0.0,
    gain_error: float = 0.0,
) -> LoadEstimate:
    """Estimate the mass of a load at a stated distance from one lift.

    Parameters
    ----------
    body : mapping of str to float
        The robot without the load, by the core's names of a joint, SI; numbers that are left out are 0.
    empty : sequence of Lift
        Lifts without the load, at least three.
    loaded : Lift
        The lift with it.
    distance : float
        From the axis to the load [m].
    lowpass : float
        Cutoff of the zero-phase low-pass on all signals [Hz].
    sensor_delay : float
        Time by which the force sensor is late [s].
    gain_error : float
        Standard deviation of the force sensor's gain [1]. Lifts without a load do not show it.

    Returns
    -------
    LoadEstimate

    Raises
    ------
    IdentificationError
        If there are too few lifts without the load, or a lift does not move.

    Examples
    --------
    >>> import numpy as np
    >>> from pellucid.joint.fit.lifted_load import Lift, estimate_load
    >>> t = np.arange(0.0, 1.5, 1e-3)
    >>> q = 0.3 + 0.8 * (t / 1.5) ** 2 * (3.0 - 2.0 * t / 1.5)
    >>> a = 0.8 * (6.0 - 12.0 * t / 1.5) / 1.5**2
    >>> def lift(mass, error):
    ...     weight = (2.0 + 9.80665 * 0.3 * mass + error) * np.sin(q)
    ...     return Lift(q, weight + (0.05 + 0.09 * mass) * a, np.zeros_like(t), 1000.0)
    >>> empty = [lift(0.0, error) for error in (-0.02, 0.0, 0.03)]
    >>> found = estimate_load({"inertia": 0.05, "gravity_sine": 2.0}, empty, lift(1.0, 0.0), distance=0.3)
    >>> round(found.mass, 2), found.interval[0] < 1.0 < found.interval[1]
    (1.0, True)
    """
    if len(empty) < MIN_EMPTY_LIFTS:
        raise IdentificationError(
            f"load: found {len(empty)} lifts without it, expected at least {MIN_EMPTY_LIFTS}: their spread gives the "
            "interval"
        )
    if not distance > 0.0:
        raise IdentificationError(f"load: found a distance of {distance:g} m, expected one above 0")
    settings = {"distance": distance, "lowpass": lowpass, "sensor_delay": sensor_delay}
    apparent = np.array([_apparent_mass(body, lift, **settings) for lift in empty])
    mass = _apparent_mass(body, loaded, **settings) - float(apparent.mean())
    n = len(apparent)
    reach = float(stdtrit(n - 1, 0.975) * apparent.std(ddof=1) * np.sqrt(1.0 + 1.0 / n))
    reach = float(np.hypot(reach, NORMAL_QUANTILE_97_5 * gain_error * mass))
    return LoadEstimate(mass, (mass - reach, mass + reach), distance)


def _apparent_mass(
    body: Mapping[str, float], lift: Lift, *, distance: float, lowpass: float, sensor_delay: float
) -> float:
    """Return the mass at the distance that makes the robot's balance hold best over a lift [kg]."""
    unknown = sorted(set(body) - set(NAMES))
    if unknown:
        raise IdentificationError(f"load: found no number {', '.join(unknown)} of a joint's body")

    def smooth(samples: np.ndarray) -> np.ndarray:
        return zero_phase_lowpass(np.asarray(samples, float), lowpass, LIFT_FILTER_ORDER, lift.fs)

    late = round(sensor_delay * lift.fs)
    felt = np.concatenate([lift.interaction[late:], np.repeat(lift.interaction[-1], late)])
    q = smooth(lift.position)
    v = central_difference(q, lift.fs)
    a = central_difference(v, lift.fs)
    used = np.abs(v) > MIN_LIFT_SPEED
    if np.count_nonzero(used) < MIN_MOVING_S * lift.fs:
        raise IdentificationError(
            f"load: found {np.count_nonzero(used) / lift.fs:.3g} s of motion above {MIN_LIFT_SPEED:g} rad/s, expected "
            f"{MIN_MOVING_S:g} s"
        )
    vector = np.array([body.get(name, 0.0) for name in NAMES])
    inertia, sine, cosine = (vector[PARAMETER_INDEX[name]] for name in ("inertia", "gravity_sine", "gravity_cosine"))
    # What the transmission passes on, after friction under exactly that torque: the wearer's part does not pass it.
    drive = smooth(lift.effort)
    passed = inertia * _core.forward_dynamics(vector, q, v, drive) + sine * np.sin(q) + cosine * np.cos(q)
    missing = smooth(passed) + smooth(felt) - (inertia * a + sine * np.sin(q) + cosine * np.cos(q))
    row = distance * GRAVITY * np.sin(q) + distance**2 * a
    return float(row[used] @ missing[used] / (row[used] @ row[used]))
