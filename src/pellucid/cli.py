"""The command line. Each command parses its arguments, calls the Python function of its name, and prints the result.

Large modules are imported only when a command runs, so that ``pellucid --help`` answers at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from ._domains import missing_domain
from ._errors import PellucidError, UnfitRecordingError
from ._plugins import load_plugins
from ._printed_command import printed_command
from .study.procedures.command import (
    DEPLOY_GROUP,
    DESCRIBE_GROUP,
    IDENTIFY_GROUP,
    LEARN_GROUP,
    PEOPLE_GROUP,
    Command,
)
from .study.procedures.procedure import procedure_commands
from .study.terminal import (
    MAX_ITEM_LINES_UNLESS_VERBOSE,
    CommandGroup,
    Json,
    count_of,
    example,
    exit_unless_answered,
    exit_with_message,
    is_verbose,
    make_console,
    print_answer,
    print_items,
    print_json,
    print_line,
    print_lines,
    print_next,
    print_short_table,
    print_steps,
    print_wrapped,
    replace_unprintable_characters,
    set_quiet,
    set_verbose,
    show_progress,
)

if TYPE_CHECKING:
    from .files.fault import Fault
    from .study.answer import Answer
    from .study.procedures.audit import Audit
    from .study.procedures.result import Result
    from .study.study import Study

app = typer.Typer(
    name="pellucid",
    cls=CommandGroup,
    help="From recordings of a robot to its model, its controllers and their C.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
datasets_app = typer.Typer(
    name="datasets", cls=CommandGroup, help="List or fetch public recordings of real machines.", rich_markup_mode=None,
    no_args_is_help=True, epilog=example("pellucid datasets list"),
    context_settings={"help_option_names": ["-h", "--help"]},
)  # fmt: skip
app.add_typer(datasets_app, rich_help_panel=LEARN_GROUP)
emg_app = typer.Typer(
    name="emg", cls=CommandGroup, help="Quality, onset, cocontraction, synergies and force of EMG.",
    rich_markup_mode=None, no_args_is_help=True, epilog=example("pellucid emg onset my-study"),
    context_settings={"help_option_names": ["-h", "--help"]},
)  # fmt: skip

MAX_TERMS_LENGTH = 16
"""Largest number of characters of a data set's terms in a list of one line for each."""

MAX_PROPOSAL_LINES = 24
"""Largest number of lines on a proposed study without ``-v``."""

MAX_ASSUMPTION_LINES = 12
"""Largest number of lines on what a tried log assumes without ``-v``."""

MAX_TRIED_WARNING_LINES = 10
"""Largest number of lines of warnings on a tried log without ``-v``."""

MAX_PROPOSAL_CHECK_LINES = 14
"""Largest number of lines of the check of a proposed study without ``-v``, which stands below the proposal."""

MALLOC_PARAMETERS = {"M_MMAP_THRESHOLD": (-3, 1 << 26), "M_TRIM_THRESHOLD": (-1, 1 << 27)}
"""Parameters of ``mallopt`` by name: number in ``malloc.h``, and size up to which freed memory is kept [B]."""

Answer = Annotated[
    list[str] | None,
    typer.Option("--answer", metavar="KEY=VALUE", help="Answer to a question about the files, by its key; repeatable."),
]
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the study.")]
Outside = Annotated[
    bool, typer.Option("--allow-outside", help="Files that it names or links to may lie outside its folder.")
]
Stale = Annotated[
    bool,
    typer.Option("--accept-stale", help="Use cards that were made from an earlier state of the study."),
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder to write to, instead of the study's own.")
]
Family = Annotated[
    list[str] | None,
    typer.Option("--family", metavar="NAME", help="Friction family; may be given several times."),
]


@app.command(rich_help_panel=DESCRIBE_GROUP, epilog=example("pellucid init my-elbow --from recordings/*.csv"))
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to create.")],
    dataset: Annotated[str | None, typer.Option(metavar="NAME", help="Public data set to fill it from.")] = None,
    rig: Annotated[str | None, typer.Option(metavar="NAME", help="Virtual rig to fill it from.")] = None,
    urdf: Annotated[Path | None, typer.Option(metavar="FILE", help="Robot with several joints to study.")] = None,
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILES...]", help="Further files after --from.", show_default=False)
    ] = None,
    from_: Annotated[
        list[Path] | None,
        typer.Option("--from", metavar="FILES...", help="Recordings of your own, or folders of them."),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Take every question's default, and mark it in study.toml.")
    ] = False,
    answer: Answer = None,
    session: Annotated[
        str | None, typer.Option(metavar="NAME", help="Live session to plan: elbow, knee, able-elbow, knee-orthosis.")
    ] = None,
) -> None:
    """Start a study: recordings, and a study.toml about them."""
    from .start_study import init as run

    if from_:
        others = {"dataset": dataset, "rig": rig, "session": session, "urdf": urdf}
        _init_from(folder, [*from_, *(files or [])], others, yes=yes, answer=answer or [])
        return
    if files or yes or answer:
        raise PellucidError("init: found files or answers without --from, expected init DIR --from FILES")
    made = run(folder, dataset=dataset, rig=rig, urdf=urdf, session=session, progress=sys.stderr.isatty())
    out = make_console()
    if session is not None:
        print_line(out, f"{made}: the session {session}, to be run as it is or edited.")
        print_line(out, f"Next: {printed_command('live', folder)}")
        return
    if urdf is not None:
        print_line(out, f"{made}: the joints of {urdf.name}. Put recordings into {folder / 'recordings'},")
        print_line(out, f"and say in study.toml what their columns mean. Next: {printed_command('check', folder)}")
        return
    if isinstance(made, Path):
        print_line(out, f"{made}: the rig {rig}, to be used as it is or edited.")
        print_line(out, f"Next: {printed_command('simulate', folder)}")
        return
    study = cast("Study", made)  # own files were proposed above
    print_line(out, f"{folder}: study {study.name!r}, {count_of(len(study.recordings()), 'recording')}.")
    print_items(out, [("note", note) for note in study.notes])
    print_line(out, f"study.toml says what they mean. Next: {printed_command('check', folder)}")


