"""Laws of the joint with a carriage and of its identification: exact recovery, mirroring, order, bounds."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nonlinear_solver import least_squares_from_afar, nonlinearly

sys.path.insert(0, str(Path(__file__).parent))

from slider_motions import made_up

from pellucid import _core
from pellucid.joint.slider.slider_fit import all_at_once, fit_coherent, three_steps
from pellucid.models.joint import GRAVITY, PARAMETER_INDEX
from pellucid.models.slider_joint import UNITS, DirectionalSliderModel, SliderJointModel, columns

SLOW = ("constant_velocity",)
RAIL = (0.10, 0.30)
MASS = {"carriage_mass": 0.48}
MODELS = {
    "consistent": SliderJointModel("consistent"),
    "consistent, weighed": SliderJointModel("consistent", MASS),
    "load": SliderJointModel("load"),
    "load, weighed": SliderJointModel("load", MASS),
}
TRUE = {
    "inertia": 0.031,
    "carriage_moment": -0.004,
    "carriage_mass": 0.48,
    "gravity": 1.15,
    "gravity_cosine": 0.26,
    "coulomb_positive": 0.24,
    "coulomb_negative": 0.17,
    "viscous_positive": 0.06,
    "viscous_negative": 0.04,
    "load_motoring": 0.14,
    "load_generating": 0.11,
    "load_friction": 0.12,
}
UP = np.array([0.55, 0.128, 0.026, 0.31, 0.060, 0.0335, 0.0153, 0.474])
DOWN = np.array([0.43, 0.108, 0.022, 0.24, 0.042, 0.0313, -0.0198, 0.453])


def values_of(model, **changes):
    return np.array([(TRUE | changes)[name] for name in model.names])


def points(rng, n=200):
    """Motions at zero, tiny and random points, each shape (n,)."""
    return 10.0 ** rng.uniform(-12.0, 1.0, (3, n)) * rng.choice([-1.0, 0.0, 1.0], (3, n))


@pytest.mark.parametrize("name", MODELS)
def test_spread_is_what_one_unit_of_a_parameter_adds(rng, name):
    model = MODELS[name]
    for x in (0.0, 1e-12, 0.12, 0.3):
        values = rng.uniform(0.0, 1.0, len(model.names))
        zero = model.vector(np.zeros(len(values)), x)
        assert model.vector(values, x) == pytest.approx(model.selection(x) @ values + zero, rel=1e-14, abs=1e-300)
        assert zero[PARAMETER_INDEX["gravity_sine"]] == pytest.approx(
            GRAVITY * x * model.known.get("carriage_mass", 0.0)
        )
        vector = model.vector(values, x, 0.02)
        assert vector[PARAMETER_INDEX["velocity_width"]] == 0.02
        assert vector[PARAMETER_INDEX["inertia"]] == pytest.approx(float(model.inertia(values, np.array(x))), rel=1e-13)
        q = np.linspace(-3.0, 3.0, 11)
        held = np.asarray(_core.load(vector, q, np.zeros(11)))
        assert held == pytest.approx(model.gravity(values, np.array(x), q), rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("width", [0.0, 0.01])
def test_the_mirrored_joint_has_the_mirrored_torque(rng, name, width):
    """Torque is odd in the motion where directions are swapped and what hangs across the link changes sides."""
    model = MODELS[name]
    swapped = dict(TRUE, gravity_cosine=-TRUE["gravity_cosine"])
    for kind in ("coulomb", "viscous"):
        swapped |= {f"{kind}_positive": TRUE[f"{kind}_negative"], f"{kind}_negative": TRUE[f"{kind}_positive"]}
    q, v, a = points(rng)
    for x in (0.0, 0.2):
        plain = np.asarray(_core.inverse_dynamics(model.vector(values_of(model), x, width), q, v, a))
        turned = np.asarray(_core.inverse_dynamics(model.vector(values_of(model, **swapped), x, width), -q, -v, -a))
        assert np.all(np.isfinite(plain))
        assert turned == pytest.approx(-plain, rel=1e-12, abs=1e-13)


def test_a_coherent_torque_is_proportional_to_its_linear_parameters(rng):
    model, (q, v, a) = MODELS["consistent"], points(rng)
    values = values_of(model)
    plain = np.asarray(_core.inverse_dynamics(model.vector(values, 0.2, 0.01), q, v, a))
    tripled = np.asarray(_core.inverse_dynamics(model.vector(3.0 * values, 0.2, 0.01), q, v, a))
    assert tripled == pytest.approx(3.0 * plain, rel=1e-12, abs=1e-14)
    parts = sum(
        np.asarray(_core.inverse_dynamics(model.vector(values * (np.arange(9) == k), 0.2, 0.01), q, v, a))
        for k in range(9)
    )
    assert parts == pytest.approx(plain, rel=1e-12, abs=1e-14)


def test_a_directional_torque_is_its_columns_times_the_set_of_the_direction(rng):
    q, v, a = points(rng)
    for x in (0.0, 1e-12, 0.2):
        whole = columns(q, v, a, x)
        model = DirectionalSliderModel(UP, DOWN)
        assert model.torque(q, v, a, x) == pytest.approx(np.where(v > 0.0, whole @ UP, whole @ DOWN), rel=1e-14)
        assert DirectionalSliderModel(UP, UP).torque(q, v, a, x) == pytest.approx(whole @ UP, rel=1e-14, abs=1e-14)
        # Mirrored: directions change places, and so does what lies across the link.
        across = np.where(np.array(list(UNITS)) == "cross_moment", -1.0, 1.0)
        turned = DirectionalSliderModel(DOWN * across, UP * across).torque(-q, -v, -a, x)
        moving = v != 0.0
        assert turned[moving] == pytest.approx(-model.torque(q, v, a, x)[moving], rel=1e-12, abs=1e-14)
        for direction, sign in (("up", 1.0), ("down", -1.0)):
            still = np.full(len(q), sign * 1e-300)
            held = model.torque(q, still, np.zeros(len(q)), x)
            assert held == pytest.approx(model.gravity(direction, np.array(x), q), rel=1e-13, abs=1e-14)
            pushed = model.torque(q, still, a, x) - held
            assert pushed == pytest.approx(a * float(model.inertia(direction, np.array(x))), rel=1e-9, abs=1e-13)


def test_a_body_that_meets_the_conditions_has_inertia_everywhere(rng):
    model, met = MODELS["consistent"], 0
    x = np.linspace(-2.0, 2.0, 401)
    for mass in (None, 2.0):
        for _ in range(4000):
            values = np.concatenate([10.0 ** rng.uniform(-4.0, 0.0, 1), rng.uniform(-0.2, 0.2, 1)])
            values = np.concatenate([values, rng.uniform(0.0, 1.5, 1), rng.uniform(-3.0, 3.0, 2), np.zeros(4)])
            if np.min(model.gaps(values, RAIL, mass)) < 0.0:
                continue
            met += 1
            assert np.all(model.inertia(values, x) > -1e-12)
            assert np.all(model.inertia(values, np.linspace(*RAIL, 50)) > 0.0)
    assert met > 500


def pooled_effort(m, values=UP):
    return dissociated_effort(m, values, values)


def dissociated_effort(m, up=UP, down=DOWN):
    """Two sets, what jumps with the direction filtered as the measured effort is."""
    whole = columns(m.position, m.velocity, m.acceleration, m.slider)
    dry = np.array(list(UNITS)) == "coulomb"
    smooth, sign = whole @ (0.5 * (up + down) * ~dry), np.where(m.velocity > 0.0, 1.0, -1.0)
    return smooth + m.smooth(whole @ (0.5 * (up + down) * dry) + sign * (whole @ (0.5 * (up - down))))


def without_inertia_while_steady(effort_of):
    """Step 2 knows no inertia: constant velocities that are so exactly, for the published steps to be exact too."""
    idle = [replace(m, acceleration=0.0 * m.acceleration) if m.protocol in SLOW else m for m in made_up(zero)]
    return [replace(m, effort=effort_of(m)) for m in idle]


def zero(m):
    return np.zeros(len(m.position))


@pytest.mark.parametrize("solver", ["linear", "nonlinear"])
@pytest.mark.parametrize("method", [three_steps, all_at_once])
def test_the_published_steps_recover_every_parameter(method, solver, monkeypatch):
    if solver == "nonlinear":
        monkeypatch.setattr("pellucid.joint.slider.slider_fit.least_squares_within", least_squares_from_afar)
    make = without_inertia_while_steady if method is three_steps else made_up
    pooled = method(make(pooled_effort), dissociated=False)
    assert pooled.values == pytest.approx(UP, rel=1e-6, abs=1e-7)
    assert pooled.residual_sd < 1e-7
    both = method(make(dissociated_effort), dissociated=True)
    assert both.values == pytest.approx(np.concatenate([UP, DOWN]), rel=1e-6, abs=1e-7)
    assert both.model.up == pytest.approx(UP, rel=1e-6, abs=1e-7)
    assert both.model.down == pytest.approx(DOWN, rel=1e-6, abs=1e-7)
    assert not both.notes


@pytest.mark.parametrize("dissociated", [False, True])
@pytest.mark.parametrize("method", [three_steps, all_at_once])
def test_both_solvers_find_the_same_under_noise(method, dissociated, monkeypatch):
    noise = np.random.default_rng(5)
    motions = made_up(lambda m: dissociated_effort(m) + 0.05 * m.smooth(noise.standard_normal(len(m.position))))
    one = method(motions, dissociated=dissociated)
    other = nonlinearly(monkeypatch, method, motions, dissociated=dissociated)
    assert other.values == pytest.approx(one.values, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("name", MODELS)
def test_a_coherent_body_is_recovered(name):
    model = MODELS[name]
    truth = values_of(model)
    motions = made_up(lambda m: model.effort(truth, m))
    found = fit_coherent(model, motions, rail=RAIL, mass=2.5)
    assert found.values == pytest.approx(truth, rel=1e-5, abs=1e-6)
    assert found.residual_sd < 1e-6
    assert not found.notes


def test_without_a_weighed_carriage_one_coefficient_stands_for_both():
    r"""Torques are (1 + a_m) y and (1 - a_g) y; another y' = k y with one coefficient b gives the same where
    k (1 + b) = 1 + a_m and k (1 - b) = 1 - a_g."""
    truth = SliderJointModel("load", MASS)
    motions = made_up(lambda m: truth.effort(values_of(truth), m))
    found = fit_coherent(MODELS["load"], motions, rail=RAIL)
    motoring, generating = TRUE["load_motoring"], TRUE["load_generating"]
    k = 1.0 + 0.5 * (motoring - generating)
    assert found["load_friction"].value == pytest.approx(0.5 * (motoring + generating) / k, rel=0.01)
    for name in ("inertia", "carriage_mass", "gravity", "gravity_cosine"):
        assert found[name].value == pytest.approx(k * TRUE[name], rel=0.01), name
    for name in ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative"):
        assert found[name].value == pytest.approx(TRUE[name], rel=0.01), name


def mirrored(motions):
    return [
        replace(m, position=-m.position, velocity=-m.velocity, acceleration=-m.acceleration, effort=-m.effort)
        for m in motions
    ]


@pytest.mark.parametrize("name", MODELS)
def test_mirrored_recordings_swap_directions(name):
    model = MODELS[name]
    noise = np.random.default_rng(8)
    motions = made_up(
        lambda m: model.effort(values_of(model), m) + 0.03 * m.smooth(noise.standard_normal(len(m.position)))
    )
    plain = fit_coherent(model, motions, rail=RAIL)
    turned = fit_coherent(model, mirrored(motions), rail=RAIL)
    swap = {"positive": "negative", "negative": "positive"}
    for parameter in plain.parameters:
        head, _, tail = parameter.name.rpartition("_")
        partner = turned[f"{head}_{swap[tail]}" if tail in swap else parameter.name]
        expected = -parameter.value if parameter.name == "gravity_cosine" else parameter.value
        assert partner.value == pytest.approx(expected, rel=1e-4, abs=1e-6), parameter.name
        assert partner.standard_error == pytest.approx(parameter.standard_error, rel=1e-2), parameter.name


@pytest.mark.parametrize("method", [three_steps, all_at_once])
def test_mirrored_recordings_swap_the_sets(method):
    motions = made_up(dissociated_effort)
    plain = method(motions, dissociated=True).model
    turned = method(mirrored(motions), dissociated=True).model
    across = np.where(np.array(list(UNITS)) == "cross_moment", -1.0, 1.0)
    assert turned.up == pytest.approx(across * plain.down, rel=1e-6, abs=1e-7)
    assert turned.down == pytest.approx(across * plain.up, rel=1e-6, abs=1e-7)


def test_a_joint_without_friction_is_the_same_backwards_in_time():
    body = UP * np.where(np.isin(np.array(list(UNITS)), ("coulomb", "viscous")), 0.0, 1.0)
    motions = made_up(lambda m: pooled_effort(m, body))
    back = [
        replace(
            m,
            position=m.position[::-1].copy(),
            velocity=-m.velocity[::-1],
            acceleration=m.acceleration[::-1].copy(),
            effort=m.effort[::-1].copy(),
            scored=m.scored[::-1].copy(),
        )
        for m in motions
    ]
    for dissociated in (False, True):
        forth = all_at_once(motions, dissociated=dissociated)
        assert all_at_once(back, dissociated=dissociated).model.up == pytest.approx(forth.model.up, rel=1e-3, abs=1e-4)


def test_friction_backwards_in_time_would_drive_and_is_refused():
    """A film of a rubbing joint run backwards shows one that drives itself: bounds hold every friction at zero."""
    model = MODELS["consistent"]
    drives = values_of(
        model, coulomb_positive=-0.24, coulomb_negative=-0.17, viscous_positive=-0.06, viscous_negative=-0.04
    )
    found = fit_coherent(model, made_up(lambda m: model.effort(drives, m)), rail=RAIL)
    for name in ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative"):
        assert found[name].at_bound
        assert found[name].value == pytest.approx(0.0, abs=1e-6)
        assert not found[name].identifiable
        assert any(note.startswith(f"{name} is held at its physical bound") for note in found.notes)


@pytest.mark.parametrize("name", MODELS)
def test_the_order_of_recordings_changes_nothing(name, rng):
    model = MODELS[name]
    noise = np.random.default_rng(3)
    motions = made_up(
        lambda m: model.effort(values_of(model), m) + 0.03 * m.smooth(noise.standard_normal(len(m.position)))
    )
    shuffled = [motions[i] for i in rng.permutation(len(motions))]
    plain, other = (fit_coherent(model, some, rail=RAIL, mass=2.5) for some in (motions, shuffled))
    assert other.values == pytest.approx(plain.values, rel=1e-5, abs=1e-7)
    assert np.diag(other.covariance) == pytest.approx(np.diag(plain.covariance), rel=0.05)
    for dissociated in (False, True):
        plain, other = (three_steps(some, dissociated=dissociated) for some in (motions, shuffled))
        assert other.values == pytest.approx(plain.values, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("name", ["consistent", "load, weighed"])
def test_an_inertia_that_no_body_has_is_moved_to_one_that_could_exist(name):
    model = MODELS[name]
    planted = values_of(model, inertia=0.002, carriage_moment=-0.05)
    assert np.min(model.gaps(planted, RAIL, 2.5)) < 0.0
    motions = made_up(lambda m: model.effort(planted, m))
    found = fit_coherent(model, motions, rail=RAIL, mass=2.5)
    assert np.min(model.gaps(found.values, RAIL, 2.5)) >= -1e-6
    assert "inertia and gravity are held where a body of these masses can have them" in found.notes
    assert np.all(model.inertia(found.values, np.linspace(*RAIL, 50)) > 0.0)
    # Nearest in its own residuals: the truth of a coherent body that is merely possible fits worse.
    merely = values_of(model)
    square = [float(np.sum((model.effort(merely, m) - m.effort)[m.scored] ** 2)) for m in motions]
    own = [float(np.sum((model.effort(found.values, m) - m.effort)[m.scored] ** 2)) for m in motions]
    assert sum(own) < 0.5 * sum(square)
    assert np.min(model.gaps(found.values, RAIL, 2.5)) < 1e-3


def test_a_published_friction_at_its_bound_is_said():
    sets = [s * np.where(np.array(list(UNITS)) == "viscous", -1.0, 1.0) for s in (UP, DOWN)]
    found = all_at_once(made_up(lambda m: dissociated_effort(m, *sets)), dissociated=True)
    for direction in ("up", "down"):
        assert found[f"viscous_{direction}"].at_bound
        assert f"viscous_{direction} is held at its physical bound, 0" in found.notes
