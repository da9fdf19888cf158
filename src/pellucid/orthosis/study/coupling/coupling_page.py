"""Page of an orthosis and its wearers: results by stage, and the more reliable side of each strap."""

from __future__ import annotations

import numpy as np

from ...._printed_command import printed_command
from ....study.drawing.drawing import draw
from ....study.pages.page import Answer, Page, Section, Tile, without_drawing
from ....study.pages.quantities import number, typeset_sentence, unit_text
from ....study.pages.tables import number_table
from ....study.procedures.badge_bounds import MIN_EXPLAINED_PERCENT
from ....study.procedures.posterior_beside import pair_with_posterior
from ....study.procedures.posterior_figures import posterior_figure
from ....study.procedures.study_page import figure_tables, parameter_tables, study_page
from ....study.study import Study
from . import coupling_figures as figures
from .coupling_result import CouplingResult
from .coupling_table import CouplingTable

ORIENTATION_FILTER_NAMES = {"vqf": "VQF", "madgwick": "Madgwick's filter"}
"""Names of the orientation filters."""


def page(study: Study, findings: CouplingResult) -> Page:
    """Build the page of a result."""
    sections = (
        _found(findings),
        _orthosis(findings),
        *([_limbs(findings)] if any(w.limb is not None for w in findings.wearers.values()) else []),
        _straps(findings),
        _provenance(study, findings),
    )
    shown = f"mismatch_{next(iter(findings.wearers))}" if findings.wearers else ""
    drawn = (drawing for section in sections for drawing in section.drawings)
    figure = next((drawing for drawing in drawn if drawing.name == shown), None)
    held = [w.coupling.mean_fit() for w in findings.wearers.values()]
    known = np.isfinite(held).any()
    wrong = any(v.kind == "wrong" for v in findings.verdicts)
    explained = known and float(np.nanmean(held)) >= MIN_EXPLAINED_PERCENT
    return study_page(
        title=f"{findings.study}: wearers and their orthosis",
        headline=typeset_sentence(findings.headline),
        verdicts=findings.verdicts,
        tiles=_tiles(findings),
        sections=without_drawing(sections, shown),
        answer=Answer(
            f"Do the straps explain at least {MIN_EXPLAINED_PERCENT:.0f} % of the angle between limb and orthosis in "
            "swings that were not fitted?",
            "no" if wrong or (known and not explained) else "yes" if explained else "unsure",
            figure,
            tuple(
                f"Make a controller for {who}: `{printed_command('export', study.folder, '--participant', who)}`."
                for who in list(findings.wearers)[:1]
            ),
        ),
    )


def _tiles(findings: CouplingResult) -> tuple[Tile, ...]:
    gravity = findings.orthosis.gravity.gravity
    tiles = [Tile("Orthosis, gravity", number(gravity.value, gravity.standard_error), "N·m", "held out horizontally")]
    for who, stages in findings.wearers.items():
        strap, reached = stages.coupling.parameter("stiffness"), stages.coupling.mean_fit()
        more = f"explains {reached:.1f} % of held-out mismatch" if np.isfinite(reached) else "nothing is held out"
        tiles.append(Tile(f"Strap, {who}", number(strap.value, strap.standard_error), unit_text(strap.unit), more))
    return tuple(tiles)


def _found(findings: CouplingResult) -> Section:
    return Section(
        "coupling_found",
        "What was found",
        (),
        figure_tables(findings),
    )


def _orthosis(findings: CouplingResult) -> Section:
    fit = findings.orthosis
    drawings = [draw(figures.gravity_figure, fit.gravity)]
    if fit.checks:
        name = next(iter(fit.checks))
        drawings.append(draw(figures.response_figure, fit.checks[name], fit.linear_checks[name]))
    return Section(
        "coupling_orthosis",
        "The orthosis alone",
        (
            "Gravity comes from angles at which the orthosis was held, inertia and friction from sines that led it. "
            "The published form has no gravity of its own: a spring has to stand for it, and fits one amplitude only.",
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
    table = number_table(heads, rows, "Gravity of shank and foot (N·m): found, and by shares.", wide=False)
    drawing = draw(figures.limbs_figure, findings.orthosis.gravity, known)
    tables = (table, *parameter_tables(findings, ": limb"))
    return Section("coupling_limbs", "The limbs", tables=tables, drawings=(drawing,))


def _straps(findings: CouplingResult) -> Section:
    drawings = [draw(figures.straps_figure, findings.wearers, findings.confidence)]
    for who, stages in findings.wearers.items():
        if stages.coupling.strap is not None:
            drawings.append(draw(figures.strap_figure, who, stages.coupling.strap))
        drawings.append(draw(figures.mismatch_figure, who, figures.drawn_swing(stages.coupling.evaluated)))
        if stages.coupling.posterior is not None:
            compared = pair_with_posterior(stages.coupling.orthosis_side.parameters, stages.coupling.posterior)
            drawings.append(draw(posterior_figure, compared, findings.confidence, f"posterior-{who}"))
    return Section(
        "coupling_straps",
        "The straps",
        (
            "A strap's torque comes from the balance of one body; the mismatch answers it through what the strap is: a "
            "spring and a damper, and of hardening, slack, relaxation, askewness, friction and soft tissue what blocks "
            "held out ask for. Its stiffness is the tangent where it begins to pull. In the sum of both balances, as "
            "published, that torque cancels.",
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
