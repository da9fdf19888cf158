"""Start of the command line: ``pellucid``, and ``python -m pellucid``.

The version, and the lines of a report that need not be drawn again, are printed without loading the commands.
"""

from __future__ import annotations

import atexit
import gc
import sys

SHARED_OPTIONS = {"-q", "--quiet", "-v", "--verbose"}
"""Options of every command; a report that need not be drawn again prints the same lines with each."""


def main() -> None:
    """Print the version or an up-to-date report if nothing else is asked for; else run the command line."""
    # After every 700 new objects, as Python has it, the search for unused ones takes 3 % of an assessment.
    gc.set_threshold(200_000)
    atexit.register(gc.freeze)  # the search at exit, through every module, takes a tenth of a check
    words = sys.argv[1:]
    if words in (["version"], ["--version"]):
        from . import __version__

        print(f"pellucid {__version__}")
        return
    asked = [word for word in words if word not in SHARED_OPTIONS]
    if len(asked) == 2 and asked[0] == "report" and not asked[1].startswith("-") and _print_drawn_report(asked[1]):
        return
    from .cli import main as run

    run()


def _print_drawn_report(folder: str) -> bool:
    """Print the lines that told of a study's report if it is up to date; return whether it is."""
    from pathlib import Path

    from .study.drawn_report import ReportPlace

    text = "\n".join(ReportPlace(Path(folder)).drawn_lines(with_pdf=False))
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:  # the command replaces what the terminal cannot print
        return False
    if text:
        print(text)
    return bool(text)


if __name__ == "__main__":
    main()
