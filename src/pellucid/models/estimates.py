"""The result of every fit: parameters by name with their covariance, as text, table, data frame and figure."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .._domains import offered
from .._tabular import data_frame, html_table, text_table
from .card import named
from .parameter import Parameter

if TYPE_CHECKING:
    import pandas

    from .drawing.drawing import Figure


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class NamedEstimates(Mapping[str, Parameter]):
    """Estimated parameters by name: ``fit["inertia"].value``, ``fit["inertia"].interval(0.95)``.

    Attributes
    ----------
    covariance : ndarray, shape (p, p)
        Covariance of the parameters, SI.
    title : str
        Name of the estimated object, in a few words.
    confidence : float
        Confidence level of the printed intervals.
    """

    covariance: np.ndarray = field(repr=False)
    title: str = ""
    confidence: float = 0.95

    @property
    @abstractmethod
    def every(self) -> tuple[Parameter, ...]:
        """The parameters, followed by quantities derived from them."""

    def interval(self, name: str, level: float | None = None) -> tuple[float, float]:
        """Return the confidence interval of a parameter in its unit, at `level` or by default at `confidence`."""
        return self[name].interval(self.confidence if level is None else level)

    def __getitem__(self, name: str) -> Parameter:
        return named(self.every, name, self.title or "this fit")

    def __iter__(self) -> Iterator[str]:
        return (p.name for p in self.every)

    def __len__(self) -> int:
        return len(self.every)

    def _rows(self) -> list[tuple[str, ...]]:
        return [(p.name, *_shown(p, self.confidence), p.unit, _remark(p)) for p in self.every]

    def _head(self) -> tuple[str, ...]:
        return "", "value", f"{100.0 * self.confidence:g} % interval", "unit", ""

    def _facts(self) -> tuple[str, ...]:
        """Sentences on the quality of the fit, printed below the table."""
        return ()

    def to_frame(self, level: float | None = None) -> pandas.DataFrame:
        """Return the parameters as a data frame with one row each, in SI units.

        Parameters
        ----------
        level : float, optional
            Confidence level of the columns ``low`` and ``high``; `confidence` by default.

        Returns
        -------
        pandas.DataFrame
            Indexed by name; columns ``value``, ``standard_error``, ``low``, ``high``, ``unit``, ``identifiable``,
            ``at_bound`` and ``refused``.

        Raises
        ------
        PellucidError
            If pandas is not installed.
        """
        ends = [self.interval(p.name, level) for p in self.every]
        columns: dict[str, Sequence[object]] = {
            "value": [p.value for p in self.every],
            "standard_error": [p.standard_error for p in self.every],
            "low": [low for low, _ in ends],
            "high": [high for _, high in ends],
            "unit": [p.unit for p in self.every],
            "identifiable": [p.identifiable for p in self.every],
            "at_bound": [p.at_bound for p in self.every],
            "refused": [p.refused for p in self.every],
        }
        return data_frame(columns, [p.name for p in self.every])

    def plot(self) -> Figure:
        """Draw the parameters with their intervals, relative to their values, in the colours of the report.

        Returns
        -------
        matplotlib.figure.Figure
        """
        (draw,) = offered("PARAMETER_DRAWINGS")
        return draw(self).figure

    def __str__(self) -> str:
        return "\n".join(filter(None, (self.title, text_table(self._head(), self._rows()), *self._facts())))

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return html_table(self.title, self._head(), self._rows(), self._facts())


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Estimates(NamedEstimates):
    """Estimated parameters by name, which are also a tuple in the order of the covariance.

    Attributes
    ----------
    parameters : tuple of Parameter
        Parameters in the order of the covariance.
    """

    parameters: tuple[Parameter, ...]

    @property
    def every(self) -> tuple[Parameter, ...]:
        """The parameters, followed by quantities derived from them."""
        return self.parameters

    @property
    def array(self) -> np.ndarray:
        """Values of the parameters in their order, shape (p,), SI."""
        return np.array([p.value for p in self.parameters])


def _shown(parameter: Parameter, level: float) -> tuple[str, str]:
    """Return value and interval as text, rounded to two digits of the standard error."""
    value, error = parameter.value, parameter.standard_error
    low, high = parameter.interval(level)
    if not (np.isfinite(error) and error > 0.0) or parameter.refused:
        return f"{value:.4g}", "refused" if parameter.refused else "-"
    places = int(1 - np.floor(np.log10(error)))
    if not 0 <= places <= 8 or abs(value) >= 1e7:
        return f"{value:.4g}", f"{low:.4g} to {high:.4g}"
    return f"{value:.{places}f}", f"{low:.{places}f} to {high:.{places}f}"


def _remark(parameter: Parameter) -> str:
    """Return the remark on a parameter's interval; empty if there is none."""
    if parameter.at_bound:
        return "held by its bound"
    if parameter.refused:
        return f"refused: {parameter.refused}"
    return "" if parameter.identifiable else "not told from 0"
