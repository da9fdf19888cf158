"""An identified parameter with its uncertainty, the whiteness of residuals, and verdicts in words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import isnan

from .card import CardParameter

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
        """Return the confidence interval at `level`, in the parameter's unit."""
        from scipy.special import ndtri

        half = float(ndtri(0.5 + level / 2.0)) * self.standard_error
        return self.value - half, self.value + half

    def sentence(self, level: float = 0.95) -> str:
        """Return the interval at `level` in words, with the share that coloured residuals alone contribute."""
        if self.refused:
            return f"interval refused: {self.refused}"
        low, high = self.interval(level)
        said = f"{100.0 * level:g} % interval {low:.6g} to {high:.6g}"
        if self.statistical_error == self.standard_error:
            return said
        share = 0.5 * (high - low) * self.statistical_error / self.standard_error
        return f"{said}, coloured residuals alone ± {share:.3g}"

    def on_card(self, level: float) -> CardParameter:
        """Return the entry of a model card for this parameter, with its interval at `level`."""
        interval = self.interval(level)
        return CardParameter(
            self.name,
            self.unit,
            self.value,
            self.standard_error,
            interval,
            self.at_bound,
            self.identifiable,
            self.statistical_error,
            self.refused,
            self.carried,
        )

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
