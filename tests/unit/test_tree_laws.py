"""Laws of all joints, from a card: what they carry, what they see of a wearer, when they stop, what they refuse."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers import tree_laws
from pellucid.controllers.control_law import Limits
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.tree_stability import LinearShares, TreeCoupling, gravity_slope, linear_law
from pellucid.models.anthropometry import Segment
from pellucid.models.tree_card import COLUMNS, JointRange, TreeCard

M, PERIOD = 4, 1e-3
WAYS = "positive", "negative"
JOINT = {name: i for i, name in enumerate(COLUMNS["joints"])}


def arm(**changes):
    """A shoulder of three hinges and an elbow, links of 1 kg."""
    links = np.zeros((M, len(COLUMNS["links"])))
    at = {name: i for i, name in enumerate(COLUMNS["links"])}
    links[:, at["parent"]] = np.arange(M)
    links[:, at["joint"]] = 1.0
    links[:, at["axis_x"] : at["axis_z"] + 1] = [[0, 0, 1], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
    links[1:, at["z"]] = -0.25
    links[:, at["rotor_inertia"]] = 0.05
    links[:, at["mass"]], links[:, at["moment_z"]] = 1.0, -0.12
    links[:, at["moment_x"]] = 0.03
    links[:, [at["inertia_xx"], at["inertia_yy"]]] = 0.03
    links[:, at["inertia_zz"]] = 0.01
    joints = np.zeros((M, len(COLUMNS["joints"])))
    for name, value in {
        "coulomb_positive": 0.3, "coulomb_negative": 0.25, "viscous_positive": 0.1, "viscous_negative": 0.12,
        "load_motoring": 0.05, "load_generating": 0.05, "square_root": 0.05, "velocity_width": 0.02,
    }.items():  # fmt: skip
        joints[:, JOINT[name]] = value
    values = dict(
        study="arm", family="best", method="made", names=("rotation", "flexion", "abduction", "elbow"),
        bodies=("yoke", "ring", "upper", "forearm"), links=tuple(map(tuple, links.tolist())),
        gravity=(0.0, 0.0, -9.81), joints=tuple(map(tuple, joints.tolist())),
        turns=tuple(map(tuple, np.eye(M).tolist())), motors=(), gains=(1.0,) * M, gains_known=(True,) * M,
        drive_units=("A",) * M, effort_units=("N*m",) * M,
        ranges=(JointRange(-1.5, 1.5, effort=12.0, seen_velocity=2.5),) * M, families=(("coulomb", "viscous"),) * M,
        consistent=True, parameters=(), covariance=(), heldout_error=(), processing="", confidence=0.95, notes=(),
        checksums={}, pellucid="0",
    )  # fmt: skip
    return TreeCard(**values | changes)


def with_joint_numbers(card, **numbers):
    rows = np.array(card.joints)
    for name, value in numbers.items():
        rows[:, JOINT[name]] = value
    return replace(card, joints=tuple(map(tuple, rows.tolist())))


def settled(law, position, periods=400, **read):
    running = law.start()
    for i in range(periods):
        effort = running.step(PERIOD * i, position, **read)
    assert running.fault == "none"
    return effort, running


@pytest.mark.parametrize("scale", [0.0, 1e-9, 1.0], ids=["zero", "tiny", "random"])
def test_at_rest_the_weight_is_carried(scale, rng):
    card = arm()
    for q in scale * rng.uniform(-1.2, 1.2, (4, M)):
        for law in (tree_laws.carried(card), tree_laws.transparent(card)):
            effort, running = settled(law, q)
            np.testing.assert_allclose(effort, card.tree.gravity(q), rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(running.weight, card.tree.gravity(q), rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(running.outside, 0.0, atol=1e-4)  # what is left of the ramp


def test_in_motion_it_is_the_cards_own_inverse_dynamics():
    """Every share at 1, an estimator that hardly lags: what motors need, but for the lag."""
    card = with_joint_numbers(arm(), velocity_width=0.05)
    limits = (Limits(200.0, 1e6, 50.0, (-10.0, 10.0), 0.0),) * M
    law = tree_laws.full_compensation(card, limits=limits, period=2e-4).changed(
        inertia_share=1.0, bandwidth=2000.0, acceleration_limit=1e4
    )
    t = 2e-4 * np.arange(8000)
    rate, phase = np.array([3.0, 4.0, 5.0, 6.0]), np.arange(M)
    q = 0.5 * np.sin(np.outer(t, rate) + phase)
    v, a = 0.5 * rate * np.cos(np.outer(t, rate) + phase), -0.5 * rate**2 * np.sin(np.outer(t, rate) + phase)
    got = law.start().run(t, q)[2000:]
    rigid, joints = card.tree.inverse_dynamics(q, v, a), np.array(card.joints)[0]
    names = _core.PARAMETER_NAMES
    friction = dict(zip(COLUMNS["joints"], joints, strict=True)) | {"velocity_width": 0.02 * 2.5, "inertia": 1.0}
    row = np.array([friction.get(name, 0.0) for name in names])
    wanted = rigid + np.column_stack([_core.friction(row, v[:, k], rigid[:, k]) for k in range(M)])
    slow = np.abs(v[2000:]) < 0.3
    error = np.abs(got - wanted[2000:])
    assert np.max(error[~slow]) < 0.02 * np.abs(wanted).max()


def test_near_a_posture_it_is_the_law_that_margins_are_asked_of(rng):
    """Small motion and small efforts of a wearer: the core's answer beside that of matrices."""
    alike = {f"{name}_{way}": value for name, value in (("coulomb", 0.3), ("viscous", 0.1)) for way in WAYS}
    card = with_joint_numbers(arm(), **alike, square_root=0.0)
    shares = {"friction": 0.7, "inertia": 0.3, "friction_lead": 0.01, "bandwidth": 60.0}
    limits = (Limits(200.0, 1e6, 50.0, (-10.0, 10.0), 0.0),) * M
    law = tree_laws.transparent(card, friction_share=0.7, inertia_share=0.3, limits=limits)
    law = tree_laws.with_force_sensor(law, proportional=2.0, lowpass=15.0, drift=0.1)
    law = law.changed(integral=4.0, leak=1.0, friction_lead=0.01, bandwidth=60.0, energy_store=np.inf)
    shares |= {"proportional": 2.0, "integral": 4.0, "leak": 1.0, "lowpass": 15.0, "drift": 0.1}
    q, weight = np.array([0.3, 0.4, -0.2, 0.6]), np.abs(card.tree.gravity(np.array([0.3, 0.4, -0.2, 0.6])))
    about = TreeCoupling(
        mass=card.tree.mass_matrix(q), viscous=0.1, slope=gravity_slope(card.tree, q), coulomb=0.3 + 0.05 * weight,
        limb_mass=1.0, limb_viscous=0.0, limb_slope=0.0, cuff_stiffness=0.0, cuff_damping=0.0, drive_frequency=50.0,
        drive_damping=1.0,
    )  # fmt: skip
    width = [joint["velocity_width"] for joint in law.joints]
    linear = linear_law(about, LinearShares(**shares), PERIOD, width=width, speed=1e-6)
    t = PERIOD * np.arange(600)
    moved, given = (1e-5 * np.sin(np.outer(t, rng.uniform(3.0, 12.0, M))) for _ in range(2))
    running, at_rest, state = law.start(), card.tree.gravity(q), np.zeros(len(linear.a))
    got, wanted = np.zeros((2, len(t), M))
    for i in range(len(t)):
        got[i] = running.step(t[i], q + moved[i], interaction=given[i]) - at_rest
        read = np.concatenate([moved[i], np.zeros(M), given[i]])
        wanted[i] = linear.c @ state + linear.d @ read
        state = linear.a @ state + linear.b @ read
    assert running.fault == "none"
    np.testing.assert_allclose(got, wanted, atol=2e-3 * np.abs(wanted).max())


