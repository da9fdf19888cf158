"""Inertias that bodies can have: the least of squares among them, and nothing lost where none need be."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from pellucid._errors import IdentificationError
from pellucid.arm.fit.consistent_inertias import (
    MIN_EIGENVALUE,
    FullParametrisation,
    bodies_from_pseudo_inertia,
    least_eigenvalue,
    least_reduced_eigenvalue,
    make_consistent_estimate,
    pseudo_inertia,
    reduced_pseudo_inertia,
    scaled_pseudo_inertia,
    solve_consistent,
    solve_consistent_inertias,
    triangle_matrix,
)
from pellucid.arm.fit.fit_tree import make_tree_estimate
from pellucid.arm.fit.friction_terms import PLAIN_TERMS
from pellucid.arm.fit.inertia_prior import (
    InertiaPrior,
    entropic_solver,
    fit_consistent,
    guessed_bodies,
    log_determinant,
    make_prior,
    prior_covariance,
    solve_with_prior,
)
from pellucid.arm.fit.tree_estimate import FROM_PRIOR_REASON, find_base_parameters, parameter_verdict
from pellucid.arm.fit.tree_regression import TreeModel, collect_rows, fit_rows
from pellucid.arm.tree_motion import TreeMotion
from pellucid.arm.urdf import STAND_IN
from pellucid.models.kinematic_tree import TRIANGLE_MARGIN, Link, Tree, TreeJoint
from pellucid.models.robot import Robot

BAR = Link.about_centre("bar", 2.0, (0.1, 0.0, -0.2), (0.03, 0.0, 0.0, 0.03, 0.001, 0.004))


def test_the_pseudo_inertia_tells_bodies_from_numbers():
    np.testing.assert_allclose(bodies_from_pseudo_inertia(pseudo_inertia(BAR.numbers)), BAR.numbers, atol=1e-15)
    triangles = triangle_matrix() @ BAR.numbers
    assert triangles @ triangles == pytest.approx(np.sum(scaled_pseudo_inertia(BAR.numbers) ** 2))
    # A point's pseudo-inertia has rank 1, a body's as many ways as it has mass in.
    point = Link.about_centre("point", 3.0, (0.2, 0.1, 0.0), (0.0,) * 6)
    assert abs(least_eigenvalue(point.numbers)) < 1e-15
    # One moment larger than the other two together: no body, though all moments are positive.
    odd = Link.about_centre("odd", 1.0, (0.0, 0.0, 0.0), (0.01, 0.0, 0.0, 0.01, 0.0, 0.03))
    assert least_eigenvalue(BAR.numbers) > 0.0
    assert least_eigenvalue(odd.numbers) < -1e-12


def test_a_body_too_near_a_plane_to_have_an_inverse_is_outside():
    """A search that stops there would fail, since rounding decides whether its matrix has an inverse."""
    solid = pseudo_inertia(BAR.numbers)
    flat = np.diag([1.0, 1e-9, 1.0, 1.0]) @ solid @ np.diag([1.0, 1e-9, 1.0, 1.0])
    margin = flat - reduced_pseudo_inertia(bodies_from_pseudo_inertia(flat))
    bodies = bodies_from_pseudo_inertia(np.array([solid, flat + (1.0 + 1e-16) * margin]))
    assert np.isfinite(log_determinant(bodies[:1]))
    assert log_determinant(bodies) == -np.inf


def drawn_sums(rng, truth, rows=40, noise=0.0):
    """Normal equations of drawn columns that show six directions of the ten."""
    ways = rng.normal(size=(rows, 6)) @ rng.normal(size=(6, 10))
    target = ways @ truth + noise * rng.normal(size=rows)
    return ways.T @ ways, ways.T @ target


def test_where_least_squares_is_consistent_nothing_is_lost(rng):
    normal, projected = drawn_sums(rng, BAR.numbers)
    found = solve_consistent_inertias(normal, projected, 1, nearest=BAR.numbers[None])
    assert found.free
    assert found.loss <= 1e-12 * float(projected @ found.values)
    np.testing.assert_allclose(found.values, BAR.numbers, atol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_the_least_is_that_of_a_search_over_bodies_alone(seed):
    rng = np.random.default_rng(seed)
    truth = np.append(rng.normal(size=10), -1.0)  # No body, and friction that pushes
    ways = rng.normal(size=(50, 11))
    target = ways @ truth + 0.1 * rng.normal(size=50)
    lowest = np.append(np.full(10, -np.inf), 0.0)
    found = solve_consistent_inertias(ways.T @ ways, ways.T @ target, 1, lowest=lowest)
    assert not found.free
    assert found.held[0]
    assert found.at_bound[10]
    assert least_eigenvalue(found.values[:10]) >= MIN_EIGENVALUE

    def squares(x):
        # Cholesky factors are exactly the pseudo-inertias; a root of friction.
        low = np.zeros((4, 4))
        low[np.tril_indices(4)] = x[:10]
        p = low @ low.T
        # The trace of the second moments is that of the reduced ones, and three times the reduction.
        reduction = 0.5 * TRIANGLE_MARGIN * np.trace(p[:3, :3]) / (1.0 - 1.5 * TRIANGLE_MARGIN)
        theta = np.append(bodies_from_pseudo_inertia(p + reduction * np.diag([1.0, 1.0, 1.0, 0.0])), x[10] ** 2)
        return float(np.sum((target - ways @ theta) ** 2))

    searched = min(
        minimize(squares, rng.normal(size=11), method="BFGS", options={"maxiter": 3000, "gtol": 1e-7}).fun
        for _ in range(6)
    )
    mine = float(np.sum((target - ways @ found.values) ** 2))
    assert mine == pytest.approx(searched, rel=2e-5)
    best = ways @ np.linalg.lstsq(ways, target, rcond=None)[0]
    assert found.loss == pytest.approx(mine - np.sum((target - best) ** 2), rel=1e-6)


def test_a_weight_draws_towards_the_preferred_bodies(rng):
    normal, projected = drawn_sums(rng, BAR.numbers, noise=0.05)
    other = Link.about_centre("other", 1.0, (0.0, 0.0, -0.1), (0.01, 0.0, 0.0, 0.01, 0.0, 0.01)).numbers
    apart = [
        np.linalg.norm(
            scaled_pseudo_inertia(
                solve_consistent_inertias(normal, projected, 1, nearest=other[None], weight=w).values[:10] - other
            )
        )
        for w in (1.0, 1e3, 1e9)
    ]
    assert apart[0] > apart[1] > apart[2]
    assert apart[2] < 1e-5


def test_bounds_that_contradict_each_other_are_refused():
    with pytest.raises(IdentificationError, match="check the signs of drives and gears"):
        solve_consistent_inertias(
            np.eye(11), np.ones(11), 1, lowest=np.append(np.full(10, -np.inf), 1.0), highest=np.full(11, 0.5)
        )


def two_joints():
    joints = [
        TreeJoint("shoulder", "base", "upper", axis=(0.0, 1.0, 0.0)),
        TreeJoint("elbow", "upper", "lower", axis=(0.0, 1.0, 0.0), place=(0.3, 0.0, 0.0)),
    ]
    upper = Link.about_centre("upper", 2.0, (0.15, 0.0, 0.0), (0.003, 0.0, 0.0, 0.02, 0.0, 0.02))
    lower = Link.about_centre("lower", 1.0, (0.12, 0.0, 0.0), (0.001, 0.0, 0.0, 0.008, 0.0, 0.008))
    return Robot(Tree(joints, [upper, lower]))


def played(robot, rng, noise=0.02, n=1200):
    """Motion of a robot without rotors, its friction and white noise of its effort."""
    t = np.arange(n) * 0.02
    ways = np.array([[0.5, 0.9, 1.7], [0.7, 1.3, 2.1]]) * 2 * np.pi / 6
    phase, size = rng.uniform(0, 2 * np.pi, (2, 3)), np.array([0.6, 0.4, 0.2])
    q, v, a = (
        np.sum(size * ways**k * np.sin(ways * t[:, None, None] + phase + k * np.pi / 2), axis=-1) for k in range(3)
    )
    effort = robot.tree.core.inverse_dynamics(q, v, a) + 0.4 * np.sign(v) + 0.2 * v + noise * rng.normal(size=v.shape)
    return TreeMotion("played", "fit", t, q, v, a, effort, np.abs(v) > 0.02, np.arange(n) * 8 // n)


@pytest.fixture(scope="module")
def identified():
    robot = two_joints()
    rows = collect_rows(robot, [played(robot, np.random.default_rng(5))])
    model = TreeModel(robot, find_base_parameters(robot), (PLAIN_TERMS, PLAIN_TERMS))
    return robot, rows, model


def test_a_robot_of_true_bodies_is_found_again(identified):
    robot, rows, model = identified
    made = FullParametrisation.of(model)
    start, _ = fit_rows(model, rows)
    found, _ = solve_with_prior(model, rows, start=start)
    np.testing.assert_allclose(made.matrix[: len(model.base.names), : len(model.base.members)] @ np.append(
        robot.tree.parameters, [0.0, 0.0]), found.parameters[: len(model.base.names)], atol=0.02)  # fmt: skip
    estimate, _ = fit_consistent(model, rows, start=start)
    assert least_eigenvalue(estimate.links()[:, 12:]).min() >= MIN_EIGENVALUE
    motion = played(robot, np.random.default_rng(6), noise=0.0)
    rms = np.sqrt(np.mean((motion.effort - estimate.effort(motion))[motion.moving] ** 2))
    assert rms < 0.01
    # What this plane does not show is the maker's, and says so; friction is told.
    assert estimate.parameters["lower.inertia_xx"].refused == FROM_PRIOR_REASON
    assert estimate.parameters["lower.inertia_xx"].value == pytest.approx(0.001, abs=5e-4)
    low, high = estimate.interval("elbow.coulomb")
    assert low < 0.4 < high


def test_every_leave_one_out_is_consistent(identified):
    _, rows, model = identified
    found, _ = solve_with_prior(model, rows)
    whole = found.equations.total()
    for s in range(len(found.equations.count)):
        fit = found.solver(found.spread, whole.minus(found.equations.segment(s)), found.sd)
        assert least_eigenvalue(fit.values[:20].reshape(2, 10)).min() >= MIN_EIGENVALUE
        assert np.all(fit.values[20:22] >= 0.0)


def poor_recording(seed):
    """Little motion in much noise, of a robot whose maker is right."""
    robot = two_joints()
    rows = collect_rows(robot, [played(robot, np.random.default_rng(seed), noise=1.5, n=400)])
    return robot, rows, TreeModel(robot, rows.base, (PLAIN_TERMS, PLAIN_TERMS))


def moments_about_the_centre(body):
    """Principal moments of inertia about the centre of mass, in increasing order."""
    centre = body[1:4] / body[0]
    about = np.zeros((3, 3))
    about[np.triu_indices(3)] = body[4:]
    about += np.triu(about, 1).T - body[0] * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.linalg.eigvalsh(about)


def test_a_prior_is_believed_where_the_motion_shows_little():
    robot, rows, model = poor_recording(8)
    estimate, _ = fit_consistent(model, rows)
    assert least_reduced_eigenvalue(estimate.links()[:, 12:]).min() > 0.0
    start, at = fit_rows(model, rows)
    plain = make_tree_estimate("plain", rows, start, at)
    judged = played(robot, np.random.default_rng(9), noise=0.0)
    missed = [np.linalg.norm(judged.effort - e.effort(judged)) for e in (estimate, plain)]
    assert missed[0] < missed[1]
    assert estimate.parameters["upper.mass"].refused == FROM_PRIOR_REASON
    assert estimate.parameters["upper.mass"].value == pytest.approx(2.0, rel=0.3)
    assert not estimate.parameters["elbow.coulomb"].refused


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_a_wrong_prior_does_not_bias_what_the_efforts_determine(identified, factor):
    """Base parameters are as near the truth as those of least squares alone."""
    robot, rows, model = identified
    start, at = fit_rows(model, rows)
    base = make_tree_estimate("base", rows, start, at)
    bodies = factor * FullParametrisation.of(model).maker
    prior = InertiaPrior(bodies, make_prior(model, rows, start).weight, True)
    found = solve_consistent(model, rows, start=start, solver=entropic_solver(prior))
    rigid = len(model.base.names)
    sd = np.sqrt(np.diag(base.covariance))[:rigid]
    truth = model.base.combination[:, :20] @ robot.tree.parameters
    errors = [(values[:rigid] - truth) / sd for values in (found.parameters, start.values)]
    assert np.linalg.norm(errors[0]) < 1.1 * np.linalg.norm(errors[1])
    moved = np.sqrt(np.diag(prior_covariance(found, prior)))
    assert moved[10 + 1] < 0.01 * abs(bodies[1, 1])  # moment_x of the lower link


@pytest.mark.parametrize("factor", [0.6, 1.5])
def test_what_a_wrong_prior_decides_is_not_stated(identified, factor):
    """Masses divide a first moment among the links as the prior does, though the efforts determine the sum."""
    robot, rows, model = identified
    start, _ = fit_rows(model, rows)
    bodies = factor * FullParametrisation.of(model).maker
    prior = InertiaPrior(bodies, make_prior(model, rows, start).weight, True)
    found = solve_consistent(model, rows, start=start, solver=entropic_solver(prior))
    estimate = make_consistent_estimate("consistent", rows, found, prior_covariance(found, prior))
    truth = dict(zip(robot.tree.parameter_names, robot.tree.parameters, strict=True))
    stated = {n: p for n, p in estimate.parameters.items() if n in truth and not p.refused}
    assert "lower.moment_z" in stated
    for parameter in estimate.parameters.values():
        assert (parameter_verdict(parameter) == "from the prior") == (parameter.refused == FROM_PRIOR_REASON)
    assert estimate.parameters["lower.mass"].refused == FROM_PRIOR_REASON
    for name, parameter in stated.items():
        low, high = parameter.interval(0.9999)
        assert low <= truth[name] <= high, name
    own = fit_consistent(model, rows, start=start)[0]
    count = sum(own.parameters[name].refused == FROM_PRIOR_REASON for name in truth)
    assert own.notes[0].startswith(f"{count} of 20 inertial parameters are determined mainly by the prior")


def test_the_entropic_distance_is_least_where_its_slope_is_nothing(identified):
    _, rows, model = identified
    found, _ = solve_with_prior(model, rows)
    maker, weight = found.spread.maker, 50.0
    fit = entropic_solver(InertiaPrior(maker, weight, True))(found.spread, found.equations, found.sd)
    normal, projected = found.spread.sums(found.equations, found.sd)
    back = np.linalg.inv(reduced_pseudo_inertia(maker))

    def objective(x):
        p = reduced_pseudo_inertia(x[:20].reshape(2, 10))
        apart = np.einsum("iab,iba->", p, back) - np.linalg.slogdet(p)[1].sum()
        return 0.5 * x @ normal @ x - projected @ x + 0.5 * weight * apart

    least = objective(fit.values)
    rng = np.random.default_rng(0)
    for _ in range(50):
        moved = fit.values.copy()
        moved[:20] *= 1.0 + 0.02 * rng.normal(size=20)
        assert objective(moved) > least - 1e-9 * abs(least)


def test_principal_moments_keep_a_margin(identified):
    """On the bound too, where least squares asks for points and rods, and with a prior of points."""
    robot, rows, model = identified
    rods = [Link.about_centre(b.name, 1.0, (0.1, 0.0, 0.0), (0.0,) * 6) for b in robot.tree.links]
    slender = Robot(Tree(robot.tree.order, rods))
    rows = collect_rows(slender, [played(slender, np.random.default_rng(4), noise=0.01)])
    for stated in (True, False):
        found, _ = solve_with_prior(replace(model, robot=slender), rows, stated=stated)
        for body in found.fit.values[:20].reshape(2, 10):
            low, middle, high = moments_about_the_centre(body)
            assert low + middle >= (1.0 + 0.999 * TRIANGLE_MARGIN) * high


def test_a_prior_that_is_no_body_is_refused(identified):
    robot, rows, model = identified
    odd = replace(robot.tree.links[1], inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.9))
    wrong = replace(model, robot=Robot(Tree(robot.tree.order, [robot.tree.links[0], odd])))
    with pytest.raises(IdentificationError, match="moments of inertia of body 2 that no body has"):
        fit_consistent(wrong, rows)
    assert fit_consistent(wrong, rows, stated=False)[0].parameters["lower.mass"].value > 0.0


def test_bodies_that_nobody_stated_are_guessed_from_the_joints(identified):
    robot, rows, model = identified
    made = guessed_bodies(robot.tree)
    assert made[0, 1:4] / made[0, 0] == pytest.approx([0.15, 0.0, 0.0])  # halfway to the elbow
    assert np.all(least_reduced_eigenvalue(made) > 0.0)
    bare = Robot(Tree(robot.tree.order, [replace(STAND_IN, name=b.name) for b in robot.tree.links]))
    guess = make_prior(replace(model, robot=bare), rows, fit_rows(model, rows)[0])
    assert not guess.stated
    # One density gives the total mass of 3 kg within a factor of two.
    assert 1.5 < guess.bodies[:, 0].sum() < 6.0
    # Without a unit of the effort, stated bodies have the efforts' scale.
    tenth = replace(rows, effort=0.1 * rows.effort)
    scaled = make_prior(model, tenth, fit_rows(model, tenth)[0], in_si=False)
    assert scaled.bodies[:, 0] == pytest.approx([0.2, 0.1], rel=0.1)


def test_without_noise_the_true_robot_is_found():
    """Rounding does not decide where nothing is determined."""
    robot = two_joints()
    rows = collect_rows(robot, [played(robot, np.random.default_rng(5), noise=0.0)])
    model = TreeModel(robot, rows.base, (PLAIN_TERMS, PLAIN_TERMS))
    found, _ = solve_with_prior(model, rows)
    truth = model.base.combination[:, :20] @ robot.tree.parameters
    np.testing.assert_allclose(found.parameters[: len(truth)], truth, atol=1e-4)
    # A rotor, which is above 0, takes a little of the inertia that its link shares with it.
    np.testing.assert_allclose(found.fit.values[:20], robot.tree.parameters, atol=0.02 * 2.0)
