"""Models of several muscles: what is free drives what it says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid.emg.models.hill import FREE_QUANTITIES, MUSCLE_QUANTITIES, FreeParameter, HillData, HillModel, HillMuscle

MUSCLES = (
    HillMuscle("vastus_lateralis", 0.084, 0.157, 1871.0, 0.087),
    HillMuscle("vastus_medialis", 0.089, 0.126, 1294.0, 0.087),
    HillMuscle("rectus_femoris", 0.114, 0.310, 1169.0, 0.087),
)
BOTH = ("vastus_lateralis", "vastus_medialis")
FREED = (
    FreeParameter("shape", "shape", tuple(m.name for m in MUSCLES), -3.0, 0.0),
    FreeParameter("fibres", "optimal_fibre_length", BOTH, 0.8, 1.2, relative=True),
    FreeParameter("strength.rectus_femoris", "strength", ("rectus_femoris",), 0.5, 2.0),
)


@pytest.fixture
def data(rng):
    t = 2e-3 * np.arange(900)
    phase = np.array([[0.0], [0.4], [1.0]])
    slack = np.array([[m.tendon_slack_length] for m in MUSCLES])
    optimal = np.array([[m.optimal_fibre_length] for m in MUSCLES])
    return HillData(
        0.4 + 0.3 * np.sin(6.0 * t + phase),
        slack + optimal * (1.05 + 0.2 * np.sin(4.0 * t)),
        optimal * 0.8 * np.cos(4.0 * t),
        np.full((3, 900), 0.04),
        2e-3,
        (0, 400),
    )


def test_quantities_are_the_cores():
    assert MUSCLE_QUANTITIES[:11] == FREE_QUANTITIES
    assert MUSCLES[0].vector()[MUSCLE_QUANTITIES.index("max_isometric_force")] == 1871.0
    assert [getattr(MUSCLES[0], q) for q in MUSCLE_QUANTITIES] == MUSCLES[0].vector().tolist()


def test_free_values_drive_what_they_name():
    model = HillModel(MUSCLES, FREED)
    assert model.names == ("shape", "fibres", "strength.rectus_femoris")
    assert model.start.tolist() == [-1.0, 1.0, 1.0]
    assert [b.tolist() for b in model.bounds] == [[-3.0, 0.8, 0.5], [0.0, 1.2, 2.0]]
    made = model.with_values([-2.0, 1.1, 0.7])
    assert [m.shape for m in made] == [-2.0] * 3
    assert [m.optimal_fibre_length for m in made] == pytest.approx([0.0924, 0.0979, 0.114])
    assert [m.strength for m in made] == [1.0, 1.0, 0.7]
    np.testing.assert_array_equal(model.parameters(model.start), [m.vector() for m in MUSCLES])


def test_jacobian_is_of_the_free_values(data):
    model = HillModel(MUSCLES, FREED)
    values = np.array([-1.7, 1.04, 1.2])
    torque, jacobian = model.jacobian(data, values)
    np.testing.assert_array_equal(torque, model.torque(data, values))
    for j, h in enumerate((1e-5, 1e-6, 1e-5)):
        step = h * np.eye(3)[j]
        expected = (model.torque(data, values + step) - model.torque(data, values - step)) / (2 * h)
        np.testing.assert_allclose(jacobian[j], expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


def test_least_squares_steps_find_the_values_again(data):
    """Gauss-Newton on the normal equations alone."""
    model = HillModel(MUSCLES, FREED)
    truth = np.array([-1.3, 1.07, 0.8])
    measured = model.torque(data, truth)
    values = model.start
    for _ in range(12):
        cost, gradient, normal = model.normal(data, values, measured)
        values = values - np.linalg.solve(normal, gradient)
    assert values == pytest.approx(truth, rel=1e-8)
    assert cost < 1e-12


def test_samples_of_no_weight_say_nothing(data):
    model = HillModel(MUSCLES, FREED)
    measured = model.torque(data, [-1.3, 1.07, 0.8])
    weight = np.ones(900)
    weight[:300] = 0.0
    spoilt = np.where(weight > 0, measured, 1e6)
    cost, gradient, _ = model.normal(data, np.array([-1.3, 1.07, 0.8]), spoilt, weight)
    assert cost < 1e-20
    assert np.abs(gradient).max() < 1e-8


def test_the_estimator_is_the_same_model(data):
    model = HillModel(MUSCLES, FREED)
    values = [-2.0, 1.1, 0.7]
    estimator = model.estimator(data.period, values)
    whole = model.torque(data, values)
    first = [np.ascontiguousarray(x[:, :400]) for x in data.arrays]
    np.testing.assert_array_equal(estimator.run(*first), whole[:400])
    states = model.states(data, values)
    np.testing.assert_allclose((data.moment_arm * states["force"]).sum(axis=0), whole, rtol=1e-12)
    # 20 ms of delay, and two lags of 20 ms, each short by half a period.
    assert estimator.delays == pytest.approx([0.058] * 3, abs=1e-4)


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ((FreeParameter("x", "pennation", BOTH, 0, 1),), "pennation"),
        ((FreeParameter("x", "shape", ("soleus",), 0, 1),), "soleus"),
        ((FreeParameter("x", "shape", (), 0, 1),), "nothing"),
        ((FREED[0], FreeParameter("again", "shape", BOTH, -3, 0)), "which shape already sets"),
    ],
)
def test_what_cannot_be_freed(free, message):
    with pytest.raises(ValueError, match=message):
        HillModel(MUSCLES, free)


def test_names_are_told_apart():
    with pytest.raises(ValueError, match="once"):
        HillModel((MUSCLES[0], MUSCLES[0]))


def test_several_joints_are_each_joint_by_itself_to_the_bit(data, rng):
    """One pass over the forces; torque, derivatives and normal equations of each joint by its own arms."""
    model, values = HillModel(MUSCLES, FREED), np.array([-1.7, 1.04, 1.2])
    arms = np.stack((data.moment_arm, rng.normal(0.0, 0.03, data.moment_arm.shape)))
    arms[1, 0] = 0.0
    both = replace(data, moment_arm=arms)
    torque, jacobian = model.jacobian(both, values)
    assert torque.shape == (2, 900)
    assert jacobian.shape == (3, 2, 900)
    np.testing.assert_array_equal(model.torque(both, values), torque)
    measured, weight = rng.normal(0.0, 20.0, (2, 900)), rng.uniform(0.0, 1.0, (2, 900))
    cost, gradient, normal = model.normal(both, values, measured, weight)
    alone = []
    for j in range(2):
        own = replace(data, moment_arm=arms[j])
        for found, each in zip((torque[j], jacobian[:, j]), model.jacobian(own, values), strict=True):
            np.testing.assert_array_equal(found, each)
        alone.append(model.normal(own, values, measured[j], weight[j]))
    assert cost == pytest.approx(sum(a[0] for a in alone), rel=1e-12)
    np.testing.assert_allclose(gradient, sum(a[1] for a in alone), rtol=1e-10)
    np.testing.assert_allclose(normal, sum(a[2] for a in alone), rtol=1e-10)


def test_arms_of_other_joints_must_fit_the_muscles(data):
    model = HillModel(MUSCLES)
    for arms, message in ((np.zeros((2, 2, 900)), r"\(2, 3, 900\)"), (np.zeros((9, 3, 900)), "from 1 to 8")):
        with pytest.raises(ValueError, match=message):
            model.torque(replace(data, moment_arm=arms))
