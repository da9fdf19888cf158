"""Run the proofs named, or every one; print a table, write evidence.json: rows of the form of a study's results.json.

A proof is a file of this folder named after what it shows, with `rows()`, which yields `ResultRow`s of the command
"evidence".
"""

import argparse
import sys
from operator import methodcaller
from pathlib import Path

from research.benchmarks._runner import names_in, read_arguments, run_all

NAMES = names_in(Path(__file__).parent)


def main() -> None:
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers run a proof each")
    others, arguments = parser.parse_known_args()
    names, out = read_arguments("evidence", NAMES, "evidence.json", arguments, [parser])
    from pellucid.people.design_columns import cluster
    from pellucid.study.results import write_rows

    with cluster(others.scheduler) as executor:
        rows, failed = run_all("evidence", names, methodcaller("rows"), executor)

    width = max((len(row.id) for row in rows), default=0)
    for row in rows:
        value = "none" if row.value is None else f"{row.value:.4g}"
        print(f"{row.id:<{width}}  {value:>10} {row.unit:<6} {row.note}")
    out.unlink(missing_ok=True)
    write_rows(out, "evidence", rows)
    print(f"written to {out}")
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
