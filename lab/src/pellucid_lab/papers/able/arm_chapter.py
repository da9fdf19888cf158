"""The four-joint chapter: eq. 7 against load friction, Table I's question with all joints, transparency of an arm.

The paper identifies one joint; its eq. 7 gives the number of parameter sets that its method would need for n joints.
Here the method is applied to the virtual arm of four joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import Row, Table
from pellucid.study.pages.page import Section

from ...arm.rig import able_arm
from ...arm.wearer import drawn_people
from ..figure import Reproduced, figure
from ..row_sections import cell
from .arm_figures import cost_by_joints
from .arm_identification import IdentifiedArm, directional_many, identified
from .arm_worn import BEST_LAW, PUBLISHED_LAW, worn
from .directional_sets import DirectionalRow

MODEL_IDS: Mapping[str, str] = {
    "one body, load friction": "load",
    "one body, plain friction": "plain",
    "sets, own": "sets_own",
    "sets, one side": "sets_printed",
    "sets, all": "sets_errata",
}
"""Ids of the models, by the names that `compare_directional` gives them."""

MODEL_WORDS: Mapping[str, str] = {
    "load": "one body, load friction",
    "plain": "one body, plain friction",
    "sets_own": "sets by own direction",
    "sets_printed": "sets as printed, p(2ⁿ − 1)",
    "sets_errata": "sets of all directions, n p 2ⁿ⁻¹",
}
"""Descriptions of the models, by their ids."""

WORN_LAWS = (PUBLISHED_LAW, "transparent", BEST_LAW)
"""Laws of `arm_worn.LAWS` under which the arm is worn."""

WORN_MOTION_S = 10.0
"""The worn motion is cut to this length."""

_row = partial(figure, "able.arm")


@dataclass(frozen=True, eq=False)
class ArmChapter:
    """Figures of the chapter."""

    compared: Mapping[int, Mapping[str, DirectionalRow]]  # Comparison by number of moving joints, then by model's id
    found: IdentifiedArm
    torque: Mapping[str, float]  # Interaction torque by law, RMS over joints [N m]


def arm_chapter(joints: Sequence[int], *, seconds: float = WORN_MOTION_S, workers: int | None = None) -> ArmChapter:
    """Identify the rig `able-arm` with each number of moving `joints`, then with all of them, and let a person wear it.

    Parameters
    ----------
    joints : sequence of int
        Numbers of joints that move; the others are held.
    seconds : float
        Length of the worn motion [s].
    workers : int, optional
        Processes; as many as there are processors if None.
    """
    rig = able_arm()
    made = directional_many([(rig, 1, n) for n in joints], workers)
    compared = {n: {MODEL_IDS[one.model]: one for one in rows} for n, rows in zip(joints, made, strict=True)}
    found = identified(rig)
    # Constants of the laws were chosen on other people. Reaching is generated, so that every machine draws the same.
    person = drawn_people(1, seed=3)[0]
    made = worn(rig, person, WORN_LAWS, seconds)
    return ArmChapter(compared, found, {name: one.interaction for name, one in made.items()})


def arm_rows(chapter: ArmChapter) -> Iterator[Reproduced]:
    """Yield rows on eq. 7 by number of joints, on Table I's ratio of errors, and on transparency."""
    for n, models in chapter.compared.items():
        for name, one in models.items():
            words = f"{MODEL_WORDS[name]}, {n} joint{'s' if n > 1 else ''} of the rig able-arm"
            yield _row(f"n{n}.{name}.parameters", f"Parameters of {words}", "1", one.parameters,
                       note=f"{one.visited} of {one.sets} sets are visited")  # fmt: skip
            yield _row(f"n{n}.{name}.error", f"Torque error, mean over joints, of {words}", "%", one.mean,
                       note="people's motion, never fitted")  # fmt: skip
            yield _row(f"n{n}.{name}.condition", f"Condition of {words}", "1", one.condition, note="median over sets")
            yield _row(f"n{n}.{name}.creates_energy", f"Closed paths along which energy comes out of {words}", "%",
                       one.creates)  # fmt: skip
    whole = chapter.compared[max(chapter.compared)]
    if "sets_own" in whole:
        without, dissociated = whole["plain"].mean, whole["sets_own"].mean
        words = "all joints of the rig able-arm, motions never fitted"
        yield _row("table1.ratio", f"Error without dissociation over that with it, {words}", "1", without / dissociated,
                   note="the paper's 3.4 is of one joint and another robot")  # fmt: skip
        yield _row("table1.load_ratio", f"Error with dissociation over that of one body, load friction, {words}", "1",
                   dissociated / whole["load"].mean)  # fmt: skip
    yield _row("gravity_error", "Largest error of gravity, one consistent body per link, known payload", "%",
               chapter.found.gravity["consistent"])  # fmt: skip
    yield _row("gravity_error.stated_gains", "The same without payload, gains as stated", "%",
               chapter.found.gravity["load_stated_gains"])  # fmt: skip
    for name, value in chapter.torque.items():
        yield _row(f"torque.{name}", f"Interaction torque RMS under {name}, four joints", "N*m", value)
    yield _row("torque.best_over_fc", "Interaction torque of the toolkit's own law over FC's, four joints", "1",
               chapter.torque[BEST_LAW] / chapter.torque[PUBLISHED_LAW],
               note="constants chosen on other arms; one person, generated reaching")  # fmt: skip


