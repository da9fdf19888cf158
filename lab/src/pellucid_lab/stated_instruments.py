"""Instruments of a virtual robot, read from the same table ``[rig.instruments]`` that its study.toml contains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pellucid.controllers.instruments import Instruments
from pellucid.controllers.study.rig_instruments import rig_instruments
from pellucid.study.study_file import OneJoint, rig_units

ENCODER_NOISE_FACTOR = 4.0
"""Number of standard deviations of an encoder's noise in the error of one reading, in addition to the quantum [1]."""


def stated_instruments(rig: Mapping[str, Any]) -> Instruments:
    """Return the instruments that a table ``[rig]`` of study.toml with one joint states."""
    return rig_instruments(OneJoint.model_validate(rig, context=rig_units({"rig": rig})))
