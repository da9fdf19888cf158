"""Printing and progress of the command line: what every command uses, those of other packages too.

`CommandGroup` lists commands in groups, and knows those that are not installed.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from itertools import accumulate, takewhile
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from .._errors import missing_lab
from .procedures.command import HELP_GROUPS, LEARN_GROUP

if TYPE_CHECKING:
    from rich.console import Console

    from .answer import Answer
    from .procedures.result import Result

Json = Annotated[bool, typer.Option("--json", help="Print the figures as JSON instead of tables.")]
"""Option of commands whose result can be printed as JSON."""

CHARACTER_REPLACEMENTS = {
    "−": "-", "–": "-", "—": "-", "±": "+-", "·": "*", "×": "x", "µ": "u", "°": "deg", "…": "...",
    "≤": "<=", "≥": ">=", "≈": "~", "√": "sqrt", "χ": "chi", "δ": "delta", "Δ": "Delta", "Ω": "ohm", "✗": "x", "━": "-",
    "─": "-", "│": "|", "\N{RIGHT SINGLE QUOTATION MARK}": "'",
}  # fmt: skip
"""Text that replaces each character on a terminal that cannot print it."""

EXPONENT_CHARACTERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
"""Characters of exponents, which stand after a caret on such a terminal."""


MAX_NOTES_UNLESS_VERBOSE = 6
"""Largest number of notes that a command prints without ``-v``."""

MAX_ITEM_LINES_UNLESS_VERBOSE = 34
"""Largest number of lines that warnings and notes together take without ``-v``.

The command's own lines fill the screen."""

MAX_STEP_LINES = 10
"""Largest number of lines of recommended next steps without ``-v``."""

MAX_TABLE_LINES_UNLESS_VERBOSE = 20
"""Largest number of lines of a table among sentences without ``-v``."""

FIRST_PROGRESS_S = 2.0
"""Time after which a command reports its progress, and period of further reports [s]."""

MIN_PREDICTED_SHARE = 0.05
"""Completed share of the work from which the remaining time is reported."""

MAX_HELD_RATIO = 1.3
"""A prediction of the remaining time that exceeds the last one shown by less than this factor leaves it standing."""

SECONDS_SHOWN_BELOW_S = 90.0
"""Remaining time below which seconds are shown, and minutes above it [s]."""

DONE_TEXT = "done"
"""Text of the progress report when all work is done."""

MAX_UNFINISHED_SHARE = 0.99
"""Largest share that is shown while a step lasts."""

_is_quiet = ContextVar("_is_quiet", default=False)
_is_verbose = ContextVar("_is_verbose", default=False)


def set_quiet(quiet: bool) -> None:
    """Print results and warnings alone from now on, or all again."""
    _is_quiet.set(quiet)


def set_verbose(verbose: bool) -> None:
    """Print every note from now on, or only the first again."""
    _is_verbose.set(verbose)


def _also_quiet(quiet: bool) -> None:
    """Take ``-q`` behind a command, which may stand before it too."""
    set_quiet(quiet or _is_quiet.get())


def _also_verbose(verbose: bool) -> None:
    """Take ``-v`` behind a command, which may stand before it too."""
    set_verbose(verbose or _is_verbose.get())


def is_verbose() -> bool:
    """Return whether ``-v`` asked for everything."""
    return _is_verbose.get()


def make_console() -> Console:
    """Return the terminal to print to; nothing on it is coloured because it looks like a number."""
    from rich.console import Console

    return Console(highlight=False)


def print_line(out: Console, text: str) -> None:
    """Print a line unchanged: paths are neither wrapped nor read as markup."""
    out.print(text, markup=False, soft_wrap=True)


