"""Sections of the reproduction's page: each step of the paper on the virtual shank exoskeleton, with printed values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import number_table
from pellucid.study.pages.moving import Traces, over_time
from pellucid.study.pages.page import Section
from pellucid.study.pages.quantities import number

from ..row_sections import bracketed
from .descent_figures import Compared, Paths, compared, paths
from .rows import ESTIMATOR_WORDS, PARAMETER_OF_LETTER, PRINTED_ROW_OF_ESTIMATOR
from .torque import BASELINE_FAMILIES, RECORDED_EMG_BASELINES
from .training import TRAINED_QUANTITIES

if TYPE_CHECKING:
    from ...seated.rig import SeatedRig
    from ..printed import PrintedPaper
    from .steps import IdentifiedBody
    from .subject_found import SubjectFound

LINE_COLOUR_ROLES = {"true": "measured", "muscles": "fitted", "electrodes alone": "heldout", "eq. 12": "good",
         "measured": "measured", "eq. 9": "fitted", "eq. 10": "fitted"}  # fmt: skip
"""Colour roles of lines, by their label."""

DRAWN_BOUNDS_S = (8.0, 20.0)
"""First and last time of a swing that are drawn."""

DRAWN_SUBJECTS = ("S2", "S4")
"""Virtual subjects that correspond to those in the paper's Fig. 9: the fastest and the slowest."""


class HillReproduction(Protocol):
    """Results of the reproduction that its page shows."""

    @property
    def printed(self) -> PrintedPaper:
        """Numbers that the paper prints."""

    rig: SeatedRig
    empty: IdentifiedBody
    subjects: dict[str, SubjectFound]


def _cell(value: float) -> str:
    return number(value, digits=3)


def _both(ours: float, printed: float | None) -> str:
    return bracketed(_cell(ours), None if printed is None else _cell(printed))


def _chosen(made: HillReproduction, wanted: Sequence[str]) -> list[str]:
    return [name for name in wanted if name in made.subjects] or list(made.subjects)[:2]


def step_sections(made: HillReproduction) -> tuple[Section, ...]:
    """Return a section for each table and figure of the paper, in its order."""
    return tuple(make(made) for make in (_people, _swings, _legs, _training, _torque, _methods))


def _people(made: HillReproduction) -> Section:
    """Return the section with the virtual subjects."""
    rows = [
        (name, str(s["age"]), f"{100 * s['height']:.0f}", f"{s['weight']:.0f}", f"{s['frequency']:.2f}")
        for name, s in made.rig["subjects"].items()
        if name in made.subjects
    ]
    return Section(
        "people",
        "Subjects",
        (
            "Eight simulated people have the paper's means and standard deviations of age, height and weight. Their "
            "muscles have elastic tendons, passive force and activation that rises fast and falls slowly. Every "
            "constant and moment arm deviates by 5 to 15 % from the anatomical model that is calibrated. EMG is raw.",
        ),
        (number_table(("", "Age", "Height (cm)", "Weight (kg)", "Swings (Hz)"), rows, wide=False),),
    )


def _swings(made: HillReproduction) -> Section:
    """Return the section on Figs. 5 and 6."""
    name = next(iter(made.subjects))
    bodies = {"exoskeleton alone": made.empty, f"with the leg of {name}": made.subjects[name].leg.body}
    panels = [
        Paths(
            head,
            "dashed: closed form",
            {"p (kg·m²)": body.falling.values[:, 0], "q (kg·m)": body.falling.values[:, 1]},
            "p, q",
            {"p (kg·m²)": body.published.inertia.value, "q (kg·m)": body.published.weight_moment.value},
        )
        for head, body in bodies.items()
    ]
    traces = []
    for (head, body), equation in zip(bodies.items(), ("eq. 9", "eq. 10"), strict=True):
        shown = (body.swing.time >= 10.0) & (body.swing.time < 40.0)
        found = body.published.torque(body.swing)
        rest = f"residual {body.published.residual_rms:.2f} N·m"
        lines = {"measured": body.swing.torque[shown], equation: found[shown]}
        traces.append(Traces(head, rest, body.swing.time[shown], lines, "Torque (N·m)"))
    return Section(
        "swings",
        "Steps 1 and 2: Figs. 5 and 6",
        (
            "Both steps are linear in p and q: Adam with a rate that falls ends where the closed form is at once. What "
            "eqs. 9 and 10 leave is friction, which they do not have.",
        ),
        drawings=(
            draw(paths, panels, "convergence", caption="Adam on the paper's swing, eqs. 9 and 10."),
            draw(
                over_time,
                traces,
                "swing_torque",
                roles=LINE_COLOUR_ROLES,
                caption="The motor's torque over the paper's swing.",
            ),
        ),
    )


