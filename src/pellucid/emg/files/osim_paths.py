"""Read bodies, joints and muscle paths from OpenSim models, versions 3 and 4 of the files, without OpenSim."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

import numpy as np

from ..._errors import RecordingError
from ..._given import visible_text
from ...files.readers._xml import read_xml
from ..models.muscle_geometry import (
    Constant,
    CoordinateFunction,
    Linear,
    PiecewiseLinear,
    Polynomial,
    ScaledFunction,
    Spline,
)
from ..models.muscle_path import (
    GROUND_BODY,
    Axis,
    Coordinate,
    Coupling,
    MusclePath,
    PathPoint,
    PathSurface,
    Skeleton,
    SkeletonJoint,
    frame,
)
from ..models.wrapping import METHODS, Cylinder, Ellipsoid, Side, Sphere, Surface

MAX_DISTANCE_M = 5.0
"""Points of a muscle lie at most this far from their body's origin [m]. Larger values mean a model in millimetres."""

MAX_ANGLE_RAD = 4.0 * math.pi
"""Rotations of frames and default angles are at most this large [rad]. Larger values mean a model in degrees."""

FUNCTION_TAGS = (
    "Constant", "LinearFunction", "PolynomialFunction", "MultiplierFunction", "SimmSpline", "NaturalCubicSpline",
    "PiecewiseLinearFunction",
)  # fmt: skip
"""Elements of functions that are followed."""

_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True, eq=False)
class MuscleModel:
    """Bodies of a model and the paths of its muscles."""

    path: Path
    skeleton: Skeleton
    muscles: Mapping[str, MusclePath]

    def muscle(self, name: str) -> MusclePath:
        """Return the path of one muscle."""
        if name not in self.muscles:
            raise RecordingError(
                f"{self.path.name}: found the muscles {', '.join(list(self.muscles)[:40])}, expected {name} too"
            )
        return self.muscles[name]


def read_paths(path: Path) -> MuscleModel:
    """Read a model's skeleton and its muscle paths. An unsupported element is refused when it is used, not here."""
    path = Path(path)
    root = read_xml(path)
    if root.tag != "OpenSimDocument":
        raise RecordingError(f"{path.name}: found <{root.tag}>, expected an <OpenSimDocument>")
    model = root.find("Model")
    if model is None:
        raise RecordingError(f"{path.name}: found no <Model>, expected one")
    return _ModelReader(path, model, _version(path, root)).model()


def _version(path: Path, root: Element) -> int:
    said = root.get("Version", "")
    if not said.isdigit() or int(said) < 20000:
        raise RecordingError(
            f'{path.name}: found the version "{visible_text(said)[:40]}", expected one from 20000 on; OpenSim 3 or 4 '
            "writes the model again"
        )
    return int(said)


