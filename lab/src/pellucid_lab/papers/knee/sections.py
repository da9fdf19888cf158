"""Sections of the reproduction's page: each table and figure of the thesis on the virtual orthosis, with printed
values.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from pellucid.emg.study.emg_torque import calibration_page as calibration_figures
from pellucid.models.estimates import Parameter
from pellucid.study.drawing.drawing import Drawing, draw
from pellucid.study.pages.forest import Row, number_table
from pellucid.study.pages.moving import Traces, over_time
from pellucid.study.pages.page import Section
from pellucid.study.pages.quantities import MINUS_SIGN, number, unit_text

from ..figure import Reproduced
from ..printed import Printed
from ..row_sections import bracketed, cell
from .knee_figures import HoldTorques, StrapIntervals, hold_torques, strap_intervals
from .recomputed import SUBJECT_KEYS
from .torque import ESTIMATOR_NAMES

if TYPE_CHECKING:
    from ...knee.rig import KneeRig
    from ..printed import PrintedPaper
    from .torque import ScoredMap, TorqueSteps
    from .wearers import Bench, WearerErrors, WearerIdentification

LINE_COLOUR_ROLES = {
    "true": "measured",
    "measured": "measured",
    "knee": "measured",
    "strap": "fitted",
    "map": "fitted",
    "pendulum": "fitted",
    "boosting": "fitted",
    "two poles": "heldout",
    "thesis's form": "heldout",
    "orthosis": "heldout",
}
"""Colour roles of lines, by their label."""

ESTIMATOR_WORDS = {"boost": "boosting", "bagging": "bagging", "tree": "one tree", "ridge": "ridge"}
"""Names of the estimators on the page."""

DRAWN_SPAN_S = 12.0
"""Duration of the part of a swing that figures show."""

PRINTED_NOTE = "Angular brackets contain the thesis's values."
"""Sentence in captions of tables with the thesis's numbers."""


class KneeReproduction(Protocol):
    """Results of the reproduction that its page shows."""

    @property
    def printed(self) -> PrintedPaper:
        """Numbers that the thesis prints."""

    rig: KneeRig
    bench: Bench
    wearers: dict[str, WearerIdentification]
    steps: dict[tuple[str, str], TorqueSteps]
    maps: list[ScoredMap]
    drawn: list[WearerErrors]


def _both(ours: str, printed: Printed | None) -> str:
    return bracketed(ours, None if printed is None else cell(printed.value))


def _with_interval(parameter: Parameter) -> str:
    low, high = parameter.interval()
    return f"{number(parameter.value, 0.5 * (high - low))} ± {number(0.5 * (high - low), digits=2)}"


def thesis_sections(made: KneeReproduction, rows: dict[str, Reproduced]) -> tuple[Section, ...]:
    """Return a section for each table and figure of the thesis, in its order."""
    alone = (_subjects(made), _orthosis(made), _shanks(made))
    return (*alone, _torque(made, rows), _strap(made, rows), _straps_over_seeds(made, rows))


def _subjects(made: KneeReproduction) -> Section:
    """Return the section on Table 3.1."""
    table = made.printed.tables["subjects"]
    columns = ("age", "mass", "height", "shank_length")
    rows = [(table.labels[s], *(cell(table[s][n].value) for n in columns)) for s in SUBJECT_KEYS]
    return Section(
        "subjects",
        "Table 3.1: subjects",
        (
            "The virtual subjects have these ages, weights, heights and lengths; their limbs, muscles and straps are "
            "not the thesis's, which it does not print.",
        ),
        (number_table(("", "Age", "Weight (kg)", "Height (m)", "Knee to heel (m)"), rows, wide=False),),
    )


