"""A robot from arrays: predicted, simulated and scored; wrong types, units and signs of its arguments are named."""

import numpy as np
import pytest

import pellucid as pl
from pellucid import _core
from pellucid._errors import ArgumentError, PellucidError
from pellucid.arm.fit.consistent_inertias import least_reduced_eigenvalue
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.robot import Robot
from pellucid.start.inference.processing_choice import choose_processing

RATE = 200.0
NAMES = ("shoulder", "elbow")
FRICTION = {"coulomb_positive": 0.8, "coulomb_negative": 0.8, "viscous_positive": 0.3, "viscous_negative": 0.3}
OPTIONS = {"lowpass": "10 Hz", "decimate": 5, "dead_band": 0.1, "plain": True}
URDF = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 -0.2"/><mass value="1.0"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><origin xyz="0 0 -0.2"/><mass value="1.0"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0 0 -0.4"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>"""


@pytest.fixture(scope="module")
def robot():
    joints = [
        TreeJoint("shoulder", "base", "upper", axis=(0.0, 1.0, 0.0)),
        TreeJoint("elbow", "upper", "fore", axis=(0.0, 1.0, 0.0), place=(0.0, 0.0, -0.4)),
    ]
    bodies = [
        Link.about_centre(name, 1.0, (0.0, 0.0, -0.2), (0.02, 0.0, 0.0, 0.02, 0.0, 0.01)) for name in ("upper", "fore")
    ]
    return Robot(Tree(joints, bodies))


def plant(robot, period=1.0 / RATE):
    rows = np.zeros((2, len(_core.TREE_JOINT_PARAMETER_NAMES)))
    for name, value in FRICTION.items():
        rows[:, _core.TREE_JOINT_PARAMETER_NAMES.index(name)] = value
    return _core.DrivenTree(robot.tree.links_array, robot.tree.gravity, rows, period=period, substeps=20)


def swing(robot, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 30.0, 1.0 / RATE)
    w = 2.0 * np.pi * np.array([0.13, 0.37, 0.8])
    phase = time[:, None, None] * w + rng.uniform(0.0, 2.0 * np.pi, (2, 3))
    size = np.array([0.6, 0.3, 0.15])
    q, v, a = np.sin(phase) @ size, np.cos(phase) @ (size * w), -np.sin(phase) @ (size * w**2)
    effort = plant(robot).motor_effort(q, v, a) + 0.01 * rng.standard_normal(q.shape)
    return {"time": time, "position": q, "effort": effort}


@pytest.fixture(scope="module")
def recorded(robot):
    return swing(robot, 1)


@pytest.fixture(scope="module")
def fit(robot, recorded):
    return pl.fit_robot(robot, recorded, **OPTIONS)


def test_friction_passes_the_filter_of_the_effort(robot):
    """Where a joint turns, the low-pass rounds the jump of the effort. A sharp one would bias friction."""
    plain = pl.fit_robot(robot, [swing(robot, seed) for seed in (1, 2)], lowpass=10.0, decimate=5, held_out=[1])
    assert not [name for name in plain if name.endswith(("square_root", "stribeck", "load"))]
    assert plain.heldout_effort_error < 1.0
    for joint in NAMES:
        for name, true in (("coulomb", 0.8), ("viscous", 0.3)):
            assert plain[f"{joint}.{name}"].value == pytest.approx(true, rel=0.02)


def test_a_proposed_filter_predicts_as_well_as_one_that_was_chosen(robot):
    """What `init` and `try` propose leaves out the samples over which the low-pass settles, as `fit_robot` does."""
    recorded = [swing(robot, seed) for seed in (1, 2)]
    choice = choose_processing(recorded[0]["position"][:, 1] + 1e-4 * np.sin(1e4 * recorded[0]["time"]), RATE)
    own = {"lowpass": choice.lowpass, "decimate": choice.decimate, "held_out": [1], "plain": True}
    errors = [pl.fit_robot(robot, recorded, trim=trim, **own).heldout_effort_error for trim in (choice.trim, None)]
    assert errors[0] == pytest.approx(errors[1], rel=0.05)


def sprung(robot, seed, joint, stiffness):
    recorded = swing(robot, seed)
    recorded["effort"][:, joint] += stiffness * (recorded["position"][:, joint] - 0.1)
    return recorded


@pytest.mark.parametrize(("joint", "stiffness"), [(1, 0.3), (1, 2.5), (0, 2.0), (1, -0.4)])
def test_a_parallel_spring_is_named_with_its_joint_and_is_no_gravity(robot, fit, joint, stiffness):
    """A spring at the elbow of 2.5 N*m/rad exceeds the elbow's gravity, and is no effort of the other sign."""
    options = OPTIONS | {"plain": False}
    found = pl.fit_robot(robot, [sprung(robot, seed, joint, stiffness) for seed in (1, 2)], held_out=[1], **options)
    (cause,) = found.causes
    assert (cause.name, cause.joint, cause.unit) == ("parallel_spring", NAMES[joint], "N*m/rad")
    low, high = found[f"{NAMES[joint]}.parallel_stiffness"].interval(0.95)
    assert low <= stiffness <= high
    assert (cause.size, 2.0 * cause.half_width) == pytest.approx((0.5 * (low + high), high - low))
    assert 0.1 < cause.share <= 1.0
    assert found.heldout_effort_error < 1.0
    assert found["fore.moment_z"].value == pytest.approx(fit["fore.moment_z"].value, rel=0.02)
    said = f"At {NAMES[joint]}, a parallel spring of "
    assert said in str(found)
    assert f"{100.0 * cause.share:.0f} % of the residual" in str(found)
    # Pushed by the effort of a recorded motion, the simulated robot moves as the recorded one.
    recorded = sprung(robot, 1, joint, stiffness)
    time, position = (recorded[key][:400] for key in ("time", "position"))
    speed = np.gradient(position, time, axis=0)
    made = found.simulate(time, recorded["effort"][:400], position[0], speed[0])
    assert np.abs(made.position - position).max() < 0.1


