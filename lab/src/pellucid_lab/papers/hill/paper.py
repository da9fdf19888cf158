"""The paper's three steps on the virtual shank exoskeleton: Tables 2 to 5 and Figs. 5 to 11, with printed values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from pellucid.study.answer import AnswerPart
from pellucid.study.pages.page import Section, Tile
from pellucid.study.pages.quantities import number

from ...processes import ordered_results
from ...seated.protocol import SeatedTrial, seated_trials
from ...seated.rig import SeatedRig, load_seated_rig
from ...seated.subject import subjects
from ...study import record_in_memory
from ..figure import Figures, Reproduced
from ..paper import Paper, Progress
from .real_people import ranking_sentence, real_people_rows, real_people_section
from .recomputed import recomputed
from .release_orders import errors_over_all_at_once
from .rows import release_rows, step_rows, torque_rows, training_rows
from .sections import step_sections
from .steps import IdentifiedBody, find_body, find_leg
from .subject_found import SubjectFound
from .torque import find_torque
from .training import train
from .trials import active_swing, driven_swing, take_subject

MAX_INERTIA_HALF_WIDTH = 25.0
"""Largest half of the 95 % interval of a leg's inertia for which it counts as told [%]."""


@dataclass(eq=False)
class HillPaper(Paper):
    """All subjects of the virtual shank exoskeleton, with one seed of all noise."""

    title: ClassVar = "From a robot to muscles in three steps: reproduced"
    opening: ClassVar = (
        "Tables 4 and 5 are a self-test on simulated people, whose muscles are those of the fitted model: they rank no "
        "methods."
    )
    over: ClassVar = "Over subjects"
    remarks: ClassVar = True
    # p and q are compared with the rig's own constants.
    splits: ClassVar = {
        "simulated": ("hill.recomputed.", "hill.p.", "hill.q.", "hill.empty."),
        "fitted": ("hill.adam.", "hill.swarm.", "hill.order.", "hill.parameters."),
    }
    main: ClassVar = (
        "hill.real_people.", "hill.rmse.truth.", "hill.rmse.eq12.mean", "hill.p.error.rich", "hill.q.error.rich",
        "hill.adam.",
    )  # fmt: skip

    names: Sequence[str] | None = None  # Names of the subjects; all if None
    seed: int = 1  # Seed of all noise
    workers: int | None = None  # Processes; as many as there are processors if None

    rig: SeatedRig = field(init=False)
    empty: IdentifiedBody = field(init=False)
    subjects: dict[str, SubjectFound] = field(init=False)

    def figures(self, tell: Progress) -> Iterator[Reproduced]:
        """Yield figures of the exoskeleton, of everybody's leg, torque and training, then those from print alone."""
        self.rig = rig = load_seated_rig()
        chosen = tuple(rig["subjects"]) if self.names is None else tuple(self.names)
        tell("a swing that shows inertia", 0.0)
        made = seated_trials(rig, chosen)
        tell("the exoskeleton alone", 0.03)
        alone = record_in_memory(rig, [t for t in made if t.subject is None], seed=self.seed)[1]
        swings = {recording.name.removeprefix("empty_"): driven_swing(recording) for recording in alone}
        self.empty = empty = find_body(swings)
        found = ordered_results(
            [(_subject, rig, made, empty, name, self.seed) for name in chosen],
            self.workers,
            lambda done, of: tell(f"{done} of {of} subjects", 0.05 + 0.9 * done / of),
        )
        self.subjects = {one.name: one for one in found}
        people = self.subjects.items()
        yield from real_people_rows()
        yield from step_rows(empty, {n: s.leg for n, s in people}, self.printed)
        yield from torque_rows({n: s.torque for n, s in people}, self.printed)
        yield from training_rows(empty, {n: (s.leg, s.training, s.torque) for n, s in people}, self.printed)
        yield from release_rows({n: s.released for n, s in people})
        yield from recomputed(self.printed)

    def is_main(self, row: str) -> bool:
        """Return whether a row is over all subjects and with all muscles."""
        return super().is_main(row) and row.rsplit(".", 1)[-1] not in (*self.subjects, "truncated", "recorded")

    def claims(self, figures: Figures) -> tuple[AnswerPart, ...]:
        """Return whether swings tell the leg's inertia, and whether calibrated muscles tell the knee's torque."""
        torque, eq12 = (figures.ours(f"hill.rmse.{name}") for name in ("truth.mean", "reference.eq12"))
        half = figures.ours("hill.p.half_width.two_sines")
        return (
            AnswerPart(
                "muscles calibrated on one swing tell the torque of another", "yes" if torque < eq12 else "no",
                f"{torque:.2f} N·m from the true torque; the paper's reference, eq. 12, is {eq12:.2f} N·m from it",
            ),
            AnswerPart(
                "a swing of two sines tells the leg's inertia", "yes" if half <= MAX_INERTIA_HALF_WIDTH else "no",
                f"± {half:.0f} %, where ± {MAX_INERTIA_HALF_WIDTH:g} % count as told",
            ),
        )  # fmt: skip

    def headline(self, figures: Figures) -> str:
        """Return the ranking on real people, the error against the true torque, and that of the paper's reference."""

        def ours(name: str) -> float:
            return figures.ours(f"hill.{name}")

        return (
            f"{ranking_sentence()} On a virtual exoskeleton of the paper's kind, muscles calibrated on one swing tell "
            f"the knee's true torque in another one to within {ours('rmse.truth.mean'):.2f} N·m. With the electrodes' "
            f"muscles alone it is {ours('rmse.truth.recorded'):.2f} N·m, since nobody records what bends the knee. The "
            f"paper's own reference, its eq. 12, is {ours('rmse.reference.eq12'):.2f} N·m from the truth. Its swing "
            f"leaves the leg's inertia unsure to ± {ours('p.half_width.two_sines'):.0f} %; a richer one to "
            f"± {ours('p.half_width.rich'):.1f} %."
        )

    def tiles(self, figures: Figures) -> tuple[Tile, ...]:
        """Return tiles on torque, leg and training."""

        def worst(start: str) -> str:
            values = [row.ours for name, row in figures.items() if name.startswith(f"hill.{start}")]
            return number(max(values, key=abs), digits=2)

        torque, as_paper = figures.ours("hill.rmse.truth.mean"), figures.ours("hill.rmse.eq12.mean.truncated")
        return (
            Tile("Torque, held out", f"{torque:.2f}", "N·m", "RMSE against the truth"),
            Tile("Scored as in the paper", f"{as_paper:.2f}", "N·m", "it prints 1.83"),
            Tile("p' − p, worst", worst("p.error.rich."), "%", "with the richer swing"),
            Tile("q' − q, worst", worst("q.error.rich."), "%", "with the richer swing"),
            Tile("Adam's wandering", f"{figures.ours('hill.adam.spread_ratio'):.0f}", "times",
                 "fixed rate over falling"),
        )  # fmt: skip

    def sections(self, figures: Figures) -> tuple[Section, ...]:
        """Return a section for each table and figure of the paper."""
        return (real_people_section(), *step_sections(self))

    def footer(self) -> str:
        """Return the page's last line, which names the rig's status and the paper's errata."""
        return "The rig was fixed before anything was identified on it. Errata C1 to C15."


def _subject(rig: SeatedRig, made: list[SeatedTrial], empty: IdentifiedBody, name: str, seed: int) -> SubjectFound:
    taken = take_subject(rig, made, subjects(rig)[name], seed)
    leg = find_leg(empty, taken)
    torque = find_torque(empty, leg, taken)
    fitted, heldout = (
        active_swing(taken, what, leg.body.corrected["rich"], flexors=True) for what in ("swing_1", "swing_2")
    )
    released = errors_over_all_at_once(fitted, heldout)
    return SubjectFound(name, leg, torque, train(fitted.trial, torque.hill.choice.weight), released)
