"""The ABLE paper reproduced: its identification on virtual elbows, its laws with virtual people, what print allows."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...controllers.elbow_controllers import ELBOW_CONTROLLERS
from ...controllers.elbow_laws import ElbowLaw
from ...fit.slider.slider_fit import SliderFit
from ...lab.elbow.protocol import trials
from ...lab.elbow.rig import ElbowRig, able_elbow, drawn_rigs
from ...lab.elbow.study import excitation
from ...lab.pointing.conditions import Cards, identified_cards, worn
from ...lab.pointing.people import PointingRig, draw_people, elbow_participants
from ...recordings.results import ResultRow
from ..paired_test import paired_test
from ..printed import PrintedPaper, printed
from ..reproduction import Reproduced, spread, verdict_between, write_results
from .card import write_published_card
from .coherence import inconsistencies
from .elbow import able_elbow as published_elbow
from .law_comparison import compare_controllers, comparison_rows
from .parameter_count import chain_parameters
from .statistics import statistics_rows
from .transparency import Transparency, compare_laws
from .transparency_rows import safety_rows, transparency_rows
from .trials import Comparison, compare_many, compare_models

SEEDS = tuple(range(1, 11))

STUDY_SEEDS = tuple(range(1, 6))
"""Of the virtual people, their order of conditions and their noise."""

FUZZED = 10_000_000
"""Control cycles of every law among nonsense."""

LOAD_FACTORS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
"""By which the rig's load friction is multiplied, to see which would give the paper's ratio."""

SPLITS = {
    "fitted": (".published_protocol.", ".friction_needed.", ".implied_friction."),
    "simulated": (
        ".gravity_error", ".inertia_error", ".slider_error", ".recomputed.", ".parameter_count", ".table2.",
        ".statistics.", "transparency.", "safety.", "study.",
    ),
}  # fmt: skip
"""What a row is judged on, by a part of its id: rows not named here, on trials never fitted. A rig's own constants, and
arithmetic, count as simulated."""

COMMAND = "reproduce able"


@dataclass(frozen=True)
class AbleReproduction:
    """Everything `reproduce_able` computed."""

    rows: tuple[Reproduced, ...]
    results: tuple[ResultRow, ...]
    comparisons: tuple[Comparison, ...]  # All rigs and seeds, the committed rig's first
    by_factor: tuple[Comparison, ...]  # The committed rig, its load friction multiplied by `LOAD_FACTORS`
    fit: SliderFit  # The committed rig's, first seed
    rig: ElbowRig
    paper: PrintedPaper
    transparency: Transparency  # The paper's laws with virtual people, on the committed rig


def reproduce_able(
    out: Path,
    *,
    seeds: Sequence[int] = SEEDS,
    rigs: int = 5,
    people: PointingRig | None = None,
    studies: Sequence[int] = STUDY_SEEDS,
    fuzzed: int = FUZZED,
    workers: int | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> AbleReproduction:
    """Reproduce the paper, and write results.json, reproduction.json and the published model's card."""
    tell = on_progress or (lambda text, share: None)
    rig, paper = able_elbow(), printed("able")
    threads = workers or os.cpu_count() or 1
    jobs = [(r, seed) for r in (rig, *drawn_rigs(rig, rigs)) for seed in seeds]
    stronger = [(_with_load(rig, factor), seeds[0]) for factor in LOAD_FACTORS]
    found = compare_many(
        [*jobs, *stronger],
        workers=workers,
        on_progress=lambda text, share: tell(text, 0.4 * share),
    )
    comparisons, by_factor = tuple(found[: len(jobs)]), tuple(found[len(jobs) :])
    tell("the committed rig once more, to be drawn", 0.4)
    reference = excitation(rig)
    _, fit = compare_models(rig, seeds[0], trials(rig, lambda _: reference))
    rows = (*_compared(rig, comparisons, paper), *_by_factor(by_factor, paper), *_recomputed(paper))
    rows += statistics_rows(paper)
    people = people or elbow_participants(rig)
    cards = identified_cards(rig)
    transparency = compare_laws(
        people, cards, seeds=studies, threads=threads, on_progress=lambda text, share: tell(text, 0.42 + 0.43 * share)
    )
    rows += tuple(transparency_rows(transparency, paper))
    tell("laws on robots they were not chosen on", 0.85)
    rows += comparison_rows(compare_controllers(drawn_rigs(rig, rigs), workers=workers))
    tell("laws among nonsense", 0.95)
    rows += tuple(safety_rows(_all_laws(people, cards, transparency.exponents), cycles=fuzzed))
    results = write_results(out, COMMAND, rows, _split)
    write_published_card(out / "table2-as-published.json", published_elbow())
    return AbleReproduction(rows, results, comparisons, by_factor, fit, rig, paper, transparency)


