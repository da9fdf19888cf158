"""Write the page of the demo: the steps and results of each chapter in a laboratory's order, with links to each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from pellucid._printed_command import printed_command
from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, BEST_SENSED_CONTROLLER, ELBOW_CONTROLLERS
from pellucid.joint.slider.study import direction_figures
from pellucid.joint.slider.study.slider_page import COLOUR_ROLES, COMPARED_METHODS, PROTOCOL_WORDS, SHORT_METHOD_NAMES
from pellucid.joint.study.joint_answer import error_range_text, headline_error
from pellucid.joint.study.joint_page import answer_figure, parameter_value
from pellucid.people.indices import EMG_LEVEL, MEDIAN_DURATION, RMS_INTERACTION_TORQUE, Index
from pellucid.people.study import assessment_figures
from pellucid.people.study.assessment_answer import change_value, known_changes
from pellucid.people.study.assessment_result import AssessmentResult
from pellucid.study.answer import Answer, Step
from pellucid.study.datasets.registry import info
from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import Row, Table
from pellucid.study.pages.page import Page, Section, Tile, write_page
from pellucid.study.pages.quantities import (
    number,
    parameter_interval,
    parameter_label,
    percent,
    typeset_sentence,
    unit_text,
)
from pellucid.study.pages.values import Value

from .coverage import RICHER_PLANTS
from .demonstration import Demonstration
from .session_figures import screens_figure
from .wearers_figures import wearers_figure

CONFIDENCE_LEVEL = 0.95
"""Confidence level of the intervals on the page."""

INTERVAL_SENTENCE_OF_ELBOW = (
    "An interval accounts for noise, for coloured residuals, and for missing effects that the residuals show. If the "
    "true value lies outside, the model lacks an effect that the residuals do not show."
)
"""What the intervals of the elbow's table allow for."""

DRAWN_INDICES = (MEDIAN_DURATION, RMS_INTERACTION_TORQUE, EMG_LEVEL)
"""Indices of movement that the page draws."""


def write_story(out: Path, made: Demonstration) -> Path:
    """Write index.html and its figures."""
    chapters = (_real, _identified, _controllers, _people, _exported, _replayed, _coverage, _next)
    told = [section for section in (chapter(made) for chapter in chapters) if section is not None]
    sections = [replace(section, heading=f"{i}. {section.heading}") for i, section in enumerate(told, 1)]
    page = Page(
        title="Pellucid, from a recording to a transparent robot",
        kicker="pellucid demo",
        answer=demonstration_answer(made),
        figure=answer_figure(made.real_fit),
        tiles=_tiles(made),
        sections=tuple(sections),
        footer=f"Written by pellucid {version('pellucid')}; every random number has a seed. Each chapter is a folder "
        "next to this page, with its recordings, study.toml, model cards, results.json and report.",
    )
    return write_page(out, page)


def _headline(made: Demonstration) -> str:
    """Return the answer in sentences: prediction error of a real machine's model, and interaction torque of the
    robot.
    """
    judged = len(made.real.recordings("validate"))
    torque = _torque_values(made)
    return (
        f"The model of a real servo predicts the torque of {judged} held-out recordings with an error of "
        f"{_real_error(made)} %{error_range_text(made.real_fit)}. A simulated robot was identified with the same "
        f"methods; with its force sensor, {torque[BEST_SENSED_CONTROLLER]} N·m RMS act between it and its wearer."
    )


def demonstration_answer(made: Demonstration) -> Answer:
    """Return the answer of the real machine's report, with what the robot leaves people."""
    step = Step("Try your own recordings", line="pellucid init my-joint --from recordings")
    answer = made.real_fit.answer
    people = f"The robot that is worn, and the {len(made.findings.participants)} people who wear it, are simulated."
    basis = None if answer.basis is None else replace(answer.basis, more=(*answer.basis.more, people))
    return replace(answer, said=_headline(made), basis=basis, next=(step,))


def _real_error(made: Demonstration) -> Value:
    """Return the held-out error of the real machine, as its own report tells it [%]."""
    return headline_error(made.real_fit)


def _torque_values(made: Demonstration) -> dict[str, Value]:
    """Return the mean interaction torque under each controller, as the people's own report tells it [N m]."""
    name = RMS_INTERACTION_TORQUE.name
    rows = {c: f"{made.findings.study}.transparency.{name}.{c.lower()}" for c in made.findings.conditions}
    return {c: Value(rows[c], x, number(x, digits=3)) for c, x in _means(made.findings, RMS_INTERACTION_TORQUE).items()}


