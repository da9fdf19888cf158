"""Conditions of the pointing experiment at the knee: the orthosis's controllers.

The residual compensator is built from recordings of its wearer, as a lab would identify them. It runs behind the
supervisor of `export`, with the instruments that the orthosis's rig states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from pellucid._errors import StudyError
from pellucid.controllers.residual_compensator import ResidualDesign
from pellucid.controllers.worn import design_worn_law
from pellucid.emg.estimators.causal_map import EmgSettings

from ..knee.chosen_constants import chosen, design_reproduced_law
from ..knee.identified_wearer import IdentifiedWearer
from ..knee.rig import KneeRig
from ..knee.worn_compensator import WornCompensator
from .session import LegLaw


@dataclass(frozen=True)
class LegCondition:
    """One condition in which the orthosis is worn."""

    words: str
    powered: bool  # whether the motor has current
    build: Callable[[IdentifiedWearer], LegLaw] | None  # what makes the law of an identified wearer; None for no law

    def law(self, identified: IdentifiedWearer | None) -> LegLaw | None:
        """Return a new law for an identified wearer, at rest; None where the spring is asked for no torque."""
        return None if self.build is None or identified is None else self.build(identified)

    def orthosis(self, rig: KneeRig) -> KneeRig:
        """Return the orthosis as it is in this condition: without power its torque loop has no gain."""
        return rig if self.powered else rig.changed({f"torque_loop.{gain}": 0.0 for gain in ("kp", "ki", "kd")})


def exported_law(identified: IdentifiedWearer) -> WornCompensator:
    """Return the law that `export` writes for a wearer, at rest."""
    return _worn(identified, design_worn_law(identified.coupling, identified.rig.period), EmgSettings())


def tuned_law(identified: IdentifiedWearer) -> WornCompensator:
    """Return the reproduction's law, whose constants were tuned on other wearers, at rest."""
    constants = chosen()
    return _worn(
        identified, design_reproduced_law(identified.coupling, identified.rig.period, constants), constants.emg
    )


def _worn(identified: IdentifiedWearer, made: ResidualDesign, emg: EmgSettings) -> WornCompensator:
    return WornCompensator(made, identified.card(emg).emg.build(), instruments=identified.rig.instruments)


LEG_CONDITIONS: Mapping[str, LegCondition] = {
    "no_power": LegCondition("worn without power", False, None),
    "zero_impedance": LegCondition("torque loop alone", True, None),
    "residual_default": LegCondition("residual compensator as exported", True, exported_law),
    "residual": LegCondition("residual compensator, tuned on other wearers, not exported", True, tuned_law),
}
"""Conditions that can be worn, by name."""


def leg_conditions(names: Sequence[str] | None) -> dict[str, LegCondition]:
    """Return the conditions of these names, by default all of them."""
    chosen_names = list(names or LEG_CONDITIONS)
    unknown = [name for name in chosen_names if name not in LEG_CONDITIONS]
    if unknown or len(set(chosen_names)) < len(chosen_names):
        found = f'found no controller "{unknown[0]}"' if unknown else "found a controller twice"
        raise StudyError(f"conditions: {found}, expected some of {', '.join(LEG_CONDITIONS)}")
    return {name: LEG_CONDITIONS[name] for name in chosen_names}
