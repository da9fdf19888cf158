"""Commands as messages and pages print them, ready to be pasted into a shell."""

from __future__ import annotations

import os
import shlex


def printed_command(name: str, folder: str | os.PathLike, *options: str) -> str:
    """Return a command of Pellucid on a folder as text that a POSIX shell runs as it stands.

    The folder is named as the user named it, so that the text is valid where the user gave the command. It is quoted
    where a shell requires it.
    """
    return shlex.join(["pellucid", *name.split(), _no_option(folder), *options])


def printed_path(path: str | os.PathLike) -> str:
    """Return a path as a POSIX shell takes it."""
    return shlex.quote(_no_option(path))


def _no_option(path: str | os.PathLike) -> str:
    """Return a path that no command reads as an option, although its name begins with a dash."""
    text = os.fspath(path)
    return os.path.join(os.curdir, text) if text.startswith("-") else text
