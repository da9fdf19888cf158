"""Friction below slip, found from recordings: measured, bounded, unknown; families on bent motions; the protocol."""

import re
from dataclasses import replace

import numpy as np
import pytest

import pellucid as pl
from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.joint.fit.friction_solver import solve_family
from pellucid.joint.fit.presliding import Presliding, estimate_presliding, position_resolution, with_presliding
from pellucid.joint.fit.replay import Machine, simulate_recording
from pellucid.models.card import read_card, write_card
from pellucid.models.joint import NAMES, joint_model
from pellucid.numerics.motion import Filtering, motion_of
from pellucid.numerics.protocols.excitation import reversals
from pellucid.numerics.protocols.protocol import protocol
from pellucid.numerics.regression import stack
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study

FILTERING = Filtering(20.0, 4, 25, 0.0, 100)
RIG = bench_joint()
MODEL = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine", velocity_range=3.0)


def recorded(travel, seed, *, quantum=5e-5, reference=None, split="fitted"):
    rng = np.random.default_rng(seed)
    if reference is None:
        angles = rng.uniform(-0.5, 1.2, 2)
        reference = reversals(12.0, 1000.0, smallest=2e-3, largest=0.08, frequency=1.0, centres=angles)
    _, _, _, command, _, measured = _core.simulate(
        RIG.vector, reference=reference, period=1e-3, loop="cascade", kp=12.0, kv=2.4, velocity_span=4, gain=RIG.gain,
        encoder_quantum=quantum, encoder_noise=1e-5 * rng.standard_normal(len(reference)), stiction=True,
        position0=float(reference[0]), presliding_travel=travel,
    )  # fmt: skip
    effort = RIG.gain * command + 0.05 * rng.standard_normal(len(reference))
    return motion_of(1e-3 * np.arange(len(reference)), measured, effort, FILTERING, split=split)


def values_of(motions):
    return solve_family(MODEL, stack([replace(m, filtering=replace(m.filtering, dead_band=0.05)) for m in motions]))


@pytest.mark.parametrize("travel", [3e-4, 1e-3, 3e-3])
def test_travel_is_found(travel):
    fitted, held = [recorded(travel, s) for s in (1, 2)], [recorded(travel, 3, split="heldout")]
    found = estimate_presliding(MODEL, values_of(fitted).values, fitted, held)
    assert found.travel.value == pytest.approx(travel, rel=0.12)
    assert found.travel.standard_error < 0.1 * travel
    assert found.gives < 0.5 * found.slips
    assert found.p_value < 1e-3
    assert found.below is None


def test_none_is_bounded_and_not_found():
    fitted = [recorded(0.0, s) for s in (4, 5)]
    found = estimate_presliding(MODEL, values_of(fitted).values, fitted, [])
    assert found.travel is None
    assert found.below < 2e-4


def test_coarse_encoder_bounds():
    fitted = [recorded(1e-3, s, quantum=2e-3) for s in (6, 7)]
    found = estimate_presliding(MODEL, values_of(fitted).values, fitted, [])
    assert found.resolution == pytest.approx(2e-3, rel=0.3)
    assert found.travel is None
    assert found.below is None or found.below > 1e-3


def test_motion_without_reversals_is_unknown():
    """One way only: friction is a constant, whatever the travel."""
    way = 0.06 * np.arange(16_000) * 1e-3 - 0.4
    fitted = [recorded(1e-3, s, reference=way) for s in (8, 9)]
    # What starts at rest is a reversal of a kind: without it.
    fitted = [replace(m, filtering=replace(m.filtering, trim=1000)) for m in fitted]
    found = estimate_presliding(MODEL, np.array([0.085, 3.1, 0.2, 0.5, 0.05]), fitted, [])
    assert found.travel is None
    assert found.below is None
    assert "reversal" in found.why


def test_families_are_solved_on_bent_motions():
    """With the travel known, a family finds on slow samples what it finds nowhere without: its friction."""
    motions = [recorded(1e-3, s) for s in (1, 2)]
    with_it = solve_family(MODEL, stack([with_presliding(m, 1e-3) for m in motions]))
    without = solve_family(MODEL, stack(motions))
    assert np.std(with_it.residual) < 0.4 * np.std(without.residual)
    level = dict(zip(MODEL.names, with_it.values, strict=True))["coulomb"]
    assert level == pytest.approx(0.6, rel=0.15)  # Coulomb and Stribeck of a slow joint
    held = recorded(1e-3, 3, split="heldout")
    machine = Machine(gain=1.0)
    errors = [
        simulate_recording(
            MODEL, with_it.values, replace(held, command=held.effort), machine, closed=False, travel=t
        ).rmse
        for t in (1e-3, 0.0)
    ]
    assert errors[0] != errors[1]


