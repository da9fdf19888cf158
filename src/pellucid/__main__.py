"""Start of the command line: ``pellucid``, and ``python -m pellucid``.

The version is printed without loading the commands.
"""

from __future__ import annotations

import sys


def main() -> None:
    """Print the version if nothing else is asked for; else run the command line."""
    if sys.argv[1:] in (["version"], ["--version"]):
        from . import __version__

        print(f"pellucid {__version__}")
        return
    from .cli import main as run

    run()


if __name__ == "__main__":
    main()
