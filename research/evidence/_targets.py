"""The core and an exported controller, compiled for systems that are not here, by the compiler of PyPI's `ziglang`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pellucid
from pellucid.controllers.export.c_folder import EXACT_FLAGS
from pellucid.study.exporter import core_headers
from pellucid.study.results import ResultRow

TARGETS = ("aarch64-macos", "x86_64-windows-gnu", "aarch64-linux-gnu")
"""Systems for which is compiled."""

CXX_OPTIONS = ("-std=c++17", *EXACT_FLAGS.split())
"""Compiler options of C++."""


def compiler(language: str, target: str) -> list[str]:
    """Return the command of the compiler of C ("cc") or C++ ("c++") for a target."""
    return [sys.executable, "-m", "ziglang", language, "-target", target]


def core_source() -> str:
    """Return a source file that includes every header of the core."""
    headers = sorted(path.name for path in (core_headers() / "pellucid").glob("*.hpp"))
    return "".join(f"#include <pellucid/{name}>\n" for name in headers)


def failures(controller: Path, scratch: Path, target: str) -> list[str]:
    """Return which of the core and an exported controller's test program do not compile for a target."""
    core = scratch / "core.cpp"
    core.write_text(core_source(), encoding="utf-8")
    made = {name: str(scratch / f"{target}.{name}.o") for name in ("core", "controller", "check", "say")}
    include = [f"-I{controller / 'include'}", f"-I{controller}"]
    steps = {
        "core": [[*compiler("c++", target), *CXX_OPTIONS, f"-I{core_headers()}", "-c", str(core), "-o", made["core"]]],
        "controller": [
            [*compiler("c++", target), *CXX_OPTIONS, "-O2", "-fno-exceptions", "-fno-rtti", *include, "-c",
             str(controller / "pellucid_controller.cpp"), "-o", made["controller"]],
            *[[*compiler("cc", target), "-std=c11", "-O2", *include, "-c", str(controller / "test" / f"{file}.c"), "-o",
               made[name]] for name, file in (("check", "check"), ("say", "say_host"))],
            [*compiler("cc", target), made["controller"], made["check"], made["say"], "-o",
             str(scratch / f"{target}.program")],
        ],
    }  # fmt: skip
    return [
        name
        for name, commands in steps.items()
        if any(subprocess.run(command, capture_output=True).returncode for command in commands)
    ]


def rows(elbow: Path, scratch: Path) -> Iterator[ResultRow]:
    """How many targets the core and the test program of an exported controller compile for; nothing without ziglang."""
    if find_spec("ziglang") is None:
        return
    controller = pellucid.export(pellucid.open(elbow), "c", scratch / "targets_c", controller="fc")
    failed = {target: failures(controller, scratch, target) for target in TARGETS}
    words = "; ".join(f"{target}: {', '.join(names)}" for target, names in failed.items() if names) or "none"
    yield ResultRow("exports.targets.compiled", float(sum(not names for names in failed.values())), "1", "evidence",
                    "simulated", None, f"{', '.join(TARGETS)}: core and test program of an exported controller, "
                    f"compiled and linked, not run; failed: {words}")  # fmt: skip