def _init_from(folder: Path, files: list[Path], others: dict[str, Any], *, yes: bool, answer: list[str]) -> None:
    """Propose a study for files, ask what they cannot tell unless `yes`, and print what `check` found in it."""
    from .start.init_from_files import ProposedStudy, proposal_lines
    from .start.proposal import Question
    from .start_study import init as run

    out = make_console()

    def ask(question: Question) -> str:
        print_line(out, f"{question.text} It decides {question.consequence}.")
        if question.choices:
            print_line(out, f"such as: {', '.join(question.choices)}")
        return typer.prompt(question.key, default=question.default)

    answers = _answers_of("init", answer)
    with show_progress() as tell:
        tell("reading files", 0.1)
        asking = None if yes or not sys.stdin.isatty() else ask
        made = cast("ProposedStudy", run(folder, files=files, answers=answers, ask=asking, **others))
    *lines, last = proposal_lines(made)
    print_lines(out, lines, MAX_PROPOSAL_LINES, "further line")
    print_line(out, last)
    _print_check(_opened(folder, None, False), made.faults, MAX_PROPOSAL_CHECK_LINES)


def _answers_of(command: str, given: Sequence[str]) -> dict[str, str]:
    """Return the answers of options KEY=VALUE by their keys."""
    answers = {}
    for text in given:
        key, equals, value = text.partition("=")
        if not equals:
            raise PellucidError(f'{command}: found --answer "{text}", expected KEY=VALUE, such as "rate=1 kHz"')
        answers[key.strip()] = value.strip()
    return answers


@app.command("try", rich_help_panel=DESCRIBE_GROUP, epilog=example("pellucid try recordings/*.csv"))
def try_files(
    files: Annotated[list[Path], typer.Argument(metavar="FILES...", help="Recordings, or folders of them.")],
    urdf: Annotated[Path | None, typer.Option(metavar="FILE", help="Robot with the joints of the recordings.")] = None,
    answer: Answer = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="New folder for the page, instead of a temporary one.")
    ] = None,
    json: Json = False,
) -> None:
    """Identify a log at once, with every default, on one page."""
    from dataclasses import replace

    from .start.try_lines import tried_lines, try_table
    from .start.try_log import try_log

    with show_progress() as tell:
        tried = try_log(files, answers=_answers_of("try", answer or []), urdf=urdf, out=out, on_progress=tell)
    if json:
        _echo_json(try_table(tried))
    else:
        console = make_console()
        before, (heads, rows), after = tried_lines(tried)
        for text in before:
            print_wrapped(console, text)
        if rows:
            print_short_table(console, heads, rows)
        print_lines(console, after, MAX_ASSUMPTION_LINES, "further assumption")
        told = [v for v in tried.verdicts if v.kind in ("wrong", "warning") or is_verbose()]
        worst = [(v.kind, v.said.replace("`", "")) for v in told]
        print_items(console, worst, MAX_TRIED_WARNING_LINES)
        print_line(console, f"Page: {tried.page}")
        print_steps(console, replace(tried.answer, next=tuple(s for s in tried.answer.next if not s.command)))
        print_line(console, f"Next: {tried.answer.next_command}")
    exit_unless_answered([tried.answer])


@app.command(rich_help_panel=DESCRIBE_GROUP, epilog=example("pellucid check my-elbow"))
def check(folder: Folder, json: Json = False, allow_outside: Outside = False) -> None:
    """Check recordings before identification; status 1 if unfit."""
    from .study.procedures.run import check as run

    study = _opened(folder, None, allow_outside)
    with show_progress() as tell:
        faults = run(study, on_progress=tell)
    _print_check(study, faults, MAX_ITEM_LINES_UNLESS_VERBOSE, json=json)


def _print_check(study: Study, faults: Sequence[Fault], max_lines: int, *, json: bool = False) -> None:
    """Print whether a study's recordings can be used, and what was found in at most `max_lines` lines unless ``-v``
    asks for all; exit with status 1 if they cannot, as the command that uses them would."""
    from dataclasses import asdict

    from .files.fault import grouped_messages
    from .study.procedures.check_answer import check_answer

    answer = check_answer(study, faults)
    if json:
        _echo_json({"answer": answer.table(), "faults": [asdict(fault) for fault in faults]})
    else:
        out = make_console()
        print_answer(out, answer)
        of_severity = {severity: [f for f in faults if f.severity == severity] for severity in ("refuse", "warn")}
        noted = [fault for fault in faults if fault.severity not in of_severity]
        warnings = [("warning", text) for some in of_severity.values() for text in grouped_messages(some)]
        print_items(out, [*warnings, *(("note", text) for text in grouped_messages(noted))], max_lines)
        if answer.next_command:
            print_line(out, f"Next: {answer.next_command}")
        else:
            print_steps(out, answer)
    if answer.verdict == "no":
        raise typer.Exit(1)


@app.command(rich_help_panel=IDENTIFY_GROUP, epilog=example("pellucid identify my-elbow"))
def identify(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders of studies; several give a table.")],
    family: Family = None,
    json: Json = False,
    out: Out = None,
    allow_outside: Outside = False,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers process the studies.")
    ] = None,
) -> None:
    """Identify what study.toml asks for, with intervals."""
    from .study.procedures.run import identify as run

    if len(folders) > 1 or scheduler:
        if json or out:
            raise PellucidError(
                "identify: found several studies, expected one with --json and --out: identify each study by itself"
            )
        _several(folders, family or None, allow_outside, scheduler)
        return
    study = _opened(folders[0], out, allow_outside)
    _run_and_save(study, "identify", json, lambda study, tell: run(study, families=family or None, on_progress=tell))


