"""Rows of the reproduction from the virtual comparison of laws: Tables III to V and changes from control."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import numpy as np

from pellucid.controllers.control_law import ControlLaw, fuzz

from ...pointing.session_indices import FIRST_REST_RULE, PUBLISHED_RULE
from ..figure import Reproduced, figure
from ..printed import PrintedPaper, PrintedTable
from .transparency import CONTROL_CONDITION, LAWS, OWN_LAWS, Transparency

COMPARED_INDICES: Mapping[str, tuple[str, str, str]] = {
    "duration_median": ("duration_median", "Median duration", "duration"),
    "duration": ("duration", "Mean duration", "duration"),
    "vmax": ("vmax", "Peak velocity", "velocity"),
    "emgacc": ("emg_per_acc", "EMG/Acc", ""),
}
"""Indices by their name in ids: field of a session's means, words, and the paper's table ("" if it has none)."""

CENSORED_MEAN_NOTE = "a mean of movements that were cut off after 20 s, and so of where: see duration_median"
"""Note on mean durations: under a law that keeps people from settling they depend on the cut-off."""

UNSETTLED_NOTE = "on the target, within the 20 s after which the next one comes"
"""Note on shares of movements that never came to rest."""

MEDIAN_NOTE = "median over people of each one's own, by Kaplan and Meier; the paper's is of its means"
"""Note on median durations."""

PRINTED_STATISTICS = ("mean", "sd", "min", "median", "max")
"""Statistics over people that Tables III to V of the paper print."""

PRINTED_TEST_OF_INDEX = {"duration": "duration", "vmax": "velocity", "emgacc": "emg_acc"}
"""Prefix of the paper's printed test statistics, by index of the assessment."""

_row = partial(figure, "transparency")


def transparency_rows(made: Transparency, paper: PrintedPaper) -> list[Reproduced]:
    """Return all rows of the virtual comparison, with the printed numbers."""
    rows = _changes(made, paper)
    for name, table, index, unit in (
        ("table3", "duration", "duration", "s"),
        ("table4", "velocity", "vmax", "rad/s"),
    ):
        for condition in (CONTROL_CONDITION, *LAWS):
            drawn = [study.values(index, condition) for study in made.studies]
            rows += _described(f"{name}.{condition.lower()}", condition, unit, drawn, paper.tables[table])
    for condition in (CONTROL_CONDITION, *LAWS):
        for direction in ("up", "down"):
            drawn = [study.values(direction, condition) for study in made.studies]
            head, label = f"table5.{condition.lower()}_{direction}", f"R2 of isochrony, {condition} {direction}"
            rows += _described(head, label, "1", drawn, paper.tables["isochrony"])
    rows += _statistics(made, paper)
    rows += _circumstances(made, paper)
    return rows


def printed_change(table: PrintedTable, law: str) -> float:
    """Return the change from control in the means of a printed table [%]."""
    return 100.0 * (table[law.lower()]["mean"].value / table["ctrl"]["mean"].value - 1.0)


def _changes(made: Transparency, paper: PrintedPaper) -> list[Reproduced]:
    rows = []

    def add(head: str, quantity: str, drawn: Iterable[float], printed: float | None, note: str):
        rows.append(_row(head, quantity, "%", drawn, printed, note))

    for name, (index, words, table) in COMPARED_INDICES.items():
        if table:
            middle = np.median if name == "duration_median" else np.mean
            control = paper.tables[table]["ctrl"]["median" if name == "duration_median" else "mean"].value
            errors = (
                100.0 * (middle(study.values(index, CONTROL_CONDITION)) / control - 1.0) for study in made.studies
            )
            add(f"control.{name}", f"{words} in control, over print", errors, None, "what people were set by")
        for law in (*LAWS, *OWN_LAWS):
            published, studies = law in LAWS, made.with_law(law)
            printed = printed_change(paper.tables[table], law) if table and published else None
            change_words, key = f"{words} under {law}, change from control", law.lower()
            order = "the paper prints the order FC < PCFr < CLPC alone" if published and not table else ""
            order = {"duration": CENSORED_MEAN_NOTE, "duration_median": MEDIAN_NOTE}.get(name, order)
            add(f"{name}.{key}", change_words, (s.change(index, law) for s in studies), printed, order)
            rest = (s.change(index, law, FIRST_REST_RULE) for s in studies)
            add(
                f"{name}.first_rest.{key}",
                f"{change_words}, up to the first rest",
                rest,
                printed,
                "without later corrections",
            )
            drawn = (s.change(index, law) for s in made.content)
            note = "tried after the people had been frozen, and seen to correct more finely than the target is wide"
            add(f"{name}.content.{key}", f"{change_words}, people content on the target", drawn, printed, note)
    return rows


