"""The residual compensator on the virtual orthosis, from identified cards: less torque, no sway, a safe way back."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError, PellucidError
from pellucid.emg.estimators.causal_map import EmgSettings, EmgTrial, fit_causal_map
from pellucid_lab.knee.chosen_constants import (
    REQUIRED_DELAY_MARGIN_S,
    REQUIRED_GAIN_MARGIN_DB,
    ChosenConstants,
    chosen,
    design_reproduced_law,
    parse_chosen,
)
from pellucid_lab.knee.drawn import BODY_RANGES, FACTOR_RANGES, FITTED_RANGES, drawn_rig
from pellucid_lab.knee.loop_margins import design_margins
from pellucid_lab.knee.protocol import Faults
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.knee.subject import FLEXOR_MUSCLE
from pellucid_lab.knee.worn_compensator import WornCompensator
from pellucid_lab.papers.knee import tuning as knee_tuning
from pellucid_lab.papers.knee.controllers import design_by_phase
from pellucid_lab.papers.knee.residual import (
    TEST_WEARER_SEEDS,
    TUNING_WEARER_SEEDS,
    ControllerRow,
    compare,
    identify_by_name,
    session_of,
)
from pellucid_lab.papers.knee.residual_rows import residual_rows, residual_section
from pellucid_lab.papers.knee.swings import last_speed, release_leg, rms_mismatch_and_torque, swing, without_power

SEED = 41
"""Of swings on which nothing was chosen."""

whole = pytest.mark.nightly
"""What needs a wearer who was identified from the whole session: half a minute of processor time."""


@pytest.fixture(scope="module")
def rig():
    return knee_orthosis()


@pytest.fixture(scope="module")
def worn(rig):
    """A drawn wearer, identified from their own recordings; nothing was chosen on them."""
    return identify_by_name(rig, "D401")


@pytest.fixture(scope="module")
def rows(worn):
    only = ("zero_impedance", "no_control", "disturbance_observer")
    beside = compare(worn, (SEED,), only=only, duration=14.0, stability=False)
    return {r.controller: r for r in (*beside, *compare(worn, (SEED,), only=("residual",), duration=14.0))}


def test_nobody_compared_was_tuned_on():
    assert not set(TEST_WEARER_SEEDS) & set(TUNING_WEARER_SEEDS)


def test_wearers_are_drawn_within_what_is_stated_and_each_is_the_same_again(rig):
    made = [drawn_rig(rig, seed) for seed in range(500, 540)]
    people = [next(iter(r.subjects.values())) for r in made]
    for person, own in zip(people, made, strict=True):
        index, ratio = person.weight / person.height**2, person.strap["damping"] / person.strap["stiffness"]
        for value, (low, high) in (
            (index, BODY_RANGES["mass_index"]),
            (person.strap["stiffness"], FITTED_RANGES["stiffness"]),
            (ratio, FITTED_RANGES["damping"]),
            (person.strength[FLEXOR_MUSCLE] / person.weight, FITTED_RANGES["flexor"]),
            (own["actuator"]["coulomb_positive"] / rig["actuator"]["coulomb_positive"],
             FACTOR_RANGES["actuator.coulomb_positive"]),
        ):  # fmt: skip
            assert low <= value <= high
    assert len({p.strap["stiffness"] for p in people}) == len(people)
    assert drawn_rig(rig, 500).tables == made[0].tables
    assert drawn_rig(rig, 501).tables != made[0].tables


@whole
def test_cards_come_from_recordings_and_lie_near_the_truth(rig, worn):
    found, own = worn.coupling, worn.rig
    person = own.subjects[worn.name]
    loop, motor = own["torque_loop"], own["actuator"]
    share = 1 + loop["kp"]
    # A strap that hardens and relaxes has no one stiffness: what a swing meets lies above its tangent at no stretch.
    assert 0.7 * person.strap["stiffness"] < found.strap_stiffness < 2.0 * person.strap["stiffness"]
    assert found.strap_damping == pytest.approx(person.strap["damping"], rel=0.15)
    assert found.limb_gravity == pytest.approx(person.gravity, rel=0.02)
    assert found.limb_inertia == pytest.approx(person.inertia, rel=0.25)  # by tables of shares, which people are not
    assert found.orthosis_inertia == pytest.approx(own["orthosis"]["inertia"], rel=0.05)
    assert found.actuator_inertia == pytest.approx(motor["inertia"] / share, rel=0.05)
    assert found.actuator_leak == pytest.approx(loop["ki"] / share, rel=0.15)
    # The gear's losses under load count as Coulomb friction.
    assert motor["coulomb_positive"] / share < found.actuator_coulomb < 1.6 * motor["coulomb_positive"] / share
    assert worn.card(EmgSettings(corner=3.0)).emg.rmse < 3.0


@whole
def test_the_strap_carries_less_than_half_within_the_margins(rows):
    assert rows["zero_impedance"].ratio == 1
    assert rows["no_control"].ratio > 1
    compensated = rows["residual"]
    assert compensated.ratio < 0.5
    assert compensated.mismatch < 0.5 * rows["zero_impedance"].mismatch
    assert compensated.gain_db >= REQUIRED_GAIN_MARGIN_DB
    assert compensated.delay >= REQUIRED_DELAY_MARGIN_S
    assert compensated.holds
    assert compensated.fault == "none"
    assert compensated.ratio < rows["disturbance_observer"].ratio


@whole
def test_the_margins_hold_on_the_true_plant_as_well(rig, worn):
    """What the identified card promises the truth keeps: its limb rubs, and its strap is within 30 % of the card's."""
    made = design_reproduced_law(worn.coupling, rig.period, chosen())
    person = worn.rig.subjects[worn.name]
    truth = worn.coupling.scaled(
        strap_stiffness=person.strap["stiffness"] / worn.coupling.strap_stiffness,
        strap_damping=person.strap["damping"] / worn.coupling.strap_damping,
        limb_inertia=person.inertia / worn.coupling.limb_inertia,
        limb_gravity=person.gravity / worn.coupling.limb_gravity,
    )
    for speed in (0.5, 1.5, 4.0):
        left = design_margins(made, truth, speed)
        assert left.gain_db >= REQUIRED_GAIN_MARGIN_DB - 0.5
        assert left.delay >= REQUIRED_DELAY_MARGIN_S


