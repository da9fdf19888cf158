"""A controller as a folder of C and C++: headers, constants, interface, test vector, and what builds it."""

from __future__ import annotations

import re
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

import numpy as np

from .._atomic import write_text_atomically
from .._errors import PellucidError
from ..control.control_law import LAWS, LawSensor
from ..models.fields import COORDINATE, Field
from .controller_values import ControllerValues
from .replay_vector import replay_vector

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

COMPILERS = ("make", "cc", "c++")
"""What `record` and `check_here` need."""

LARGEST = "3.40282347e+38f"
"""The largest float, which stands for no limit."""


def core_headers() -> Path:
    """Where the core's headers are: beside the sources in a checkout, inside the package where it is installed."""
    package = Path(__file__).parents[1]
    for folder in (package / "include", package.parents[1] / "include"):
        if (folder / "pellucid" / "math.hpp").is_file():
            return folder
    raise PellucidError(f"{package}: found no headers of the core, expected include/pellucid; install pellucid again")


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
    law = LAWS[values.law]
    headers = needed_headers(law.header)
    for name in headers:
        text = (core_headers() / "pellucid" / name).read_text(encoding="utf-8")
        write_text_atomically(out / "include" / "pellucid" / name, text)

    def unit(of: Field | LawSensor) -> str:
        return of.unit(values.motion, values.effort_unit)

    vector = replay_vector(values)
    content = {
        "law": law,
        "values": values,
        "study": study,
        "version": version("pellucid"),
        "vector": vector,
        "headers": headers,
        "unit": unit,
        "coordinate": COORDINATE[values.motion],
        "effort_unit": values.effort_unit,
        "literal": _literal,
    }
    for name, folder in TEMPLATES.items():
        write_text_atomically(out / folder / name, _render(f"{name}.j2", **content))
    (out / "test" / "vector_outputs.h").unlink(missing_ok=True)
    record(out, vector.motion)
    return out


def record(folder: Path, motion: int = 0) -> bool:
    """Let this machine answer the test vector, and write the answers down."""
    if not all(map(shutil.which, COMPILERS)):
        return False
    run = subprocess.run(["make", "-s", "record"], cwd=folder, capture_output=True, text=True)
    if run.returncode:
        raise PellucidError(f"{folder}: found that it does not compile:\n{run.stderr.strip()}")
    outputs = [(int(bits, 16), int(fault)) for bits, fault in (line.split() for line in run.stdout.splitlines())]
    write_text_atomically(folder / "test" / "vector_outputs.h", _render("vector_outputs.h.j2", outputs=outputs))
    shutil.rmtree(folder / "build")
    wrong = next((fault for _, fault in outputs[:motion] if fault), 0)
    if wrong:
        raise PellucidError(f"{folder}: found fault {wrong} in the test vector's motion, expected none: see its README")
    return True


def check_here(folder: Path) -> tuple[int, int] | None:
    """Play the test vector on this machine, as ``make check`` does."""
    if not (folder / "test" / "vector_outputs.h").is_file() or not all(map(shutil.which, COMPILERS)):
        return None
    run = subprocess.run(["make", "-s", "check"], cwd=folder, capture_output=True, text=True)
    shutil.rmtree(folder / "build", ignore_errors=True)
    said = dict(line.split() for line in run.stdout.splitlines() if len(line.split()) == 2)
    if not {"steps", "wrong"} <= set(said):
        raise PellucidError(f"{folder}: make check failed:\n{run.stderr.strip()}")
    return int(said["steps"]), int(said["wrong"])


def _render(template: str, **content: object) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pellucid.deployment", "templates"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(template).render(**content)


def _literal(x: float) -> str:
    """A float that reads back as the same bits."""
    single = np.float32(x)
    if np.isinf(single):
        return LARGEST if x > 0 else f"-{LARGEST}"
    return f"{np.format_float_scientific(single, unique=True, trim='0')}f"
