"""Effect of a free shoulder on the published laws of the elbow, which their paper does not state.

Five simulated robots, each worn by one of five simulated people; the elbow is driven by position control (CLPC) or by
full compensation (FC), with constants found while the shoulder was held. The shoulder is held by PI; or free, its
weight carried, and kept still by its wearer; or free and moved, in reaching with the whole arm as recorded people did
where their recordings are here, else in generated reaching. Each figure is the mean over the five; `over_held` is the
ratio to the same law with the shoulder held, of pairs, its mean.

Plant and laws share no model: the plant has cables with gaps, load friction and cuffs, the laws have a few numbers of
one joint. No constant of either was chosen by these figures.
"""

from collections.abc import Iterator

import numpy as np

from pellucid._errors import PellucidError
from pellucid.study.results import ResultRow
from pellucid_lab.arm.free_shoulder import LAWS, SHOULDER_CONDITIONS, ShoulderFigures, compare_shoulders
from pellucid_lab.arm.human_motion import people
from pellucid_lab.arm.rig import able_arm, drawn_arms
from pellucid_lab.arm.wearer import drawn_people
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

ARM_COUNT = sized(5, smallest=1)
"""Number of drawn arms."""


def rows(arms: int = ARM_COUNT) -> Iterator[ResultRow]:
    """Every figure."""
    try:
        recorded = people()
    except PellucidError:
        recorded = ()
    pairs = zip(drawn_arms(able_arm(), arms), drawn_people(arms, recorded=recorded), strict=True)
    found = ordered_results([(compare_shoulders, rig, person) for rig, person in pairs])
    motion = "recorded reaching" if recorded else "generated reaching"
    for law in LAWS:
        by = {shoulder: [_of(figures, law, shoulder) for figures in found] for shoulder in SHOULDER_CONDITIONS}
        for shoulder, own in by.items():
            head = f"free_shoulder.{law}.{shoulder}"
            note = f"{arms} robots and people; shoulder {shoulder}" + (f", {motion}" if shoulder == "moving" else "")
            yield _row(f"{head}.elbow", [f.elbow_interaction for f in own], "N*m", note)
            yield _row(f"{head}.shoulder", [f.shoulder_interaction for f in own], "N*m", note)
            yield _row(f"{head}.elbow_error", [f.elbow_error for f in own], "rad", note)
            yield _row(f"{head}.shoulder_moved", [f.shoulder_moved for f in own], "rad", note)
            yield _row(f"{head}.stopped", [float(f.stopped) for f in own], "1", note)
            ratios = [f.elbow_interaction / h.elbow_interaction for f, h in zip(own, by["held"], strict=True)]
            yield _row(f"{head}.elbow.over_held", ratios, "1", note)


def _of(figures: tuple[ShoulderFigures, ...], law: str, shoulder: str) -> ShoulderFigures:
    return next(f for f in figures if (f.law, f.shoulder) == (law, shoulder))


def _row(name: str, values: list[float], unit: str, note: str) -> ResultRow:
    note = f"{note}; {min(values):.3g} to {max(values):.3g}"
    return ResultRow(name, float(np.mean(values)), unit, "evidence", "simulated", None, note)
