"""Table ``[onset]`` of study.toml."""

from __future__ import annotations

from pydantic import Field

from ....study.study_fields import quantity
from ..muscle_tables import MuscleTable


class OnsetTable(MuscleTable):
    """Settings of onset detection: ``[onset]``.

    Attributes
    ----------
    rest : tuple of float or None
        Beginning and end of the rest in every recording [s]; by default the quietest half second of each muscle.
    height : float
        Threshold of the energy above its mean at rest, in standard deviations of rest.
    shortest : float
        Shortest time for which the energy must exceed the threshold [s].
    pause : float
        Shortest pause between two bursts [s]; shorter pauses are within one burst.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    """

    rest: tuple[quantity("s"), quantity("s")] | None = None
    height: float = Field(15.0, gt=0)
    shortest: quantity("s", gt=0) = 0.025
    pause: quantity("s", ge=0) = 0.1
    confidence: float = Field(0.95, gt=0, lt=1)
