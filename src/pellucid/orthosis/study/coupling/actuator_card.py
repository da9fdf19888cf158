"""Card of an orthosis's actuator: residual motor and gear effects behind its torque loop."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from math import nan

from ...._errors import IdentificationError
from ....files.recording import Recording
from ....joint.fit.actuator_residual import actuator_residual
from ....models.card import CardParameter
from ....models.parameter_card import ParameterCard

CARD_NAME = "actuator"
"""Name of the card's file."""

REQUIRED_CHANNELS = ("command", "torque", "position", "motor_position")
"""Channels that a recording of the actuator must have."""

PARAMETER_UNITS = {
    "actuator_inertia": "kg*m^2",
    "actuator_viscous": "N*m*s/rad",
    "actuator_coulomb": "N*m",
    "actuator_leak": "1/s",
    "actuator_frequency": "rad/s",
    "actuator_damping": "1",
    "spring_stiffness": "N*m/rad",
    "actuator_fit": "1",
}
"""Units of the card's parameters, by their names."""


def actuator_card(study: str, recordings: Sequence[Recording]) -> ParameterCard | None:
    """Identify the actuator from recordings of the orthosis alone; return None if they do not determine it."""
    alone = [
        r
        for r in recordings
        if r.use == "fit" and r.protocol == "sine_tracking" and set(REQUIRED_CHANNELS) <= set(r.channels)
    ]
    if not alone:
        return None
    try:
        found = actuator_residual([tuple(r[c] for c in REQUIRED_CHANNELS) for r in alone], alone[0].fs)
    except IdentificationError:
        return None
    return ParameterCard(
        kind="actuator",
        study=study,
        name=CARD_NAME,
        parameters=tuple(CardParameter(n, PARAMETER_UNITS[n], value, nan, (nan, nan)) for n, value in found.items()),
        settings={"period": 1.0 / alone[0].fs},
        checksums={r.name: r.checksum for r in alone},
        pellucid=version("pellucid"),
    )
