"""Results on public recordings, and the validation page that is written from them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from pellucid._atomic import write_text_atomically
from pellucid.study.results import ResultRow, read_rows

RESULTS_FILE = Path(__file__).with_name("results") / "real-data.json"
"""Every figure of the page, as the commands wrote it into results.json."""

PAGE = Path(__file__).parents[2] / "docs" / "validation" / "real-data.md"
"""Page that is generated from the results."""


@dataclass(frozen=True)
class Published:
    """A figure with its published value."""

    id: str
    published: str
    decimals: int
    unit: str


EMPS: tuple[Published, ...] = (
    Published("emps.symmetric.inertia", "95.11 ± 0.11", 2, "kg"),
    Published("emps.symmetric.viscous", "203.5 ± 1.1", 1, "N·s/m"),
    Published("emps.symmetric.coulomb", "20.39 ± 0.10", 2, "N"),
    Published("emps.symmetric.offset", "−3.165 ± 0.044", 3, "N"),
    Published("emps.symmetric.effort_error.identification", "4.08", 2, "%"),
    Published("emps.symmetric.effort_error.pulses", "5.98", 2, "%"),
    Published("emps.directional.effort_error.identification", "3.11", 2, "%"),
    Published("emps.symmetric.sim.identification.effort", "5.85", 2, "%"),
    Published("emps.symmetric.sim.pulses.effort", "8.94", 2, "%"),
)
"""Figures of EMPS and what A. Janot, M. Gautier and M. Brunot published; ± is one standard deviation."""

ARM_MODELS: Mapping[str, str] = {
    "published": "stated bodies, published friction",
    "stated": "stated bodies, fitted friction",
    "base": "base parameters, plain friction",
    "best": "friction chosen for each joint",
    "consistent": "the same with consistent bodies",
}
"""Models of an arm, by their name in an id."""

ARM_ERRORS: Mapping[str, str] = {"staubli_tx40": "segments_out", "ur10e": "heldout"}
"""Data on which an arm's error is computed, by the data set."""

UNKNOWN = frozenset({("ur10e", "published")})
"""Models that a data set does not have."""

ISOMETRIC: tuple[tuple[str, str], ...] = (
    ("knee_extension", "vastus_lateralis"),
    ("knee_flexion", "biceps_femoris"),
    ("dorsiflexion", "tibialis_anterior"),
    ("plantarflexion", "gastrocnemius_lateralis"),
)
"""Tasks, and the muscle that pulls in each."""

TORQUES: tuple[tuple[str, str, str, str], ...] = (
    ("walking, the next 36 s (knee)", "lower_limb_walking", "knee", ".rest"),
    ("walking, the next 36 s (ankle)", "lower_limb_walking", "ankle", ".rest"),
    ("lifting 15 kg, fitted on 5 kg (trunk)", "lumbar_lifting", "trunk", ""),
)
"""Held-out recordings with torque from EMG: words, data set, joint, and the end of its ids."""


def wanted_ids() -> Iterator[str]:
    """Yield the id of each figure that the page shows."""
    yield from (each.id for each in EMPS)
    for data_set, split in ARM_ERRORS.items():
        models = (model for model in ARM_MODELS if (data_set, model) not in UNKNOWN)
        yield from (f"{data_set}.{model}.{split}.error.mean" for model in models)
        yield f"{data_set}.interval.over_jackknife.share_within_2"
    yield "ur10e.payload.mass"
    yield from (f"elderly_isometric.{task}.{muscle}.r" for task, muscle in ISOMETRIC)
    for _, data_set, joint, end in TORQUES:
        yield from (f"{data_set}.{joint}.{name}{end}" for name in ("chosen.r2", "motion.r2", "chosen.coverage90"))
        yield from (f"{data_set}.{joint}.gain_over_angles{bound}{end}" for bound in ("", ".low", ".high"))
    yield from ("bam_servo.headline.heldout.effort_error",)