def _orthosis(made: KneeReproduction) -> Section:
    """Return the section on Figs. 3.1 and 3.2 and Table 3.2."""
    bench, table = made.bench, made.printed.tables["orthosis"]
    found = {p.name: p for p in bench.fit.parameters} | {"stiffness": bench.fit.linear["stiffness"]}
    truth = {"gravity": bench.gravity, "inertia": bench.inertia, "damping": made.rig["orthosis"]["bearing_viscous"]}
    names = {"gravity": "m g l", "inertia": "Inertia", "damping": "Viscous damping", "stiffness": "Spring"}
    rows = [
        (
            words,
            unit_text(found[n].unit),
            cell(table["theoretical"][n].value if n in table["theoretical"] else None),
            cell(table["experimental"][n].value),
            _with_interval(found[n]),
            cell(truth.get(n, 0.0)),
        )
        for n, words in names.items()
    ]
    offset = bench.fit.gravity.offset.value
    short = 100.0 * abs(bench.as_published["line"] / bench.gravity - 1.0)
    holds = draw(
        hold_torques,
        [HoldTorques("Orthosis alone", bench.angle, bench.torque, *_sine(_hanging(made)), offset)],
        "fig-3-1",
        caption="Fig. 3.1: torque that holds the orthosis at each angle, the sine of its weight, and the thesis's line "
        f"of best fit, whose slope is {short:.0f} % short of m g l.",
    )
    return Section(
        "orthosis",
        "Figs. 3.1 and 3.2, Table 3.2: the orthosis alone",
        (
            "Gravity from holds, then inertia and friction from sines of 1 rad at 0.3, 0.5, 0.7 and 1 Hz. Two poles "
            "without zeros must take the weight for a spring, right at one amplitude only: at 0.6 rad, which neither "
            f"model has seen, they explain {bench.fit.mean_fit(linear=True):.1f} %, a pendulum with friction "
            f"{bench.fit.mean_fit():.1f} %.",
        ),
        (
            number_table(
                (
                    "",
                    "Unit",
                    "Thesis (real), theoretical",
                    "Thesis (real), found",
                    "Ours (virtual), 95 %",
                    "Ours (virtual), truth",
                ),
                rows,
                "Table 3.2. The virtual orthosis is not the thesis's: its truth is its own. The spring is that of the "
                "two poles; there is none.",
                words=2,
            ),
        ),
        (holds, _response(made)),
    )


def _hanging(made: KneeReproduction) -> tuple[float, float]:
    """Return m g l [N m] and angle of rest [rad] of the orthosis."""
    fit = made.bench.fit.gravity
    return fit.gravity.value, 0.0 if fit.zero is None else fit.zero.value


def _sine(*bodies: tuple[float, float]) -> tuple[float, float]:
    """Return m g l [N m] and angle of rest [rad] of bodies that hang together, from the two of each."""
    whole = sum(gravity * np.exp(1j * zero) for gravity, zero in bodies)
    return float(abs(whole)), float(np.angle(whole))


def _response(made: KneeReproduction) -> Drawing:
    fit, brief = made.bench.fit, made.bench.brief
    first = next(r for r in brief.responses if r.recording.endswith("07"))
    name = next(n for n in fit.checks if n.endswith("07"))
    check, linear = fit.checks[name], fit.linear_checks[name]
    part = check.time <= check.time[0] + DRAWN_SPAN_S
    panels = [
        Traces(
            "1 rad, fitted", f"two poles {first.fit:.1f} %; the thesis {made.printed['response_fit']:g} %", first.time,
            {"measured": np.degrees(first.measured), "two poles": np.degrees(first.simulated)}, "Angle (deg)",
        ),
        Traces(
            "0.6 rad, held out", f"pendulum {check.fit:.1f} %, two poles {linear.fit:.1f} %", check.time[part],
            {
                "measured": np.degrees(check.measured[part]),
                "pendulum": np.degrees(check.simulated[part]),
                "two poles": np.degrees(linear.simulated[part]),
            },
            "Angle (deg)",
        ),
    ]  # fmt: skip
    return draw(
        over_time, panels, "fig-3-2", roles=LINE_COLOUR_ROLES,
        caption="Fig. 3.2: the orthosis's angle at 0.7 Hz, measured, and simulated from the spring's torque.",
    )  # fmt: skip


