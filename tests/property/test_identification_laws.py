"""Laws any identification keeps, at many seeded points: scaling, mirroring, order, and the interval's honesty."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))

from motions import motion_of, vector_of

from pellucid.joint.fit.friction_solver import solve_family
from pellucid.models.joint import FAMILIES, joint_model
from pellucid.numerics.regression import stack


def model(family):
    return joint_model(family, motion="rotary", effort_unit="N*m", gravity="sine", velocity_range=2.0)


def truth(**more):
    return vector_of(offset=0.0, load_motoring=0.06, load_generating=0.06, stribeck=0.2, stribeck_velocity=0.15, **more)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("factor", [1e-6, 3.0, 1e4])
def test_efforts_in_another_unit_scale_every_effort_parameter(family, factor):
    motions = [motion_of(truth(), seed=s, effort_sd=0.02) for s in (1, 2)]
    plain = solve_family(model(family), stack(motions))
    scaled = solve_family(model(family), stack([replace(m, effort=factor * m.effort) for m in motions]))
    factors = [factor if "N*m" in s.unit() or "kg" in s.unit() else 1.0 for s in model(family).symbols]
    assert scaled.values / factors == pytest.approx(plain.values, rel=2e-3, abs=1e-5)


@pytest.mark.parametrize("family", FAMILIES)
def test_mirroring_the_joint_swaps_its_directions(family):
    motions = [motion_of(truth(coulomb_negative=0.4, viscous_positive=0.3), seed=s, effort_sd=0.02) for s in (3, 4)]
    mirrored = [
        replace(m, position=-m.position, velocity=-m.velocity, acceleration=-m.acceleration, effort=-m.effort)
        for m in motions
    ]
    which = model(family)
    plain, turned = solve_family(which, stack(motions)), solve_family(which, stack(mirrored))
    swap = {"positive": "negative", "negative": "positive"}
    values = dict(zip(which.names, turned.values, strict=True))
    for name, value in zip(which.names, plain.values, strict=True):
        head, _, tail = name.rpartition("_")
        partner = f"{head}_{swap[tail]}" if tail in swap else name
        expected = -value if name == "offset" else value
        assert values[partner] == pytest.approx(expected, rel=5e-3, abs=1e-5), name


@pytest.mark.parametrize("family", ["symmetric", "directional", "load"])
def test_the_order_of_recordings_does_not_matter(family):
    motions = [motion_of(truth(), seed=s, effort_sd=0.05) for s in (5, 6, 7)]
    forth, back = solve_family(model(family), stack(motions)), solve_family(model(family), stack(motions[::-1]))
    assert forth.values == pytest.approx(back.values, rel=1e-5)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_parameter_is_ever_unphysical(family):
    rng = np.random.default_rng(8)
    for _ in range(5):
        motion = motion_of(truth(), seed=int(rng.integers(1000)))
        noise = replace(motion, effort=motion.effort * 0.1 + rng.standard_normal(len(motion.effort)))
        found = solve_family(model(family), stack([noise]))
        lower, upper = model(family).bounds()
        assert np.all(found.values >= lower)
        assert np.all(found.values <= upper)
