"""Commands as messages and pages print them, ready to be pasted into a shell."""

from __future__ import annotations

import os
import shlex


def printed_command(name: str, folder: str | os.PathLike, *options: str) -> str:
    """Return a command of Pellucid on a folder as text that a POSIX shell runs as it stands.

    The folder is named as the user named it, so that the text is valid where the user gave the command. It is quoted
    where a shell requires it.
    """
    path = os.fspath(folder)
    if path.startswith("-"):
        path = os.path.join(os.curdir, path)  # a name that begins with a dash would be read as an option
    return shlex.join(["pellucid", *name.split(), path, *options])
