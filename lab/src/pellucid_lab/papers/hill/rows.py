"""The reproduction's figures as rows: Tables 2 to 5, and the numbers that Figs. 5 to 11 show."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from ..figure import Reproduced, figure, mean_figure
from ..printed import PrintedPaper
from .steps import DRIVEN_SWINGS, IdentifiedBody, IdentifiedLeg
from .torque import BASELINE_FAMILIES, ERROR_MEASURES, RECORDED_EMG_BASELINES, TorqueComparison
from .training import TRAINED_QUANTITIES, Training

MEASURE_WORDS = {"rmse": "RMSE", "maxe": "Largest error", "mae": "Mean error"}
"""Words for the measures of error."""

ESTIMATOR_WORDS = {
    "hill": "muscles, flexors by balance",
    "hill.recorded": "muscles with electrodes alone",
    "hill.adaptive": "muscles, errors learnt online",
    "hill.eq12": "muscles calibrated on eq. 12",
    "nmco": "NM-CO (reconstruction)",
    "nmcoa": "NM-COA (reconstruction, told the torque so far: no peer)",
    "nmnc": "NM-NC (reconstruction)",
    "mbp": "M-BP (reconstruction)",
    "ridge": "ridge regression",
    "boost": "boosting",
    "motion": "ridge regression without EMG",
}
"""Descriptions of the estimators, by their ids."""

PRINTED_ROW_OF_ESTIMATOR = {"nmco": "nm_co", "nmcoa": "nm_coa", "nmnc": "nm_nc", "mbp": "m_bp", "mean": "ours"}
"""Row of Table 5 of the paper that an estimator's id corresponds to; "mean" is the paper's own method."""


def _words(quantity: str) -> str:
    return quantity.replace("_", " ")


def _subject_key(name: str) -> str:
    return f"subject_{name.removeprefix('S')}"


PARAMETER_OF_LETTER = {"p": "inertia", "q": "weight_moment"}
"""What the paper's letters stand for."""

_row, _over = partial(figure, "hill"), partial(mean_figure, "hill")


def step_rows(empty: IdentifiedBody, legs: Mapping[str, IdentifiedLeg], paper: PrintedPaper) -> list[Reproduced]:
    """Return rows on Table 2 and its errors."""
    table, units = paper.tables["swings"], {"p": "kg*m^2", "q": "kg*m"}
    rows = []
    for n, unit in units.items():
        own = empty.published[PARAMETER_OF_LETTER[n]]
        rows.append(_row(f"empty.{n}", f"{n} of the exoskeleton, eq. 9", unit, own.value, table["empty"][n]))
    for name, leg in legs.items():
        both = leg.body.published
        rows += [
            _row(f"{n}.{name}", f"{n}' of {name}, eq. 10", unit, both[PARAMETER_OF_LETTER[n]].value,
                    table[_subject_key(name)][n] if _subject_key(name) in table.rows else None)
            for n, unit in units.items()
        ]  # fmt: skip
    for swing in DRIVEN_SWINGS:
        words = {"two_sines": "the paper's swing", "rich": "a richer swing"}[swing]
        p = {n: 100.0 * (leg.inertia[swing].value / leg.true_inertia - 1.0) for n, leg in legs.items()}
        q = {n: 100.0 * (leg.weight_moment[swing].value / leg.restoring_moment - 1.0) for n, leg in legs.items()}
        weight = {n: 100.0 * (leg.weight_moment[swing].value / leg.true_weight_moment - 1.0) for n, leg in legs.items()}
        sure = [196.0 * leg.inertia[swing].standard_error / leg.true_inertia for leg in legs.values()]
        rows += [
            _over(f"p.half_width.{swing}", f"Half the 95 % interval of p' - p, {words}", "%", sure),
            _over(f"p.error.{swing}", f"Error of p' - p, corrected, {words}", "%", p.values()),
            _over(f"q.error.{swing}", f"Error of q' - q, corrected, {words}", "%", q.values(),
                  note="against the relaxed leg's whole restoring torque, its tissue included"),
            _over(f"q.error.gravity.{swing}", f"q' - q beyond the leg's weight, {words}", "%", weight.values(),
                  note="tissue restores the leg as its weight does; printed values are 20 to 54 % beyond Winter's"),
        ]  # fmt: skip
        rows += [_row(f"p.error.{swing}.{n}", f"Error of p' - p, {n}, {words}", "%", v) for n, v in p.items()]
        rows += [_row(f"q.error.{swing}.{n}", f"Error of q' - q, {n}, {words}", "%", v) for n, v in q.items()]
    two = [leg.body.corrected["two_sines"].correlation for leg in legs.values()]
    rich = [leg.body.corrected["rich"].correlation for leg in legs.values()]
    rows.append(
        _over("p.correlation.two_sines", "Correlation of inertia's and gravity's torque, the paper's swing", "1", two)
    )
    rows.append(_over("p.correlation.rich", "The same, a richer swing", "1", rich))
    return rows


