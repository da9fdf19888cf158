"""Write a controller as a folder of C and C++: headers, constants, interface, test vector and build files.

Read the numbers of a controller back from the ``pellucid_constants.h`` that an export wrote.

Mark the folder of an export with its contents, so that no other export replaces it by mistake.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ... import _core
from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from ..._given import read_given, require_folder, visible_text
from ...models.fields import COORDINATE_UNITS, Field, model_fields
from ...study.exporter import (
    COMPILER_PROGRAMS,
    HEADER_FOLDER,
    OUTPUT_FILE,
    core_headers,
    float_literal,
    header_files,
    needed_headers,
    record_outputs,
    refuse_other_makefile,
    write_files,
)
from ..control_law import LAWS, LawSensor
from ..supervised import SUPERVISOR_NAMES
from ..supervisor_faults import SUPERVISOR_FAULTS, describe_drive_watch
from .controller_values import ControllerValues
from .replay_vector import SUPERVISOR_VARIANTS, replay_vector

TEMPLATE_FOLDERS: dict[str, str] = {
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
"""Templates that are rendered, each with the folder of its file.

They are those of a single joint. Every other kind of controller has a folder of its own, whose templates extend them
and replace the blocks that differ. A template that such a folder lacks is the same for all kinds.
"""

INCIDENT_TEMPLATE_FOLDERS: dict[str, str] = {
    "pellucid_incident.h": "",
    "pellucid_incident.cpp": "",
    "play_incident.c": "test",
}
"""Templates of the incident recorder for a single joint, each with the folder of its file."""

EXACT_FLAGS = "-ffp-contract=off -fno-math-errno"
"""Compiler options without which another machine may round otherwise."""

SAFE_FLAGS = "-fno-exceptions -fno-rtti -fno-threadsafe-statics"
"""Compiler options of C++ without what a microcontroller has no memory for."""


def template_folder() -> Path:
    """Return the folder of the templates from which exported files are made."""
    return Path(__file__).parent / "templates"


def write_c_folder(study: str, values: ControllerValues, out: Path) -> Path:
    """Write the folder; files of an earlier export are replaced, all others stay."""
    refuse_other_makefile(out)
    return write_files(c_files(c_content(study, values), out), out)


def c_files(content: Mapping[str, Any], out: Path) -> dict[str, str]:
    """Return the texts of the controller's files by their paths in the folder; error messages name `out`."""
    files = header_files(content["headers"]) | render_all("", **content)
    files |= {template_path(name): render(name, **content) for name in INCIDENT_TEMPLATE_FOLDERS}
    return files | _output_files(files, out, content["vector"].motion)


def c_content(study: str, values: ControllerValues) -> dict[str, Any]:
    """Return what the templates of a controller of one joint, and of what is built around it, are filled in with."""
    law = LAWS[values.law]
    headers = sorted({*needed_headers(law.header), *needed_headers("incident_recorder.hpp"), "watchdog.hpp"})

    def unit(of: Field | LawSensor) -> str:
        return of.unit(values.motion, values.effort_unit)

    return {
        "law": law,
        "title": law.title,
        "values": values,
        "cards": values.cards,
        "checksums": values.checksums,
        "notes": values.all_notes,
        "instruments": values.listed_instruments,
        "watch": describe_drive_watch({**values.numbers, **values.supervised.supervision}, values.effort_unit),
        "period": values.numbers["period"],
        "supervision": values.supervised.supervision,
        "supervisor": model_fields("supervisor"),
        "storage": _core.supervised_storage(values.law),
        "faults": _core.FAULTS,
        "explained_faults": SUPERVISOR_FAULTS,
        "modes": _core.MODES,
        "variants": SUPERVISOR_VARIANTS,
        "study": study,
        "version": version("pellucid"),
        "vector": replay_vector(values),
        "headers": headers,
        "unit": unit,
        "coordinate": COORDINATE_UNITS[values.motion],
        "effort_unit": values.effort_unit,
        "literal": float_literal,
        "has_incident": True,
    }


def _output_files(files: Mapping[str, str], out: Path, motion: int) -> dict[str, str]:
    """Return the file with this machine's outputs for the test vector; none without a compiler."""
    lines = record_outputs(files, out)
    outputs = [(int(bits, 16), int(status)) for bits, status in (line.split() for line in lines)]
    refuse_faults(out, [status for _, status in outputs[:motion]])
    return {OUTPUT_FILE: render("vector_outputs.h", outputs=outputs)} if lines else {}


