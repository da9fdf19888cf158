"""Collect the findings on a result, and state what counts as a good model in all of them.

A module of findings has one function for each.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import replace
from types import ModuleType
from typing import Any

from ...models.estimates import Verdict, rank_verdicts
from ..answer import Step

MAX_GOOD_ERROR = 20.0
"""Largest held-out error of a good prediction [% of the RMS effort].

The bound leaves 4 % of the power of the effort unexplained. A controller that compensates the model leaves at most a
fifth of the joint's own effort to the wearer. The public data sets of single joints lie between 5 and 12 %.

The error of a model over all held-out data decides, whatever single recordings say. Where several models answer, of
joints or of recordings, each error decides for its own model, and yes needs all.
"""

SOUND_R2 = 0.8
"""A model explains the effort if its R2 is above this: a constant effort makes the RMS effort large, and R2 does not
count it."""

MAX_BODY_ERROR_RATIO = 1.1
"""One body predicts as well as two directions if its error is at most this many times theirs: it has ten parameters in
place of sixteen."""

MIN_EXPLAINED_PERCENT = 50.0
"""A strap explains the angle between limb and orthosis if it explains at least this share of it held out: more than is
left unexplained."""

FINDING_PREFIX = "report_"
"""Prefix of the functions that report a finding; what follows is the finding's name."""


CAUSES_FINDING = "causes"
"""Finding of a cause of what a model misses."""

SECOND_RECORDING_TEXT = "Record a second recording to hold out: the verdict rests on a single one"
"""Text of the next step where a single held-out recording decides."""

ROBOT_ADVICE = (
    "To identify one model of all joints, provide the robot's URDF: run init again with --urdf FILE, or put the file "
    'into the study\'s folder and add [tree] urdf = "FILE".'
)
"""Advice to identify a model of all joints."""

MAX_IMPROVING_STEPS = 3
"""Largest number of steps that an answer takes from findings."""


def improving_steps(verdicts: Iterable[Verdict], *otherwise: Step) -> tuple[Step, ...]:
    """Return what improves a model that does not predict: its causes, then the advice of warnings, worst first.

    `otherwise` are the steps where no finding has any.
    """
    ranked = rank_verdicts(verdicts)
    texts = [f"Look for this cause: {v.text}" for v in ranked if v.finding == CAUSES_FINDING]
    texts += [v.do for v in ranked if v.kind in ("wrong", "warning") and v.do]
    return tuple(map(Step, dict.fromkeys(texts[:MAX_IMPROVING_STEPS]))) or otherwise


def steps_before_use(verdicts: Iterable[Verdict], findings: Collection[str]) -> tuple[Step, ...]:
    """Return what to record before a model that predicts is used: the advice of warnings of the named findings."""
    unknown = (v for v in rank_verdicts(verdicts) if v.kind == "warning" and v.do and v.finding in findings)
    steps = tuple(Step(f"Before a controller is used, {_advice_with_reason(verdict)}") for verdict in unknown)
    return steps[:MAX_IMPROVING_STEPS]


def _advice_with_reason(verdict: Verdict) -> str:
    """Return a verdict's advice within a sentence, with the beginning of its text as the reason."""
    advice, reason = verdict.do.rstrip("."), verdict.text.split(" (", 1)[0].rstrip(".")
    return f"{advice[:1].lower()}{advice[1:]} ({reason[:1].lower()}{reason[1:]})"


def finders(module: ModuleType) -> Iterator[tuple[str, Callable[[Any], Iterator[Verdict]]]]:
    """Yield name and function of every finding of a module, by name: each function ``report_<name>(case)``."""
    for name, function in sorted(vars(module).items()):
        if name.startswith(FINDING_PREFIX) and getattr(function, "__module__", None) == module.__name__:
            yield name.removeprefix(FINDING_PREFIX), function


def collect_findings(module: ModuleType, case: Any) -> tuple[Verdict, ...]:
    """Return the verdicts of all findings of a module on a `case`, worst first, each under its finding's name."""
    return rank_verdicts(replace(v, finding=v.finding or name) for name, find in finders(module) for v in find(case))
