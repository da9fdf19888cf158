"""One weight decides how quick and how precise a person is; weights and traits are found again in what was measured."""

import numpy as np
import pytest

from pellucid_lab.pointing.instructed import WIDE_PRIOR, Population, estimate_people, estimate_person, prior_from_others
from pellucid_lab.pointing.line_pointing import MEASURE_NAMES, OutcomeEmulator, Tablet, measure_movements, point_at_line
from pellucid_lab.pointing.movement_choice import preferred_duration
from pellucid_lab.pointing.one_way_movements import OneWay
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_people
from pellucid_lab.pointing.speed_accuracy import Accuracy, Aim, choose_aim, dead_zone

CHOICE = {"resting_power": 0.4, "efficiency": 0.25, "torque_rate_cost": 0.16, "discount": 1.0, "shortest": 0.1,
          "longest": 2.0}  # fmt: skip
DYNAMICS, WIDTH, ANGLE = (0.06, 0.1, 0.0), 0.05, 0.375
ACCURACY = Accuracy(noise=0.0135, resolution=1e-3, correction=0.25, visual_delay=0.14, shortfall=0.1)


def test_without_a_price_of_errors_the_duration_is_the_one_of_largest_utility():
    # A zone of everything: nothing is corrected and nothing is lost.
    free = choose_aim(ANGLE, DYNAMICS, 500.0, ACCURACY, 1e-6, CHOICE, WIDTH)
    assert free.duration == pytest.approx(preferred_duration(ANGLE, DYNAMICS, 500.0, CHOICE, WIDTH), rel=1e-3)
    assert free.dead_zone > 10.0


def test_a_higher_price_makes_slower_movements_and_smaller_dead_zones():
    made = [choose_aim(ANGLE, DYNAMICS, 500.0, ACCURACY, price, CHOICE, WIDTH) for price in (1e2, 1e4, 5e5)]
    assert made[0].dead_zone > made[1].dead_zone > made[2].dead_zone > ACCURACY.resolution
    assert made[2].duration > 1.2 * made[1].duration
    for one in made:
        assert one.spread == pytest.approx(ACCURACY.noise * ANGLE / one.duration)


def test_no_dead_zone_is_smaller_than_what_is_seen():
    assert dead_zone(0.5, ACCURACY, 1e12, 1.0) == pytest.approx(ACCURACY.resolution)
    # By hand: reward over price 1e-4, of which a correction of 0.39 s after 0.5 s costs 0.39/1.89.
    by_hand = np.sqrt(1e-6 + (1e-4 - 1e-6) * 0.39 / 1.89)
    assert dead_zone(0.5, ACCURACY, 1e4, 1.0) == pytest.approx(by_hand)


def test_an_error_is_left_where_correcting_it_costs_more():
    """At the border of the zone the utility of leaving and that of correcting are the same."""
    price, primary = 3e3, 0.4
    zone = float(dead_zone(primary, ACCURACY, price, 1.0))
    leaving = (1.0 - price * zone**2) / (1.0 + primary)
    correcting = (1.0 - price * ACCURACY.resolution**2) / (1.0 + primary + ACCURACY.correction_time)
    assert leaving == pytest.approx(correcting)


class Made:
    """Outcomes by formula: corrections add to the time, and what is left grows with the zone."""

    tablet = Tablet()

    def __call__(self, aimed, accuracy):
        missed = aimed.spread / (aimed.spread + aimed.dead_zone)
        time = aimed.duration + missed * accuracy.correction_time
        left = 0.4 * np.hypot(np.minimum(aimed.dead_zone, aimed.spread), accuracy.resolution)
        return np.log([time, left, 0.9 * aimed.duration, 0.4 * aimed.spread, time + 0.2])


@pytest.fixture
def population():
    return Population(None, None, Made(), DYNAMICS, CHOICE, 0.14, WIDTH)


def person(population, weights, traits, count=200):
    return {k: (np.exp(population.emulate_measures(w, traits)), count) for k, w in zip((1, 3, 5), weights, strict=True)}


