"""A published figure beside ours, with a verdict; and the files that hold them all."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from .._atomic import write_text_atomically
from ..recordings.results import ResultRow, write_rows

VERDICTS = ("agrees", "differs", "recomputed", "ours only", "cannot be")


@dataclass(frozen=True)
class Reproduced:
    """One row of reproduction.json."""

    id: str
    quantity: str
    unit: str
    published: float | None  # As printed, in `unit`
    ours: float | None  # Computed here: the median where it was drawn several times
    lower: float | None = None  # lower, upper: The smallest and largest of those.
    upper: float | None = None
    # "agrees" or "differs" (with what is printed), "recomputed" (from other printed numbers), "ours only" (nothing is
    # printed), "cannot be" (what is printed contradicts itself)
    verdict: str = "ours only"
    note: str = ""


def spread(values: Iterable[float]) -> tuple[float, float, float]:
    """Median, smallest and largest of several draws."""
    drawn = np.array(list(values), float)
    return float(np.median(drawn)), float(drawn.min()), float(drawn.max())


def verdict_between(published: float | None, lower: float, upper: float) -> str:
    """Verdict on a printed figure, by whether it lies between ours."""
    if published is None:
        return "ours only"
    return "agrees" if lower <= published <= upper else "differs"


def write_reproduction(path: Path, rows: Iterable[Reproduced]) -> Path:
    """Write reproduction.json, whole or not at all."""
    table = []
    for row in rows:
        plain = asdict(row)
        for key in ("published", "ours", "lower", "upper"):
            value = plain[key]
            plain[key] = None if value is None or not np.isfinite(value) else float(value)
        table.append(plain)
    return write_text_atomically(path, json.dumps({"rows": table}, indent=1, ensure_ascii=False) + "\n")


def write_results(
    out: Path, command: str, rows: Sequence[Reproduced], split: Callable[[str], str]
) -> tuple[ResultRow, ...]:
    """Write results.json and reproduction.json."""
    out.mkdir(parents=True, exist_ok=True)
    results = tuple(ResultRow(r.id, r.ours, r.unit, command, split(r.id), note=_note(r)) for r in rows)
    write_rows(out / "results.json", command, results)
    write_reproduction(out / "reproduction.json", rows)
    return results


def _note(row: Reproduced) -> str:
    between = "" if row.lower is None else f"{row.lower:.4g} to {row.upper:.4g}"
    return "; ".join(part for part in (between, row.note) if part)
