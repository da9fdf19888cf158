"""End points with their stated margins, and the certificate of one condition with its evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...units import COORDINATES_BY_UNIT
from ..certificate import ESTIMAND_METHODS, Certificate, Estimand
from ..equivalence import Equivalence, Margin
from ..indices import Index, indices_along
from ..mixed_model import MixedModel
from .movement_curves import CurveEndPoint


@dataclass(frozen=True)
class EndPoint:
    """One index with its stated margin."""

    name: str  # name of the index in the catalogue
    along: str  # unit of the coordinate of movement, "rad" or "m"
    stated: str  # margin as stated
    margin: Margin  # margin for logarithms of ratios if `ratio`, else in the index's unit
    ratio: bool  # whether the margin is relative to control

    @property
    def index(self) -> Index:
        """Entry of the catalogue for this coordinate."""
        return indices_along(COORDINATES_BY_UNIT[self.along])[self.name]

    def differences(self, own: np.ndarray, control: np.ndarray | None) -> np.ndarray:
        """Return each participant's difference that is compared with the margin, (n,)."""
        if control is None:
            return own
        return np.log(own / control) if self.ratio else own - control

    def shown(self, value: float) -> float:
        """Convert a difference for display: to %, or to the unit of tables."""
        if self.ratio:
            return 100.0 * float(np.expm1(value))
        return (100.0 if self.index.over_control else self.index.shown[0]) * value

    @property
    def logs(self) -> bool:
        """Whether movements are compared by logarithms, as participants are by ratios."""
        return self.ratio or self.index.over_control

    @property
    def unit(self) -> str:
        """Unit of `shown`."""
        if self.ratio or self.index.over_control:
            return "%"
        return self.index.shown[1]


@dataclass(frozen=True)
class Certified:
    """Certificate of one condition's transparency, with its evidence."""

    condition: str
    certificate: Certificate
    end_points: Mapping[str, EndPoint]
    participants: int  # number of participants with all end points
    needed: int | None  # participants for a power of 90 % if there is no change; None if more than were tried
    estimand: Estimand = "mean"  # quantity that the study states
    people: tuple[str, ...] = ()  # participants with all end points, in the order of the tests' differences
    models: Mapping[str, MixedModel] = field(default_factory=dict)  # mixed model of all movements, by end point
    # sensitivity analyses: results of other tests, by test and end point
    beside: Mapping[str, Mapping[str, Equivalence]] = field(default_factory=dict)
    trends: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # trend and its p value, by end point
    unknown: tuple[str, ...] = ()  # questions that could not be tested, in sentences
    failed: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # failed and all targets, by condition
    curves: tuple[CurveEndPoint, ...] = ()
    # lost and all movements, by end point and condition
    lost: Mapping[str, Mapping[str, tuple[int, int]]] = field(default_factory=dict)
    max_left_out: float = 0.0  # largest share of movements and of participants that may be lost
    lost_people: tuple[str, ...] = ()  # participants who were recorded and take no part

    @property
    def test(self) -> str:
        """Name of the test that the certificate rests on."""
        return ESTIMAND_METHODS[self.estimand]
