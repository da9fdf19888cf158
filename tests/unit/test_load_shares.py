"""Shares of the load lost in motoring and in generating: a known payload tells them apart, and with them gravity."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

import pellucid as pl
from pellucid.joint.fit.drive_constant import (
    LoadShares,
    decide_load_shares,
    estimate_drive_constant,
    widen_for_unknown_shares,
)
from pellucid.joint.fit.friction_solver import solve_family
from pellucid.joint.fit.joint_estimate import make_estimate
from pellucid.joint.study import joint_findings
from pellucid.joint.study.identify_joint import identify_joint
from pellucid.joint.study.joint_findings import report_drive_constant
from pellucid.models.estimates import Parameter
from pellucid.models.joint import joint_model
from pellucid.numerics.motion import Filtering, motion_of
from pellucid.numerics.regression import stack

GRAVITY = 9.80665
JOINTS = 4
RATE, STEPS, SECONDS = 200.0, 8, 12.0
SMOOTH_SIGN = 0.02  # rad/s over which dry friction changes its direction
FILTERING = Filtering(12.0, 4, 4, 0.15, 60)
CONSTANT = 0.8  # N m/A

STUDY = """name = "elbow"

[rig]
joint = "elbow"
motion = "rotary"
[rig.drive]
kind = "torque"

[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "u", unit = "N*m" }

