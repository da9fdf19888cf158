"""Speed of dynamics, regressor and simulation of many joints, compared with Pinocchio and MuJoCo, called from Python.

Six hinges in a chain, 45,000 samples; four hinges with friction are simulated. Compared runs are interleaved in one
process, on one core, into allocated arrays, and give the same numbers.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable

import numpy as np

from pellucid import _core
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint

from ._peers import peer
from ._size import sized
from .identification import _row, interleaved

SAMPLE_COUNT = sized(45_000, smallest=500)
"""Number of samples of each call."""

SIMULATED_S = sized(0.5, smallest=0.05)
"""Duration of the simulated motion [s]."""

PERIOD_S = 1e-3
"""Control period of the simulation [s]."""

SUBSTEP_COUNT = 4
"""Number of simulation steps in a control period."""

COULOMB_FRICTION_NM = 0.5
"""Coulomb friction of every joint [N*m]."""

ROTOR_INERTIA_KGM2 = 0.02
"""Inertia of every rotor at its joint [kg*m^2]."""

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
"""Unit vector of each axis by its letter."""


def chain(axes: str, rng: np.random.Generator) -> Tree:
    """Links of 2 kg and 0.3 m, one behind the other."""
    joints, links = [], []
    for i, axis in enumerate(axes):
        joints.append(
            TreeJoint(
                f"joint{i}", f"link{i - 1}" if i else "base", f"link{i}", axis=AXES[axis],
                place=(0.0, 0.0, -0.3 if i else 0.0), rotor_inertia=ROTOR_INERTIA_KGM2,
            )
        )  # fmt: skip
        centre = (*rng.uniform(-0.02, 0.02, 2), -0.15)
        links.append(Link.about_centre(f"link{i}", 2.0, centre, (0.02, 0.001, 0.0, 0.02, 0.002, 0.005)))
    return Tree(joints, links)


def in_pinocchio(tree: Tree):
    """The same in Pinocchio and its module, or None where it is not installed."""
    pinocchio = peer("kinematic_tree", "pinocchio")
    if pinocchio is None:
        return None
    model = pinocchio.Model()
    model.gravity.linear = np.array(tree.gravity)
    joint, body = 0, {link.name: link.numbers for link in tree.links}
    for one in tree.order:
        made = {"x": pinocchio.JointModelRX, "y": pinocchio.JointModelRY, "z": pinocchio.JointModelRZ}
        axis = next(name for name, value in AXES.items() if value == one.axis)
        joint = model.addJoint(joint, made[axis](), pinocchio.SE3(np.eye(3), np.array(one.place)), one.name)
        numbers = body[one.child][[0, 1, 2, 3, 4, 5, 7, 6, 8, 9]]
        model.appendBodyToJoint(joint, pinocchio.Inertia.FromDynamicParameters(numbers), pinocchio.SE3.Identity())
    model.armature = np.full(len(tree.order), ROTOR_INERTIA_KGM2)
    return pinocchio, model, model.createData()


def words(numbers: Iterable[float]) -> str:
    return " ".join(map(str, numbers))


def in_mujoco(tree: Tree) -> Callable[[np.ndarray], None] | None:
    """The same with dry friction in MuJoCo, a call a period; None where it is not installed."""
    mujoco = peer("kinematic_tree", "mujoco")
    if mujoco is None:
        return None
    text, body = "", {link.name: link for link in tree.links}
    for one in tree.order:
        link = body[one.child]
        c = np.array(link.moment) / link.mass
        xx, xy, xz, yy, yz, zz = link.inertia
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - link.mass * (c @ c * np.eye(3) - np.outer(c, c))
        six = words(about[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        text += (
            f'<body pos="{words(one.place)}"><joint name="{one.name}" axis="{words(one.axis)}" '
            f'armature="{ROTOR_INERTIA_KGM2}" '
            f'frictionloss="{COULOMB_FRICTION_NM}"/><inertial pos="{words(c)}" mass="{link.mass}" fullinertia="{six}"/>'
        )
    motors = "".join(f'<motor joint="{one.name}"/>' for one in tree.order)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{PERIOD_S / SUBSTEP_COUNT}" gravity="{words(tree.gravity)}"/><worldbody>{text}'
        f"{'</body>' * len(tree.order)}</worldbody><actuator>{motors}</actuator></mujoco>"
    )
    data = mujoco.MjData(model)

    def run(effort: np.ndarray) -> None:
        mujoco.mj_resetData(model, data)
        for one in effort:
            data.ctrl[:] = one
            mujoco.mj_step(model, data, SUBSTEP_COUNT)

    return run


def driven(tree: Tree) -> _core.DrivenTree:
    """With dry friction of every joint."""
    m = len(tree.moving)
    joints = np.zeros((m, len(_core.TREE_JOINT_PARAMETER_NAMES)))
    for name in ("coulomb_positive", "coulomb_negative"):
        joints[:, _core.TREE_JOINT_PARAMETER_NAMES.index(name)] = COULOMB_FRICTION_NM
    return _core.DrivenTree(tree.links_array, tree.gravity, joints, period=PERIOD_S, substeps=SUBSTEP_COUNT)


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    rng = np.random.default_rng(1)
    tree = chain("zyyxyx", rng)
    core = tree.core
    q, v, a = rng.uniform(-3, 3, (3, SAMPLE_COUNT, 6))
    effort = core.inverse_dynamics(q, v, a)
    rows, out = np.zeros((SAMPLE_COUNT, 6, 60)), np.zeros((SAMPLE_COUNT, 6))
    weight = rng.uniform(0.5, 1.0, (SAMPLE_COUNT, 6))

    def one_by_one() -> None:
        for i in range(SAMPLE_COUNT):
            out[i] = core.inverse_dynamics(q[i], v[i], a[i])

    named: dict[str, Callable[[], object]] = {
        "regressor": lambda: core.regressor(q, v, a, out=rows),
        "regressor and normal equations": lambda: core.normal_equations(q, v, a, effort, weight=weight),
        "inverse dynamics, all at once": lambda: core.inverse_dynamics(q, v, a),
        "inverse dynamics, one by one": one_by_one,
    }
    arm = chain("zxyx", rng)
    plant, periods = driven(arm), round(SIMULATED_S / PERIOD_S)
    pushed = 4.0 * np.sin(np.outer(np.arange(periods) * PERIOD_S * 6.0, [1.0, 2.0, 3.0, 4.0]))

    def simulate() -> None:
        plant.reset()
        plant.run(pushed)

    named["arm of four joints with stiction"] = simulate
    beside = in_pinocchio(tree)
    if beside is not None:
        pin, model, data = beside
        theirs = np.zeros((SAMPLE_COUNT, 6, 60))

        def their_regressor() -> None:
            for i in range(SAMPLE_COUNT):
                theirs[i] = pin.computeJointTorqueRegressor(model, data, q[i], v[i], a[i])

        def their_dynamics() -> None:
            for i in range(SAMPLE_COUNT):
                out[i] = pin.rnea(model, data, q[i], v[i], a[i])

        _, arm_model, arm_data = in_pinocchio(arm)

        def their_arm() -> None:
            x, u, h = np.zeros(4), np.zeros(4), PERIOD_S / SUBSTEP_COUNT
            for one in pushed:
                for _ in range(SUBSTEP_COUNT):
                    u = u + h * pin.aba(arm_model, arm_data, x, u, one)
                    x = x + h * u

        named |= {
            "regressor, Pinocchio": their_regressor,
            "inverse dynamics one by one, Pinocchio": their_dynamics,
            "arm without friction, Pinocchio": their_arm,
        }
        their_regressor()
        named["regressor"]()
        ours = rows.reshape(SAMPLE_COUNT, 6, 6, 10)[..., [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]].reshape(theirs.shape)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-11 * np.abs(theirs).max())
        their_dynamics()
        np.testing.assert_allclose(effort, out, rtol=0, atol=1e-11 * np.abs(out).max())
    mujoco = in_mujoco(arm)
    if mujoco is not None:
        named["arm with friction, MuJoCo"] = lambda: mujoco(pushed)
    taken = dict(zip(named, interleaved(*named.values()), strict=True))
    made = []
    for name, seconds in taken.items():
        if name.startswith("arm"):
            made.append(_row(f"tree: {name}", [SIMULATED_S / s for s in seconds], "s/s", f"{SUBSTEP_COUNT} kHz"))
        else:
            made.append(
                _row(f"tree: {name}", [1e3 * s for s in seconds], "ms", f"{SAMPLE_COUNT} samples of six joints")
            )
    for name, other in (
        ("regressor", "regressor, Pinocchio"),
        ("regressor and normal equations", "regressor, Pinocchio"),
        ("inverse dynamics, all at once", "inverse dynamics one by one, Pinocchio"),
        ("inverse dynamics, one by one", "inverse dynamics one by one, Pinocchio"),
    ):
        if other in taken:
            ratios = [x / y for x, y in zip(taken[name], taken[other], strict=True)]
            note = f"{name} over {other}, in pairs, median {statistics.median(ratios):.3g}"
            made.append(_row(f"tree: {name}, ratio", ratios, "1", note))
    return made
