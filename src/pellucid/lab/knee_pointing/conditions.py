"""Conditions of the pointing experiment at the knee: what the orthosis does while it is worn.

The residual compensator is built from recordings of the person who wears it, as a lab would identify them, and stands
behind the supervisor that `export` gives it, with the instruments that the orthosis's rig states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ..._errors import StudyError
from ...control.worn import WornCompensator
from ..knee.chosen_constants import ChosenConstants, chosen, design_for_wearer
from ..knee.identified_wearer import IdentifiedWearer
from ..knee.rig import KneeRig
from .session import LegLaw


@dataclass(frozen=True)
class LegCondition:
    """One condition in which the orthosis is worn."""

    words: str
    powered: bool  # whether the motor has current
    constants: Callable[[], ChosenConstants] | None  # constants of the residual compensator; None for no law

    def law(self, identified: IdentifiedWearer | None) -> LegLaw | None:
        """Return a new law for an identified wearer, at rest; None where the spring is asked for no torque."""
        if self.constants is None or identified is None:
            return None
        constants = self.constants()
        made = design_for_wearer(identified.coupling, identified.rig.period, constants)
        return WornCompensator(made, identified.card(constants.emg).emg.build(), instruments=identified.rig.instruments)

    def orthosis(self, rig: KneeRig) -> KneeRig:
        """Return the orthosis as it is in this condition: without power its torque loop has no gain."""
        return rig if self.powered else rig.changed({f"torque_loop.{gain}": 0.0 for gain in ("kp", "ki", "kd")})


LEG_CONDITIONS: Mapping[str, LegCondition] = {
    "no_power": LegCondition("worn without power", False, None),
    "zero_impedance": LegCondition("torque loop alone", True, None),
    "residual_default": LegCondition("residual compensator, constants of export", True, ChosenConstants),
    "residual": LegCondition("residual compensator, constants tuned on other wearers", True, chosen),
}
"""Conditions that can be worn, by name."""


def leg_conditions(names: Sequence[str] | None) -> dict[str, LegCondition]:
    """Return the conditions of these names, all of them if left out."""
    chosen_names = list(names or LEG_CONDITIONS)
    unknown = [name for name in chosen_names if name not in LEG_CONDITIONS]
    if unknown or len(set(chosen_names)) < len(chosen_names):
        found = f'found no controller "{unknown[0]}"' if unknown else "found a controller twice"
        raise StudyError(f"conditions: {found}, expected some of {', '.join(LEG_CONDITIONS)}")
    return {name: LEG_CONDITIONS[name] for name in chosen_names}
