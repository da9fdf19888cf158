"""The proof of coverage counts what it says: intervals that hold, those refused, and friction that is compensated."""

from dataclasses import replace

import numpy as np
import pytest
from research.evidence._foreign_joint import ForeignJoint
from research.evidence._foreign_plants import record_plant
from research.evidence.coverage import (
    Elbow,
    bench_identified,
    bench_rows,
    drawn_benches,
    elbow_rows,
    exact_errors,
    identified,
)

from pellucid.models.estimates import Parameter
from pellucid_lab.elbow.rig import able_elbow

NAMES = ("inertia", "gravity", "load_motoring", "load_generating")


def elbow(error, half=0.2, refused="", exceeds=False):
    made = {
        n: Parameter(n, "1", 1.0 + error, half / 1.959964, statistical_error=0.5 * half, refused=refused) for n in NAMES
    }
    return Elbow(made, dict.fromkeys(NAMES, 1.0), exceeds, 0.8)


def figures(found):
    return {row.id: row.value for row in elbow_rows(found)}


def test_intervals_that_miss_are_counted_and_those_refused_are_not():
    found = [elbow(0.1), elbow(-0.1), elbow(0.3), elbow(0.3, refused="all of it"), elbow(0.1, exceeds=True)]
    seen = figures(found)
    assert seen["coverage.misspecified.inertia"] == pytest.approx(75.0)
    assert seen["coverage.misspecified.lowest"] == pytest.approx(75.0)
    assert seen["coverage.misspecified.refused.highest"] == pytest.approx(20.0)
    assert seen["coverage.width_over_rmse.highest"] == pytest.approx(0.2 / np.sqrt(0.03))
    assert seen["deployed.exceeds_truth"] == pytest.approx(20.0)
    assert seen["deployed.compensated_share"] == pytest.approx(80.0)


def test_one_elbow_is_identified_against_its_own_targets():
    rig = able_elbow()
    made = identified(rig, 1)
    assert made.targets["inertia"] == rig.inertia(0.0)
    assert 0.14 < made.targets["load_motoring"] < 0.14 * 1.3
    assert not made.exceeds
    assert made.carried > 0.5
    for name in NAMES:
        p = made.parameters[name]
        assert p.statistical_error < p.standard_error
        assert abs(p.value - made.targets[name]) <= 1.96 * p.standard_error


def test_one_bench_is_identified_against_its_own_targets():
    rig = drawn_benches(1, seed=7)[0].changed({"sampling.duration": 10.0})
    found = bench_identified(rig, 1)
    assert found["inertia"][1] == rig["joint"]["inertia"]
    for p, target in found.values():
        assert abs(p.value - target) <= 1.96 * p.standard_error
    seen = {row.id: row.value for row in bench_rows([found])}
    assert seen["coverage.bench.lowest"] == 100.0
    assert seen["coverage.bench.refused.highest"] == 0.0


@pytest.mark.parametrize(("engine", "module"), [("mujoco", "mujoco"), ("pinocchio", "pinocchio")])
def test_plants_of_other_programs_are_the_drawn_joints(engine, module):
    pytest.importorskip(module)
    joint = ForeignJoint(0.2, 5.0, 0.3, 0.4, bristle=200.0, load=0.05 * (engine == "pinocchio"))
    exact = replace(joint, position_noise=0.0, torque_noise=0.0)
    t, q, torque = record_plant(engine, exact, np.random.default_rng(3), 6.0).T
    v = np.gradient(q, t)
    a = np.gradient(v, t)
    load = joint.inertia * a + joint.gravity * np.sin(q)
    rubbing = joint.viscous * v + (joint.coulomb + joint.load * np.abs(load)) * np.sign(v)
    # Fast enough, both engines' friction is that of the drawn joint.
    fast = np.abs(v) > 0.3
    fast[:20] = fast[-20:] = False
    assert fast.sum() > 500
    assert np.sqrt(np.mean((torque - load - rubbing)[fast] ** 2)) < 0.02 * joint.gravity


def test_exact_least_squares_errs_as_it_says():
    rng, joint = np.random.default_rng(4), ForeignJoint(0.2, 5.0, 0.3, 0.4)
    t = np.arange(4000) / 500.0
    q = 0.6 * np.sin(2.0 * t) + 0.3 * np.sin(5.3 * t)
    v = np.gradient(q, t)
    errors = exact_errors(joint, np.column_stack([t, q, np.zeros_like(q)]))
    used = np.abs(v) > 0.05
    used[:100] = used[-100:] = False
    w = np.column_stack([np.gradient(v, t), np.sin(q), v, np.sign(v), np.ones_like(q)])[used]
    noise = joint.torque_noise * 0.1 * joint.gravity
    found = [np.linalg.lstsq(w, noise * rng.standard_normal(len(w)), rcond=None)[0][:4] for _ in range(200)]
    assert np.std(found, axis=0) == pytest.approx(list(errors.values()), rel=0.2)
