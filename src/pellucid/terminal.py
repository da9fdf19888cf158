"""Printing and progress of the command line: what every command uses, those of other packages too."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from .procedures.result import Result

Json = Annotated[bool, typer.Option("--json", help="Print the figures as JSON instead of tables.")]
"""Option of commands whose result can be printed as JSON."""

CHARACTER_REPLACEMENTS = {
    "−": "-", "–": "-", "—": "-", "±": "+-", "·": "*", "×": "x", "²": "^2", "³": "^3", "µ": "u", "°": "deg", "…": "...",
    "≤": "<=", "≥": ">=", "≈": "~", "√": "sqrt", "χ": "chi", "δ": "delta", "Δ": "Delta", "Ω": "ohm", "✗": "x", "━": "-",
    "─": "-", "│": "|", "\N{RIGHT SINGLE QUOTATION MARK}": "'",
}  # fmt: skip
"""Text that replaces each character on a terminal that cannot print it."""


MAX_NOTES_UNLESS_VERBOSE = 6
"""Largest number of notes that a command prints without ``-v``; warnings are all printed."""

_is_quiet = ContextVar("_is_quiet", default=False)
_is_verbose = ContextVar("_is_verbose", default=False)


def set_quiet(quiet: bool) -> None:
    """Print results and warnings alone from now on, or all again."""
    _is_quiet.set(quiet)


def set_verbose(verbose: bool) -> None:
    """Print every note from now on, or only the first again."""
    _is_verbose.set(verbose)


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


@contextmanager
def show_progress() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar on standard error; without a terminal, print a line after two seconds and at intervals.

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
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(24), TaskProgressColumn(), TimeElapsedColumn(),
               TimeRemainingColumn())  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda text, share: progress.update(task, description=text, completed=share)


@contextmanager
def _print_first_line(seconds: float = 2.0) -> Iterator[Callable[[str, float], None]]:
    """Print the progress after `seconds`, even if no step has ended by then, and later at intervals."""
    from threading import Timer

    print_later = _lines_at_intervals()
    last: list[tuple[str, float]] = []

    def tell(text: str, share: float) -> None:
        last[:] = [(text, share)]
        print_later(text, share)

    def print_last() -> None:
        for text, share in last:
            _print_progress(text, share)

    first = Timer(seconds, print_last)
    first.daemon = True
    first.start()
    try:
        yield tell
    finally:
        first.cancel()


def _print_progress(text: str, share: float) -> None:
    """Print the share of the work that is done, and what is done now, on standard error."""
    typer.echo(f"pellucid: {100.0 * share:.0f} % {text}", err=True)


def _lines_at_intervals(seconds: float = 5.0) -> Callable[[str, float], None]:
    """Return a function that prints the progress if nothing was printed for `seconds`."""
    from time import monotonic

    last = [monotonic()]

    def tell(text: str, share: float) -> None:
        if monotonic() - last[0] >= (0.0 if _is_verbose.get() else seconds) and share < 1.0:
            last[0] = monotonic()
            _print_progress(text, share)

    return tell


def print_json(result: Result) -> None:
    """Print every row of a result as JSON."""
    from json import dumps

    from .studies.results import finite_row, row_table

    typer.echo(dumps({"figures": [row_table(finite_row(row)) for row in result.rows]}, indent=1, ensure_ascii=False))


def print_items(out: Console, items: Sequence[tuple[str, str]]) -> None:
    """Print sentences, each with the mark of its kind: "good", "note" or "warning".

    Of more than `MAX_NOTES_UNLESS_VERBOSE` notes the first are printed unless ``-v`` asks for all; after ``-q`` none.
    """
    from .procedures.print_result import print_sentences

    shown, left = _noted(items)
    print_sentences(out, shown)
    if left and not _is_quiet.get():
        print_line(out, f"  and {count_of(left, 'further note')}, which -v prints")


def _noted(items: Sequence[tuple[str, str]]) -> tuple[list[tuple[str, str]], int]:
    """Return the sentences that are to be printed, and the number of notes among the others."""
    if _is_verbose.get():
        return list(items), 0
    room = 0 if _is_quiet.get() else MAX_NOTES_UNLESS_VERBOSE
    notes = [item for item in items if item[0] == "note"]
    # One more is printed rather than counted.
    kept = notes if len(notes) == room + 1 and room else notes[:room]
    return [item for item in items if item[0] != "note" or item in kept], len(notes) - len(kept)


def count_of(n: int, what: str) -> str:
    """Return a number and its noun, in the plural if it is not 1."""
    return f"{n} {what}" + ("" if n == 1 else "s")


def replace_unprintable_characters() -> None:
    """Print a similar text, or a question mark, for a character that the terminal does not have."""
    import codecs

    def instead(error: UnicodeError) -> tuple[str, int]:
        if not isinstance(error, UnicodeEncodeError):
            raise error
        return "".join(CHARACTER_REPLACEMENTS.get(c, "?") for c in error.object[error.start : error.end]), error.end

    codecs.register_error("pellucid", instead)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="pellucid")