def test_bent_rows_are_the_equation(rng):
    """level(v) s + F_v v + alpha |y| s, through the filter, whatever the family."""
    motion = with_presliding(recorded(1e-3, 1), 1e-3)
    model = joint_model("combined", motion="rotary", effort_unit="N*m", gravity="sine", velocity_range=3.0)
    values = np.array([0.1, 3.0, 0.2, 0.5, 0.3, 0.4, 0.15, 0.1, 0.06])
    p = dict(zip(NAMES, model.vector(values), strict=True))
    s, q, v, a = motion.direction, motion.position, motion.velocity, motion.acceleration
    load = p["inertia"] * a + p["gravity_sine"] * np.sin(q)
    viscous = np.where(v > 0, p["viscous_positive"], p["viscous_negative"]) * v
    coulomb = np.where(s < 0, p["coulomb_negative"], p["coulomb_positive"])
    level = coulomb + p["stribeck"] * np.exp(-((v / p["stribeck_velocity"]) ** 2)) + p["load_motoring"] * np.abs(load)
    wanted = load + viscous + motion.smooth(level * s)
    np.testing.assert_allclose(model.effort(values, motion), wanted, atol=1e-9)
    rows = model.rows(values, motion)
    np.testing.assert_allclose(rows[0], motion.rows(wanted), atol=1e-9)
    step = 1e-6 * values
    for i in range(len(values)):
        moved = [model.effort(values + sign * step * (np.arange(len(values)) == i), motion) for sign in (1, -1)]
        difference = motion.rows((moved[0] - moved[1]) / (2 * step[i]))
        np.testing.assert_allclose(rows[1][:, i], difference, atol=1e-5 * max(1, np.abs(difference).max()))


def test_resolution_is_the_encoders_step():
    assert position_resolution([recorded(0.0, 1, quantum=3e-4)]) == pytest.approx(3e-4, rel=0.4)
    assert position_resolution([]) == 0.0


def test_joint_study_tells_and_keeps_it(tmp_path):
    rig = RIG.changed({"joint.presliding_travel": 1e-3, "sampling.reversals": 2, "sampling.duration": 12.0}, "bench")
    result = pl.identify(write_study(tmp_path / "study", rig, name="bench", seed=2), families=["load"], thorough=False)
    travel = result["presliding_travel"]
    assert travel.value == pytest.approx(1e-3, rel=0.1)
    told = [v for v in result.verdicts if v.finding == "presliding"]
    assert len(told) == 1
    assert re.match(r"Presliding displacement: [\d.]+ mrad \(", told[0].said)
    assert {r.id: r.value for r in result.rows}["bench.presliding.travel"] == travel.value
    card = result.cards["joint"]
    assert card.presliding_travel.value == travel.value
    write_card(tmp_path / "card.json", card)
    assert read_card(tmp_path / "card.json").presliding_travel == card.presliding_travel
    write_card(tmp_path / "without.json", replace(card, presliding_travel=None))
    assert read_card(tmp_path / "without.json").presliding_travel is None
    wrong = replace(card.presliding_travel, value=float("1e12"))
    write_card(tmp_path / "wrong.json", replace(card, presliding_travel=wrong))
    with pytest.raises(PellucidError, match="presliding_travel"):
        read_card(tmp_path / "wrong.json")


def test_a_simulation_that_diverges_is_told_and_stops_nothing(tmp_path):
    rig = bench_joint().changed({"joint.presliding_travel": 1e-3, "sampling.reversals": 3})
    study = write_study(tmp_path / "study", rig, name="bench", seed=1)
    result = pl.identify(study, families=["combined"])
    assert any("diverges" in v.text for v in result.verdicts)
    assert result.presliding.travel.value == pytest.approx(1e-3, rel=0.2)


def test_reversals_grow_around_each_angle():
    path = reversals(24.0, 500.0, smallest=1e-3, largest=0.1, frequency=1.0, centres=[0.2, 0.9])
    assert len(path) == 12_000
    for half, centre in ((path[:6000], 0.2), (path[6000:], 0.9)):
        strokes = half[500:].reshape(-1, 500) - centre
        sizes = np.abs(strokes).max(axis=1)
        np.testing.assert_allclose(sizes[[0, -1]], [1e-3, 0.1], rtol=1e-3)
        np.testing.assert_allclose(np.diff(np.log(sizes)), np.log(100.0) / 10, rtol=1e-2)
        np.testing.assert_allclose(strokes.mean(axis=1), 0, atol=1e-4)
    assert np.abs(np.diff(path)).max() * 500 < 2.5  # no jump
    with pytest.raises(PellucidError, match="3 strokes and a largest stroke above the smallest"):
        reversals(4.0, 500.0, smallest=1e-3, largest=0.1, frequency=1.0, centres=[0.0, 1.0])


def test_the_command_writes_them(tmp_path):
    said = {"rate": 200.0, "smallest": 1e-3, "largest": 0.05, "around": [0.1, 0.6]}
    path, files = protocol("reversals", tmp_path, **said, duration=12.0)
    assert [f.name for f in files] == ["reversals.csv"]
    table = np.loadtxt(files[0], delimiter=",", skiprows=2)
    np.testing.assert_allclose(table[:, 1], path, atol=1e-8)
    with pytest.raises(PellucidError, match="found no around"):
        protocol("reversals", tmp_path, **said | {"around": ()})


def test_unknown_without_anything():
    assert Presliding().travel is None
