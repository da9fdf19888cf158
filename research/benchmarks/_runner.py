"""Run the benchmarks or proofs of a folder one after another; one that fails does not stop the others.

A benchmark or proof is a file whose name begins with a letter; a file whose name begins with an underscore is shared
code. A file that requires a missing data set is skipped, and its name is printed.
"""

from __future__ import annotations

import argparse
import os
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from importlib import import_module
from pathlib import Path
from typing import Any

from ._size import choose_smallest, is_smallest

NOT_MEASURED = "not measured"
"""First words of the reason for which a file was skipped, since a data set is missing."""


def names_in(folder: Path) -> list[str]:
    """Return the names of the benchmarks or proofs of a folder, in order."""
    return sorted(path.stem for path in folder.glob("*.py") if path.stem[0].isalpha())


def read_arguments(
    program: str,
    names: list[str],
    out: str,
    arguments: list[str] | None = None,
    parents: Sequence[argparse.ArgumentParser] = (),
) -> tuple[list[str], Path]:
    """Return the names that were asked for, or every name, and the file for the figures; choose the size.

    `parents` have further options of the program, which the help lists too.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m research.{program}", description=f"Files of {program}: {', '.join(names)}", parents=parents
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to run; everything if none is named")
    parser.add_argument("--out", type=Path, default=Path(out), help=f"where the figures are written; {out} by default")
    parser.add_argument(
        "--smallest", action="store_true", help="run at the smallest size, which shows only that everything runs"
    )
    asked = parser.parse_args(arguments)
    files = [name for name in asked.names if name.endswith(".json")]
    unknown = sorted(set(asked.names) - set(names) - set(files))
    if unknown or len(files) > 1:
        parser.error(f"found {', '.join(unknown or files)}, expected some of {', '.join(names)}")
    if asked.smallest:
        choose_smallest()
    return [name for name in asked.names if name not in files] or names, Path(files[0]) if files else asked.out


def limit_to_one_thread() -> None:
    """Limit linear algebra to one thread, in Pellucid, in reference methods and in started commands.

    Pellucid's functions use one thread each. A reference method with one thread per core would use more of the
    machine than Pellucid, and would be slower when another program uses a core.
    """
    from pellucid._processes import THREAD_VARIABLES

    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))


def check_one_thread(benchmark: str) -> None:
    """Raise if a library that is loaded would use several threads for linear algebra."""
    from threadpoolctl import threadpool_info

    several = [f"{one['filepath']} ({one['num_threads']})" for one in threadpool_info() if one["num_threads"] > 1]
    if several:
        found = ", ".join(several)
        raise RuntimeError(f"{benchmark}: found libraries with several threads, expected one each: {found}")


def run_all(
    package: str, names: list[str], rows_of: Callable[[Any], Any], executor: Executor | None = None
) -> tuple[list, list[str]]:
    """Return the rows of every named module of a package, and the names of those that failed.

    They run one after another, or all on the workers of an `executor`, which import this package and see its folder.
    """
    jobs = [(package, name, rows_of, is_smallest()) for name in names]
    if executor is None:
        found = (rows_of_one(*job) for job in jobs)
    else:
        begun = [executor.submit(rows_of_one, *job) for job in jobs]
        found = (each.result() for each in begun)
    rows, failed = [], []
    for name, (made, why) in zip(names, found, strict=True):
        rows += made
        if why:
            print(f"{name}: {why}", flush=True)
            failed += [name] * (not why.startswith(NOT_MEASURED))
    return rows, failed


def rows_of_one(package: str, name: str, rows_of: Callable[[Any], Any], smallest: bool) -> tuple[list, str]:
    """Return the rows of one module of a package, and why there are not more: empty, or the text of an error."""
    from pellucid._errors import DatasetError

    if smallest:
        choose_smallest()
    rows = []
    try:
        for row in rows_of(import_module(f"research.{package}.{name}")):
            rows.append(row)  # what came before a failure is kept
    except DatasetError as error:
        return rows, f"{NOT_MEASURED}: {error}"
    except Exception:
        return rows, traceback.format_exc()
    return rows, ""
