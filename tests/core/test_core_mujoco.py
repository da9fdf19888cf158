"""The plant without friction, and with a joint damper, against MuJoCo: someone else's equations of motion."""

import numpy as np
import pytest

from pellucid import _core

mujoco = pytest.importorskip("mujoco")

# A pendulum of 2 kg at 0.4 m with 0.03 kg m^2 about its own centre; q = 0 hangs, and positive q swings about -y.
MODEL = """
<mujoco>
  <option timestep="{timestep}" integrator="{integrator}" gravity="0 0 -9.81">
    <flag contact="disable" eulerdamp="disable"/>
  </option>
  <worldbody>
    <body>
      <joint name="j" type="{kind}" axis="0 1 0" damping="{damping}" armature="{armature}"/>
      <inertial pos="0 0 -0.4" mass="2" diaginertia="0.03 0.03 0.03"/>
    </body>
  </worldbody>
  <actuator><motor joint="j"/></actuator>
</mujoco>
"""
MASS, LENGTH = 2.0, 0.4


def run_mujoco(effort, timestep, kind, damping=0.0, integrator="Euler", position0=0.0, every=1, armature=0.0):
    model = mujoco.MjModel.from_xml_string(
        MODEL.format(timestep=timestep, kind=kind, damping=damping, integrator=integrator, armature=armature)
    )
    data = mujoco.MjData(model)
    data.qpos[0] = position0
    states = []
    for value in effort:
        data.ctrl[0] = value
        states.append((data.qpos[0], data.qvel[0]))
        for _ in range(every):
            mujoco.mj_step(model, data)
    return np.array(states).T


def parameters(kind, damping=0.0):
    p = np.zeros(len(_core.PARAMETER_NAMES))
    p[0] = 0.03 + MASS * LENGTH**2 if kind == "hinge" else MASS
    p[1] = MASS * 9.81 * LENGTH if kind == "hinge" else 0.0
    p[6] = p[7] = damping
    return p


@pytest.mark.parametrize("kind", ["hinge", "slide"])
@pytest.mark.parametrize("damping", [0.0, 0.7])
def test_same_integrator_same_trajectory(kind, damping):
    """Both semi-implicit Euler at 0.5 ms: equal but for rounding, over 3 s of large swings."""
    t = 1e-3 * np.arange(3000)
    effort = 3.0 * np.sin(3 * t) + np.sin(11 * t)
    q, v = run_mujoco(effort, 0.5e-3, kind, damping, position0=1.2, every=2)
    got = _core.simulate(parameters(kind, damping), reference=effort, period=1e-3, substeps=2, position0=1.2)
    assert np.ptp(q) > 0.5
    np.testing.assert_allclose(got[0], q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got[1], v, rtol=0, atol=1e-9)


def geared(motor_inertia, stiffness, damping):
    """The same pendulum behind a motor and a transmission without gap and friction."""
    values = dict.fromkeys(_core.GEARED_PARAMETER_NAMES, 0.0) | {
        "link_inertia": 0.03 + MASS * LENGTH**2,
        "gravity_sine": MASS * 9.81 * LENGTH,
        "motor_inertia": motor_inertia,
        "stiffness": stiffness,
        "damping": damping,
    }
    return np.array([[values[name] for name in _core.GEARED_PARAMETER_NAMES]])


def test_stiff_gear_is_an_armature():
    """Motor and link behind a stiff transmission are MuJoCo's hinge with the motor's inertia as armature."""
    t = 1e-3 * np.arange(3000)
    effort = 3.0 * np.sin(3 * t) + np.sin(11 * t)
    q, _ = run_mujoco(effort, 1e-3, "hinge", integrator="RK4", position0=1.2, armature=0.2)
    errors = []
    for stiffness in (1e5, 4e5):
        got = _core.simulate_geared(
            geared(0.2, stiffness, 100.0), reference=effort, period=1e-3, substeps=400, position0=1.2
        )
        errors.append(np.max(np.abs(got[2][0] - q)))
    assert np.ptp(q) > 0.5
    assert errors[0] < 1e-3
    assert errors[1] < 0.6 * errors[0]


def test_light_motor_leaves_the_single_body():
    """With a motor that weighs nothing to speak of, the link alone is left: MuJoCo's pendulum without armature."""
    t = 1e-3 * np.arange(2000)
    effort = 3.0 * np.sin(3 * t)
    q, _ = run_mujoco(effort, 1e-3, "hinge", integrator="RK4", position0=1.2)
    got = _core.simulate_geared(geared(1e-4, 1e5, 1.0), reference=effort, period=1e-3, substeps=400, position0=1.2)
    np.testing.assert_allclose(got[2][0], q, rtol=0, atol=3e-3)


def test_converges_to_runge_kutta():
    """Against MuJoCo's RK4 the error falls in proportion to the substep, as a first-order method's does."""
    t = 1e-3 * np.arange(2000)
    effort = 3.0 * np.sin(3 * t)
    q, _ = run_mujoco(effort, 1e-3, "hinge", integrator="RK4", position0=1.0)
    errors = []
    for substeps in (10, 20, 40):
        got = _core.simulate(parameters("hinge"), reference=effort, period=1e-3, substeps=substeps, position0=1.0)
        errors.append(np.max(np.abs(got[0] - q)))
    assert errors[2] < 2e-4
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.05)


def test_inverse_dynamics_is_mujocos(rng):
    model = mujoco.MjModel.from_xml_string(
        MODEL.format(timestep=1e-3, kind="hinge", damping=0.7, integrator="Euler", armature=0.0)
    )
    data = mujoco.MjData(model)
    q, v, a = rng.uniform(-3, 3, (3, 100))
    wanted = []
    for data.qpos[0], data.qvel[0], data.qacc[0] in zip(q, v, a, strict=True):
        mujoco.mj_inverse(model, data)
        wanted.append(data.qfrc_inverse[0])
    np.testing.assert_allclose(
        _core.inverse_dynamics(parameters("hinge", 0.7), q, v, a), wanted, rtol=1e-12, atol=1e-11
    )
