"""Random trees of rigid bodies, and the same in Pinocchio."""

import numpy as np

from pellucid import _core

INDEX = {name: i for i, name in enumerate(_core.LINK_PARAMETER_NAMES)}
FIXED, REVOLUTE, PRISMATIC = 0, 1, 2
GRAVITY = np.array([0.3, -0.2, -9.7])
PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # of ten columns: I_xx I_xy I_yy I_xz I_yz I_zz


def random_body(rng):
    """Ten numbers of a body that can exist: points of mass."""
    points, masses = rng.normal(size=(8, 3)) * 0.2 + rng.normal(size=3) * 0.1, rng.uniform(0.1, 1.0, 8)
    inertia = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, points, strict=True))
    upper = inertia[np.triu_indices(3)]
    return np.concatenate([[masses.sum()], masses @ points, upper])


def random_tree(rng, links, kinds=(REVOLUTE, PRISMATIC, FIXED), serial=False, axes="any"):
    """(links, 22) numbers; the first joint moves."""
    rows = np.zeros((links, len(INDEX)))
    for i, row in enumerate(rows):
        row[INDEX["parent"]] = i if serial else rng.integers(0, i + 1)
        row[INDEX["joint"]] = rng.choice(kinds) if i else max(kinds[0], REVOLUTE)
        row[INDEX["x"] : INDEX["z"] + 1] = rng.normal(size=3) * 0.3
        row[INDEX["roll"] : INDEX["yaw"] + 1] = rng.uniform(-3, 3, 3)
        axis = rng.normal(size=3) if axes == "any" else np.eye(3)[rng.integers(3)]
        row[INDEX["axis_x"] : INDEX["axis_z"] + 1] = axis / np.linalg.norm(axis)
        row[INDEX["rotor_inertia"]] = rng.uniform(0, 0.3)
        row[INDEX["mass"] :] = random_body(rng)
    return rows


def tree_of(rows, gravity=GRAVITY):
    return _core.KinematicTree(rows, gravity)


def in_pinocchio(pin, rows, gravity=GRAVITY):
    """Model, and of each link its joint's id and its placement in that joint's frame."""
    model = pin.Model()
    model.gravity.linear = np.asarray(gravity, float)
    at = [(0, pin.SE3.Identity())]
    for i, row in enumerate(rows):
        joint, placement = at[int(row[INDEX["parent"]])]
        here = placement * pin.SE3(
            pin.rpy.rpyToMatrix(*row[INDEX["roll"] : INDEX["yaw"] + 1]), row[INDEX["x"] : INDEX["z"] + 1]
        )
        axis = row[INDEX["axis_x"] : INDEX["axis_z"] + 1]
        kind = int(row[INDEX["joint"]])
        if kind != FIXED:
            made = (pin.JointModelRevoluteUnaligned if kind == REVOLUTE else pin.JointModelPrismaticUnaligned)(axis)
            joint, here = model.addJoint(joint, made, here, f"joint{i}"), pin.SE3.Identity()
        m, *moments = row[INDEX["mass"] :][PINOCCHIO_ORDER]
        model.appendBodyToJoint(joint, pin.Inertia.FromDynamicParameters(np.array([m, *moments])), here)
        at.append((joint, here))
    model.armature = rows[rows[:, INDEX["joint"]] != FIXED, INDEX["rotor_inertia"]]
    return model, at[1:]