def test_weights_and_traits_are_found_again(population):
    weights, traits = np.log([2e3, 2e4, 2e5]), np.log([700.0, 0.016, 0.24, 8e-4, 0.12])
    one = estimate_person(population, person(population, weights, traits), (1, 3, 5), WIDE_PRIOR)
    for k, weight in zip((1, 3, 5), weights, strict=True):
        assert population.emulate_measures(one.weight(k), one.traits) == pytest.approx(
            population.emulate_measures(weight, traits), abs=0.06
        )
    assert one.traits[1] == pytest.approx(traits[1], abs=0.15)
    assert np.all(np.abs(one.weights - weights) < 2.0 * np.sqrt(np.diag(one.covariance)[:3]))
    assert one.weight(2) == pytest.approx(np.mean(one.weights[:2]))
    assert one.weight(4) == pytest.approx(np.mean(one.weights[1:]))
    assert np.all(np.linalg.eigvalsh(one.covariance) > 0.0)


def test_who_was_not_seen_is_as_the_prior_says_and_few_movements_tell_little(population):
    nobody = estimate_person(population, {}, (1, 3, 5), WIDE_PRIOR)
    assert nobody.numbers == pytest.approx(WIDE_PRIOR.mean)
    told = person(population, np.log([2e3, 2e4, 2e5]), np.log([700.0, 0.03, 0.24, 8e-4, 0.12]), count=1)
    few = estimate_person(population, told, (1, 3, 5), WIDE_PRIOR)
    many = estimate_person(population, {k: (v, 400) for k, (v, _) in told.items()}, (1, 3, 5), WIDE_PRIOR)
    assert abs(few.traits[1] - WIDE_PRIOR.mean[4]) < abs(many.traits[1] - WIDE_PRIOR.mean[4])


def test_others_are_the_prior_once_there_are_three(population):
    traits = np.log([700.0, 0.016, 0.24, 8e-4, 0.12])
    seen = {f"P{i}": person(population, np.log([2e3, 2e4, 2e5]) + 0.1 * i, traits) for i in range(4)}
    del seen["P3"][1]
    estimates = estimate_people(population, seen, (1, 3, 5), WIDE_PRIOR)
    others = prior_from_others([estimates[name] for name in ("P0", "P1", "P2")], WIDE_PRIOR)
    assert np.all(others.spread < WIDE_PRIOR.spread)
    assert prior_from_others([estimates["P0"]] * 2, WIDE_PRIOR) is WIDE_PRIOR
    # What was not seen of the last one is what the others are like.
    assert estimates["P3"].weights[0] == pytest.approx(others.mean[0], abs=0.3)


def test_measured_of_few_movements_is_unknown_and_of_more_what_it_says():
    one = OneWay(1.0, 1.8, 0.151, 1.4, 0.148)
    assert np.isnan(measure_movements([one] * 2)).all()
    told = dict(zip(MEASURE_NAMES, measure_movements([one] * 3), strict=True))
    assert told["time"] == pytest.approx(0.8)
    assert told["first_time"] == pytest.approx(0.4)
    assert told["spread"] == 0.0


def test_virtual_people_with_smaller_dead_zones_are_slower_and_end_closer():
    rig = elbow_people()
    someone = draw_people(rig, np.random.default_rng(1), count=1)[0]
    made = {}
    for name, zone in (("quick", 0.05), ("precise", 0.003)):
        moved = point_at_line(rig, someone, Aim(0.35, 0.015, zone), ACCURACY, count=24)
        assert len(moved) >= 22
        made[name] = dict(zip(MEASURE_NAMES, measure_movements(moved), strict=True))
    assert made["quick"]["time"] < made["precise"]["time"] - 0.2
    assert made["quick"]["spread"] > 4.0 * made["precise"]["spread"]
    # The primary movement is the same: scatter and duration of the first stop are those aimed at.
    for one in made.values():
        assert one["first_spread"] == pytest.approx(0.015 * Tablet().lever, rel=0.35)
        assert one["first_time"] == pytest.approx(made["quick"]["first_time"], rel=0.2)


def test_outcomes_are_learnt_from_movements():
    rig = elbow_people()
    someone = draw_people(rig, np.random.default_rng(1), count=1)[0]
    outcomes = OutcomeEmulator.fit_to_simulation(rig, someone, points=32, count=8)
    quick, slow = (np.exp(outcomes(Aim(t, 0.01, 0.02), ACCURACY)) for t in (0.3, 0.9))
    assert quick[2] < 0.6 * slow[2]
    assert np.isfinite([quick, slow]).all()
