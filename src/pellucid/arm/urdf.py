"""Read robots from URDF files: joints, limits and bodies. Meshes are not read."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np

from .._errors import IdentificationError, RecordingError
from .._given import require_path
from ..files.readers._xml import read_xml
from ..models.kinematic_tree import GRAVITY, Link, Pose, Tree, TreeJoint, hold_joint, weld_fixed_joints
from ..models.robot import Robot

if TYPE_CHECKING:
    from ..models.kinematic_tree import Vector

_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}

MAX_GYRATION_RATIO = 3.0
"""A body's radius of gyration is at most this many times the robot's length. A larger one means that the moments of
inertia are in another unit."""

MAX_COUNT = 500
"""A file has at most this many links and at most this many joints, welded ones included."""

STAND_IN = Link("", 1.0, (0.0, 0.0, 0.0), (0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
"""Every link gets this body if the file states no body at all."""

_ACCEPTED_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.:/ -]{0,99}")


@dataclass(frozen=True)
class Limits:
    """Limits of a joint as the file states them; None for a limit that it does not state."""

    lower: float | None = None  # smallest position [rad; m]
    upper: float | None = None  # largest position [rad; m]
    velocity: float | None = None  # largest speed [rad/s; m/s]
    effort: float | None = None  # largest effort [N m; N]


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: its coordinate is `multiplier` times the other's coordinate plus `offset`."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Urdf:
    """A robot as its file describes it."""

    path: Path
    name: str
    joints: tuple[TreeJoint, ...]  # joints in the file's order, fixed ones included
    links: tuple[Link, ...]
    limits: Mapping[str, Limits]  # limits by joint
    mimics: Mapping[str, Mimic]  # followed joints by the joint that follows
    notes: tuple[str, ...]  # remarks about the file that do not prevent its use

    @property
    def has_bodies(self) -> bool:
        """Whether any link has a mass. A file with shapes only has none; stand-ins then replace the bodies."""
        return any(link.mass > 0.0 for link in self.links)

    @property
    def moving(self) -> tuple[TreeJoint, ...]:
        """Joints that move by themselves, in the file's order."""
        return tuple(joint for joint in self.joints if joint.kind != "fixed" and joint.name not in self.mimics)

    def tree(
        self, holding: Mapping[str, float] | None = None, gravity: Vector = (0.0, 0.0, -GRAVITY)
    ) -> tuple[Tree, Mapping[str, tuple[str, Pose]]]:
        """Return the tree of the moving joints while others are held at coordinates [rad; m], and each link's place.

        The place of a link is the link of the tree that carries it, and its pose on that link.
        """
        holding = dict(holding or {})
        movable = {joint.name for joint in self.joints if joint.kind != "fixed"}
        unknown = sorted(set(holding) - movable)
        if unknown:
            raise IdentificationError(
                f"{self.path.name}: found no joint {unknown[0]!r} to hold, expected one of {', '.join(sorted(movable))}"
            )
        for _ in self.mimics:
            for name, mimic in self.mimics.items():
                if mimic.joint in holding:
                    holding.setdefault(name, mimic.multiplier * holding[mimic.joint] + mimic.offset)
        for name, mimic in self.mimics.items():
            if name not in holding:
                raise IdentificationError(
                    f"{self.path.name}: joint {name!r}: found that it follows {mimic.joint!r}, expected joints with a "
                    f'coordinate of their own; hold it: [tree] held = {{ {name} = "0 rad" }}, or both'
                )
        joints = [hold_joint(j, holding[j.name]) if j.name in holding else j for j in self.joints]
        kept, links, on = weld_fixed_joints(joints, self.links, self.path.name)
        if not self.has_bodies:
            links = tuple(replace(STAND_IN, name=link.name) for link in links)
        return Tree(kept, links, gravity, self.path.name), on