def _legs(made: HillReproduction) -> Section:
    """Return the section on Table 2 and its contradictions."""
    printed = made.printed.tables["swings"]
    more = [
        100.0 * (s.leg.weight_moment["rich"].value / s.leg.true_weight_moment - 1.0) for s in made.subjects.values()
    ]
    empty = (
        _both(made.empty.published[PARAMETER_OF_LETTER[n]].value, printed["empty"][n].value)
        for n in PARAMETER_OF_LETTER
    )
    rows = [("Empty", *empty, "", "", "", "")]
    for name, found in made.subjects.items():
        leg, key = found.leg, f"subject_{name[1:]}"
        shown = {n: printed[key][n].value if key in printed.rows else None for n in ("p", "q")}
        rows.append(
            (
                name,
                *(_both(leg.body.published[PARAMETER_OF_LETTER[n]].value, value) for n, value in shown.items()),
                *(
                    f"{leg.inertia[s].value:.3f} ± {1.96 * leg.inertia[s].standard_error:.3f}"
                    for s in ("two_sines", "rich")
                ),
                f"{leg.true_inertia:.3f}",
                f"{leg.weight_moment['rich'].value:.3f}, {leg.restoring_moment:.3f}, {leg.true_weight_moment:.3f}",
            )
        )
    heads = ("", "p' eq. 10", "q' eq. 10", "p' − p, paper's swing", "p' − p, richer swing", "p' − p, true",
             "q' − q: found, restoring, weight")  # fmt: skip
    return Section(
        "legs",
        "Table 2: the leg's inertia and weight",
        (
            "Angular brackets contain printed values. In the paper's swing, the torque of inertia is small compared "
            "with that of gravity and opposite to it, so that p' − p has wide intervals. The corrected equation and a "
            "swing designed for it identify p' − p within a few percent.",
            "q' − q is the relaxed leg's whole restoring torque: its weight, and its muscles' passive force, which no "
            "swing of this range tells from weight. On these subjects it is "
            f"{min(more):.0f} to {max(more):.0f} % more than weight alone; the printed values exceed what shanks "
            "weigh by 20 to 54 %.",
        ),
        (number_table(heads, rows),),
    )


def _training(made: HillReproduction) -> Section:
    """Return the section on Table 3 and Figs. 7 and 11."""
    panels = []
    for name in list(made.subjects)[:4]:
        t = made.subjects[name].training
        lines = {}
        for quantity, letter in TRAINED_QUANTITIES.items():
            columns = [i for i, n in enumerate(t.names) if n.split(".")[0] == quantity]
            lines[letter] = t.whole.values[:, columns[0]]
        panels.append(Paths(name, "of one muscle", lines, "Deviations from anatomy"))
    name = next(iter(made.subjects))
    t = made.subjects[name].training
    at = int(np.argmax(t.fixed.spread()))
    letter = TRAINED_QUANTITIES[t.names[at].split(".")[0]]
    rates = [
        Paths(
            letter,
            "fixed and falling rate",
            {"fixed": t.fixed.values[:, at], "falling": t.falling.values[:, at]},
            "Deviations from anatomy",
        ),
        Paths(
            "Cost",
            "on 2 s at a time",
            {"fixed": _smooth(t.fixed.costs), "falling": _smooth(t.falling.costs)},
            "Mean square error",
            logarithmic=True,
        ),
    ]
    order = sorted(TRAINED_QUANTITIES, key=lambda q: np.mean([s.training.converged[q] for s in made.subjects.values()]))
    letters = ", ".join(TRAINED_QUANTITIES[q] for q in order)
    stopped = " and ".join(TRAINED_QUANTITIES[q] for q in order if _stopped(made, q) > 0.5)
    rows = [
        (n, *(_cell(s.training.values[q]) for q in TRAINED_QUANTITIES), _cell(s.training.spread_ratio),
         *(_cell(s.training.evaluations(w)) for w in ("adam", "swarm")), str(s.training.least_squares))
        for n, s in made.subjects.items()
    ]  # fmt: skip
    spent = np.mean([s.training.least_squares for s in made.subjects.values()])
    heads = ("", *TRAINED_QUANTITIES.values(), "Fixed over falling", "Adam", "Swarm", "Least squares")
    return Section(
        "training",
        "Table 3, Figs. 7 and 11: ways down",
        (
            f"Parameters settle in the order {letters}; the paper has k_r, A, λ, k_s, k_v. "
            + (f"Most of {stopped} stop at a bound of what muscles can be. " if stopped else "")
            + "With a fixed rate they go on wandering when each gradient rests on a part of the data; a rate that "
            f"falls ends that. Bounded least squares with exact derivatives takes {spent:.0f} evaluations in the mean, "
            "three starts included.",
        ),
        (
            number_table(
                heads,
                rows,
                "Means over muscles; evaluations to within 5 % of the lowest cost, – where never.",
            ),
        ),
        (
            draw(paths, panels, "parameters", caption="Parameters of four subjects, Adam with a falling rate."),
            draw(paths, rates, "rates", caption=f"Fixed rate against falling rate, {name}, gradients of 2 s of data."),
        ),
    )


