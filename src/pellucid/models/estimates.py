"""The result of every fit: parameters by name with their covariance, as text, table, data frame and figure.

An identified parameter with its uncertainty, the whiteness of residuals, and verdicts in words.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import isnan, nextafter
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from .._domains import offered
from .._errors import PellucidError
from .._tabular import data_frame, html_table, text_table
from .card import CardParameter, named

if TYPE_CHECKING:
    import pandas

    from .drawing.drawing import Figure

UNDETERMINED_REASON = "undetermined: a change of the recordings by 1e-12 moves it beyond its interval"
"""Reason for refusing the interval of a parameter whose value depends on the rounding of the processor."""


@dataclass(frozen=True)
class Parameter:
    """An identified parameter with its uncertainty.

    Parameters
    ----------
    name, unit : str
        The field's term, and the SI unit as plain text (per ampere or per volt if the drive constant is unknown).
    value, standard_error : float
        Value and standard error in `unit`. The standard error allows for coloured residuals and, if a discrepancy part
        exists, for effects that the model neglects.
    at_bound : bool
        Whether a physical bound holds the value. Its interval is then one-sided.
    identifiable : bool
        False if the interval contains zero or the recordings do not determine this parameter (see the verdicts).
    influence : float
        RMS effort per unit of the parameter, divided by the RMS effort.
    bootstrap : tuple of float, optional
        Block bootstrap's 95 % interval, in `unit`.
    statistical_error : float
        Standard error from coloured residuals alone; equal to `standard_error` if no discrepancy part exists.
    refused : str
        Reason for refusing the interval, in words; empty if it may be read.
    carried : float, optional
        For a friction coefficient: the value that a compensation may use. Together with the other coefficients it
        exceeds the true friction in at most one case of twenty.
    doubt : str
        Why the interval may exclude the true value although it may be read, in a few words; empty without a reason.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    at_bound: bool = False
    identifiable: bool = True
    influence: float = float("nan")
    bootstrap: tuple[float, float] | None = None
    statistical_error: float = float("nan")
    refused: str = ""
    carried: float | None = None
    doubt: str = ""

    def __post_init__(self) -> None:
        if isnan(self.statistical_error):
            object.__setattr__(self, "statistical_error", self.standard_error)

    @property
    def undetermined(self) -> bool:
        """Whether the recordings do not determine the value: another processor's rounding would change it."""
        return self.refused == UNDETERMINED_REASON

    @property
    def trusted(self) -> bool:
        """Whether the interval may be read."""
        return not self.refused

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Return the confidence interval at `level`, a share between 0 and 1, in the parameter's unit."""
        if not 0.0 < level < 1.0:
            raise PellucidError(f"interval: found level={level!r}, expected a share between 0 and 1, such as 0.95")
        half = NormalDist().inv_cdf(min(0.5 + level / 2.0, nextafter(1.0, 0.0))) * self.standard_error
        return self.value - half, self.value + half

    def sentence(self, level: float = 0.95) -> str:
        """Return the interval at `level` in words, with the share that coloured residuals alone contribute."""
        if self.refused:
            return f"not identifiable: {self.refused}"
        low, high = self.interval(level)
        said = f"{100.0 * level:g} % interval {low:.6g} to {high:.6g}"
        if self.statistical_error == self.standard_error:
            return said
        share = 0.5 * (high - low) * self.statistical_error / self.standard_error
        return f"{said}, coloured residuals alone ± {share:.3g}"

    def on_card(self, level: float) -> CardParameter:
        """Return the entry of a model card for this parameter, with its interval at `level`."""
        shared = {each.name: getattr(self, each.name) for each in fields(CardParameter) if each.name != "interval"}
        return CardParameter(**shared, interval=self.interval(level))

    @property
    def relative_sd(self) -> float:
        """Statistical error as a percentage of the value; infinite at zero."""
        return 100.0 * self.statistical_error / abs(self.value) if self.value else float("inf")


@dataclass(frozen=True)
class Whiteness:
    """Tests of whether residuals are white."""

    lag1: float  # lag-1 autocorrelation
    statistic: float  # Ljung-Box statistic
    p_value: float  # p value of the Ljung-Box test
    lags: int  # number of lags in the test
    effective_share: float  # effective number of independent samples divided by the number of samples; 1 is white


VERDICT_KINDS = ("wrong", "warning", "note", "good")
"""Kinds of verdict, the worst first."""


@dataclass(frozen=True)
class Verdict:
    """A verdict on an estimate or on the recordings.

    Parameters
    ----------
    kind : str
        "wrong" (the figures do not describe the machine until this is corrected), "warning" (some of them cannot be
        trusted), "note" or "good".
    text : str
        The finding, in plain sentences.
    do : str
        The action to take, in a sentence; empty if none is needed.
    finding : str
        Short name of the finding.
    weight : float
        Order among verdicts of one kind: the largest comes first.
    """

    kind: str
    text: str
    do: str = ""
    finding: str = ""
    weight: float = 0.0

    @property
    def said(self) -> str:
        """The finding, followed by the action to take."""
        return f"{self.text} {self.do}".rstrip()


def rank_verdicts(verdicts: Iterable[Verdict]) -> tuple[Verdict, ...]:
    """Sort verdicts by kind and weight, the worst first."""
    return tuple(sorted(verdicts, key=lambda v: (VERDICT_KINDS.index(v.kind), -v.weight)))


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
        return f"{value:.4g}", "not identifiable" if parameter.refused else "-"
    places = int(1 - np.floor(np.log10(error)))
    if not 0 <= places <= 8 or abs(value) >= 1e7:
        return f"{value:.4g}", f"{low:.4g} to {high:.4g}"
    return f"{value:.{places}f}", f"{low:.{places}f} to {high:.{places}f}"


def _remark(parameter: Parameter) -> str:
    """Return the remark on a parameter's interval; empty if there is none."""
    if parameter.at_bound:
        return "held by its bound"
    if parameter.refused:
        return f"not identifiable: {parameter.refused}"
    return "" if parameter.identifiable else "may be zero"