[processing]
lowpass = "12 Hz"
decimate = 4
trim = 60
dead_band = "0.15 rad/s"
"""


@pytest.fixture(scope="module")
def joints():
    """Drawn joints, each value (JOINTS,): generating loses a tenth to four fifths of what motoring loses."""
    rng = np.random.default_rng(11)
    low_high = {
        "inertia": (0.04, 0.15), "gravity": (1.5, 5.0), "coulomb": (0.1, 0.5), "viscous": (0.05, 0.3),
        "offset": (-0.1, 0.1), "motoring": (0.15, 0.4), "mass": (0.6, 1.5), "distance": (0.15, 0.3),
    }  # fmt: skip
    drawn = {name: rng.uniform(*ends, JOINTS) for name, ends in low_high.items()}
    return drawn | {"generating": drawn["motoring"] * rng.uniform(0.1, 0.8, JOINTS)}


@pytest.fixture(scope="module")
def recordings(joints):
    """Time (n,), and position and torque of each joint, (n, JOINTS), bare and loaded, integrated with NumPy alone.

    Dry friction has a hyperbolic tangent for its sign, so that it is not the model's own.
    """
    n, dt = int(SECONDS * RATE), 1.0 / (RATE * STEPS)
    rng = np.random.default_rng(12)
    loaded = np.repeat([0.0, 1.0], JOINTS)
    d = {name: np.tile(values, 2) for name, values in joints.items()}
    inertia = d["inertia"] + loaded * d["mass"] * d["distance"] ** 2
    gravity = d["gravity"] + loaded * d["mass"] * d["distance"] * GRAVITY
    w = 2.0 * np.pi * np.array([[0.13], [0.27], [0.46], [0.74], [1.1], [1.7]])
    size = np.array([[0.55], [0.35], [0.2], [0.15], [0.1], [0.05]])
    phase = rng.uniform(0.0, 2.0 * np.pi, (len(w), 2 * JOINTS))
    t = np.arange(n) / RATE
    wanted = [np.sum(size * np.sin(w * x + phase), axis=0) for x in t]
    rate = [np.sum(size * w * np.cos(w * x + phase), axis=0) for x in t]
    q, v = wanted[0], rate[0]
    position, torque = np.empty((2, n, 2 * JOINTS))
    for i in range(n):
        u = (400.0 * inertia + 30.0) * (wanted[i] - q) + (40.0 * inertia + 3.0) * (rate[i] - v)
        u = u + gravity * np.sin(wanted[i])
        position[i], torque[i] = q, u
        for _ in range(STEPS):
            passed = u - d["offset"] - d["coulomb"] * np.tanh(v / SMOOTH_SIGN) - d["viscous"] * v
            y = passed / np.where(passed * v > 0.0, 1.0 + d["motoring"], 1.0 - d["generating"])
            v = v + dt * (y - gravity * np.sin(q)) / inertia
            q = q + dt * v
    step = 2.0 * np.pi / 2**16
    position = np.round(position / step) * step
    torque += 0.02 * rng.standard_normal(torque.shape)
    return {"bare": (t, position[:, :JOINTS], torque[:, :JOINTS]),
            "loaded": (t, position[:, JOINTS:], torque[:, JOINTS:])}  # fmt: skip


def motions(joints, recordings, i, constant=1.0):
    """The bare and the loaded motion of joint `i`."""
    made = []
    for name, (t, position, torque) in recordings.items():
        payload = (joints["mass"][i], joints["distance"][i]) if name == "loaded" else (0.0, 0.0)
        made.append(replace(motion_of(t, position[:, i], torque[:, i] / constant, FILTERING), payload=payload))
    return made


def model(effort_unit="N*m", *, separate=True, family="load"):
    return joint_model(family, motion="rotary", effort_unit=effort_unit, gravity="sine", separate_load=separate)


def plain_least_squares(motions):
    """Seven numbers of a joint by SciPy on the same rows: the rival."""

    def missed(x):
        inertia, gravity, viscous, coulomb, offset, motoring, generating = x
        parts = []
        for m in motions:
            mass, distance = m.payload
            y = (inertia + mass * distance**2) * m.acceleration
            y = y + (gravity + mass * distance * GRAVITY) * np.sin(m.position)
            sign = np.sign(m.velocity)
            rubs = coulomb * sign + np.where(y * sign > 0.0, motoring, generating) * np.abs(y) * sign
            parts.append(m.rows(m.smooth(rubs) + y + viscous * m.velocity + offset) - m.rows(m.effort))
        return np.concatenate(parts)

    return least_squares(missed, [0.1, 2.0, 0.1, 0.2, 0.0, 0.1, 0.1]).x


def write(folder, joints, recordings, i, uses):
    """A study of joint `i` with the recordings and uses that `uses` maps, its payloads stated."""
    (folder / "recordings").mkdir(parents=True)
    text = STUDY
    for name, use in uses.items():
        t, position, torque = recordings[name]
        columns = np.column_stack([t, position[:, i], torque[:, i]])
        path = f"recordings/{name}.csv"
        np.savetxt(folder / path, columns, delimiter=",", header="t,q,u", comments="", fmt="%.9g")
        text += f'\n[[recordings]]\nname = "{name}"\nfile = "{path}"\nuse = "{use}"\n'
        if name == "loaded":
            mass, distance = joints["mass"][i], joints["distance"][i]
            text += f'payload = {{ mass = "{mass:.9g} kg", distance = "{distance:.9g} m" }}\n'
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return pl.open(folder)


@pytest.mark.parametrize("i", range(JOINTS))
def test_a_payload_tells_gravity_from_load_friction_as_plain_least_squares_does(joints, recordings, i):
    fitted = motions(joints, recordings, i)
    which = model()
    assert decide_load_shares(which, stack(fitted)) == LoadShares(True)
    found = dict(zip(which.names, solve_family(which, stack(fitted)).values, strict=True))
    rival = plain_least_squares(fitted)
    assert found["gravity"] == pytest.approx(joints["gravity"][i], rel=0.015)
    assert found["gravity"] == pytest.approx(rival[1], rel=0.002)
    assert found["load_motoring"] == pytest.approx(joints["motoring"][i], abs=0.02)
    assert found["load_generating"] == pytest.approx(joints["generating"][i], abs=0.02)
    tied = model(separate=False)
    blind = dict(zip(tied.names, solve_family(tied, stack(fitted)).values, strict=True))
    assert abs(blind["gravity"] / joints["gravity"][i] - 1.0) > 0.03


def test_identify_takes_the_stated_payload_for_a_known_load(joints, recordings, tmp_path):
    i = int(np.argmax(joints["motoring"] - joints["generating"]))
    uses = {"bare": "fit", "loaded": "fit"}
    found = identify_joint(
        write(tmp_path / "elbow", joints, recordings, i, uses), families=["symmetric", "load"], thorough=False
    )
    fit = found.families["load"]
    assert found.best == "load"
    assert fit["gravity"].value == pytest.approx(joints["gravity"][i], rel=0.015)
    low, high = fit["gravity"].interval()
    assert low < joints["gravity"][i] < high
    said = {verdict.finding for verdict in found.verdicts}
    # Shares that differ make payloads imply another constant than the right one that is stated.
    assert not said & {"load_friction_tied", "drive_constant"}


def test_what_cannot_be_told_is_said_with_its_reason(joints, recordings):
    bare, loaded = motions(joints, recordings, 0)
    light = replace(loaded, payload=(1e-4, 0.1), effort=bare.effort, position=bare.position)
    for data, unit, why in (
        ([bare], "N*m", "no known load"),
        ([bare, loaded], "A", "unknown drive"),
        ([loaded, loaded], "N*m", "same payload"),
        ([bare, replace(bare, payload=light.payload)], "N*m", "small payload"),
    ):
        assert decide_load_shares(model(unit), stack(data)) == LoadShares(False, why)


@pytest.mark.parametrize(
    ("why", "payload", "begins"),
    [
        ("no known load", 0.0, "Without a known load, load friction while motoring"),
        ("no known load", 1.0, "Only held-out recordings carry a known load, so that load friction"),
        ("unknown drive", 1.0, "The drive's constant is not stated. Even with known payloads, load friction"),
        ("same payload", 1.0, "All fitted recordings carry the same known load, so that load friction"),
        ("small payload", 1.0, "The known payloads change the load too little, so that load friction"),
    ],
)
def test_a_known_load_is_never_said_to_be_lacking(why, payload, begins):
    case = SimpleNamespace(
        fit=SimpleNamespace(model=model(separate=False)),
        shares=LoadShares(False, why),
        motions=(SimpleNamespace(payload=(payload, 0.2)),),
    )
    (verdict,) = joint_findings.report_load_friction_tied(case)
    assert verdict.text.startswith(begins)


@pytest.mark.parametrize("i", range(JOINTS))
def test_an_unknown_constant_leaves_gravity_right_and_is_as_unsure_as_the_shares(joints, recordings, i):
    data = stack(motions(joints, recordings, i, CONSTANT))
    constant = estimate_drive_constant(model("A", separate=False), data)
    tied = replace(model("A", separate=False), payload_scale=1.0 / constant.value)
    solution = solve_family(tied, data)
    found = make_estimate(tied, data, solution, "ls")
    assert found["gravity"].value * constant.value == pytest.approx(joints["gravity"][i], rel=0.015)
    # Joints that lose next to nothing in generating are beyond the 95 % interval.
    low, high = widen_for_unknown_shares(constant, found).interval(0.99)
    assert low < CONSTANT < high
    assert not constant.interval()[0] < CONSTANT < constant.interval()[1]


def test_a_wrong_constant_is_named_where_load_friction_cannot_explain_it():
    shares = {"load_motoring": Parameter("load_motoring", "1", 0.3, 0.01),
              "load_generating": Parameter("load_generating", "1", 0.1, 0.01)}  # fmt: skip
    case = SimpleNamespace(
        drive=SimpleNamespace(kind="torque", constant=None),
        fit=type("Fit", (dict,), {"model": model()})(shares),
        level=0.95,
        rotary=True,
    )
    for value, wrong in ((1.0, False), (1.0 / 1.2, False), (1.0 / 0.8, False), (0.7, True), (1.4, True), (2.0, True)):
        case.constant = Parameter("drive_constant", "N*m/A", value, 0.005)
        assert bool(list(report_drive_constant(case))) is wrong, value
