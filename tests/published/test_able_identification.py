"""The virtual elbow through the paper's protocol: what the published identification finds, and one coherent body."""

import os

import numpy as np
import pytest
from nonlinear_solver import nonlinearly

from pellucid.joint.slider.slider_fit import all_at_once, fit_coherent, three_steps
from pellucid.joint.slider.study.identify_slider import STEP_PROTOCOLS, fit_slider
from pellucid.models.joint import GRAVITY
from pellucid.models.simulate import cycle_energy
from pellucid.numerics.protocols.excitation import REVERSALS_NAME
from pellucid_lab.elbow.instruments import read_all
from pellucid_lab.elbow.protocol import fitted_sliders, trials
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.study import record_in_memory, write_study

SEED = 1
THREADS = min(2, os.cpu_count() or 1)


@pytest.fixture(scope="module")
def rig():
    return able_elbow()


@pytest.fixture(scope="module")
def protocol(rig):
    return rig.trials()


@pytest.fixture(scope="module")
def recorded(rig, protocol):
    return record_in_memory(rig, protocol, seed=SEED, threads=THREADS)


@pytest.fixture(scope="module")
def fit(recorded):
    config, recordings, _ = recorded
    return fit_slider(config, recordings)


@pytest.fixture(scope="module")
def known(rig, recorded):
    return rig.truth() | {"sliders": {one.trial.name: one.trial.slider for one in recorded[2]}}


def workspace(rig):
    """Places of the carriage [m] and angles [rad] of the protocol, to be broadcast."""
    x = np.linspace(rig["slider"]["low"], rig["slider"]["high"], 16)
    return x, np.linspace(rig["range"]["low"], rig["range"]["high"], 60)


def true_gravity(rig, x, q):
    along, across = (np.array([rig.gravity(float(place))[i] for place in x])[:, None] for i in (0, 1))
    return along * np.sin(q) + across * np.cos(q)


def mean_error(fit, method, recordings):
    return np.mean([e.current for e in fit.errors[method] if e.recording in recordings])


def steps_of(fit):
    return [m for m in fit.motions if m.split == "fitted" and m.protocol in STEP_PROTOCOLS]


def test_sliders_are_found_within_a_millimetre(fit, known):
    off = [abs(p.slider - known["sliders"][p.recording]) for p in fit.geometry.placements]
    assert len(off) == sum(
        not name.startswith(REVERSALS_NAME) for name in known["sliders"]
    )  # those tell of friction alone
    assert max(off) < 1e-3


def test_gravity_with_friction_by_load_is_right_over_the_workspace(fit, rig):
    x, q = workspace(rig)
    right = true_gravity(rig, x, q)
    found = fit["load"].model.gravity(fit["load"].values, x[:, None], q)
    assert np.max(np.abs(found - right)) < 0.01 * np.max(np.abs(right))
    assert np.max(np.abs(found / right - 1.0)) < 0.02


def test_without_friction_by_load_it_is_further_off(fit, rig):
    x, q = workspace(rig)
    right = true_gravity(rig, x, q)
    off = {
        name: np.max(np.abs(fit[name].model.gravity(fit[name].values, x[:, None], q) - right))
        for name in ("consistent", "load")
    }
    assert off["load"] < 0.5 * off["consistent"]


@pytest.mark.parametrize("method", ["consistent", "load"])
def test_inertia_is_right_over_the_rail(fit, rig, method):
    x, _ = workspace(rig)
    right = np.array([rig.inertia(float(place)) for place in x])
    assert fit[method].model.inertia(fit[method].values, x) == pytest.approx(right, rel=0.05)


@pytest.mark.parametrize("protocol_name", ["constant_velocity", "swept_sine", "swept_sine_integrated", "slow"])
def test_each_model_predicts_better_than_the_one_before(fit, protocol_name):
    names = tuple(e.recording for e in fit.errors["pooled"] if e.split == "heldout" and e.protocol == protocol_name)
    assert names
    error = {name: mean_error(fit, name, names) for name in fit.estimates}
    assert error["dissociated"] < 0.75 * error["pooled"]
    assert error["dissociated_at_once"] < 0.75 * error["pooled_at_once"]


def test_one_body_with_fewer_parameters_predicts_as_well(fit):
    assert len(fit["load"].values) < len(fit["dissociated"].values)
    assert fit.evaluated_error("dissociated") < 0.6 * fit.evaluated_error("pooled")
    assert fit.evaluated_error("load") <= 1.05 * fit.evaluated_error("dissociated")
    assert fit.evaluated_error("load") < fit.evaluated_error("consistent")


