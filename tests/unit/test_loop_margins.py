"""Margins against closed forms from textbooks, and the eigenvalues against the frequency response."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.controllers.coupling import Coupling, friction_slope
from pellucid.controllers.residual_compensator import Law, design, within
from pellucid.controllers.stability import (
    RATE_RATIOS,
    LinearSystem,
    bears,
    closed_loop,
    loop_response,
    radius,
    rate_limit_table,
    sampled,
    swings,
    worn_orthosis,
)
from pellucid.models.card import CardParameter
from pellucid.models.parameter_card import ParameterCard
from pellucid_lab.knee.loop_margins import bears_all, crossings, design_margins, margins, worst_margins
from pellucid_lab.papers.knee.pid_tuning import strap_torque_gain, tune_pid

PERIOD = 0.002
KNEE = Coupling(
    orthosis_inertia=0.048, orthosis_viscous=0.008, orthosis_gravity=1.56, coulomb=0.015, limb_inertia=0.33,
    limb_viscous=0.15, limb_gravity=8.0, strap_stiffness=14.0, strap_damping=0.42, actuator_frequency=55.0,
    actuator_damping=0.2, delay=0.002, actuator_inertia=0.055, actuator_viscous=0.1, actuator_coulomb=2.6,
    actuator_leak=1.7,
)  # fmt: skip


def test_three_poles_have_their_textbook_gain_margin():
    # L = k / (s (s+1) (s+2)) meets the negative axis at sqrt(2) rad/s with |L| = k/6.
    omega = np.geomspace(0.01, 100, 20_001)
    s = 1j * omega
    gain, _ = crossings(omega, 1.5 / (s * (s + 1) * (s + 2)))
    assert gain == pytest.approx(4.0, rel=1e-4)


def test_an_integrator_has_its_textbook_delay_margin():
    # L = k / s: |L| = 1 at k, a quarter turn left there: pi / (2 k).
    omega = np.geomspace(0.01, 100, 20_001)
    _, delay = crossings(omega, 3.0 / (1j * omega))
    assert delay == pytest.approx(np.pi / 6, rel=1e-5)


def test_a_sampled_integrator_under_proportional_gain():
    # q' = u held over T and fed back with gain k: 1 - k T in the circle, so k < 2/T; with one period's delay k < 1/T.
    plant = LinearSystem(np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    none = LinearSystem(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[-1.0]]))
    for delay, most in ((0.0, 2 / PERIOD), (PERIOD, 1 / PERIOD)):
        held = sampled(plant, PERIOD, delay)
        assert radius(closed_loop(held, none, 0.999 * most)) < 1 < radius(closed_loop(held, none, 1.001 * most))


def test_dead_time_of_a_fraction_of_a_period_is_exact():
    # A first-order lag's step response behind a delay, at the samples.
    lag = LinearSystem(np.array([[-5.0]]), np.array([[5.0]]), np.ones((1, 1)), np.zeros((1, 1)))
    held = sampled(lag, 0.1, 0.13)
    x, got = np.zeros(len(held.a)), []
    for _ in range(10):
        got.append((held.c @ x).item())
        x = held.a @ x + held.b[:, 0]
    t = 0.1 * np.arange(10)
    np.testing.assert_allclose(got, np.where(t > 0.13, 1 - np.exp(-5 * (t - 0.13)), 0.0), atol=1e-12)


def test_eigenvalues_and_frequency_response_agree():
    made = design(KNEE, PERIOD, law=Law(0.8, 0.8, 0.5, 0.7, proportional=3.0, torque_gain=0.0))
    controller = made.linear(1.5)
    own = margins(KNEE, controller, PERIOD, speed=1.5)
    plant = worn_orthosis(KNEE, 1.5)
    plant = sampled(LinearSystem(plant.a, plant.b[:, :1], plant.c[:2], plant.d[:2, :1]), PERIOD, KNEE.delay)
    omega = np.geomspace(0.05, 0.999 * np.pi / PERIOD, 40_000)
    gain, delay = crossings(omega, loop_response(plant, controller, omega, PERIOD))
    assert own.stable
    assert own.gain_db == pytest.approx(20 * np.log10(gain), abs=0.05)
    if np.isfinite(own.delay):
        assert own.delay == pytest.approx(delay, rel=0.02)
    else:
        assert delay > 0.1


def test_a_margin_is_where_the_loop_begins_to_ring():
    made = design(KNEE, PERIOD)
    left = design_margins(made, speed=1.5)
    plant = sampled(worn_orthosis(KNEE, 1.5), PERIOD, KNEE.delay)
    for factor, grows in ((0.95, False), (1.05, True)):
        matrix = closed_loop(plant, made.linear(1.5), factor * 10 ** (left.gain_db / 20))
        later = np.linalg.matrix_power(matrix, 100_000)
        x = later @ np.ones(len(matrix))
        assert (np.linalg.norm(later @ x) > np.linalg.norm(x)) == grows


def test_the_linear_controller_is_the_core_for_small_motions(rng):
    made = replace(design(KNEE, PERIOD, law=Law(0.8, 0.8, 0.5, 0.7, integral=0.4, derivative=0.01)), width=50.0)
    made = replace(made, assist_width=50.0)  # wide: friction is linear
    linear, core = made.linear(1e-3), made.control_law().start()
    n = 600
    position = 1e-4 * np.sin(0.05 * np.arange(n)) * np.linspace(0, 1, n)
    torque = 1e-4 * rng.standard_normal(n)
    for k in range(400):  # EMG fades in
        core.step(PERIOD * k, 0.0, 0.0, 0.0)
    got = [core.step(PERIOD * (400 + k), position[k], torque[k], 0.0) for k in range(n)]
    x, wanted = np.zeros(len(linear.a)), []
    for k in range(n):
        u = np.array([position[k], torque[k]])
        wanted.append((linear.c @ x + linear.d @ u).item())
        x = linear.a @ x + linear.b @ u
    np.testing.assert_allclose(got, wanted, atol=1e-4 * np.abs(wanted).max())


def test_friction_as_a_slope():
    assert friction_slope(2.0, 3.0) == pytest.approx(6 / np.pi)
    assert friction_slope(2.0, 3.0, 1e-4) == pytest.approx(6 / np.pi, rel=1e-3)
    assert friction_slope(1e-4, 3.0, 0.5) == pytest.approx(6.0, rel=1e-6)


def test_strap_gain_and_pid_keep_the_margins_asked_for():
    plants = [KNEE, KNEE.scaled(strap_stiffness=0.7), KNEE.scaled(strap_stiffness=1.3)]
    wanted = design(KNEE, PERIOD, law=Law(friction=0.6, proportional=8.0))
    assert not bears_all(wanted, plants, gain_db=6.0, delay=0.02)
    made = within(wanted, plants, gain_db=6.0, delay=0.02)
    assert made.law.proportional < 8.0
    left = worst_margins(made, plants)
    assert left.gain_db >= 6
    assert left.delay >= 0.02
    pid = tune_pid(made, plants, gain_db=6.0, delay=0.02)
    assert worst_margins(pid, plants).gain_db >= 6
    omega = [2.0, 4.0, 6.0]
    off = replace(pid, law=Law(0, 0, 0, 0, proportional=0, torque_gain=0))
    assert np.all(strap_torque_gain(pid, omega) < strap_torque_gain(off, omega))
    with pytest.raises(PellucidError, match="no weaker law leaves"):
        within(made, plants, gain_db=80.0, delay=0.02)


def test_a_limit_of_rate_has_its_textbook_describing_function():
    # Reached in every half-wave it makes a triangle of a sine: gain 4 K / pi, late by arccos(pi K / 2).
    table = rate_limit_table()
    for ratio in (0.1, 0.3, 0.5):
        got = np.interp(ratio, RATE_RATIOS, table.real) + 1j * np.interp(ratio, RATE_RATIOS, table.imag)
        assert abs(got) == pytest.approx(4.0 * ratio / np.pi, rel=0.01)
        assert -np.angle(got) == pytest.approx(np.arccos(0.5 * np.pi * ratio), abs=0.02)
    assert table[-1] == pytest.approx(1.0, abs=0.01)


def last_efforts(coupling, controller, kick):
    """Efforts of the last half second of three, after so many 9 Hz half-waves of the whole effort, within 10 N m and
    300 N m/s."""
    plant = sampled(worn_orthosis(coupling, 4.0), PERIOD, coupling.delay)
    x, c, effort, late = np.zeros(len(plant.a)), np.zeros(len(controller.a)), 0.0, []
    for k in range(1500):
        seen = plant.c[:2] @ x
        wanted = (controller.c @ c + controller.d @ seen).item()
        c = controller.a @ c + controller.b @ seen
        if k < kick:
            wanted = 10.0 * np.sign(np.sin(2.0 * np.pi * 9.0 * k * PERIOD))
        effort += np.clip(np.clip(wanted, -10.0, 10.0) - effort, -300.0 * PERIOD, 300.0 * PERIOD)
        x = plant.a @ x + plant.b[:, 0] * effort
        late.append(abs(effort))
    return float(max(late[-250:]))


@pytest.mark.parametrize(("share", "goes_on"), [(0.6, True), (0.4, False)])
def test_a_stable_loop_may_swing_at_its_limit_of_rate(share, goes_on):
    """An orthosis 1.4 times as heavy as its law thinks: small motions come to rest, large ones need not."""
    heavy = KNEE.scaled(orthosis_inertia=1.4)
    law = Law(friction=0.3, inertia=0.7 * share, proportional=0.6 * share)
    loop = design(KNEE, PERIOD, law=law).linear(4.0)
    assert bears(heavy, loop, PERIOD, gain_db=0.0, delay=0.0, speed=4.0)
    assert swings(heavy, loop, PERIOD, effort=10.0, rate=300.0, speed=4.0) is goes_on
    assert not swings(heavy, loop, PERIOD, effort=10.0, rate=np.inf, speed=4.0)
    assert (last_efforts(heavy, loop, kick=100) > 3.0) is goes_on
    assert last_efforts(heavy, loop, kick=2) < 0.5


def test_a_law_is_weakened_until_it_rests_on_wrong_inertias():
    wrong = [KNEE.scaled(orthosis_inertia=factor) for factor in (0.7, 1.4)]
    kept = {"gain_db": 6.0, "delay": 0.02, "speeds": (1.5, 4.0)}
    wanted = design(KNEE, PERIOD)
    usual, robust = within(wanted, [KNEE], **kept), within(wanted, [KNEE], wrong_plants=wrong, **kept)

    def resting(made):
        limits = {"effort": made.limits.effort, "rate": made.limits.rate, "speed": 4.0}
        return [not swings(plant, made.linear(4.0), PERIOD, **limits) for plant in wrong]

    assert not all(resting(usual))
    assert all(resting(robust))
    assert usual.law.inertia == 0.7
    assert robust.law.inertia < 0.7
    assert robust.law.inertia / 0.7 == pytest.approx(robust.law.proportional / usual.law.proportional)
    assert within(wanted, [KNEE], wrong_plants=[KNEE], **kept) == usual


def test_what_margins_say_bears_says():
    made = design(KNEE, PERIOD, law=Law(proportional=6.0))
    loop = made.linear(1.5, trust=1.0)
    left = margins(KNEE, loop, PERIOD, speed=1.5)
    assert np.isfinite([left.gain_db, left.delay]).all()
    for gain, delay, borne in ((-0.1, -1e-4, True), (0.1, -1e-4, False), (-0.1, 1e-4, False)):
        asked = {"gain_db": left.gain_db + gain, "delay": left.delay + delay}
        assert bears(KNEE, loop, PERIOD, speed=1.5, **asked) is borne


def test_cards_of_identify_are_read_by_kind():
    def card(kind, **values):
        parameters = tuple(CardParameter(name, "1", value, 0.0, (value, value)) for name, value in values.items())
        return ParameterCard(kind, "study", kind, parameters)

    orthosis = card("orthosis", inertia=0.048, damping=0.008, gravity=1.56, coulomb=0.015)
    limb, strap = card("limb", inertia=0.33, damping=0.15, gravity=8.0), card("coupling", stiffness=14.0, damping=0.42)
    actuator = {name: getattr(KNEE, name) for name in KNEE.__dataclass_fields__ if name.startswith("actuator")}
    assert Coupling.of_cards(orthosis, limb, strap, actuator | {"delay": 0.002}) == KNEE
    with pytest.raises(PellucidError, match='of kind "limb", expected "orthosis"'):
        Coupling.of_cards(limb, limb, strap, actuator)


def test_cards_that_contradict_or_lack():
    numbers = {name: getattr(KNEE, name) for name in KNEE.__dataclass_fields__}
    assert Coupling.from_cards(numbers, {"strap_stiffness": 14.0, "unrelated": 1.0}) == KNEE
    with pytest.raises(PellucidError, match="two cards give strap_stiffness"):
        Coupling.from_cards(numbers, {"strap_stiffness": 15.0})
    with pytest.raises(PellucidError, match=r"no card gives .*limb_inertia"):
        Coupling.from_cards({k: v for k, v in numbers.items() if k != "limb_inertia"})
    with pytest.raises(PellucidError, match="strap_stiffness is -1"):
        replace(KNEE, strap_stiffness=-1.0)