def read_urdf(path: Path) -> Urdf:
    """Read a robot from a file; raise a RecordingError that names the joint or link which is impossible."""
    path = Path(path)
    root = read_xml(path)
    if root.tag != "robot":
        raise RecordingError(f"{path.name}: found <{root.tag}>, expected <robot>: a URDF file")
    xacro = next((child.tag for child in root if "xacro" in child.tag), None)
    if xacro is not None:
        raise RecordingError(
            f"{path.name}: found <{xacro.rpartition('}')[2]}> of xacro, expected URDF; make it first: "
            f"xacro {path.name} > robot.urdf"
        )
    for tag in ("link", "joint"):
        found = len(root.findall(tag))
        if found > MAX_COUNT:
            raise RecordingError(f"{path.name}: found {found} times <{tag}>, expected at most {MAX_COUNT}")
    links = [_link(path, element) for element in root.findall("link")]
    known = {link.name for link in links}
    joints, limits, mimics = [], {}, {}
    for element in root.findall("joint"):
        joint = _joint(path, element, known)
        joints.append(joint)
        limits[joint.name] = _limits(path, joint, element.find("limit"))
        mimic = element.find("mimic")
        if mimic is not None and joint.kind != "fixed":
            at = f"joint {joint.name!r}, <mimic>"
            multiplier, offset = (_number(path, at, mimic, key) for key in ("multiplier", "offset"))
            followed = _name(path, at, mimic, "joint")
            mimics[joint.name] = Mimic(followed, 1.0 if multiplier is None else multiplier, offset or 0.0)
    if not joints:
        raise RecordingError(f"{path.name}: found no <joint>, expected at least one")
    name = root.get("name") or path.stem
    robot = Urdf(path, name, tuple(joints), tuple(links), limits, mimics, ())
    _require_metres(robot)
    return replace(robot, notes=tuple(_body_notes(robot)))


def read_robot(path: str | os.PathLike, *, held: Mapping[str, float] | None = None) -> Robot:
    """Read a robot's kinematics, limits and stated bodies from a URDF file.

    Parameters
    ----------
    path : path-like
        The URDF file; xacro has to be expanded before.
    held : mapping of str to float, optional
        Joints that do not move, with their coordinates [rad or m].

    Returns
    -------
    Robot
        For `pellucid.fit_robot`; ``robot.names`` are its moving joints.

    Raises
    ------
    RecordingError
        If the file cannot be read as a robot; the message names the joint or link.
    IdentificationError
        If a joint to hold does not exist, or a joint follows another one.

    Examples
    --------
    >>> import pellucid as pl
    >>> robot = pl.read_robot("arm.urdf")                                    # doctest: +SKIP
    >>> robot.names                                                          # doctest: +SKIP
    """
    return Robot(read_urdf(require_path(path, "read_robot: path")).tree(held)[0])


def _joint(path: Path, element: Element, links: set[str]) -> TreeJoint:
    name = _name(path, "a <joint>", element, "name")
    at = f"joint {name!r}"
    said = element.get("type")
    if said not in _KINDS:
        raise RecordingError(
            f"{path.name}, {at}: found type {said!r}, expected revolute, continuous, prismatic or fixed"
            + ("; a robot that floats is not known here: fix its base" if said in ("floating", "planar") else "")
        )
    kind, ends = _KINDS[said], {}
    for end in ("parent", "child"):
        found = element.find(end)
        if found is None:
            raise RecordingError(f'{path.name}, {at}: found no <{end}>, expected <{end} link="NAME"/>')
        ends[end] = _name(path, f"{at}, <{end}>", found, "link")
        if ends[end] not in links:
            raise RecordingError(
                f"{path.name}, {at}: found the {end} {ends[end]!r}, which is no <link>; expected one of "
                f"{', '.join(sorted(links)) or 'none: the file has no <link>'}"
            )
    place, turned = _origin(path, at, element)
    axis = None
    if kind != "fixed":
        found = element.find("axis")
        if found is None:
            raise RecordingError(
                f'{path.name}, {at}: found no <axis>, expected one such as <axis xyz="0 0 1"/>, in the joint\'s frame'
            )
        axis = _vector(path, f"{at}, <axis>", found, "xyz", default=None)
        length = math.hypot(*axis)
        if not length > 1e-6:
            raise RecordingError(f'{path.name}, {at}: found <axis xyz="{found.get("xyz")}"/>, expected a direction')
        x, y, z = axis
        axis = (x / length, y / length, z / length)
    return TreeJoint(name, ends["parent"], ends["child"], kind, axis, place, turned)


def _limits(path: Path, joint: TreeJoint, element: Element | None) -> Limits:
    if element is None or joint.kind == "fixed":
        return Limits()
    at = f"joint {joint.name!r}, <limit>"
    found = {key: _number(path, at, element, key) for key in ("lower", "upper", "velocity", "effort")}
    low, high = found["lower"], found["upper"]
    if low is not None and high is not None and low >= high:
        # Files state unknown limits as 0 to 0.
        found |= {"lower": None, "upper": None}
        if low > high:
            raise RecordingError(f"{path.name}, {at}: found lower = {low:g} above upper = {high:g}, expected it below")
    # Files state unknown speeds and efforts as 0 too.
    return Limits(**{key: None if key in ("velocity", "effort") and not x else x for key, x in found.items()})