@pytest.mark.parametrize("name", ["inertia", "carriage_moment", "gravity", "gravity_cosine"])
def test_the_body_lies_within_four_standard_errors(fit, known, name):
    """The body is in the model. Frictions are not: the rig's have a Stribeck rise, a decline with speed, a swing along
    the travel and a rise of the load's share towards rest, so that no value of theirs is the true one."""
    found = fit["load"][name]
    assert abs(found.value - known[name]) < 4.0 * found.standard_error
    assert 0.0 < found.standard_error < 0.25 * max(abs(known[name]), 0.01)


def test_frictions_by_load_are_of_the_size_they_were_made(fit, rig):
    made = rig["transmission"]
    for name in ("load_motoring", "load_generating"):
        assert fit["load"][name].value == pytest.approx(made[name], rel=0.15)
    for sign in ("positive", "negative"):
        dry, slick = fit["load"][f"coulomb_{sign}"].value, fit["load"][f"viscous_{sign}"].value
        assert dry == pytest.approx(made[f"coulomb_{sign}"] + rig["bearing"]["coulomb"], rel=0.2)
        assert 0.5 * made[f"viscous_{sign}"] < slick < made[f"viscous_{sign}"] + rig["bearing"]["viscous"]


def test_the_directional_gravity_straddles_the_true_one(fit, rig):
    """Two sets give the load's friction to gravity: too much of it upward, too little downward."""
    x, q = workspace(rig)
    model, right = fit["dissociated"].model, true_gravity(rig, *workspace(rig))
    q, heavy = q[None, :], right > 0.5 * right.max()
    assert np.all((model.gravity("up", x[:, None], q) > right)[heavy])
    assert np.all((model.gravity("down", x[:, None], q) < right)[heavy])


def test_a_body_that_could_exist_and_one_mass(fit, known):
    for name in ("consistent", "load"):
        estimate = fit[name]
        assert np.min(estimate.model.gaps(estimate.values, fit.rail, 2.5)) >= 0.0
        assert estimate.model.value(estimate.values, "carriage_mass") == pytest.approx(known["carriage_mass"], rel=0.05)


@pytest.mark.parametrize("dissociated", [False, True])
def test_the_linear_and_the_nonlinear_solver_agree(fit, dissociated, monkeypatch):
    steps = steps_of(fit)
    for method in (three_steps, all_at_once):
        one = method(steps, dissociated=dissociated)
        other = nonlinearly(monkeypatch, method, steps, dissociated=dissociated)
        error = np.array([parameter.standard_error for parameter in one.parameters])
        assert np.all(np.abs(other.values - one.values) <= 1e-6 * np.abs(one.values) + 1e-4 * error)


def test_the_load_family_is_found_from_anywhere(fit, rig):
    model = fit["load"].model
    again = fit_coherent(model, steps_of(fit), rail=fit.rail, mass=rig["link"]["mass"] + rig["carriage"]["mass"])
    assert again.values == pytest.approx(fit["load"].values, rel=1e-4, abs=1e-6)


def test_compensating_by_two_sets_drives_the_rig_past_the_range_it_was_fitted_on(fit, rig):
    """Where the load is small and gravity's sets are not, compensation gives more than the rig's own friction takes.

    The rig is moved steadily: its friction under the true load, without backlash and the swing along the travel.
    """
    x = rig["slider"]["high"]
    along, across = rig.gravity(x)

    def given(q, v, a):
        load = along * np.sin(q) + across * np.cos(q) + rig.inertia(x) * a
        return fit["dissociated"].model.torque(q, v, a, x) - load - rig.friction(v, load)

    angles = np.linspace(2.2, np.pi, 20)
    work = {b: np.array([cycle_energy(given, b, q, 0.5 / (2.0 * np.pi * b)) for q in angles]) for b in (0.05, 0.1)}
    best = int(np.argmax(work[0.05]))
    assert work[0.05][best] > 0.0
    assert work[0.1][best] > work[0.05][best]