def _shanks(made: KneeReproduction) -> Section:
    """Return the section on Fig. 3.3 and Table 3.3."""
    shank = made.printed.tables["shank"]
    panels, cells = [], []
    for (name, found), subject in zip(made.wearers.items(), SUBJECT_KEYS, strict=True):
        limb = found.stages.limb
        together = _sine(_hanging(made), (limb.gravity.value, limb.zero.value))
        panels.append(
            HoldTorques(f"{name}, orthosis on", *found.holds_of_leg, *together, made.bench.fit.gravity.offset.value)
        )
        printed = shank[subject]
        segments = limb.segments
        cells.append(
            (
                name,
                _both(cell(segments["published"].mass), printed["mass"]),
                _both(cell(segments["published"].centre), printed["centre"]),
                _both(cell(segments["published"].inertia), printed["inertia"]),
                _both(cell(segments["published"].gravity()), printed["gravity"]),
                cell(segments["winter"].gravity()),
                _both(_with_interval(limb.gravity), printed["gravity_found"]),
                cell(found.subject.gravity),
            )
        )
    drawing = draw(
        hold_torques, panels, "fig-3-3",
        caption="Fig. 3.3: torque that holds orthosis and relaxed leg on a rigid plate, three trials each. The shank's "
        "m g l is the sine's less the orthosis's.",
    )  # fmt: skip
    return Section(
        "shanks",
        "Fig. 3.3, Table 3.3: the shanks",
        (
            "The leg is held relaxed, which its EMG must show. Tables of shares are guesses: on the virtual subjects "
            "they miss the truth as the thesis's may have missed its subjects'.",
        ),
        (
            number_table(
                ("", "Mass (kg)", "Centre (m)", "Inertia (kg·m²)", "m g l, heel (N·m)", "m g l, ankle (N·m)",
                 "m g l found, 95 % (N·m)", "Truth (N·m)"),
                cells,
                f"Table 3.3, Winter's shares on the length from knee to heel as in the thesis. {PRINTED_NOTE} Found "
                "and true are the virtual subjects' own.",
            ),
        ),
        (drawing,),
    )  # fmt: skip


def _torque(made: KneeReproduction, rows: dict[str, Reproduced]) -> Section:
    """Return the section on Fig. 3.4 and Table 3.4."""
    table, cells = made.printed.tables["regression"], []
    for estimator in dict.fromkeys(m.estimator for m in made.maps):
        mine = [m for m in made.maps if (m.estimator, m.protocol) == (estimator, "published")]
        kind = estimator.removesuffix("_published")
        both = rows.get(f"knee.emg.both_ways.rmse.{estimator}")
        cells.append(
            Row(
                (
                    ESTIMATOR_WORDS[kind] + (", defaults of the thesis's tool" if kind != estimator else ""),
                    cell(table[kind]["rmse"].value if kind in table.rows else None),
                    cell(rows[f"knee.emg.rmse.{estimator}"].ours),
                    *(cell(m.score.rmse) for m in mine),
                    cell(rows[f"knee.emg.true_rmse.{estimator}"].ours),
                    cell(None if both is None else both.ours),
                ),
                estimator in ESTIMATOR_NAMES,
            )
        )
    heads = (
        "",
        "Thesis, real people (N·m)",
        "Ours, virtual people (N·m)",
        *made.wearers,
        "Against the truth",
        "Either way",
    )
    target, plain, as_one = (rows[f"knee.emg.target{name}.rmse"] for name in ("", ".kelvin_voigt", ".as_one"))
    return Section(
        "torque",
        "Fig. 3.4, Table 3.4: torque from EMG",
        (
            "The thesis's steps of 0, 5 and 10 N·m at six angles, three repetitions, each predicted by a map that has "
            "not seen it. The target is the knee's torque by the limb's balance: against 10 N·m the strap yields by "
            f"tens of degrees, and taking orthosis and leg for one body puts the target off by {as_one.ours:.2g} N·m; "
            f"through the strap as identified it is off by {target.ours:.2g} N·m, through a spring and a damper by "
            f"{plain.ours:.2g} N·m. The last column is of steps that "
            "go on to the same torques the other way.",
        ),
        (number_table(heads, cells, "Table 3.4, RMSE in N·m."),),
        (_torque_trace(made), *_torque_errors(made)),
    )