def write_results(rows: Iterable[ResultRow], path: Path = RESULTS_FILE) -> None:
    """Write the figures as JSON."""
    content = {"figures": [asdict(row) for row in rows]}
    write_text_atomically(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n")


def read_results(path: Path = RESULTS_FILE) -> dict[str, ResultRow]:
    """Return the figures of a file, by id."""
    return {row.id: row for row in read_rows(path)}


HEAD = """# Validation on real machines and people

This page is generated from `research/evidence/results/real-data.json`. [Simulated results](simulation.md) have a page
of their own, and the [errata](../errata.md) prove errors of papers.

**Claim.** Identification and torque from EMG predict recordings that were not fitted, as well as published methods or
better. Where joint angles predict a torque as well as EMG does, the answer says so.

**Data.** Public recordings of real machines and people, as `pellucid init DIR --dataset NAME` fetches them.

**Baseline.** Published values; stated bodies of the robot's file; joint angles without EMG.

**Command.** `python -m research.evidence.real_data` runs the commands on all data sets and writes this page.
`python -m research.evidence.real_data --page` only writes the page.

**Limits.** One recording or a few people for each claim. No controller was worn.
"""
"""Text before the results."""

EMPS_TEXT = """## EMPS, a real machine

EMPS is a motor with a ball screw and a carriage (A. Janot, M. Gautier, M. Brunot 2019). One recording is fitted. The
other, with force pulses, is held out. The published ± is one standard deviation, `sim` a closed-loop simulation.

| figure | published | Pellucid | unit |
|---|--:|--:|---|
"""
"""Text before the figures of EMPS."""

EMPS_PICTURES = """
![Friction force against velocity with the samples of EMPS, for all friction families](../images/emps_friction.svg)

![The beginning of a report: the joint, its parameters with intervals, and the answer](../images/emps_report.png)

*The beginning of the report on EMPS, as `pellucid report` writes it.*
"""
"""Pictures after the figures of EMPS."""

ARM_TEXT = """## Real arms of six joints

The error is the RMS torque error relative to the RMS torque, as a mean over moving joints. Each of 13 segments of the
Stäubli TX40 is held out in turn. Two recordings of the UR10e are held out.

| model | Stäubli TX40 | UR10e |
|---|--:|--:|
"""
"""Text before the errors of arms."""

EMG_TEXT = """## Torque from EMG, real people

The recommended estimator, chosen by cross-validation within the fitted recordings, against ridge regression on joint
angles alone. The gain is the difference of R² to the best estimators without EMG, chosen in the same way. The last
column is the coverage of the 90 % band.

| held-out recording | R² | R² of angles alone | gain | 95 % interval | coverage |
|---|--:|--:|--:|--:|--:|
"""
"""Text before the figures of torque from EMG."""

FORCE_TEXT = """## EMG and force

Ten people of 64 to 82 years pushed against a load cell (`elderly_isometric`, `pellucid emg force`).

| task | muscle | correlation | 95 % interval |
|---|---|--:|--:|
"""
"""Text before the correlations."""

OTHERS = """## Results without a stored file

These commands compute further results on real recordings. Their figures are not on this page, because no results file
is stored.

| result | command |
|---|---|
| detection of changed EMG channels and of movements outside the fitted range | `python -m research.evidence emg` |
| recommended estimator compared with the best one, all data sets | `python -m research.evidence emg` |
| replay of an exported servo in MuJoCo | `python -m research.evidence formats` |
| presliding of real machines | `python -m research.evidence friction` |
| pointing movements of people without a robot | `python -m research.evidence people` |
| typical faults of recordings | `python -m research.evidence spoilt` |
"""
"""Commands of further results."""


def shown(value: float, decimals: int) -> str:
    """Return a figure with a minus sign that a reader sees."""
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text.replace("-", "−")


def interval_of(row: ResultRow) -> str:
    """Return the interval in a figure's note: "0.35 to 0.73"."""
    return row.note.partition("interval ")[2].partition(":")[0].replace("-", "−")


def real_data_page(results: Mapping[str, ResultRow]) -> str:
    """Return the page in Markdown."""

    def value(name: str, decimals: int) -> str:
        found = results[name].value
        return "" if found is None else shown(found, decimals)

    text = HEAD + "\n" + EMPS_TEXT
    for each in EMPS:
        text += f"| `{each.id}` | {each.published} | {value(each.id, each.decimals)} | {each.unit} |\n"
    text += EMPS_PICTURES + "\n" + ARM_TEXT
    for model, words in ARM_MODELS.items():
        ids = [f"{data_set}.{model}.{split}.error.mean" for data_set, split in ARM_ERRORS.items()]
        text += f"| {words} | {' | '.join(f'{value(i, 2)} %' if i in results else '' for i in ids)} |\n"
    within = [value(f"{data_set}.interval.over_jackknife.share_within_2", 0) for data_set in ARM_ERRORS]
    text += (
        f"\nA payload of 2.805 kg on the UR10e is estimated as {value('ur10e.payload.mass', 2)} kg. Standard errors\n"
        f"within a factor of two of a jackknife over segments: {within[0]} % (TX40) and {within[1]} % (UR10e).\n\n"
        f"A servo (`bam_servo`) is predicted on four held-out recordings with an error of "
        f"{value('bam_servo.headline.heldout.effort_error', 1)} %.\n\n"
    )
    text += EMG_TEXT
    for words, data_set, joint, end in TORQUES:
        at = f"{data_set}.{joint}."
        low, high = (value(f"{at}gain_over_angles.{bound}{end}", 2) for bound in ("low", "high"))
        text += (
            f"| {words} | {value(f'{at}chosen.r2{end}', 2)} | {value(f'{at}motion.r2{end}', 2)} "
            f"| {value(f'{at}gain_over_angles{end}', 2)} | {low} to {high} "
            f"| {100.0 * (results[f'{at}chosen.coverage90{end}'].value or 0.0):.0f} % |\n"
        )
    text += "\n" + FORCE_TEXT
    for task, muscle in ISOMETRIC:
        row = results[f"elderly_isometric.{task}.{muscle}.r"]
        words = (name.replace("_", " ") for name in (task, muscle))
        text += f"| {' | '.join(words)} | {value(row.id, 2)} | {interval_of(row)} |\n"
    return text + "\n" + OTHERS


def write_page() -> None:
    """Write the page from the stored results."""
    write_text_atomically(PAGE, real_data_page(read_results()))
