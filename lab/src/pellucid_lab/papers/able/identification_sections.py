"""First half of the page: Table I and Fig. 3 on virtual elbows, and one coherent body on the same recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pellucid.joint.slider.slider_fit import SliderFit
from pellucid.joint.slider.study import direction_figures as figures
from pellucid.joint.slider.study.identify_slider import predicted
from pellucid.models.simulate import cycle_energy
from pellucid.study.drawing.drawing import Drawing, draw
from pellucid.study.pages.forest import Row, Table
from pellucid.study.pages.page import Section
from pellucid.study.recorded_motions import recorded_word

from ...elbow.rig import ElbowRig
from ..figure import Reproduced
from ..row_sections import cell
from . import ratio_figures
from .identification_rows import LOAD_FRICTION_FACTORS
from .trials import ModelComparison

MODEL_WORDS = {
    "pooled": "without dissociation",
    "dissociated": "with dissociation",
    "consistent": "one body",
    "load": "one body, load friction",
}
"""Names of the models in figures, in the order in which they are drawn."""

MODEL_COLOUR_ROLES = dict(zip(MODEL_WORDS.values(), ("symmetric", "heldout", "fitted", "load"), strict=True))
"""Colour role of each model, by its name in figures."""


def identification_sections(
    rig: ElbowRig,
    comparisons: Sequence[ModelComparison],
    by_factor: Sequence[ModelComparison],
    fit: SliderFit,
    rows: Mapping[str, Reproduced],
) -> tuple[Section, ...]:
    """Return the sections on Table I, Fig. 3b, load friction, gravity, inertia, friction and energy."""
    return (
        _table1(rig, comparisons, rows),
        _trace(fit),
        _needed(rig, by_factor, rows),
        _body(rig, fit),
        _energy(fit),
    )


def _table1(rig: ElbowRig, comparisons: Sequence[ModelComparison], rows: Mapping[str, Reproduced]) -> Section:
    committed = [c for c in comparisons if c.rig == rig.name]
    first = committed[0]
    kinds = ["constant"] * 6 + ["sweep"] * 6 + ["slow"] * 6
    drawings = [
        draw(
            figures.paired_errors,
            {MODEL_WORDS[m]: first.errors[which][m] for m in MODEL_WORDS},
            kinds,
            f"paired-errors-{which}",
            roles=MODEL_COLOUR_ROLES,
            caption=caption,
        )
        for which, caption in (
            ("published", "The paper's 18 trials (its Fig. 3a), one seed: 12 of them are fitted."),
            ("unseen", "18 trials never fitted, with the carriage between the fitted places, one seed."),
        )
    ]
    names = list(dict.fromkeys(c.rig for c in comparisons))
    ids = [f"able.{'' if n == rig.name else n + '.'}table1.ratio" for n in names]
    drawings.append(
        draw(
            ratio_figures.ratio_by_rig,
            names,
            np.array([rows[i].ours for i in ids]),
            np.array([rows[i].lower for i in ids]),
            np.array([rows[i].upper for i in ids]),
            rows["able.table1.ratio"].published,
        )
    )
    table = []
    for which, tail in (("the paper's 18 trials", "published_protocol."), ("18 never fitted", "")):
        for name in names:
            head = f"able.{'' if name == rig.name else name + '.'}table1.{tail}"
            table.append(
                Row(
                    (
                        name,
                        which,
                        *(cell(rows[head + key].ours) for key in ("without", "with", "ratio")),
                        f"{rows[head + 'ratio'].lower:.2f} to {rows[head + 'ratio'].upper:.2f}",
                        cell(rows[head + "p"].ours),
                    ),
                    name == rig.name,
                )
            )
    printed = (cell(rows[f"able.table1.{key}"].published) for key in ("without", "with", "ratio"))
    table.append(Row(("the paper's robot", "its 18 trials", *printed, "", cell(rows["able.table1.p"].published))))
    return Section(
        "table1",
        "Table I: does dissociating the directions pay?",
        (
            "Every trial gives one mean absolute current error, in amperes, with one set of parameters for both "
            "directions and with a set for each. Medians over seeds; a rig's friction, masses and noise were fixed "
            "before anything was identified on it.",
        ),
        (
            Table(
                ("Rig", "Trials", "Without (A)", "With (A)", "Ratio", "Over seeds", "p"),
                tuple(table),
                frozenset({2, 3, 4, 6}),
                wide=True,
            ),
        ),
        tuple(drawings),
    )


def _trace(fit: SliderFit) -> Section:
    m = next(m for m in fit.motions if m.recording == "unseen_constant_3")
    part = slice(0, len(m.position))
    drawing = draw(
        figures.current_trace,
        m.time[part],
        m.effort[part] / fit.gain,
        {MODEL_WORDS[name]: predicted(fit[name], m)[part] / fit.gain for name in ("pooled", "dissociated", "load")},
        m.velocity[part],
        recorded_word("", is_simulated=True),
        roles=MODEL_COLOUR_ROLES,
        caption="Motor current at five velocities up and down (the paper's Fig. 3b), a trial never fitted.",
    )
    return Section(
        "trace",
        "Fig. 3b: the current, simulated and modelled",
        ("While the joint rests between movements, stiction holds it and no model of a moving joint speaks.",),
        (),
        (drawing,),
    )


def _needed(rig: ElbowRig, by_factor: Sequence[ModelComparison], rows: Mapping[str, Reproduced]) -> Section:
    ratios = np.array([c.ratio("published", "pooled", "dissociated") for c in by_factor])
    share = np.array(LOAD_FRICTION_FACTORS) * rig["transmission"]["load_motoring"]
    drawing = draw(
        ratio_figures.ratio_by_friction,
        share,
        ratios,
        rows["able.table1.ratio"].published,
        "Load friction while lifting, share of the load",
    )
    needed = rows["able.friction_needed.factor"]
    text = (
        f"The paper's ratio takes {needed.ours:.2f} times this rig's load friction: "
        f"{needed.ours * rig['transmission']['load_motoring']:.2f} of the load lost while lifting and "
        f"{needed.ours * rig['transmission']['load_generating']:.2f} while lowering."
        if needed.ours is not None
        else f"No multiple of this rig's load friction gives the paper's ratio: {needed.note}."
    )
    return Section(
        "needed",
        "Which friction would give the paper's ratio?",
        (
            text,
            "Friction that only differs between the directions, and not with the load, is an offset: one set of "
            "parameters lacks it, but it needs no second gravity or inertia. The ratio grows with load friction until "
            "what neither model knows (noise, ripple, friction that varies along the travel) is all that is left.",
        ),
        (),
        (drawing,),
    )


def _body(rig: ElbowRig, fit: SliderFit) -> Section:
    q = np.linspace(rig["range"]["low"], rig["range"]["high"], 80)
    middle = 0.5 * sum(fit.rail)
    model, body = fit["dissociated"].model, fit["load"]
    sine, cosine = rig.gravity(middle)
    drawings: list[Drawing] = [
        draw(
            figures.gravity_by_direction,
            np.degrees(q),
            {
                "up": model.gravity("up", middle, q),
                "down": model.gravity("down", middle, q),
                MODEL_WORDS["load"]: body.model.gravity(body.values, middle, q),
                "truth": sine * np.sin(q) + cosine * np.cos(q),
            },
            roles={MODEL_WORDS["load"]: "fitted"},
            caption="Gravity torque, carriage in the middle of the rail: the dissociated model's two sets, one body "
            "with load friction, and the rig itself.",
        )
    ]
    x = np.linspace(*fit.rail, 40)
    drawings.append(
        draw(
            figures.inertia_by_slider,
            x,
            {
                "up": model.inertia("up", x),
                "down": model.inertia("down", x),
                MODEL_WORDS["load"]: body.model.inertia(body.values, x),
                "truth": np.array([rig.inertia(s) for s in x]),
            },
            roles={MODEL_WORDS["load"]: "fitted"},
            caption="Inertia about the joint's axis against the slider's position; dashed is the true one.",
        )
    )
    load = np.linspace(-3.0, 3.0, 121)
    one = fit["consistent"]
    level = [body.model.value(body.values, n) for n in ("coulomb_positive", "viscous_positive")]
    shares = [body.model.value(body.values, n) for n in ("load_motoring", "load_generating")]
    speed = 1.0
    drawings.append(
        draw(
            figures.friction_by_load,
            load,
            {
                MODEL_WORDS["consistent"]: np.full_like(
                    load, one["coulomb_positive"].value + one["viscous_positive"].value * speed
                ),
                MODEL_WORDS["load"]: level[0] + level[1] * speed + np.abs(load) * np.where(load > 0.0, *shares),
                "truth": rig.friction(np.full_like(load, speed), load),
            },
            roles=MODEL_COLOUR_ROLES,
            caption=f"Friction against the load it carries, at {speed:g} rad/s upwards.",
        )
    )
    return Section(
        "body",
        "One coherent body",
        (
            "The dissociated model has two values each of gravity, inertia and friction. The difference of its two "
            "gravities is load friction: lifting costs (1 + α) times the weight, lowering gives back (1 − β) times. As "
            "long as the load "
            "never changes its sign, the two descriptions predict the same current, and a model with load friction "
            "cannot predict better. The further parameters of the dissociated model even absorb part of effects that "
            "both models lack, such as a load share that grows towards rest. The advantage is the meaning of the "
            "parameters: gravity and inertia are those of the body, so they may be compensated.",
        ),
        (),
        tuple(drawings),
    )


def _energy(fit: SliderFit) -> Section:
    """Return the section on the energy that compensating gravity alone puts into a joint over a closed cycle."""
    paper_angle = 1.15
    amplitude = np.linspace(0.02, 0.8, 30)
    middle = 0.5 * sum(fit.rail)
    model, body = fit["dissociated"].model, fit["load"]

    def directional(q, v, a):
        return np.where(v > 0.0, model.gravity("up", middle, q), model.gravity("down", middle, q))

    def coherent(q, v, a):
        return body.model.gravity(body.values, middle, q)

    energies = {
        MODEL_WORDS["dissociated"]: np.array([cycle_energy(directional, s, paper_angle, 0.5) for s in amplitude]),
        MODEL_WORDS["load"]: np.array([cycle_energy(coherent, s, paper_angle, 0.5) for s in amplitude]),
    }
    return Section(
        "energy",
        "Energy of a closed cycle",
        (
            "Gravity gives back what it takes: over a closed cycle its compensation may do no work. That of one body "
            "does none. A gravity that differs between the directions works in every cycle, and whether its friction "
            "terms take that back depends on the angle (errata, A7).",
        ),
        (),
        (
            draw(
                ratio_figures.cycle_energy,
                np.degrees(amplitude),
                energies,
                roles=MODEL_COLOUR_ROLES,
                caption="Net energy that compensating gravity puts into the joint in one cycle about 66°.",
            ),
        ),
    )