def torque_rows(found: Mapping[str, TorqueComparison], paper: PrintedPaper) -> list[Reproduced]:
    """Return rows on Tables 4 and 5: errors on the held-out swing, full and truncated."""
    table, rows = paper.tables["errors"], []
    references = {
        "truth": ("hill", "active", "the true torque of the muscles"),
        "eq12": ("hill.eq12", "eq12", "eq. 12, calibrated on eq. 12"),
    }
    for kind, (estimator, against, words) in references.items():
        for measure in ERROR_MEASURES:
            for cut, tail in ((False, ""), (True, ".truncated")):
                values = {n: getattr(f.errors(estimator, against, truncated=cut), measure) for n, f in found.items()}
                what = f"{MEASURE_WORDS[measure]} against {words}" + (", both cut off at 0" if cut else "")
                # What the paper prints is against its eq. 12, cut off at 0.
                as_printed = kind == "eq12" and cut
                rows.append(
                    _over(f"{measure}.{kind}.mean{tail}", f"{what}, mean", "N*m", values.values(),
                          table["mean"][measure] if as_printed else None)
                )  # fmt: skip
                rows += [
                    _row(f"{measure}.{kind}.{n}{tail}", f"{what}, {n}", "N*m", v,
                            table[_subject_key(n)][measure] if as_printed and _subject_key(n) in table.rows else None)
                    for n, v in values.items()
                ]  # fmt: skip
    others = ["hill.recorded", "hill.adaptive", *BASELINE_FAMILIES, *(f"{n}.recorded" for n in RECORDED_EMG_BASELINES)]
    methods = paper.tables["methods"]
    for estimator in others:
        base = estimator.removesuffix(".recorded") if estimator != "hill.recorded" else estimator
        words = ESTIMATOR_WORDS[base] + (
            ", recorded muscles" if estimator.endswith(".recorded") and base != estimator else ""
        )
        short = estimator.removeprefix("hill.")
        for measure in ERROR_MEASURES:
            for cut, tail in ((False, ""), (True, ".truncated")):
                values = [getattr(f.errors(estimator, truncated=cut), measure) for f in found.values()]
                key = PRINTED_ROW_OF_ESTIMATOR.get(estimator)
                shown = methods[key][measure] if cut and key and measure in methods[key] else None
                what = f"{MEASURE_WORDS[measure]} of {words}" + (", cut off at 0" if cut else "")
                rows.append(_over(f"{measure}.truth.{short}{tail}", what, "N*m", values, shown))
    for estimator, name in (("hill", "mean"), ("hill.recorded", "recorded")):
        values = [f.errors(estimator, "muscles").rmse for f in found.values()]
        rows.append(
            _over(f"rmse.total.{name}", f"RMSE against all that muscles pull, {ESTIMATOR_WORDS[estimator]}",
                  "N*m", values, note="a relaxed leg's balance takes passive force for weight")
        )  # fmt: skip
    for against, words in (("reference", "The balance of leg and exoskeleton"), ("eq12", "Eq. 12 as published")):
        values = [float(np.sqrt(np.mean((getattr(f, against) - f.active) ** 2))) for f in found.values()]
        rows.append(_over(f"rmse.reference.{against}", f"{words} against the true torque, RMSE", "N*m", values))
    return rows


