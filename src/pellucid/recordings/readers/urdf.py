"""Robots as URDF files say them: joints, limits and bodies. Meshes are not needed, and not looked at."""

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

from ..._errors import IdentificationError, RecordingError
from ...models.kinematic_tree import GRAVITY, Link, Tree, TreeJoint
from ...models.robot import Robot
from ...models.welded import Pose, hold_joint, weld_fixed_joints
from ._xml import read_xml

if TYPE_CHECKING:
    from ...models.kinematic_tree import Vector

_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}

FARTHEST = 3.0
"""Times the robot's length, beyond which a body's radius of gyration is that of another unit."""

MOST = 500
"""Links, and joints, of a file, welded ones with them."""

STAND_IN = Link("", 1.0, (0.0, 0.0, 0.0), (0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
"""Of each link, where a file says nothing of any."""

_LEGIBLE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.:/ -]{0,99}")


@dataclass(frozen=True)
class Limits:
    """Of a joint, where the file says them: position [rad; m], speed and effort [N m; N]."""

    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: its coordinate is `multiplier` times the other's and `offset`."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Urdf:
    """What a file says of a robot."""

    path: Path
    name: str
    joints: tuple[TreeJoint, ...]  # In the file's order, fixed ones with them
    links: tuple[Link, ...]
    limits: Mapping[str, Limits]  # By joint
    mimics: Mapping[str, Mimic]  # By joint
    notes: tuple[str, ...]  # What is remarkable, and does not keep it from being used

    @property
    def has_bodies(self) -> bool:
        """Whether any link has a mass; a file of shapes alone has none, and stand-ins take their place."""
        return any(link.mass > 0.0 for link in self.links)

    @property
    def moving(self) -> tuple[TreeJoint, ...]:
        """Joints that move by themselves, in the file's order."""
        return tuple(joint for joint in self.joints if joint.kind != "fixed" and joint.name not in self.mimics)

    def tree(
        self, holding: Mapping[str, float] | None = None, gravity: Vector = (0.0, 0.0, -GRAVITY)
    ) -> tuple[Tree, Mapping[str, tuple[str, Pose]]]:
        """The tree of what moves while some joints are held at coordinates [rad; m]; and of every link the one that
        carries it, and where on that it is."""
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
            links = [replace(STAND_IN, name=link.name) for link in links]
        return Tree(kept, links, gravity, self.path.name), on


def read_urdf(path: Path) -> Urdf:
    """The robot of a file; a RecordingError that names the joint or link where it cannot be one."""
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
        if found > MOST:
            raise RecordingError(f"{path.name}: found {found} times <{tag}>, expected at most {MOST}")
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
            mimics[joint.name] = Mimic(
                _name(path, at, mimic, "joint"),
                _number(path, at, mimic, "multiplier", 1.0),
                _number(path, at, mimic, "offset", 0.0),
            )
    if not joints:
        raise RecordingError(f"{path.name}: found no <joint>, expected at least one")
    name = root.get("name") or path.stem
    made = Urdf(path, name, tuple(joints), tuple(links), limits, mimics, ())
    _require_metres(made)
    return replace(made, notes=tuple(_crude(made)))


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
    return Robot(read_urdf(Path(path)).tree(held)[0])


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
        axis = _vector(path, f"{at}, <axis>", found, "xyz", None)
        length = math.hypot(*axis)
        if not length > 1e-6:
            raise RecordingError(f'{path.name}, {at}: found <axis xyz="{found.get("xyz")}"/>, expected a direction')
        axis = tuple(x / length for x in axis)
    return TreeJoint(name, ends["parent"], ends["child"], kind, axis, place, turned)


def _limits(path: Path, joint: TreeJoint, element: Element | None) -> Limits:
    if element is None or joint.kind == "fixed":
        return Limits()
    at = f"joint {joint.name!r}, <limit>"
    found = {key: _number(path, at, element, key, None) for key in ("lower", "upper", "velocity", "effort")}
    low, high = found["lower"], found["upper"]
    if low is not None and high is not None and low >= high:
        # 0 to 0 is what files say of what they do not know.
        found |= {"lower": None, "upper": None}
        if low > high:
            raise RecordingError(f"{path.name}, {at}: found lower = {low:g} above upper = {high:g}")
    # So are speeds and efforts of 0.
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
    kilograms = _number(path, f"{at}, <mass>", mass, "value", None)
    if kilograms is None or kilograms < 0.0:
        raise RecordingError(f"{path.name}, {at}: found the mass {mass.get('value')!r}, expected a number >= 0 [kg]")
    about = [_number(path, f"{at}, <inertia>", inertia, f"i{ij}", 0.0) for ij in ("xx", "xy", "xz", "yy", "yz", "zz")]
    return Link.about_centre(name, kilograms, centre, about, turned)


def _origin(path: Path, at: str, element: Element) -> tuple[Vector, Vector]:
    found = element.find("origin")
    if found is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    zeros = (0.0, 0.0, 0.0)
    return tuple(_vector(path, f"{at}, <origin>", found, key, zeros) for key in ("xyz", "rpy"))


def _name(path: Path, at: str, element: Element, key: str) -> str:
    found = element.get(key)
    if found is None or not _LEGIBLE.fullmatch(found):
        raise RecordingError(f"{path.name}, {at}: found {key} = {(found or '')[:60]!r}, expected a name")
    return found


def _number(path: Path, at: str, element: Element, key: str, otherwise: float | None) -> float | None:
    found = element.get(key)
    return otherwise if found is None else _parsed(path, at, key, found)


def _vector(path: Path, at: str, element: Element, key: str, otherwise: Vector | None) -> Vector:
    found = element.get(key)
    if found is None and otherwise is not None:
        return otherwise
    parts = (found or "").split()
    if len(parts) != 3:
        raise RecordingError(f"{path.name}, {at}: found {key} = {(found or '')[:60]!r}, expected three numbers")
    return tuple(_parsed(path, at, key, part) for part in parts)


def _parsed(path: Path, at: str, key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        more = "; make URDF of it with xacro first" if "${" in text else ""
        raise RecordingError(f"{path.name}, {at}: found {key} = {text[:60]!r}, expected a number{more}")
    return value


def _about_centre(link: Link) -> np.ndarray:
    """Principal moments about the centre of mass, shape (3,) [kg m^2]."""
    xx, xy, xz, yy, yz, zz = link.inertia
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if link.mass > 0.0:
        h = np.asarray(link.moment)
        about = about - (h @ h * np.eye(3) - np.outer(h, h)) / link.mass
    return np.linalg.eigvalsh(about)


def _require_metres(robot: Urdf) -> None:
    """Places in millimetres are Tree's to name; moments in other units show as bodies larger than the robot."""
    length = sum(math.hypot(*joint.place) for joint in robot.joints)
    if any(max(map(abs, joint.place)) > 10.0 for joint in robot.joints):
        return
    for link in robot.links:
        if link.mass <= 0.0:
            continue
        radius = math.sqrt(max(float(_about_centre(link)[-1]), 0.0) / link.mass)
        if radius > FARTHEST * max(length, 0.1):
            raise RecordingError(
                f"{robot.path.name}, link {link.name!r}: found moments of inertia as of a body {radius:.3g} m large on "
                f"a robot {length:.3g} m long, expected kg m^2: are these kg mm^2, or of a mesh in millimetres?"
            )


def _crude(robot: Urdf):
    """Bodies that cannot be, which a fit does not need."""
    if not robot.has_bodies:
        yield (
            f"{robot.path.name}: found no link with a mass, expected <inertial> of each; bodies of 1 kg stand in: "
            "recordings tell what they are, and nothing is compared with them"
        )
    for link in robot.links:
        low, middle, high = _about_centre(link)
        if robot.has_bodies and link.mass == 0.0 and high > 0.0:
            found = f"mass 0 with a moment of inertia of {high:.3g} kg m^2"
            yield f"{robot.path.name}, link {link.name!r}: found {found}, expected a mass; its inertias are no prior"
        elif link.mass > 0.0 and low <= 0.0:
            found = f"a moment of inertia of {low:.3g} kg m^2 about its centre"
            yield f"{robot.path.name}, link {link.name!r}: found {found}, expected > 0; its inertias are no prior"
        elif low + middle < high * (1.0 - 1e-6):
            found = f"moments of inertia {low:.3g}, {middle:.3g} and {high:.3g} kg m^2"
            yield (
                f"{robot.path.name}, link {link.name!r}: found {found}, of which no body has the largest above the sum "
                "of the others; its inertias are no prior"
            )
