"""An assessment's figures as rows of results.json."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from ...study.results import ResultRow, combined_checksum
from .certified_rows import certificate_rows
from .primary_change import ESTIMAND_WORDS, primary_change

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult

COMMAND_NAME = "assess"
"""Name of the command that writes these results."""


def result_rows(found: AssessmentResult) -> tuple[ResultRow, ...]:
    """Return the result rows of an assessment.

    ``<study>.transparency.<index>.<condition>`` is the primary change from control in % (SPARC, LDLJ and the signed
    end-point error: in their own unit; interaction: the mean itself); ``<study>.assess.<index>.<condition>.<what>`` the
    rest, with other estimates of the change as sensitivity analyses.
    """
    # All recordings share one checksum, because every value comes from all of them.
    digest = combined_checksum(found.checksums.values())
    rows: list[ResultRow] = []

    def add(name: str, value: float | None, unit: str, note: str = "") -> None:
        rows.append(ResultRow(f"{found.study}.{name}", value, unit, COMMAND_NAME, "fitted", digest, note))

    add("assess.participants", len(found.participants), "1", _without(found))
    add(
        "assess.movements", found.movements, "1", ", ".join(f"{n} left out: {why}" for why, n in found.left_out.items())
    )
    for each in found.assessed.values():
        _index_rows(found, each, add)
    for each in found.settling:
        head = f"assess.settling.{each.condition.lower()}"
        note = "Kaplan and Meier, all participants together"
        add(f"{head}.median", each.curve.median, "s", note)
        add(f"{head}.never", 100.0 * each.curve.cut, "%", "not at rest when the next target came")
    for line in found.isochrony:
        head = f"assess.isochrony.{line.condition.lower()}.{line.direction}"
        for what, r2 in (("velocity", line.velocity_r2), ("duration", line.duration_r2)):
            for name, value in _describe(np.array(r2)).items():
                add(f"{head}.{what}.r2.{name}", value, "1", "each participant's own line")
        add(f"{head}.velocity.slope", line.velocity_slope, "1/s", "mean velocity over amplitude, means of participants")
        add(f"{head}.velocity.intercept", line.velocity_intercept, f"{found.unit}/s")
        add(
            f"{head}.duration.slope",
            line.duration_slope,
            f"s/{found.unit}",
            "duration over amplitude, means of participants",
        )
        add(f"{head}.duration.intercept", line.duration_intercept, "s")
    for s in found.sensitivity:
        rule = re.sub(r"[^a-z0-9]+", "_", s.words.replace(" Hz", "hz").replace("%", "percent").lower())
        add(f"assess.sensitivity.{rule}.{s.index}.{s.condition.lower()}", 100.0 * s.change, "%", s.words)
    for each in found.needed:
        note = f"signed ranks against control, power 0.8, d of pairs {each.effect:.3g}"
        note += "" if each.participants else "; more than were tried"
        what = f"d_{each.effect:g}" if each.change is None else f"{each.index}.{100 * each.change:g}_percent"
        add(f"assess.needed.{what.replace('.', '_') if each.change is None else what}", each.participants, "1", note)
    return (*rows, *certificate_rows(found, digest))


def _index_rows(found: AssessmentResult, each: Assessed, add) -> None:
    index, compared = each.table.index, each.comparison
    against = {a.condition: a for a in compared.against_control}
    for condition in each.table.conditions:
        low = condition.lower()
        column = each.table.column(condition)
        for name, value in _describe(column).items():
            add(f"assess.{index.name}.{low}.{name}", value, index.unit)
        headline = f"transparency.{index.name}.{low}"
        own = against.get(condition)
        change = primary_change(found, index.name, condition)
        if change is not None:
            value = change.value if np.isfinite(change.value) else None
            least = "at least; " if change.at_least else ""
            add(headline, value, change.unit or "1", least + ESTIMAND_WORDS[found.estimand])
        elif condition != found.control:
            add(headline, float(column.mean()), index.unit, "mean of participants; control has none")
        if own is not None:
            head = f"assess.{index.name}.{low}"
            add(f"{head}.change", own.change, index.unit, "sensitivity analysis: difference of means")
            if own.relative is not None and index.scaled:
                add(f"{head}.change_of_mean", 100.0 * own.relative, "%", "sensitivity analysis: difference of means")
            add(f"{head}.change.low", own.interval[0], index.unit, "bootstrap over participants")
            add(f"{head}.change.high", own.interval[1], index.unit, "bootstrap over participants")
            add(f"{head}.p", own.p_value, "1", "signed ranks, counted")
            add(f"{head}.p_holm", own.holm, "1")
            add(f"{head}.rank_biserial", own.rank_biserial, "1")
            add(f"{head}.cliff", own.cliff, "1")
            add(f"{head}.dz", own.standardised, "1")
    if compared.friedman is not None:
        add(f"assess.{index.name}.friedman.chi2", compared.friedman.statistic, "1")
        add(f"assess.{index.name}.friedman.p", compared.friedman.p_value, "1", "chi-squared")
        add(f"assess.{index.name}.friedman.p_exact", compared.friedman.exact_p_value, "1", "counted")
        add(f"assess.{index.name}.kendall_w", compared.kendall, "1")
        for i, one in enumerate(compared.conditions):
            for other in compared.conditions[i + 1 :]:
                add(f"assess.{index.name}.nemenyi.{one.lower()}_{other.lower()}", compared.pair(one, other), "1")


def _describe(column: np.ndarray) -> dict[str, float]:
    """Return mean, standard deviation (n - 1), minimum, median and maximum."""
    return {
        "mean": float(np.mean(column)),
        "sd": float(np.std(column, ddof=1)) if len(column) > 1 else float("nan"),
        "min": float(np.min(column)),
        "median": float(np.median(column)),
        "max": float(np.max(column)),
    }


def _without(found: AssessmentResult) -> str:
    return "; ".join(f"{person} left out: {why}" for person, why in found.without.items())
