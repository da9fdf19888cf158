"""Run the named benchmarks, or every one; print a table with each ratio and its goal, and write benchmarks.json.

With ``--write`` every benchmark runs at full size, and the stored results and the page docs/validation/speed.md are
written, too. ``--page`` measures nothing and only writes the page.

A benchmark is a file of this folder with a function `run()`, which returns rows of name, value, unit and note. The file
has the name of the timed code.
"""

import argparse
import json
import platform
import sys
from pathlib import Path
from types import ModuleType

from ._goals import RESULTS_FILE, SPEED_PAGE, goal_table, write_page, write_results
from ._runner import check_one_thread, limit_to_one_thread, names_in, read_arguments, run_all
from ._size import is_smallest

NAMES = names_in(Path(__file__).parent)


def measured(module: ModuleType) -> list[dict]:
    """Return the rows of a benchmark, which are comparable only if everything used one thread."""
    rows = list(module.run())
    check_one_thread(module.__name__)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--write", action="store_true", help="write the stored results and the page of speed, too")
    parser.add_argument("--page", action="store_true", help="measure nothing, and write the page of speed")
    asked, others = parser.parse_known_args()
    if asked.page:
        write_page()
        print(f"written to {SPEED_PAGE}")
        return
    names, out = read_arguments("benchmarks", NAMES, "benchmarks.json", others, [parser])
    if asked.write and (names != NAMES or is_smallest()):
        sys.exit("--write: found some of the benchmarks or the smallest size, expected every one at full size")
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
    if asked.write and not failed:
        write_results(rows, machine)
        print(f"written to {RESULTS_FILE} and {SPEED_PAGE}")
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
