"""Ratios that benchmarks must meet, and the page docs/validation/speed.md, which is written from their rows.

A goal bounds the ratio of Pellucid's time to that of the usual alternative. Both are measured by turns in one run, so
that a slow moment of the machine affects both. If a goal is not met, the profile of the command gives the reason.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pellucid._atomic import write_text_atomically


@dataclass(frozen=True)
class Goal:
    """A bound of one ratio."""

    name: str  # name of the row that holds the ratio
    bound: float  # bound of the ratio [1]
    words: str  # what is compared
    at_least: bool = False  # whether the ratio shall be at least the bound, not at most
    profile: str = ""  # causes of the time beyond the bound, printed if the goal is not held

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
        profile="Half of `identify` fits five friction families by six estimators and over ten blocks; a quarter is "
        "imports.",
    ),
    Goal(
        "report again over python",
        12.0,
        "`report` of a study in which nothing changed over `python -c pass`",
        profile="Two fifths are imports of the standard library, two fifths the versions of code and libraries; the "
        "rest is checksums.",
    ),
    Goal(
        "identify 1e5 over pandas",
        0.8,
        "`identify` of 100,000 samples over pandas and least squares",
        profile="Two thirds fit and cross-validate five friction families; a fifth is imports.",
    ),
    Goal(
        "identify 7.2e6 over pandas",
        2.2,
        "`identify` of 7.2 million samples over pandas and least squares",
        profile="A third is intervals and neglected effects, a fifth regressors at the full rate, a sixth reading and "
        "its checks.",
    ),
    Goal(
        "simulate over in memory",
        1.7,
        "`simulate` of six people who point, 2,400 movements, over the same in memory",
        profile="Beyond the movements, a quarter is raw EMG at 2 kHz, a fifth the writing of 585 MB of text, and a "
        "tenth the identification of the robot.",
    ),
    Goal(
        "assess over reading",
        2.4,
        "`assess` of these people over PyArrow, which reads the same files",
        profile="Reading and its checks are 44 %, of which half is the files' text; movements and EMG are a third.",
    ),
    Goal(
        "plant.core_over_numba",
        1.0,
        "steps per second of one joint's plant over Numba",
        at_least=True,
        profile="A single joint waits for the sine of its last angle, which takes 1.5 times the C library's time and "
        "gives the same bits on every processor.",
    ),
    Goal(
        "friction by load, SciPy over ours",
        1.2,
        "SciPy's least squares over our fit of friction",
        at_least=True,
        profile="A third of Pellucid's time is the covariance and tests of neglected effects, which the baseline does "
        "not compute.",
    ),
    Goal(
        "fit_joint second over lstsq",
        8.0,
        "second call of `fit_joint` over a filter and NumPy's least squares",
        profile="It decides as `identify` does for one family: half fits and compares estimators, the rest filters, "
        "aligns and checks the data.",
    ),
)
"""Every ratio that has a bound, in the order of the page."""


@dataclass(frozen=True)
class Comparison:
    """A ratio without a bound, on the page of speed."""

    name: str  # name of the row that holds the ratio
    words: str  # what is compared
    sentence: str


COMPARISONS = (
    Comparison(
        "emps: output error, plain over Pellucid",
        "SciPy's least squares on a Numba plant over the output-error fit of EMPS",
        "The core gives exact Jacobians, so that the fit needs no finite differences.",
    ),
    Comparison(
        "emps: least squares, plain over Pellucid",
        "NumPy's least squares over the same fit of EMPS",
        "Both solve one small linear problem.",
    ),
    Comparison(
        "calibrating ten muscles, 55 parameters, differences over Pellucid",
        "finite differences over the calibration of ten muscles (55 parameters)",
        "Both reach the same cost; the gain is the exact Jacobian.",
    ),
    Comparison(
        "transfer function, 10,000 samples, plain over Pellucid",
        "SciPy's `lsim` and least squares over the fit of a transfer function, 10,000 samples",
        "All coefficients agree within 1e-8.",
    ),
    Comparison(
        "ridge regression over GridSearchCV",
        "the torque estimator's ridge regression over scikit-learn's `GridSearchCV`",
        "Rows, candidates and folds are the same.",
    ),
    Comparison(
        "tree: regressor, ratio",
        "the regressor of six joints over Pinocchio's",
        "Pellucid computes all 45,000 samples in one call.",
    ),
    Comparison(
        "tree: inverse dynamics, one by one, ratio",
        "inverse dynamics of six joints, sample by sample, over Pinocchio's",
        "Both are called once for each sample.",
    ),
    Comparison(
        "plant.core_batch_over_numba_batch",
        "steps per second of 64 simulated joints in lanes over Numba",
        "Vector instructions advance several joints at once.",
    ),
    Comparison(
        "plant.core_over_mujoco",
        "steps per second of one simulated joint over MuJoCo",
        "MuJoCo is called from Python, ten steps a call.",
    ),
    Comparison(
        "law: FC, Python over core",
        "one step of full compensation called from Python over the same step in C++",
        "A live session calls the controller from C++.",
    ),
    Comparison(
        "law: FC, NumPy over core",
        "one step of full compensation written in NumPy over the same step in C++",
        "Torques agree within 1e-9 N·m over 20,000 steps.",
    ),
)
"""Further ratios on the page, in its order."""

RESULTS_FILE = Path(__file__).with_name("results") / "speed.json"
"""Every figure of the last run that was written."""

SPEED_PAGE = Path(__file__).parents[2] / "docs" / "validation" / "speed.md"
"""Page that is generated from the results."""

HEAD = """# Speed

