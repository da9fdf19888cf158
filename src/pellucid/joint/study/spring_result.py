"""What was found of a spring on the bench: the fit, and every recording with its prediction."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...study.procedures.result import Result
from ..fit.replay import relative_error
from ..fit.spring_fit import SpringFit


@dataclass(frozen=True)
class SpringTrace:
    """One recording's rows, in their order."""

    recording: str
    split: str  # "fitted" or "heldout"
    deflection: np.ndarray = field(repr=False)  # (m,) [rad or m]
    effort: np.ndarray = field(repr=False)  # (m,) in the effort's unit
    predicted: np.ndarray = field(repr=False)  # (m,) in the effort's unit

    @property
    def error(self) -> float:
        """Error of the predicted effort [%]."""
        return relative_error(self.effort, self.predicted)


@dataclass(frozen=True, kw_only=True, repr=False)
class SpringResult(Result):
    """A spring on the bench, from the deflections and efforts of its driven end."""

    fit: SpringFit
    traces: tuple[SpringTrace, ...] = ()  # what is held out last
