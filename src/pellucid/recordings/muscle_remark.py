"""What a file of another program has no place for: calibrated muscles as a remark in its XML, and read from it again.

The remark holds every number, so that a file gives back the muscles to the bit. A number that was changed in the file's
own elements since counts as changed: the file is what is believed, the remark what it lacks.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from .._errors import PellucidError, RecordingError
from .._given import read_given, seen
from ..models.hill import HillMuscle
from ..models.muscle_card import CARD_KIND, CalibratedMuscles, calibrated_muscles
from ..models.parameter_card import ParameterCard
from .muscle_constants import MuscleConstants, require_physical
from .readers.ceinms_xml import SubjectMuscle, read_subject
from .readers.osim import read_model

HEAD = "pellucid calibrated muscles "
_REMARK = re.compile(rb"\s*<!-- " + HEAD.encode() + rb"(\{[^<>]*\}) -->")

LEAST_SHAPE = 1e-4
"""A CEINMS subject's shape factor divides by e^A - 1."""


@dataclass(frozen=True)
class MuscleRemark:
    """Calibrated muscles, and how a file calls them."""

    muscles: CalibratedMuscles
    names: Mapping[str, str]  # The file's name of each muscle
    period: float = 0.0  # Of the recursion of a CEINMS subject [s]
    study: str = ""  # Name of the study that was exported; empty in files of earlier versions

    def text(self) -> str:
        """As XML."""
        table = {"names": dict(self.names), "period": self.period, "settings": self.muscles.settings()}
        said = json.dumps({**table, "study": self.study})
        # Two hyphens end a remark, and tags in it would confuse who looks for them.
        for plain, escaped in (("--", "-\\u002d"), ("<", "\\u003c"), (">", "\\u003e")):
            said = said.replace(plain, escaped)
        return f"<!-- {HEAD}{said} -->"


def without_remark(content: bytes) -> bytes:
    """A file without what an earlier export left in it."""
    return _REMARK.sub(b"", content)


def osim_numbers(muscle: HillMuscle) -> dict[str, float]:
    """What an OpenSim model says of a muscle: its elements and their values, SI."""
    return {
        "max_isometric_force": muscle.strength * muscle.max_isometric_force,
        "optimal_fiber_length": muscle.optimal_fibre_length,
        "tendon_slack_length": muscle.tendon_slack_length,
        "pennation_angle_at_optimal": muscle.pennation,
        "max_contraction_velocity": muscle.max_velocity,
    }


def subject_numbers(muscle: HillMuscle, period: float) -> dict[str, float]:
    """What a CEINMS subject says of a muscle, in its order and units, at a period of its recursion [s]."""
    twitch = [-math.exp(-period / t) if t > 0.0 else 0.0 for t in (muscle.time_constant_1, muscle.time_constant_2)]
    return {
        "C1": twitch[0],
        "C2": twitch[1],
        "shapeFactor": max(-muscle.shape, LEAST_SHAPE),
        "optimalFiberLength": muscle.optimal_fibre_length,
        "pennationAngle": math.degrees(muscle.pennation),
        "tendonSlackLength": muscle.tendon_slack_length,
        "maxIsometricForce": muscle.max_isometric_force,
        "strengthCoefficient": muscle.strength,
    }


def read_calibrated(path: Path) -> CalibratedMuscles:
    """The muscles of an exported ``.osim`` or CEINMS ``.xml``, as the file has them now."""
    path = Path(path)
    subject = path.suffix.lower() == ".xml"
    constants = read_subject(path).muscles if subject else read_model(path)
    remark = _read_remark(path)
    changed = []
    for muscle in remark.muscles.muscles:
        name = remark.names.get(muscle.name, muscle.name)
        if name not in constants:
            raise RecordingError(
                f"{path.name}: found no muscle {seen(name)}, expected it, as the remark in the file has it"
            )
        found = constants[name]
        made = (
            _of_subject(muscle, found, remark.period) if isinstance(found, SubjectMuscle) else _of_model(muscle, found)
        )
        changed.append(made)
    return replace(remark.muscles, muscles=tuple(changed))


def _read_remark(path: Path) -> MuscleRemark:
    found = _REMARK.findall(read_given(path))
    if len(found) != 1:
        raise RecordingError(
            f"{path.name}: found {len(found)} remarks of calibrated muscles, expected the one of an export"
        )
    try:
        table = json.loads(found[0])
        settings = {str(k): v if isinstance(v, str) else float(v) for k, v in table["settings"].items()}
        numbers = [v for v in settings.values() if isinstance(v, float)]
        if not all(map(math.isfinite, numbers)):
            raise ValueError("a number is not finite")
        muscles = calibrated_muscles(ParameterCard(CARD_KIND, "", path.stem, (), settings=settings))
        names = {str(k): str(v) for k, v in table["names"].items()}
        period, study = float(table["period"]), str(table.get("study", ""))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        said = error if isinstance(error, PellucidError) else repr(error)
        raise RecordingError(
            f"{path.name}: found a damaged remark of calibrated muscles ({said}), export again"
        ) from None
    for m in muscles.muscles:
        require_physical(
            path,
            MuscleConstants(m.name, m.max_isometric_force, m.optimal_fibre_length, m.tendon_slack_length, m.pennation),
        )
    return MuscleRemark(muscles, names, period, study)


def exported_study(path: Path) -> str | None:
    """Return the name of the study whose muscles an exported file has; None if no export with a name wrote it."""
    try:
        return _read_remark(path).study or None
    except PellucidError:
        return None


def _of_model(muscle: HillMuscle, found: MuscleConstants) -> HillMuscle:
    written = osim_numbers(muscle)
    return _changed(
        muscle,
        max_isometric_force=(found.largest_force, written["max_isometric_force"], lambda x: x / muscle.strength),
        optimal_fibre_length=(found.optimal_fibre_length, written["optimal_fiber_length"], float),
        tendon_slack_length=(found.tendon_slack_length, written["tendon_slack_length"], float),
        pennation=(found.pennation, written["pennation_angle_at_optimal"], float),
    )


def _of_subject(muscle: HillMuscle, found: SubjectMuscle, period: float) -> HillMuscle:
    written = subject_numbers(muscle, period)

    def constant(c: float) -> float:
        return -period / math.log(-c) if c < 0.0 else 0.0

    return _changed(
        muscle,
        time_constant_1=(found.twitch[0], written["C1"], constant),
        time_constant_2=(found.twitch[1], written["C2"], constant),
        shape=(found.shape, written["shapeFactor"], lambda x: -abs(x)),
        optimal_fibre_length=(found.optimal_fibre_length, written["optimalFiberLength"], float),
        pennation=(found.pennation, math.radians(written["pennationAngle"]), float),
        tendon_slack_length=(found.tendon_slack_length, written["tendonSlackLength"], float),
        max_isometric_force=(found.largest_force, written["maxIsometricForce"], float),
        strength=(found.strength, written["strengthCoefficient"], float),
    )


def _changed(muscle: HillMuscle, **numbers) -> HillMuscle:
    """The muscle with what stands differently in the file than it was written."""
    return replace(muscle, **{key: back(now) for key, (now, written, back) in numbers.items() if now != written})