def _all_laws(people: PointingRig, cards: Cards, exponents: tuple[float, float]) -> dict[str, ElbowLaw]:
    one = draw_people(people, np.random.default_rng(0), count=1)[0]
    place = one.slider(people)
    return {name: worn(cards, name, exponents=exponents)(one, place) for name in ELBOW_CONTROLLERS}


def _with_load(rig: ElbowRig, factor: float) -> ElbowRig:
    t = rig["transmission"]
    values = {f"transmission.{n}": factor * t[n] for n in ("load_motoring", "load_generating")}
    return rig.changed(values, f"load-{100.0 * factor:.0f}-percent")


def _split(row: str) -> str:
    return next((split for split, parts in SPLITS.items() if any(part in row for part in parts)), "heldout")


def _compared(rig: ElbowRig, comparisons: Sequence[Comparison], paper: PrintedPaper) -> list[Reproduced]:
    table = paper.tables["error"]
    printed_ = {
        "without": table["without_dissociation"]["mean"].value,
        "with": table["with_dissociation"]["mean"].value,
        "ratio": paper["error_ratio"],
        "p": paper["paired_p"],
    }
    rows: list[Reproduced] = []
    for name in dict.fromkeys(c.rig for c in comparisons):
        head = "able" if name == rig.name else f"able.{name}"
        rows += _of_one_rig(head, name, [c for c in comparisons if c.rig == name], printed_)
    return rows


def _of_one_rig(head: str, rig: str, mine: Sequence[Comparison], printed_: Mapping[str, float]) -> list[Reproduced]:
    rows: list[Reproduced] = []

    def add(what: str, quantity: str, unit: str, values: Iterable[float], printed: float | None = None, note: str = ""):
        ours, low, high = spread(values)
        said, verdict = f"{quantity}, rig {rig}", verdict_between(printed, low, high)
        rows.append(Reproduced(f"{head}.{what}", said, unit, printed, ours, low, high, verdict, note))

    for which, table, judged, note in (
        ("unseen", "table1", "trials never fitted", "the paper held nothing out"),
        ("published", "table1.published_protocol", "the 18 trials of the paper", "12 of the 18 are fitted too"),
    ):
        for key, quantity, unit, values in (
            ("without", "Mean absolute error without dissociation", "A", [c.mean(which, "pooled") for c in mine]),
            ("with", "Mean absolute error with dissociation", "A", [c.mean(which, "dissociated") for c in mine]),
            ("ratio", "Error without over with", "1", [c.ratio(which, "pooled", "dissociated") for c in mine]),
            ("p", "Paired t-test over 18 trials", "1", [c.p_value(which) for c in mine]),
        ):
            add(f"{table}.{key}", f"{quantity}, {judged}", unit, values, printed_[key], note)
    for method in ("consistent", "load"):
        body = "one coherent body" + (", friction by load" if method == "load" else "")
        add(
            f"{method}.ratio", f"Error of the dissociated model over that of {body}", "1",
            [c.ratio("unseen", "dissociated", method) for c in mine], note="trials never fitted",
        )  # fmt: skip
        for protocol, part in (("constant", slice(0, 6)), ("sweep", slice(6, 12)), ("slow", slice(12, 18))):
            errors = [(c.errors["unseen"]["dissociated"][part], c.errors["unseen"][method][part]) for c in mine]
            add(
                f"{method}.ratio.{protocol}", f"The same, {protocol} trials", "1",
                [over.mean() / under.mean() for over, under in errors],
            )  # fmt: skip
        add(
            f"{method}.torque_error", f"Mean absolute torque error of {body}", "N*m",
            [c.torque_errors["unseen"][method].mean() for c in mine], note="trials never fitted",
        )  # fmt: skip
        add(
            f"{method}.gravity_error", f"Largest gravity error of {body}, of the largest", "1",
            [c.gravity_error[method] for c in mine], note="against the rig's own gravity",
        )  # fmt: skip
        add(
            f"{method}.inertia_error", f"Largest relative inertia error of {body}", "1",
            [c.inertia_error[method] for c in mine], note="against the rig's own inertia",
        )  # fmt: skip
    add("slider_error", "Largest error of a slider position", "m", [c.slider_error for c in mine])
    add(
        "implied_friction.least", "Least friction the dissociated model implies at rest", "N*m",
        [c.implied_friction[0] for c in mine], note="no joint has a negative one (A7)",
    )  # fmt: skip
    return rows