def _torque_errors(made: KneeReproduction) -> tuple[Drawing, ...]:
    errors = [
        (m.subject, m.estimator, ESTIMATOR_WORDS[m.estimator], m.score.rmse)
        for m in made.maps
        if m.estimator in ESTIMATOR_WORDS and m.protocol == "published"
    ]
    if not errors:
        return ()
    return (
        draw(
            calibration_figures.error_by_estimator, errors, "torque-errors", heads=list(made.wearers), chosen={},
            bare="motion", caption="Torque error on held-out repetitions, by subject.",
        ),
    )  # fmt: skip


def _torque_trace(made: KneeReproduction) -> Drawing:
    """Draw the torque in the longer steps, which begin with the thesis's."""
    mine = [m for m in made.maps if m.protocol == "both_ways"]
    chosen = next((m for m in mine if m.estimator == "boost"), mine[0])
    steps = made.steps[chosen.subject, "both_ways"]
    trial = next(t for t in steps.trials if "_15_" in t.name)
    label = "boosting" if chosen.estimator == "boost" else "map"
    lines = {
        "knee": steps.true[trial.name],
        label: chosen.predicted[trial.name],
        "orthosis": steps.actuator[trial.name],
    }
    panel = Traces(f"{chosen.subject}, 15°", f"RMSE {chosen.score.rmse:.2f} N·m", trial.time, lines, "Torque (N·m)")
    return draw(
        over_time, [panel], "fig-3-4", roles=LINE_COLOUR_ROLES, height=3.4,
        caption="Fig. 3.4: the knee's true torque, the map's estimate from EMG and angle in a held-out repetition, and "
        "the orthosis's torque that the subject counteracts. First the thesis's steps, then the opposite direction.",
    )  # fmt: skip


def _strap(made: KneeReproduction, rows: dict[str, Reproduced]) -> Section:
    """Return the section on Figs. 3.5 to 3.7 and Table 3.5."""
    table, drawings, cells = made.printed.tables["coupling"], [], []
    for number_, ((name, found), subject) in enumerate(zip(made.wearers.items(), SUBJECT_KEYS, strict=True), 5):
        printed, coupling = table[subject], found.stages.coupling
        swing = next(s for s in found.swings if s.split == "heldout")
        part = (swing.time >= 2.0) & (swing.time <= 2.0 + DRAWN_SPAN_S)
        lines = {"true": swing.true, "strap": swing.predicted, "thesis's form": swing.published}
        shown = {k: np.degrees(v[part]) for k, v in lines.items() if v is not None}
        head = f"strap {swing.fit():.1f} %, thesis's form {swing.fit('published'):.1f} %".replace("-", MINUS_SIGN)
        drawings.append(
            draw(
                over_time,
                [Traces(f"{name}, held out", head, swing.time[part], shown, "Limb ahead (deg)")],
                f"fig-3-{number_}",
                roles=LINE_COLOUR_ROLES,
                caption=f"Fig. 3.{number_}: angle between leg and orthosis in a swing that was not fitted: the true "
                f"one, hidden under the strap's by the orthosis's balance, and that of the thesis's form. The thesis "
                f"prints {printed['fit'].value:g} % on data it fitted.",
            )
        )
        literal = coupling.published["two_poles"]
        fits = [f"{swing.fit(form):.1f}".replace("-", MINUS_SIGN) for form in ("predicted", "published")]
        names, true = ("inertia", "damping", "stiffness"), found.subject.strap
        own = (_with_interval(coupling.parameter(n)) for n in names)
        cells += [
            Row((name, "strap", *own, fits[0], cell(swing.rmse())), True),
            (name, "thesis's form", *(cell(getattr(literal, n)) for n in names), fits[1], ""),
            (name, "truth", "0", cell(true["damping"]), cell(true["stiffness"]), "", ""),
            (name, "the thesis", *(cell(printed[n].value) for n in (*names, "fit", "rmse"))),
        ]
    best = rows["knee.coupled.fit.published_form.true_torque.fitted"]
    return Section(
        "strap",
        "Figs. 3.5 to 3.7, Table 3.5: between leg and orthosis",
        (
            "In zero-impedance mode the leg swings and the orthosis follows. Its own balance gives the strap's torque, "
            "and the angle between both is that torque over stiffness and damping. The thesis writes both balances "
            "together, in which the strap's torque cancels (B1); it explains as little when it is given the muscles' "
            f"true torque, {best.ours:.1f} % of the data it is fitted to.",
        ),
        (
            number_table(
                ("", "", "Inertia (kg·m²)", "Damping (N·m·s/rad)", "Stiffness (N·m/rad)", "Fit (%)", "Error (rad)"),
                cells,
                "Table 3.5. Fits of ours are held out and against the true angle, the thesis's in sample and against "
                "its sensor. Its straps are not ours.",
                words=2,
            ),
        ),
        tuple(drawings),
        (_imu_note(rows),),
    )


