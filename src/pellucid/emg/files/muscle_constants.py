"""The constants of each muscle that come from a model's file and not from a recording.

Read the constants of muscles from OpenSim models.

Read CEINMS subjects: XML with the constants of each muscle, the joints that it moves and the EMG that excites it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from ... import _given
from ..._errors import RecordingError
from ...files.readers._xml import read_xml

PLAUSIBLE_RANGES: Mapping[str, tuple[float, float]] = {
    "largest_force": (1e-3, 1e5), "optimal_fibre_length": (1e-4, 2.0), "tendon_slack_length": (0.0, 2.0),
    "pennation": (0.0, 1.5),
}  # fmt: skip
"""Smallest and largest accepted value of each constant, in the units of `MuscleConstants`. They admit muscles from a
rat to an elephant."""


@dataclass(frozen=True)
class MuscleConstants:
    """One muscle of a musculoskeletal model."""

    name: str  # name in the file
    largest_force: float  # largest isometric force, at the optimal fibre length [N]
    optimal_fibre_length: float  # fibre length with the largest force [m]
    tendon_slack_length: float  # length at which the tendon begins to pull [m]
    pennation: float  # angle of the fibres to the tendon at the optimal fibre length [rad]


Muscle = TypeVar("Muscle", bound=MuscleConstants)


def require_physical(path: Path, muscle: Muscle) -> Muscle:
    """Return the muscle; raise a RecordingError if its name or a constant is not plausible."""
    if re.fullmatch(_given.NAME_PATTERN, muscle.name) is None:
        raise RecordingError(
            f"{path.name}: found the muscle {_given.visible_text(muscle.name[:100])!r}, expected letters, digits, "
            "blanks and . - _"
        )
    for what, bounds in PLAUSIBLE_RANGES.items():
        require_range(path, muscle.name, what, getattr(muscle, what), bounds=bounds)
    return muscle


def require_range(path: Path, muscle: str, what: str, found: float, *, bounds: tuple[float, float]) -> None:
    """Raise a RecordingError if the number `what` of a muscle lies outside its `bounds`."""
    low, high = bounds
    if not low <= found <= high:
        raise RecordingError(f"{path.name}, muscle {muscle}, {what}: found {found:g}, expected {low:g} to {high:g}")


# OpenSim's element for each field of `MuscleConstants`.
_ELEMENT_NAMES = {
    "largest_force": "max_isometric_force",
    "optimal_fibre_length": "optimal_fiber_length",
    "tendon_slack_length": "tendon_slack_length",
    "pennation": "pennation_angle_at_optimal",
}
_OLD_PENNATION = "pennation_angle"  # name of the element before OpenSim 3


def read_model(path: Path) -> dict[str, MuscleConstants]:
    """Return the constants of all muscles of a model by name, for every OpenSim class of muscle."""
    path = Path(path)
    root = read_xml(path)
    if root.tag != "OpenSimDocument":
        raise RecordingError(f"{path.name}: found <{root.tag}>, expected an <OpenSimDocument>")
    # Every class of muscle has this element, and no other object has it.
    muscles = [
        element
        for element in root.iter()
        if element.get("name") and element.find(_ELEMENT_NAMES["largest_force"]) is not None
    ]
    if not muscles:
        raise RecordingError(f"{path.name}: found no muscle, expected some with <{_ELEMENT_NAMES['largest_force']}>")
    return {element.get("name", ""): _constants(path, element) for element in muscles}


def _constants(path: Path, element) -> MuscleConstants:
    values = {}
    for name, key in _ELEMENT_NAMES.items():
        found = element.find(key)
        if found is None and name == "pennation":
            found = element.find(_OLD_PENNATION)
        try:
            values[name] = float(found.text)
        except (AttributeError, TypeError, ValueError):
            values[name] = math.nan
        if not math.isfinite(values[name]):
            said = "none" if found is None else f'"{found.text}"'
            raise RecordingError(f"{path.name}, muscle {element.get('name')}, <{key}>: found {said}, expected a number")
    return require_physical(path, MuscleConstants(element.get("name"), **values))


SUBJECT_RANGES: Mapping[str, tuple[float, float]] = {
    "strengthCoefficient": (1e-3, 100.0), "shapeFactor": (-10.0, 10.0), "C1": (-1.0, 1.0), "C2": (-1.0, 1.0),
    "damping": (0.0, 10.0),
}  # fmt: skip
"""Smallest and largest value that is accepted for each of CEINMS's own numbers [1]. Chosen by judgement; no measurement
is recorded."""


@dataclass(frozen=True)
class SubjectMuscle(MuscleConstants):
    """One muscle of a CEINMS subject."""

    strength: float  # factor on the largest force, from calibration [1]
    shape: float  # shape factor A of the activation [1]; CEINMS has it from -3 to 0, CEINMS-RT without the sign
    twitch: tuple[float, float]  # C1 and C2 of the activation's recursion [1]


@dataclass(frozen=True, eq=False)
class Subject:
    """A CEINMS subject."""

    path: Path
    muscles: Mapping[str, SubjectMuscle]  # muscles by name, in the file's order
    joints: Mapping[str, tuple[str, ...]]  # muscles that move each degree of freedom
    # Muscles that each EMG channel excites; empty if the file does not state them
    excitations: Mapping[str, tuple[str, ...]]
    # Points of the curves ``activeForceLength``, ``passiveForceLength`` and ``forceVelocity`` that the file has, each
    # of shape (2, n): normalised length or velocity, and normalised force
    curves: Mapping[str, np.ndarray]
    damping: float = 0.0  # normalised damping of the fibres [1]; 0 if the file has none


def read_subject(path: Path) -> Subject:
    """Read a subject of CEINMS or CEINMS-RT, uncalibrated or calibrated."""
    path = Path(path)
    root = read_xml(path)
    found = _child(root, "mtuset", "muscles")
    if root.tag != "subject" or found is None:
        raise RecordingError(
            f"{path.name}: found <{root.tag}>, expected the <subject> of CEINMS with <mtuSet> or of CEINMS-RT with "
            "<muscles>"
        )
    default = _child(root, "mtudefault", "muscledefault")
    muscles = {}
    for each in found:
        muscle = _muscle(path, each, default)
        muscles[muscle.name] = muscle
    if not muscles:
        raise RecordingError(f"{path.name}: found no muscle, expected some")
    _refuse_radians(path, muscles)
    joints = _groups(path, _child(root, "dofset", "dofs"), muscles)
    excitations = _groups(path, _child(root, "channels"), muscles)
    damping = _optional(path, default, "damping")
    require_range(path, "mtuDefault", "damping", damping, bounds=SUBJECT_RANGES["damping"])
    return Subject(path, muscles, joints, excitations, _curves(path, default), damping)


def _child(parent, *names):
    """Return the first child with one of the `names`, in upper or lower case; None if there is none."""
    if parent is None:
        return None
    return next((child for child in parent if child.tag.lower() in names), None)


def _muscle(path: Path, element, default) -> SubjectMuscle:
    named = _child(element, "name")
    name = (named.text or "").strip() if named is not None else ""
    if not name:
        raise RecordingError(f"{path.name}: found a muscle without a <name>, expected one")

    def value(key: str) -> float:
        # Numbers that all muscles share may stand in the element of defaults.
        for place in (element, default):
            found = _child(place, key.lower())
            if found is not None:
                return _number(path, found, f"muscle {name}")
        raise RecordingError(f"{path.name}, muscle {name}: found no <{key}>, expected a number")

    muscle = SubjectMuscle(
        name,
        value("maxIsometricForce"),
        value("optimalFiberLength"),
        value("tendonSlackLength"),
        math.radians(value("pennationAngle")),
        value("strengthCoefficient"),
        value("shapeFactor"),
        (value("C1"), value("C2")),
    )
    for what, found in (
        ("strengthCoefficient", muscle.strength),
        ("shapeFactor", muscle.shape),
        *zip(("C1", "C2"), muscle.twitch, strict=True),
    ):
        require_range(path, name, what, found, bounds=SUBJECT_RANGES[what])
    return require_physical(path, muscle)


def _number(path: Path, element, where: str) -> float:
    try:
        number = float(element.text)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise RecordingError(f'{path.name}, {where}, <{element.tag}>: found "{element.text}", expected a number')
    return number


def _optional(path: Path, parent, name: str) -> float:
    found = _child(parent, name)
    return 0.0 if found is None else _number(path, found, parent.tag)


def _refuse_radians(path: Path, muscles: Mapping[str, SubjectMuscle]) -> None:
    largest = max(math.degrees(muscle.pennation) for muscle in muscles.values())
    if 0.0 < largest < math.pi / 4:
        raise RecordingError(
            f"{path.name}: found no pennation angle above {largest:.3g}, which is as in radians; expected degrees, as "
            "CEINMS has them"
        )


def _groups(path: Path, parent, muscles) -> dict[str, tuple[str, ...]]:
    groups = {}
    for each in parent if parent is not None else ():
        name, listed = _child(each, "name"), _child(each, "mtunameset", "musclesequence")
        if name is None or listed is None:
            continue
        members = tuple((listed.text or "").split())
        unknown = [member for member in members if member not in muscles]
        if unknown:
            raise RecordingError(
                f"{path.name}, <{each.tag}> {name.text}: found the muscles {', '.join(unknown)}, expected some that "
                "the file describes"
            )
        groups[(name.text or "").strip()] = members
    return groups


def _curves(path: Path, default) -> dict[str, np.ndarray]:
    curves = {}
    for each in default if default is not None else ():
        if each.tag.lower() != "curve":
            continue
        name, x, y = (_child(each, key) for key in ("name", "xpoints", "ypoints"))
        try:
            points = np.array([x.text.split(), y.text.split()], dtype=float)
            if not np.isfinite(points).all() or np.any(np.diff(points[0]) <= 0.0) or points.size == 0:
                raise ValueError(name)
            curves[name.text.strip()] = points
        except (AttributeError, ValueError):
            raise RecordingError(
                f"{path.name}: found a <{each.tag}> that is incomplete or has lists of different lengths, expected "
                "<name>, <xPoints> that increase and <yPoints>"
            ) from None
    return curves