def _described(head: str, label: str, unit: str, drawn: Sequence[np.ndarray], table: PrintedTable) -> list[Reproduced]:
    printed = table[head.rsplit(".", 1)[-1]]
    statistics = {"mean": np.mean, "sd": lambda x: np.std(x, ddof=1), "min": np.min, "median": np.median, "max": np.max}
    words = label if unit == "1" else f"{'Duration' if unit == 's' else 'Peak velocity'}, {label}"
    return [
        _row(
            f"{head}.{name}",
            f"{words}, {name} over people",
            unit,
            (statistics[name](x) for x in drawn),
            printed[name].value,
        )
        for name in PRINTED_STATISTICS
    ]


def _statistics(made: Transparency, paper: PrintedPaper) -> list[Reproduced]:
    found = made.recorded.findings
    if found is None:
        return []
    rows = []
    for index, printed in PRINTED_TEST_OF_INDEX.items():
        test = found.assessed[index].comparison.friedman
        words = found.assessed[index].table.index.words
        for name, statistic_words, value in (("chi2", "chi-squared", test.statistic), ("p", "p", test.p_value)):
            rows.append(
                _row(
                    f"friedman.{index}.{name}", f"Friedman's {statistic_words}, {words}", "1", value,
                    paper[f"{printed}_{name}"], "the first study's recordings, assessed",
                )
            )  # fmt: skip
    return rows


def _circumstances(made: Transparency, paper: PrintedPaper) -> list[Reproduced]:
    rows = []
    for k, direction in zip(made.exponents, ("up", "down"), strict=True):
        rows.append(
            _row(
                f"exponent.{direction}", f"k of eq. 8, {direction}", "1", k, paper[f"inertia_exponent_{direction}"],
                "smallest interaction torque of five people who take no other part",
            )
        )  # fmt: skip
    for law in OWN_LAWS:
        never = [100.0 * np.mean([t.unsettled for t in study.of(law)]) for study in made.own]
        rows.append(
            _row(f"unsettled.{law}", f"Movements that never came to rest, {law}", "%", never, None, UNSETTLED_NOTE)
        )
    for law in LAWS:
        given = [study.given(law) for study in made.studies]
        note = "of 99 % of cycles; above 0 the robot drives"
        rows.append(
            _row(
                f"energy.{law.lower()}", f"Energy that {law} gives over a closed cycle", "J", given, None,
                note,
            )
        )  # fmt: skip
        never = [100.0 * np.mean([t.unsettled for t in study.of(law)]) for study in made.studies]
        rows.append(
            _row(
                f"unsettled.{law.lower()}",
                f"Movements that never came to rest, {law}",
                "%",
                never,
                None,
                UNSETTLED_NOTE,
            )
        )
        without = [100.0 * np.mean([t.means[PUBLISHED_RULE].left_out for t in s.of(law)]) for s in made.studies]
        rows.append(_row(f"left_out.{law.lower()}", f"Movements without a clear end, {law}", "%", without))
    units = {"coulomb": "N*m", "viscous": "N*m*s/rad", "inertia": "kg*m^2"}
    for name, unit in units.items():
        quantity = f"Additional {'Coulomb friction' if name == 'coulomb' else name} that makes control 20 % slower"
        rows.append(_row(f"required.{name}", quantity, unit, made.required[name], None, "alone"))
    count = sum(t.movements for t in made.studies[0].taken)
    note = f"{count} movements with markers, encoder and EMG, durations chosen; this machine, two threads"
    rows.append(figure("study", "seconds", "The whole virtual study", "s", made.recorded.seconds, None, note))
    return rows


def safety_rows(laws: Mapping[str, ControlLaw], *, cycles: int, seed: int = 1) -> list[Reproduced]:
    """Return the unsafe commands of all laws among fuzzed inputs, and the delay from a fault to a safe output."""
    found = {name: fuzz(law, cycles, seed=seed) for name, law in laws.items()}
    note = f"{cycles} cycles of each of {', '.join(found)}; {sum(f.faults for f in found.values())} faults"
    unsafe, slowest = sum(f.unsafe for f in found.values()), max(f.slowest for f in found.values())
    return [
        figure("safety", "unsafe", "Commands outside limits among fuzzed inputs", "1", unsafe, None, note),
        figure("safety", "slowest", "Cycles from a fault to a safe output", "1", slowest, None, note),
    ]
