"""Page of an orthosis and its wearers with its figures: results by stage, and the more reliable side of each strap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ....models.estimates import Parameter
from ....numerics.gravity_holds import GravityFit, line_of_best_fit
from ....study.drawing.drawing import Drawing, Head, dots, draw, heads, key, line, one_panel, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.forest import number_table
from ....study.pages.moving import MovingDrawing, Way, cursor, strokes
from ....study.pages.page import Page, Section, Tile
from ....study.pages.quantities import number, unit_text
from ....study.procedures.posterior_figures import posterior_figure
from ....study.procedures.study_page import figure_tables, parameter_tables, study_page
from ....study.study import Study
from ...strap.identified_strap import IdentifiedStrap
from ...strap.wearer_coupling import EvaluatedSwing
from ...transfer.fit_transfer_function import Response
from .coupling_result import CouplingResult, WearerStages, strap_beside_posterior
from .coupling_table import CouplingTable


@dataclass(frozen=True)
class PageSettings:
    """What is drawn on the page of an orthosis and its wearers."""

    max_drawn_s: float = 12.0  # length of a response or swing that is drawn [s]
    frame_count: int = 60  # number of frames of the movement
    # Magnification of the drawn angle between leg and orthosis, which is often of a few degrees.
    mismatch_magnification: float = 2.0
    hold_dot_points: float = 5.0  # diameter of the dot of a hold, in points


PAGE_SETTINGS = PageSettings()


STRAP_PARAMETERS = (("stiffness", "Stiffness"), ("damping", "Damping"), ("inertia", "Inertia"))
"""Strap parameters that are drawn, with their labels."""


def _zero_line(axis: Axes) -> None:
    axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)


def _label(axis: Axes, vertical: str, horizontal: str, entries: Sequence[tuple[str, str]]) -> None:
    """Name both axes of a single panel, and its lines in a key: words and colour's role of each."""
    tidy(axis, first=True, text=vertical)
    axis.set_xlabel(horizontal)
    key(axis, [(words, colour(role)) for words, role in entries])


def gravity_figure(fit: GravityFit) -> Drawing:
    """Draw the holding torque of the orthosis against its angle, with the fitted sine and the published line."""
    figure, axis = one_panel(3.6)
    _zero_line(axis)
    angle = np.array([h.angle for h in fit.holds])
    torque = np.array([h.torque for h in fit.holds])
    span = np.linspace(angle.min(), angle.max(), 121)
    straight = line_of_best_fit(angle, torque)
    line(axis, np.degrees(span), straight.slope * span + straight.intercept, color=colour("stribeck"), linewidth=1.2)
    line(axis, np.degrees(span), fit.torque(span), color=colour("fitted"), linewidth=1.8)
    dots(axis, np.degrees(angle), torque, colour("measured"), alpha=0.9, size=PAGE_SETTINGS.hold_dot_points)
    entries = (("holds", "measured"), ("m g l sin", "fitted"), ("line", "stribeck"))
    _label(axis, "Torque (N·m)", "Angle from hanging (deg)", entries)
    return Drawing(
        "gravity",
        figure,
        "Torque that holds the orthosis still. The largest residual is "
        f"{1e3 * float(np.abs(fit.residual).max()):.0f} mN·m for the sine and "
        f"{1e3 * straight.largest_residual:.0f} mN·m for the straight line of the published method, whose "
        f"slope is {straight.slope:.3f} N·m/rad.",
    )


def response_figure(pendulum: Response, linear: Response) -> Drawing:
    """Draw the held-out response of the orthosis to a torque: measured, by the pendulum, and by the published form."""
    figure, axis = one_panel(3.4)
    start = pendulum.time[0]
    shown = pendulum.time <= start + PAGE_SETTINGS.max_drawn_s
    for values, role, width in (
        (pendulum.measured, "measured", 2.6),
        (linear.simulated, "stribeck", 1.2),
        (pendulum.simulated, "heldout", 1.2),
    ):
        line(axis, pendulum.time[shown] - start, np.degrees(values[shown]), color=colour(role), linewidth=width)
    entries = (("measured", "measured"), ("pendulum", "heldout"), ("two poles", "stribeck"))
    reached = "diverges" if pendulum.diverges else f"{pendulum.fit:.1f} %"
    rest = f"pendulum {reached}, two poles {linear.fit:.1f} %"
    heads([axis], [Head(pendulum.recording.replace("_", " "), rest, colour("heldout"))])
    _label(axis, "Angle (deg)", "Time (s)", entries)
    return Drawing(
        "response",
        figure,
        "Response of the orthosis to a torque of another amplitude than the fitted ones: measured, simulated as a "
        "pendulum with friction, and by the published transfer function with two poles. Only initial states are "
        "estimated here.",
    )


