"""Where a movement ends, and where it was to: signs, zeros, labels without a target."""

import numpy as np
import pytest
from made_pointing import minimum_jerk

from pellucid.people.indices import end_error, target_zero
from pellucid.people.movements import MovementRule, Stretch, kinematics, movements

RULE = MovementRule(lowpass=20.0)


def moved(*, short: float = 0.05, zero: float = 0.0, goals: bool = True):
    """Up by 0.6 and down again [rad], either short of the target."""
    time = np.arange(0.0, 8.0, 0.005)
    angle = (
        zero + (0.6 - short) * minimum_jerk((time - 1.0) / 0.8) - (0.6 - 2.0 * short) * minimum_jerk((time - 4.5) / 0.8)
    )
    motion = kinematics(time, angle, RULE)
    stretches = [Stretch(0.5, 4.0, 0.6, 0.6 if goals else None), Stretch(4.0, 8.0, -0.6, 0.0 if goals else None)]
    found, none = movements(motion, stretches, RULE)
    assert none == []
    return motion, found


def test_falling_short_is_negative_in_both_directions():
    motion, found = moved()
    for movement in found:
        error = end_error(motion, movement, 0.0)
        # The rule ends a movement at 5 % of its peak, where a little is still to go.
        assert error["end_error"] == pytest.approx(-0.05, abs=0.01)
        assert error["end_absolute"] == abs(error["end_error"])


def test_the_zero_is_what_both_directions_share():
    (motion, found), (raised, same) = moved(), moved(zero=0.2)
    zeros = [target_zero([(m, x) for x in each]) for m, each in ((motion, found), (raised, same))]
    assert zeros[1] - zeros[0] == pytest.approx(0.2, abs=1e-6)
    ours = [end_error(motion, x, zeros[0])["end_error"] for x in found]
    assert ours == pytest.approx([end_error(raised, x, zeros[1])["end_error"] for x in same], abs=1e-6)
    assert target_zero([(motion, found[0])]) == 0.0


def test_without_a_target_the_label_says_how_far():
    motion, found = moved(goals=False)
    assert end_error(motion, found[0], 0.3)["end_error"] == pytest.approx(-0.05, abs=1e-3)
    unlabelled, _ = movements(motion, [Stretch(0.5, 4.0)], RULE)
    assert end_error(motion, unlabelled[0], 0.0) == {}