def _imu_note(rows: dict[str, Reproduced]) -> str:
    def of(name: str) -> float:
        return rows[f"knee.{name}"].ours

    return (
        f"Against the angle that the IMU saw, the strap explains {of('coupled.fit.imu.nine_axes'):.1f} % with nine "
        f"axes and {of('coupled.fit.imu.six_axes'):.1f} % with six; the IMU's own error allows "
        f"{of('coupled.ceiling.true.nine_axes'):.1f} and {of('coupled.ceiling.true.six_axes'):.1f} %. The turn about "
        f"the knee's own axis does not see the heading drift: VQF errs by {of('imu.error.nine_axes'):.2f}° with nine "
        f"axes and {of('imu.error.six_axes'):.2f}° with six. The thesis's regression on the outputs of Madgwick's "
        f"filter errs by {of('imu.error.madgwick.nine_axes'):.1f}° and {of('imu.error.madgwick.six_axes'):.1f}°."
    )


def _straps_over_seeds(made: KneeReproduction, rows: dict[str, Reproduced]) -> Section:
    """Return the section on whether intervals contain the truth."""
    panels = []
    for what, unit, letter in (("stiffness", "N·m/rad", "k"), ("damping", "N·m·s/rad", "b")):
        row = []
        for name, found in made.wearers.items():
            own = [d.strap[what] for d in made.drawn if d.subject == name]
            half = np.array([0.5 * (p.interval()[1] - p.interval()[0]) for p in own])
            values = np.array([p.value for p in own])
            row.append(StrapIntervals(f"{letter}, {name}", values, half, found.subject.strap[what], unit))
        panels.append(row)
    k, b, inertia = (100.0 * rows[f"knee.coupled.coverage.{n}"].ours for n in ("k", "b", "inertia"))
    return Section(
        "coverage",
        "Do the intervals cover the true values?",
        (
            f"Over {len(made.drawn)} subjects and seeds, 95 % intervals cover the strap's stiffness in {k:.0f} %, its "
            f"damping in {b:.0f} %, and an inertia of zero in {inertia:.0f} %.",
        ),
        (),
        (
            draw(
                strap_intervals, panels, "coverage",
                caption="Stiffness and damping of each strap with 95 % intervals, for each seed of all noise; lines "
                "are the truth. An interval that misses it is orange.",
            ),
        ),
    )  # fmt: skip
