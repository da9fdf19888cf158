"""The help of the command line: commands by what somebody wants to do, an example for each, and options of all.

A command says to which of `pellucid.study.procedures.command.HELP_GROUPS` it belongs, and how it is called;
`CommandGroup` prints them.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from .._errors import missing_lab
from .procedures.command import HELP_GROUPS, LEARN_GROUP
from .terminal import set_quiet, set_verbose

LAB_COMMANDS = ("simulate", "predict", "demo", "reproduce", "rank")
"""Commands of the distribution `pellucid-lab`. If it is not installed, they say how to install it."""


def example(command_line: str) -> str:
    """Return what stands below a command's options: one way to call it, and where the manual is."""
    return f"Example: {command_line}\n\n\nManual: docs/commands.md"


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
            "-q", "--quiet", callback=set_quiet, expose_value=False,
            help="Print results and warnings alone: no progress, no notes.",
        ),
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "-v", "--verbose", callback=set_verbose, expose_value=False,
            help="Print every note, and progress at each step.",
        ),
    ] = False,
) -> None:  # fmt: skip
    """Have the options that every command has."""