def _link(path: Path, element: Element) -> Link:
    name = _name(path, "a <link>", element, "name")
    at, inertial = f"link {name!r}", element.find("inertial")
    if inertial is None:
        return Link(name)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        lacks = "<mass>" if mass is None else "<inertia>"
        raise RecordingError(f"{path.name}, {at}: found an <inertial> without {lacks}, expected both, or none of them")
    centre, turned = _origin(path, at, inertial)
    kilograms = _number(path, f"{at}, <mass>", mass, "value")
    if kilograms is None or kilograms < 0.0:
        raise RecordingError(f"{path.name}, {at}: found the mass {mass.get('value')!r}, expected a number >= 0 [kg]")
    pairs = ("xx", "xy", "xz", "yy", "yz", "zz")
    about = [_number(path, f"{at}, <inertia>", inertia, f"i{pair}") or 0.0 for pair in pairs]
    return Link.about_centre(name, kilograms, centre, about, turned)


def _origin(path: Path, at: str, element: Element) -> tuple[Vector, Vector]:
    found = element.find("origin")
    if found is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    where, zeros = f"{at}, <origin>", (0.0, 0.0, 0.0)
    return tuple(_vector(path, where, found, key, default=zeros) for key in ("xyz", "rpy"))


def _name(path: Path, at: str, element: Element, key: str) -> str:
    found = element.get(key)
    if found is None or not _ACCEPTED_NAME.fullmatch(found):
        raise RecordingError(f"{path.name}, {at}: found {key} = {(found or '')[:60]!r}, expected a name")
    return found


def _number(path: Path, at: str, element: Element, key: str) -> float | None:
    found = element.get(key)
    return None if found is None else _parsed(path, at, key, found)


def _vector(path: Path, at: str, element: Element, key: str, *, default: Vector | None) -> Vector:
    found = element.get(key)
    if found is None and default is not None:
        return default
    parts = (found or "").split()
    if len(parts) != 3:
        raise RecordingError(f"{path.name}, {at}: found {key} = {(found or '')[:60]!r}, expected three numbers")
    x, y, z = (_parsed(path, at, key, part) for part in parts)
    return x, y, z


def _parsed(path: Path, at: str, key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        more = "; make URDF of it with xacro first" if "${" in text else ""
        raise RecordingError(f"{path.name}, {at}: found {key} = {text[:60]!r}, expected a number{more}")
    return value


def _principal_moments(link: Link) -> np.ndarray:
    """Return the principal moments of inertia about the centre of mass, ascending, shape (3,) [kg m^2]."""
    xx, xy, xz, yy, yz, zz = link.inertia
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if link.mass > 0.0:
        h = np.asarray(link.moment)
        about = about - (h @ h * np.eye(3) - np.outer(h, h)) / link.mass
    return np.linalg.eigvalsh(about)


def _require_metres(robot: Urdf) -> None:
    """Raise a RecordingError if moments of inertia are in another unit: a body is then larger than the robot.

    `Tree` reports positions in millimetres, so that they are not checked here.
    """
    length = sum(math.hypot(*joint.place) for joint in robot.joints)
    if any(max(map(abs, joint.place)) > 10.0 for joint in robot.joints):
        return
    for link in robot.links:
        if link.mass <= 0.0:
            continue
        radius = math.sqrt(max(float(_principal_moments(link)[-1]), 0.0) / link.mass)
        if radius > MAX_GYRATION_RATIO * max(length, 0.1):
            raise RecordingError(
                f"{robot.path.name}, link {link.name!r}: found moments of inertia as of a body {radius:.3g} m large on "
                f"a robot {length:.3g} m long, expected kg m^2: are these kg mm^2, or of a mesh in millimetres?"
            )


def _body_notes(robot: Urdf):
    """Yield a note for each body that is physically impossible; a fit does not need the bodies."""
    if not robot.has_bodies:
        yield (
            f"{robot.path.name}: found no link with a mass, expected <inertial> of each: bodies of 1 kg are assumed, "
            "and the identified ones are not compared with them"
        )
    for link in robot.links:
        low, middle, high = _principal_moments(link)
        if robot.has_bodies and link.mass == 0.0 and high > 0.0:
            found = f"mass 0 with a moment of inertia of {high:.3g} kg m^2"
            yield f"{robot.path.name}, link {link.name!r}: found {found}, expected a mass; its inertia is ignored"
        elif link.mass > 0.0 and low <= 0.0:
            found = f"a moment of inertia of {low:.3g} kg m^2 about its centre"
            yield f"{robot.path.name}, link {link.name!r}: found {found}, expected > 0; its inertia is ignored"
        elif low + middle < high * (1.0 - 1e-6):
            found = f"moments of inertia {low:.3g}, {middle:.3g} and {high:.3g} kg m^2"
            yield (
                f"{robot.path.name}, link {link.name!r}: found {found}, of which no body has the largest above the sum "
                "of the others; its inertia is ignored"
            )
