"""Which estimator is the headline: the plainest that errs hardly more than the best at what it is for."""

import numpy as np
import pytest

from pellucid.joint.fit.estimators import choose_method


@pytest.fixture
def misses(rng):
    """Residuals of one recording, (400,), with an error of 1 beside what a method adds."""
    shared = rng.standard_normal(400)

    def of(**added):
        return {name: [shared + more * rng.standard_normal(400)] for name, more in added.items()}

    return of


def test_the_plainest_of_equals_is_taken(misses):
    assert choose_method(misses(ls=0.01, irls=0.0, output_error=0.0), {}) == "ls"


def test_what_is_worse_at_its_purpose_is_not(misses):
    assert choose_method(misses(ls=1.0, wls=0.9, irls=0.0, output_error=0.02), {}) == "irls"


def test_the_other_purpose_decides_where_it_tells_them_far_apart(misses):
    alike = misses(ls=0.01, wls=0.01, output_error=0.0)
    assert choose_method(alike, misses(ls=3.0, wls=3.0, output_error=0.0)) == "output_error"
    assert choose_method(alike, misses(ls=0.6, wls=0.6, output_error=0.0)) == "ls"


def test_the_other_purpose_cannot_bring_back_what_is_worse_at_the_first(misses):
    assert choose_method(misses(ls=0.0, output_error=2.0), misses(ls=3.0, output_error=0.0)) == "ls"


def test_a_method_that_cannot_be_simulated_is_judged_by_torque(misses):
    assert choose_method(misses(ls=0.0, wls=0.01), misses(wls=0.0)) == "ls"


def of_one_sample(error, count=400):
    """Residuals of one recording, (count,), whose RMS is `error` by a single sample: no test finds it significant."""
    return [np.where(np.arange(count) == 200, error * np.sqrt(count), 0.0)]


@pytest.mark.parametrize("larger", [1.1, 1.5, 3.3])
def test_a_larger_error_needs_no_test_to_be_passed_over(larger):
    first = {"ls": of_one_sample(larger), "wls": of_one_sample(2.0 * larger), "output_error": of_one_sample(1.0)}
    assert choose_method(first, {}) == "output_error"


def test_what_errs_hardly_more_stays_the_plainest():
    assert choose_method({"ls": of_one_sample(1.04), "output_error": of_one_sample(1.0)}, {}) == "ls"
