"""Rows of Table I and Fig. 3 on virtual elbows, of the friction that the paper's ratio needs, and what print allows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from ...elbow.rig import ElbowRig
from ..figure import Reproduced, figure
from ..paired_test import paired_test
from ..printed import PrintedPaper
from .coherence import inconsistencies
from .elbow import able_elbow as published_elbow
from .trials import ModelComparison

LOAD_FRICTION_FACTORS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
"""Factors on the rig's load friction; the ratio of errors is computed for each, to find which gives the paper's."""

_row = partial(figure, "able")


def compared_rows(rig: ElbowRig, comparisons: Sequence[ModelComparison], paper: PrintedPaper) -> Iterator[Reproduced]:
    """Yield Table I for every rig; ids name the rig unless it is the committed one."""
    table = paper.tables["error"]
    printed = {
        "without": table["without_dissociation"]["mean"].value,
        "with": table["with_dissociation"]["mean"].value,
        "ratio": paper["error_ratio"],
        "p": paper["paired_p"],
    }
    for name in dict.fromkeys(c.rig for c in comparisons):
        prefix = "able" if name == rig.name else f"able.{name}"
        yield from _rows_of_rig(prefix, name, [c for c in comparisons if c.rig == name], printed)


def _rows_of_rig(
    head: str, rig: str, mine: Sequence[ModelComparison], printed: Mapping[str, float]
) -> Iterator[Reproduced]:
    """Yield Table I for one rig over its seeds (`mine`), with the paper's `printed` figures."""

    def row(what: str, quantity: str, unit: str, values: Sequence[float], beside: float | None = None, note: str = ""):
        return figure(head, what, f"{quantity}, rig {rig}", unit, values, beside, note)

    for which, table, words, note in (
        ("unseen", "table1", "trials never fitted", "the paper held nothing out"),
        ("published", "table1.published_protocol", "the 18 trials of the paper", "12 of the 18 are fitted too"),
    ):
        for key, quantity, unit, values in (
            ("without", "Mean absolute error without dissociation", "A", [c.mean(which, "pooled") for c in mine]),
            ("with", "Mean absolute error with dissociation", "A", [c.mean(which, "dissociated") for c in mine]),
            ("ratio", "Error without over with", "1", [c.ratio(which, "pooled", "dissociated") for c in mine]),
            ("p", "Paired t-test over 18 trials", "1", [c.p_value(which) for c in mine]),
        ):
            yield row(f"{table}.{key}", f"{quantity}, {words}", unit, values, printed[key], note)
    for method in ("consistent", "load"):
        body = "one coherent body" + (", friction by load" if method == "load" else "")
        yield row(
            f"{method}.ratio", f"Error of the dissociated model over that of {body}", "1",
            [c.ratio("unseen", "dissociated", method) for c in mine], note="trials never fitted",
        )  # fmt: skip
        for protocol, part in (("constant", slice(0, 6)), ("sweep", slice(6, 12)), ("slow", slice(12, 18))):
            errors = [(c.errors["unseen"]["dissociated"][part], c.errors["unseen"][method][part]) for c in mine]
            yield row(
                f"{method}.ratio.{protocol}", f"The same, {protocol} trials", "1",
                [over.mean() / under.mean() for over, under in errors],
            )  # fmt: skip
        yield row(
            f"{method}.torque_error", f"Mean absolute torque error of {body}", "N*m",
            [c.torque_errors["unseen"][method].mean() for c in mine], note="trials never fitted",
        )  # fmt: skip
        yield row(
            f"{method}.gravity_error", f"Largest gravity error of {body}, of the largest", "1",
            [c.gravity_error[method] for c in mine], note="against the rig's own gravity",
        )  # fmt: skip
        yield row(
            f"{method}.inertia_error", f"Largest relative inertia error of {body}", "1",
            [c.inertia_error[method] for c in mine], note="against the rig's own inertia",
        )  # fmt: skip
    yield row("slider_error", "Largest error of a slider position", "m", [c.slider_error for c in mine])
    yield row(
        "implied_friction.least", "Least friction the dissociated model implies at rest", "N*m",
        [c.implied_friction[0] for c in mine], note="no joint has a negative one (A7)",
    )  # fmt: skip


def factor_rows(by_factor: Sequence[ModelComparison], paper: PrintedPaper) -> list[Reproduced]:
    """Return rows with the ratio of errors by load friction, and the friction that gives the paper's ratio."""
    ratios = np.array([c.ratio("published", "pooled", "dissociated") for c in by_factor])
    wanted = paper["error_ratio"]
    rows = [
        _row(f"friction_needed.ratio_at_{factor:g}".replace("0.5", "half"),
             f"Error ratio with the rig's load friction times {factor:g}", "1", ratio, wanted,
             "the paper's own 18 trials, one seed", verdict="differs")
        for factor, ratio in zip(LOAD_FRICTION_FACTORS, ratios, strict=True)
    ]  # fmt: skip
    above = np.flatnonzero(ratios >= wanted)
    needed, note = (
        None,
        f"no factor up to {LOAD_FRICTION_FACTORS[-1]:g} gives {wanted:g}; the largest ratio is {ratios.max():.2f}",
    )
    if len(above) and above[0] > 0:
        i = int(above[0])
        needed = float(np.interp(wanted, ratios[i - 1 : i + 1], LOAD_FRICTION_FACTORS[i - 1 : i + 1]))
        note = "interpolated"
    what = "Factor on the rig's load friction that gives the paper's ratio"
    return [*rows, _row("friction_needed.factor", what, "1", needed, None, note)]


def recomputed_rows(paper: PrintedPaper) -> list[Reproduced]:
    """Return rows on Table I's test, the count of parameters, and the contradictions in Table II."""
    table = paper.tables["error"]
    without, with_ = table["without_dissociation"], table["with_dissociation"]
    test = paired_test(
        paper["paired_t"],
        int(paper["trials_compared"]),
        means=(without["mean"].value, with_["mean"].value),
        sds=(without["sd"].value, with_["sd"].value),
    )
    means = without["mean"].value / with_["mean"].value
    rows = [
        _row("recomputed.p", "p of the printed t with 17 degrees of freedom", "1", test.p_value, paper["paired_p"],
             "t is printed with four digits", verdict="recomputed"),
        _row("recomputed.correlation", "Correlation of both errors over the 18 trials, from t and Table I", "1",
             test.correlation, None, "negative: trials that are worst without dissociation are best with it (A3)",
             verdict="recomputed"),
        _row("recomputed.ratio", "Ratio of Table I's means", "1", means, paper["error_ratio"], verdict="recomputed"),
        _row("parameter_count", "Parameters of seven joints over those of one, eq. 7", "1", 2.0**7 - 1.0,
             127.0, "counts a chain's prefixes only (A15)", verdict="recomputed"),
    ]  # fmt: skip
    for i, wrong in enumerate(inconsistencies(published_elbow()), 1):
        words = f"Table II, {wrong.subject.replace('_', ' ')}"
        rows.append(
            _row(f"table2.{wrong.subject}_{i}", words, wrong.unit, wrong.value, None, f"{wrong.erratum}: {wrong.what}",
                 verdict="cannot be")
        )  # fmt: skip
    return rows
