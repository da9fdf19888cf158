"""Run the proofs named, or every one; print a table, write evidence.json: rows of the form of a study's results.json.

A proof is a file of this folder named after what it shows, with `rows()`, which yields `ResultRow`s of the command
"evidence".
"""

import argparse
from importlib import import_module
from pathlib import Path

from pellucid.recordings.results import write_rows

NAMES = sorted(path.stem for path in Path(__file__).parent.glob("*.py") if not path.stem.startswith("_"))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m evidence", description="Proofs: " + ", ".join(NAMES))
    parser.add_argument("names", nargs="*", metavar="NAME", help="proofs to run; all if none is named")
    parser.add_argument("--out", type=Path, default=Path("evidence.json"), help="where the figures are written")
    told = parser.parse_args()
    unknown = sorted(set(told.names) - set(NAMES))
    if unknown:
        parser.error(f"found {', '.join(unknown)}, expected some of {', '.join(NAMES)}")
    rows = [row for name in told.names or NAMES for row in import_module(f".{name}", __package__).rows()]
    width = max((len(row.id) for row in rows), default=0)
    for row in rows:
        value = "none" if row.value is None else f"{row.value:.4g}"
        print(f"{row.id:<{width}}  {value:>10} {row.unit:<6} {row.note}")
    told.out.unlink(missing_ok=True)
    write_rows(told.out, "evidence", rows)
    print(f"written to {told.out}")


if __name__ == "__main__":
    main()