def print_wrapped(out: Console, text: str) -> None:
    """Print a text in lines of the terminal's width; a word, such as a path, is not cut."""
    from textwrap import wrap

    # Rich breaks long words, and fills lines with spaces.
    indent = "  " if text.startswith(("- ", "  ")) else ""
    lines = wrap(text, out.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    for line in lines or [""]:
        print_line(out, line)


@contextmanager
def show_progress() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar on standard error; without a terminal, print a line every two seconds.

    After ``-q`` nothing is shown.
    """
    if _is_quiet.get():
        yield lambda text, share: None
        return
    if not sys.stderr.isatty():
        with _print_first_line() as tell:
            yield tell
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        SpinnerColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.text import Text

    remaining = RemainingTime()

    class RemainingColumn(TextColumn):
        """Time that remains: it is shown anew between steps, too."""

        def render(self, task: Task) -> Text:
            return Text(remaining.text(task.elapsed or 0.0), style="dim")

    class ShareColumn(TextColumn):
        """Share of the work that is done."""

        def render(self, task: Task) -> Text:
            return Text(share_text(task.percentage / 100.0, task.elapsed or 0.0), style="magenta")

    columns = (SpinnerColumn("line"), TextColumn("{task.description}"), BarColumn(24), ShareColumn(""),
               TimeElapsedColumn(), RemainingColumn(""))  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)

        def tell(text: str, share: float) -> None:
            progress.update(task, description=text, completed=remaining.step(progress.tasks[0].elapsed or 0.0, share))

        yield tell


def share_text(share: float, elapsed: float) -> str:
    """Return the `share` that was done in `elapsed` [s] in percent, with a decimal where one percent takes longer than
    `FIRST_PROGRESS_S`."""
    return f"{100.0 * share:.{int(0.0 < share < 1.0 and elapsed > 100.0 * FIRST_PROGRESS_S * share)}f} %"


class RemainingTime:
    """Time that remains of some work, predicted from the share done, and shown so that it never grows.

    A prediction becomes shorter while a step lasts. If the step lasts longer than the whole rest should, the rest is
    predicted anew from all the time so far. A new prediction that is little longer than the last one shown leaves that
    one standing; a much longer one is said in words, until a prediction is again as short as the last one shown.
    """

    def __init__(self) -> None:
        self._share = 0.0
        self._stepped = 0.0  # when the last step was told [s]
        self._shown: float | None = None  # last time that was shown [s]

    def step(self, elapsed: float, share: float) -> float:
        """Take the `share` done at `elapsed` [s], and return the largest share so far: no work is undone."""
        self._share, self._stepped = max(self._share, share), elapsed
        return self._share

    def text(self, elapsed: float) -> str:
        """Return in words how long the rest takes, seen at `elapsed` [s]; "" at the start and at the end."""
        share = self._share
        if share < MIN_PREDICTED_SHARE or elapsed < FIRST_PROGRESS_S or share >= 1.0:
            return ""
        left = self._stepped / share - elapsed
        if left <= 0.0:
            left = elapsed * (1.0 - share) / share
        left = _rounded_rest(left)
        if self._shown is not None and left > self._shown:
            if left > MAX_HELD_RATIO * self._shown:
                return "longer than predicted"
            left = self._shown
        self._shown = left
        return f"about {left:.0f} s left" if left < SECONDS_SHOWN_BELOW_S else f"about {left / 60.0:.0f} min left"


def _rounded_rest(left: float) -> float:
    """Return a remaining time [s] as coarse as it is shown: five seconds at least."""
    return max(5.0 * round(left / 5.0), 5.0) if left < SECONDS_SHOWN_BELOW_S else 60.0 * round(left / 60.0)


@contextmanager
def _print_first_line() -> Iterator[Callable[[str, float], None]]:
    """Print the progress every `FIRST_PROGRESS_S` from then on, even while a step lasts; a line holds
    what the bar of a terminal shows."""
    from threading import Event, Lock, Thread
    from time import monotonic

    began, ended, lock = monotonic(), Event(), Lock()
    remaining = RemainingTime()
    last: list[tuple[str, float]] = []  # what is done, and the share done

    def tell(text: str, share: float) -> None:
        told = monotonic() - began
        with lock:
            changed = not last or last[0][0] != text
            last[:] = [(text, remaining.step(told, share))]
            if changed and _is_verbose.get():
                _print_progress(*last[0], told, remaining.text(told))

    def beat() -> None:
        while not ended.wait(FIRST_PROGRESS_S):
            elapsed = monotonic() - began
            with lock:
                if last:
                    _print_progress(*last[0], elapsed, remaining.text(elapsed))

    thread = Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield tell
    finally:
        ended.set()
        thread.join()


def _print_progress(text: str, share: float, elapsed: float, left: str) -> None:
    """Print the completed share of the work, the current step and the remaining time on standard error.

    If the remaining time cannot be predicted, the elapsed time is printed. Nothing is printed once all work is done.
    """
    if share >= 1.0 and text == DONE_TEXT:
        return
    # A last step that is named with the whole share still lasts.
    share = min(share, MAX_UNFINISHED_SHARE)
    typer.echo(f"pellucid: {share_text(share, elapsed)} {text}, {left or f'{elapsed:.0f} s so far'}", err=True)


def print_json(result: Result) -> None:
    """Print the answers and every row of a result as JSON."""
    from json import dumps

    from .results import finite_row, row_table

    answers = [{"command": part.command, "procedure": part.procedure, **part.answer.table()} for part in result.each]
    table = {"answers": answers, "figures": [row_table(finite_row(row)) for row in result.rows]}
    typer.echo(dumps(table, indent=1, ensure_ascii=False))


def print_answer(out: Console, answer: Answer) -> None:
    """Print an answer: question, verdict with its sentence, basis; long lines are wrapped."""
    from .answer import answer_lines

    for text in answer_lines(answer):
        print_wrapped(out, text)


def print_steps(out: Console, answer: Answer, max_lines: int = MAX_STEP_LINES) -> None:
    """Print the recommended next steps of an answer, in at most `max_lines` unless ``-v`` asks for all."""
    texts = [text.replace("`", "") for text in answer.following]
    print_lines(out, texts, max_lines, "further step", wrap=not any("pellucid " in text for text in texts))


def print_next(out: Console, answer: Answer) -> None:
    """Print what to do next, up to the first command."""
    from .answer import next_lines

    for step, text in zip(answer.next, next_lines(answer.next), strict=False):
        if step.command:  # which stays on one line, to be copied
            print_line(out, text)
        else:
            out.print(text, markup=False)


def exit_unless_answered(answers: Sequence[Answer]) -> None:
    """Exit with status 1, and say why, if a question could not be answered."""
    from .answer import unanswered_message

    why = unanswered_message(answers)
    if why:
        exit_with_message(why, 1)


def exit_with_message(text: str, status: int = 2) -> None:
    """Print one message, with its control characters replaced, and exit with a status."""
    from .._given import visible_text

    typer.echo(f"pellucid: {visible_text(text)}", err=True)
    raise SystemExit(status)


def print_items(out: Console, items: Sequence[tuple[str, str]], max_lines: int = MAX_ITEM_LINES_UNLESS_VERBOSE) -> None:
    """Print sentences, each with the mark of its kind: "good", "note" or "warning".

    Unless ``-v`` asks for all, at most `MAX_NOTES_UNLESS_VERBOSE` notes are printed, and of all sentences the first
    that fit into `max_lines`; the others are counted. After ``-q`` no note is printed.
    """
    from .procedures.print_result import print_sentences, sentence_lines

    shown = _noted(items)
    if not _is_verbose.get():
        taken = accumulate(sentence_lines(out, [item]) for item in shown)
        shown = shown[: max(sum(1 for _ in takewhile(lambda lines: lines <= max_lines, taken)), 1)]
    print_sentences(out, shown)
    kinds = Counter(kind for kind, _ in items) - Counter(kind for kind, _ in shown)
    notes = 0 if _is_quiet.get() else kinds.pop("note", 0)
    kinds.pop("note", 0)
    noun = "further remark" if set(kinds) <= {"good"} else "further warning"
    counted = [count_of(kinds.total(), noun)] if kinds else []
    counted += [count_of(notes, "further note")] if notes else []
    if counted:
        print_line(out, f"  and {' and '.join(counted)}, which -v prints")


def _noted(items: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the sentences without the notes beyond those that are printed unless ``-v`` asks for all."""
    if _is_verbose.get():
        return list(items)
    room = 0 if _is_quiet.get() else MAX_NOTES_UNLESS_VERBOSE
    notes = [item for item in items if item[0] == "note"]
    # One more is printed rather than counted.
    kept = notes if len(notes) == room + 1 and room else notes[:room]
    return [item for item in items if item[0] != "note" or item in kept]


def print_lines(out: Console, lines: Sequence[str], max_lines: int, noun: str, *, wrap: bool = True) -> None:
    """Print lines; unless ``-v`` asks for all, the first that fit into `max_lines` of the terminal. The others are
    counted as what `noun` calls them. Without `wrap` a line with a command stays whole, so that it can be copied."""
    kept = len(lines)
    if not _is_verbose.get():
        taken = list(accumulate(max(-(-len(line) // out.width), 1) for line in lines))
        kept = max(sum(each <= max_lines for each in taken), 1)
    for line in lines[:kept]:
        (print_wrapped if wrap else print_line)(out, line)
    if len(lines) > kept:
        print_line(out, f"  and {count_of(len(lines) - kept, noun)}, which -v prints")


def print_short_table(
    out: Console, heads: Sequence[str], rows: Sequence[Sequence[str]], max_lines: int = MAX_TABLE_LINES_UNLESS_VERBOSE
) -> None:
    """Print a table that fits the terminal; unless ``-v`` asks for all, the first rows that fit into `max_lines`."""
    from .procedures.print_result import print_table

    print_table(out, heads, rows, None if _is_verbose.get() else max_lines)


def count_of(n: int, what: str) -> str:
    """Return a number and its noun, in the plural if it is not 1."""
    return f"{n} {what}" + ("" if n == 1 else "s")


def replace_unprintable_characters() -> None:
    """Print a similar text, or a question mark, for a character that the terminal does not have."""
    import codecs

    def instead(error: UnicodeError) -> tuple[str, int]:
        if not isinstance(error, UnicodeEncodeError):
            raise error
        text, end = error.object, error.end
        while ord(text[end - 1]) in EXPONENT_CHARACTERS and end < len(text) and ord(text[end]) in EXPONENT_CHARACTERS:
            end += 1  # a terminal that has ¹, ² and ³ has not the rest of the exponent
        found = re.sub("[⁻⁰¹²³⁴-⁹]+", lambda m: "^" + m[0].translate(EXPONENT_CHARACTERS), text[error.start : end])
        return "".join(c if c.isascii() else CHARACTER_REPLACEMENTS.get(c, "?") for c in found), end

    codecs.register_error("pellucid", instead)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="pellucid")


LAB_COMMANDS = ("simulate", "predict", "demo", "reproduce", "rank")
"""Commands of the distribution `pellucid-lab`. If it is not installed, they say how to install it."""


def example(command_line: str) -> str:
    """Return what stands below a command's options: one way to call it, and where the manual is."""
    return f"Example: {command_line}\n\n\nManual: docs/reference/index.md"


COMPLETION_HELP = {
    "install_completion": "Have this shell complete commands and options.",
    "show_completion": "Print what completes them, to copy or change it.",
}
"""Help of the options about completion."""


class CommandGroup(TyperGroup):
    """The commands by name, in groups. Each has `-q` and `-v`; one that is not installed is known, and says so."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command by its name; None if no distribution of Pellucid has it."""
        found = super().get_command(ctx, cmd_name)
        if found is None and cmd_name in LAB_COMMANDS:
            raise missing_lab(cmd_name)
        if isinstance(found, TyperCommand) and not any("--quiet" in each.opts for each in found.params):
            found.params += _shared_parameters()
        return found

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, the help of each on one line: all commands fit on a screen."""
        found: list[Any] = super().get_params(ctx)
        for each in found:
            each.help = COMPLETION_HELP.get(each.name, getattr(each, "help", None))
            # `--install-completion` is what people need; the other one works, and takes no line.
            each.hidden = getattr(each, "hidden", False) or each.name == "show_completion"
        return found

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands under the headings of their groups."""
        named = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows: dict[str, list[tuple[str, str]]] = {heading: [] for heading in HELP_GROUPS}
        width = max(len(name) for name, _ in named)
        for name, command in named:
            if command is None or command.hidden:
                continue
            heading = getattr(command, "rich_help_panel", None)
            rows.setdefault(heading if isinstance(heading, str) else LEARN_GROUP, []).append(
                (name.ljust(width), command.get_short_help_str(formatter.width - 6 - width))
            )
        for heading, listed in rows.items():
            if listed:
                with formatter.section(heading):
                    formatter.write_dl(listed)


@cache
def _shared_parameters() -> tuple[Any, ...]:
    """Return the options that every command has, made once for all of them."""
    made = typer.Typer(add_completion=False)
    made.command()(_shared_options)
    return tuple(each for each in typer.main.get_command(made).params if each.name in ("quiet", "verbose"))


def _shared_options(
    quiet: Annotated[
        bool,
        typer.Option(
            "-q", "--quiet", callback=_also_quiet, expose_value=False,
            help="Print results and warnings alone: no progress, no notes.",
        ),
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "-v", "--verbose", callback=_also_verbose, expose_value=False,
            help="Print every note, and progress at each step.",
        ),
    ] = False,
) -> None:  # fmt: skip
    """Have the options that every command has."""
