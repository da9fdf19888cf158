"""Write the page of the ranking: one table of strategies, then the ranking of every task with all its columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.people.share_of_people import MIN_PEOPLE
from pellucid.study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import Row, Table, number_table
from pellucid.study.pages.page import Page, Section, without_drawing, write_page

from .board import BoardEntry, share_over_before
from .foreign_law import stopped_words
from .index_section import index_section
from .law_certificate import certificate_words
from .ranking_figures import Line, ranked_torque
from .strategies import (
    CONTROLLER_FIELDS,
    RANKED_STRATEGIES,
    SIMPLE_RIVALS,
    Strategy,
    controller_words,
    sensors_read,
)
from .task_ranking import SIGNIFICANCE_LEVEL, TaskRanking
from .tried import ControllerTrial

MIN_TOLD_PAIRS = 12
"""With fewer pairs the page says that more separate more controllers."""

LAW_GUIDE = "docs/how-to/bring-your-own-controller.md"
"""Document that states the interface of a law of one's own."""

EMPTY_CELL = "–"
"""Text of a table's cell without a value."""


def write_ranking(
    out: Path, tasks: Sequence[TaskRanking], pairs: int, seed: int, board: Sequence[BoardEntry] = ()
) -> Path:
    """Write index.html and its figures."""
    sections = (
        _strategy_section(tasks), *(_task_section(task) for task in tasks),
        *(section for task in tasks for section in index_section(task)), *_foreign_sections(tasks, board),
        _method_section(),
    )  # fmt: skip
    figure = next((drawing for section in sections for drawing in section.drawings), None)
    page = Page(
        title="Which controller?",
        kicker="pellucid rank",
        sections=sections if figure is None else without_drawing(sections, figure.name),
        footer=f"Written by pellucid {version('pellucid')}; seed {seed}. Every figure is simulated.",
        answer=ranking_answer(tasks, pairs),
        figure=figure,
    )
    return write_page(out, page)


def ranking_answer(tasks: Sequence[TaskRanking], pairs: int) -> Answer:
    """Return whether a controller leaves less torque than every simple reference controller in each task."""
    parts = []
    for task in tasks:
        first = option_name(task.controllers[0])
        if task.controllers[0] in SIMPLE_RIVALS[task.task]:
            parts.append(AnswerPart(task.task, "no", f"least torque with {first}, a simple reference controller"))
        elif task.test is not None and _is_told_from_rivals(task):
            parts.append(AnswerPart(task.task, "yes", f"significantly less torque with {first}"))
        else:
            parts.append(
                AnswerPart(
                    task.task, "cannot say", f"{first} does not differ significantly from each reference controller"
                )
            )
    more = Step(
        "Use more pairs to separate more controllers", line=f"pellucid rank --pairs {max(MIN_TOLD_PAIRS, 2 * pairs)}"
    )
    own = Step(f"Write a control law, as {LAW_GUIDE} shows, and rank it", line="pellucid rank --law my_law.py")
    export = Step("Try the first controller on your own study; for instructions", line="pellucid export --help")
    is_told = all(part.verdict != "cannot say" for part in parts)
    return answer_of_parts(
        "Does any controller leave significantly less torque than every simple reference controller?",
        _headline(tasks, pairs),
        parts,
        [_number(task) for task in tasks],
        basis=Basis(pairs, pairs, "pair", is_simulated=True),
        improve=(own,) if is_told else (more, own),
        next=(export, more) if pairs < MIN_TOLD_PAIRS else (export,),
    )


def _number(task: TaskRanking) -> AnswerNumber:
    """Return the median torque that the first controller leaves, over that without power, with 80 % of pairs."""
    low, middle, high = task.spread(_shares(task))[:, 0].tolist()
    what = f"torque of {option_name(task.controllers[0])} over that without power, {task.task}"
    return AnswerNumber(what, middle, "1", (low, high) if task.has_interval else None)


def _is_told_from_rivals(task: TaskRanking) -> bool:
    """Return whether the first controller differs significantly from each reference controller."""
    first, rivals = task.controllers[0], SIMPLE_RIVALS[task.task]
    return first not in rivals and not any(task.like_first[task.controllers.index(rival)] for rival in rivals)