def limbs_figure(orthosis: GravityFit, wearers: Mapping[str, WearerStages]) -> Drawing:
    """Draw the holding torque that each limb adds, against the angle."""
    figure = Figure(figsize=(FIGURE_WIDTH, 3.4), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(wearers), sharey=True))
    texts = []
    for axis, (who, stages) in zip(panels, wearers.items(), strict=True):
        limb = stages.limb
        _zero_line(axis)
        holds = [h for trial in limb.trials for h in trial]
        angle = np.array([h.angle for h in holds])
        added = np.array([h.torque for h in holds]) - orthosis.torque(angle)
        span = np.linspace(angle.min(), angle.max(), 121)
        drawn = limb.gravity.value * np.sin(span - limb.zero.value)
        line(axis, np.degrees(span), drawn, color=colour("fitted"), linewidth=1.8)
        dots(axis, np.degrees(angle), added, colour("measured"), alpha=0.8, size=PAGE_SETTINGS.hold_dot_points)
        tidy(axis, first=axis is panels[0], text="Torque (N·m)")
        axis.set_xlabel("Angle (deg)")
        size = number(limb.gravity.value, limb.gravity.standard_error)
        texts.append(Head(who, f"{size} N·m", colour("fitted")))
    heads(list(panels), texts)
    return Drawing(
        "limbs",
        figure,
        "Torque that a relaxed limb on a rigid plate adds to the orthosis's own, at every hold of every trial, and the "
        "sine through them.",
    )


def mismatch_figure(who: str, swing: EvaluatedSwing) -> MovingDrawing:
    """Draw the mismatch angle of one swing by the IMU and by the models, next to the recorded motion of the leg in its
    orthosis."""
    figure = Figure(figsize=(FIGURE_WIDTH, 3.2), layout="constrained")
    limb, axis = figure.subplots(1, 2, width_ratios=(1.0, 2.6))
    _zero_line(axis)
    middle = 0.5 * (swing.time[0] + swing.time[-1])
    shown = np.abs(swing.time - middle) <= 0.5 * PAGE_SETTINGS.max_drawn_s
    time = swing.time[shown]
    role = "heldout" if swing.split == "heldout" else "fitted"
    entries = [("IMU", "measured"), ("strap", role)]
    line(axis, time, np.degrees(swing.seen[shown]), color=colour("measured"), linewidth=2.6)
    if "published" in swing.simulated:
        line(axis, time, np.degrees(swing.simulated["published"][shown]), color=colour("stribeck"), linewidth=1.1)
        entries.append(("as published", "stribeck"))
    line(axis, time, np.degrees(swing.simulated["orthosis"][shown]), color=colour(role), linewidth=1.4)
    rest = f"{swing.fit['orthosis']:.1f} % of the IMU's angle explained"
    if np.isfinite(swing.ceiling):
        rest += f"; {swing.ceiling:.1f} % possible with a perfect model"
    heads([axis], [Head(f"{who}, {swing.recording.replace('_', ' ')}", rest, colour(role))])
    _label(axis, "Mismatch (deg)", "Time (s)", entries)
    frames = np.linspace(float(time[0]), float(time[-1]), PAGE_SETTINGS.frame_count)
    orthosis = np.zeros(len(time)) if swing.position is None else swing.position[shown]
    turned = np.interp(frames, time, orthosis), np.interp(frames, time, swing.seen[shown])
    ways = {**_leg_in_orthosis(limb, *turned), "cursor": cursor(axis, frames)}
    return MovingDrawing(
        f"mismatch_{who}",
        figure,
        "Left: recorded orthosis (grey) and leg (black; white on a dark page), with the angle between them magnified "
        f"{PAGE_SETTINGS.mismatch_magnification:g} times. Right: angle between limb and orthosis of {who}, from the "
        "IMU and from the identified strap, under the torque that the orthosis's equation of motion gives. "
        + ("This swing was not fitted." if role == "heldout" else "This swing was fitted.")
        + (" The published equation contains no strap." if len(entries) > 2 else ""),
        ways,
        float(time[-1] - time[0]),
    )


def _leg_in_orthosis(axis: Axes, orthosis: np.ndarray, mismatch: np.ndarray) -> dict[str, Way]:
    """Draw a thigh that rests, and orthosis and shank that turn below it, (frames,) [rad] from hanging."""
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-1.35, 1.15)
    axis.set_ylim(-1.2, 0.45)
    axis.plot((0.0, 1.0), (0.0, 0.12), color=colour("faint"), linewidth=15.0, solid_capstyle="round")
    ways = {}
    drawn = (
        ("orthosis", orthosis, 1.0, colour("muted"), 13.0),
        ("leg", orthosis + PAGE_SETTINGS.mismatch_magnification * mismatch, 1.08, colour("measured"), 5.0),
    )
    for name, angle, length, tone, width in drawn:
        # The foot swings back when the knee bends.
        foot = length * np.column_stack([-np.sin(angle), -np.cos(angle)])
        points = np.stack([np.zeros_like(foot), foot], axis=1)
        strokes(axis, points[0], name, edgecolor=tone, linewidth=width, zorder=4)
        ways[name] = Way(axis, points)
    axis.plot([0.0], [0.0], "o", color=colour("fitted"), markersize=8.0, zorder=6)
    return ways


