"""Read the constants of muscles from OpenSim models."""

from __future__ import annotations

import math
from pathlib import Path

from ..._errors import RecordingError
from ...files.readers._xml import read_xml
from .muscle_constants import MuscleConstants, require_physical

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