def chapter_sentences(made: Demonstration) -> list[tuple[str, str]]:
    """Return the heading and the main sentence of each chapter, for the page and the command line."""
    off, error = percent(100.0 * _gravity_error(made)), 1e3 * made.fit.evaluated_error("load") * made.fit.gain
    found = (
        f"A virtual elbow exoskeleton was identified from {_minutes(made):.0f} minutes of recordings: the error "
        f"of its gravity torque is {off} %, that of the torque in held-out trials {number(error, digits=2)} mN·m."
    )
    torque, slower = _torque_values(made), _changes(made.findings)
    pulled = ", ".join(f"{x.text} under {c}" for c, x in torque.items())
    lasted = ", ".join(f"{slower[c].text} %" for c in torque)
    worn = (
        f"{len(made.findings.participants)} simulated people pointed without and with it. The torque between robot and "
        f"person was, in N·m, {pulled}. Relative to no robot, the duration of their movements changed by {lasted}."
    )
    fitted, judged = (len(made.real.recordings(use)) for use in ("fit", "validate"))
    real = (
        f"A real machine ({made.real.name}) was identified from {fitted} recordings; on {judged} others, of other "
        f"movements, the error of its effort is {_real_error(made).text} %."
    )
    return [("Real", real), ("Identified", found), ("Worn", worn), ("Exported", _left(made))]


def _left(made: Demonstration) -> str:
    head, cost = f"The controller {BEST_SENSED_CONTROLLER} left the PC as C", made.cost
    if cost is not None:
        same = f"and {cost.wrong} answers differ from here" if cost.wrong else "with the same bits as here"
        return f"{head}: on a Cortex-M4F in QEMU a step takes {cost.instructions:.0f} instructions, {same}."
    if made.played is not None:
        return f"{head}: compiled on this machine it played {made.played[0]} steps, {made.played[1]} of them wrong."
    return f"{head}; no compiler is here to prove it."


def _minutes(made: Demonstration) -> float:
    return sum(float(m.time[-1] - m.time[0]) for m in made.fit.motions) / 60.0


def _gravity_error(made: Demonstration) -> float:
    return abs(made.fit["load"]["gravity"].value / made.robot.gravity(0.0)[0] - 1.0)


def _means(findings: AssessmentResult, index: Index) -> dict[str, float]:
    table = findings.assessed[index.name].table
    return {c: float(table.column(c).mean()) for c in table.conditions}


def _changes(findings: AssessmentResult) -> Mapping[str, Value]:
    """Return the primary change of the median duration against control, as the people's own report tells it [%]."""
    name = MEDIAN_DURATION.name
    return {c: change_value(findings, name, c, change) for c, change in known_changes(findings, name).items()}


def _tiles(made: Demonstration) -> tuple[Tile, ...]:
    torque = _torque_values(made)
    others = ", ".join(f"{c.replace('_', ' ')} {x}" for c, x in torque.items() if c != BEST_SENSED_CONTROLLER)
    tiles = [
        Tile("Error of the gravity torque", percent(100.0 * _gravity_error(made)), "%", "a virtual elbow"),
        Tile(
            f"Interaction torque, {BEST_SENSED_CONTROLLER.replace('_', ' ')}",
            str(torque[BEST_SENSED_CONTROLLER]),
            "N·m RMS",
            others,
        ),
    ]
    if made.cost is not None:
        count, size = f"{made.cost.instructions:.0f}", f"Cortex-M4F, {made.cost.bytes} bytes"
        tiles.append(Tile("Control step", count, "instructions", size))
    tiles.insert(0, Tile("Torque error, held out", str(_real_error(made)), "%", "a real machine"))
    return tuple(tiles)


def _identified(made: Demonstration) -> Section:
    fit, robot = made.fit, made.robot
    sine, cosine = robot.gravity(0.0)
    rows = []
    for name, true in (("gravity", sine), ("gravity_cosine", cosine), ("inertia", robot.inertia(0.0))):
        p = fit["load"][name]
        low, high = p.interval(CONFIDENCE_LEVEL)
        found = (
            number(p.value, p.standard_error),
            parameter_interval(p, CONFIDENCE_LEVEL),
            number(true, p.standard_error),
        )
        off = percent(100.0 * abs(p.value / true - 1.0))
        words = name.replace("_", ", ")
        rows.append(Row((words, unit_text(p.unit), *found, off, "yes" if low <= true <= high else "no")))
    heads = ("Parameter", "Unit", "Found", "95 % interval", "Truth", "Off by (%)", "Interval holds it")
    table = Table(heads, tuple(rows), frozenset({2, 3, 4, 5}), "With the carriage at 0.", True)
    evaluated = {m: {e.recording: e for e in fit.evaluated(m)} for m in COMPARED_METHODS}
    trials = list(evaluated["pooled"])
    errors = {SHORT_METHOD_NAMES[m]: np.array([evaluated[m][t].current for t in trials]) for m in COMPARED_METHODS}
    kinds = [PROTOCOL_WORDS.get(evaluated["pooled"][t].protocol, evaluated["pooled"][t].protocol) for t in trials]
    places = len({round(m.slider, 3) for m in fit.motions if m.split == "fitted"})
    return Section(
        "identified",
        "A robot is identified",
        (
            f"An elbow exoskeleton with a carriage on its forearm moved for {_minutes(made):.0f} minutes, the carriage "
            f"at {places} places. It is virtual, so that the truth is known, and richer than any model: friction that "
            "follows load, speed and direction, stiction, backlash, a cable that gives, cameras on their own clock. "
            "What identifies it sees files alone: time, encoder counts, current, markers.",
            INTERVAL_SENTENCE_OF_ELBOW,
        ),
        (table,),
        (draw(direction_figures.paired_errors, errors, kinds, roles=COLOUR_ROLES),),
        links=(("Full report", "elbow/report/index.html"), ("Model card", "elbow/models/slider.load.json")),
    )