def _stopped(made: HillReproduction, quantity: str) -> float:
    """Return the share of a quantity's parameters, over subjects and muscles, that end on a bound."""
    still = [
        spread < 1e-9
        for s in made.subjects.values()
        for name, spread in zip(s.training.names, s.training.whole.spread(), strict=True)
        if name.split(".")[0] == quantity
    ]
    return float(np.mean(still))


def _smooth(costs: np.ndarray, size: int = 25) -> np.ndarray:
    return np.convolve(costs, np.ones(size) / size, mode="valid")


def _torque(made: HillReproduction) -> Section:
    """Return the section on Table 4 and Figs. 8 and 9."""
    printed = made.printed.tables["errors"]
    rows = []
    for name, found in made.subjects.items():
        f, key = found.torque, f"subject_{name[1:]}"
        full, cut = f.errors("hill"), f.errors("hill", truncated=True)
        paper = f.errors("hill.eq12", "eq12", truncated=True)
        shown = {m: printed[key][m].value if key in printed.rows else None for m in ("rmse", "maxe", "mae")}
        rows.append(
            (name, *(_cell(getattr(full, m)) for m in shown), *(_cell(getattr(cut, m)) for m in shown),
             *(_both(getattr(paper, m), shown[m]) for m in shown))
        )  # fmt: skip
    measures = ("RMSE", "largest", "mean")
    heads = (
        "",
        *(f"{m}" for m in measures),
        *(f"{m}, cut" for m in measures),
        *(f"{m}, eq. 12 ⟨real people⟩" for m in measures),
    )
    traces = []
    for name in _chosen(made, DRAWN_SUBJECTS):
        f = made.subjects[name].torque
        shown = (f.time >= DRAWN_BOUNDS_S[0]) & (f.time < DRAWN_BOUNDS_S[1])
        lines = {"true": f.active, "muscles": f.predicted["hill"], "electrodes alone": f.predicted["hill.recorded"]}
        rest = f"RMSE {f.errors('hill').rmse:.2f} N·m"
        traces.append(Traces(name, rest, f.time[shown], {n: x[shown] for n, x in lines.items()}, "Torque (N·m)"))
    return Section(
        "torque",
        "Step 3: Table 4, Figs. 8 and 9",
        (
            "Calibrated on one recording, scored on another. First against the true torque that the muscles pull "
            "beyond what they pull relaxed, full and with both torques cut off at 0; then as the paper has it: "
            "calibrated on its eq. 12 and scored on it, cut off at 0, with what it prints in angular brackets.",
            "Nobody records the flexors. As in hybrid models elsewhere, they are excited wherever the balance of leg "
            "and exoskeleton asks for bending; extension is the electrodes' alone.",
        ),
        (number_table(heads, rows, "Errors of the torque of the held-out recording (N·m)."),),
        (
            draw(
                over_time,
                traces,
                "torque",
                roles=LINE_COLOUR_ROLES,
                caption="Held-out torque of the fastest and the slowest swing.",
            ),
        ),
    )


def _methods(made: HillReproduction) -> Section:
    """Return the section on Table 5 and Fig. 10."""
    table = made.printed.tables["methods"]

    def row(estimator: str, label: str, strong: bool = False) -> Compared:
        errors = [s.torque.errors(estimator, truncated=True).rmse for s in made.subjects.values()]
        key = PRINTED_ROW_OF_ESTIMATOR.get(estimator)
        return Compared(label, errors, table[key]["rmse"].value if key in table.rows else None, strong)

    rows = [row("hill", ESTIMATOR_WORDS["hill"], True), row("hill.adaptive", ESTIMATOR_WORDS["hill.adaptive"])]
    rows += [row(name, ESTIMATOR_WORDS[name]) for name in BASELINE_FAMILIES]
    alone, both = (np.mean([s.torque.errors(n).rmse for s in made.subjects.values()]) for n in ("motion", "ridge"))
    rows.append(row("hill.recorded", ESTIMATOR_WORDS["hill.recorded"], True))
    rows += [row(f"{name}.recorded", f"{ESTIMATOR_WORDS[name]}, recorded muscles") for name in RECORDED_EMG_BASELINES]
    return Section(
        "methods",
        "Table 5 and Fig. 10: other methods",
        (
            "All methods are fitted on the same swing and evaluated on the same other one. The reference is computed "
            "from motion, so that a method with acceleration as input can reproduce it without EMG. Relative to the "
            f"true torque, the error of ridge regression is {alone:.2f} N·m from motion alone and {both:.2f} N·m with "
            "EMG. If the robot measures motion, the torque balance is the better estimator of the present torque. EMG "
            "predicts future torque, and estimates muscle torque where no balance can be measured.",
        ),
        drawings=(
            draw(compared, rows, "methods", text="RMSE against the true torque, both cut off at 0 (N·m)",
                 caption="A dot per subject, a bar at their mean; open marks: Table 5's, of other people and tasks."),
        ),
    )  # fmt: skip