def refuse_faults(out: Path, statuses: Iterable[int]) -> None:
    """Raise a PellucidError if one of the status words `statuses` of a motion contains a fault."""
    wrong = next((word & 0xFF for word in statuses if word & 0xFF), 0)
    if wrong:
        raise PellucidError(
            f"{out}: found the fault {_core.FAULTS[wrong]} in the test vector's motion, expected none, because the "
            "robot is healthy; check [rig.limits] and [rig.instruments]"
        )


@contextmanager
def copied_controller(folder: Path) -> Iterator[Path]:
    """Copy a controller's own files into a temporary folder, so that no other file is compiled or run."""
    names = [OUTPUT_FILE, *map(template_path, (*TEMPLATE_FOLDERS, *INCIDENT_TEMPLATE_FOLDERS))]
    names += [f"{HEADER_FOLDER}/{path.name}" for path in (core_headers() / "pellucid").glob("*.hpp")]
    with TemporaryDirectory() as scratch:
        for name in names:
            if (folder / name).is_file():
                (Path(scratch) / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(folder / name, Path(scratch) / name)
        yield Path(scratch)


def check_on_host(folder: Path) -> tuple[int, int] | None:
    """Play the test vector on this machine as ``make check`` does; return the number of steps and of wrong ones.

    The result is None without recorded outputs or without a compiler.
    """
    if not (folder / OUTPUT_FILE).is_file() or not all(map(shutil.which, COMPILER_PROGRAMS)):
        return None
    with copied_controller(folder) as copy:
        run = subprocess.run(["make", "-s", "check"], cwd=copy, capture_output=True, text=True)
    counts = dict(line.split() for line in run.stdout.splitlines() if len(line.split()) == 2)
    if not {"steps", "wrong"} <= set(counts):
        raise PellucidError(f"{folder}: make check failed:\n{run.stderr.strip()}")
    return int(counts["steps"]), int(counts["wrong"])


def template_path(template: str) -> str:
    """Return the path of a rendered template in the exported folder."""
    return f"{(TEMPLATE_FOLDERS | INCIDENT_TEMPLATE_FOLDERS)[template]}/{template}".lstrip("/")


def render_all(kind: str, /, **content: object) -> dict[str, str]:
    """Return all files that templates give for a kind of controller ("" for a joint), by their paths in the folder."""
    return {template_path(name): render(name, kind, **content) for name in TEMPLATE_FOLDERS}


def render(template: str, kind: str = "", /, **content: object) -> str:
    """Return a template, or the one that extends it for the kind ("tree", "estimator"), filled in with `content`."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pellucid.controllers.export", "templates"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=_safe_in_comment,
    )
    own = [f"{kind}/{template}.j2"] if kind else []
    return environment.select_template([*own, f"{template}.j2"]).render(
        exact_flags=EXACT_FLAGS, safe_flags=SAFE_FLAGS, **content
    )


def _safe_in_comment(x: object) -> object:
    """Return a text for a template in which nothing ends a comment, begins one or starts a new line."""
    if not isinstance(x, str):
        return x
    x = re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029\\]", " ", x)
    return re.sub(r"\*(?=/)|/(?=[*/])|\?(?=\?)", r"\g<0> ", x)


CONSTANTS_FILE = "pellucid_constants.h"
"""File of an exported folder that holds the law's and the supervisor's numbers."""

MAX_CONSTANTS_BYTES = 1_000_000
"""Largest size of that file that is read [B]."""

MAX_FLOAT = 3.4028234e38
"""Magnitude from which on a number stands for the absence of a limit: it is that of the largest float."""

_NUMBER_PATTERN = re.compile(r"^\s*(-?[0-9.]+(?:e[+-]?[0-9]+)?)f, /\* (\w+) \[", re.MULTILINE)


def read_constants(folder: Path) -> dict[str, float]:
    """Return the numbers of an exported controller of one joint, by name, SI.

    Parameters
    ----------
    folder : Path
        Folder that `pellucid.export` wrote.

    Returns
    -------
    dict of str to float
        Numbers of the law and then of its supervisor, in the core's order, rounded to float32. The largest float is
        returned as infinity, which it stands for.

    Raises
    ------
    PellucidError
        If the file is missing, lacks a number of the supervisor, or states a number twice.
    """
    path = Path(folder) / CONSTANTS_FILE
    try:
        return constants_in(read_given(path, MAX_CONSTANTS_BYTES), path)
    except OSError as error:
        raise PellucidError(f"{path}: not readable: {error}") from None


def read_effort_unit(folder: Path) -> str:
    """Return the unit of the efforts of an exported controller of one joint."""
    return effort_unit_in(read_given(Path(folder) / CONSTANTS_FILE, MAX_CONSTANTS_BYTES))


def effort_unit_in(content: bytes) -> str:
    """Return the unit of the effort limit in the content of that file."""
    found = re.search(rb"/\* effort_limit \[([^\]]+)\]", content)
    assert found is not None
    return found[1].decode()


def constants_in(content: bytes, path: Path) -> dict[str, float]:
    """Return the numbers in the content of that file; errors name `path`."""
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise PellucidError(f"{path}: not readable: {error}") from None
    found = numbers_in(text, str(path))
    lacking = [name for name in SUPERVISOR_NAMES if name not in found]
    if lacking:
        raise PellucidError(f"{path}: found no {', '.join(lacking[:5])}, expected every number of the supervisor")
    return found


def numbers_in(text: str, where: str) -> dict[str, float]:
    """Return the numbers in the text of such a file by name, SI; errors say `where` it is from."""
    found: dict[str, float] = {}
    for number, name in _NUMBER_PATTERN.findall(text):
        if name in found:
            raise PellucidError(f"{where}: {name}: found it twice, expected it once")
        value = float(number)
        found[name] = math.copysign(math.inf, value) if abs(value) >= MAX_FLOAT else value
    return found


OWNER_FILE = "pellucid.json"
"""File of an exported folder that states what Pellucid wrote there."""

MAX_OWNER_BYTES = 100_000
"""An owner file has at most this size, since it holds only a few names."""


def require_own_folder(folder: Path, owner: Mapping[str, str], names: Iterable[str], *, overwrite: bool) -> None:
    """Raise a PellucidError if `folder` holds something else than the `owner` that is to be written.

    `names` are the files and folders that will be written in it; `overwrite` lets all of them be replaced.
    """
    require_folder(folder, "a folder to write to")
    if overwrite:
        return
    found = read_owner(folder)
    if found is None:
        there = sorted(name for name in {*names, OWNER_FILE} if (folder / name).exists())
        if there:
            raise PellucidError(
                f"{folder}: found {', '.join(there[:5])}, which an export of Pellucid did not write; expected none of "
                f"these files. {_WAY_OUT}"
            )
        return
    refuse_other_owner(folder, found, owner)


def refuse_other_owner(place: Path, found: Mapping[str, str] | None, owner: Mapping[str, str]) -> None:
    """Raise a PellucidError if what is at `place` does not state the `owner` of what is to be written."""
    if found is None or found != dict(owner):
        raise PellucidError(
            f"{place}: found {_describe_owner(found or {})}, expected {_describe_owner(owner)} or nothing. {_WAY_OUT}"
        )


def mark_own_folder(folder: Path, owner: Mapping[str, str]) -> Path:
    """Write the `owner` into its file in `folder`."""
    return write_text_atomically(folder / OWNER_FILE, owner_text(owner))


def owner_text(owner: Mapping[str, str]) -> str:
    """Return the text of an owner file."""
    return json.dumps(dict(owner), indent=1, ensure_ascii=False) + "\n"


_WAY_OUT = "Name another place with --out, or replace this one: --overwrite (overwrite=True)"
"""Advice at the end of the message that an export does not write into a folder."""


def read_owner(folder: Path) -> dict[str, str] | None:
    """Return the owner that a folder states; None if it has no readable owner file."""
    try:
        return parse_owner(read_given(folder / OWNER_FILE, MAX_OWNER_BYTES))
    except OSError:
        return None


def parse_owner(text: bytes) -> dict[str, str] | None:
    """Return the owner that the text of an owner file states; None if it states none."""
    try:
        found = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        return None
    whole = isinstance(found, dict) and all(isinstance(x, str) for x in found.values())
    return found if whole else None


def _describe_owner(owner: Mapping[str, str]) -> str:
    """Return a description of an owner."""
    stated = ", ".join(f"{key} {value}" for key, value in owner.items() if value)
    return visible_text(stated or "no export of Pellucid")[:300]
