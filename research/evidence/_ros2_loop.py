"""An exported package for ros2_control, compiled against stand-in headers and played in a simulated hardware loop."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pellucid
from pellucid.controllers.export.c_folder import EXACT_FLAGS
from pellucid.study.results import ResultRow

from ._fmu_replay import LAWS

STAND_INS = Path(__file__).parents[2] / "tests" / "ros2"
"""Folder of the stand-in headers and of the loop."""

WARNINGS = ("-Wall", "-Wextra", "-Werror")
"""Compiler warnings that are errors."""

TYPES = {"string": "std::string", "double": "double", "bool": "bool", "int": "std::int64_t"}
"""C++ type of a parameter for each type of generate_parameter_library."""

LISTENER = """
inline Params given;  // what a user has set
class ParamListener {
 public:
  template <class Node>
  explicit ParamListener(const std::shared_ptr<Node>&) {}
  Params get_params() const { return given; }
  bool is_old(const Params&) const { return true; }
};
"""
"""Stand-in for the generated listener."""


@dataclass(frozen=True)
class Played:
    """Result of the loop."""

    steps: int
    wrong: int  # steps that differ from the recorded outputs
    faults: int  # kinds of faults in the vector
    reached: int  # kinds of them that reached the lifecycle
    refused: bool  # whether numbers that the supervisor refuses fail the configuration
    activation: bool  # whether a latched fault keeps the controller from activation until its token is set
    reset: bool  # whether the law then runs again
    reference: bool  # whether the effort of a preceding controller is added within its limit


def parameter_header(text: str) -> str:
    """Return a stand-in for the header that generate_parameter_library makes of a file's text."""
    lines = [(len(line) - len(line.lstrip()), line.strip()) for line in text.splitlines() if line.strip()]
    name = lines[0][1].rstrip(":")
    made: list[str] = []
    depths: list[tuple[int, str]] = []
    for i, (depth, line) in enumerate(lines[1:], 1):
        while depths and depth <= depths[-1][0]:
            _, group = depths.pop()
            made.append(f"}} {group};")
        if not re.fullmatch(r"[a-z]\w*:", line) or line in ("validation:",):
            continue
        key, following = line.rstrip(":"), lines[i + 1][1]
        if following.startswith("type:"):
            kind = TYPES[following.split()[1]]
            made.append(f"{kind} {key} = {lines[i + 2][1].removeprefix('default_value: ')};")
        else:
            made.append("struct {")
            depths.append((depth, key))
    made += [f"}} {group};" for _, group in reversed(depths)]
    config = text.split("\n  config:\n")[1]
    taken = "".join(f"p.config.{key} = c.{key}; " for key in re.findall(r"^    (\w+):$", config, re.MULTILINE))
    return (
        "#pragma once\n#include <cstdint>\n#include <memory>\n#include <string>\n#include <pellucid_controller.h>\n"
        f"namespace {name} {{\nstruct Params {{\n" + "\n".join(made) + f"\n}};\n{LISTENER}"
        f"inline void take(Params& p, const pellucid_config& c) {{ {taken}}}\n}}\n"
    )


def play(package: Path, scratch: Path) -> Played:
    """Compile a package with warnings as errors and play its vector; raises CalledProcessError where either fails."""
    (parameters,) = package.glob("src/*_parameters.yaml")
    name = parameters.stem.removesuffix("_parameters")
    text = parameters.read_text(encoding="utf-8")
    header = scratch / "include" / name / f"{name}_parameters.hpp"
    header.parent.mkdir(parents=True, exist_ok=True)
    header.write_text(parameter_header(text), encoding="utf-8")
    sensors = re.findall(r"^    (\w+):$", text.split("\n  sensors:\n")[1].split("\n  config:\n")[0], re.MULTILINE)
    places = [scratch / "include", package / "include", package / "include" / name, package / "controller",
              package / "controller" / "include", package / "controller" / "test", STAND_INS / "include"]  # fmt: skip
    listed = " ".join(f"EACH({sensor})" for sensor in sensors)
    options = ["-std=c++17", "-O1", *EXACT_FLAGS.split(), *WARNINGS]
    options += [*[f"-I{place}" for place in places], f"-DPACKAGE={name}", f"-DSENSORS(EACH)={listed}"]
    sources = [package / "src" / "controller.cpp", package / "controller" / "pellucid_controller.cpp",
               STAND_INS / "loop.cpp"]  # fmt: skip
    subprocess.run(["c++", *options, *map(str, sources), "-o", str(scratch / "loop")], check=True)
    run = subprocess.run([scratch / "loop"], check=True, capture_output=True, text=True)
    said = {key: int(value) for key, value in re.findall(r"^(\w+) (\d+)$", run.stdout, re.MULTILINE)}
    decided = (said[key] == 1 for key in ("refused", "activation", "reset", "reference"))
    return Played(said["steps"], said["wrong"], said["faults"], said["reached"], *decided)


def rows(elbow: Path, scratch: Path) -> Iterator[ResultRow]:
    """Whether the package of each law compiles, and how many steps of its vector differ."""
    wrong, compiled, faults, reached = 0, 0, 0, 0
    for law in LAWS:
        folder = pellucid.export(pellucid.open(elbow), "ros2_control", scratch / f"ros2_{law}", controller=law)
        made = scratch / f"loop_{law}"
        made.mkdir()
        played = play(folder, made)
        compiled += 1
        wrong += played.wrong
        faults += played.faults
        reached += played.reached
    note = f"packages of {', '.join(LAWS)}, against stand-in headers; not run under ROS 2"
    yield ResultRow("exports.ros2_control.compiled", float(compiled == len(LAWS)), "1", "evidence", "simulated", None,
                    f"every package compiles with {' '.join(WARNINGS)}: {note}")  # fmt: skip
    yield ResultRow("exports.ros2_control.wrong_bits", float(wrong), "1", "evidence", "simulated", None,
                    f"steps of the test vector that differ from the C export in a simulated loop, {note}")  # fmt: skip
    yield ResultRow("exports.ros2_control.faults_in_lifecycle", 100.0 * reached / faults, "%", "evidence", "simulated",
                    None, f"kinds of faults of the test vectors that reach the lifecycle, {note}")  # fmt: skip
