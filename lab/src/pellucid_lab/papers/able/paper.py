"""Reproduction of the ABLE paper: identification on virtual elbows, control laws with simulated people, printed
numbers.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.joint.slider.slider_fit import SLIDER_METHODS, SliderFit
from pellucid.study.answer import AnswerPart
from pellucid.study.pages.forest import Row, Table
from pellucid.study.pages.page import Section, Tile

from ...elbow.protocol import excitation, trials
from ...elbow.rig import ElbowRig, able_elbow, drawn_rigs
from ...pointing.conditions import Cards, controller_builder, identify_cards
from ...pointing.people import draw_people
from ...pointing.rig import PointingRig, elbow_participants
from ...pointing.sensitivity import Sensitivity, is_salib_installed, screen_factors
from ..figure import Figures, Reproduced
from ..paper import Paper, Progress
from .arm_chapter import ArmChapter, arm_chapter, arm_rows, arm_sections
from .card import write_published_card
from .elbow import able_elbow as published_elbow
from .identification_rows import LOAD_FRICTION_FACTORS, compared_rows, factor_rows, recomputed_rows
from .identification_sections import identification_sections
from .law_comparison import compare_controllers, comparison_rows
from .predicted import PredictionSize, ScoredPrediction, models_of_people, predict_paper, predicted_rows
from .predicted_sections import predicted_sections
from .statistics import statistics_rows
from .transparency import LAWS, Transparency, compare_laws
from .transparency_rows import safety_rows, transparency_rows
from .transparency_sections import transparency_sections
from .trials import ModelComparison, compare_many, compare_models


@dataclass(eq=False)
class AblePaper(Paper):
    """The reproduction: ten seeds on six elbows, five studies with six people, ten million fuzzed cycles per law."""

    title: ClassVar = "ABLE: reproduced"
    over: ClassVar = "Over seeds or robots"
    # Rows that no entry names are on held-out trials. A rig's own constants, and arithmetic, count as simulated.
    splits: ClassVar = {
        "fitted": (".published_protocol.", ".friction_needed.", ".implied_friction."),
        "simulated": (
            ".gravity_error", ".inertia_error", ".slider_error", ".recomputed.", ".parameter_count", ".table2.",
            ".statistics.", "transparency.", "safety.", "study.", "able.arm.",
            "able.predicted.",
        ),
    }  # fmt: skip
    main: ClassVar = (
        "able.table1.", "able.consistent.ratio", "able.load.ratio", "able.load.torque_error",
        "able.friction_needed.factor", *(f"transparency.duration_median.{law}" for law in ("fc", "pcfr", "clpc")),
        "transparency.unsettled.fc",
        "able.predicted.inside", "able.predicted.order",
        "transparency.torque.best_over_fc", "able.arm.n4.", "safety.unsafe", "study.seconds",
    )  # fmt: skip

    seeds: Sequence[int] = tuple(range(1, 11))  # Seeds of the measurement noise
    rigs: int = 5  # Number of drawn rigs beside the committed one
    people: PointingRig | None = None  # Virtual people who wear the committed rig; the package's if None
    studies: Sequence[int] = tuple(range(1, 6))  # Seeds of the virtual people, their order of conditions, their noise
    joints: Sequence[int] = (1, 2, 3, 4)  # Numbers of moving joints in the four-joint chapter; empty: no chapter
    # Size of the prediction of the experiment; None: no such chapter
    predicted: PredictionSize | None = field(default_factory=PredictionSize)
    fuzzed: int = 10_000_000  # Number of control cycles with fuzzed inputs, for every law
    workers: int | None = None  # Processes, or threads; as many as there are processors if None

    rig: ElbowRig = field(init=False)
    comparisons: tuple[ModelComparison, ...] = field(init=False)  # All rigs and seeds, the committed rig's first
    by_factor: tuple[ModelComparison, ...] = field(init=False)  # The committed rig, its friction times `LOAD_FACTORS`
    fit: SliderFit = field(init=False)  # The committed rig's, first seed
    transparency: Transparency = field(init=False)  # The paper's laws with virtual people, on the committed rig
    scored: ScoredPrediction | None = field(init=False, default=None)  # Prediction of the experiment beside the paper
    screened: Sensitivity | None = field(init=False, default=None)  # Sensitivity of that prediction to each factor
    chapter: ArmChapter | None = field(init=False, default=None)  # Chapter on four joints

    def figures(self, tell: Progress) -> Iterator[Reproduced]:
        """Yield Table I and Fig. 3, then all that follows from print alone, then Tables III to V and other laws."""
        self.rig = rig = able_elbow()
        drawn = drawn_rigs(rig, self.rigs)
        jobs = [(r, seed) for r in (rig, *drawn) for seed in self.seeds]
        stronger = [(_with_load(rig, factor), self.seeds[0]) for factor in LOAD_FRICTION_FACTORS]
        found = compare_many(
            [*jobs, *stronger],
            self.workers,
            lambda done, of: tell(f"{done} of {of} identifications", 0.4 * done / of),
        )
        self.comparisons, self.by_factor = tuple(found[: len(jobs)]), tuple(found[len(jobs) :])
        tell("the committed rig once more, to be drawn", 0.4)
        reference = excitation(rig)
        _, self.fit = compare_models(rig, self.seeds[0], trials(rig, lambda _: reference))
        yield from compared_rows(rig, self.comparisons, self.printed)
        yield from factor_rows(self.by_factor, self.printed)
        yield from recomputed_rows(self.printed)
        yield from statistics_rows(self.printed)
        people, cards = self.people or elbow_participants(rig), identify_cards(rig)
        self.transparency = compare_laws(
            people, cards, seeds=self.studies, threads=self.workers or os.cpu_count() or 1,
            on_progress=lambda text, share: tell(text, 0.42 + 0.36 * share),
        )  # fmt: skip
        yield from transparency_rows(self.transparency, self.printed)
        if self.predicted:
            yield from self._predicted(self.predicted, people, tell)
        tell("laws on robots they were not chosen on", 0.85)
        yield from comparison_rows(compare_controllers(drawn, workers=self.workers))
        if self.joints:
            tell("four joints", 0.9)
            self.chapter = arm_chapter(self.joints, workers=self.workers)
            yield from arm_rows(self.chapter)
        tell("laws among nonsense", 0.95)
        yield from safety_rows(_all_laws(people, cards, self.transparency.exponents), cycles=self.fuzzed)

    def _predicted(self, drawn: PredictionSize, people: PointingRig, tell: Progress) -> list[Reproduced]:
        rigs = drawn.rigs or models_of_people(people.robot)
        self.scored = predict_paper(
            rigs, self.printed, people=drawn.people, robots=drawn.robots, movements=drawn.movements,
            workers=self.workers, on_progress=lambda text, share: tell(text, 0.78 + 0.04 * share),
        )  # fmt: skip
        if is_salib_installed():
            self.screened = screen_factors(
                rigs[0], trajectories=drawn.trajectories, movements=drawn.movements, workers=self.workers,
                on_progress=lambda text, share: tell(text, 0.82 + 0.03 * share),
            )  # fmt: skip
        return predicted_rows(self.scored, self.screened)

    def claims(self, figures: Figures) -> tuple[AnswerPart, ...]:
        """Return whether dissociated directions predict better, and whether movements last longer under each law."""
        ratio = figures["able.table1.ratio"]
        holds = ratio.lower is not None and ratio.lower > 1.0
        made = [
            AnswerPart(
                "a set of parameters for each direction predicts better than one set", "yes" if holds else "no",
                f"the error is divided by {ratio.ours:.2f} ({ratio.lower:.2f} to {ratio.upper:.2f}), in print by "
                f"{ratio.published:g}",
            )
        ]  # fmt: skip
        for law in LAWS:
            row = figures[f"transparency.duration_median.{law.lower()}"]
            same = row.ours * row.published > 0.0
            text = f"the median duration changes by {row.ours:+.0f} %, the mean in print by {row.published:+.0f} %"
            longer = "longer" if row.published > 0.0 else "shorter"
            made.append(AnswerPart(f"movements last {longer} under {law}", "yes" if same else "no", text))
        return tuple(made)

    def headline(self, figures: Figures) -> str:
        """Return the gain by dissociation and by one coherent body, and the effect of the laws on people."""
        ratio, load = figures["able.table1.ratio"], figures["able.load.ratio"]
        changes_text = ", ".join(
            f"{law} {figures.ours(f'transparency.duration_median.{law.lower()}'):+.0f} % in the median "
            f"({figures.ours(f'transparency.unsettled.{law.lower()}'):.0f} % never settled; "
            f"the paper {figures[f'transparency.duration_median.{law.lower()}'].published:+.0f} % in the mean)"
            for law in LAWS
        )
        best, sensed = (figures.ours(f"transparency.torque.best_over_fc{tail}") for tail in ("", ".force_sensor"))
        return (
            f"On a virtual elbow whose friction depends on load, speed and direction, dissociating the directions "
            f"divides the error by {ratio.ours:.2f} ({ratio.lower:.2f} to {ratio.upper:.2f} over {len(self.seeds)} "
            f"seeds) on trials never fitted; the paper found {ratio.published:g} on its own robot. One coherent body "
            f"with friction that follows the load errs by {100.0 * abs(1.0 / load.ours - 1.0):.1f} % "
            f"{'more' if load.ours < 1.0 else 'less'} with 10 parameters instead of 16, and its gravity and inertia "
            f"are the rig's own. Virtual people's movements last longer under the paper's laws: {changes_text}. Of the "
            f"interaction torque under FC, the toolkit's own law leaves {best:.2f} with dither of the motor against "
            f"sticking, and {sensed:.2f} with a force sensor, on robots that it was not chosen on."
        )

    def tiles(self, figures: Figures) -> tuple[Tile, ...]:
        """Return tiles on the ratio, torque and gravity errors, and interaction torque."""
        ours, torque = figures.ours, "transparency.torque"
        return (
            Tile("Error ratio, never fitted", f"{ours('able.table1.ratio'):.2f}", "",
                 f"the paper: {figures['able.table1.ratio'].published:g}"),
            Tile("Torque error, load model", f"{1e3 * ours('able.load.torque_error'):.1f}", "mN·m",
                 "mean, trials never fitted"),
            Tile("Gravity error, load model", f"{100.0 * ours('able.load.gravity_error'):.2f}", "%",
                 f"{100.0 * ours('able.consistent.gravity_error'):.2f} % without load friction"),
            Tile("Torque over FC's, force sensor", f"{ours(f'{torque}.best_over_fc.force_sensor'):.2f}", "",
                 f"{ours(f'{torque}.best_over_fc'):.2f} by dither, "
                 f"{ours(f'{torque}.transparent_over_fc'):.2f} without either"),
        )  # fmt: skip

    def sections(self, figures: Figures) -> tuple[Section, ...]:
        """Return the sections on the identification, then on the laws, then on four joints."""
        first = identification_sections(self.rig, self.comparisons, self.by_factor, self.fit, figures)
        arm = () if self.chapter is None else arm_sections(self.chapter)
        predicted = () if self.scored is None else predicted_sections(self.scored, self.screened, figures)
        return (*first, *transparency_sections(self.transparency, figures), *predicted, *arm)

    def closing(self, figures: Figures) -> tuple[Section, ...]:
        """Return the last sections, with a sentence on Table II's file and a table of the methods."""
        recomputed, every = super().closing(figures)
        table2_text = (
            "Table II is in this page's folder as table2-as-published.json; its numbers contradict each other."
        )
        methods = Table(("Method", "What it is"), tuple(Row((k, v)) for k, v in SLIDER_METHODS.items()))
        return replace(recomputed, paragraphs=(table2_text,)), replace(every, tables=(methods, *every.tables))

    def footer(self) -> str:
        """Return the numbers of rigs and seeds, and the filter."""
        return f"{self.rigs + 1} rigs, {len(self.seeds)} seeds each; {self.fit.filter_note}."

    def write_more(self, out: Path) -> None:
        """Write Table II as a card."""
        write_published_card(out / "table2-as-published.json", published_elbow())


def _all_laws(people: PointingRig, cards: Cards, exponents: tuple[float, float]) -> dict[str, ControlLaw]:
    one = draw_people(people, np.random.default_rng(0), count=1)[0]
    place = one.slider(people)
    return {
        name: controller_builder(cards, name, exponents=exponents)(one, place)
        for name, controller in ELBOW_CONTROLLERS.items()
        if not controller.assists
    }


def _with_load(rig: ElbowRig, factor: float) -> ElbowRig:
    t = rig["transmission"]
    values = {f"transmission.{n}": factor * t[n] for n in ("load_motoring", "load_generating")}
    return rig.changed(values, f"load-{100.0 * factor:.0f}-percent")
