"""Install Pellucid's wheels where there is Python and nothing else, without a network, and run the demo there.

``python packaging/bare_root.py dist`` makes a folder that becomes the root: this Python with its standard library, the
libraries that every Linux of the wheel's tag has, and no compiler, no shell, no tool. It needs the right to make
namespaces (`unshare`), as root or as a user who may.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

LIBRARIES_OF_EVERY_LINUX = (
    "libstdc++.so.6",
    "libgcc_s.so.1",
    "libm.so.6",
    "libpthread.so.0",
    "libdl.so.2",
    "librt.so.1",
)
"""Shared libraries that a wheel may expect beside the C library: those of manylinux that our dependencies ask for."""

LEFT_OUT = ("site-packages", "test", "idlelib", "tkinter", "__pycache__", "config-*")
"""Parts of a standard library that no user needs."""

WHEELS_FOLDER = "wheels"
"""Folder in the new root that has every wheel, so that no network is needed."""

DEMO = (
    "import os, json, time, subprocess, sys\n"
    "start = time.perf_counter()\n"
    "subprocess.run([sys.executable, '-m', 'pellucid', '--help'], check=True, stdout=subprocess.DEVNULL)\n"
    "first = time.perf_counter() - start\n"
    "start = time.perf_counter()\n"
    "subprocess.run([sys.executable, '-m', 'pellucid', '--help'], check=True, stdout=subprocess.DEVNULL)\n"
    "second = time.perf_counter() - start\n"
    "start = time.perf_counter()\n"
    "subprocess.run([sys.executable, '-m', 'pellucid', 'demo', '--out', '/tmp/demo'], check=True)\n"
    "print(json.dumps({'help_first_s': first, 'help_s': second, 'demo_s': time.perf_counter() - start,\n"
    "                  'page_bytes': os.path.getsize('/tmp/demo/index.html')}))\n"
)
"""What runs in the root: the command's start-up twice, the first of which compiles modules, and the demo."""


ENTER = """
mount -t proc proc "$0/proc"
for node in null urandom; do
  touch "$0/dev/$node"
  mount --bind "/dev/$node" "$0/dev/$node"
done
mkdir -p "$0/dev/shm"  # every Linux has this folder; locks between processes are in it
mount -t tmpfs tmpfs "$0/dev/shm"
exec chroot "$0" "$@"
"""
"""Shell commands that enter the root, in namespaces of their own."""


def main(folder: Path) -> dict[str, float]:
    """Return what was measured: bytes of the wheels and of the installed environment, start-up and the demo's time.

    Raises
    ------
    subprocess.CalledProcessError
        If anything asks for a compiler, a network or a library that is not there.
    """
    wheels = sorted(folder.glob("*.whl"))
    here = "-abi3-" if sys.version_info >= (3, 12) else "-cp311-"
    ours = [w for w in wheels if here in w.name or "-none-any" in w.name]
    with tempfile.TemporaryDirectory() as made:
        root = Path(made)
        python, environment = copy_python(root), {"PATH": os.environ["PATH"]}
        house = root / WHEELS_FOLDER
        house.mkdir()
        wanted = [*map(str, ours), "pip"]
        run([sys.executable, "-m", "pip", "download", "--quiet", "--only-binary=:all:", "--dest", str(house), *wanted])
        pip = next(house.glob("pip-*.whl"))
        start = time.perf_counter()
        inside(root, [python, f"/{WHEELS_FOLDER}/{pip.name}/pip", "install", "--quiet", "--no-index", "--no-compile",
                      "--find-links", f"/{WHEELS_FOLDER}", "--root-user-action=ignore",
                      *[f"/{WHEELS_FOLDER}/{w.name}" for w in ours]], environment)  # fmt: skip
        installed = time.perf_counter() - start
        packages = next((root / python.lstrip("/")).parent.parent.glob("lib/python3.*/site-packages"))
        measured = {
            "wheel_bytes": float(sum(w.stat().st_size for w in ours)),
            "pellucid_bytes": float(size_of(packages / "pellucid")),
            "installed_bytes": float(size_of(packages)),
            "base_size_bytes": float(size_of(packages) - size_of(packages / "pellucid_lab")),
            "install_s": installed,
        }
        return measured | json.loads(inside(root, [python, "-c", DEMO], environment).splitlines()[-1])


def copy_python(root: Path) -> str:
    """Copy this Python and the shared libraries that it asks for; return its path in the root."""
    prefix = Path(sys.base_prefix)
    name = f"python{sys.version_info.major}.{sys.version_info.minor}"
    inner = root / "python"
    (inner / "bin").mkdir(parents=True)
    shutil.copy2(prefix / "bin" / name, inner / "bin" / name)
    shutil.copytree(
        prefix / "lib" / name, inner / "lib" / name, ignore=shutil.ignore_patterns(*LEFT_OUT), symlinks=False
    )
    (inner / "lib" / name / "site-packages").mkdir()
    asking = [inner / "bin" / name, *(inner / "lib" / name / "lib-dynload").glob("*.so")]
    needed = {path for file in asking for path in libraries_of(file)}
    cache = subprocess.run(["/sbin/ldconfig", "-p"], capture_output=True, text=True, check=True).stdout
    for line in cache.splitlines():
        if line.split(" ")[0].strip() in LIBRARIES_OF_EVERY_LINUX and "x86-64" in line:
            needed.add(Path(line.rsplit("=> ", 1)[1]))
    for path in needed:
        target = root / str(path).lstrip("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path.resolve(), target)
    for folder in ("tmp", "proc", "dev", "etc"):
        (root / folder).mkdir(exist_ok=True)
    return f"/python/bin/{name}"


def libraries_of(file: Path) -> list[Path]:
    """Return the shared libraries that a program or module asks the loader for."""
    said = subprocess.run(["ldd", str(file)], capture_output=True, text=True, check=False).stdout
    paths = [word for line in said.splitlines() for word in line.split() if word.startswith("/")]
    return [Path(path) for path in paths if Path(path).is_file()]


def inside(root: Path, command: list[str], environment: Mapping[str, str], before: str = "") -> str:
    """Run a command in the root, without a network; return what it printed.

    `before` are shell commands that run in the same namespaces before the root is entered.
    """
    namespaces = ["unshare", "--user", "--map-root-user", "--net", "--mount", "--pid", "--fork"]
    known = {"HOME": "/tmp", "LANG": "C.UTF-8", **environment}
    alone = ["env", "-i", *[f"{name}={value}" for name, value in known.items()]]
    found = subprocess.run(
        [*namespaces, *alone, "sh", "-e", "-c", f"{before}{ENTER}", str(root), *command],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if found.returncode:
        sys.stderr.write(found.stdout[-2000:] + found.stderr[-4000:])
        raise subprocess.CalledProcessError(found.returncode, command)
    return found.stdout


def run(command: list[str]) -> None:
    """Run a command on this machine."""
    subprocess.run(command, check=True)


def size_of(folder: Path) -> int:
    """Return the bytes of every file in a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1] if len(sys.argv) > 1 else "dist")), indent=1))