def _several(folders: list[Path], families: list[str] | None, allow_outside: bool, scheduler: str | None) -> None:
    """Identify several studies in parallel, and print one table of all; exit with status 1 where one alone would."""
    from .people.design_columns import cluster
    from .study.procedures.run import identify_several, table_of

    with cluster(scheduler) as executor, show_progress() as tell:
        found = identify_several(
            folders, families=families, allow_outside=allow_outside, executor=executor, on_progress=tell
        )
    console = make_console()
    print_short_table(console, *table_of(found))
    print_items(console, [("good", f"{each.study}: {each.headline}") for each in found if not each.failure], 16)
    failed = [("warning", f"{each.folder}: {each.failure or each.flaw}") for each in found if each.failure or each.flaw]
    print_items(console, failed)
    if failed:
        raise typer.Exit(1)


def _print_version(asked: bool) -> None:
    """Print the version and end, if it was asked for."""
    if asked:
        from . import __version__

        typer.echo(f"pellucid {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version, and exit.")
    ] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", callback=set_quiet, expose_value=False, hidden=True)] = False,
    verbose: Annotated[
        bool, typer.Option("-v", "--verbose", callback=set_verbose, expose_value=False, hidden=True)
    ] = False,
) -> None:
    """Take the options that come before a command."""


def _add_command(command: Command) -> None:
    """Add a command that runs procedures on one study, as their folder describes it."""

    def found(folder: Path, json: bool, out: Path | None, allow_outside: bool, accept_stale: bool = False) -> None:
        from .study.procedures.run import run

        study = _opened(folder, out, allow_outside, accept_stale)
        _run_and_save(study, command.name, json, lambda study, tell: run(study, command.name, on_progress=tell))

    def plain(folder: Folder, json: Json = False, out: Out = None, allow_outside: Outside = False) -> None:
        found(folder, json, out, allow_outside)

    def reading_cards(
        folder: Folder, json: Json = False, out: Out = None, allow_outside: Outside = False, accept_stale: Stale = False
    ) -> None:
        found(folder, json, out, allow_outside, accept_stale)

    *group, word = command.words
    line = example(f"pellucid {' '.join(command.words)} my-study")
    run_it = reading_cards if command.reads_cards else plain
    # A command of a group keeps its own name, unlisted.
    app.command(
        command.name, help=command.help, rich_help_panel=command.group, epilog=line, hidden=bool(group)
    )(run_it)  # fmt: skip
    if group == [emg_app.info.name]:
        emg_app.command(word, help=command.help, rich_help_panel=command.group, epilog=line)(run_it)


for _command in procedure_commands():
    _add_command(_command)
if emg_app.registered_commands:
    app.add_typer(emg_app, rich_help_panel=PEOPLE_GROUP)


@app.command("help", hidden=True, epilog=example("pellucid help identify"))
def help_of(
    ctx: typer.Context, words: Annotated[list[str] | None, typer.Argument(metavar="[COMMAND]")] = None
) -> None:
    """Print what a command does, as its own --help does."""
    context = ctx.find_root()
    for word in words or ():
        group: Any = context.command
        command = group.get_command(context, word) if hasattr(group, "get_command") else None
        if command is None:
            context.fail(f"No such command '{word}'.")
        context = type(ctx)(command, info_name=word, parent=context)
    typer.echo(context.get_help())


@app.command(rich_help_panel=PEOPLE_GROUP, epilog=example("pellucid assess my-people"))
def assess(
    folder: Folder,
    json: Json = False,
    studies: Annotated[
        int, typer.Option(metavar="N", min=100, help="Studies to simulate for the plan of the next one.")
    ] = 1000,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to simulate on.")] = None,
    out: Out = None,
    allow_outside: Outside = False,
) -> None:
    """Test whether conditions change how people move."""
    from .people.design_columns import cluster
    from .study.procedures.run import run

    study = _opened(folder, out, allow_outside)
    with cluster(scheduler) as executor:
        asked = {"studies": studies, "executor": executor}
        _run_and_save(
            study, "assess", json, lambda study, tell: run(study, "assess", on_progress=tell, assessment=asked)
        )


@app.command(rich_help_panel=PEOPLE_GROUP, epilog=example("pellucid plan my-people --participants 16"))
def plan(
    folder: Folder,
    participants: Annotated[
        int | None, typer.Option(metavar="N", min=2, help="Number decided on: refused if it can certify nothing.")
    ] = None,
    pilot: Annotated[
        Path | None, typer.Option(metavar="STUDY", help="Assessed pilot study from whose people studies are drawn.")
    ] = None,
    power: Annotated[
        float, typer.Option(metavar="P", min=0.5, max=0.999, help="Share of studies that should show it (power).")
    ] = 0.9,
    studies: Annotated[
        int, typer.Option(metavar="N", min=100, help="Studies to simulate for each number of people.")
    ] = 2000,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to simulate on.")] = None,
    allow_outside: Outside = False,
) -> None:
    """Plan people for a certificate, and register its analysis.

    The analysis is written to analysis.toml. A certificate under another one is called post hoc.
    """
    from .people.design_columns import cluster
    from .people.study.plan import pilot_changes
    from .people.study.plan import plan as run
    from .people.study.registered import register

    study, console = _opened(folder, None, allow_outside), make_console()
    with cluster(scheduler) as executor, show_progress() as tell:
        people, noise = (None, None) if pilot is None else pilot_changes(_opened(pilot, None, allow_outside))
        found = run(
            study, power=power, participants=participants, pilot=people, noise_shares=noise, studies=studies,
            executor=executor, on_progress=tell,
        )  # fmt: skip
    answer = found.answer.in_folder(folder)
    print_answer(console, answer)
    print_line(console, found.title)
    rows = [["" if cell is None else str(cell) for cell in row] for row in found.rows]
    print_short_table(console, found.heads, rows, 30)
    print_line(console, found.note)
    print_line(console, register(study))
    print_steps(console, answer)


