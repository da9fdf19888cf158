"""Power by simulation against closed forms, the same on however many workers, and what it refuses."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import stats

from pellucid._errors import PellucidError
from pellucid.people.design_columns import cluster
from pellucid.people.power import participants_for_effects, participants_needed, power_curve


def pilot(n=200, spread=0.1, seed=3):
    """Participants who differ a lot from each other, and little between conditions; no condition does anything."""
    rng = np.random.default_rng(seed)
    return rng.normal(1.0, 0.5, (n, 1)) + rng.normal(0.0, spread / np.sqrt(2.0), (n, 3))


@pytest.mark.parametrize("test", ["friedman", "signed_rank", "nemenyi"])
def test_without_an_effect_the_power_is_the_level(test):
    found = power_curve(pilot(), (12,), test=test, compared=1, change=0.0, studies=4000)
    # Friedman's null needs all conditions the same; Nemenyi's holds the level over all pairs together.
    assert found.power[0] < 0.06 + 2.0 * found.standard_error[0]
    if test == "signed_rank":
        assert found.power[0] == pytest.approx(0.042, abs=0.012)  # the counted level nearest below 5 %


def test_signed_ranks_are_about_as_powerful_as_student():
    """On normal differences the signed ranks' efficiency is 3/pi of Student's t, whose power is known."""
    values = pilot()
    d = values[:, 1] - values[:, 0]
    n, change = 20, 0.08
    found = power_curve(values, (n,), test="signed_rank", compared=1, change=change, studies=4000)
    ncp = change / d.std(ddof=1) * np.sqrt(3.0 / np.pi * n)
    edge = stats.t.ppf(0.975, n - 1)
    expected = stats.nct.sf(edge, n - 1, ncp) + stats.nct.cdf(-edge, n - 1, ncp)
    assert found.power[0] == pytest.approx(expected, abs=0.04)


def test_few_participants_cannot_pass_a_corrected_level():
    found = power_curve(pilot(), (6, 7, 8), test="signed_rank", compared=1, change=10.0, comparisons=3)
    assert found.power == (0.0, 1.0, 1.0)
    assert found.needed() == 7


def test_the_people_for_a_change_are_those_whom_the_study_s_own_tests_need():
    """Nemenyi's test alone is significant with four people, of whom Friedman's counted p is never below 0.05."""
    clear = np.column_stack([np.ones(8), np.full(8, 2.0)]) + 0.01 * np.random.default_rng(1).normal(size=(8, 2))
    assert participants_needed(clear, test="nemenyi", compared=1, studies=200) == 6


def test_workers_do_not_change_the_outcome():
    with ThreadPoolExecutor(3) as executor:
        shared = power_curve(pilot(12), (6, 10), change=0.1, studies=1200, executor=executor)
    assert shared == power_curve(pilot(12), (6, 10), change=0.1, studies=1200)


def test_an_executor_needs_submit_and_result_alone():
    """As a Dask client has them."""

    class Client:
        def submit(self, function, *arguments):
            outcome = function(*arguments)
            return type("Future", (), {"result": lambda self: outcome})()

    assert power_curve(pilot(12), (6,), change=0.1, executor=Client()) == power_curve(pilot(12), (6,), change=0.1)


def test_more_participants_find_smaller_changes():
    values = pilot()
    need = [
        participants_needed(values, test="signed_rank", compared=1, change=c, studies=500)
        for c in (0.2, 0.1, 0.05, 1e-4)
    ]
    assert need[0] < need[1] < need[2]
    assert need[3] is None


@pytest.mark.nightly
@pytest.mark.slow
def test_large_runs_use_every_core():
    small = power_curve(pilot(8), (90,), change=0.05, studies=1000)
    large = power_curve(pilot(8), (90, 6000), change=0.05, studies=1000)
    assert large.power[0] == small.power[0]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: power_curve(np.ones((2, 2)), (5,)), "3 participants x 2 conditions"),
        (lambda: power_curve(pilot(5), (5,), test="nemenyi"), "compared = None"),
        (lambda: power_curve(pilot(5), (1,)), "at least 2"),
    ],
)
def test_misuse_is_refused(call, said):
    with pytest.raises(PellucidError, match=said):
        call()


def test_effects_are_found_by_as_many_whoever_simulates_them():
    effects = (0.4, 1.0, 2.0)
    found = participants_for_effects(effects, comparisons=3, studies=300)
    assert found[0] > found[1] > found[2] == 7
    with ThreadPoolExecutor(2) as executor:
        assert participants_for_effects(effects, comparisons=3, studies=300, executor=executor) == found
    # The same as for a pilot in whom the change is as many standard deviations.
    values = pilot()
    change = (values[:, 1] - values[:, 0]).std(ddof=1)
    assert participants_needed(
        values, test="signed_rank", compared=1, change=change, comparisons=3, studies=300
    ) == pytest.approx(found[1], abs=1)


def test_a_dask_cluster_gives_what_one_machine_gives():
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, silence_logs=50
        ) as made,
        cluster(made.scheduler_address) as executor,
    ):
        found = participants_for_effects((1.0, 2.0), studies=300, executor=executor)
    assert found == participants_for_effects((1.0, 2.0), studies=300)


def test_a_scheduler_that_nobody_answers_for_is_refused(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("pellucid.people.design_columns.SCHEDULER_TIMEOUT_S", 0.5)
    with (
        pytest.raises(PellucidError, match=r"found no answer at tcp://127\.0\.0\.1:9"),
        cluster("tcp://127.0.0.1:9"),
    ):
        pass


def test_without_dask_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(PellucidError, match="pip install"), cluster("tcp://127.0.0.1:9"):
        pass
