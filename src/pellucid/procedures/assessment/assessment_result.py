"""What an assessment found, with what its tables, figures and sentences need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...assessment.comparison import ConditionComparison
from ...assessment.indices import Index, IndexTable, Isochrony, indices_along
from ...assessment.measured import MeasuredMovement
from ...assessment.survival import Survival
from ...recordings.study import Study
from ...units import COORDINATES, Coordinate
from ..result import Result
from .certified import Certified


@dataclass(frozen=True, eq=False)
class Assessed:
    """One index: every participant's values (`table`) and what they say of the conditions (`comparison`)."""

    table: IndexTable
    comparison: ConditionComparison

    @property
    def name(self) -> str:
        """Of the index."""
        return self.table.index.name

    def change_of_median(self, control: str, condition: str) -> float | None:
        """Median over participants of each one's own change from control, as a share; None without a control."""
        if control not in self.table.conditions or condition not in self.table.conditions:
            return None
        base = self.table.column(control)
        return float(np.median(self.table.column(condition) / base - 1.0)) if (base > 0.0).all() else None

    def share_of_control(self, control: str) -> float | None:
        """What a change is to be divided by to become a share of control's mean; None where shares say little."""
        if self.table.index.over_control:
            return 1.0
        if not self.table.index.scaled or control not in self.table.conditions:
            return None
        return float(self.table.column(control).mean())


@dataclass(frozen=True)
class Sensitivity:
    """Change from control by one rule for movements."""

    words: str  # The rule
    index: str
    condition: str
    control: float  # Mean in the control condition, in the index's unit; NaN for an index over control
    change: float  # From control, as a share
    p_value: float  # Friedman's, counted where it can be


@dataclass(frozen=True, eq=False)
class Profile:
    """Mean movement of one condition, all participants' movements of one kind."""

    condition: str
    time: np.ndarray  # (n,) From the movement's start [s]
    angle: np.ndarray  # angle, velocity, acceleration: (n,) The angle from where it started [rad], [rad/s], [rad/s^2]
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, eq=False)
class Settling:
    """How many movements of a condition still went on after a time, all participants' together."""

    condition: str
    curve: Survival


@dataclass(frozen=True)
class Needed:
    """Participants with whom a change from control would be found in 8 of 10 studies."""

    index: str  # ``""`` where the effect stands for that of any index
    change: float | None  # As a share of control's mean
    effect: float  # The change over the standard deviation of participants' changes (d of pairs)
    participants: int | None  # None where more than were tried


@dataclass(frozen=True, kw_only=True)
class AssessmentResult(Result):
    """Everything an assessment found."""

    paragraph: str = ""  # What was found and what was not, in plain sentences
    control: str = ""
    conditions: tuple[str, ...] = ()  # conditions, participants: That were compared; control is the first condition
    participants: tuple[str, ...] = ()
    without: Mapping[str, str] = field(default_factory=dict)  # Participants who were left out, and why
    absent: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # Conditions that each of them lacks
    unusable: Mapping[str, str] = field(default_factory=dict)  # Recordings that were left out, and why
    movements: int = 0  # That were used
    left_out: Mapping[str, int] = field(default_factory=dict)  # Stretches without a movement that could be used, by why
    assessed: Mapping[str, Assessed] = field(default_factory=dict, repr=False)  # By index
    isochrony: tuple[Isochrony, ...] = field(default=(), repr=False)
    sensitivity: tuple[Sensitivity, ...] = field(default=(), repr=False)
    needed: tuple[Needed, ...] = ()
    certified: tuple[Certified, ...] = ()  # By condition, where margins are stated
    profiles: tuple[Profile, ...] = field(default=(), repr=False)
    settling: tuple[Settling, ...] = field(default=(), repr=False)
    profile_of: str = ""  # Which movements the profiles are the means of
    # Every movement that was used, by the study's own rule
    measured: tuple[MeasuredMovement, ...] = field(default=(), repr=False)
    unit: str = "rad"  # Of what people moved along: "rad", or "m"

    @property
    def along(self) -> Coordinate:
        """What people moved along."""
        return COORDINATES[self.unit]

    @property
    def indices(self) -> Mapping[str, Index]:
        """Every index there could be, in this unit."""
        return indices_along(self.along)

    def written(self, study: Study) -> str:
        return f"Tables for a paper in {study.made / 'tables'}"

    @property
    def prose(self) -> str:
        return self.paragraph

    def save_more(self, study: Study) -> None:
        from .paper_tables import write_tables

        write_tables(study.place("tables"), self)