def _controllers(made: Demonstration) -> Section:
    worn = [c for c in made.findings.conditions if c in ELBOW_CONTROLLERS]
    rows = tuple(Row((name, ELBOW_CONTROLLERS[name].title, ELBOW_CONTROLLERS[name].card)) for name in worn)
    return Section(
        "controllers",
        "Its cards make controllers",
        (
            "Each controller takes its numbers from a model card and the place of the carriage, nothing else, and ends "
            "in the same safety gate: limits on torque, rate, speed and position, and faults that latch. "
            f"{BEST_CONTROLLER} has "
            f"the encoder alone, as clpc has; {BEST_SENSED_CONTROLLER} also reads the torque at the strap, with the "
            "sensor's "
            "noise, offset, drift and delay.",
        ),
        (Table(("Controller", "What it does", "Card"), rows, wide=True),),
    )


def _people(made: Demonstration) -> Section:
    findings = made.findings
    n, left = len(findings.participants), sum(findings.left_out.values())
    least = number(min(1.0, 2.0 ** (1 - n)), digits=2)
    torque, changes = _torque_values(made), _changes(findings)
    cut = {each.condition: f"{100.0 * each.curve.cut:.0f} %" for each in findings.settling}
    rows = tuple(
        Row((c.replace("_", " "), f"{changes[c]} %", cut[c], str(x)), c == BEST_SENSED_CONTROLLER)
        for c, x in torque.items()
    )
    heads = ("Condition", f"Duration against {findings.control}", "Never settled", "Interaction torque, RMS (N·m)")
    drawn = {each.name: findings.assessed[each.name] for each in DRAWN_INDICES if each.name in findings.assessed}
    return Section(
        "people",
        "People wear it, and point",
        (
            f"{n} simulated people pointed up and down over five distances, without the robot ({findings.control}) and "
            f"with each controller: {findings.movements} movements, {left} more excluded. They choose their pace, "
            "plan, learn the load, and have muscles with noise and delays. Their parameters are fitted to human "
            "movement without a robot and then frozen, so that the robot's effect on them is a prediction.",
            f"{n} people illustrate a study but prove nothing: a signed-rank test of one controller against "
            f"{findings.control} cannot give less than p = {least}, whatever it does. The whole experiment has six "
            "people and 400 movements of each: `pellucid init my-people --rig elbow-participants`.",
            "Where a robot sticks and lets go, people hunt about the target, and a movement's duration counts that; "
            "some never settle before the next target comes. So durations are medians, with the share that never "
            "settled; the report shows what other rules would say.",
        ),
        (Table(heads, rows, frozenset({1, 2, 3}), "Durations: medians over people; torque: means."),),
        (
            draw(wearers_figure, findings.profiles, findings.conditions, findings.profile_of),
            draw(assessment_figures.index_figure, drawn, findings.conditions),
        ),
        tuple(typeset_sentence(v.said) for v in findings.verdicts if v.kind in ("wrong", "warning")),
        links=(("Full report", "people/report/index.html"), ("The study", "people/study.toml")),
    )