@app.command(rich_help_panel=PEOPLE_GROUP, epilog=example("pellucid certificate my-people"))
def certificate(folder: Folder, out: Out = None, allow_outside: Outside = False) -> None:
    """Write a certificate's page for a reviewer.

    The page lists protocol, margins, assumptions, exclusions and checksums.
    """
    from .people.study.assessment_answer import reviewed_answer
    from .people.study.assessment_page import write_certificate_of
    from .people.study.assessment_result import kept_certificates

    study = _opened(folder, out, allow_outside)
    with show_progress() as tell:
        found = kept_certificates(study, "margins to certify", tell)
        page = write_certificate_of(study, found)
    console = make_console()
    answer = reviewed_answer(found)
    print_answer(console, answer)
    print_steps(console, answer)
    print_line(console, f"Certificate: {page}")
    exit_unless_answered([answer])


@app.command(rich_help_panel=PEOPLE_GROUP, epilog=example("pellucid live my-session"))
def live(
    folder: Folder,
    participant: Annotated[
        str | None, typer.Option(metavar="NAME", help="Who takes part; else the first with trials to do.")
    ] = None,
    port: Annotated[int, typer.Option(metavar="N", min=0, max=65535, help="Port of the pages; 0: a free one.")] = 0,
    unattended: Annotated[
        bool, typer.Option("--unattended", help="Give consent, starts and verdicts without a person; virtual alone.")
    ] = False,
    browser: Annotated[bool, typer.Option(help="Open the operator's page in a browser.")] = True,
    replay: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Compute a session.xdf again, or hold a log against the supervisor."),
    ] = None,
) -> None:
    """Run the session with a person that study.toml plans."""
    out = make_console()
    if replay is not None:
        from .live.session.recorded_trial import replay_file

        answer = replay_file(_opened(folder, None, False), replay)
        for line in answer.lines:
            print_line(out, line)
        if not answer.is_equal:
            raise SystemExit(1)
        return
    from .live.session.page_server import PageServer
    from .live.session.run_session import live as run

    def show(server: PageServer) -> None:
        print_line(out, "The robot's engine runs.")
        print_line(out, f"Operator:    {server.address('operator')}")
        print_line(out, f"Participant: {server.address('participant')}")
        print_line(out, "Both pages are for this computer alone. Ctrl-C ends the session; recordings stay.")

    found = run(
        folder, participant=participant, port=port, unattended=unattended, open_pages=browser and not unattended,
        on_ready=show, show_evaluation=show_progress,
    )  # fmt: skip
    for note in found.notes:
        print_line(out, note)  # a note may end in a command, which no line may break
    recorded = f"{found.done} of {found.planned} trials are recorded"
    print_line(out, f"The session is finished. {found.participant}: {recorded}.")
    if found.report is not None:
        print_line(out, f"Report: {found.report}")


@app.command(rich_help_panel=IDENTIFY_GROUP, epilog=example("pellucid report my-elbow"))
def report(
    folder: Folder, out: Out = None, allow_outside: Outside = False, accept_stale: Stale = False,
    with_pdf: Annotated[bool, typer.Option("--pdf", help="Write each figure as PDF too.")] = False,
) -> None:  # fmt: skip
    """Write the report: one HTML page, and its figures as SVG.

    It draws and prints what other commands have found and kept, and says how to make what is missing.
    """
    from .study.drawn_report import ReportPlace

    place = ReportPlace(folder, out=out, allow_outside=allow_outside)
    lines, is_elsewhere = () if accept_stale else place.drawn_lines(with_pdf=with_pdf), False
    if not lines:
        from .study.procedures.run import write_report as run

        study = _opened(folder, out, allow_outside, accept_stale)
        with show_progress() as tell:
            made = run(study, only_kept=True, on_progress=tell, with_pdf=with_pdf)
        lines, is_elsewhere = made.lines, made.page.parent != place.report_dir
        if not accept_stale:
            place.note_drawn(made.page, lines, study.files(), with_pdf=with_pdf)
    console = make_console()
    for line in lines:
        print_line(console, line)
    if is_elsewhere:
        exit_with_message(f"{place.report_dir} could not be written; the report is elsewhere", 1)


@app.command(rich_help_panel=IDENTIFY_GROUP, epilog=example("pellucid paper my-elbow"))
def paper(folder: Folder, out: Out = None, allow_outside: Outside = False, accept_stale: Stale = False) -> None:
    """Write figures, LaTeX tables and text for a paper.

    The text is a methods paragraph with its references.
    """
    from .people.study.paper import write_paper_of

    study = _opened(folder, out, allow_outside, accept_stale)
    with show_progress() as tell:
        made, results = write_paper_of(study, on_progress=tell)
    console = make_console()
    for result in results:
        print_answer(console, result.answer)
    print_line(console, f"For a paper: {made}; main.tex shows how the parts are used")