@whole
def test_a_relaxed_wearer_is_not_swayed(rig, worn):
    """No limit cycle: a leg let go from half a radian comes to rest, and stays there."""
    controller = WornCompensator(
        design_reproduced_law(worn.coupling, rig.period, chosen()), worn.card(chosen().emg).emg.build()
    )
    taken = release_leg(worn.rig, worn.name, controller)
    assert controller.fault == "none"
    assert last_speed(taken) < 0.1
    assert np.abs(taken.truth.limb_position[-1500:]).max() < 0.25


@whole
def test_detached_electrodes_leave_what_needs_none(rig, worn, rows):
    controller = WornCompensator(
        design_reproduced_law(worn.coupling, rig.period, chosen()), worn.card(chosen().emg).emg.build()
    )
    session, faults = session_of(worn), Faults(emg_detached={0: 6.0, 1: 6.0})
    taken = swing(worn.rig, worn.name, SEED, controller, duration=14.0, session=session, faults=faults)
    assert controller.fault == "none"
    assert controller.core.estimates["trust"] == 0.0  # found by its hum, and faded out
    assert np.abs(taken.command).max() < 10
    assert rms_mismatch_and_torque(taken)[1] < rows["zero_impedance"].strap_torque


@whole
def test_without_control_the_motor_gives_no_torque(worn):
    taken = swing(without_power(worn.rig), worn.name, SEED, None, duration=4.0)
    assert np.abs(taken.truth.motor_torque).max() < 1e-12


