"""The ABLE paper's tests between conditions, computed again from the only rank sums that fit what is printed.

Six participants rank four conditions (three for EMG/Acc); the printed chi-squared and p values leave one set of rank
sums for each index, but for the end from which one ranks. From these every printed statistic follows, or does not.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pellucid.people.comparison import friedman_from_rank_sums, nemenyi_from_rank_sums

from ..figure import Reproduced, figure
from ..printed import PrintedPaper

RANK_SUMS: Mapping[str, Mapping[str, int]] = MappingProxyType(
    {
        "duration": MappingProxyType({"ctrl": 9, "fc": 9, "pcfr": 21, "clpc": 21}),
        "velocity": MappingProxyType({"ctrl": 23, "fc": 19, "pcfr": 10, "clpc": 8}),
        "emg_acc": MappingProxyType({"fc": 6, "pcfr": 12, "clpc": 18}),
    }
)
"""Rank sums by index and condition; a test in `tests/published` shows that no others agree with print."""

INDEX_WORDS = {"duration": "duration", "velocity": "largest velocity", "emg_acc": "EMG/Acc"}
"""Words for the indices."""

PRINT_ERRORS = {
    "duration_p_fc_others": "A2: printed 0.37, a zero is missing; said to be the same difference as Ctrl's",
    "velocity_p": "A1: printed ten times too large",
    "emg_acc_p_fc_clpc": "cut off after the third decimal, not rounded",
}
"""Printed values that do not follow from the rank sums, and their probable cause."""


def statistics_rows(paper: PrintedPaper) -> tuple[Reproduced, ...]:
    """Return every printed statistic of section 5's tests, and that from the rank sums."""
    n = int(paper["participants"])
    rows = []
    for index, sums in RANK_SUMS.items():
        test = friedman_from_rank_sums(tuple(sums.values()), n, exact=True)
        words = INDEX_WORDS[index]
        sums_text = ", ".join(f"{condition} {r}" for condition, r in sums.items())
        rows.append(
            _row(paper, f"{index}_chi2", f"Friedman's chi-squared, {words}", test.statistic, f"rank sums {sums_text}")
        )
        rows.append(_row(paper, f"{index}_p", f"Its p, {words}", test.p_value))
        rows.append(
            figure("able.statistics", f"{index}_p_exact", f"Its p counted over all orders, {words}", "1",
                   test.exact_p_value, note="for six participants the chi-squared one is several times too large")
        )  # fmt: skip
        pairs = nemenyi_from_rank_sums(tuple(sums.values()), n)
        for name, (one, other) in _printed_pairs(paper, index).items():
            p = pairs[list(sums).index(one), list(sums).index(other)]
            rows.append(_row(paper, name, f"Nemenyi's p, {words}, {one} and {other}", float(p)))
    return tuple(rows)


def _printed_pairs(paper: PrintedPaper, index: str) -> dict[str, tuple[str, str]]:
    found = {}
    for name in paper.values:
        parts = name.removeprefix(f"{index}_p_").split("_")
        if name.startswith(f"{index}_p_") and len(parts) == 2:
            # The paper says of both laws at once that they differ from FC as they differ from control.
            found[name] = (parts[0], "pcfr" if parts[1] == "others" else parts[1])
    return found


def _row(paper: PrintedPaper, name: str, quantity: str, ours: float, note: str = "") -> Reproduced:
    value = paper.values[name]
    agrees = value.agrees(ours)
    verdict = "agrees" if agrees else "cannot be"
    return figure(
        "able.statistics", name, quantity, "1", ours, value, note if agrees else PRINT_ERRORS[name], verdict=verdict
    )