def training_rows(
    empty: IdentifiedBody, found: Mapping[str, tuple[IdentifiedLeg, Training, TorqueComparison]], paper: PrintedPaper
) -> list[Reproduced]:
    """Return rows on Table 3, and on Figs. 5, 7 and 11 in numbers."""
    bodies = [empty, *(leg.body for leg, _, _ in found.values())]
    trained = {n: t for n, (_, t, _) in found.items()}
    rows = [
        _row("adam.closed_form_difference", "Adam with a falling rate against the closed form, of p and q",
                "1", max(b.closed_form_difference for b in bodies), note="kg m^2 and kg m"),
        _row("adam.spread_ratio", "Spread of the parameters in the last 100 iterations, fixed over falling rate",
                "1", [t.spread_ratio for t in trained.values()],
                note="gradients of 2 s of data each; median over subjects"),
        _over("adam.spread_ratio.swings", "The same of p and q", "1", [b.spread_ratio for b in bodies]),
    ]  # fmt: skip
    for way in ("adam", "swarm"):
        spent = [t.evaluations(way) for t in trained.values()]
        arrived = [s for s in spent if np.isfinite(s)]
        rows.append(
            _row(f"{way}.evaluations", f"Evaluations of the cost to within 5 % of the lowest, {way}", "1",
                    float(np.median(arrived)) if arrived else float("nan"),
                    note=f"median of the {len(arrived)} of {len(spent)} subjects where it arrived")
        )  # fmt: skip
    rows.append(
        _over("adam.evaluations.least_squares", "Evaluations that bounded least squares took, three starts", "1",
              [t.least_squares for t in trained.values()])
    )  # fmt: skip
    for quantity, letter in TRAINED_QUANTITIES.items():
        rows.append(
            _over(f"order.{quantity}", f"Iteration from which {_words(quantity)} ({letter} of the paper) stays", "1",
                  [t.converged[quantity] for t in trained.values()])
        )  # fmt: skip
    table = paper.tables["muscles"]
    for name, t in trained.items():
        printed = table[_subject_key(name)] if _subject_key(name) in table.rows else {}
        for quantity, letter, unit in (
            ("shape", "A", "1"),
            ("optimal_length_shift", "lambda", "1"),
            ("max_velocity", "k_v", "1/s"),
        ):
            shown = printed.get(letter) if unit == "1" else None
            rows.append(
                _row(f"parameters.{name}.{quantity}", f"{_words(quantity).capitalize()} of {name}, trained", unit,
                        t.values[quantity], shown)
            )  # fmt: skip
    inside = [f.hill.fit for _, _, f in found.values()]
    rows.append(
        _row("parameters.outside", "Parameters outside physiological bounds", "1",
                sum(int(np.sum((f.z < f.problem.lower - 1e-9) | (f.z > f.problem.upper + 1e-9))) for f in inside))
    )  # fmt: skip
    rows.append(
        _over(
            "parameters.at_bound",
            "Parameters on a bound, of each subject",
            "1",
            [int(f.at_bound.sum()) for f in inside],
        )
    )
    return rows


def release_rows(found: Mapping[str, Mapping[str, float]]) -> list[Reproduced]:
    """Return rows on the outlook of section 3.3: orders in which parameters are released, `found` by subject."""
    orders = dict.fromkeys(name for one in found.values() for name in one)
    return [
        _over(f"release.{name}", f"Error with parameters released {_words(name)}, over all at once", "1",
              [one[name] for one in found.values()],
              note="held-out swing, bounded least squares; section 3.3 wants orders tried, and prints none")
        for name in orders
    ]  # fmt: skip
