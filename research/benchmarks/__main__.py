"""Run the named benchmarks, or every one; print a table with each ratio and its goal, and write benchmarks.json.

With every benchmark, at full size, the page docs/speed.md is written too, in the current folder's docs.

A benchmark is a file of this folder with a function `run()`, which returns rows of name, value, unit and note. The file
has the name of the timed code.
"""

import json
import platform
import sys
from pathlib import Path
from types import ModuleType

from ._goals import goal_table, speed_page
from ._runner import check_one_thread, limit_to_one_thread, names_in, read_arguments, run_all
from ._size import is_smallest

NAMES = names_in(Path(__file__).parent)

SPEED_PAGE = Path("docs/speed.md")
"""The page that is written from the figures of all benchmarks."""


def measured(module: ModuleType) -> list[dict]:
    """Return the rows of a benchmark, which are comparable only if everything used one thread."""
    rows = list(module.run())
    check_one_thread(module.__name__)
    return rows


def main() -> None:
    names, out = read_arguments("benchmarks", NAMES, "benchmarks.json")
    limit_to_one_thread()
    rows, failed = run_all("benchmarks", names, measured)
    from pellucid._atomic import write_text_atomically

    width = max((len(row["name"]) for row in rows), default=0)
    for row in rows:
        print(f"{row['name']:<{width}}  {row['value']:>12.4g} {row['unit']:<6} {row['note']}")
    machine = f"{platform.machine()}, Python {platform.python_version()}"
    write_text_atomically(out, json.dumps({"machine": machine, "figures": rows}, indent=2) + "\n")
    print(goal_table(rows))
    print(f"written to {out}")
    if names == NAMES and not failed and not is_smallest() and SPEED_PAGE.parent.is_dir():
        write_text_atomically(SPEED_PAGE, speed_page(rows, machine))
        print(f"written to {SPEED_PAGE}")
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
