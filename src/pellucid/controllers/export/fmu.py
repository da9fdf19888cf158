"""Write a supervised law as a functional mock-up unit (FMI) for co-simulation, from the exported C source.

Simulink, dSPACE, OpenModelica and FMPy import such a file. It holds the sources, the test vector and a binary for this
system if a compiler is installed.
"""

from __future__ import annotations

import io
import platform
import re
import shutil
import subprocess
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from uuid import UUID
from xml.etree import ElementTree

from ..._atomic import write_bytes_atomically
from ..._errors import PellucidError
from ...study.exporter import COMPILER_PROGRAMS, HEADER_FOLDER, float_literal
from ...units import base_powers
from ..control_law import LAWS
from ..supervisor_faults import SUPERVISOR_FAULTS_BY_NAME
from .c_folder import (
    CONSTANTS_FILE,
    EXACT_FLAGS,
    MAX_CONSTANTS_BYTES,
    MAX_OWNER_BYTES,
    OWNER_FILE,
    SAFE_FLAGS,
    c_content,
    c_files,
    constants_in,
    effort_unit_in,
    owner_text,
    parse_owner,
    refuse_other_owner,
    render,
)
from .controller_values import ControllerValues

FMI_VERSIONS = (3, 2)
"""Versions of FMI that can be written; the first one is the default."""

ENDING = ".fmu"
"""Ending of the file."""

SOURCE_NAMES = ("pellucid_controller.cpp", "pellucid_controller.h", CONSTANTS_FILE)
"""Files of the C folder from which the unit is compiled, together with the core's headers."""

VECTOR_NAMES = ("test/vector_inputs.h", "test/vector_outputs.h")
"""Files of the C folder with the test vector."""

FMI_TYPES = {
    3: {"real": "Float32", "word": "UInt32", "flag": "Boolean", "time": "Int64", "choice": "Enumeration"},
    2: {"real": "Real", "word": "Integer", "flag": "Boolean", "time": "Real", "choice": "Enumeration"},
}
"""Type of each kind of variable for each version of FMI."""

SAMPLE_FIELDS = (
    ("sequence", "word", "number of this measurement"),
    ("time_us", "time", "time of the measurement"),
    ("valid", "flag", "false: the sensor reports that the value is not valid"),
)
"""Name, kind and description of the fields of a sample in addition to its value."""

_ZIP_TIME = (1980, 1, 1, 0, 0, 0)
"""Time of every file in the archive: the same export gives the same bytes."""


@dataclass(frozen=True)
class UnitVariable:
    """A variable of the unit. `kind` is "real", "word" (32 bits), "flag", "time" [us] or "choice" (an enumeration)."""

    reference: int
    name: str
    kind: str
    causality: str
    place: str  # of its value in an instance, in C++
    start: str
    description: str
    unit: str = ""
    choices: str = ""  # name of its enumeration

    @property
    def is_set(self) -> bool:
        """Whether a caller sets it."""
        return self.causality != "output"

    def named(self, fmi: int) -> str:
        """Return its name: FMI 2.0 has times in seconds, without the ending that says microseconds."""
        return self.name.removesuffix("_us") if fmi == 2 and self.kind == "time" else self.name

    def unit_of(self, fmi: int) -> str:
        """Return its unit as plain text; integers of FMI 3.0 have none."""
        return "s" if fmi == 2 and self.kind == "time" else self.unit


def unit_variables(values: ControllerValues, content: Mapping[str, Any]) -> tuple[UnitVariable, ...]:
    """Return every variable of the unit but the time, in the order of their references."""

    def described() -> Iterator[tuple]:
        yield "now_us", "time", "input", "input.now_us", "0", "time of this step, used if stamps_given"
        for name, unit, meaning in _samples(values, content):
            at = f"input.{name}"
            yield f"{name}.value", "real", "input", f"{at}.value", "0.0", meaning, unit
            for field, kind, words in SAMPLE_FIELDS:
                start = "true" if kind == "flag" else "0"
                yield f"{name}.{field}", kind, "input", f"{at}.{field}", start, words
        yield "token", "word", "input", "input.token", "0", "answer to `challenge` that asks for a reset; otherwise 0"
        yield "stop", "flag", "input", "stop", "false", "true: the controller stops before this step (pellucid_stop)"
        yield "init", "flag", "input", "init", "false", "true: pellucid_init runs again, which does not reset a fault"
        yield (
            "stamps_given", "flag", "parameter", "stamps_given", "false",
            "true: one step per communication step, with the numbers and times of the inputs",
        )  # fmt: skip
        yield (
            "effort", "real", "output", "output.effort", "0.0",
            "for the drive: always finite, within effort_limit", values.effort_unit,
        )  # fmt: skip
        yield "fault", "choice", "output", "output.fault", "0", "why the controller stopped", "", "pellucid_fault"
        yield "steps", "word", "output", "output.steps", "0", "steps since the start; the heartbeat for a watchdog"
        yield (
            "enable", "flag", "output", "output.enable", "false",
            "false: the power stage must be off, whatever the effort",
        )  # fmt: skip
        yield "mode", "choice", "output", "output.mode", "0", "what the controller is doing", "", "pellucid_mode"
        yield "challenge", "word", "output", "output.challenge", "0", "`token` that a reset needs; 0 while all is well"
        numbers = {**values.numbers, **content["supervision"]}
        for field in (*content["law"].fields, *content["supervisor"]):
            start = float_literal(numbers[field.name]).rstrip("f")
            unit = content["unit"](field)
            place = f"config.{field.name}"
            yield place, "real", "parameter", place, start, field.sentence, "" if unit == "1" else unit

    return tuple(UnitVariable(i, *each) for i, each in enumerate(described(), start=1))