@whole
def test_gains_by_phase_never_cost_the_margins(rig, worn):
    made = design_reproduced_law(worn.coupling, rig.period, chosen())
    phased = design_by_phase(made, (2.0, 1.0, 0.9, 1.1, 1.2, 0.8, 1.0, 1.0), (0.58, 4.7))
    assert phased.law.phase_gain[5] == 0.8
    assert max(phased.law.phase_gain) <= 1.25
    assert design_by_phase(made, (1.0,) * 8, (0.58, 4.7)).law == made.law


def test_constants_come_back_from_their_file():
    constants = chosen()
    assert parse_chosen(knee_tuning.write_toml(constants, TUNING_WEARER_SEEDS)) == constants
    assert knee_tuning.change_constant(constants, "law.friction", 0.123).law.friction == 0.123
    assert knee_tuning.change_constant(constants, "fuzzy.largest", 0.5).fuzzy["largest"] == 0.5


def test_a_search_takes_the_least_that_keeps_its_margins(monkeypatch):
    monkeypatch.setattr(knee_tuning, "SEARCHED_VALUES", {"fuzzy": {"fuzzy.largest": (1.0, 2.0, 3.0)}})
    monkeypatch.setattr(knee_tuning, "strap_torque_share", lambda kind, c, seed: 1.0 / c.fuzzy["largest"])
    monkeypatch.setattr(knee_tuning, "keeps_margins", lambda kind, c, seed: c.fuzzy["largest"] < 2.5)
    found, reached = knee_tuning.search(
        "fuzzy", ChosenConstants(fuzzy={"largest": 1.5}), (1, 2), map, lambda line: None
    )
    assert found.fuzzy["largest"] == 2.0
    assert reached == pytest.approx(0.5)


def test_repetitions_that_were_not_held_are_left_out_of_the_map():
    rng, time, emg_time = np.random.default_rng(2), np.arange(5000) / 500, np.arange(20480) / 2048

    def step(repetition, angle):
        level = 1.0 + np.sin(0.7 * emg_time)[:, None] * [1.0, -1.0]
        emg = 1e-5 * level * rng.standard_normal((20480, 2))
        torque = 5.0 * np.interp(time, emg_time, level[:, 1] - level[:, 0])
        return EmgTrial(repetition, time, np.full(5000, 0.5) + angle, torque, emg_time, emg)

    held = [step(r, 0.0) for r in "123"]
    lost = step("3", 6.0 * np.clip(time - 5.0, 0.0, 1.0))
    made = fit_causal_map(held)
    assert made.rmse < 3.0
    again = fit_causal_map([*held, lost])
    np.testing.assert_array_equal(again.weights, made.weights)
    with pytest.raises(IdentificationError, match="fewer than two repetitions"):
        fit_causal_map(held[:1])


def test_rows_and_section_tell_drawn_wearers_from_the_rigs_own():
    compared = [
        ControllerRow(kind, who, seed, 0.05, 0.8, ratio + 0.1 * (who == "S1"), gain, delay, holds)
        for who in ("S1", "D1", "D2")
        for seed in (1, 2)
        for kind, ratio, gain, delay, holds in (
            ("zero_impedance", 1.0, None, None, None),
            ("residual", 0.2, 6.5 + seed, float("inf"), True),
        )
    ]
    rows = {r.id: r for r in residual_rows(compared)}
    assert rows["knee.residual.torque_ratio.residual"].ours == pytest.approx(0.2)
    assert rows["knee.residual.torque_ratio.residual.rig"].ours == pytest.approx(0.3)
    assert rows["knee.residual.gain_margin.residual"].ours == pytest.approx(7.5)
    assert rows["knee.residual.delay_margin.residual"].ours == pytest.approx(0.1)
    assert "where the search ends" in rows["knee.residual.delay_margin.residual"].note
    assert rows["knee.residual.holds.residual"].ours == 1.0
    section = residual_section(compared)
    assert section.drawings[0].svg.startswith("<?xml")


def test_a_wearer_who_is_nobody(rig):
    with pytest.raises(PellucidError, match="D<seed>"):
        identify_by_name(rig, "X1")
