"""Write src/pellucid/_core.pyi from the signatures and docstrings of the installed module (needs nanobind and ruff)."""

import re
import subprocess
import sys
import textwrap
from pathlib import Path

from nanobind.stubgen import StubGen

from pellucid import _core

HEADER = """
from collections.abc import Callable, Sequence

from numpy import float32, float64
from numpy.typing import ArrayLike, NDArray

"""


def text(module: object) -> str:
    generator = StubGen(module=module, recursive=False, include_docstrings=True)
    generator.put(module)
    return generator.get()


def main() -> None:
    stub = text(_core)
    stub = re.sub(r"^from pellucid\._core import math.*\n", HEADER, stub, flags=re.M)
    stub = stub.replace("PARAMETER_NAMES: tuple = ...", "PARAMETER_NAMES: tuple[str, ...]")
    stub = re.sub(r"^instructions: str = .*$", "instructions: str", stub, flags=re.M)
    functions = re.sub(r"^def ", "@staticmethod\ndef ", text(_core.math), flags=re.M)
    stub += "\n\nclass math:\n" + textwrap.indent(functions.strip(), "    ") + "\n"
    path = Path(__file__).parents[1].joinpath("src", "pellucid", "_core.pyi")
    path.write_text(stub, encoding="utf-8")
    for command in (("format",), ("check", "--fix")):
        subprocess.run((sys.executable, "-m", "ruff", *command, "--quiet", path), check=True)


if __name__ == "__main__":
    main()
