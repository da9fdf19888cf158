"""Compare a posterior with the intervals of a fit, and report it where an interval is refused."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.estimates import Parameter, Verdict
from ...numerics.posterior.posterior import DrawnParameter, Posterior
from ..pages.quantities import number, unit_text
from ..results import ResultRow
from .result import FigureTable

AGREEMENT_FACTOR = 2.0
"""An interval and a posterior disagree if their widths differ by more than this factor."""


@dataclass(frozen=True)
class ComparedPosterior:
    """One parameter by a fit and by a posterior."""

    fitted: Parameter  # parameter by the fit
    drawn: DrawnParameter  # parameter by the posterior

    def widths(self, level: float) -> float:
        """Return the posterior's width divided by the interval's; NaN without an interval."""
        p = self.fitted
        if p.refused or p.at_bound or not p.standard_error > 0.0:
            return float("nan")
        return float(np.ptp(self.drawn.interval(level)) / np.ptp(p.interval(level)))

    def told(self, level: float) -> str:
        """Return the disagreement in a few words; empty if both agree."""
        ratio = self.widths(level)
        if self.drawn.refused:
            return "not settled"
        if self.drawn.told_by_prior:
            return "determined by the prior"
        if self.fitted.refused:
            return "no interval; posterior determined by the data"
        if ratio > AGREEMENT_FACTOR:
            return "interval narrower than the posterior"
        if ratio < 1.0 / AGREEMENT_FACTOR:
            return "interval wider than the posterior"
        return ""


def pair_with_posterior(parameters: Sequence[Parameter], posterior: Posterior) -> tuple[ComparedPosterior, ...]:
    """Pair each parameter with that of the posterior, if the posterior has it."""
    return tuple(ComparedPosterior(p, posterior[p.name]) for p in parameters if p.name in posterior)


def posterior_table(title: str, compared: Sequence[ComparedPosterior], level: float) -> FigureTable:
    """Return a table with interval and posterior side by side."""
    share = f"{100.0 * level:g} %"
    heads = ("Parameter", "unit", f"{share} interval", "median", f"{share} posterior", "ratio of widths", "remark")
    rows = []
    for one in compared:
        p, drawn, ratio = one.fitted, one.drawn, one.widths(level)
        rows.append(
            (
                p.name,
                unit_text(p.unit) or "1",
                "not identifiable" if p.refused else "at its bound" if p.at_bound else _range(p, level),
                number(drawn.value, drawn.standard_error),
                "not settled" if drawn.refused else _range(drawn, level),
                ratio if np.isfinite(ratio) else None,
                one.told(level),
            )
        )
    some = len(heads) if any(row[-1] for row in rows) else len(heads) - 1
    return FigureTable(title, heads[:some], tuple(row[:some] for row in rows))


def posterior_rows(
    head: str, compared: Sequence[ComparedPosterior], level: float, plain: ResultRow
) -> Iterator[ResultRow]:
    """Yield the rows `<head>.posterior.<name>`, the median with its interval, and `.width`, relative to the fit.

    `plain` is a row with the remaining fields.
    """
    for one in compared:
        drawn, ratio = one.drawn, one.widths(level)
        note = "; ".join(filter(None, (drawn.sentence(level), one.told(level), plain.note)))
        value = None if drawn.refused else drawn.value
        own = f"{head}.posterior.{drawn.name}"
        yield replace(plain, id=own, value=value, unit=drawn.unit, note=note)
        if np.isfinite(ratio) and not drawn.refused:
            yield replace(plain, id=f"{own}.width", value=ratio, note="width relative to that of the interval")


def posterior_verdicts(
    compared: Sequence[ComparedPosterior], posterior: Posterior, level: float, who: str = ""
) -> Iterator[Verdict]:
    """Yield verdicts on whether a posterior can be read, its disagreements, and its results for refused intervals."""
    head = f"{who}: " if who else ""
    if posterior.unsettled:
        yield Verdict(
            "warning", f"{head}The posterior has not settled: {posterior.unsettled}; it is not used."
        )
        return
    determined = [one for one in compared if not one.drawn.told_by_prior]
    # An interval may be wider than a posterior that the prior limits, but it should not be narrower.
    apart = [
        one
        for one in compared
        if one.widths(level) > AGREEMENT_FACTOR or (one in determined and one.widths(level) < 1.0 / AGREEMENT_FACTOR)
    ]
    if apart:
        widths_text = "; ".join(
            f"{_named(one)} {_range(one.fitted, level)} from the fit, {_range(one.drawn, level)} from the posterior"
            for one in apart
        )
        yield Verdict(
            "warning",
            f"{head}Intervals and posterior differ in width by more than a factor of {AGREEMENT_FACTOR:g}: "
            f"{widths_text}.",
            "Take the wider of the two.",
        )
    for one in (one for one in determined if one.fitted.refused):
        found = f"{_range(one.drawn, level)} {unit_text(one.drawn.unit)}".rstrip()
        yield Verdict(
            "note",
            f"{head}The fit gives no interval for {_named(one)}; its posterior, which the data determine, is {found}.",
        )
    prior = [_named(one) for one in compared if one.drawn.told_by_prior]
    if prior:
        verb = "is" if len(prior) == 1 else "are"
        yield Verdict(
            "note", f"{head}In the posterior {', '.join(prior)} {verb} determined by the prior, not by the data."
        )
    if posterior.pairs:
        pairs_text = ", ".join(f"{a} and {b} ({r:+.2f})".replace("_", " ") for a, b, r in posterior.pairs)
        yield Verdict("note", f"{head}Correlated parameters in the posterior: {pairs_text}.")
    if any(np.isfinite(one.widths(level)) for one in determined) and not apart:
        yield Verdict(
            "good",
            f"{head}The widths of intervals and posterior agree within a factor of {AGREEMENT_FACTOR:g}.",
        )


def _named(one: ComparedPosterior) -> str:
    return one.fitted.name.replace("_", " ")


def _range(p: Parameter, level: float) -> str:
    low, high = p.interval(level)
    return f"{number(low, p.standard_error)} to {number(high, p.standard_error)}"
