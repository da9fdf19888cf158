r"""How far from the target does a movement end?

The end is the last sample of the movement by the study's rule; the error is signed along the movement, so that
overshoot is positive. Angle and target need not have one zero: markers are glued on by hand. What a participant's
movements without the robot end apart from their targets in the mean of both directions is taken for that difference of
zeros; undershoot in either direction is left. Per participant, condition, amplitude and direction, the mean of the
signed error is the constant error, its standard deviation the variable error [1]_.

.. [1] R. A. Schmidt, T. D. Lee, "Motor control and learning", 5th ed., Human Kinetics, 2011, chapter 2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .movements import Kinematics, Movement


def target_zero(made: Sequence[tuple[Kinematics, Movement]]) -> float:
    """Return the angle at which a target at 0 lies [rad], from the ends of one participant's control movements.

    It is the mean of the medians of both directions; 0 if a direction has no movement to a target.
    """
    ends: dict[int, list[float]] = {1: [], -1: []}
    for motion, movement in made:
        if movement.goal is not None:
            ends[movement.direction].append(float(motion.angle[movement.last]) - movement.goal)
    if not all(ends.values()):
        return 0.0
    return float(np.mean([np.median(own) for own in ends.values()]))


def end_error(motion: Kinematics, movement: Movement, zero: float) -> dict[str, float]:
    """Return the signed and the absolute error of a `movement`'s end, ``end_error`` and ``end_absolute`` [rad].

    `motion` holds the angle, and a target at 0 lies at `zero`. The result is empty if the target is not known.
    """
    if movement.goal is not None:
        error = movement.direction * (float(motion.angle[movement.last]) - movement.goal - zero)
    elif movement.amplitude is not None:
        error = movement.reach - movement.amplitude
    else:
        return {}
    return {"end_error": error, "end_absolute": abs(error)}
