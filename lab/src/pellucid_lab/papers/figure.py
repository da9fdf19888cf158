"""Reproduced figure: a published number and ours, with a verdict; and the files with all figures."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pellucid._atomic import write_text_atomically
from pellucid._errors import PellucidError
from pellucid.study.results import ResultRow, write_rows

from .printed import Printed

VERDICT_WORDS = ("agrees", "differs", "recomputed", "ours only", "cannot be")
"""Verdicts on a figure.

"agrees" and "differs" compare with the printed number. "recomputed" follows from other printed numbers, "ours only" has
no printed counterpart, and for "cannot be" printed numbers contradict each other.
"""


@dataclass(frozen=True)
class Reproduced:
    """One row of reproduction.json."""

    id: str
    quantity: str
    unit: str
    published: float | None  # Printed value, in `unit`; None if there is none
    ours: float | None  # Value computed here; the median if there are several draws
    lower: float | None = None  # Smallest draw, or the interval's lower end
    upper: float | None = None  # Largest draw, or the interval's upper end
    verdict: str = "ours only"  # One of `VERDICT_WORDS`
    note: str = ""


def figure(
    head: str,
    name: str,
    quantity: str,
    unit: str,
    ours: float | Iterable[float] | None,
    published: Printed | float | None = None,
    note: str = "",
    *,
    middle: Callable[[np.ndarray], float] = np.median,
    between: tuple[float, float] | None = None,
    verdict: str | None = None,
) -> Reproduced:
    """Return a row: a number with the interval `between`, or the `middle` of several draws with their range.

    Without a `verdict`, the row agrees if ours rounds to the `published` number (`Printed`), or, if that is a plain
    number, if it lies in the range.
    """
    if isinstance(ours, Iterable):
        drawn = np.array(list(ours), float)
        ours = float(middle(drawn))
        between = (float(drawn.min()), float(drawn.max()))
    low, high = between or (None, None)
    if verdict is None and published is not None:
        least, most = between or (ours, ours)
        agrees = published.agrees(ours) if isinstance(published, Printed) else least <= published <= most
        verdict = "agrees" if agrees else "differs"
    printed = published.value if isinstance(published, Printed) else published
    value = None if ours is None else float(ours)
    return Reproduced(f"{head}.{name}", quantity, unit, printed, value, low, high, verdict or "ours only", note)


def mean_figure(head: str, name: str, quantity: str, unit: str, ours: Iterable[float], *beside, **more) -> Reproduced:
    """Return a row as `figure` does, with the mean of several people, and the smallest and largest of them."""
    return figure(head, name, quantity, unit, list(ours), *beside, middle=np.mean, **more)


class Figures(Mapping[str, Reproduced]):
    """Rows by id, in the order in which a paper has them."""

    def __init__(self, rows: Iterable[Reproduced]):
        self._rows: dict[str, Reproduced] = {}
        for row in rows:
            if row.id in self._rows:
                raise PellucidError(f"two figures have the id {row.id}")
            self._rows[row.id] = row

    def __getitem__(self, name: str) -> Reproduced:
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def ours(self, name: str) -> float:
        """Return the value computed here, in the row's unit."""
        return self._rows[name].ours


def spread(values: Iterable[float]) -> tuple[float, float, float]:
    """Return median, smallest and largest of several draws."""
    drawn = np.array(list(values), float)
    return float(np.median(drawn)), float(drawn.min()), float(drawn.max())


def write_figures(out: Path, command: str, rows: Sequence[Reproduced], split: Callable[[str], str]) -> None:
    """Write results.json and reproduction.json, each atomically; `split` gives "fitted", "heldout" or "simulated"."""
    out.mkdir(parents=True, exist_ok=True)
    results = [ResultRow(r.id, r.ours, r.unit, command, split(r.id), note=_note(r)) for r in rows]
    write_rows(out / "results.json", command, results)
    table = [{name: _plain(value) for name, value in asdict(row).items()} for row in rows]
    text = json.dumps({"rows": table}, indent=1, ensure_ascii=False)
    write_text_atomically(out / "reproduction.json", text + "\n")


def _plain(value: str | float | None) -> str | float | None:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _note(row: Reproduced) -> str:
    between = "" if row.lower is None else f"{row.lower:.4g} to {row.upper:.4g}"
    return "; ".join(part for part in (between, row.note) if part)
