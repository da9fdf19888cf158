"""Store calibrated muscles as a remark in the XML file of another program, and read them from it again.

The other program's format has no place for some of the numbers. The remark holds every number, so that the muscles are
restored to the bit. If a number in the file's own elements was changed afterwards, the changed number counts.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ..._errors import PellucidError, RecordingError
from ..._given import read_given, visible_text
from ...models.parameter_card import ParameterCard
from ..models.hill import HillMuscle
from ..models.muscle import CARD_KIND, CalibratedMuscles, calibrated_muscles
from .ceinms_xml import SubjectMuscle, read_subject
from .muscle_constants import MuscleConstants, require_physical
from .osim import read_model

REMARK_START = "pellucid calibrated muscles "
"""Every remark begins with this text, which a table in JSON follows."""

_REMARK_PATTERN = re.compile(rb"\s*<!-- " + REMARK_START.encode() + rb"(\{[^<>]*\}) -->")

MIN_SHAPE_FACTOR = 1e-4
"""Smallest magnitude of a shape factor A that is written into a CEINMS subject, because CEINMS divides by e^A - 1."""


@dataclass(frozen=True)
class MuscleRemark:
    """Calibrated muscles, with their names in the file."""

    muscles: CalibratedMuscles
    names: Mapping[str, str]  # name of each muscle in the file, by the study's name
    period: float = 0.0  # period of the recursion of a CEINMS subject [s]
    study: str = ""  # name of the study that was exported; empty in files of earlier versions

    def text(self) -> str:
        """Return the remark as XML."""
        table = {"names": dict(self.names), "period": self.period, "settings": self.muscles.settings()}
        said = json.dumps({**table, "study": self.study})
        # Two hyphens would end the remark, and tags in it would confuse programs that search for tags.
        for plain, escaped in (("--", "-\\u002d"), ("<", "\\u003c"), (">", "\\u003e")):
            said = said.replace(plain, escaped)
        return f"<!-- {REMARK_START}{said} -->"


def without_remark(content: bytes) -> bytes:
    """Return a file's content without the remark of an earlier export."""
    return _REMARK_PATTERN.sub(b"", content)


def osim_numbers(muscle: HillMuscle) -> dict[str, float]:
    """Return the elements of a muscle in an OpenSim model and their values, SI."""
    return {
        "max_isometric_force": muscle.strength * muscle.max_isometric_force,
        "optimal_fiber_length": muscle.optimal_fibre_length,
        "tendon_slack_length": muscle.tendon_slack_length,
        "pennation_angle_at_optimal": muscle.pennation,
        "max_contraction_velocity": muscle.max_velocity,
    }


def subject_numbers(muscle: HillMuscle, period: float) -> dict[str, float]:
    """Return the elements of a muscle in a CEINMS subject and their values, in the subject's order and units.

    `period` is that of the subject's recursion [s].
    """
    twitch = [-math.exp(-period / t) if t > 0.0 else 0.0 for t in (muscle.time_constant_1, muscle.time_constant_2)]
    return {
        "C1": twitch[0],
        "C2": twitch[1],
        "shapeFactor": max(-muscle.shape, MIN_SHAPE_FACTOR),
        "optimalFiberLength": muscle.optimal_fibre_length,
        "pennationAngle": math.degrees(muscle.pennation),
        "tendonSlackLength": muscle.tendon_slack_length,
        "maxIsometricForce": muscle.max_isometric_force,
        "strengthCoefficient": muscle.strength,
    }


def read_calibrated(path: Path) -> CalibratedMuscles:
    """Return the muscles of an exported ``.osim`` or CEINMS ``.xml``, with numbers that were changed in the file
    since."""
    path = Path(path)
    subject = path.suffix.lower() == ".xml"
    constants = read_subject(path).muscles if subject else read_model(path)
    remark = _read_remark(path)
    changed = []
    for muscle in remark.muscles.muscles:
        name = remark.names.get(muscle.name, muscle.name)
        if name not in constants:
            raise RecordingError(
                f"{path.name}: found no muscle {visible_text(name)}, expected it, as the remark in the file has it"
            )
        found = constants[name]
        if isinstance(found, SubjectMuscle):
            changed.append(_with_subject_numbers(muscle, found, remark.period))
        else:
            changed.append(_with_model_numbers(muscle, found))
    return replace(remark.muscles, muscles=tuple(changed))


def _read_remark(path: Path) -> MuscleRemark:
    found = _REMARK_PATTERN.findall(read_given(path))
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


def _with_model_numbers(muscle: HillMuscle, found: MuscleConstants) -> HillMuscle:
    written = osim_numbers(muscle)
    return _with_changed_numbers(
        muscle,
        max_isometric_force=(found.largest_force, written["max_isometric_force"], lambda x: x / muscle.strength),
        optimal_fibre_length=(found.optimal_fibre_length, written["optimal_fiber_length"], float),
        tendon_slack_length=(found.tendon_slack_length, written["tendon_slack_length"], float),
        pennation=(found.pennation, written["pennation_angle_at_optimal"], float),
    )


def _with_subject_numbers(muscle: HillMuscle, found: SubjectMuscle, period: float) -> HillMuscle:
    written = subject_numbers(muscle, period)

    def constant(c: float) -> float:
        return -period / math.log(-c) if c < 0.0 else 0.0

    return _with_changed_numbers(
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


def _with_changed_numbers(muscle: HillMuscle, **numbers) -> HillMuscle:
    """Return the muscle with the `numbers` that were changed in the file after it was written.

    Each number is given as its value in the file now, the value that was written, and the conversion to the muscle's
    own quantity.
    """
    return replace(muscle, **{key: back(now) for key, (now, written, back) in numbers.items() if now != written})