def simulated(card, law, outside, seconds=1.5, start=0.2, extra=None):
    """The arm of a card worn by nobody but an `outside` effort, (m,); what the law's observer says, (n, m)."""
    plant = card.driven(PERIOD, substeps=4)
    plant.reset(np.full(M, start), np.zeros(M))
    running, said, places = law.start(), [], []
    for i in range(round(seconds / PERIOD)):
        effort = running.step(PERIOD * i, plant.position) + (0.0 if extra is None else extra(PERIOD * i))
        places.append(plant.position)
        plant.run(effort, outside(PERIOD * i))
        said.append(running.outside)
    assert running.fault == "none"
    return np.array(said), np.array(places)


def test_the_observer_sees_what_pushes():
    """A steady push and a slow one on a moving arm without friction; the share of gravity is whole."""
    card = with_joint_numbers(
        arm(), coulomb_positive=0.0, coulomb_negative=0.0, viscous_positive=0.4, viscous_negative=0.4,
        load_motoring=0.0, load_generating=0.0, square_root=0.0,
    )  # fmt: skip
    limits = (Limits(60.0, 1e5, 50.0, (-10.0, 10.0), 0.0),) * M
    law = tree_laws.carried(card, friction_share=0.0, limits=limits).changed(observer_bandwidth=60.0, bandwidth=300.0)
    push = np.array([0.6, -0.4, 0.3, 0.2])

    def outside(t):
        return push * (t > 0.2) * (1.0 + 0.3 * np.sin(3.0 * t))

    said, places = simulated(card, law, outside)
    wanted = np.array([outside(PERIOD * i) for i in range(len(said))])
    assert np.ptp(places) > 0.3
    assert np.abs(said[150:190]).max() < 0.02
    assert np.abs(said[500:] - wanted[500:]).max() < 0.05
    rising = said[200:260, 0] / wanted[259, 0]
    assert 0.4 < rising[16] < 0.8  # 1 - 1/e after 1 / w


