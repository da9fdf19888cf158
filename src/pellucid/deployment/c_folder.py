"""A controller as a folder of C and C++: headers, constants, interface, test vector, and what builds it."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from .. import _core
from .._atomic import remove_leftovers, write_text_atomically
from .._errors import PellucidError
from ..control.control_law import LAWS, LawSensor
from ..models.fields import COORDINATE_UNITS, Field, model_fields
from .controller_values import ControllerValues
from .replay_vector import VARIANTS, replay_vector

TEMPLATES = {
    "pellucid_controller.h": "",
    "pellucid_controller.cpp": "",
    "pellucid_constants.h": "",
    "Makefile": "",
    "CMakeLists.txt": "",
    "README.md": "",
    **dict.fromkeys(
        ("vector_inputs.h", "replay.h", "record.c", "check.c", "count.c", "say.h", "say_host.c", "m4.c", "m4.ld"),
        "test",
    ),
}
"""What is rendered, and the folder that it goes to."""

HEADERS, OUTPUTS = "include/pellucid", "test/vector_outputs.h"
"""Where the core's headers are, and what this machine answered to the test vector."""

COMPILERS = ("make", "cc", "c++")
"""What playing the test vector needs."""

LARGEST = "3.40282347e+38f"
"""The largest float, which stands for no limit."""


def core_headers() -> Path:
    """Where the core's headers are: beside the sources in a checkout, inside the package where it is installed."""
    package = Path(__file__).parents[1]
    for folder in (package / "include", package.parents[1] / "include"):
        if (folder / "pellucid" / "math.hpp").is_file():
            return folder
    raise PellucidError(
        f"{package}: found no headers of the core, expected include/pellucid: run make demo again in the clone"
    )


def needed_headers(header: str) -> list[str]:
    """A header of the core, and all that it includes."""
    folder, found, waiting = core_headers() / "pellucid", set(), [header]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += re.findall(r'#include "([^"]+)"', (folder / name).read_text(encoding="utf-8"))
    return sorted(found)


def write_c_folder(study: str, values: ControllerValues, out: Path) -> Path:
    """Write the folder; files that it has from before are replaced, all others stay."""
    refuse_other_makefile(out)
    law = LAWS[values.law]
    headers = sorted({*needed_headers(law.header), *needed_headers("supervisor.hpp"), "watchdog.hpp"})
    files = {f"{HEADERS}/{name}": (core_headers() / "pellucid" / name).read_text(encoding="utf-8") for name in headers}

    def unit(of: Field | LawSensor) -> str:
        return of.unit(values.motion, values.effort_unit)

    vector = replay_vector(values)
    content = {
        "law": law,
        "values": values,
        "supervision": values.supervised.supervision,
        "supervisor": model_fields("supervisor"),
        "storage": _core.supervised_storage(values.law),
        "faults": _core.FAULTS,
        "modes": _core.MODES,
        "variants": VARIANTS,
        "study": study,
        "version": version("pellucid"),
        "vector": vector,
        "headers": headers,
        "unit": unit,
        "coordinate": COORDINATE_UNITS[values.motion],
        "effort_unit": values.effort_unit,
        "literal": literal,
    }
    files |= {place_of(name): rendered(f"{name}.j2", **content) for name in TEMPLATES}
    files |= _answers(files, out, vector.motion)
    return put_down(files, out)


def refuse_other_makefile(out: Path) -> None:
    """PellucidError where make would obey a file that is not the controller's own."""
    obeyed = {"GNUmakefile", "makefile"}.intersection(path.name for path in (out.iterdir() if out.is_dir() else ()))
    if obeyed:
        raise PellucidError(f"{out}: found {obeyed.pop()}, expected none: make would obey it, not the controller's own")


def put_down(files: Mapping[str, str], out: Path) -> Path:
    """Write a controller's files; answers of another are taken away."""
    remove_leftovers(out, *(out / folder for folder in dict.fromkeys(Path(name).parent for name in files)))
    (out / OUTPUTS).unlink(missing_ok=True)
    for name, text in files.items():
        write_text_atomically(out / name, text)
    return out


def _answers(files: Mapping[str, str], out: Path, motion: int) -> dict[str, str]:
    """This machine's to the test vector, as one file more; none without a compiler."""
    lines = recorded(files, out)
    outputs = [(int(bits, 16), int(said)) for bits, said in (line.split() for line in lines)]
    refuse_faults(out, [said for _, said in outputs[:motion]])
    return {OUTPUTS: rendered("vector_outputs.h.j2", outputs=outputs)} if lines else {}


def refuse_faults(out: Path, said: Iterable[int]) -> None:
    """PellucidError where what was said of a motion names a fault."""
    wrong = next((word & 0xFF for word in said if word & 0xFF), 0)
    if wrong:
        raise PellucidError(f"{out}: found fault {wrong} in the test vector's motion, expected none")


def recorded(files: Mapping[str, str], out: Path) -> list[str]:
    """Lines that this machine says to the test vector; none without a compiler."""
    if not all(map(shutil.which, COMPILERS)):
        return []
    # Nothing is compiled but what was just rendered, whatever lies in the folder already.
    with TemporaryDirectory() as scratch:
        for name, text in files.items():
            path = Path(scratch) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        run = subprocess.run(["make", "-s", "record"], cwd=scratch, capture_output=True, text=True)
    if run.returncode:
        raise PellucidError(f"{out}: found that it does not compile:\n{run.stderr.strip()}")
    return run.stdout.splitlines()


@contextmanager
def copied(folder: Path) -> Iterator[Path]:
    """A controller's own files in a folder that goes again: what else lies beside them is neither compiled nor run."""
    names = [OUTPUTS, *map(place_of, TEMPLATES)]
    names += [f"{HEADERS}/{path.name}" for path in (core_headers() / "pellucid").glob("*.hpp")]
    with TemporaryDirectory() as scratch:
        for name in names:
            if (folder / name).is_file():
                (Path(scratch) / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(folder / name, Path(scratch) / name)
        yield Path(scratch)


def check_here(folder: Path) -> tuple[int, int] | None:
    """Play the test vector on this machine, as ``make check`` does."""
    if not (folder / OUTPUTS).is_file() or not all(map(shutil.which, COMPILERS)):
        return None
    with copied(folder) as copy:
        run = subprocess.run(["make", "-s", "check"], cwd=copy, capture_output=True, text=True)
    said = dict(line.split() for line in run.stdout.splitlines() if len(line.split()) == 2)
    if not {"steps", "wrong"} <= set(said):
        raise PellucidError(f"{folder}: make check failed:\n{run.stderr.strip()}")
    return int(said["steps"]), int(said["wrong"])


def place_of(template: str) -> str:
    """Where a rendered template goes in the folder."""
    return f"{TEMPLATES[template]}/{template}".lstrip("/")


def rendered(template: str, **content: object) -> str:
    """A template filled in."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pellucid.deployment", "templates"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=_within_a_line,
    )
    return environment.get_template(template).render(**content)


def _within_a_line(x: object) -> object:
    """What is put into a template: no name, unit or remark ends a comment, begins one or goes on in the next line."""
    if not isinstance(x, str):
        return x
    x = re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029\\]", " ", x)
    return re.sub(r"\*(?=/)|/(?=[*/])|\?(?=\?)", r"\g<0> ", x)


def literal(x: float) -> str:
    """A float that reads back as the same bits."""
    single = np.float32(x)
    if np.isinf(single):
        return LARGEST if x > 0 else f"-{LARGEST}"
    return f"{np.format_float_scientific(single, unique=True, trim='0')}f"
