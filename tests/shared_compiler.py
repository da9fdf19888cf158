"""A stand-in for compilers, first on PATH in the tests: no exported controller is compiled twice in one run of them.

A translation unit is known by the compiler, its options and the preprocessed source; a link by the objects' bytes. What
was compiled is kept in a folder that all processes of one run share. Anything that this stand-in does not understand,
and everything that fails, is left to the compiler itself.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

COMPILERS = ("cc", "c++", "gcc", "g++", "arm-none-eabi-gcc", "arm-none-eabi-g++")
"""Programs that may have a stand-in."""

EXPORT_MARK = "pellucid_controller.h"
"""A file that every exported controller has; calls outside of such a folder go to the compiler as they are."""

SOURCE_ENDINGS = (".c", ".cpp")
"""File name endings of what is preprocessed; every other file counts by its bytes."""


def install_stand_ins(folder: Path, kept: Path) -> None:
    """Write a stand-in for every compiler on PATH into `folder`; they keep what is compiled in `kept`."""
    folder.mkdir(parents=True, exist_ok=True)
    kept.mkdir(parents=True, exist_ok=True)
    for name in COMPILERS:
        compiler = shutil.which(name)
        if compiler is not None:
            stand_in = folder / name
            stand_in.write_text(
                f'#!/bin/sh\nexec "{sys.executable}" -I -S "{__file__}" "{kept}" "{compiler}" "$@"\n', encoding="utf-8"
            )
            stand_in.chmod(0o755)


def compile_once(kept: Path, compiler: str, arguments: list[str]) -> int:
    """Do what the compiler does with `arguments`, or copy what it did with the same; return its exit status."""
    key = _key(compiler, arguments)
    if key is None:
        return subprocess.run([compiler, *arguments]).returncode
    output = Path(arguments[arguments.index("-o") + 1])
    with open(kept / f"{key}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        made = kept / key
        if not made.exists():
            status = subprocess.run([compiler, *arguments]).returncode
            if status == 0:
                shutil.copy(output, kept / f"{key}.part")
                (kept / f"{key}.part").rename(made)
            return status
    output.unlink(missing_ok=True)
    shutil.copy(made, output)
    return 0


def _key(compiler: str, arguments: list[str]) -> str | None:
    """Return a digest of all that decides what a call makes; None if the call is not one output of given files."""
    if arguments.count("-o") != 1 or arguments[-1] == "-o" or any(a.startswith(("-M", "@")) for a in arguments):
        return None
    folders = {Path(), *(Path(a).parent for a in arguments if a.endswith(SOURCE_ENDINGS))}
    if not any((folder / EXPORT_MARK).is_file() for folder in folders):
        return None
    at = arguments.index("-o")
    rest = arguments[:at] + arguments[at + 2 :]
    digest = hashlib.sha256(f"{compiler}\0{os.stat(compiler).st_mtime_ns}\0".encode())
    files = 0
    for argument in rest:
        if argument.endswith(SOURCE_ENDINGS) and os.path.isfile(argument):
            options = [a for a in rest if a.startswith("-") and a not in ("-c", "-shared")]
            run = subprocess.run([compiler, *options, "-E", "-P", argument], capture_output=True)
            if run.returncode:
                return None
            digest.update(b"source\0" + run.stdout)
            files += 1
        elif not argument.startswith("-") and os.path.isfile(argument):
            digest.update(b"file\0" + Path(argument).read_bytes())
            files += 1
        elif not argument.startswith("-I"):  # a folder of headers counts by what the preprocessor takes from it
            digest.update(f"option\0{argument}\0".encode())
    return digest.hexdigest() if files else None


if __name__ == "__main__":
    sys.exit(compile_once(Path(sys.argv[1]), sys.argv[2], sys.argv[3:]))
