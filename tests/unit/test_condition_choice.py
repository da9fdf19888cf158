"""Which estimator is named for movements unlike those fitted."""


import numpy as np
import pytest
from made_muscles import trial

from pellucid._errors import IdentificationError
from pellucid.emg.estimators.condition_choice import (
    MAX_TEST_COUNT,
    ConditionTestErrors,
    combine_tests,
    find_extrapolator,
    is_candidate,
    make_choice_tests,
    make_condition_tests,
    recommend,
    run_condition_tests,
)
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES, STACKED
from pellucid.emg.estimators.torque_map import fit_torque_map


def told(*errors, weights=()):
    """Test errors of an estimator; one array a test."""
    rmse = tuple(float(np.sqrt(np.mean(np.square(e)))) for e in errors)
    return ConditionTestErrors(tuple("abcdefg"[: len(rmse)]), rmse, 1.0, errors=tuple(map(np.asarray, errors)),
                               weights=weights, band_errors=tuple(map(np.asarray, errors)))  # fmt: skip


def drawn(seed, scale, tests=3):
    rng = np.random.default_rng(seed)
    return [scale * rng.standard_normal(2000) for _ in range(tests)]


def test_candidates_that_err_alike_and_apart_are_averaged():
    chosen = recommend({"hill": told(*drawn(1, 1.0)), "ridge": told(*drawn(2, 1.0))})
    assert chosen.name == STACKED
    assert chosen.weights == pytest.approx({"hill": 0.5, "ridge": 0.5}, abs=0.05)
    assert len(chosen.jackknife) == 3
    # Half of two independent errors of the same size leaves 1/sqrt(2) of it.
    both = combine_tests({"hill": told(*drawn(1, 1.0)), "ridge": told(*drawn(2, 1.0))}, chosen)
    assert both.mean == pytest.approx(np.sqrt(0.5), abs=0.05)
    assert chosen.predict({"hill": np.ones(2), "ridge": -np.ones(2)}) == pytest.approx(np.zeros(2), abs=0.1)


def test_a_candidate_that_wins_clearly_is_named_alone():
    assert recommend({"boost": told(*drawn(1, 1.0)), "ridge": told(*drawn(2, 4.0))}).weights == {"boost": 1.0}


def test_a_candidate_whose_errors_another_has_too_gets_the_less_weight_the_more_tests_there_are():
    shares = []
    for tests in (2, 7):
        shared = drawn(1, 1.0, tests)
        worse = [e + 0.5 * f for e, f in zip(shared, drawn(2, 1.0, tests), strict=True)]
        shares.append(recommend({"tree": told(*worse), "boost": told(*shared)}).weights["tree"])
    assert 0.5 > shares[0] > 1.4 * shares[1] > 0.0


def test_a_test_that_one_of_them_could_not_be_given_counts_for_nobody():
    first, second, third = drawn(1, 1.0)
    lost = [first, np.full(9, np.nan), third]
    assert recommend({"hill": told(*lost), "ridge": told(3.0 * first, 9.0 * second, 3.0 * third)}).name == "hill"
    with pytest.raises(IdentificationError, match="found no test recording that hill, ridge all predict"):
        recommend({"hill": told(np.full(9, np.nan)), "ridge": told(first)})


def test_trials_are_weighed_when_candidates_are():
    """Boosting errs less in newton metres, ridge regression less in what each trial can tell."""
    slow, fast = np.random.default_rng(1).standard_normal((2, 2000))
    weights = (np.full(2000, 10.0), np.full(2000, 0.1))
    found = {"ridge": (0.2 * slow, 3.0 * fast), "boost": (2.0 * slow, 1.0 * fast)}
    assert recommend({n: told(*e) for n, e in found.items()}).weights["boost"] > 0.5
    assert recommend({n: told(*e, weights=weights) for n, e in found.items()}).weights["ridge"] > 0.5


def test_muscles_go_beyond_what_was_fitted():
    found = {"boost": told(*drawn(1, 1.0)), "hill": told(*drawn(2, 3.0)), "ridge": told(*drawn(3, 2.0))}
    assert find_extrapolator(found) == "hill"
    assert find_extrapolator({"boost": found["boost"], "ridge": found["ridge"]}) is None


def test_what_is_told_the_torque_or_is_published_is_not_named():
    names = ("hill", "nmcoa", "ridge", "motion", "motion_boost", "linear", "boost", "boost_published")
    assert [n for n in names if is_candidate(n)] == ["hill", "ridge", "motion", "motion_boost", "linear", "boost"]


def test_blocks_of_a_single_recording_are_left_out_with_gaps():
    tests = make_choice_tests([trial(seconds=8.0)])
    assert [t.words for t in tests] == [f"block {i}" for i in range(1, 6)]
    for test in tests:
        assert np.abs(test.fitted[:, None] - test.judged[None, :]).min() >= 20  # samples at 100 Hz
    several = [trial(name, seconds=2.0, seed=i) for i, name in enumerate("abc")]
    assert [t.words for t in make_choice_tests(several)] == ["without a", "without b", "without c"]


def test_of_two_recordings_blocks_count_as_much_as_each_left_out():
    two = [trial(name, seconds=3.0, seed=i) for i, name in enumerate("ab")]
    tests = make_choice_tests(two)
    assert [t.words for t in tests] == ["without a", "without b", *(f"block {i}" for i in range(1, 6))]
    assert [t.share for t in tests] == pytest.approx([0.5] * 2 + [0.2] * 5)
    for test in tests[2:]:
        assert {int(i) // len(two[0]) for i in test.judged} == {0, 1}
        assert not set(test.fitted) & set(test.judged)
    # The band follows from recordings left out alone.
    found = run_condition_tests(fit_torque_map(two, "ridge"), two)
    assert (len(found.errors), len(found.band_errors), found.conditions) == (7, 2, 2)


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


def test_a_single_recording_gives_its_band_by_long_parts_with_gaps():
    one = trial(seconds=9.0)
    tests = make_condition_tests([one])
    assert [test.words for test in tests] == ["without part 1", "without part 2", "without part 3"]
    for test in tests:
        assert np.abs(test.fitted[:, None] - test.judged[None, :]).min() >= 20  # samples at 100 Hz
    assert len(tests[0].judged) == pytest.approx(270, abs=5)  # 0.3 s at the beginning are nobody's
    found = run_condition_tests(fit_torque_map([one], "ridge"), [one])
    assert (len(found.errors), len(found.band_errors), found.conditions) == (5, 3, 1)
    assert found.left_out_coverage is None


def test_muscles_and_maps_are_fitted_again_and_judged_on_the_same_samples():
    one = trial(seconds=4.0)
    fitted = {name: fit_torque_map([one], name) for name in ("ridge", "hill")}
    found = {name: run_condition_tests(fit, [one]) for name, fit in fitted.items()}
    assert found["hill"].words == found["ridge"].words
    # The muscles made the torque: they carry over, and a quadratic form does less.
    assert found["hill"].mean < 1.0 < found["ridge"].mean
    assert 0.5 < found["hill"].half_width < 2.0
    assert run_condition_tests(fitted["ridge"], [one]) == found["ridge"]
