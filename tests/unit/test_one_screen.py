"""Whatever a command prints without -v is at most one screen, and counts what it left out; -v prints all."""

import ast
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from pellucid import cli
from pellucid.study import terminal
from pellucid.study.pages.quantities import typeset_quantities
from pellucid.study.terminal import print_items, print_lines, print_short_table
from pellucid_lab import lab_cli

SCREEN_LINES = 45
"""Lines of one screen."""

MAX_RESULT_LINES = SCREEN_LINES - 5
"""Lines of it that a command's own last lines leave."""

SHORT_LOOPS = {
    "_tree_protocol": "lines that an optimised motion left out, of which there are a few",
    "live": "what a replay answers, and two addresses",
    "demo": "four chapters",
    "paper": "the answers of a study's analyses, of which there are a few",
    "report": "the answers of a study's analyses, of which there are a few",
    "commission": "a line for each number that was measured, of which there are a few",
    "try_files": "two or three lines before a table that has a bound of its own",
    "plan": "next steps of an answer, of which there are a few",
    "rank": "a table for each of four tasks, each with a bound of its own",
}
"""Functions of the command line that print in a loop whose length is bounded by what it goes over."""


@pytest.fixture(params=[False, True], ids=["plain", "verbose"])
def verbose(request):
    terminal.set_verbose(request.param)
    yield request.param
    terminal.set_verbose(False)


def printed(show, *given, width=80, **options):
    text = StringIO()
    show(Console(width=width, highlight=False, no_color=True, file=text), *given, **options)
    return text.getvalue().splitlines()


@pytest.mark.parametrize("kind", ["warning", "note", "good"])
def test_sentences_are_one_screen_and_the_others_are_counted(verbose, kind):
    items = [(kind, f"Sentence {i} on a file and a channel, which goes on for a while. " * 3) for i in range(200)]
    lines = printed(print_items, items)
    told = [line for line in lines if "Sentence" in line and line[0] in "!·+"]
    if verbose:
        assert len(told) == 200
        return
    assert len(lines) <= MAX_RESULT_LINES
    noun = {"warning": "further warnings", "note": "further notes", "good": "further remarks"}[kind]
    assert f"{200 - len(told)} {noun}, which -v prints" in lines[-1]


def test_a_warning_stands_before_notes_and_both_are_counted():
    items = [("warning", f"Warning {i} " * 30) for i in range(20)] + [("note", f"Note {i}.") for i in range(9)]
    lines = printed(print_items, items)
    assert len(lines) <= MAX_RESULT_LINES
    assert lines[-1].endswith("further warnings and 9 further notes, which -v prints")


def test_lines_and_rows_are_cut_and_counted(verbose):
    lines = printed(print_lines, [f"line {i} " * 20 for i in range(100)], 30, "further figure")
    rows = printed(print_short_table, ("name", ">value"), [(f"row {i}", str(i)) for i in range(100)])
    if verbose:
        assert any("row 99" in line for line in rows)
        assert "line 99" in lines[-1]
        return
    assert sum(-(-len(line) // 80) for line in lines) <= 31
    assert lines[-1] == "  and 85 further figures, which -v prints"
    assert len(rows) <= terminal.MAX_TABLE_LINES_UNLESS_VERBOSE + 1
    assert rows[-1].strip().startswith("and ")


@pytest.mark.parametrize("module", [cli, lab_cli], ids=["cli", "lab_cli"])
def test_no_command_prints_in_a_loop_that_has_no_bound(module):
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    found = set()
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        for loop in (node for node in ast.walk(function) if isinstance(node, (ast.For, ast.While))):
            calls = (node.func for node in ast.walk(loop) if isinstance(node, ast.Call))
            if any(getattr(f, "id", getattr(f, "attr", "")) in ("print_line", "print", "echo") for f in calls):
                found.add(function.name)
    assert found <= set(SHORT_LOOPS)


def test_the_list_of_data_sets_is_a_line_each():
    short = CliRunner().invoke(cli.app, ["datasets", "list"], env={"COLUMNS": "80"}).stdout.splitlines()
    whole = CliRunner().invoke(cli.app, ["datasets", "list", "-v"], env={"COLUMNS": "80"}).stdout
    assert len(short) <= SCREEN_LINES
    assert "Leg extension from sitting: …" in "\n".join(short)
    assert "goniometer at the knee" in whole
    assert len(whole.splitlines()) > SCREEN_LINES


def test_the_help_of_all_commands_fits_one_screen():
    told = CliRunner().invoke(cli.app, ["--help"]).output.splitlines()
    assert len(told) <= SCREEN_LINES
    assert max(map(len, told)) <= 80


def test_a_value_to_copy_keeps_its_minus():
    """A delay with the typographer's minus was no number in study.toml."""
    assert typeset_quantities('Write torque = { delay = "-3.0 ms" }.') == 'Write torque = { delay = "-3.0 ms" }.'


def test_minus_signs_of_sentences_are_typographic_and_options_are_not():
    said = typeset_quantities("seen from -20.4 to +3.1 deg, -.5 N*m/rad; run with -v, run-2, 1e-05 s, 2026-11-27")
    assert said == "seen from −20.4 to +3.1 deg, −.5 N·m/rad; run with -v, run-2, 1e-05 s, 2026-11-27"