class _ModelReader:
    """Parser of one ``<Model>`` element."""

    def __init__(self, path: Path, model: Element, version: int):
        self.path, self.version = path, version
        self.root = model
        self.coordinates: dict[str, Coordinate] = {}
        self.frames: dict[str, tuple[str, np.ndarray]] = {GROUND_BODY: (GROUND_BODY, np.eye(4))}

    def model(self) -> MuscleModel:
        bodies = [b for b in self.root.iter("Body") if b.get("name")]
        for body in bodies:
            name = body.get("name", "")
            self.frames[name] = (name, np.eye(4))
        self._place_frames()
        joints = self._new_joints() if self.root.find("JointSet") is not None else self._old_joints(bodies)
        found: dict[str, SkeletonJoint] = {}
        for joint in joints:
            if joint.child in found:
                self._refuse(f"joint {joint.name}", f"a second joint of the body {joint.child}", "one for each body")
            found[joint.child] = joint
        skeleton = Skeleton(self.coordinates, found, self._couplings())
        surfaces = self._surfaces(bodies)
        muscles = {}
        for element in self.root.iter():
            name = element.get("name", "")
            if name and element.find("max_isometric_force") is not None:
                muscles[name] = self._muscle(element, surfaces)
        if not muscles:
            self._refuse("", "no muscle", "some with <max_isometric_force>")
        for muscle in muscles.values():
            self._require_joined(muscle, skeleton)
        return MuscleModel(self.path, skeleton, muscles)

    # Numbers and texts of elements, with messages for what is wrong.

    def _refuse(self, where: str, found: str, expected: str) -> NoReturn:
        raise RecordingError(f"{self.path.name}{', ' if where else ''}{where}: found {found}, expected {expected}")

    def _numbers(self, element: Element | None, where: str, count: int | None = None) -> np.ndarray:
        text = "" if element is None else (element.text or "")
        try:
            values = np.array([float(x) for x in text.replace(",", " ").split()])
        except ValueError:
            values = np.array([math.nan])
        wrong = not np.isfinite(values).all() or not len(values) or (count is not None and len(values) != count)
        if wrong:
            said = "none" if element is None else f'"{visible_text(text.strip())[:60]}"'
            self._refuse(where, said, f"{count or 'one or more'} number{'s' if count != 1 else ''}")
        return values

    def _number(self, parent: Element, tag: str, where: str, default: float | None = None) -> float:
        found = parent.find(tag)
        if found is None and default is not None:
            return default
        return float(self._numbers(found, f"{where}, <{tag}>", 1)[0])

    def _vector(self, parent: Element, tag: str, where: str) -> np.ndarray:
        found = parent.find(tag)
        return np.zeros(3) if found is None else self._numbers(found, f"{where}, <{tag}>", 3)

    def _require_metres(self, values: np.ndarray, where: str) -> np.ndarray:
        most = np.abs(values).max(initial=0.0)
        if most > MAX_DISTANCE_M:
            self._refuse(where, f"{most:.4g} m", f"at most {MAX_DISTANCE_M:g} m; is the model in millimetres?")
        return values

    def _require_radians(self, values: np.ndarray, where: str) -> np.ndarray:
        most = np.abs(values).max(initial=0.0)
        if most > MAX_ANGLE_RAD:
            self._refuse(where, f"{most:.4g} rad", f"at most {MAX_ANGLE_RAD:.4g} rad; is the model in degrees?")
        return values

    def _text(self, parent: Element, tag: str) -> str:
        found = parent.find(tag)
        return "" if found is None or found.text is None else found.text.strip()

    def _frame(self, element: Element, where: str, translation: str, orientation: str) -> np.ndarray:
        place = self._require_metres(self._vector(element, translation, where), f"{where}, <{translation}>")
        turned = self._require_radians(self._vector(element, orientation, where), f"{where}, <{orientation}>")
        return frame(place.tolist(), turned.tolist())

    # Frames.

    def _place_frames(self) -> None:
        """Fill `frames` with the named frames that are offset from bodies; joints read their own frames."""
        waiting = {f.get("name", ""): f for f in self.root.iter("PhysicalOffsetFrame") if f.get("name")}
        owners = {
            f.get("name", ""): body.get("name", "")
            for body in self.root.iter("Body")
            for f in body.iter("PhysicalOffsetFrame")
            if f.get("name")
        }
        for name in waiting:
            self.frames.setdefault(name, ("", np.eye(4)))
        for name, element in waiting.items():  # an empty body marks a frame that is not resolved yet
            if self.frames[name][0] == "":
                self.frames[name] = self._resolve_frame(element, waiting, owners, ())

    def _resolve_frame(
        self, element: Element, known: Mapping[str, Element], owners: Mapping[str, str], above: tuple[str, ...]
    ) -> tuple[str, np.ndarray]:
        """Return the body that carries a frame, and the frame's pose on it; `above` are the frames attached to it."""
        name = element.get("name", "")
        where = f"frame {name}"
        said = self._text(element, "socket_parent") or self._text(element, "socket_parent_frame")
        parent = said.split("/")[-1] if said else ""
        if parent in ("", "..", "."):
            parent = owners.get(name, "")
        if name in above or len(above) > 20:
            self._refuse(where, "frames attached to each other", "a frame attached to a body")
        here = self._frame(element, where, "translation", "orientation")
        if parent in known:
            body, base = self._resolve_frame(known[parent], known, owners, (*above, name))
        elif parent in self.frames and self.frames[parent][0]:
            body, base = self.frames[parent]
        else:
            self._refuse(where, f'the parent "{visible_text(said)[:60]}"', "a body or another frame of the model")
        return body, base @ here

    def _resolve_socket(
        self, name: str, where: str, own: Mapping[str, Element] | None = None
    ) -> tuple[str, np.ndarray]:
        """Return the body and the pose on it of the frame that a socket names."""
        last = name.split("/")[-1]
        if own and last in own:
            return self._resolve_frame(own[last], own, {}, ())
        if not last or last not in self.frames:
            self._refuse(where, f'the frame "{visible_text(name)[:60]}"', "a body or frame of the model")
        return self.frames[last]

    # Joints.

    def _new_joints(self) -> list[SkeletonJoint]:
        found: list[SkeletonJoint] = []
        joint_set = self.root.find("JointSet")
        for element in () if joint_set is None else joint_set.findall("./objects/*"):
            name = element.get("name", "")
            where = f"joint {visible_text(name)}"
            frames = element.findall("./frames/PhysicalOffsetFrame")
            own = {f.get("name", ""): f for f in frames if f.get("name")}
            parent, parent_frame = self._resolve_socket(self._text(element, "socket_parent_frame"), where, own)
            child, child_frame = self._resolve_socket(self._text(element, "socket_child_frame"), where, own)
            coordinates = element.findall("./coordinates/Coordinate")
            bodies = {"parent": parent, "child": child, "parent_frame": parent_frame, "child_frame": child_frame}
            found.append(self._joint(element, name, coordinates, **bodies))
        return found

    def _old_joints(self, bodies: Sequence[Element]) -> list[SkeletonJoint]:
        found = []
        for body in bodies:
            element = next(iter(body.findall("./Joint/*")), None)
            if element is None:
                continue
            name = element.get("name", "")
            where = f"joint {visible_text(name)}"
            parent, _ = self._resolve_socket(self._text(element, "parent_body"), where)
            found.append(
                self._joint(
                    element,
                    name,
                    element.findall("./CoordinateSet/objects/Coordinate"),
                    parent=parent,
                    child=body.get("name"),
                    parent_frame=self._frame(element, where, "location_in_parent", "orientation_in_parent"),
                    child_frame=self._frame(element, where, "location", "orientation"),
                )
            )
        return found

    def _joint(self, element, name, coordinates, *, parent, child, parent_frame, child_frame) -> SkeletonJoint:
        where = f"joint {visible_text(name)}"
        names = [c.get("name", "") for c in coordinates]
        frames = (name, parent, child, parent_frame, child_frame)
        refused = ""
        if self._text(element, "reverse").lower() == "true":
            refused = "found <reverse>, which is not supported, expected a joint from parent to child"
        turns: list[Axis] = []
        shifts: list[Axis] = []
        if element.tag == "CustomJoint":
            axes = element.findall("./SpatialTransform/TransformAxis")
            if len(axes) != 6:
                self._refuse(where, f"{len(axes)} <TransformAxis>", "6: three turns and three shifts")
            made = [self._axis(axis, f"{where}, {visible_text(axis.get('name', ''))}") for axis in axes]
            turns, shifts = [a for a in made[:3] if a], [a for a in made[3:] if a]
        else:
            plain: dict[str, tuple[Sequence, Sequence]] = {
                "WeldJoint": ((), ()), "PinJoint": ((_Z,), ()), "SliderJoint": ((), (_X,)),
                "UniversalJoint": ((_X, _Y), ()), "GimbalJoint": ((_X, _Y, _Z), ()), "BallJoint": ((_X, _Y, _Z), ()),
                "FreeJoint": ((_X, _Y, _Z), (_X, _Y, _Z)), "PlanarJoint": ((_Z,), (_X, _Y)),
            }  # fmt: skip
            if element.tag not in plain:
                kinds = ", ".join(["CustomJoint", *plain])
                refused = f"found a {visible_text(element.tag)}, which is not supported, expected one of {kinds}"
            about, alongs = plain.get(element.tag, ((), ()))
            if not refused and len(names) != len(about) + len(alongs):
                self._refuse(where, f"{len(names)} coordinates", f"{len(about) + len(alongs)} of a {element.tag}")
            one = Linear((1.0,), 0.0)
            turns = [Axis(a, (n,), one) for a, n in zip(about, names, strict=False)]
            shifts = [Axis(a, (n,), one) for a, n in zip(alongs, names[len(about) :], strict=False)]
        sliding = {n for axis in shifts for n in axis.coordinates} - {n for axis in turns for n in axis.coordinates}
        for each in coordinates:
            self._coordinate(each, each.get("name") not in sliding)
        return SkeletonJoint(*frames, tuple(turns), tuple(shifts), refused)

    def _coordinate(self, element: Element, turns: bool) -> None:
        name = element.get("name", "")
        where = f"coordinate {visible_text(name)}"
        low, high = -math.pi, math.pi
        if element.find("range") is not None:
            low, high = self._numbers(element.find("range"), f"{where}, <range>", 2)
        default = self._number(element, "default_value", where, 0.0)
        if turns and abs(default) > MAX_ANGLE_RAD:
            self._require_radians(np.array([default]), where)
        self.coordinates[name] = Coordinate(name, default, float(low), float(high), turns)

    def _axis(self, element: Element, where: str) -> Axis | None:
        function = self._function_in(element, where)
        names = tuple(self._text(element, "coordinates").split())
        while isinstance(function, ScaledFunction) and isinstance(function.function, Constant):
            function = Constant(function.factor * function.function.value)
        if function is None or (isinstance(function, Constant) and function.value == 0.0):
            return None
        direction = self._numbers(element.find("axis"), f"{where}, <axis>", 3)
        size = float(np.linalg.norm(direction))
        if size < 1e-9:
            self._refuse(f"{where}, <axis>", "no direction", "one that is not 0")
        if not names and not isinstance(function, Constant):
            self._refuse(where, "a function of no coordinate", "<coordinates>")
        return Axis(direction / size, names, function)

    def _function_in(self, parent: Element, where: str) -> CoordinateFunction | None:
        holder = parent.find("function")
        if holder is not None and len(holder):
            return self._function(holder[0], where)
        for child in parent:
            # What ends like a function and is none of the known ones is refused.
            if child.tag in FUNCTION_TAGS or child.tag.endswith(("Function", "Spline")):
                return self._function(child, where)
        return None

    def _function(self, element: Element, where: str) -> CoordinateFunction:
        def numbers(tag: str) -> tuple[float, ...]:
            return tuple(map(float, self._numbers(element.find(tag), f"{where}, <{tag}>")))

        match element.tag:
            case "Constant":
                return Constant(self._number(element, "value", where, 0.0))
            case "LinearFunction":
                *slopes, offset = numbers("coefficients")
                return Linear(tuple(slopes), offset)
            case "PolynomialFunction":
                return Polynomial(numbers("coefficients"))
            case "MultiplierFunction":
                inner = self._function_in(element, where)
                if inner is None:
                    self._refuse(where, "a MultiplierFunction of nothing", "a <function> in it")
                return ScaledFunction(inner, self._number(element, "scale", where, 1.0))
            case "SimmSpline" | "NaturalCubicSpline" | "PiecewiseLinearFunction":
                x, y = numbers("x"), numbers("y")
                if len(x) != len(y) or len(x) < 2 or np.any(np.diff(x) <= 0.0):
                    self._refuse(where, f"{len(x)} <x> and {len(y)} <y>", "two or more points whose <x> grow")
                return (PiecewiseLinear if element.tag == "PiecewiseLinearFunction" else Spline)(x, y)
        known = ", ".join(FUNCTION_TAGS)
        self._refuse(where, f"a {visible_text(element.tag)}, which is not followed", f"one of {known}")

    def _couplings(self) -> dict[str, Coupling]:
        found = {}
        for element in self.root.iter("CoordinateCouplerConstraint"):
            where = f"constraint {visible_text(element.get('name', ''))}"
            if self._text(element, "isEnforced").lower() == "false" or (
                self._text(element, "isDisabled").lower() == "true"
            ):
                continue
            dependent = self._text(element, "dependent_coordinate_name")
            independent = tuple(self._text(element, "independent_coordinate_names").split())
            for name in (dependent, *independent):
                if name not in self.coordinates:
                    self._refuse(where, f'the coordinate "{visible_text(name)[:60]}"', "one of the model")
            holder = element.find("coupled_coordinates_function")
            if holder is None or not len(holder):
                self._refuse(where, "no function", "a <coupled_coordinates_function>")
            function = ScaledFunction(
                self._function(holder[0], where), self._number(element, "scale_factor", where, 1.0)
            )
            found[dependent] = Coupling(dependent, independent, function)
        return found

    # Surfaces and muscles.

    def _surfaces(self, bodies: Sequence[Element]) -> dict[str, tuple[str, np.ndarray, Surface | str]]:
        found = {}
        grounds = list(self.root.iter("Ground"))
        holders = [(b.get("name", ""), b, np.eye(4)) for b in bodies] + [(GROUND_BODY, g, np.eye(4)) for g in grounds]
        offsets = {id(f): f for f in self.root.iter("PhysicalOffsetFrame") if f.find("WrapObjectSet") is not None}
        for element in offsets.values():
            body, base = self.frames[element.get("name", "")]
            holders.append((body, element, base))
        for body, holder, base in holders:
            for each in holder.findall("./WrapObjectSet/objects/*"):
                name = each.get("name", "")
                where = f"wrap object {visible_text(name)}"
                turned = "xyz_body_rotation"
                found[name] = (body, base @ self._frame(each, where, "translation", turned), self._surface(each, where))
        return found

    def _surface(self, element: Element, where: str) -> Surface | str:
        """Return the surface of a wrap object; a text says why it is unsupported, "off" that it is inactive."""
        if self._text(element, "active").lower() == "false":
            return "off"
        said = self._text(element, "quadrant").lower() or "all"
        axis = -1 if said == "all" else "xyz".find(said[-1])
        if said != "all" and (axis < 0 or said.strip("+-xyz")):
            self._refuse(f"{where}, <quadrant>", f'"{visible_text(said)[:20]}"', "all, or x, y or z with a sign")
        side = Side(axis, -1.0 if said.startswith("-") else 1.0)
        if element.tag == "WrapCylinder":
            if axis == 2:
                return "found a side along the axis of a cylinder, expected x or y"
            radius, length = (self._number(element, tag, where) for tag in ("radius", "length"))
            self._require_metres(np.array([radius]), f"{where}, <radius>")
            return Cylinder(radius, length, side)
        if element.tag == "WrapSphere":
            return Sphere(
                float(self._require_metres(np.array([self._number(element, "radius", where)]), where)[0]), side
            )
        if element.tag == "WrapEllipsoid":
            radii = self._require_metres(self._numbers(element.find("dimensions"), f"{where}, <dimensions>", 3), where)
            return Ellipsoid((float(radii[0]), float(radii[1]), float(radii[2])), side)
        known = "WrapCylinder, WrapSphere or WrapEllipsoid"
        return f"found a {visible_text(element.tag)}, which is not supported, expected {known}"

    def _muscle(self, element: Element, surfaces) -> MusclePath:
        name = element.get("name", "")
        where = f"muscle {visible_text(name)[:100]}"
        way = next(element.iter("GeometryPath"), None)
        if way is None:
            return MusclePath(name, (), (), "found no <GeometryPath>, expected the points that it runs through")
        points = tuple(self._point(p, where) for p in way.findall("./PathPointSet/objects/*"))
        if len(points) < 2:
            self._refuse(where, f"{len(points)} points", "two or more that it runs through")
        around = []
        for each in way.findall("./PathWrapSet/objects/PathWrap"):
            target = self._text(each, "wrap_object").split("/")[-1]
            if target not in surfaces:
                self._refuse(where, f'the wrap object "{visible_text(target)[:60]}"', "one of the model")
            body, base, surface = surfaces[target]
            if surface == "off":
                continue
            if isinstance(surface, str):
                return MusclePath(name, points, (), f"wrap object {target}: {surface}")
            if isinstance(surface, Ellipsoid):
                method = self._text(each, "method").lower() or "hybrid"
                if method not in METHODS:
                    why = f'found the method "{visible_text(method)[:20]}", which is not followed, expected '
                    return MusclePath(name, points, (), f"wrap object {target}: {why}{' or '.join(METHODS)}")
                surface = Ellipsoid(surface.radii, surface.side, method)
            first, last = -1.0, -1.0
            if each.find("range") is not None:
                first, last = self._numbers(each.find("range"), f"{where}, wrap object {target}, <range>", 2)
            last_point = len(points) - 1 if last < 1 else min(int(last) - 1, len(points) - 1)
            around.append(PathSurface(target, body, base, surface, max(int(first) - 1, 0), last_point))
        return MusclePath(name, points, tuple(around))

    def _point(self, element: Element, muscle: str) -> PathPoint:
        where = f"{muscle}, point {visible_text(element.get('name', ''))[:60]}"
        socket = self._text(element, "socket_parent_frame") or self._text(element, "body")
        body, base = self._resolve_socket(socket, where)
        place = self._require_metres(self._vector(element, "location", where), f"{where}, <location>")
        moves, only = (), None
        if element.tag == "MovingPathPoint":
            moves = tuple(self._moving_coordinate(element, axis, place[i], where) for i, axis in enumerate("xyz"))
            if not np.allclose(base, np.eye(4)):
                self._refuse(where, "a moving point on an offset frame", "one on the body itself")
        elif element.tag == "ConditionalPathPoint":
            low, high = self._numbers(element.find("range"), f"{where}, <range>", 2)
            only = (self._point_coordinate(element, "", where), float(low), float(high))
        elif element.tag != "PathPoint":
            self._refuse(where, f"a {visible_text(element.tag)}", "PathPoint, ConditionalPathPoint or MovingPathPoint")
        return PathPoint(body, base[:3, :3] @ place + base[:3, 3], moves, only)

    def _moving_coordinate(self, element: Element, axis: str, otherwise: float, where: str):
        holder = element.find(f"{axis}_location")
        if holder is None or not len(holder):
            return Constant(float(otherwise)), ()
        function = self._function(holder[0], f"{where}, {axis}_location")
        name = self._point_coordinate(element, f"{axis}_", where)
        return function, (name,)

    def _point_coordinate(self, element: Element, prefix: str, where: str) -> str:
        """Return the name of the coordinate that a moving or conditional point depends on."""
        said = self._text(element, f"socket_{prefix}coordinate") or self._text(element, f"{prefix}coordinate")
        name = said.split("/")[-1]
        if name not in self.coordinates:
            self._refuse(where, f'the coordinate "{visible_text(said)[:60]}"', "one of the model")
        return name

    def _require_joined(self, muscle: MusclePath, skeleton: Skeleton) -> None:
        for body in muscle.bodies:
            if body != GROUND_BODY and body not in skeleton.joints:
                self._refuse(
                    f"muscle {muscle.muscle}", f"the body {visible_text(body)} without a joint", "one that is joined"
                )