def test_a_plain_robot_has_no_cause_and_one_with_a_late_effort_has(robot, fit):
    assert fit.causes == ()
    recorded = swing(robot, 1)
    late = recorded["effort"].copy()
    late[4:, 1] = recorded["effort"][:-4, 1]
    (cause,) = pl.fit_robot(robot, recorded | {"effort": late}, **(OPTIONS | {"plain": False})).causes
    assert (cause.name, cause.joint, cause.unit) == ("delay", "elbow", "s")
    assert cause.size == pytest.approx(4.0 / RATE, rel=0.25)


@pytest.mark.parametrize("spoil", ["drift", "position_friction", "saturation"])
def test_what_else_is_wrong_at_a_joint_is_named(robot, spoil):
    recorded = swing(robot, 1)
    time, position, effort = (recorded[key] for key in ("time", "position", "effort"))
    speed = np.gradient(position[:, 1], time)
    if spoil == "drift":
        effort[:, 1] += 0.5 * time / time[-1]
    elif spoil == "position_friction":
        effort[:, 1] += 0.5 * np.tanh(speed / 0.01) * position[:, 1]
    else:
        effort[:, 1] = np.clip(effort[:, 1], -1.6, 1.6)
    causes = pl.fit_robot(robot, recorded, **(OPTIONS | {"plain": False})).causes
    assert [(cause.name, cause.joint) for cause in causes] == [(spoil, "elbow")]


def test_no_bodies_cost_less_than_the_nearest_ones(robot):
    """A spring at the elbow asks for bodies that cannot be. Those near the description are not the nearest ones."""
    recorded = swing(robot, 1)
    recorded["effort"][:, 1] += 0.6 * recorded["position"][:, 1]
    said = str(pl.fit_robot(robot, recorded, **OPTIONS).consistent)
    parts = said.split("residuals by")[1], said.split("it is")[1]
    nearest, own = (float(part.split(" %")[0].split()[-1]) for part in parts)
    assert 0.0 < nearest <= own


