"""The margin of an end point: the largest change that does not matter, stated before the data are seen."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from .._errors import PellucidError


@dataclass(frozen=True)
class Margin:
    """Largest change that does not matter: from `low` to `high`, in the unit of the differences; one may be
    infinite."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low < self.high or (self.low == -inf and self.high == inf):
            raise PellucidError(f"margin: found {self.low:g} to {self.high:g}, expected a low end below a high one")

    @property
    def half_width(self) -> float:
        """Half of the margin's width; of a margin with one end the distance of that end from 0."""
        if np.isinf(self.low) or np.isinf(self.high):
            return abs(self.high if np.isinf(self.low) else self.low)
        return 0.5 * (self.high - self.low)

    @classmethod
    def either_way(cls, size: float) -> Margin:
        """Return the margin from -`size` to `size`."""
        return cls(-abs(size), abs(size))

    @classmethod
    def of_ratio(cls, share: float) -> Margin:
        """Return the margin for logarithms of ratios: from 1/(1 + share) to 1 + share."""
        return cls.either_way(float(np.log1p(share)))
