"""One identified parameter and what is known of it; how white residuals are; a verdict in words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import isnan

from ..models.card import CardParameter

UNDETERMINED = "undetermined: a change of the recordings by 1e-12 moves it beyond its interval"
"""Why the interval of a parameter is refused that means another number on every machine."""


@dataclass(frozen=True)
class Parameter:
    """An identified parameter and what is known of it.

    Parameters
    ----------
    name, unit : str
        The field's term; SI unit as plain text (per ampere or per volt where the drive constant is unknown).
    value, standard_error : float
        In `unit`; the standard error allows for coloured residuals and, where a discrepancy part exists, for what the
        model leaves out.
    at_bound : bool
        A physical bound holds the value: its interval is then one-sided.
    identifiable : bool
        False where the interval holds zero or the recording does not carry this parameter (see the verdicts).
    influence : float
        RMS effort that one unit of it makes, over the RMS effort: what its uncertainty matters.
    bootstrap : tuple of float, optional
        The block bootstrap's 95 % interval, in `unit`.
    statistical_error : float
        What of the standard error coloured residuals alone make; all of it where no discrepancy part exists.
    refused : str
        Why no interval should be read, in words; empty where one may.
    carried : float, optional
        Of a coefficient of friction, what a compensation carries: together with the others it exceeds the true friction
        in one case of twenty at most.
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
        """Whether the recordings leave the value to chance: another processor's rounding finds another one."""
        return self.refused == UNDETERMINED

    @property
    def trusted(self) -> bool:
        """Whether the interval may be read."""
        return not self.refused

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval at `level`, in the parameter's unit."""
        from scipy.special import ndtri

        half = float(ndtri(0.5 + level / 2.0)) * self.standard_error
        return self.value - half, self.value + half

    def sentence(self, level: float = 0.95) -> str:
        """The interval at `level` in words, with what of it coloured residuals alone make."""
        if self.refused:
            return f"interval refused: {self.refused}"
        low, high = self.interval(level)
        said = f"{100.0 * level:g} % interval {low:.6g} to {high:.6g}"
        if self.statistical_error == self.standard_error:
            return said
        share = 0.5 * (high - low) * self.statistical_error / self.standard_error
        return f"{said}, coloured residuals alone ± {share:.3g}"

    def on_card(self, level: float) -> CardParameter:
        """The same as a model card keeps it, its interval at `level`."""
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
        """Statistical error as a percentage of the value (infinite at zero): how well the recording shows it."""
        return 100.0 * self.statistical_error / abs(self.value) if self.value else float("inf")


@dataclass(frozen=True)
class Whiteness:
    """How far residuals are from white: lag-1 autocorrelation, Ljung-Box statistic and p value over `lags` lags,
    and the effective share of independent samples (1 is white)."""

    lag1: float
    statistic: float
    p_value: float
    lags: int
    effective_share: float


KINDS = ("wrong", "warning", "note", "good")
"""Of verdicts, worst first."""


@dataclass(frozen=True)
class Verdict:
    """What the recordings do or do not show.

    Parameters
    ----------
    kind : str
        "wrong" (the figures are not the machine's until this is mended), "warning" (some of them cannot be trusted),
        "note" or "good".
    text : str
        What was found, in plain sentences.
    do : str
        What to write, or to record, in a sentence; empty where nothing is to be done.
    finding : str
        Its short name.
    weight : float
        Of two verdicts of one kind the heavier comes first.
    """

    kind: str
    text: str
    do: str = ""
    finding: str = ""
    weight: float = 0.0

    @property
    def said(self) -> str:
        """What was found, and what to do."""
        return f"{self.text} {self.do}".rstrip()


def ranked(verdicts: Iterable[Verdict]) -> tuple[Verdict, ...]:
    """The same, worst first: praise never stands above a fault."""
    return tuple(sorted(verdicts, key=lambda v: (KINDS.index(v.kind), -v.weight)))