def test_it_predicts_at_full_rate_and_is_scored_on_others(fit, robot, recorded):
    predicted = fit.predict(recorded["time"], recorded["position"])
    assert predicted.shape == recorded["effort"].shape
    inner = slice(100, -100)
    assert np.std((predicted - recorded["effort"])[inner]) < 0.2
    score = fit.score([swing(robot, 2), swing(robot, 3)])
    assert list(score.errors) == list(score.r2) == list(NAMES)
    assert 0.0 < score.mean_error < 5.0
    assert min(score.r2.values()) > 0.98


def test_held_out_recordings_are_not_fitted_and_test_each_joint(robot, recorded, fit):
    other = swing(robot, 2)
    held = pl.fit_robot(robot, [recorded, other], held_out=1, **OPTIONS)
    assert held.array == pytest.approx(fit.array, rel=1e-12)
    assert held.heldout.errors == pytest.approx(fit.score(other).errors)
    assert held.heldout_effort_error == pytest.approx(fit.score(other).mean_error)
    assert held.heldout_r2 > 0.98
    assert [each.verdict for each in held.answers] == ["yes", "yes"]
    assert "% on held-out recordings" in held.answers[0].reason
    by_name = pl.fit_robot(robot, {"a": recorded, "b": other}, held_out="b", **OPTIONS)
    further = pl.fit_robot(robot, recorded, held_out=other, **OPTIONS)
    for again in (by_name, further):
        assert again.heldout_effort_error == pytest.approx(held.heldout_effort_error)
    share = pl.fit_robot(robot, recorded, held_out=0.25, **OPTIONS)
    assert 0.0 < share.heldout_effort_error < 5.0
    assert np.isnan(fit.heldout_effort_error)
    assert [str(each) for each in fit.answers] == ["cannot say: no recording was held out"] * 2


@pytest.mark.parametrize(
    ("held_out", "said"),
    [
        (1.5, "held_out: found 1.5, expected a share above 0 and below 1"),
        (7, "held_out: found 7, expected a number from 0 to 1 or one of recording 1, recording 2"),
        ([0, 1], "held_out: found all recordings, expected at least one that is fitted"),
        (True, "held_out: found True, expected recordings, their names or numbers, or a share"),
        ([], "held_out: found an empty list|held_out: found .*expected recordings, their names"),
    ],
)
def test_what_cannot_be_held_out_is_named(robot, recorded, held_out, said):
    with pytest.raises(PellucidError, match=said):
        pl.fit_robot(robot, [recorded, recorded], held_out=held_out, **OPTIONS)


def test_a_joint_that_is_predicted_badly_is_answered_with_no(robot, recorded):
    other = swing(robot, 2)
    other["effort"] = other["effort"] + np.array([0.0, 3.0]) * np.sign(np.sin(40.0 * other["time"]))[:, None]
    fit = pl.fit_robot(robot, recorded, held_out=other, **(OPTIONS | {"lowpass": "20 Hz"}))
    assert [each.verdict for each in fit.answers] == ["yes", "no"]
    assert fit.answers[1].reason.endswith("more than 20 %")


def test_its_bodies_are_consistent_and_near_those_stated(fit, robot):
    bodies = fit.consistent
    assert least_reduced_eigenvalue(bodies.links()[:, 12:]).min() > 0.0
    masses = [bodies[f"{name}.mass"].value for name in ("upper", "fore")]
    assert masses == pytest.approx([1.0, 1.0], rel=0.2)
    assert bodies["fore.moment_z"].value == pytest.approx(-0.2, rel=0.05)


def test_a_score_is_the_command_s_measure(fit, robot):
    from pellucid.arm.fit.fit_tree import heldout_errors
    from pellucid.arm.tree_motion import tree_motion_of

    other = swing(robot, 2)
    motion = tree_motion_of(*other.values(), fit.filtering, dead_band=0.1, recording="other", use="validate")
    assert list(fit.score(other).errors.values()) == pytest.approx(heldout_errors(fit, [motion]), rel=1e-12)