def test_a_wrench_on_the_forearm_is_felt_at_every_joint():
    """J'F: pushing the end is as pushing joints; the law then helps in that direction."""
    card = arm()
    q, force, point = np.array([0.3, 0.4, -0.2, 0.6]), np.array([2.0, -1.0, 3.0]), (0.02, 0.0, -0.2)
    law = tree_laws.with_force_sensor(tree_laws.carried(card), body="forearm", point=point, proportional=1.5)
    law = law.changed(sensor_drift=0.0, sensor_lowpass=1e3)
    assert "sensor" in law.kind
    place = card.tree.placements(q)[3][:, :3]
    felt = card.tree.jacobian(q, 3, point)[:3].T @ (place @ force)
    effort, _ = settled(law, q, wrench=np.array([*force, 0.0, 0.0, 0.0]))
    limit = np.array([share["feedback_limit"] for share in law.shares])
    np.testing.assert_allclose(effort - card.tree.gravity(q), np.clip(1.5 * felt, -limit, limit), atol=1e-6)
    at_joints = tree_laws.with_force_sensor(tree_laws.carried(card), proportional=1.5)
    at_joints = at_joints.changed(sensor_drift=0.0, sensor_lowpass=1e3)
    again, _ = settled(at_joints, q, interaction=felt)
    np.testing.assert_allclose(again, effort, atol=1e-6)
    silent, _ = settled(law, q, wrench=np.full(6, np.nan))
    np.testing.assert_allclose(silent, card.tree.gravity(q), atol=1e-9)


def test_motors_that_turn_with_several_joints_get_their_own():
    """The elbow's motor turns with flexion too: what motors give is at joints what the law wants."""
    turns = np.eye(M)
    turns[3, 1] = 0.7
    card = arm(turns=tuple(map(tuple, turns.tolist())), motors=tuple([(0.0,) * len(COLUMNS["motors"])] * M))
    q = np.array([0.3, 0.4, -0.2, 0.6])
    effort, running = settled(tree_laws.carried(card), q)
    np.testing.assert_allclose(effort, card.tree.gravity(q), rtol=1e-9)
    np.testing.assert_allclose(turns.T @ running.drive, effort, rtol=1e-12)