def _headline(tasks: Sequence[TaskRanking], pairs: int) -> str:
    """Return the first controller of each task with its torque relative to that without power, and the range of 80 %
    of pairs.
    """
    parts = []
    for task in tasks:
        low, middle, high = task.spread(_shares(task))
        between = f" ({low[0]:.2f} to {high[0]:.2f} in 80 % of pairs)" if task.has_interval else ""
        parts.append(f"{task.task}: {middle[0]:.2f} with {option_name(task.controllers[0])}{between}")
    who = (
        "one simulated person in one robot, which does not generalise" if pairs == 1
        else f"{pairs} simulated people in sampled robots"
    )  # fmt: skip
    return (
        f"Torque between robot and person as a share of that without power, {who}: {'; '.join(parts)}. No constant was "
        "chosen on these people or robots."
    )


def option_name(controller: str) -> str:
    """Return a controller's name as the option --controller takes it; of a foreign law its file."""
    return controller.removeprefix("law:")


def _strategy_section(tasks: Sequence[TaskRanking]) -> Section:
    """Return the table of strategies with their place and torque in every task, the best mean place first."""

    def mean_place(one: Strategy) -> float:
        named = [(task, getattr(one, CONTROLLER_FIELDS[task.task])) for task in tasks]
        places = [task.controllers.index(name) / len(task.controllers) for task, name in named if name is not None]
        return sum(places) / len(places) if places else float("inf")

    rows = []
    for one in sorted(RANKED_STRATEGIES, key=mean_place):
        cells = [_place_text(task, getattr(one, CONTROLLER_FIELDS[task.task])) for task in tasks]
        rows.append(Row((one.name, one.reviewed or EMPTY_CELL, *cells)))
    heads = ("strategy", "reviewed for", *(task.task for task in tasks))
    caption = (
        "The name that --controller takes (an arm's fc is called full there, and force_sensors is not exported), the "
        "place by mean rank of the interaction torque, and its median over pairs as a share of the robot's without "
        "power. A dash: no such controller of that robot."
    )
    table = Table(heads, tuple(rows), caption=caption, wide=True)
    return Section("strategies", "By strategy", (), (table,))


def _place_text(task: TaskRanking, controller: str | None) -> str:
    if controller is None:
        return EMPTY_CELL
    i = task.controllers.index(controller)
    share = float(np.median(_shares(task)[:, i]))
    torque = f"{share:.2f}" if np.isfinite(share) else "stopped"
    return f"{option_name(controller)}: place {i + 1} of {len(task.controllers)}, {torque}"


def _shares(task: TaskRanking) -> np.ndarray:
    return task.over(SIMPLE_RIVALS[task.task][0])


def _task_section(task: TaskRanking) -> Section:
    rivals = SIMPLE_RIVALS[task.task]
    shares = _shares(task)
    lines = [
        Line(option_name(name), shares[:, i][np.isfinite(shares[:, i])], name in rivals)
        for i, name in enumerate(task.controllers)
    ]
    anchor = task.task.replace(" ", "_")
    paragraph = (
        "Ranked by the mean rank of the torque's RMS over pairs."
        if task.test is None
        else f"Ranked by the mean rank of the torque's RMS over {len(task.torque)} pairs. Friedman's chi-squared "
        f"({task.test.degrees_of_freedom:g}) = {task.test.statistic:.1f}, p = {task.test.p:.2g}. By Nemenyi's test "
        f"(5 %), controllers differ if their mean ranks differ by {task.critical:.1f}: "
        f"{int(task.like_first.sum()) - 1} of the other {len(task.controllers) - 1} do not differ from the first."
    )
    drawing = draw(
        ranked_torque, lines, f"ranked_{anchor}",
        caption=f"{task.task.capitalize()}: a dot for each pair of a person and a robot, a bar for their median; "
        "reference controllers in grey. Logarithmic axis.",
    )  # fmt: skip
    ranked, more = _tables(task)
    return Section(
        anchor, task.task.capitalize(), (paragraph,), (ranked,), (drawing,),
        folded=(("Energy, movement, margins and faults of each controller", more),),
    )  # fmt: skip