def test_it_simulates_what_the_robot_does(fit, robot):
    time = np.arange(0.0, 1.0, 1e-3)
    effort = np.column_stack([3.0 * np.sin(4.0 * time), 1.5 * np.cos(3.0 * time)])
    truth = plant(robot, 1e-3)
    truth.reset(np.array([0.2, -0.1]), np.zeros(2))
    position, _ = truth.run(effort)
    made = fit.simulate(time, effort, position=[0.2, -0.1])
    assert made.position.shape == made.velocity.shape == (1000, 2)
    assert np.abs(made.position - position).max() < 0.1 * np.ptp(position)


def test_a_file_and_other_units_and_tables_are_taken(tmp_path, fit, recorded):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)
    degrees = {**recorded, "position": np.degrees(recorded["position"]), "time": 1e3 * recorded["time"]}
    again = pl.fit_robot(str(path), degrees, units={"position": "deg", "time": "ms"}, **OPTIONS)
    assert again.array == pytest.approx(fit.array, rel=1e-6)
    by_joint = {"time": recorded["time"]} | {
        f"{key}.{name}": recorded[key][:, k] for key in ("position", "effort") for k, name in enumerate(NAMES)
    }
    assert pl.fit_robot(path, [by_joint], **OPTIONS).array == pytest.approx(fit.array, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"robot": 3}, "robot: found 3, expected a Robot, a Tree, or the path"),
        ({"robot": "nothing.urdf"}, "nothing.urdf"),
        ({"recordings": None}, "recordings: found None, expected a sequence or a mapping"),
        ({"recordings": []}, "found no recording"),
        ({"recordings": [1.0]}, "recordings: found 1.0, expected a mapping"),
        ({"lowpass": "10"}, 'lowpass: found "10" without a unit'),
        ({"lowpass": [10.0]}, "lowpass: found a value of type list"),
        ({"order": "four"}, "order: "),
        ({"decimate": 2.5}, "decimate: found 2.5, expected an integer"),
        ({"trim": -1}, "trim: found -1, expected an integer of 0 or more"),
        ({"dead_band": [0.1]}, "dead_band: found 1 numbers, expected 1 or 2"),
        ({"dead_band": "1 m/s"}, 'dead_band: found the unit "m/s"'),
        ({"velocity_width": None}, "velocity_width: found None, expected a number"),
        ({"plain": "yes"}, "plain: found 'yes', expected True or False"),
        ({"units": {"position": "m"}}, "units: position: found the unit"),
        ({"units": "deg"}, "units: found 'deg', expected a mapping"),
        ({"time": "2026"}, "time: found '2026', expected an array of real numbers"),
        ({"position": "complex"}, "position: found complex numbers"),
        ({"position": "degrees"}, "position: found a magnitude of .* which looks like deg taken for rad"),
        ({"position": "masked"}, "position: found missing samples"),
        ({"effort": "reversed"}, "effort: found friction of joint .* the effort has the opposite sign of the position"),
        ({"effort": "short"}, r"effort: found shape \(100, 2\), expected \(6000, 2\)"),
        ({"short": True}, "found 50 samples, expected at least"),
    ],
)
def test_what_is_wrong_is_named(robot, recorded, change, said):
    ((key, value),) = change.items()
    own = {
        "complex": recorded["position"] + 1j,
        "degrees": np.degrees(recorded["position"]),
        "masked": np.ma.masked_greater(recorded["position"], 0.5),
        "reversed": -recorded["effort"],
    }
    table, options = dict(recorded), dict(OPTIONS)
    given = {"robot": robot, "recordings": table}
    if key == "short" or value == "short":
        length = 50 if key == "short" else 100
        table |= {n: x[:length] for n, x in table.items() if key in ("short", n)}
    elif key in recorded:
        table[key] = own.get(value, value)
    elif key in given:
        given[key] = value
    else:
        options[key] = value
    with pytest.raises(PellucidError, match=said):
        pl.fit_robot(given["robot"], given["recordings"], **options)


def test_wrong_types_are_type_errors_too(robot, recorded):
    with pytest.raises(ArgumentError):
        pl.fit_robot(robot, 3, lowpass=10.0)
    assert issubclass(ArgumentError, TypeError)
    assert issubclass(ArgumentError, ValueError)