@pytest.mark.parametrize("single", [False, True])
def test_no_number_of_one_joint_stops_all_of_them(single):
    law = tree_laws.carried(arm())
    for joint in range(M):
        running = law.start(single=single)
        q = np.full(M, 0.5)
        for i in range(100):
            before = running.step(PERIOD * i, q)
        broken = q.copy()
        broken[joint] = np.nan
        efforts = [running.step(PERIOD * (100 + i), broken if i == 0 else q) for i in range(60)]
        assert running.fault == "not_finite"
        assert running.fault_joint == joint
        sizes = np.abs([before, *efforts])
        assert np.all(np.isfinite(sizes))
        assert np.all(np.diff(sizes, axis=0) <= 0.0)
        assert np.all(sizes[-1] == 0.0)
        running.reset()
        assert np.all(np.isfinite(running.step(1.0, q)))


def test_a_healthy_arm_is_not_stopped_and_one_joint_stops_all():
    card = arm()
    law = tree_laws.transparent(card)
    plant, running = card.driven(PERIOD), law.supervised()
    plant.reset(np.full(M, 0.3), np.zeros(M))
    for i in range(1500):
        drive = running.step(PERIOD * i, plant.position)
        plant.run(drive, 0.6 * np.sin(6.0 * PERIOD * i) * np.array([1.0, 0.8, 0.6, 0.4]))
    assert (running.mode, running.fault) == ("running", "none"), running.log
    moved = plant.position
    for i in range(1500, 1900):
        seen = plant.position
        if i >= 1510:
            seen[1] += 0.4  # the second encoder slips
        plant.run(running.step(PERIOD * i, seen), np.zeros(M))
    assert (running.mode, running.fault, running.fault_joint) == ("damped_stop", "jump", 1)
    assert running.enable == (True, False, True, True)
    assert running.effort[1] == 0.0
    free = card.driven(PERIOD)
    free.reset(moved, np.zeros(M))
    free.run(np.zeros((400, M)))
    held, fallen = (np.abs(one.position - moved)[[2, 3]].max() for one in (plant, free))
    assert held < 0.7 * fallen  # joints that can be held sink instead of falling
    assert running.log[0][1] == "jump"


def swung_with(gain, lag=0.0, noise=0.0, seconds=12.0, **changes):
    """Why an arm's supervised law stops while all joints swing and every drive's measurement has the same errors."""
    law = tree_laws.carried(arm(), instruments=Instruments(drive=True))
    law = replace(law, watches=tuple({**watch, **changes} for watch in law.watches))
    running, rng = law.supervised(), np.random.default_rng(3)
    offset = 0.01 * law.shares[0]["effort_limit"] * np.array([1.0, -1.0, 1.0, -1.0])
    meters = [_core.DriveReading([gain, x if noise else 0.0, lag, 0.0], PERIOD) for x in offset]
    phase, errors, said = np.arange(M), noise * rng.standard_normal((1000, M)), np.zeros(M)
    for i in range(round(seconds / PERIOD)):
        given = running.step(PERIOD * i, 0.5 * np.sin(3.0 * PERIOD * i + phase), drive=said)
        if running.fault != "none":
            return running.fault
        said = np.array([one.step(*now) for one, *now in zip(meters, given, errors[i % 1000], strict=True)])
    return "none"


@pytest.mark.parametrize(("gain", "lag"), [(0.95, 0.3e-3), (1.05, 0.3e-3), (1.05, 2e-3)])
def test_drives_measured_as_accurately_as_stated_do_not_stop_an_arm(gain, lag):
    assert swung_with(gain, lag, noise=0.12) == "none"


def test_drives_that_say_that_they_add_energy_stop_an_arm():
    assert swung_with(1.02, drive_gain=0.0, drive_offset=0.0, drive_forget=0.0) == "drive_effort"
    assert swung_with(1.13) == "drive_effort"


