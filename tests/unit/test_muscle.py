"""One muscle over arrays: against the core, against the model's equations, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError

MUSCLE = pl.Muscle(
    max_isometric_force=1200.0, optimal_fibre_length=0.08, tendon_slack_length=0.15, pennation=0.2, damping=0.05
)
ELASTIC = replace(MUSCLE, tendon_strain=0.033)


def test_force_is_the_equation():
    """Without passive force: F_0 a f_l f_v cos(phi), written out."""
    a, length, velocity = 0.6, 0.15 + np.array([0.05, 0.06, 0.07]), np.array([[-0.2], [-0.05]])
    muscle = replace(MUSCLE, damping=0.0)
    along = length - 0.15
    fibre = np.hypot(along, 0.08 * np.sin(0.2))
    cosine = along / fibre
    shape = np.exp(-((fibre / (0.08 * (0.15 * 0.4 + 1.0)) - 1.0) ** 2) / 0.45)
    slow = velocity * cosine / 0.8
    expected = 1200.0 * a * shape * (1.0 + slow) / (1.0 - slow / 0.25) * cosine
    found = muscle.force(a, length, velocity)
    assert found.shape == (2, 3)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert muscle.force(a, 0.22).shape == ()


def test_a_missing_sample_stays_where_it_is():
    found = MUSCLE.force([0.5, np.nan, 0.5], 0.22)
    assert np.isnan(found[1])
    assert found[0] == found[2] > 0.0
    assert np.isnan(ELASTIC.force([0.5, np.nan], 0.22)[1])


def test_an_elastic_tendon_rests_where_simulation_ends():
    length, active = np.full(3000, 0.235), np.full(3000, 0.7)
    force, fibre = ELASTIC.simulate(active, length, period=1e-3)
    assert force[-1] == pytest.approx(float(ELASTIC.force(0.7, 0.235)), rel=1e-6)
    stiff = replace(ELASTIC, tendon_strain=1e-5)
    assert float(stiff.force(0.7, 0.235)) == pytest.approx(float(MUSCLE.force(0.7, 0.235)), rel=1e-3)
    assert force[-1] < float(MUSCLE.force(0.7, 0.235)) * 1.2
    assert 0.03 < fibre[-1] < 0.1


def test_a_rigid_tendon_is_simulated_with_the_lengths_own_speed():
    t = 1e-3 * np.arange(500)
    length = 0.23 + 0.01 * np.sin(6.0 * t)
    force, fibre = MUSCLE.simulate(0.5, length, period=1e-3)
    np.testing.assert_allclose(force, MUSCLE.force(0.5, length, np.gradient(length, 1e-3)))
    np.testing.assert_allclose(fibre, np.hypot(length - 0.15, 0.08 * np.sin(0.2)))


def test_curves_of_the_fibre():
    x = np.linspace(0.6, 1.5, 10)
    np.testing.assert_allclose(MUSCLE.force_length(x), np.exp(-((x - 1.0) ** 2) / 0.45), rtol=1e-12)
    assert MUSCLE.force_velocity([-1.5, -1.0, 0.0]).tolist() == [0.0, 0.0, 1.0]
    assert np.all(np.diff(MUSCLE.force_velocity(np.linspace(-1.0, 1.0, 50))) > 0.0)
    passive = MUSCLE.passive_force_length([[0.5, 1.0], [1.6, 2.0]])
    assert passive.shape == (2, 2)
    assert passive[0].tolist() == [0.0, 0.0]
    assert passive[1, 0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"max_isometric_force": 0.0}, "max_isometric_force: found 0.0, expected a finite number above 0"),
        ({"optimal_fibre_length": np.nan}, "optimal_fibre_length: found nan"),
        ({"damping": -1.0}, "damping: found -1.0, expected a finite number of at least 0"),
        ({"pennation": 2.0}, "pennation: found 2 rad"),
        ({"tendon_strain": 0.03, "tendon_slack_length": 0.0}, "tendon_slack_length: found 0.0"),
    ],
)
def test_numbers_out_of_range_are_refused(change, said):
    with pytest.raises(PellucidError, match=said):
        replace(MUSCLE, **change)


def test_what_does_not_fit_is_refused():
    with pytest.raises(PellucidError, match=r"the shapes \[\(2,\), \(3,\), \(\)\], expected ones that broadcast"):
        MUSCLE.force([0.1, 0.2], [0.2, 0.21, 0.22])
    with pytest.raises(PellucidError, match=r"use simulate\(activation, length, period=\)"):
        ELASTIC.force(1.0, 0.23, 0.1)
    with pytest.raises(PellucidError, match=r"expected \(n,\) of both"):
        MUSCLE.simulate([0.1, 0.2], [0.2, 0.21, 0.22], period=1e-3)
    with pytest.raises(PellucidError, match="activation: "):
        MUSCLE.activation([[1.0]], period=1e-3)
