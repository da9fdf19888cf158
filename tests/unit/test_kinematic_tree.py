"""Trees of links as Python says them: what they compute, and what cannot be one."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.models.joint import GRAVITY
from pellucid.models.kinematic_tree import BODY_QUANTITIES, Link, Tree, TreeJoint

X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def two_links(**changes):
    joints = [
        TreeJoint("shoulder", "base", "upper", axis=X, place=(0.0, 0.0, 1.0)),
        TreeJoint("elbow", "upper", "lower", **({"axis": X, "place": (0.0, 0.0, -0.3)} | changes)),
    ]
    return joints, [Link("upper", 2.0, (0.0, 0.0, -0.3)), Link("lower", 1.0, (0.0, 0.0, -0.1))]


def test_a_hanging_arm():
    """Two links that hang along gravity, lifted by the shoulder: m g c sin q."""
    tree = Tree(*two_links())
    q = np.array([[0.0, 0.0], [np.pi / 2, 0.0], [0.0, np.pi / 2]])
    lower = 1.0 * GRAVITY * 0.1
    upper = GRAVITY * (2.0 * 0.15 + 1.0 * 0.3)
    np.testing.assert_allclose(
        tree.core.gravity(q), [[0.0, 0.0], [upper + lower, lower], [lower, lower]], rtol=0, atol=1e-13
    )
    assert tree.base == "base"
    assert [joint.name for joint in tree.moving] == ["shoulder", "elbow"]
    a = np.ones((3, 2))
    made = tree.core.regressor(q, 0 * q, a) @ tree.parameters
    np.testing.assert_allclose(made, tree.core.inverse_dynamics(q, 0 * q, a), atol=1e-12)
    assert tree.parameter_names[0] == "upper.mass"
    assert tree.parameter_names[-1] == "lower.inertia_zz"
    assert len(tree.parameter_names) == 2 * len(BODY_QUANTITIES)


def test_order_of_joints_does_not_matter():
    joints, links = two_links()
    assert Tree(joints[::-1], links).order == Tree(joints, links[::-1]).order


def test_a_weld_carries():
    """A link welded on is one body with what it hangs on."""
    joints, links = two_links(kind="fixed", axis=None)
    q = np.array([[0.7], [-0.2]])
    rigid = Tree(joints, links)
    as_one = Tree(joints[:1], [Link("upper", 3.0, (0.0, 0.0, -0.3 - 0.1 - 0.3), (0.09 + 2 * 0.03, 0, 0, 0, 0, 0))])
    np.testing.assert_allclose(rigid.core.gravity(q), as_one.core.gravity(q), atol=1e-13)
    np.testing.assert_allclose(rigid.core.mass_matrix(q), as_one.core.mass_matrix(q), atol=1e-13)


def test_moments_about_the_centre_are_moved_to_the_origin():
    centre, turned = (0.1, -0.2, 0.3), (0.4, -0.5, 0.6)
    link = Link.about_centre("a", 2.0, centre, (0.01, 0.001, 0.002, 0.02, 0.003, 0.03), turned)
    cr, cp, cy = np.cos(turned)
    sr, sp, sy = np.sin(turned)
    r = (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    own = r @ np.array([[0.01, 0.001, 0.002], [0.001, 0.02, 0.003], [0.002, 0.003, 0.03]]) @ r.T
    c = np.array(centre)
    about = own + 2.0 * (c @ c * np.eye(3) - np.outer(c, c))
    np.testing.assert_allclose(link.inertia, about[np.triu_indices(3)], atol=1e-15)
    np.testing.assert_allclose(link.moment, 2.0 * c)


def test_what_cannot_be_a_tree_is_named():
    joints, links = two_links()

    def refused(message, joints=joints, links=links, **more):
        with pytest.raises(IdentificationError, match=message):
            Tree(joints, links, source="arm.urdf", **more)

    refused("arm.urdf: found no joint, expected at least one", joints=[])
    refused("joint 'elbow': found no axis, expected three", *two_links(axis=None))
    refused("joint 'elbow': found an axis of length 2, expected 1", *two_links(axis=(0.0, 0.0, 2.0)))
    refused("joint 'elbow': found an axis of length nan", *two_links(axis=(0.0, 0.0, float("nan"))))
    refused("joint 'elbow': found kind 'ball', expected one of fixed, revolute", *two_links(kind="ball"))
    refused("joint 'elbow': found place .* are these millimetres", *two_links(place=(0.0, 0.0, -300.0)))
    refused("joint 'elbow': found rotor inertia -1", *two_links(rotor_inertia=-1))
    refused(
        "link 'lower': found its centre of mass 100 m .* millimetres", links=[links[0], Link("lower", 1, (0, 100, 0))]
    )
    refused("link 'lower': found mass 0 on joint 'elbow', which moves", links=[links[0], Link("lower")])
    refused("link 'lower': found mass -1", links=[links[0], Link("lower", -1.0)])
    refused("link 'lower': expected ten finite numbers", links=[links[0], Link("lower", float("inf"))])
    refused("found two joints named 'elbow'", joints=[*joints, joints[1]])
    refused("found two links named 'lower'", links=[*links, links[1]])
    refused("joint 'elbow': found no link 'lower', expected one of upper", links=links[:1])
    refused("link 'hand' has no joint", links=[*links, Link("hand", 1.0)])
    loop = TreeJoint("back", "base", "lower", axis=Z)
    refused("link 'lower' is the child of two joints, 'elbow' and 'back': a loop", joints=[*joints, loop])
    around = [TreeJoint("a", "upper", "lower", axis=Z), TreeJoint("b", "lower", "upper", axis=Z)]
    refused("none: every link is the child of another, in a loop", joints=around)
    refused("carry one another in a loop", joints=[TreeJoint("c", "base", "hand", axis=Z), *around],
            links=[*links, Link("hand", 1.0)])  # fmt: skip
    refused("links without a parent: 'base', 'floor'", joints=[joints[0], TreeJoint("b", "floor", "lower", axis=Z)])
    refused("found no joint that moves", joints=[TreeJoint("a", "base", "upper", "fixed")], links=links[:1])
    chain = [TreeJoint(f"j{i}", f"l{i}", f"l{i + 1}", axis=Z) for i in range(33)]
    refused("found 33 links, expected at most 32", joints=chain, links=[Link(f"l{i + 1}", 1.0) for i in range(33)])


def test_a_link_without_mass_may_carry_one():
    joints, _ = two_links()
    arm = Link.about_centre("lower", 1.0, (0.0, 0.0, -0.1), (0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
    tree = Tree(joints, [Link("upper"), arm])
    assert np.isfinite(tree.core.forward_dynamics(np.zeros(2), np.zeros(2), np.ones(2))).all()
    rotor = Tree(two_links(rotor_inertia=0.1)[0], [replace(arm, name="upper"), Link("lower")])
    assert np.isfinite(rotor.core.forward_dynamics(np.zeros(2), np.zeros(2), np.ones(2))).all()
