"""What a calibration may change of muscles: bounds from physiology, and how far people differ from an anatomical model.

An EMG envelope and a joint's torque do not determine every number of every muscle. What a recording says little of is
held near the anatomical value, in units of how far people spread about it; what it says much of moves freely within
bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...models.hill import FreeParameter, HillModel, HillMuscle


@dataclass(frozen=True)
class Freedom:
    """One quantity that calibration frees."""

    quantity: str  # One of `pellucid.models.hill.FREE` or ``TWINS``
    shared: bool  # One number for all muscles, instead of one for each
    relative: bool  # Whether bounds and spread are shares of what each muscle has, or SI
    lower: float
    upper: float
    spread: float  # Standard deviation among people about the anatomical value
    logarithm: bool = False  # Whether spread is that of the logarithm: half and twice are equally far away


FREEDOMS: Mapping[str, Freedom] = {
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
"""Everything that can be freed, by quantity; the published bounds on activation (A in [-3, 0], delay up to 100 ms)."""

USUAL = ("strength", "tendon_slack_length", "optimal_fibre_length", "passive_scale", "shape", "time_constant", "delay")
"""What is freed if nothing else is asked."""

UNITS: Mapping[str, str] = {"time_constant": "s", "delay": "s", "max_velocity": "1/s"}
"""Of quantities that are no factors and have one."""

STAGES: tuple[tuple[str, ...], ...] = (
    ("strength",),
    ("strength", "shape", "time_constant", "delay"),
    USUAL,
)
"""What is free in each stage of a staged calibration: what torque says most of comes first."""


@dataclass(frozen=True)
class Prior:
    """A free parameter with what anatomy says of it: a mean and a standard deviation, of its logarithm if so said."""

    free: FreeParameter
    expected: float
    spread: float
    logarithm: bool = False

    @property
    def unit(self) -> str:
        """Of the number: a factor has none."""
        return "1" if self.free.relative else UNITS.get(self.free.quantity, "1")


def muscle_priors(muscles: Sequence[HillMuscle], quantities: Sequence[str] = USUAL) -> tuple[Prior, ...]:
    """Free parameters of some muscles, with their priors."""
    names = tuple(m.name for m in muscles)
    free = []
    for quantity in quantities:
        f = FREEDOMS[quantity]
        for group in (names,) if f.shared else tuple((name,) for name in names):
            name = quantity if f.shared else f"{quantity}.{group[0]}"
            free.append(FreeParameter(name, quantity, group, f.lower, f.upper, f.relative))
    start = HillModel(muscles, free).start
    return tuple(
        Prior(
            parameter,
            float(expected),
            FREEDOMS[parameter.quantity].spread,
            FREEDOMS[parameter.quantity].logarithm,
        )
        for parameter, expected in zip(free, start, strict=True)
    )