@app.command(rich_help_panel=IDENTIFY_GROUP, epilog=example("pellucid compare in-spring in-autumn"))
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="Study that was identified, or model card.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The later one.")],
    family: Annotated[str | None, typer.Option(metavar="NAME", help="Friction family to compare.")] = None,
    allow_outside: Outside = False,
    accept_stale: Stale = False,
) -> None:
    """Compare the parameters of a joint in two studies."""
    from .study.pages.quantities import number, unit_text
    from .study.procedures.compare import compare as run

    found = run(a, b, family=family, allow_outside=allow_outside, accept_stale=accept_stale)
    rows = [
        (
            row.name,
            number(row.a, row.standard_error),
            number(row.b, row.standard_error),
            number(row.b - row.a, row.standard_error),
            unit_text(row.unit),
            "<0.001" if row.p_value < 1e-3 else f"{row.p_value:.3f}",
            "changed" if row.changed else "",
        )
        for row in found.rows
    ]
    out = make_console()
    print_answer(out, found.answer)
    print_line(out, f"A is {a}, B is {b}; {found.family} friction.")
    print_short_table(out, ("parameter", ">A", ">B", ">B − A", "unit", ">p", ""), rows, 24)
    print_line(out, f"Next: {found.answer.next_command}")
    exit_unless_answered([found.answer])


@app.command(rich_help_panel=DEPLOY_GROUP, epilog=example("pellucid export my-elbow --out controller"))
def export(
    folder: Folder,
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="c; fmu; ros2_control; mjcf, urdf, mjx, isaaclab for simulators; osim, ceinms for muscles.",
        ),
    ] = "c",
    out: Annotated[Path | None, typer.Option("--out", metavar="PLACE", help="Folder or file to create.")] = None,
    fmi: Annotated[int | None, typer.Option(metavar="VERSION", help="FMI version of an fmu: 3 (default) or 2.")] = None,
    participant: Annotated[str | None, typer.Option(metavar="NAME", help="Wearer of the robot.")] = None,
    card: Annotated[str | None, typer.Option(metavar="FILE", help="Card in models/, of a joint or muscles.")] = None,
    slider: Annotated[float | None, typer.Option(metavar="M", help="Position of the carriage [m].")] = None,
    controller: Annotated[
        str | None, typer.Option(metavar="NAME", help="For a carriage: fc, transparent, force_sensor ...")
    ] = None,
    exponents: Annotated[
        tuple[float, float] | None, typer.Option(metavar="UP DOWN", help="Exponents of fc and pcfr.")
    ] = None,
    load: Annotated[
        tuple[float, float] | None, typer.Option(metavar="KG M", help="Load on the robot and its distance.")
    ] = None,
    held: Annotated[
        tuple[float, float] | None, typer.Option(metavar="KG M", help="Load in the hand and its distance.")
    ] = None,
    period: Annotated[float | None, typer.Option(metavar="S", help="Period of the controller [s].")] = None,
    probe: Annotated[
        bool | None,
        typer.Option(
            "--probe/--no-probe", help="Test drive and encoder by waves of effort; usual if the drive is not measured."
        ),
    ] = None,
    unmeasured: Annotated[
        bool, typer.Option("--unmeasured", help="Accept a drive that is neither measured nor asked.")
    ] = False,
    allow_outside: Outside = False,
    accept_stale: Stale = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files that this export did not write.")
    ] = False,
) -> None:
    """Write the controller as C, a simulator's model, or muscles."""
    from .controllers.export.export import export as run
    from .controllers.export.export_answer import export_answer, save_answer
    from .controllers.export.microcontroller import measure, missing_tools, save_measured

    study = _opened(folder, None, allow_outside)
    in_c = to == "c"
    with show_progress() as tell:
        tell("building the controller", 0.1)
        asked: dict[str, Any] = {"participant": participant, "card": card, "slider": slider, "controller": controller}
        made = run(
            study, to, out, **asked, exponents=exponents, load=load, held=held, period=period, probe=probe,
            unmeasured=unmeasured, fmi=fmi,
            allow_outside=allow_outside, accept_stale=accept_stale, overwrite=overwrite,
        )  # fmt: skip
        absent = missing_tools()
        if in_c:
            tell("running it on a Cortex-M4F in QEMU", 0.7)
        found = measure(made) if in_c and not absent else None
    console = make_console()
    answer = export_answer(study, to, made, card=card, measured=found)
    print_answer(console, answer)
    if in_c and found is None:
        print_wrapped(console, f"Not run on a Cortex-M4F: {', '.join(absent)} not installed.")
    elif found is not None:
        print_line(console, f"On a Cortex-M4F in QEMU: {found.text}.")
    try:
        if found is not None:
            save_measured(study, made, found, controller=controller)
        save_answer(study, to, answer)
    except (OSError, PellucidError) as error:
        print_line(console, f"Not noted in {study.results_path}: {error}.")
    if answer.next_command:
        print_line(console, f"{made}: read README.md there.")
        print_line(console, f"Next: {answer.next_command}")
    else:
        print_steps(console, answer)


