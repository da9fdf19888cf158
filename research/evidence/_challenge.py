"""The challenge: studies by a generator that knows nothing of the analysis, assessed before their truth is opened."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import pellucid as pl
from pellucid import PellucidError
from pellucid.people.certificate import CANNOT_SAY, PASS
from pellucid.people.equivalence import Margin, equivalence
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import is_smallest, sized
from research.certificate.generator import SEAL, STUDY_COUNT, Truth, seal, truth_of, write_study
from research.certificate.scenarios import MARGIN, SCENARIOS

COUNT = sized(STUDY_COUNT, smallest=2)
"""Number of studies that are assessed."""


REFUSED = "refused"
"""Answer to a study whose recordings are not fit to be used: most movements of one of them have no end."""


def verdict_of(i: int) -> str:
    """Return what `pl.assess` says of the robot in study number `i`, which is written and read as files."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        write_study(i, folder)
        if (folder / "study.toml").exists():
            try:
                found = pl.assess(folder, studies=5)
            except PellucidError:
                return REFUSED
            return next(each.certificate.verdict for each in found.certified if each.condition == "robot")
        return pl.assess(
            read_table(folder / "movements.csv"), control="free", margins={"duration": MARGIN}
        ).certificates["robot"].verdict  # fmt: skip


def rival_says_within(i: int) -> bool | None:
    """Return whether two one-sided t tests of people's mean durations, of all rows with a value, say "within".

    None of recordings.
    """
    with TemporaryDirectory() as place:
        folder = Path(place)
        write_study(i, folder)
        if (folder / "study.toml").exists():
            return None
        table = read_table(folder / "movements.csv")
    seen: dict[tuple[str, str], list[float]] = {}
    for person, condition, seconds in zip(table["participant"], table["condition"], table["duration"], strict=True):
        if np.isfinite(seconds):
            seen.setdefault((person, condition), []).append(seconds)
    people = sorted({person for person, _ in seen})
    changes = [np.log(np.mean(seen[p, "robot"]) / np.mean(seen[p, "free"])) for p in people]
    return equivalence(np.array(changes), Margin.of_ratio(MARGIN), method="t").verdict == "within"


def read_table(path: Path) -> dict[str, list]:
    """Return the columns of a table of movements; numbers as numbers, and NaN where a movement gave none."""
    with path.open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    words = ("participant", "condition", "direction")
    return {
        name: list(column) if name in words else [float(x) if x else float("nan") for x in column]
        for name, column in zip(head, zip(*rows, strict=True), strict=True)
    }


def rows() -> Iterator[tuple[str, float, str, str]]:
    """Name, value, unit and note of each figure."""
    numbers = range(COUNT)
    said = dict(zip(numbers, ordered_results([(verdict_of, i) for i in numbers]), strict=True))
    truths = ordered_results([(truth_of, i) for i in numbers])
    if not is_smallest() and seal(truths) != SEAL:
        raise RuntimeError("the challenge: found other truths than the sealed ones, expected them unchanged")
    recordings = sum(t.kind == "recordings" for t in truths)
    yield "challenge.studies", len(truths), "1", f"{len(SCENARIOS)} scenarios; {recordings} are recordings"
    changed = [i for i in numbers if not truths[i].transparent]
    alike = [i for i in numbers if truths[i].transparent]
    false = [i for i in changed if said[i] == PASS]
    wrong = [i for i in alike if said[i] not in (PASS, CANNOT_SAY, REFUSED)]
    refused = [i for i in numbers if said[i] == REFUSED]
    silent = [i for i in numbers if said[i] == CANNOT_SAY]
    right = [i for i in alike if said[i] == PASS]
    for name, some, of, words in (
        ("false_transparent", false, changed, "studies whose robot is not transparent, most of them at a limit"),
        ("false_not_transparent", wrong, alike, "studies whose robot is transparent"),
        ("cannot_say", silent, numbers, "studies"),
        ("refused", refused, numbers, "studies, whose recordings miss most of somebody's movements"),
        ("power", right, alike, "studies whose robot is transparent, 12 to 24 people"),
    ):
        value = 100.0 * len(some) / max(len(of), 1)
        named = f": {_named(truths, some)}" if some and name.startswith(("false", "refused")) else ""
        yield f"challenge.{name}", value, "%", f"{len(some)} of {len(of)} {words}{named}"
    rival = ordered_results([(rival_says_within, i) for i in numbers if truths[i].kind == "table"])
    tables = dict(zip((i for i in numbers if truths[i].kind == "table"), rival, strict=True))
    for name, some in (("false_transparent", changed), ("power", alike)):
        own = [tables[i] for i in some if i in tables]
        value = 100.0 * float(np.mean(own)) if own else 0.0
        yield f"challenge.rival.t.{name}", value, "%", f"reference method: t tests of people's means, {len(own)} tables"
    for kind in ("table", "recordings"):
        own = [i for i in alike if truths[i].kind == kind]
        value = 100.0 * float(np.mean([said[i] == PASS for i in own])) if own else 0.0
        yield f"challenge.power.{kind}", value, "%", f"of {len(own)} studies whose robot is transparent"


def _named(truths: list[Truth], some: list[int]) -> str:
    return "; ".join(sorted({truths[i].scenario for i in some}))