def _samples(values: ControllerValues, content: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield the name, unit and meaning of every sample of the input."""
    for sensor in LAWS[values.law].sensors:
        yield sensor.name, content["unit"](sensor), sensor.meaning
    yield "drive", values.effort_unit, "what the drive measures of its own effort; needed where drive_expected is 1"
    yield "joint", content["coordinate"], "a second encoder; needed where joint_expected is 1"


def write_fmu(
    study: str, values: ControllerValues, out: Path, *, name: str, owner: Mapping[str, str], fmi: int
) -> Path:
    """Write the unit of a law to the file `out`; `name` is that of the controller, `fmi` the version, 2 or 3."""
    model = "pellucid_" + re.sub(r"\W+", "_", name, flags=re.ASCII)
    content = c_content(study, values)
    files = c_files(content, out)
    variables = unit_variables(values, content)
    sources = {Path(path).name: files[path] for path in SOURCE_NAMES}
    sources |= {path.removeprefix("include/"): text for path, text in files.items() if path.startswith(HEADER_FOLDER)}
    wrapper = f"fmi{fmi}.cpp"
    shown = {
        **content,
        "fmi": fmi,
        "variables": variables,
        "samples": [sample[0] for sample in _samples(values, content)],
    }
    sources[wrapper] = render(wrapper, "fmu", **shown)
    # The token is that of these sources: a binary of another export refuses the description.
    blank = render("fmu_unit.hpp", "fmu", token="", **shown)
    digest = sha256("".join([*sources.values(), blank]).encode()).hexdigest()
    token = f"{{{UUID(digest[:32])}}}"
    sources["fmu_unit.hpp"] = render("fmu_unit.hpp", "fmu", token=token, **shown)
    compiled = (SOURCE_NAMES[0], wrapper)
    binary = compile_unit(sources, compiled, out)
    system, ending = _system(fmi)
    readme = render(
        "README.md",
        "fmu",
        binary=f"`{system}`" if binary else "",
        sources=compiled,
        steps=len(content["vector"].steps),
        law_sensors=[sensor.name for sensor in content["law"].sensors],
        drive_expected=content["supervision"]["drive_expected"] == 1.0,
        **shown,
    )
    inside: dict[str, bytes] = {
        "modelDescription.xml": description_text(model, token, values, content, variables, compiled, fmi),
        "documentation/README.md": readme.encode(),
        "documentation/index.html": f"<!DOCTYPE html><meta charset=utf-8><pre>{escape(readme)}</pre>\n".encode(),
        f"resources/{OWNER_FILE}": owner_text(owner).encode(),
        **{f"resources/{path}": files[path].encode() for path in VECTOR_NAMES if path in files},
        **{f"sources/{path}": text.encode() for path, text in sources.items()},
    }
    if fmi == 3:
        inside["sources/buildDescription.xml"] = build_text(model, compiled)
    if binary:
        inside[f"binaries/{system}/{model}.{ending}"] = binary
    return write_bytes_atomically(out, _archive(inside))


def _archive(files: Mapping[str, bytes]) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():
            archive.writestr(zipfile.ZipInfo(path, _ZIP_TIME), content, zipfile.ZIP_DEFLATED)
    return made.getvalue()


def compile_unit(sources: Mapping[str, str], compiled: tuple[str, ...], out: Path) -> bytes:
    """Return the shared library of the sources; nothing without a compiler. Error messages name `out`."""
    if not all(map(shutil.which, COMPILER_PROGRAMS)):
        return b""
    options = ["-std=c++17", "-O2", *EXACT_FLAGS.split(), *SAFE_FLAGS.split(), "-fPIC", "-fvisibility=hidden", "-I."]
    with TemporaryDirectory() as scratch:
        for path, text in sources.items():
            (Path(scratch) / path).parent.mkdir(parents=True, exist_ok=True)
            (Path(scratch) / path).write_text(text, encoding="utf-8")
        commands = [["c++", *options, "-c", name, "-o", f"{name}.o"] for name in compiled]
        # The C compiler links, so that the unit needs no C++ library.
        commands.append(["cc", "-shared", *[f"{name}.o" for name in compiled], "-lm", "-o", "unit"])
        for command in commands:
            run = subprocess.run(command, cwd=scratch, capture_output=True, text=True)
            if run.returncode:
                raise PellucidError(f"{out}: found that it does not compile:\n{run.stderr.strip()}")
        return (Path(scratch) / "unit").read_bytes()


def _system(fmi: int) -> tuple[str, str]:
    """Return the folder of this system's binaries and the ending of a library."""
    system, machine = platform.system().lower(), platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    ending = {"darwin": "dylib", "windows": "dll"}.get(system, "so")
    if fmi == 2 and machine == "x86_64":
        return {"linux": "linux64", "darwin": "darwin64", "windows": "win64"}.get(system, f"{machine}-{system}"), ending
    return f"{machine}-{system}", ending


def description_text(
    model: str, token: str, values: ControllerValues, content: Mapping[str, Any],
    variables: tuple[UnitVariable, ...], compiled: tuple[str, ...], fmi: int,
) -> bytes:  # fmt: skip
    """Return modelDescription.xml."""
    period = f"{values.numbers['period']:g}"
    token_name, version = ("guid", "2.0") if fmi == 2 else ("instantiationToken", "3.0")
    root = ElementTree.Element("fmiModelDescription", {
        "fmiVersion": version, "modelName": f"{content['title']}, study {content['study']}", token_name: token,
        "description": f"{content['title']} with its supervisor, by Pellucid from {', '.join(values.cards)}",
        "generationTool": f"pellucid {content['version']}", "variableNamingConvention": "structured",
        **({"numberOfEventIndicators": "0"} if fmi == 2 else {}),
    })  # fmt: skip
    states = ("canGetAndSetFMUstate", "canSerializeFMUstate") if fmi == 2 else (
        "canGetAndSetFMUState", "canSerializeFMUState")  # fmt: skip
    simulation = ElementTree.SubElement(root, "CoSimulation", {
        "modelIdentifier": model, "needsExecutionTool": "false", "canHandleVariableCommunicationStepSize": "true",
        **dict.fromkeys(states, "true"), **({"fixedInternalStepSize": period} if fmi == 3 else {}),
    })  # fmt: skip
    if fmi == 2:
        files = ElementTree.SubElement(simulation, "SourceFiles")
        for name in compiled:
            ElementTree.SubElement(files, "File", {"name": name})
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit in sorted({v.unit_of(fmi) for v in variables} - {""} | {"s"}):
        _add_unit(units, unit)
    types = ElementTree.SubElement(root, "TypeDefinitions")
    _add_enumeration(types, "pellucid_fault", {n: _fault_words(n) for n in content["faults"]}, fmi)
    _add_enumeration(types, "pellucid_mode", {n: "" for n in content["modes"]}, fmi)
    ElementTree.SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": "1", "stepSize": period})
    listed = ElementTree.SubElement(root, "ModelVariables")
    if fmi == 3:
        ElementTree.SubElement(listed, "Float64", {
            "name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous", "unit": "s",
        })  # fmt: skip
    for v in variables:
        _add_variable(listed, v, fmi)
    structure = ElementTree.SubElement(root, "ModelStructure")
    parent = ElementTree.SubElement(structure, "Outputs") if fmi == 2 else structure
    for index, v in enumerate(variables, start=1):
        if v.causality == "output":
            known = {"index": str(index)} if fmi == 2 else {"valueReference": str(v.reference)}
            ElementTree.SubElement(parent, "Unknown" if fmi == 2 else "Output", known)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _add_unit(units: ElementTree.Element, unit: str) -> None:
    element = ElementTree.SubElement(units, "Unit", {"name": unit})
    powers = base_powers(unit)
    known = {"kg", "m", "s", "A", "K", "rad"}
    if set(powers) <= known and all(float(p).is_integer() for p in powers.values()):
        ElementTree.SubElement(element, "BaseUnit", {symbol: f"{p:g}" for symbol, p in powers.items()})


def _add_enumeration(types: ElementTree.Element, name: str, items: Mapping[str, str], fmi: int) -> None:
    if fmi == 2:
        simple = ElementTree.SubElement(types, "SimpleType", {"name": name})
        element = ElementTree.SubElement(simple, "Enumeration")
    else:
        element = ElementTree.SubElement(types, "EnumerationType", {"name": name})
    for value, (item, words) in enumerate(items.items()):
        described = {"description": words} if words else {}
        ElementTree.SubElement(element, "Item", {"name": item, "value": str(value), **described})


def _fault_words(name: str) -> str:
    fault = SUPERVISOR_FAULTS_BY_NAME.get(name)
    return "" if fault is None else fault.when_of_law(1, 2.0)


def _add_variable(listed: ElementTree.Element, v: UnitVariable, fmi: int) -> None:
    kind, unit = FMI_TYPES[fmi][v.kind], v.unit_of(fmi)
    continuous = v.causality == "input" and v.kind == "real"
    variability = "fixed" if v.causality == "parameter" else "continuous" if continuous else "discrete"
    common = {
        "name": v.named(fmi), "valueReference": str(v.reference), "causality": v.causality, "variability": variability,
        "description": v.description, **({} if v.causality == "input" else {"initial": "exact"}),
    }  # fmt: skip
    typed = {
        **({"declaredType": v.choices} if v.choices else {}),
        **({"unit": unit} if unit and kind in ("Real", "Float32") else {}),
        "start": "0.0" if kind == "Real" and v.start == "0" else v.start,
    }
    if fmi == 2:
        ElementTree.SubElement(ElementTree.SubElement(listed, "ScalarVariable", common), kind, typed)
    else:
        ElementTree.SubElement(listed, kind, common | typed)


def build_text(model: str, compiled: tuple[str, ...]) -> bytes:
    """Return sources/buildDescription.xml, which says how the unit is compiled."""
    root = ElementTree.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = ElementTree.SubElement(root, "BuildConfiguration", {"modelIdentifier": model})
    options = f"-O2 {EXACT_FLAGS} {SAFE_FLAGS}"
    sources = ElementTree.SubElement(build, "SourceFileSet", {"language": "C++17", "compilerOptions": options})
    for name in compiled:
        ElementTree.SubElement(sources, "SourceFile", {"name": name})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def require_own_file(out: Path, owner: Mapping[str, str], *, overwrite: bool) -> None:
    """Raise a PellucidError if `out` is no file NAME.fmu, or one that holds something else than `owner`."""
    if out.suffix.lower() != ENDING:
        raise PellucidError(f"{out}: found another ending, expected a file NAME{ENDING}")
    if out.is_dir():
        raise PellucidError(f"{out}: found a folder, expected a file to write")
    if overwrite or not out.exists():
        return
    refuse_other_owner(out, read_unit_owner(out), owner)


def read_unit_owner(unit: Path) -> dict[str, str] | None:
    """Return the owner that an exported unit states; None if it states none."""
    return parse_owner(read_inside(unit, f"resources/{OWNER_FILE}", MAX_OWNER_BYTES))


def read_inside(unit: Path, name: str, most: int = MAX_CONSTANTS_BYTES) -> bytes:
    """Return a file of a unit with at most so many bytes; nothing if it is missing, too large or not readable."""
    try:
        with zipfile.ZipFile(unit) as archive:
            return archive.read(name) if archive.getinfo(name).file_size <= most else b""
    except (OSError, KeyError, ValueError, RuntimeError, zipfile.BadZipFile):
        return b""


def read_unit_constants(unit: Path) -> dict[str, float]:
    """Return the numbers of the law and the supervisor in an exported unit, as `read_constants` does of a folder."""
    return constants_in(read_inside(unit, f"sources/{CONSTANTS_FILE}"), unit)


def read_unit_effort_unit(unit: Path) -> str:
    """Return the unit of the efforts in an exported unit."""
    return effort_unit_in(read_inside(unit, f"sources/{CONSTANTS_FILE}"))


def describe_unit(unit: Path) -> str:
    """Return a sentence about an exported unit."""
    with zipfile.ZipFile(unit) as archive:
        names = archive.namelist()
    binary = next((Path(name).parent.name for name in names if name.startswith("binaries/")), None)
    version = "3.0" if "sources/buildDescription.xml" in names else "2.0"
    built = f"binary for {binary}" if binary else f"no binary: that needs {', '.join(COMPILER_PROGRAMS)}"
    return f"{unit}: FMI {version} unit for co-simulation, {built}. Read documentation/README.md in it."