@app.command(rich_help_panel=DEPLOY_GROUP, epilog=example("pellucid commission my-elbow --log start*.csv"))
def commission(
    folder: Folder,
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILES...]", help="Further files after --log.", show_default=False)
    ] = None,
    log: Annotated[
        list[Path] | None,
        typer.Option(
            "--log", metavar="FILES...", help="Logs of starts: time, position, effort. Nobody wears the robot."
        ),
    ] = None,
    worn: Annotated[
        list[Path] | None,
        typer.Option("--worn", metavar="FILE", help="The same on a wearer at ease, after --log; repeatable."),
    ] = None,
    udp: Annotated[
        str | None, typer.Option("--udp", metavar="HOST:PORT", help="Listen there for the robot, and start it.")
    ] = None,
    controller: Annotated[
        str | None, typer.Option(metavar="NAME", help="The controller that will be exported.")
    ] = None,
    participant: Annotated[str | None, typer.Option(metavar="NAME", help="Wearer of the robot.")] = None,
    slider: Annotated[float | None, typer.Option(metavar="M", help="Position of the carriage [m].")] = None,
    period: Annotated[float | None, typer.Option(metavar="S", help="Period of the controller [s].")] = None,
    wearer: Annotated[
        bool, typer.Option("--wearer/--no-wearer", help="Whether somebody wears the robot for the answers.")
    ] = True,
    gain_checked: Annotated[
        bool, typer.Option("--gain-checked", help="You checked the gain by hand, if the starts do not show it.")
    ] = False,
    allow_outside: Outside = False,
    accept_stale: Stale = False,
) -> None:
    """Measure the drive of the empty robot, then with a wearer."""
    from contextlib import nullcontext

    from .controllers.study.commission import commission as run
    from .live.udp_robot import UdpRobot

    study = _opened(folder, None, allow_outside, accept_stale)
    if (log or files or worn) and udp:
        raise PellucidError("commission: found --log and --udp, expected one of them")
    with show_progress() as tell, UdpRobot(udp) if udp else nullcontext() as robot:
        tell("starting the robot" if not (log or files) else "reading the starts", 0.2)
        done = run(
            study, logs=[*(log or []), *(files or [])], worn_logs=worn or [], robot=robot, controller=controller,
            participant=participant, slider=slider, period=period, wearer=wearer, gain_checked=gain_checked,
            ask=lambda text: typer.prompt(text, default="", show_default=False),
        )  # fmt: skip
    console = make_console()
    print_answer(console, done.answer)
    for line in done.lines():
        print_wrapped(console, line)
    print_line(console, f"Next: {done.answer.next_command or done.answer.next[0].text}")
    if done.problem:
        exit_with_message(done.problem, 1)
    if done.answer.verdict == "no" or done.is_undecided:
        raise typer.Exit(1)


@app.command(rich_help_panel=DEPLOY_GROUP, epilog=example("pellucid incident incident.bin"))
def incident(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File that the recorder of a controller wrote.")],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the page.")] = None,
    json: Json = False,
) -> None:
    """Say why a controller stopped, from its record."""
    from .controllers.study.incident import NEAREST_WATCH_COUNT, account_table
    from .controllers.study.incident import incident as run
    from .controllers.study.incident_page import write_incident_page

    found = run(file)
    page = write_incident_page(found, file.with_name(f"{file.stem}-page") if out is None else out)
    if json:
        _echo_json(account_table(found))
        return
    console = make_console()
    answer = found.answer
    print_answer(console, answer)
    print_items(console, [each for each in found.sentences if each[1] != answer.said], 16)
    print_short_table(console, *found.watch_table(NEAREST_WATCH_COUNT))
    print_line(console, f"Page: {page}")
    if answer.next_command:
        print_line(console, f"Next: {answer.next_command}")
    exit_unless_answered([answer])


@app.command(rich_help_panel=DESCRIBE_GROUP, epilog=example("pellucid repair trial.xdf --out whole.xdf"))
def repair(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="XDF file whose recorder was stopped.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="File to write, instead of the file itself.")
    ] = None,
) -> None:
    """Make a recording that ends badly a whole file."""
    from .files.repair import repair as run

    print_line(make_console(), run(file, out).line())


@app.command(rich_help_panel=DESCRIBE_GROUP, epilog=example("pellucid audit logs/*.csv"))
def audit(
    files: Annotated[list[Path], typer.Argument(metavar="FILES...", help="Logs of any format, or folders of them.")],
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", min=0, help="Sampling rate of files without a column of time.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the page.", show_default=True)] = Path(
        "audit-page"
    ),
    json: Json = False,
) -> None:
    """Judge each channel of any log."""
    from .study.procedures.audit import audit as run
    from .study.procedures.audit_page import write_audit_page

    _show_audit(lambda tell: run(files, rate=rate, on_progress=tell), write_audit_page, out, json)


@emg_app.command("quality", rich_help_panel=PEOPLE_GROUP, epilog=example("pellucid emg quality recordings/*.c3d"))
def emg_quality(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILES...", help="Files of any format, folders of them, or studies.")
    ],
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", min=0, help="Sampling rate of files without a column of time.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the page.", show_default=True)] = Path(
        "emg-quality-page"
    ),
    json: Json = False,
) -> None:
    """Judge each channel of EMG."""
    from .emg.study.emg_files import audit_emg
    from .study.procedures.audit_page import write_audit_page

    _show_audit(lambda tell: audit_emg(files, rate=rate, on_progress=tell), write_audit_page, out, json)


def _show_audit(
    run: Callable[[Callable], Audit], write_page: Callable[[Audit, Path], Path], out: Path, json: bool
) -> None:
    """Run an audit, write its page and print it."""
    from .study.pages.quantities import typeset_quantities

    with show_progress() as tell:
        found = run(tell)
        page = write_page(found, out)
    if json:
        _echo_json(found.table())
    else:
        console = make_console()
        print_answer(console, found.answer)
        rows = [(v.channel, v.holds, v.verdict) for v in found.verdicts]
        print_short_table(console, ("channel", "holds", "verdict"), rows)
        said = [
            ("warning" if level == "alarm" else "note", f"{v.channel}: {typeset_quantities(text)}")
            for v in found.verdicts
            for level, text in v.said
        ]
        unread = [("wrong", file.unread) for file in found.unread]
        print_items(console, [*unread, *sorted(said, key=lambda item: item[0] == "note")], 18)
        print_steps(console, found.answer, 8)
        print_line(console, f"Page: {page}")
    exit_unless_answered([found.answer])


