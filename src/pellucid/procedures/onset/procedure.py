"""When muscles become active, and for how long, from raw EMG."""

from __future__ import annotations

from pydantic import Field

from ...recordings.study_fields import quantity
from ..muscle_tables import MuscleTable
from ..procedure import Procedure, late


class OnsetTable(MuscleTable):
    """When muscles become active: ``[onset]``.

    Attributes
    ----------
    rest : tuple of float or None
        Where every recording is at rest [s]; without it the quietest half second of each muscle.
    height : float
        Standard deviations of rest above its mean that the energy has to pass.
    shortest : float
        Time that it has to stay there [s].
    pause : float
        Shorter pauses are within one burst [s].
    confidence : float
        Of the intervals, in (0, 1).
    """

    rest: tuple[quantity("s"), quantity("s")] | None = None
    height: float = Field(15.0, gt=0)
    shortest: quantity("s", gt=0) = 0.025
    pause: quantity("s", ge=0) = 0.1
    confidence: float = Field(0.95, gt=0, lt=1)


class OnsetProcedure(Procedure):
    """When muscles become active."""

    name, command = "onset", "onset"
    table = OnsetTable
    whole = True
    faults = late("onset.find_onsets", "faults")
    run = late("onset.find_onsets", "find_onsets")
    page = late("onset.onset_page", "page")