def _by_factor(by_factor: Sequence[Comparison], paper: PrintedPaper) -> list[Reproduced]:
    """Which load friction the paper's ratio would need."""
    ratios = np.array([c.ratio("published", "pooled", "dissociated") for c in by_factor])
    wanted = paper["error_ratio"]
    rows = [
        Reproduced(
            f"able.friction_needed.ratio_at_{factor:g}".replace("0.5", "half"),
            f"Error ratio with the rig's load friction times {factor:g}",
            "1",
            wanted,
            float(ratio),
            verdict="differs",
            note="the paper's own 18 trials, one seed",
        )
        for factor, ratio in zip(LOAD_FACTORS, ratios, strict=True)
    ]
    above = np.flatnonzero(ratios >= wanted)
    needed, note = (
        None,
        f"no factor up to {LOAD_FACTORS[-1]:g} gives {wanted:g}; the largest ratio is {ratios.max():.2f}",
    )
    if len(above) and above[0] > 0:
        i = int(above[0])
        needed = float(np.interp(wanted, ratios[i - 1 : i + 1], LOAD_FACTORS[i - 1 : i + 1]))
        note = "interpolated"
    rows.append(
        Reproduced(
            "able.friction_needed.factor", "Factor on the rig's load friction that gives the paper's ratio", "1", None,
            needed, note=note,
        )
    )  # fmt: skip
    return rows


def _recomputed(paper: PrintedPaper) -> list[Reproduced]:
    table = paper.tables["error"]
    without, with_ = table["without_dissociation"], table["with_dissociation"]
    test = paired_test(
        paper["paired_t"],
        int(paper["trials_compared"]),
        means=(without["mean"].value, with_["mean"].value),
        sds=(without["sd"].value, with_["sd"].value),
    )
    rows = [
        Reproduced(
            "able.recomputed.p", "p of the printed t with 17 degrees of freedom", "1", paper["paired_p"], test.p_value,
            verdict="recomputed", note="t is printed with four digits",
        ),
        Reproduced(
            "able.recomputed.correlation", "Correlation of both errors over the 18 trials, from t and Table I", "1",
            None, test.correlation, verdict="recomputed",
            note="negative: trials that are worst without dissociation are best with it (A3)",
        ),
        Reproduced(
            "able.recomputed.ratio", "Ratio of Table I's means", "1", paper["error_ratio"],
            without["mean"].value / with_["mean"].value, verdict="recomputed",
        ),
        Reproduced(
            "able.parameter_count", "Parameters of seven joints over those of one, eq. 7", "1", 127.0,
            float(chain_parameters(7, 1)), verdict="recomputed", note="counts a chain's prefixes only (A15)",
        ),
    ]  # fmt: skip
    for i, wrong in enumerate(inconsistencies(published_elbow())):
        rows.append(
            Reproduced(
                f"able.table2.{wrong.subject}_{i + 1}", f"Table II, {wrong.subject.replace('_', ' ')}", wrong.unit,
                None, wrong.value, verdict="cannot be", note=f"{wrong.erratum}: {wrong.what}",
            )
        )  # fmt: skip
    return rows
