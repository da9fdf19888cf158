"""What must hold for every muscle, whatever its numbers are."""

import dataclasses

import numpy as np
import pytest

from pellucid import _core
from pellucid.emg.models.hill import HillData, HillModel, HillMuscle

N = 600


def random_muscle(rng, **fixed):
    made = HillMuscle(
        "m",
        rng.uniform(0.04, 0.2),
        rng.uniform(0.1, 0.4),
        rng.uniform(300, 3000),
        rng.uniform(0, 0.4),
        shape=rng.uniform(-3, 0),
        time_constant_1=rng.uniform(0, 0.06),
        time_constant_2=rng.uniform(0, 0.06),
        delay=rng.uniform(0, 0.1),
        optimal_length_shift=rng.uniform(0, 0.25),
        max_velocity=rng.uniform(3, 15),
        curvature=rng.uniform(0.15, 0.4),
        eccentric_force=rng.uniform(1.2, 1.8),
        damping=rng.uniform(0, 0.2),
    )
    return dataclasses.replace(made, **fixed)


def states(muscle, excitation, stretch, speed):
    """`stretch` in l_o beyond the slack tendon, `speed` in v_max."""
    along = muscle.tendon_slack_length + muscle.optimal_fibre_length * np.broadcast_to(stretch, (1, N))
    rate = muscle.optimal_fibre_length * muscle.max_velocity * np.broadcast_to(speed, (1, N))
    data = HillData(np.broadcast_to(excitation, (1, N)), along, rate, np.ones((1, N)), 1e-3)
    return {name: value[0] for name, value in HillModel([muscle]).states(data).items()}


@pytest.mark.parametrize("seed", range(40))
def test_activation_stays_a_share_and_force_pulls(seed):
    rng = np.random.default_rng(seed)
    muscle = random_muscle(rng)
    made = states(muscle, rng.uniform(-1, 2, N), rng.uniform(-0.3, 2.0, N), rng.uniform(-2, 2, N))
    assert made["activation"].min() >= 0.0
    assert made["activation"].max() <= 1.0
    assert made["force"].min() >= 0.0
    assert np.isfinite(made["force"]).all()


@pytest.mark.parametrize("seed", range(20))
def test_steady_effort_is_activation_of_its_size(seed):
    rng = np.random.default_rng(seed)
    muscle = random_muscle(rng)
    for effort in (0.0, rng.uniform(), 1.0):
        envelope = np.r_[rng.uniform(0, 1, 50), np.full(N - 50, effort)]
        last = states(dataclasses.replace(muscle, time_constant_1=0.01, time_constant_2=0.02), envelope, 1.0, 0.0)
        expected = effort if muscle.shape == 0 else np.expm1(muscle.shape * effort) / np.expm1(muscle.shape)
        assert last["activation"][-1] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_more_effort_or_lengthening_pulls_harder(seed):
    rng = np.random.default_rng(seed)
    muscle = random_muscle(rng, optimal_length_shift=0.0, time_constant_1=0.0, time_constant_2=0.0, delay=0.0)
    force = states(muscle, np.linspace(0, 1, N), 1.1, 0.3)["force"]
    assert (np.diff(force) >= -1e-9).all()
    force = states(muscle, 0.7, 0.9, np.linspace(-1.5, 1.5, N))["force"]
    assert (np.diff(force) >= -1e-9).all()


@pytest.mark.parametrize("seed", range(20))
def test_damping_takes_power(seed):
    """What damping adds to the force resists the fibre's motion."""
    rng = np.random.default_rng(seed)
    muscle = random_muscle(rng, damping=0.1)
    given = rng.uniform(0.2, 1, N), rng.uniform(0.6, 1.5, N), rng.uniform(-0.8, 0.8, N)
    damped, free = (states(dataclasses.replace(muscle, damping=d), *given) for d in (0.1, 0.0))
    assert ((damped["force"] - free["force"]) * damped["fibre_velocity"] >= 0.0).all()


@pytest.mark.parametrize("seed", range(20))
def test_a_slack_passive_muscle_is_silent(seed):
    rng = np.random.default_rng(seed)
    muscle = random_muscle(rng, damping=0.0)
    short = np.cos(muscle.pennation) * rng.uniform(0.2, 0.99, N)
    assert not states(muscle, 0.0, short, rng.uniform(-1, 1, N))["force"].any()
    assert states(muscle, 0.0, 1.3, 0.0)["force"].min() > 0.0


@pytest.mark.parametrize("seed", range(8))
def test_a_passive_elastic_muscle_gives_back_no_more_than_it_took(seed):
    """Stretched in a cycle and brought back without activation: springs return, damping keeps."""
    rng = np.random.default_rng(seed)
    muscle = random_muscle(rng, damping=0.1)
    t = 1e-3 * np.arange(4001)
    stretch = 0.5 + 1.2 * 0.5 * (1.0 - np.cos(np.pi * t))
    length = muscle.tendon_slack_length + muscle.optimal_fibre_length * stretch
    core = _core.ElasticMuscle(muscle.vector(), tendon_strain=0.04, period=1e-3)
    core.rest(0.0, length[0])
    force, _ = core.run(np.zeros_like(t), length)
    work = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(length))
    assert work > 0.0