def _tables(task: TaskRanking) -> tuple[Table, Table]:
    """Return the table of ranks and torques, and that of everything else."""
    columns, words_of_columns = ROBOT_COLUMNS[CONTROLLER_FIELDS[task.task]]
    low, middle, high = task.spread(task.torque)
    rivals = SIMPLE_RIVALS[task.task]
    over = [np.median(task.over(rival), axis=0) for rival in rivals]
    own = [(head, cell) for head, cell in columns if any(cell(tried) != EMPTY_CELL for tried in task.tried.values())]
    rows, more = [], []
    for i, name in enumerate(task.controllers):
        tried = task.tried[name]
        label = f"{i + 1}. {option_name(name)}{'' if task.like_first[i] else ' *'}"
        words = (controller_words(task.task, name), sensors_read(task.task, name))
        torque = _torque_text(task, middle[i], low[i], high[i])
        shares = (f"{one[i]:.2f}" if np.isfinite(one[i]) else EMPTY_CELL for one in over)
        rows.append(Row((label, *words, f"{task.ranks[i]:.1f}", torque, *shares), name in rivals))
        more.append(Row((label, *(cell(tried) for _, cell in own)), name in rivals))
    heads = ("controller", "strategy", "senses", "mean rank", "torque (N·m)",
             *(f"over {option_name(rival)}" for rival in rivals))  # fmt: skip
    caption = "Medians over pairs; in brackets the range of 80 % of pairs. * differs significantly from the first."
    further = "Energy a second, given to the person and taken. " + words_of_columns
    return (
        number_table(heads, rows, caption, words=3),
        number_table(("controller", *(head for head, _ in own)), more, further, words=1),
    )


def _torque_text(task: TaskRanking, middle: float, low: float, high: float) -> str:
    """Return a torque with the range of 80 % of pairs, if there are enough; of a law that was stopped, a dash."""
    if not np.isfinite(middle):
        return EMPTY_CELL
    return f"{middle:.3g} ({low:.3g} to {high:.3g})" if task.has_interval else f"{middle:.3g}"


def _foreign_sections(tasks: Sequence[TaskRanking], board: Sequence[BoardEntry]) -> tuple[Section, ...]:
    """Return the section on foreign laws: those that were stopped, and the board of all runs of this folder."""
    if not board:
        return ()
    stopped = [
        Row((name.removeprefix("law:"), task.task, f"{one.pair + 1}", stopped_words(one.fault)))
        for task in tasks
        for name, tried in task.tried.items()
        if name.startswith("law:")
        for one in tried
        if one.fault != NO_FAULT
    ]
    rows = [
        Row((e.law, e.checksum[:12], e.task, f"{e.place} of {e.of}",
             EMPTY_CELL if e.share is None else f"{e.share:.3f}", _ratio_text(share_over_before(board, e)),
             str(e.pairs), str(e.seed), e.version))
        for e in sorted(board, key=lambda e: (e.task, e.law, e.version, e.seed))
    ]  # fmt: skip
    shares = ("torque over no power", "over the version before")
    heads = ("law", "file", "task", "place", *shares, "pairs", "seed", "pellucid")
    caption = "Every run of this folder; a changed file has another checksum. Versions are compared on the same pairs."
    tables = [number_table(heads, rows, caption, words=3)]
    counted = [
        Row((name.removeprefix("law:"), task.task, f"{tried[0].instructions:.0f}"))
        for task in tasks
        for name, tried in task.tried.items()
        if name.startswith("law:") and tried[0].instructions is not None
    ]
    if counted:
        caption = "Mean of a step on a Cortex-M4F in QEMU, of the law without its supervisor; doubles are in software."
        tables.append(number_table(("law", "task", "instructions"), counted, caption, words=2))
    if stopped:
        stopped_heads = ("law", "task", "pair", "why")
        caption = "Stopped by the supervisor or by the limits of its process."
        tables.insert(0, Table(stopped_heads, tuple(stopped), caption=caption))
    text = (
        "A foreign law is a stranger's code. It runs in a process of its own with limited time and memory, and what it "
        "asks for passes the supervisor that export puts around a law of this orthosis, with the same limits, encoders "
        "and spring. It wears the knee orthosis with the same people and the same noise as every other controller. It "
        "has no linear margins, because nothing is known of its form; whether it sways is tried like any other law's."
    )
    return (Section("foreign", "Foreign laws", (text,), tuple(tables)),)


def _ratio_text(ratio: float | None) -> str:
    return EMPTY_CELL if ratio is None else f"{ratio:.3f}"


def _median(name: str, text: str, scale: float = 1.0) -> Callable[[Sequence[ControllerTrial]], str]:
    def cell(tried: Sequence[ControllerTrial]) -> str:
        values = [v for one in tried if (v := getattr(one, name)) is not None and np.isfinite(v)]
        return format(scale * float(np.median(values)), text) if values else EMPTY_CELL

    return cell


def _extreme(name: str, text: str, of: Callable, scale: float = 1.0) -> Callable[[Sequence[ControllerTrial]], str]:
    def cell(tried: Sequence[ControllerTrial]) -> str:
        values = [v for one in tried if (v := getattr(one, name)) is not None]
        if not values:
            return EMPTY_CELL
        found = scale * of(values)
        return format(found, text) if np.isfinite(found) else "beyond search"

    return cell


