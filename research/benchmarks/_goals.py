"""Ratios that benchmarks must meet, and the page docs/speed.md, which is written from their rows.

A goal bounds the ratio of Pellucid's time to that of the usual alternative. Both are measured by turns in one run, so
that a slow moment of the machine affects both. If a goal is not met, the profile of the command gives the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Goal:
    """A bound of one ratio."""

    name: str  # name of the row that holds the ratio
    bound: float  # bound of the ratio [1]
    words: str  # what is compared
    at_least: bool = False  # whether the ratio shall be at least the bound, not at most
    profile: str = ""  # where the time goes, said if the goal is not held

    def is_held(self, ratio: float) -> bool:
        """Return whether a ratio keeps the bound."""
        return ratio >= self.bound if self.at_least else ratio <= self.bound

    @property
    def text(self) -> str:
        """Return the bound as the page prints it."""
        return f"{'≥' if self.at_least else '≤'} {self.bound:g}"


GOALS = (
    Goal("version over python", 4.0, "`pellucid --version` over `python -c pass`"),
    Goal(
        "EMPS three over plain",
        5.0,
        "`check`, `identify` and `report` of one joint over one least squares fit with NumPy and SciPy",
        profile="Five families are fitted by six estimators, with intervals, and without each of ten blocks; one "
        "family by every estimator without each block. The plain fit is one of these some 200 fits. A report draws "
        "eleven figures with Matplotlib, half a second each.",
    ),
    Goal(
        "report again over python",
        12.0,
        "`report` of a study in which nothing changed over `python -c pass`",
        profile="Half of it is the import of Typer and pydantic, which read the command and study.toml; the rest is "
        "mostly hashing: of the study's files and of the code, by which it is known that nothing changed.",
    ),
    Goal(
        "identify 1e5 over pandas",
        0.8,
        "`identify` of 100,000 samples over pandas and least squares",
        profile="To load SciPy, pydantic and Typer takes longer than the goal allows for all. Two thirds are fits of "
        "five families by six estimators, and without each of ten blocks, as for the joint above; reading is a "
        "twentieth.",
    ),
    Goal(
        "identify 7.2e6 over pandas",
        2.2,
        "`identify` of 7.2 million samples over pandas and least squares",
        profile="Filters at the full rate and nonlinear families read all rows several times; the reference "
        "method reads them once.",
    ),
    Goal(
        "simulate over in memory",
        1.7,
        "`simulate` of six people who point, 2,400 movements, over the same in memory",
        profile="Half of the additional time is raw EMG at 2 kHz, which the reference method does not simulate. A "
        "third is safe writing of 585 MB of text; the rest is loading of code.",
    ),
    Goal(
        "assess over reading",
        2.4,
        "`assess` of these people over PyArrow, which reads the same files",
        profile="Reading is a sixth of it. EMG is filtered, clocks are compared, spikes are looked for, and all "
        "movements are found and measured again under each of eight other rules, for the table of sensitivity.",
    ),
    Goal(
        "plant.core_over_numba",
        1.0,
        "steps per second of one joint's plant over Numba",
        at_least=True,
        profile="Each step waits for the sine of the last one's angle. The core's sine and cosine are one function "
        "without a branch, which lanes, dual numbers and microcontrollers share and which gives all of them the same "
        "bits; one after another it takes 1.5 times as long as the C library's sine, which Numba calls. Its tanh takes "
        "three quarters of the C library's time. Many joints in lanes run at several times Numba's speed (the row "
        "`plant.core_batch_over_numba_batch`).",
    ),
    Goal(
        "friction by load, SciPy over ours",
        1.2,
        "SciPy's least squares over our fit of friction",
        at_least=True,
        profile="Pellucid's time includes the covariance and tests of neglected effects (a third of the time); the "
        "reference method returns values without intervals.",
    ),
    Goal(
        "fit_joint second over lstsq",
        8.0,
        "second call of `fit_joint` over a filter and NumPy's least squares",
        profile="The fit itself is a tenth. The rest is what stands behind its intervals: neglected effects, blocks "
        "drawn 2,000 times, drift between blocks, families of friction that the drive's limits would carry.",
    ),
)
"""Every ratio that has a bound, in the order of the page."""

HEAD = """# Speed

This page is written by `make bench` from what the benchmarks measured; nothing in it is typed by hand but the reasons
of goals that are not held. Times are processor seconds of fresh processes, medians of pairs that ran by turns. Ratios
mean the same on another machine, seconds do not. Machine: {machine}.

## Goals

| What is compared | Ratio | Goal | Held |
|---|--:|--:|---|
"""


def held_text(goal: Goal, ratios: Mapping[str, float]) -> str:
    """Return whether a goal is held, or that its benchmark did not run."""
    if goal.name not in ratios:
        return "not measured"
    return "yes" if goal.is_held(ratios[goal.name]) else "no"


def goal_table(rows: Sequence[Mapping]) -> str:
    """Return lines for the terminal with each ratio and its goal."""
    ratios = {row["name"]: row["value"] for row in rows}
    width = max(len(goal.name) for goal in GOALS)
    lines = [
        f"{goal.name:<{width}}  {ratios[goal.name]:>8.3g}  goal {goal.text:<6}  {held_text(goal, ratios)}"
        for goal in GOALS
        if goal.name in ratios
    ]
    return "\n".join(lines)


def speed_page(rows: Sequence[Mapping], machine: str) -> str:
    """Return the text of docs/speed.md."""
    ratios = {row["name"]: row["value"] for row in rows}
    text = HEAD.format(machine=machine)
    for goal in GOALS:
        ratio = f"{ratios[goal.name]:.3g}" if goal.name in ratios else "–"
        text += f"| {goal.words} | {ratio} | {goal.text} | {held_text(goal, ratios)} |\n"
    missed = [goal for goal in GOALS if held_text(goal, ratios) == "no" and goal.profile]
    if missed:
        text += "\n## Where the time goes\n\n"
        text += "".join(f"- **{goal.words}**: {goal.profile}\n" for goal in missed)
    text += "\n## Every figure\n\n| Name | Value | Unit | Note |\n|---|--:|---|---|\n"
    for row in rows:
        text += f"| {row['name']} | {row['value']:.4g} | {row['unit']} | {str(row['note']).replace('|', '/')} |\n"
    return text