@app.command(
    rich_help_panel=DESCRIBE_GROUP,
    epilog=example(
        "pellucid protocol random_phase_multisine motion --rate 1000 --low 0.2 --high 8 --resolution 0.1 --rms 0.2"
    ),
)
def protocol(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="Motion: random_phase_multisine or reversals; of all joints: optimised_fourier or step_by_step.",
        ),
    ],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for its files.")],
    rate: Annotated[float, typer.Option(metavar="HZ", help="Rate of the controller's references.")],
    low: Annotated[float | None, typer.Option(metavar="HZ", help="Lower end of the multisine's band.")] = None,
    high: Annotated[float | None, typer.Option(metavar="HZ", help="Upper end of its band.")] = None,
    resolution: Annotated[float | None, typer.Option(metavar="HZ", help="One over its period.")] = None,
    study: Annotated[
        Path | None, typer.Option(metavar="STUDY", help="Study whose joints move, within their limits.")
    ] = None,
    criterion: Annotated[str, typer.Option(metavar="D|A", help="Criterion of an optimised motion.")] = "D",
    harmonics: Annotated[int, typer.Option(metavar="N", min=2, help="Harmonics of an optimised motion.")] = 5,
    acceleration: Annotated[
        float | None, typer.Option(metavar="SIZE", min=0, help="Limit of every joint of a study, SI.")
    ] = None,
    radius: Annotated[
        float, typer.Option(metavar="M", min=0, help="Radius of links, which must not touch; 0: no check.")
    ] = 0.05,
    rms: Annotated[float | None, typer.Option(metavar="SIZE", help="RMS excursion, in --unit.")] = None,
    peak: Annotated[float | None, typer.Option(metavar="SIZE", help="Largest excursion; lowers the RMS.")] = None,
    centre: Annotated[float, typer.Option(metavar="PLACE", help="Centre of the motion.")] = 0.0,
    lines: Annotated[
        str, typer.Option(metavar="KIND", help="Excited frequencies: odd_random, odd or full.")
    ] = "odd_random",
    realisations: Annotated[
        int | None, typer.Option(metavar="N", help="Files with different phases; by default 7, of several joints 1.")
    ] = None,
    periods: Annotated[int, typer.Option(metavar="N", help="Periods to measure in each file.")] = 4,
    settle: Annotated[int, typer.Option(metavar="N", help="Periods before them, to settle.")] = 1,
    fall: Annotated[float, typer.Option(metavar="POWER", help="Power of frequency by which amplitudes fall.")] = 0.0,
    smallest: Annotated[float | None, typer.Option(metavar="SIZE", help="Smallest stroke of the reversals.")] = None,
    largest: Annotated[float | None, typer.Option(metavar="SIZE", help="Largest stroke, which is the last.")] = None,
    around: Annotated[
        list[float] | None, typer.Option(metavar="PLACE", help="Centre of the reversals; repeatable.")
    ] = None,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of strokes there and back.")] = 1.0,
    duration: Annotated[float, typer.Option(metavar="S", help="Duration of the reversals.")] = 20.0,
    unit: Annotated[str, typer.Option(metavar="UNIT", help="Unit of the reference.")] = "rad",
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of excited frequencies and phases.")] = 1,
) -> None:
    """Write a reference motion for identification."""
    if study is not None or name in ("optimised_fourier", "step_by_step"):
        _tree_protocol(
            name, study, folder, rate=rate, resolution=resolution, harmonics=harmonics, criterion=criterion,
            periods=periods, realisations=1 if realisations is None else realisations, acceleration=acceleration,
            radius=radius, seed=seed,
        )  # fmt: skip
        return
    realisations = 7 if realisations is None else realisations
    from .numerics.protocols.excitation import RandomPhaseMultisine
    from .numerics.protocols.protocol import protocol as run

    motion, files = run(
        name, folder, rate=rate, low=low, high=high, resolution=resolution, rms=rms, peak=peak, centre=centre,
        lines=lines, realisations=realisations, periods=periods, settle=settle, fall=fall, unit=unit, seed=seed,
        smallest=smallest, largest=largest, around=around or (), frequency=frequency, duration=duration,
    )  # fmt: skip
    out = make_console()
    if not isinstance(motion, RandomPhaseMultisine):
        places = count_of(len(around or ()), "place")
        print_line(out, f"{files[0]}: strokes from {smallest:g} to {largest:g} {unit} around {places}.")
        needed = "an encoder some ten times finer than the way over which friction builds up before it slips"
        print_line(out, f"Needs {needed}.")
        return
    print_line(
        out,
        f"{folder}: {count_of(len(files), 'file')} of {settle + periods} periods of {motion.period:g} s; "
        f"{len(motion.lines)} lines from {motion.frequency[0]:g} to {motion.frequency[-1]:g} Hz, "
        f"{len(motion.left_out)} excluded; peak {motion.peak:.3g} {unit}.",
    )
    print_line(
        out,
        f'In study.toml: protocol = "{name}" on each recording, and period = "{motion.period:g} s" in '
        "[transfer_function].",
    )


def _tree_protocol(name: str, study: Path | None, folder: Path, **asked: Any) -> None:
    """Write a motion of all joints of a study's robot, and print its properties."""
    from .arm.study.tree_excitation import tree_protocol

    if study is None:
        raise PellucidError(f"{name}: found no --study, expected one with [tree] and limits of each joint")
    with show_progress() as tell:
        made = tree_protocol(name, _opened(study, None, False), folder, on_progress=tell, **asked)
    out = make_console()
    limits = made.limits
    held = ["position", "velocity", "acceleration"]
    held += ["effort"] if limits.effort_of is not None else []
    held += [f"{1e3 * limits.clearance:.0f} mm between links"] if limits.distance is not None else []
    files, joints = count_of(len(made.files), "file"), len(limits.names)
    print_line(out, f"{folder}: {files} of {made.duration:.0f} s, {joints} joints, within limits of {', '.join(held)}.")
    if made.gain is not None:
        print_line(
            out,
            f"Intervals of its {made.parameters} parameters are to be {made.gain:.1f} times smaller than those of a "
            "random motion of that length.",
        )
    for said in getattr(made.made, "left_out", ()):
        print_line(out, f"Left out: {said}.")
    print_line(out, f'In study.toml: protocol = "{name}" on each recording.')


