"""Robots by rows of Denavit and Hartenberg or by screws: weight and mass matrix against products of matrices."""

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.arm.study.recorded_tree import robot_of
from pellucid.study.procedures.registry import open_study

HEAD = """name = "arm"
[tree]
{head}
"""
JOINT = """[[rig.joints]]
name = "j{i}"
motion = "{motion}"
{frame}
{body}
[rig.joints.drive]
kind = "torque"
"""
TAIL = """[channels]
time = { rate = "250 Hz" }
[processing]
lowpass = "20 Hz"
[[recordings]]
name = "sweep"
file = "a.csv"
"""
MOTIONS = ("rotary", "rotary", "prismatic", "rotary")
ROWS = np.array([[0.1, 1.2, 0.3, 0.4], [0.25, -0.7, 0.05, -0.9], [0.0, 1.5, 0.2, 0.3], [0.1, 0.4, 0.15, 0.0]])
AXES = np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
POINTS = np.array([[0.1, 0.0, 0.0], [0.1, 0.2, 0.3], [0.4, 0.2, 0.3], [0.5, 0.1, 0.3]])
CENTRES = np.array([[0.02, -0.1, 0.03], [0.15, 0.01, 0.0], [0.0, 0.05, 0.1], [-0.03, 0.02, 0.06]])
INERTIA = np.diag([0.02, 0.03, 0.01]) + 0.002
MASSES = (2.0, 1.5, 1.0, 0.7)
Q = np.array([0.3, -0.5, 0.12, 0.8])


def about(axis, angle):
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def moved(turn=None, way=(0.0, 0.0, 0.0)):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = np.eye(3) if turn is None else turn, way
    return made


def poses_by_rows(q, convention):
    at, made = np.eye(4), []
    for (a, alpha, d, theta), motion, x in zip(ROWS, MOTIONS, q, strict=True):
        theta, d = theta + x * (motion == "rotary"), d + x * (motion == "prismatic")
        z = moved(about((0.0, 0.0, 1.0), theta)) @ moved(way=(0.0, 0.0, d))
        along = moved(about((1.0, 0.0, 0.0), alpha)) @ moved(way=(a, 0.0, 0.0))
        at = at @ (z @ along if convention == "classic" else along @ z)
        made.append(at)
    return made


def poses_by_screws(q):
    at, made = np.eye(4), []
    for axis, point, motion, x in zip(AXES, POINTS, MOTIONS, q, strict=True):
        if motion == "rotary":
            turn = about(axis, x)
            at = at @ moved(turn, point - turn @ point)
        else:
            at = at @ moved(way=x * axis)
        made.append(at @ moved(way=point))
    return made


def weight_and_masses(poses):
    """Gravity's torques (4,) and the mass matrix (4, 4) at Q, from how bodies move with the coordinates."""
    step, weight, masses = 1e-5, np.zeros(4), np.zeros((4, 4))
    sides = [(poses(Q + step * e), poses(Q - step * e)) for e in np.eye(4)]
    for body, (mass, centre, pose) in enumerate(zip(MASSES, CENTRES, poses(Q), strict=True)):
        c = np.append(centre, 1.0)
        ways = np.array([(a[body] @ c - b[body] @ c)[:3] for a, b in sides]) / (2.0 * step)
        spins = []
        for a, b in sides:
            w = (a[body] - b[body])[:3, :3] @ pose[:3, :3].T / (2.0 * step)
            spins.append([w[2, 1], w[0, 2], w[1, 0]])
        own = pose[:3, :3] @ INERTIA @ pose[:3, :3].T
        masses += mass * ways @ ways.T + np.array(spins) @ own @ np.array(spins).T
        weight += 9.80665 * mass * ways[:, 2]
    return weight, masses


def quantities(values, unit):
    return "[" + ", ".join(f'"{v:.12g} {unit}"' for v in values) + "]"


def study_of(folder, head, frames, bodies=True):
    text = HEAD.format(head=head)
    moments = quantities(INERTIA[np.triu_indices(3)], "kg*m^2")
    for i, (motion, frame) in enumerate(zip(MOTIONS, frames, strict=True)):
        body = f'body = {{ mass = "{MASSES[i]} kg", centre = {quantities(CENTRES[i], "m")}, inertia = {moments} }}'
        text += JOINT.format(i=i, motion=motion, frame=frame, body=body if bodies else "")
    (folder / "study.toml").write_text(text + TAIL, encoding="utf-8")
    return open_study(folder)


def by_rows():
    return [f'dh = {{ a = "{a} m", alpha = "{al} rad", d = "{d} m", theta = "{t} rad" }}' for a, al, d, t in ROWS]


def by_screws():
    return [f"axis = {a.tolist()}\nthrough = {quantities(p, 'm')}" for a, p in zip(AXES, POINTS, strict=True)]


@pytest.mark.parametrize(
    ("head", "frames", "poses"),
    [
        ('dh = "classic"', by_rows(), lambda q: poses_by_rows(q, "classic")),
        ('dh = "modified"', by_rows(), lambda q: poses_by_rows(q, "modified")),
        ("", by_screws(), poses_by_screws),
    ],
    ids=["classic", "modified", "screws"],
)
def test_weight_and_masses_are_those_of_the_rows(tmp_path, head, frames, poses):
    core = robot_of(study_of(tmp_path, head, frames)).tree.core
    rest = np.zeros(4)
    weight, masses = weight_and_masses(poses)
    found = core.inverse_dynamics(Q[None], rest[None], rest[None])[0]
    np.testing.assert_allclose(found, weight, atol=1e-7)
    columns = [core.inverse_dynamics(Q[None], rest[None], e[None])[0] - found for e in np.eye(4)]
    np.testing.assert_allclose(columns, masses, atol=1e-7)


def test_bodies_may_be_unknown(tmp_path):
    links = robot_of(study_of(tmp_path, 'dh = "classic"', by_rows(), bodies=False)).tree.links
    assert [(link.name, link.mass) for link in links] == [(f"j{i}_link", 1.0) for i in range(4)]


@pytest.mark.parametrize(
    ("head", "change", "said"),
    [
        ("", lambda rows: rows, r'j0: found a row of Denavit and Hartenberg, expected \[tree\] dh = "classic"'),
        ('dh = "classic"', lambda rows: [by_screws()[0], *rows[1:]], "j1: found no through, which other joints have"),
        ('dh = "classic"', lambda rows: [rows[0] + "\naxis = [0, 0, 1]", *rows[1:]], "j0: found axis and dh"),
        ('dh = "classic"', lambda rows: ["", *rows[1:]], "j0: found no place, expected place and axis"),
    ],
)
def test_what_is_said_half_is_refused(tmp_path, head, change, said):
    with pytest.raises(PellucidError, match=said):
        study_of(tmp_path, head, change(by_rows()))