def arm_sections(chapter: ArmChapter) -> tuple[Section, ...]:
    """Return the section that draws eq. 7 over joints, and the section of the worn arm."""
    counts = sorted(chapter.compared)
    table = [
        Row(
            (str(n), MODEL_WORDS[name], str(one.parameters), *(cell(x) for x in (one.mean, one.condition, one.creates)))
        )
        for n in counts
        for name, one in chapter.compared[n].items()
    ]
    whole = chapter.compared[counts[-1]]
    load, sets = whole["load"], whole.get("sets_errata", whole["sets_own"])
    gives = f"{sets.creates:.0f} %" if sets.creates else "none"
    comparison_text = (
        f"With {counts[-1]} joints, one body whose friction follows the load has {load.parameters} parameters and errs "
        f"by {load.mean:.1f} % of the torque on motions never fitted; sets of all directions have {sets.parameters} "
        f"and err by {sets.mean:.1f} %. Sets know nothing of each other: on the worst of 200 closed paths they "
        f"lose {sets.least:.2f} of what one body does, and along {gives} of them they give energy out."
    )
    drawing = draw(
        cost_by_joints,
        chapter.compared,
        MODEL_WORDS,
        "What directions cost as joints are added: the others are held by the robot's own loops.",
    )
    over = chapter.torque[BEST_LAW] / chapter.torque[PUBLISHED_LAW]
    worn_text = (
        f"Under full compensation of all four joints a person who reaches feels "
        f"{chapter.torque[PUBLISHED_LAW]:.2f} N·m in the root mean square over joints; under the toolkit's own law, "
        f"chosen on other arms, {over:.2f} of it."
    )
    gravity = chapter.found.gravity
    gravity_text = (
        f"Lifting and lowering lose different shares of the load, which no motion tells from the masses: with gains as "
        f"stated, gravity errs by {gravity['load_stated_gains']:.1f} %; with a payload of known mass, by "
        f"{gravity['consistent']:.1f} %."
    )
    return (
        Section(
            "arm",
            "Four joints: eq. 7 against load friction",
            (comparison_text, gravity_text),
            (
                Table(
                    ("Joints", "Model", "Parameters", "Error (%)", "Condition", "Gives energy (% of paths)"),
                    tuple(table),
                    frozenset({2, 3, 4, 5}),
                    wide=True,
                ),
            ),
            (drawing,),
        ),
        Section("arm-worn", "Four joints worn", (worn_text,), (), ()),
    )
