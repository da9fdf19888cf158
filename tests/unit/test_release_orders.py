"""Orders in which muscles' parameters are released."""

import numpy as np
import pytest
from made_muscles import trial

from pellucid.emg.fit.muscle_calibration import MuscleProblem
from pellucid_lab.papers.hill.release_orders import (
    ALL_AT_ONCE,
    HELD_AFTER_RELEASE,
    RELEASE_METHODS,
    RELEASE_ORDERS,
    STRENGTH_ALONE,
    calibrate_in_order,
    released_in_turn,
)
from pellucid_lab.papers.hill.training import TRAINED_QUANTITIES


@pytest.fixture(scope="module")
def problem():
    from pellucid.emg.estimators.muscle_trials import find_driven_muscles, make_muscle_samples

    made = trial(true={"strength.vastus_lateralis": 1.4, "shape": -0.5})
    muscles = find_driven_muscles([made])
    samples, _ = make_muscle_samples([made], muscles=[m.name for m in muscles])
    return MuscleProblem(muscles, samples, quantities=tuple(TRAINED_QUANTITIES))


def test_each_stage_keeps_what_was_released_and_the_last_frees_all():
    assert released_in_turn(("a",), ("b", "c")) == (("a",), ("a", "b", "c"))
    for name, stages in RELEASE_ORDERS.items():
        released = {quantity for stage in stages for quantity in stage}
        assert released == ({"strength"} if name == STRENGTH_ALONE else set(TRAINED_QUANTITIES))
        if name not in (HELD_AFTER_RELEASE, STRENGTH_ALONE):
            assert set(stages[-1]) == set(TRAINED_QUANTITIES)
    assert len(RELEASE_ORDERS) >= 5


@pytest.mark.parametrize("method", RELEASE_METHODS)
def test_what_is_never_released_stays_at_anatomy(problem, method):
    z = calibrate_in_order(problem, RELEASE_ORDERS[STRENGTH_ALONE], method, iterations=60).z
    held = np.array([not name.startswith("strength") for name in problem.names[: len(problem.priors)]])
    start = np.clip(np.zeros(len(z)), problem.lower, problem.upper)
    np.testing.assert_array_equal(z[: len(held)][held], start[: len(held)][held])
    assert np.any(z[: len(held)][~held] != 0.0)


def test_orders_of_adam_share_one_number_of_iterations_and_end_near_each_other(problem):
    at_once = calibrate_in_order(problem, RELEASE_ORDERS[ALL_AT_ONCE], "adam", iterations=300)
    in_turn = calibrate_in_order(problem, RELEASE_ORDERS["quick_first"], "adam", iterations=300)
    assert in_turn.evaluations == at_once.evaluations + 4
    best = calibrate_in_order(problem, RELEASE_ORDERS[ALL_AT_ONCE], "least_squares")
    assert best.cost <= min(at_once.cost, in_turn.cost) + 1e-9
