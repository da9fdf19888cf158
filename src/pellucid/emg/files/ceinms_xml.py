"""Read CEINMS subjects: XML with the constants of each muscle, the joints that it moves and the EMG that excites it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ...files.readers._xml import read_xml
from .muscle_constants import MuscleConstants, require_physical, require_range

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
