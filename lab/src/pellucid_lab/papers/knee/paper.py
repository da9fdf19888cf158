"""The thesis's Tables 3.1 to 3.5 and Figs. 3.1 to 3.7 on the virtual orthosis, with printed values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from pellucid._processes import Job, finished_results
from pellucid.study.answer import AnswerPart
from pellucid.study.pages.page import Section, Tile
from pellucid.study.pages.quantities import number
from pellucid.study.procedures.findings import MIN_EXPLAINED_PERCENT

from ...knee.rig import KneeRig, knee_orthosis
from ..figure import Figures, Reproduced
from ..paper import Paper, Progress
from .recomputed import recomputed
from .residual import REPRODUCED_WEARERS, ControllerRow, evaluate_wearer
from .residual_rows import residual_rows, residual_section
from .rows import coupling_rows, limbs_rows, orthosis_rows, torques_rows
from .sections import thesis_sections
from .torque import (
    ESTIMATOR_NAMES,
    PUBLISHED_ESTIMATOR_NAMES,
    STEP_PROTOCOLS,
    ScoredMap,
    TorqueSteps,
    published_steps,
    score_map,
    torque_steps,
)
from .walking import WALKING_WEARERS, WalkedRow, evaluate_walker, walking_rows, walking_section
from .wearers import (
    Bench,
    WearerErrors,
    WearerIdentification,
    drawn_from,
    identify_bench,
    identify_straps,
    identify_subject,
)


@dataclass(eq=False)
class KneePaper(Paper):
    """The reproduction with six seeds of all noise; EMG maps and controllers use the first alone."""

    title: ClassVar = "A knee orthosis and its wearer: reproduced"
    kicker: ClassVar = "Reproduction of a thesis"
    over: ClassVar = "Range or interval"
    answer_figure: ClassVar = "fig-3-5"
    # Comparisons with the rig's own constants, and arithmetic, count as simulated.
    splits: ClassVar = {
        "heldout": (".heldout",),
        "fitted": (".fitted", "knee.tf.fit.published_form", "knee.emg.target"),
        "simulated": (
            ".recomputed.", "knee.mgl_", ".inertia", ".damping", ".stiffness", ".coverage.", "knee.imu.", ".gravity",
            "_margin.", ".walking.",
        ),
    }  # fmt: skip
    main: ClassVar = (
        "knee.mgl_e.error", "knee.mgl_sh.error", "knee.orthosis.inertia.error", "knee.tf.fit", "knee.emg.rmse.",
        "knee.coupled.fit", "knee.residual.",
    )  # fmt: skip

    seeds: Sequence[int] = tuple(range(1, 7))
    estimators: Sequence[str] = (*ESTIMATOR_NAMES, *PUBLISHED_ESTIMATOR_NAMES)  # Estimators of the torque maps
    # Wearers on whom controllers are tried: the rig's own, or drawn ones D<seed>
    compared: Sequence[str] = REPRODUCED_WEARERS
    walking: Sequence[str] = WALKING_WEARERS  # Wearers who walk under laws that were built sitting; empty: nobody
    workers: int | None = None  # Processes; as many as there are processors if None

    rig: KneeRig = field(init=False)
    bench: Bench = field(init=False)
    wearers: dict[str, WearerIdentification] = field(init=False, default_factory=dict)  # Wearers, by name
    # Torque steps by subject and protocol
    steps: dict[tuple[str, str], TorqueSteps] = field(init=False, default_factory=dict)
    maps: list[ScoredMap] = field(init=False, default_factory=list)
    drawn: list[WearerErrors] = field(init=False, default_factory=list)  # Subjects of all seeds
    controllers: list[ControllerRow] = field(init=False, default_factory=list)  # Comparison by wearer and swing
    walked: list[WalkedRow] = field(init=False, default_factory=list)  # Laws worn while walking, by wearer

    def figures(self, tell: Progress) -> Iterator[Reproduced]:
        """Yield figures of orthosis, limbs, torque from EMG, strap and compensator, then those from print alone."""
        self.rig = knee_orthosis()
        tell("the orthosis alone", 0.0)
        self.bench = identify_bench(self.rig, self.seeds[0])
        self._compute(tell)
        yield from orthosis_rows(self.bench, self.printed)
        yield from limbs_rows(self.rig, self.wearers, self.drawn, self.printed)
        yield from torques_rows(self.steps, self.maps, self.printed)
        yield from coupling_rows(self.wearers, self.drawn, self.printed)
        yield from residual_rows(self.controllers)
        yield from walking_rows(self.walked)
        yield from recomputed(self.printed)

    def _compute(self, tell: Progress) -> None:
        """One subject, one seed or one map at a time, in the order of subjects, seeds and estimators in the end."""
        names = tuple(self.rig.subjects)
        # The defaults of the thesis's tool are compared on the thesis's protocol alone.
        maps = [
            (p, e)
            for p in STEP_PROTOCOLS
            for e in self.estimators
            if p == "published" or e not in PUBLISHED_ESTIMATOR_NAMES
        ]
        total = len(names) * (1 + len(maps)) + len(self.compared) + len(self.walking) + len(self.seeds) - 1
        jobs: list[Job] = [(_whole, self.rig, name, self.seeds[0], self.bench) for name in names]
        jobs += [(evaluate_wearer, self.rig, name) for name in self.compared]
        jobs += [(evaluate_walker, self.rig, name) for name in self.walking]
        jobs += [(_drawn, self.rig, seed) for seed in self.seeds[1:]]
        for count, (_, result) in enumerate(finished_results(jobs, self.workers), 1):
            tell(f"{count} of {total} parts", 0.05 + 0.9 * count / total)
            jobs += self._keep(result, maps)
        self.wearers = {n: self.wearers[n] for n in names}
        self.maps.sort(key=lambda m: (names.index(m.subject), maps.index((m.protocol, m.estimator))))
        self.controllers.sort(key=lambda c: self.compared.index(c.subject))
        self.walked.sort(key=lambda w: self.walking.index(w.subject))
        self.drawn.sort(key=lambda d: (self.seeds.index(d.seed), names.index(d.subject)))

    def _keep(self, result, maps: Sequence[tuple[str, str]]) -> list[Job]:
        """Store the result of a job, and return the jobs that it makes possible."""
        match result:
            case ScoredMap():
                self.maps.append(result)
            case (ControllerRow(), *_):
                self.controllers += result
            case (WalkedRow(), *_):
                self.walked += result
            case list():
                self.drawn += result
            case (found, steps):
                self.wearers[found.name] = found
                self.drawn.append(drawn_from(found))
                duration = self.printed["step_time"] * len(self.printed.values["torque_steps"])
                for made in (published_steps(steps, duration), steps):
                    self.steps[found.name, made.protocol] = made
                return [(score_map, self.steps[found.name, p], e) for p, e in maps]
        return []

    def is_main(self, row: str) -> bool:
        """Return whether a row is neither on a single subject nor on a single kind of IMU."""
        return super().is_main(row) and not row.endswith(tuple(self.wearers)) and "_axes" not in row

    def claims(self, figures: Figures) -> tuple[AnswerPart, ...]:
        """Return whether the thesis's equation explains the angle between orthosis and leg, in and out of sample."""
        form = figures["knee.coupled.fit.published_form"]
        fitted = figures.ours("knee.coupled.fit.published_form.fitted")
        name = "the thesis's equation explains the angle between orthosis and leg"
        claims = (
            ("in swings that were not fitted", form.ours, f"; in print {form.published:g} %"),
            ("in the swings that were fitted", fitted, ""),
        )
        return tuple(
            AnswerPart(
                f"{name}, {where}", "yes" if fit >= MIN_EXPLAINED_PERCENT else "no", f"{fit:.0f} % explained{text}"
            )
            for where, fit, text in claims
        )

    def headline(self, figures: Figures) -> str:
        """Return the share of the mismatch that the strap explains, and that of the thesis's form."""
        fit, form = figures["knee.coupled.fit"], figures["knee.coupled.fit.published_form"]
        best = figures.ours("knee.coupled.fit.published_form.true_torque.fitted")
        return (
            f"The strap between orthosis and leg, identified from one body's balance, explains {fit.ours:.1f} % of the "
            "angle between them in held-out swings. The thesis's equation, from which the strap cancels, "
            f"explains {form.ours:.0f} %, and {best:.0f} % of its own data when it is given the muscles' true "
            f"torque; printed are {form.published:g} %. All on a virtual orthosis of the thesis's kind, whose three "
            f"wearers have its subjects' weights and heights."
        )

    def tiles(self, figures: Figures) -> tuple[Tile, ...]:
        """Return tiles on gravity of both bodies, the orthosis's response, the strap, and torque from EMG."""

        def tile(name: str, what: str, unit: str, more: str = "") -> Tile:
            row = figures[f"knee.{name}"]
            thesis = "" if row.published is None else f"the thesis: {row.published:.3g}"
            return Tile(what, number(row.ours, digits=3), unit, more or thesis)

        fit = figures["knee.coupled.fit"]
        return (
            tile("mgl_e.error", "Orthosis's gravity, error", "%"),
            tile("mgl_sh.error", "Shanks' gravity, error", "%"),
            tile("tf.fit", "Response at another amplitude", "%",
                 f"two poles: {figures.ours('knee.tf.fit.published_form.heldout'):.1f}"),
            Tile("Mismatch, held out", f"{fit.ours:.1f}", "%", f"the thesis, in sample: {fit.published:g}"),
            *((tile("emg.rmse.boost", "Torque from EMG, boosting", "N·m"),)
              if "knee.emg.rmse.boost" in figures else ()),
        )  # fmt: skip

    def sections(self, figures: Figures) -> tuple[Section, ...]:
        """Return the thesis's tables and figures, then its further work."""
        residual = (residual_section(self.controllers),) if self.controllers else ()
        walking = (walking_section(self.walked),) if self.walked else ()
        return (*thesis_sections(self, figures), *residual, *walking)

    def footer(self) -> str:
        """Return the number of seeds, the rig's status, and the thesis's errata."""
        return (
            f"{len(self.seeds)} seeds of all noise; the rig was fixed before anything was identified on it. Errata B1 "
            "to B13."
        )


def _whole(rig: KneeRig, name: str, seed: int, bench: Bench) -> tuple[WearerIdentification, TorqueSteps]:
    """Return all that is computed of one subject."""
    found, taken = identify_subject(rig, name, seed)
    return found, torque_steps(rig, taken, bench.fit.orthosis, found)


def _drawn(rig: KneeRig, seed: int) -> list[WearerErrors]:
    """Identify straps and limbs of all subjects with other noise."""
    return [drawn_from(found) for found in identify_straps(rig, seed)]