def test_the_same_seed_gives_the_same_bits(rig, protocol, recorded, fit):
    some = [protocol[i] for i in (0, 6, 12)]
    one, other = (read_all(rig, some, np.random.default_rng(4), threads=n) for n in (1, THREADS))
    third = read_all(rig, some, np.random.default_rng(5))
    for a, b, c in zip(one, other, third, strict=True):
        assert np.array_equal(a.counts, b.counts)
        assert np.array_equal(a.milliamperes, b.milliamperes)
        assert all(np.array_equal(a.markers[n], b.markers[n], equal_nan=True) for n in a.markers)
        assert not np.array_equal(a.milliamperes, c.milliamperes)
    config, recordings, _ = recorded
    for name, estimate in fit_slider(config, recordings).estimates.items():
        assert np.array_equal(estimate.values, fit[name].values)


def test_files_hold_what_memory_holds(rig, protocol, tmp_path):
    wanted = {"static_1", "constant_2", "unseen_sweep_3"}
    some = tuple(t for t in protocol if t.name in wanted)
    assert len(some) == 3
    config, recordings, _ = record_in_memory(rig, some, seed=3)
    study = write_study(tmp_path / "elbow", rig, name=rig.name, seed=3, trials=some)
    assert study.config == config
    read = {r.name: r for r in study.recordings()}
    for memory in recordings:
        file = read[memory.name]
        assert (file.use, file.protocol) == (memory.use, memory.protocol)
        for channel in ("position", "current", "time"):
            assert np.array_equal(file[channel], memory[channel])
        assert file.optical.time == pytest.approx(memory.optical.time, abs=5.01e-6)
        assert list(file.optical.markers) == list(memory.optical.markers)
        for name, points in memory.optical.markers.items():
            assert file.optical.markers[name] == pytest.approx(points, abs=1e-12, nan_ok=True)


def test_without_friction_all_models_are_one(rig):
    """The limit in which directions do not differ: no friction, no ripple, no play."""
    none = [
        "coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative", "stribeck", "load_motoring",
        "load_generating", "friction_swing", "backlash",
    ]  # fmt: skip
    changes = {f"transmission.{name}": 0.0 for name in none}
    changes |= {"bearing.coulomb": 0.0, "bearing.viscous": 0.0, "motor.ripple_amplitude": 0.0}
    ideal = rig.changed(changes, "frictionless")
    some = tuple(t for t in trials(ideal) if t.use == "fit")
    config, recordings, _ = record_in_memory(ideal, some, seed=2, threads=THREADS)
    fit = fit_slider(config, recordings)
    x, q = workspace(ideal)
    right = true_gravity(ideal, x, q)
    inertia = np.array([ideal.inertia(float(place)) for place in x])
    for name in ("pooled", "dissociated"):
        model = fit[name].model
        for direction in ("up", "down"):
            assert model.gravity(direction, x[:, None], q) == pytest.approx(right, abs=0.01 * right.max())
            assert model.inertia(direction, x) == pytest.approx(inertia, rel=0.05)
        assert max(model.up[3], model.down[3]) < 0.005
    for name in ("consistent", "load"):
        model, values = fit[name].model, fit[name].values
        assert model.gravity(values, x[:, None], q) == pytest.approx(right, abs=0.01 * right.max())
        assert model.inertia(values, x) == pytest.approx(inertia, rel=0.03)
        assert max(model.value(values, f"coulomb_{sign}") for sign in ("positive", "negative")) < 0.005
    names = tuple(e.recording for e in fit.errors["pooled"])
    errors = [mean_error(fit, name, names) for name in ("pooled", "dissociated", "consistent", "load")]
    assert max(errors) < 1.05 * min(errors)
    at_once = [mean_error(fit, name, names) for name in ("pooled_at_once", "dissociated_at_once", "consistent", "load")]
    assert max(at_once) < 1.01 * min(at_once)


def test_at_rest_gravity_is_known_only_within_what_sticks(fit, known):
    """A held joint sticks with any torque up to its friction, so the static set is rough; its errors say how rough."""
    static = {p.name: p for p in fit.static}
    right = {"moment_slope": known["carriage_mass"], "moment": known["gravity"] / GRAVITY}
    for name, value in right.items():
        assert abs(static[name].value - value) < 4.0 * static[name].standard_error, name
    assert static["moment"].standard_error > 3.0 * fit["dissociated"]["moment_up"].standard_error


def test_six_places_span_the_rail(rig, fit):
    x = fitted_sliders(rig)
    assert (x[0], x[-1]) == (rig["slider"]["low"], rig["slider"]["high"])
    assert fit.rail == (x[0], x[-1])