def test_a_bit_lost_in_memory_takes_all_power_off():
    running = tree_laws.carried(arm()).supervised(single=True)
    running.step(0.0, np.zeros(M))
    running.flip(40 * 32 + 20)
    for i in range(1, 6000):
        running.step(PERIOD * i, np.zeros(M))
        if running.fault != "none":
            break
    assert running.fault == "integrity"
    assert running.enable == (False,) * M


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(effort_units=("N*m", "A", "N*m", "N*m")), "efforts of flexion in A"),
        (dict(ranges=(JointRange(-1.0, 1.0),) * M), "no speed of rotation"),
    ],
)
def test_what_a_card_lacks_is_refused_by_name(changes, message):
    with pytest.raises(PellucidError, match=message):
        tree_laws.carried(arm(**changes))


def test_dither_wants_a_measured_travel_of_every_joint():
    with pytest.raises(PellucidError, match="rotation: found no presliding_travel"):
        tree_laws.with_dither(tree_laws.transparent(arm()))
    with pytest.raises(PellucidError, match="rotation: found a presliding_travel of 2 mrad"):
        tree_laws.with_dither(tree_laws.transparent(with_joint_numbers(arm(), presliding_travel=2e-3)))
    law = tree_laws.with_dither(tree_laws.transparent(with_joint_numbers(arm(), presliding_travel=2e-4)))
    effort = law.start().run(PERIOD * np.arange(200), np.zeros((200, M)))
    assert np.all(np.ptp(effort[100:], axis=0) > 0.05)


def test_emg_leads_a_joint_whose_limb_hangs_from_it():
    card = arm()
    law = tree_laws.with_emg(tree_laws.transparent(card), "elbow", Segment(2.0, 0.15, 0.06))
    q, still = np.zeros((300, M)), np.zeros((300, M))
    muscle = still.copy()
    muscle[150:, 3] = 4.0
    t = PERIOD * np.arange(300)
    led, plain = (law.start().run(t, q, muscle=x) for x in (muscle, still))
    assert led[160, 3] - plain[160, 3] > 0.02
    with pytest.raises(PellucidError, match="found the joint 'wrist'"):
        tree_laws.with_emg(law, "wrist", Segment(2.0, 0.15, 0.06))


def test_misuse_is_told():
    law = tree_laws.carried(arm())
    with pytest.raises(PellucidError, match="found no parameter gravity_shar"):
        law.changed(gravity_shar=0.5)
    with pytest.raises(PellucidError, match="expected one of yoke"):
        tree_laws.carried(arm(), end="hand")
    with pytest.raises(PellucidError, match="limits: found 1, expected 4"):
        tree_laws.carried(arm(), limits=(Limits(),))
    with pytest.raises(ValueError, match=r"position: got shape \(3,\), expected \(4,\)"):
        law.start().step(0.0, np.zeros(3))
    with pytest.raises(ValueError, match=r"wrench: got shape \(4,\), expected \(6,\)"):
        law.start().step(0.0, np.zeros(4), wrench=np.zeros(4))


@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
def test_commanded_efforts_pass_the_supervisor_of_the_law(single):
    law = tree_laws.carried(arm())
    running, position, wanted = law.supervised(single=single, commanded=True), np.zeros(M), [1.0, -0.5, 2.0, 0.5]
    _, carries = settled(law, position)
    for i in range(60):
        # Somebody holds the arm against what is asked of it.
        given = running.step(PERIOD * i, position, command=wanted)
    assert running.fault == "none"
    assert given == pytest.approx(wanted)
    assert not np.allclose(carries.drive, given)
    running.step(PERIOD * 60, position, command=[0.0, np.nan, 0.0, 0.0])
    for i in range(61, 400):
        given = running.step(PERIOD * i, position, command=wanted)
    assert (running.fault, running.mode) == ("stopped", "damped_stop")
    assert given == pytest.approx(np.zeros(M))
    with pytest.raises(ValueError, match="expected one that is commanded"):
        law.supervised(single=single).step(0.0, position, command=wanted)
    with pytest.raises(ValueError, match=r"command: got shape \(3,\), expected \(4,\)"):
        law.supervised(commanded=True).step(0.0, position, command=np.zeros(3))
