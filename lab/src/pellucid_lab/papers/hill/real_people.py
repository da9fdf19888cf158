"""Ranking of the methods on recordings of real people, which simulated people cannot give.

``python -m research.evidence._emg_cases`` measures the ranking and writes ``real_people.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from pellucid._atomic import write_text_atomically
from pellucid.study.pages.forest import number_table
from pellucid.study.pages.page import Section

from ..figure import Reproduced, figure

RANKING_FILE = Path(__file__).with_name("real_people.json")
"""File with the ranking."""

PEOPLE_WORDS = "real people who walk, run, lift, crouch, extend a leg or hold a load"
"""Movements of the recordings."""


@dataclass(frozen=True)
class RankedError:
    """A method's error over that of the best of each case: geometric mean, with Student's interval over cases."""

    ratio: float
    low: float  # Ends of the 95 % interval
    high: float
    cases: int

    def __str__(self) -> str:
        """Return the ratio with its interval, in words."""
        return f"{self.ratio:.2f} ({self.low:.2f} to {self.high:.2f})"


@dataclass(frozen=True)
class RankedMethod:
    """A method's error on real people."""

    name: str
    words: str
    common: RankedError  # In the cases in which every method can be fitted
    every: RankedError | None  # In all cases; None for a method that cannot be fitted in some of them


def write_ranking(ranked: Sequence[RankedMethod], path: Path) -> None:
    """Write the methods, the best first, as `ranked_methods` reads them."""
    content = {"methods": [asdict(each) for each in ranked]}
    write_text_atomically(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n")


@cache
def ranked_methods() -> tuple[RankedMethod, ...]:
    """Return the methods, the best first."""
    content = json.loads(RANKING_FILE.read_text(encoding="utf-8"))
    return tuple(
        RankedMethod(
            each["name"], each["words"], RankedError(**each["common"]),
            None if each["every"] is None else RankedError(**each["every"]),
        )
        for each in content["methods"]
    )  # fmt: skip


def real_people_rows() -> Iterator[Reproduced]:
    """Yield the error of each method over that of the best one."""
    for each in ranked_methods():
        own = each.common
        beyond = "" if each.every is None else f"; in all {each.every.cases} cases {each.every}"
        yield figure(
            "hill", f"real_people.{each.name}", f"Error over the best on real people, {each.words}", "1", own.ratio,
            note=f"{own.cases} held-out cases{beyond}; measured by python -m research.evidence._emg_cases",
            between=(own.low, own.high),
        )  # fmt: skip


def ranking_sentence() -> str:
    """Return the best method on real people, and where the recommended estimator and muscles of Hill's type stand."""
    ranked = ranked_methods()
    others = [
        f"{each.words}: {each.common}, place {i}"
        for i, each in enumerate(ranked, start=1)
        if each.name in ("named", "hill") and i > 1
    ]
    return (
        f"The ranking of {len(ranked)} methods comes from {PEOPLE_WORDS}. The best is {ranked[0].words}; its error is "
        f"{ranked[0].common} times that of the best method of each case ({'; '.join(others)})."
    )


def real_people_section() -> Section:
    """Return the section with the table of all methods."""
    rows = [
        (each.words, *_cells(each.common), *(("–", "–") if each.every is None else _cells(each.every)))
        for each in ranked_methods()
    ]
    common = ranked_methods()[0].common.cases
    every = max(each.every.cases for each in ranked_methods() if each.every is not None)
    return Section(
        "real_people",
        "Ranking of the methods on real people",
        (
            f"Recordings of {PEOPLE_WORDS}. Each case fits some recordings and predicts others that no choice has "
            "seen. Figures are the RMS error over that of the best method of the case, as geometric mean over cases. "
            f"In {common} of {every} cases lengths and moment arms of the muscles are known, so that every method can "
            "be fitted.",
        ),
        (
            number_table(
                ("", f"Error over the best, {common} cases", "95 % interval", f"All {every} cases", "95 % interval"),
                rows,
            ),
        ),
    )


def _cells(found: RankedError) -> tuple[str, str]:
    """Return the cells of a ratio and of its interval."""
    return f"{found.ratio:.2f}", f"{found.low:.2f} to {found.high:.2f}"