This page is generated from `research/benchmarks/results/speed.json`, which has every figure with its spread.

**Claim.** Fits, controllers and batches of simulations are as fast as the usual tools or faster. One simulated joint
alone is slower than in Numba. A command takes longer than a plain fit, because it also computes intervals, selects a
model and tests it.

**Data.** Public recordings and simulated joints. Times are processor seconds of fresh processes with one thread each,
medians of pairs that ran in turn. Machine: {machine}.

**Baseline.** The second term of each comparison. A ratio holds on other machines, a time does not.

**Command.** `python -m research.benchmarks --write` measures again and writes results and page.
`python -m research.benchmarks --page` only writes the page.

## Bounded ratios

| comparison | ratio | bound | within |
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
    """Return the page of speed in Markdown."""
    ratios = {row["name"]: row["value"] for row in rows}
    text = HEAD.format(machine=machine)
    for goal in GOALS:
        ratio = f"{ratios[goal.name]:.3g}" if goal.name in ratios else "–"
        text += f"| {goal.words} | {ratio} | {goal.text} | {held_text(goal, ratios)} |\n"
    missed = [goal for goal in GOALS if held_text(goal, ratios) == "no" and goal.profile]
    if missed:
        text += "\nThe time beyond a bound has these causes:\n\n"
        text += "".join(f"- **{goal.words}**: {goal.profile}\n" for goal in missed)
    text += "\n## Other ratios\n\n| comparison | ratio | remark |\n|---|--:|---|\n"
    for each in COMPARISONS:
        if each.name in ratios:
            text += f"| {each.words} | {ratios[each.name]:.3g} | {each.sentence} |\n"
    return text


def write_results(rows: Sequence[Mapping], machine: str) -> None:
    """Write all figures of a run, and the page."""
    write_text_atomically(RESULTS_FILE, json.dumps({"machine": machine, "figures": list(rows)}, indent=1) + "\n")
    write_page()


def write_page() -> None:
    """Write the page from the stored results."""
    write_text_atomically(SPEED_PAGE, stored_page())


def stored_page() -> str:
    """Return the page of the stored results."""
    results = json.loads(RESULTS_FILE.read_text(encoding="utf-8"))
    return speed_page(results["figures"], results["machine"])