@datasets_app.command("list", epilog=example("pellucid datasets list"))
def datasets_list() -> None:
    """List the public data sets with their terms, and whether they are on this machine.

    Each is one line, and -v prints what it is and its terms in full.
    """
    from .study import datasets
    from .study.procedures.print_result import plain_table, shorten_text

    out, names = make_console(), (*datasets.names(), *datasets.motion_names())
    # Ten characters lie between the columns and at the edges, four are of the last column.
    room = max(out.width - max(map(len, names)) - MAX_TERMS_LENGTH - 14, 20)
    table = plain_table("name", "what it is~", "terms~", "here")
    for name in names:
        found = datasets.info(name)
        try:
            datasets.path(name)
            here = "yes"
        except PellucidError:
            here = "no"
        lengths = (len(found.title), len(found.licence)) if is_verbose() else (room, MAX_TERMS_LENGTH)
        cells = (shorten_text(text, length) for text, length in zip((found.title, found.licence), lengths, strict=True))
        table.add_row(name, *cells, here)
    out.print(table)
    if not is_verbose():
        print_line(out, "-v prints what each is and its terms in full.")


@datasets_app.command("fetch", epilog=example("pellucid datasets fetch NAME"))
def datasets_fetch(name: Annotated[str, typer.Argument(metavar="NAME")]) -> None:
    """Download a data set, and check every file against its checksum."""
    from .study import datasets

    typer.echo(str(datasets.fetch(name, progress=sys.stderr.isatty())))


@datasets_app.command("path", epilog=example("pellucid datasets path NAME"))
def datasets_path(name: Annotated[str, typer.Argument(metavar="NAME")]) -> None:
    """Print where a data set's files are on this machine."""
    from .study import datasets

    typer.echo(str(datasets.path(name)))


for _plugin in load_plugins("pellucid.commands"):
    _plugin.value(app)


def main() -> None:
    """Run the command line.

    An error that the user can cause or correct ends with one message and exit status 2. Recordings that `check` refuses
    end with its status 1.
    """
    # The matrices are small, so that threads would only wait for each other. NumPy reads the variable when it is
    # loaded.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _keep_freed_memory()
    replace_unprintable_characters()
    try:
        app()
    except UnfitRecordingError as error:
        exit_with_message(_text_with_notes(error), 1)
    except PellucidError as error:
        exit_with_message(_text_with_notes(error))
    except ModuleNotFoundError as error:
        domain = missing_domain(error)
        if domain is None:
            raise
        exit_with_message(f"this command needs pellucid/{domain}, which this installation lacks")
    except OSError as error:
        exit_with_message(f"{error.strerror or error}{f': {error.filename}' if error.filename else ''}")
    except MemoryError as error:
        exit_with_message(f"not enough memory{f': {error}' if str(error) else ''}")
    except Exception as error:
        import traceback

        if os.environ.get("PELLUCID_TRACEBACK"):
            raise
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(frame.filename).name}:{frame.lineno}"
        exit_with_message(
            f"a fault of Pellucid's own, at {where}: {error!r}; PELLUCID_TRACEBACK=1 shows where from", 70
        )


def _keep_freed_memory() -> None:
    """Let GNU's C library use the memory of a freed array for the next one.

    The system clears each page that it is asked for again, which takes 4 % of the identification of two hours.
    """
    from ctypes import CDLL

    mallopt = getattr(CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    for parameter, size in MALLOC_PARAMETERS.values() if mallopt is not None else ():
        mallopt(parameter, size)


def _text_with_notes(error: PellucidError) -> str:
    """Return an error's message, and its notes on lines of their own."""
    return "\n".join([str(error), *getattr(error, "__notes__", ())])


def _echo_json(table: dict[str, Any]) -> None:
    from json import dumps

    typer.echo(dumps(table, indent=1, ensure_ascii=False))


def _opened(folder: Path, out: Path | None, allow_outside: bool, accept_stale: bool = False) -> Study:
    from .study.procedures.registry import open_study

    return open_study(folder, out=out, allow_outside=allow_outside, accept_stale=accept_stale)


def _run_and_save(study: Study, command: str, json: bool, run: Callable[[Study, Callable], Result]) -> None:
    """Run a command on a study, then save and print its result; of recordings that are not fit, that it cannot say."""
    from .study.procedures.print_result import print_result

    try:
        with show_progress() as tell:
            result = run(study, tell)
    except UnfitRecordingError as error:
        from .study.procedures.refusal import write_refusal

        answer, page = write_refusal(study, command, error)
        if json:
            _echo_json({"answers": [{"command": command, "procedure": command, **answer.table()}], "figures": []})
        else:
            console = make_console()
            print_answer(console, answer)
            print_line(console, f"Page: {page}" if page else f"Not written: {study.results_path}")
            print_steps(console, answer)
        raise
    try:
        study, elsewhere = result.save_somewhere(study)
    except OSError as error:
        # The result of minutes of work is printed if it cannot be written.
        print_json(result)
        exit_with_message(f"results could not be written: {error.strerror or error}; they are printed above")
    if json:
        print_json(result)
    else:
        out = make_console()
        print_result(out, result, brief=not is_verbose())
        print_line(out, f"{result.written(study)}, every figure in {study.results_path}.")
        print_next(out, result.answers[0])
    if elsewhere:
        # A next command after && would use the study's own cards, which are older, so it must not run.
        exit_with_message(elsewhere, 1)
    exit_unless_answered(result.answers)


if __name__ == "__main__":
    main()
