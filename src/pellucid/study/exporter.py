"""What `export` writes: a product as its domain offers it, and what a caller asks for.

Exporters of C share the functions on the core's headers, and on the folder that is written.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import numpy as np

from .._atomic import remove_leftovers, write_text_atomically
from .._domains import offered
from .._errors import PellucidError
from .answer import Answer, Step
from .study import Study


@dataclass(frozen=True)
class ExportRequest:
    """What a caller of `export` asks for; its arguments are described there."""

    study: Study
    to: str = "c"
    out: Path | None = None
    card: str | None = None
    slider: float | None = None
    participant: str | None = None
    controller: str | None = None
    exponents: tuple[float, float] | None = None
    load: tuple[float, float] | None = None
    held: tuple[float, float] | None = None
    period: float | None = None
    probe: bool | None = None
    unmeasured: bool = False
    fmi: int | None = None
    allow_outside: bool = False
    overwrite: bool = False


class Exporter(ABC):
    """A product that can be exported: which requests are for it, which options it has, and how it is written."""

    kinds: ClassVar[tuple[str, ...]]  # Values of `to` that name the product
    order: ClassVar[int]  # Exporters are asked in this order; the first one that fits writes
    unused: ClassVar[tuple[str, ...]] = ()  # Options that the product does not have
    why_unused: ClassVar[str] = ""  # The reason, as an error message ends with it
    question: ClassVar[str] = "Can this model be exported?"  # What its answer answers

    def fits(self, request: ExportRequest) -> bool:
        """Return whether a request with one of the `kinds` is for this product."""
        return True

    def place(self, request: ExportRequest) -> str:
        """Return how an error message names a request."""
        return f"export to {request.to} of {request.study.name}"

    def require_options(self, request: ExportRequest) -> None:
        """Raise a PellucidError if the request has an option that the product does not have."""
        given = ((name, getattr(request, name)) for name in self.unused)
        found = [name for name, value in given if value is not None and value is not False]
        if found:
            raise PellucidError(f"{self.place(request)}: found {', '.join(found)}, expected none: {self.why_unused}")

    @abstractmethod
    def export(self, request: ExportRequest) -> Path:
        """Write the product and return its folder or file."""

    def describe(self, request: ExportRequest, place: Path) -> str:
        """Return in a sentence what was written."""
        return f"{request.to} is written to {place}"

    def next_step(self, request: ExportRequest, place: Path) -> Step:
        """Return what to do with what was written."""
        return Step(f"Read {place / 'README.md'}" if place.is_dir() else f"Use {place}")

    def make_answer(self, request: ExportRequest, place: Path) -> Answer:
        """Return the answer of an export that was written to `place`."""
        said, step = self.describe(request, place), self.next_step(request, place)
        return Answer(self.question, "yes", said, next=(step,))


def find_exporter(request: ExportRequest, kind: type = Exporter) -> Exporter:
    """Return the exporter that a request is for, with its options checked.

    Raises
    ------
    PellucidError
        If no exporter knows `to`, or the request has an option that the product does not have.
    """
    fitting = (each() for each in offered("EXPORTER_CLASSES") if issubclass(each, kind))
    known = sorted(fitting, key=lambda each: each.order)
    exporter = next((each for each in known if request.to in each.kinds and each.fits(request)), None)
    if exporter is None:
        names = " or ".join(f'"{name}"' for name in dict.fromkeys(name for each in known for name in each.kinds))
        raise PellucidError(f'export: found to = "{request.to}", expected {names}')
    exporter.require_options(request)
    return exporter


HEADER_FOLDER = "include/pellucid"
"""Folder of the core's headers in the exported folder."""


OUTPUT_FILE = "test/vector_outputs.h"
"""File with this machine's outputs for the test vector."""


COMPILER_PROGRAMS = ("make", "cc", "c++")
"""Programs that are needed to play the test vector."""


MAX_FLOAT_LITERAL = "3.40282347e+38f"
"""Literal of the largest float, which stands for the absence of a limit."""


def core_headers() -> Path:
    """Return the folder of the core's headers: next to the sources in a checkout, inside an installed package."""
    package = Path(__file__).parents[1]
    for folder in (package / "include", package.parents[1] / "include"):
        if (folder / "pellucid" / "math.hpp").is_file():
            return folder
    raise PellucidError(
        f"{package}: found no headers of the core, expected include/pellucid: run make demo again in the clone"
    )


def needed_headers(header: str) -> list[str]:
    """Return the names of a header of the core and of all headers that it includes."""
    folder, found, waiting = core_headers() / "pellucid", set(), [header]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += re.findall(r'#include "([^"]+)"', (folder / name).read_text(encoding="utf-8"))
    return sorted(found)


def header_files(names: Iterable[str]) -> dict[str, str]:
    """Return the texts of headers of the core by their paths in an exported folder."""
    folder = core_headers() / "pellucid"
    return {f"{HEADER_FOLDER}/{name}": (folder / name).read_text(encoding="utf-8") for name in names}


def refuse_other_makefile(out: Path) -> None:
    """Raise a PellucidError if the folder has a makefile that make would prefer to the controller's own."""
    obeyed = {"GNUmakefile", "makefile"}.intersection(path.name for path in (out.iterdir() if out.is_dir() else ()))
    if obeyed:
        raise PellucidError(f"{out}: found {obeyed.pop()}, expected none: make would use it instead of Makefile")


def write_files(files: Mapping[str, str], out: Path) -> Path:
    """Write a controller's files, and remove the outputs of an earlier one."""
    remove_leftovers(out, *(out / folder for folder in dict.fromkeys(Path(name).parent for name in files)))
    (out / OUTPUT_FILE).unlink(missing_ok=True)
    for name, text in files.items():
        write_text_atomically(out / name, text)
    return out


def record_outputs(files: Mapping[str, str], out: Path) -> list[str]:
    """Return the lines that this machine prints for the test vector; none without a compiler."""
    if not all(map(shutil.which, COMPILER_PROGRAMS)):
        return []
    # Only the files that were just rendered are compiled, whatever else is in the folder.
    with TemporaryDirectory() as scratch:
        for name, text in files.items():
            path = Path(scratch) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        run = subprocess.run(["make", "-s", "record"], cwd=scratch, capture_output=True, text=True)
    if run.returncode:
        raise PellucidError(f"{out}: found that it does not compile:\n{run.stderr.strip()}")
    return run.stdout.splitlines()


def float_literal(x: float) -> str:
    """Return a C literal that is read back as the same float."""
    single = np.float32(x)
    if np.isinf(single):
        return MAX_FLOAT_LITERAL if x > 0 else f"-{MAX_FLOAT_LITERAL}"
    return f"{np.format_float_scientific(single, unique=True, trim='0')}f"
