"""Quantities of muscles that a calibration may change: physiological bounds and the variation between people.

EMG envelopes and a joint's torque do not determine every parameter of every muscle. Each parameter therefore has a
prior: its anatomical value, with the standard deviation among people. A parameter that the recording determines moves
freely within its bounds; any other stays near its anatomical value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..models.hill import FreeParameter, HillModel, HillMuscle


@dataclass(frozen=True)
class Freedom:
    """Bounds and prior of one quantity that a calibration may free."""

    quantity: str  # name in `pellucid.emg.models.hill`
    shared: bool  # whether all muscles share one value
    relative: bool  # whether bounds and spread are factors of each muscle's anatomical value instead of SI
    lower: float
    upper: float
    spread: float  # standard deviation among people around the anatomical value
    logarithm: bool = False  # whether the spread is that of the logarithm, so that half and double are equally far


QUANTITY_FREEDOMS: Mapping[str, Freedom] = {
    freedom.quantity: freedom
    for freedom in (
        Freedom("strength", False, True, 0.3, 3.0, 0.4, logarithm=True),
        Freedom("tendon_slack_length", False, True, 0.95, 1.05, 0.02),
        Freedom("optimal_fibre_length", False, True, 0.85, 1.15, 0.06),
        Freedom("passive_scale", False, False, 0.0, 3.0, 0.5),
        Freedom("shape", True, False, -3.0, 0.0, 1.0),
        Freedom("time_constant", False, False, 0.005, 0.06, 0.015),
        Freedom("delay", True, False, 0.0, 0.1, 0.02),
        Freedom("max_velocity", True, False, 5.0, 15.0, 3.0),
        Freedom("force_length_width", True, False, 0.25, 0.8, 0.15),
        Freedom("optimal_length_shift", True, False, 0.0, 0.25, 0.1),
    )
}
"""All quantities that can be freed, by name. The bounds on activation (A in [-3, 0], delay up to 100 ms) are
published."""

DEFAULT_QUANTITIES = (
    "strength",
    "tendon_slack_length",
    "optimal_fibre_length",
    "passive_scale",
    "shape",
    "time_constant",
    "delay",
)
"""Quantities that are freed by default."""

QUANTITY_UNITS: Mapping[str, str] = {"time_constant": "s", "delay": "s", "max_velocity": "1/s"}
"""Units of the quantities that are not dimensionless."""

CALIBRATION_STAGES: tuple[tuple[str, ...], ...] = (
    ("strength",),
    ("strength", "shape", "time_constant", "delay"),
    DEFAULT_QUANTITIES,
)
"""Quantities that are free in each stage of a staged calibration: those that the torque determines best come first."""


@dataclass(frozen=True)
class Prior:
    """A free parameter with its anatomical prior: mean and standard deviation, the latter of the logarithm if so
    stated."""

    free: FreeParameter
    expected: float
    spread: float
    logarithm: bool = False

    @property
    def unit(self) -> str:
        """Unit of the parameter; "1" for a factor."""
        return "1" if self.free.relative else QUANTITY_UNITS.get(self.free.quantity, "1")


def muscle_priors(muscles: Sequence[HillMuscle], quantities: Sequence[str] = DEFAULT_QUANTITIES) -> tuple[Prior, ...]:
    """Return the free parameters of some muscles with their priors."""
    names = tuple(m.name for m in muscles)
    free = []
    for quantity in quantities:
        f = QUANTITY_FREEDOMS[quantity]
        for group in (names,) if f.shared else tuple((name,) for name in names):
            name = quantity if f.shared else f"{quantity}.{group[0]}"
            free.append(FreeParameter(name, quantity, group, f.lower, f.upper, f.relative))
    start = HillModel(muscles, free).start
    return tuple(
        Prior(
            parameter,
            float(expected),
            QUANTITY_FREEDOMS[parameter.quantity].spread,
            QUANTITY_FREEDOMS[parameter.quantity].logarithm,
        )
        for parameter, expected in zip(free, start, strict=True)
    )