def strap_figure(who: str, strap: IdentifiedStrap) -> Drawing:
    """Draw the strap torque against the mismatch angle: measured, by the chosen model, and by a spring alone."""
    figure, axis = one_panel(3.4)
    _zero_line(axis)
    place, torque = strap.seen
    half = 0.5 * strap.fit.values.get("slack", 0.0)
    low, high = strap.range[0] - half, strap.range[1] + half
    span = np.linspace(low, high, 301)
    inside = (place >= low) & (place <= high)
    dots(axis, np.degrees(place[inside]), torque[inside], colour("measured"), alpha=0.35, size=3.0)
    plain = strap.plain.values["stiffness"]
    line(axis, np.degrees(span), plain * span, color=colour("stribeck"), linewidth=1.2)
    pulled = span - np.clip(span, -half, half)
    line(axis, np.degrees(span), strap.stiffness.value * pulled, color=colour("load"), linewidth=1.0)
    line(axis, np.degrees(span), strap.torque(span), color=colour("fitted"), linewidth=1.8)
    entries = (("IMU", "measured"), ("strap", "fitted"), ("its tangent", "load"), ("spring alone", "stribeck"))
    stiffness = number(strap.stiffness.value, strap.stiffness.standard_error)
    heads([axis], [Head(who, f"{stiffness} N·m/rad", colour("load"))])
    _label(axis, "Torque (N·m)", "Mismatch (deg)", entries)
    return Drawing(
        f"strap_{who}",
        figure,
        f"Elastic torque of the strap of {who} over the angle between limb and orthosis: measured with the limb's IMU, "
        f"the chosen model ({strap.model.words}), its tangent at the onset of tension, and the best-fitting spring "
        "alone. The torques of damper and relaxation are subtracted.",
    )


def straps_figure(wearers: Mapping[str, WearerStages], level: float) -> Drawing:
    """Draw intervals of stiffness, damping and inertia by participant, from either side of the strap."""
    figure = Figure(figsize=(FIGURE_WIDTH, 1.5 + 0.5 * len(wearers)), layout="constrained")
    panels = figure.subplots(1, len(STRAP_PARAMETERS), sharey=True)
    names = list(wearers)
    both = False
    for axis, (attribute, word) in zip(panels, STRAP_PARAMETERS, strict=True):
        axis.axvline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        for row, who in enumerate(names):
            found = wearers[who].coupling
            _interval(axis, row - 0.12, found.parameter(attribute), level, "fitted")
            if found.limb_side is not None and attribute != "inertia":
                both = True
                _interval(axis, row + 0.18, getattr(found.limb_side, attribute), level, "load")
        unit = unit_text(wearers[names[0]].coupling.parameter(attribute).unit)
        tidy(axis, first=axis is panels[0])
        axis.set_xlabel(f"{word} ({unit})")
        axis.margins(x=0.08)
    panels[0].set_yticks(range(len(names)), names)
    panels[0].set_ylim(len(names) - 0.5, -0.6)
    if both:
        key(panels[1], [("orthosis's side", colour("fitted")), ("limb's side", colour("load"))])
    limb = " The interval from the limb's torque balance omits the error of its torque." if both else ""
    return Drawing(
        "straps",
        figure,
        f"Parameters of every strap with {100.0 * level:.4g} % intervals. A strap has no inertia, so that this "
        f"interval must contain zero.{limb}",
    )


def _interval(axis, row: float, parameter: Parameter, level: float, role: str) -> None:
    low, high = parameter.interval(level)
    axis.plot([low, high], [row, row], color=colour(role), linewidth=2.2, solid_capstyle="round", zorder=3)
    dots(axis, np.array([parameter.value]), np.array([row]), colour(role), alpha=1.0, size=6.0)


def drawn_swing(swings: Sequence[EvaluatedSwing]) -> EvaluatedSwing:
    """Return the swing that is drawn: the first held-out one, else the first."""
    return next((s for s in swings if s.split == "heldout"), swings[0])


ORIENTATION_FILTER_NAMES = {"vqf": "VQF", "madgwick": "Madgwick's filter"}
"""Names of the orientation filters."""


