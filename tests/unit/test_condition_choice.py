"""Which estimator is named for movements unlike those fitted."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import trial

from pellucid._errors import IdentificationError
from pellucid.emg.estimators.condition_choice import (
    MAX_TEST_COUNT,
    ConditionTestErrors,
    choose_estimator,
    is_candidate,
    make_condition_tests,
    run_condition_tests,
)
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES
from pellucid.emg.estimators.torque_map import fit_torque_map


def told(*rmse):
    return ConditionTestErrors(tuple("abcdefg"[: len(rmse)]), rmse, 1.0)


def test_the_least_mean_square_is_named_unless_the_tests_cannot_tell():
    assert choose_estimator({"hill": told(5.0, 5.1, 5.0), "boost": told(3.0, 3.1, 3.0)}) == "boost"
    # Ahead in one test and behind in another: the form that goes furthest beyond what was fitted.
    assert (
        choose_estimator({"hill": told(3.0, 4.0, 3.1), "ridge": told(2.9, 3.0, 3.2), "boost": told(3.5, 2.4, 2.5)})
        == "hill"
    )
    assert choose_estimator({"ridge": told(3.0, 3.2, 3.1), "boost": told(3.3, 2.5, 3.2)}) == "ridge"
    # A test that one of them could not be given counts for nobody.
    assert choose_estimator({"hill": told(5.0, np.nan, 5.1), "ridge": told(3.0, 99.0, 3.0)}) == "ridge"
    with pytest.raises(IdentificationError, match="found no test that hill, ridge could all be given"):
        choose_estimator({"hill": told(np.nan), "ridge": told(3.0)})


def test_what_is_told_the_torque_or_sees_no_emg_or_chose_nothing_is_not_named():
    names = ("hill", "nmcoa", "ridge", "motion", "linear", "boost", "boost_published")
    assert [name for name in names if is_candidate(name)] == ["hill", "ridge", "boost"]


def test_a_reconstruction_of_a_paper_is_compared_with_and_never_named():
    rebuilt = [name for name, family in ESTIMATOR_FAMILIES.items() if "reconstruction" in family.description]
    assert rebuilt == ["nmco", "nmcoa", "nmnc", "mbp"]
    published = [name for name in ESTIMATOR_FAMILIES if name.endswith("_published")]
    assert [name for name in (*rebuilt, *published) if is_candidate(name)] == []


def test_several_recordings_are_left_out_whole_and_many_together_by_speed():
    trials = [trial(name, seconds=2.0, seed=i) for i, name in enumerate("abcdefg")]
    few = make_condition_tests(trials[:3])
    assert [t.words for t in few] == ["without a", "without b", "without c"]
    assert [len(t.judged) for t in few] == [170, 170, 170]  # 0.3 s of each are nobody's
    assert not set(few[0].fitted) & set(few[0].judged)
    many = make_condition_tests(trials)
    assert len(many) == MAX_TEST_COUNT
    assert sorted(i for t in many for i in t.judged) == sorted({i for t in many for i in t.judged})


def test_within_one_recording_fast_strides_and_the_most_of_effort_and_speed_judge():
    one = trial(seconds=8.0)
    speed = np.repeat([1.0, 2.0], 400)
    phase = np.cumsum(2.0 * np.pi * speed / 100.0)
    one = replace(one, angles={"hip": one.angles["hip"], "knee": -0.7 + 0.4 * np.sin(phase)})
    fast, slow, effort, moving = make_condition_tests([one])
    assert np.mean(fast.judged >= 400) > 0.85
    assert set(fast.judged) == set(slow.fitted)
    total = np.sum(list(one.envelopes.values()), axis=0)
    assert total[effort.judged].mean() > 2.0 * total[effort.fitted].mean()
    assert len(moving.judged) == pytest.approx(0.2 * 770, abs=20)


def test_muscles_and_maps_are_fitted_again_and_judged_on_the_same_samples():
    one = trial(seconds=4.0)
    fitted = {name: fit_torque_map([one], name) for name in ("ridge", "hill")}
    found = {name: run_condition_tests(fit, [one]) for name, fit in fitted.items()}
    assert found["hill"].words == found["ridge"].words
    # The muscles made the torque: they carry over, and a quadratic form does less.
    assert found["hill"].mean < 1.0 < found["ridge"].mean
    assert 0.5 < found["hill"].half_width < 2.0
    assert run_condition_tests(fitted["ridge"], [one]) == found["ridge"]
