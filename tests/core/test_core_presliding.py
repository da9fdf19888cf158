"""Friction below slip against plain Python, and against the model that was not chosen."""

import numpy as np
import numpy_reference as reference
import pytest
from test_core_plant import LOOPS, signals

from pellucid import _core

TRAVEL = 4e-3


@pytest.mark.parametrize("stiction", [False, True])
@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS)
def test_plant_is_that_of_python(loop, stiction, rng):
    settings = dict(
        period=1e-3, substeps=5, encoder_quantum=2e-4, ripple_amplitude=0.05, ripple_wave_number=14.0, ripple_phase=0.4,
        position0=0.1, velocity0=-0.2, stiction=stiction, presliding_travel=TRAVEL, **loop, **signals(400, 1e-3, rng),
    )  # fmt: skip
    got = _core.simulate(reference.parameters(), **settings)
    wanted = reference.simulate(reference.parameters(), **settings)
    for one, other in zip(got, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-7)
    plain = _core.simulate(reference.parameters(), **settings | {"presliding_travel": 0.0})
    assert np.abs(plain[0] - got[0]).max() > 1e-6


def test_batch_mixes_travels(rng):
    """Lanes that slip at once keep their bits beside lanes that do not."""
    p = np.array([reference.random_parameters(rng) for _ in range(19)])
    settings = dict(period=1e-3, loop="p", kp=20.0, stiction=True, reference=0.3 * np.sin(0.02 * np.arange(300)))
    travels = np.where(np.arange(19) % 3, TRAVEL * rng.uniform(0.2, 2, 19), 0.0)
    many = _core.simulate_batch(p, presliding_travel=travels, **settings)
    for i, travel in enumerate(travels):
        one = _core.simulate(p[i], presliding_travel=travel, **settings)
        without = _core.simulate(p[i], **settings)
        for a, b, c in zip(one, many, without, strict=True):
            np.testing.assert_array_equal(a, b[i])
            assert travel or np.array_equal(a, c)


def test_along_a_way(rng):
    way = np.cumsum(rng.normal(size=2000) * TRAVEL / 5)
    contact = reference.Presliding(TRAVEL)
    wanted = [contact.step(step) for step in np.diff(way, prepend=way[0])]
    np.testing.assert_allclose(_core.presliding(TRAVEL, way), wanted, atol=1e-12)
    assert not _core.presliding(0.0, way).any()
    broken = way.copy()
    broken[700] = np.nan
    s = _core.presliding(TRAVEL, broken)
    assert np.isfinite(s).all()
    assert s[699] == s[700] == s[701]


def test_lugre_agrees_while_the_way_is_one():
    """From rest, a parabola of 2.79 lengths is nearest its exponential; back from slip, where this model's way doubles
    and that one's does not, one of half as much."""
    length = TRAVEL / 2.79
    way = np.linspace(0, 5 * length, 2001)
    assert np.abs(_core.presliding(TRAVEL, way) - reference.lugre(way, length)).max() < 0.08
    turned = 20 * length - np.concatenate([np.linspace(20 * length, 0, 2001), way])
    ours, other = _core.presliding(TRAVEL / 2, turned)[2000:], reference.lugre(turned, length)[2000:]
    assert ours[0] == pytest.approx(other[0], abs=1e-6)
    assert np.abs(ours - other).max() < 0.16


def test_lugre_forgets_a_loop_within_a_loop():
    """Why it is the check and not the model: the inner loop does not close, so a swinging effort makes it drift."""
    out, back = np.linspace(0, 0.7, 400), np.linspace(0.7, 0.2, 400)
    inner = np.concatenate([np.linspace(0.2, 0.4, 400), np.linspace(0.4, 0.2, 400)])
    way = TRAVEL * np.concatenate([out, back, *[inner] * 5])
    turned = 799 + 800 * np.arange(6)
    ours, other = _core.presliding(TRAVEL, way)[turned], reference.lugre(way, TRAVEL / 2.79)[turned]
    np.testing.assert_allclose(ours, ours[0], atol=1e-12)
    assert abs(other[1] - other[0]) > 0.03


def test_swinging_effort_drifts_in_lugre_alone():
    """A mass under half the level and a swing of a third of it: where it stands after each period."""
    level, inertia, viscous, travel = 0.5, 0.05, 0.2, 1e-3
    t = 1e-4 * np.arange(100_000)
    effort = level * (0.5 + 0.35 * np.sin(2 * np.pi * 2 * t))
    p = reference.parameters(
        inertia=inertia, gravity_sine=0.0, gravity_cosine=0.0, offset=0.0, coulomb_positive=level,
        coulomb_negative=level, viscous_positive=viscous, viscous_negative=viscous, stribeck=0.0, load_motoring=0.0,
        load_generating=0.0,
    )  # fmt: skip
    ours = _core.simulate(p, reference=effort, period=1e-4, substeps=1, presliding_travel=travel)[0]
    q = v = s = 0.0
    other = []
    for u in effort:
        other.append(q)
        v += 1e-4 / inertia * (u - viscous * v - level * s)
        q += 1e-4 * v
        s = np.sign(v) + (s - np.sign(v)) * np.exp(-2 * abs(v) * 1e-4 / travel)
    after = np.arange(50_000, 100_000, 5_000)  # when what the start has struck has rung down
    drifts = np.ptp(np.array(other)[after]) / travel
    assert drifts > 0.3
    assert np.ptp(ours[after]) / travel < 1e-6
    assert ours[-1] > 0.1 * travel


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 1e-300])
def test_travels_that_are_none_end(value):
    p, settings = reference.parameters(), dict(reference=np.ones(50), period=1e-3, stiction=True)
    for one, other in zip(
        _core.simulate(p, presliding_travel=value, **settings), _core.simulate(p, **settings), strict=True
    ):
        np.testing.assert_array_equal(one, other)


def test_a_geared_plant_does_not_take_it():
    with pytest.raises(TypeError, match="presliding_travel"):
        _core.simulate_geared(
            np.ones((1, len(_core.GEARED_PARAMETER_NAMES))), reference=np.ones(3), period=1e-3, presliding_travel=1e-3
        )