def _holds(tried: Sequence[ControllerTrial]) -> str:
    found = [one.holds for one in tried if one.holds is not None]
    return ("no" if not all(found) else "yes") if found else EMPTY_CELL


def _faults(tried: Sequence[ControllerTrial]) -> str:
    return str(sum(one.fault != NO_FAULT for one in tried))


ENERGY_COLUMNS = (("given (mW)", _median("given", ".0f", 1e3)), ("taken (mW)", _median("taken", ".0f", 1e3)))
"""Heads and cells of the columns on power, for every task."""

COST_COLUMN = ("M4F instructions", _median("instructions", ".0f"))
"""Head and cells of the column on what a step of a foreign law in C costs on a Cortex-M4F."""

ELBOW_COLUMNS = (
    *ENERGY_COLUMNS,
    ("duration (%)", _median("duration", "+.0f")),
    ("peak velocity (%)", _median("peak_velocity", "+.0f")),
    ("EMG/Acc (%)", _median("emg", "+.0f")),
    ("certificate", certificate_words),
    ("worst fault (J)", _extreme("fault_energy", ".2g", max)),
    ("step (ns)", _median("cost", ".0f", 1e9)),
    COST_COLUMN,
    ("gates shut", _faults),
)
"""Heads and cells of all columns other than the torque, for the elbow."""

ELBOW_CAPTION = (
    "Duration, peak velocity and EMG over acceleration: change from no robot. Worst fault: the most energy that any "
    "single fault which a sensor can show gives the person until the robot is safe, over all pairs. Step: here. "
    "Certificate: whether mean duration and mean peak velocity of people are shown to lie within 10 % of those without "
    f"a robot; it takes {MIN_PEOPLE} people (--pairs {MIN_PEOPLE})."
)
"""Caption of the elbow's table."""

KNEE_COLUMNS = (
    *ENERGY_COLUMNS,
    ("gain margin (dB)", _extreme("gain", ".1f", min)),
    ("delay margin (ms)", _extreme("delay", ".0f", min, 1e3)),
    ("no sway", _holds),
    ("worst fault (J)", _extreme("fault_energy", ".2g", max)),
    COST_COLUMN,
    ("gates shut", _faults),
)
"""Heads and cells of all columns other than the torque, for the knee."""

KNEE_CAPTION = (
    "Margins: smallest over pairs, of the linear loop with the strap 30 % off. No sway: without a linear form, whether "
    "twice the command, or one 20 ms late, leaves a relaxed leg and a swing quiet; tried with two, if there are more. "
    "Worst fault: the most energy that any single fault which a sensor can show gives the person in swings until the "
    "robot is safe, over all pairs, behind the supervisor that an export has."
)
"""Caption of the knee's tables."""

ARM_COLUMNS = (
    *ENERGY_COLUMNS,
    ("off the motion (mrad)", _median("deviation", ".0f", 1e3)),
    ("worst fault (J)", _extreme("fault_energy", ".2g", max)),
    COST_COLUMN,
    ("gates shut", _faults),
)
"""Heads and cells of all columns other than the torque, for the arm."""

ARM_CAPTION = (
    "Torque: over the joints of the person. Off the motion: how far the joints are from where the person means them to "
    "be. Worst fault: as at the elbow, with two encoders and a measured drive at each joint; faults take the joints in "
    "turn."
)
"""Caption of the arm's table."""

ROBOT_COLUMNS = {
    "elbow": (ELBOW_COLUMNS, ELBOW_CAPTION), "knee": (KNEE_COLUMNS, KNEE_CAPTION), "arm": (ARM_COLUMNS, ARM_CAPTION)
}  # fmt: skip
"""Columns and caption of the second table of each robot."""


def _method_section() -> Section:
    """Return the section about the method of the ranking and its limits."""
    return Section(
        "how",
        "How it was done",
        (
            "Every robot is identified from its own virtual recordings, and every controller is built from what that "
            "found. Constants were chosen beforehand on other robots and other people by the torque alone, within the "
            "same margins. A person is the same under every controller and hears the same noise.",
            "The robots have drives, gears, straps and sensors that the models are not told of, but friction, inertia "
            "and gravity are of the same form in plant and model: what learns beyond the model has little to find "
            "here, and a machine that differs in form may reward it more. In walking the thigh stays where it is and "
            "the foot meets no ground.",
            f"The significance level is {100 * SIGNIFICANCE_LEVEL:g} %. Few pairs separate few controllers; --pairs "
            "sets a larger number.",
        ),
    )
