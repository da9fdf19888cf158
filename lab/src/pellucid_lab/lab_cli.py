"""Commands of the distribution `pellucid-lab`: virtual rigs and people, the demo, papers, and the ranking.

`pellucid.cli` finds `add_commands` as an entry point of ``pellucid.commands``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pellucid._printed_command import printed_command
from pellucid.study.procedures.command import DEPLOY_GROUP, LEARN_GROUP, PEOPLE_GROUP
from pellucid.study.terminal import (
    Json,
    count_of,
    example,
    exit_unless_answered,
    is_verbose,
    make_console,
    print_answer,
    print_items,
    print_json,
    print_line,
    print_lines,
    print_short_table,
    print_steps,
    show_progress,
)


def simulate(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with lab/rig.toml.")],
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of every random draw.")] = 1,
    controller: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Controller worn by simulated people, as export names it; repeatable."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a study.toml that was changed by hand.")
    ] = False,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to simulate on.")] = None,
) -> None:
    """Simulate the recordings of a virtual rig."""
    from pellucid.people.design_columns import cluster

    from .simulate import simulate as run

    with cluster(scheduler) as executor, show_progress() as tell:
        made = run(folder, seed, controllers=controller, overwrite=overwrite, executor=executor, on_progress=tell)
    out = make_console()
    times = made.joint_time / made.wall_time
    print_line(
        out,
        f"{folder}: study {made.study.name!r}, {count_of(made.recordings, 'recording')}, {made.joint_time:.0f} s of "
        f"motion in {made.wall_time:.1f} s ({times:.0f} times real time).",
    )
    print_line(out, f"Next: {printed_command('check', folder)}")


def predict(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Folders with lab/rig.toml; several models share the robots."),
    ],
    people: Annotated[int, typer.Option(metavar="N", min=1, help="Number of simulated people for each folder.")] = 12,
    robots: Annotated[int, typer.Option(metavar="N", min=1, help="Robots to draw.")] = 12,
    movements: Annotated[
        int, typer.Option(metavar="N", min=2, help="Movements of a person with each controller.")
    ] = 20,
    participants: Annotated[int, typer.Option(metavar="N", min=1, help="Participants in a study.")] = 6,
    controller: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Controller as export names it; repeatable.")
    ] = None,
    load: Annotated[
        tuple[float, float] | None, typer.Option(metavar="KG M", help="Load on the robot and its distance.")
    ] = None,
    held: Annotated[
        tuple[float, float] | None, typer.Option(metavar="KG M", help="Load in the hand and its distance.")
    ] = None,
    support: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Share of the forearm's weight that support carries.")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of every random draw.")] = 1,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to simulate on.")] = None,
    json: Json = False,
) -> None:
    """Predict an experiment with simulated people and robots."""
    from pellucid.people.design_columns import cluster
    from pellucid.study.procedures.print_result import print_result

    from .predict import PREDICTION_FILE
    from .predict import predict as run
    from .ranking.prediction_page import write_prediction_page

    with cluster(scheduler) as executor, show_progress() as tell:
        found = run(
            *folders, people=people, robots=robots, movements=movements, participants=participants,
            controllers=controller, load=load, held=held, support=support, seed=seed, executor=executor,
            on_progress=tell,
        )  # fmt: skip
        page = write_prediction_page(folders[0], found)
    if json:
        print_json(found)
    else:
        out = make_console()
        print_result(out, found, brief=not is_verbose())
        print_line(out, f"Every figure in {folders[0] / PREDICTION_FILE}. Page: {page}")
        print_line(out, f"Next: {found.answer.next_command}")
    exit_unless_answered([found.answer])


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the demo's studies.")] = Path("demo"),
) -> None:
    """Run the whole workflow on examples, in about a minute."""
    from .demonstration.demo import demo as run
    from .demonstration.story import chapter_sentences, demonstration_answer

    with show_progress() as tell:
        made = run(out, on_progress=tell)
    console, answer = make_console(), demonstration_answer(made)
    print_answer(console, answer)
    for chapter, said in chapter_sentences(made):
        console.print(f"\n{chapter}")
        print_items(console, [("good", said)])
    from pellucid.study.procedures.print_result import plain_table

    table = plain_table("residuals", ">repetitions", ">lowest coverage %", ">textbook intervals %")
    for c in made.coverages:
        table.add_row(c.colour, str(c.repetitions), f"{c.lowest:.1f}", f"{c.textbook:.1f}")
    print_line(console, "\nCoverage of 95 % intervals, with the true values of a virtual joint:")
    console.print(table)
    print_items(console, [("note", note) for note in made.notes])
    print_line(console, f"The story, with pictures and every report: {made.page}")
    print_steps(console, answer, 4)


def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="Published study: able, hill, knee.")],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the page and its files.")] = None,
) -> None:
    """Reproduce a published study, number by number."""
    from .papers.reproduce import reproduce as run

    with show_progress() as tell:
        made = run(paper, out or Path(f"reproduction-{paper}"), on_progress=tell)
    console = make_console()
    print_answer(console, made.answer)
    print_lines(console, made.lines, 40, "further figure")
    print_line(console, f"Page: {made.page}")
    print_steps(console, made.answer, 4)
    exit_unless_answered([made.answer])


def rank(
    pairs: Annotated[
        int, typer.Option(metavar="N", min=1, help="Pairs of a simulated person and a robot, for each task.")
    ] = 7,
    seed: Annotated[int, typer.Option(metavar="N", min=1, help="Seed of people, robots and noise.")] = 1,
    law: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Law of your own for knee, elbow or arm: .c, .so or .py; may be repeated."),
    ] = None,
    sealed: Annotated[
        bool, typer.Option("--sealed", help="Draw the seed after the laws were read, so that none was tuned on it.")
    ] = False,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to simulate on.")] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the page.")] = Path("ranking"),
) -> None:
    """Rank every controller, and laws of your own, on one page.

    The page ranks controllers of the elbow, the knee and an arm; your own laws are ranked with them.
    docs/how-to/bring-your-own-controller.md states a law's interface.
    """
    from pellucid.people.design_columns import cluster

    from .ranking.foreign_law import why_stopped
    from .ranking.rank import rank as run
    from .ranking.ranking_page import option_name
    from .ranking.strategies import controller_words

    with cluster(scheduler) as executor, show_progress() as tell:
        seed_asked = None if sealed else seed
        made = run(out, pairs=pairs, seed=seed_asked, laws=law or (), executor=executor, on_progress=tell)
    console, answer = make_console(), made.answer
    print_answer(console, answer)
    for task in made.tasks:
        low, middle, high = task.spread(task.torque)
        rows = [
            [
                option_name(name),
                controller_words(task.task, name),
                f"{task.ranks[i]:.1f}",
                f"{middle[i]:.3g}",
                f"{low[i]:.3g} to {high[i]:.3g}" if task.has_interval else "",
            ]
            for i, name in enumerate(task.controllers)
        ]
        print_line(console, "")
        heads = (task.task, "strategy", "mean rank", "torque (N·m)", "80 % of pairs")
        print_short_table(console, heads, rows, 32 // len(made.tasks))
    stopped = [
        f"{controller_words(task.task, name)}, {task.task}: stopped: {', '.join(why)}"
        for task in made.tasks
        for name in (each.name for each in made.laws if each.name in task.tried)
        if (why := why_stopped(one.fault for one in task.tried[name]))
    ]
    print_lines(console, stopped, 6, "further law")
    if sealed:
        print_line(console, f"The seed was {made.seed}.")
    print_line(console, f"Page: {made.page}")
    print_line(console, f"Next: {answer.next_command}")
    exit_unless_answered([answer])


def add_commands(app: typer.Typer) -> None:
    """Add the commands of this distribution to the command line."""
    for command, group, line in (
        (simulate, LEARN_GROUP, "pellucid simulate my-rig --seed 2"),
        (predict, PEOPLE_GROUP, "pellucid predict my-rig --people 12 --robots 12"),
        (demo, LEARN_GROUP, "pellucid demo --out demo"),
        (reproduce, LEARN_GROUP, "pellucid reproduce knee --out knee"),
        (rank, DEPLOY_GROUP, "pellucid rank --law my_law.py"),
    ):
        app.command(rich_help_panel=group, epilog=example(line))(command)