def page(study: Study, findings: CouplingResult) -> Page:
    """Build the page of a result."""
    sections = (
        Section("coupling_found", "What was found", tables=figure_tables(findings)),
        _orthosis(findings),
        *([_limbs(findings)] if any(w.limb is not None for w in findings.wearers.values()) else []),
        _straps(findings),
        _provenance(study, findings),
    )
    shown = f"mismatch_{next(iter(findings.wearers))}" if findings.wearers else ""
    drawn = (drawing for section in sections for drawing in section.drawings)
    figure = next((drawing for drawing in drawn if drawing.name == shown), None)
    return study_page(
        title=f"{findings.study}: wearers and their orthosis",
        answer=findings.answer,
        verdicts=findings.verdicts,
        tiles=_tiles(findings),
        sections=sections,
        figure=figure,
    )


def _tiles(findings: CouplingResult) -> tuple[Tile, ...]:
    gravity = findings.orthosis.gravity.gravity
    tiles = [Tile("Orthosis, gravity", number(gravity.value, gravity.standard_error), "N·m", "held out horizontally")]
    for who, stages in findings.wearers.items():
        strap, reached = stages.coupling.parameter("stiffness"), stages.coupling.mean_fit()
        more = f"explains {reached:.1f} % of held-out mismatch" if np.isfinite(reached) else "nothing is held out"
        tiles.append(Tile(f"Strap, {who}", number(strap.value, strap.standard_error), unit_text(strap.unit), more))
    return tuple(tiles)


def _orthosis(findings: CouplingResult) -> Section:
    fit = findings.orthosis
    drawings = [draw(gravity_figure, fit.gravity)]
    if fit.checks:
        name = next(iter(fit.checks))
        drawings.append(draw(response_figure, fit.checks[name], fit.linear_checks[name]))
    return Section(
        "coupling_orthosis",
        "The orthosis alone",
        (
            "Gravity is estimated from static holds, inertia and friction from sinusoidal motion. The published form "
            "represents gravity by a spring, which fits one amplitude only.",
        ),
        parameter_tables(findings, "Orthosis"),
        tuple(drawings),
    )


def _limbs(findings: CouplingResult) -> Section:
    known = {who: stages for who, stages in findings.wearers.items() if stages.limb is not None}
    rows = []
    for who, stages in known.items():
        shares = {name: number(s.gravity(), digits=4) for name, s in stages.limb.segments.items()}
        found = number(stages.limb.gravity.value, stages.limb.gravity.standard_error)
        rows.append((who, found, *(shares.get(name, "–") for name in ("winter", "published", "de_leva"))))
    heads = ("Participant", "Found", "Winter, knee to ankle", "Winter, knee to heel", "de Leva")
    table = number_table(heads, rows, "Gravity of shank and foot (N·m): identified, and from body mass.", wide=False)
    drawing = draw(limbs_figure, findings.orthosis.gravity, known)
    tables = (table, *parameter_tables(findings, ": limb"))
    return Section("coupling_limbs", "The limbs", tables=tables, drawings=(drawing,))


def _straps(findings: CouplingResult) -> Section:
    drawings = [draw(straps_figure, findings.wearers, findings.confidence)]
    for who, stages in findings.wearers.items():
        if stages.coupling.strap is not None:
            drawings.append(draw(strap_figure, who, stages.coupling.strap))
        drawings.append(draw(mismatch_figure, who, drawn_swing(stages.coupling.evaluated)))
        if stages.coupling.posterior is not None:
            compared = strap_beside_posterior(stages.coupling)
            drawings.append(draw(posterior_figure, compared, findings.confidence, f"posterior-{who}"))
    return Section(
        "coupling_straps",
        "The straps",
        (
            "The strap's torque is computed from the torque balance of one body. The strap is modelled as a spring and "
            "a damper; hardening, slack, relaxation, misalignment, friction and soft tissue are added if they improve "
            "the prediction of held-out blocks. Its stiffness is the tangent at the onset of tension. In the published "
            "sum of both balances, the strap's torque cancels.",
        ),
        parameter_tables(findings, ": strap"),
        tuple(drawings),
    )


def _provenance(study: Study, findings: CouplingResult) -> Section:
    asked = study.table(CouplingTable)
    axes = 9 if asked.magnetometer else 6
    return Section(
        "coupling_provenance",
        "How",
        (
            f"Limb angle by {ORIENTATION_FILTER_NAMES[asked.orientation]} with {axes} axes; "
            "torque and angle low-passed alike at 15 Hz, zero-phase; "
            "the IMU's clock, mounting and gain estimated with the strap. "
            f"{len(findings.checksums)} recordings; their checksums are on the cards.",
        ),
        notes=study.notes,
    )