def _exported(made: Demonstration) -> Section:
    cost = made.cost
    tables: tuple[Table, ...] = ()
    paragraphs = [
        f"The controller {BEST_SENSED_CONTROLLER} as a folder of C and C++: the core's own headers, the identified "
        "constants, "
        "three functions to call, and a test vector with a motion and every fault."
    ]
    if cost is not None:
        rows = (
            ("Steps of the test vector", cost.steps),
            ("Answers that differ from this machine's in any bit", cost.wrong),
            ("Instructions a step, mean", round(cost.instructions)),
            ("Instructions, the costliest step", cost.most),
            ("Code and constants (bytes)", cost.bytes),
            ("Memory (bytes)", cost.memory),
        )
        cells = tuple(Row((words, f"{count}")) for words, count in rows)
        tables = (Table(("On a Cortex-M4F in QEMU", ""), cells, frozenset({1})),)
    elif made.played is not None:
        paragraphs.append(f"Compiled on this machine, it played {made.played[0]} steps; {made.played[1]} were wrong.")
    return Section(
        "exported",
        "The controller leaves the PC",
        tuple(paragraphs),
        tables,
        links=(
            ("Read before switching on", "elbow/controller/README.md"),
            ("Constants", "elbow/controller/pellucid_constants.h"),
        ),
    )


def _replayed(made: Demonstration) -> Section | None:
    session = made.replayed
    if session is None:
        return None
    replay = session.replay
    same = "every bit is equal" if replay.is_equal else f"{replay.wrong_bits} bits differ"
    return Section(
        "replayed",
        "A session is recorded, and computed again",
        (
            f"The engine of `pellucid live` ran {session.law} on the virtual robot in real time for some seconds, and "
            "recorded every number that the law was given. Another program computed its "
            f"{replay.compared} commands again: {same}.",
            "`pellucid init my-session --session elbow` starts a study whose session has a page for an operator and "
            "one for a participant, and needs no hardware.",
        ),
        drawings=(draw(screens_figure, session),),
    )


def _coverage(made: Demonstration) -> Section:
    rows = tuple(Row((c.colour, f"{c.repetitions}", f"{c.lowest:.1f}", f"{c.textbook:.1f}")) for c in made.coverages)
    heads = ("Residuals", "Repetitions", "Lowest of all parameters (%)", "Textbook intervals (%)")
    return Section(
        "coverage",
        "Are the intervals honest?",
        (
            "A virtual joint that the model describes exactly was identified repeatedly, with new noise each time. How "
            "often did a 95 % interval contain the truth? Textbook intervals, which assume white residuals, fail if "
            "the residuals are coloured, as filters and friction make them.",
            "This test says nothing about a real machine, because plant and model are the same here. On "
            f"{RICHER_PLANTS.identifications} recordings of drawn virtual elbows with a gap, a spring, ripple and "
            "friction that the identified models lack, intervals for coloured residuals alone contain the worst of "
            f"inertia, gravity and load friction in {RICHER_PLANTS.statistical:.0f} %. Intervals are therefore "
            "widened by the effects that residuals show the model to lack, and contain the truth in "
            f"{RICHER_PLANTS.held:.0f} %; `python -m research.evidence coverage` measures it.",
        ),
        (Table(heads, rows, frozenset({1, 2, 3}), wide=True),),
    )


def _real(made: Demonstration) -> Section:
    fit, name = made.real_fit, made.real.name
    fitted, judged = (len(made.real.recordings(use)) for use in ("fit", "validate"))
    best = fit.headlined
    rows = []
    for p in best.estimate.parameters:
        value = parameter_value(fit, p)
        rows.append(
            Row((parameter_label(p.name), value, parameter_interval(p, CONFIDENCE_LEVEL), unit_text(p.unit) or "–"))
        )
    heads = ("Parameter", "Value", "95 % interval", "Unit")
    return Section(
        "real",
        "A real machine",
        (
            f"{name}: {info(name).title}, under the licence {info(name).licence}. Of "
            f"{len(fit.families)} friction families, {best.family} was chosen. "
            f"{fitted} recordings were fitted; on {judged} others, of other movements, the error of its effort is "
            f'{_real_error(made)} %. "Not identifiable" means that these recordings do not determine the parameter.',
            f"Recorded by others: {info(name).citation}",
        ),
        (Table(heads, tuple(rows), frozenset({1, 2})),),
        links=(("Full report", f"{name}/report/index.html"),),
    )


def _next(made: Demonstration) -> Section:
    rows = (
        ("recordings of a joint", "pellucid init my-joint --from recordings"),
        ("an orthosis and its wearer, EMG", "pellucid init my-knee --rig knee-orthosis"),
        ("people who move under conditions", "pellucid init my-people --from recordings"),
        ("no robot", "pellucid init my-elbow --rig able-elbow"),
        ("this demo's robot, another controller", printed_command("export", made.elbow.folder, "--controller", "fc")),
    )
    return Section(
        "next",
        "Yours",
        ("Each chapter is a study like any other: try pellucid check, identify, assess and report on its folder.",),
        (Table(("You have", "Begin with"), tuple(map(Row, rows)), wide=True),),
        notes=made.notes,
    )
