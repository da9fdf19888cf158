"""Install Pellucid's wheel for aarch64 in an emulated Debian 13, fit a joint there, export a model, and test the core.

``python packaging/emulated_root.py dist`` unpacks Debian's packages for arm64 into a folder that becomes the root, and
the wheels that ``pip install pellucid`` would choose there. It needs `debootstrap`, `qemu-user-static` and the right to
make namespaces, and a Linux from 6.7 on, where a namespace has its own list of emulators. The machine's own list stays
as it is.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bare_root import inside
from later_pythons import later_pythons
from wheel_use import CORE_TESTS, FIT

CHECKOUT = Path(__file__).parents[1]

EMULATOR = "/usr/bin/qemu-aarch64-static"
PROCESSOR = "cortex-a72"
"""What it emulates: the processor of a Raspberry Pi 4. Qemu's own choice signs addresses, which takes long."""

DEBIAN = "trixie"
PYTHON = "3.13"
"""Release of Debian, and the Python that it has."""

LIBC = "aarch64-manylinux_2_40"
"""The newest C library that uv knows, older than the one of this Debian."""

ELF_HEADER = r"\x7fELF\x02\x01\x01" + 9 * r"\x00" + r"\x02\x00\xb7\x00"
ELF_MASK = 7 * r"\xff" + r"\x00" + 8 * r"\xff" + r"\xfe\xff\xff\xff"
"""First bytes of a program for aarch64, and which of their bits count."""

REGISTER = f"""
mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc
printf %s ':aarch64:M::{ELF_HEADER}:{ELF_MASK}:{EMULATOR}:F' >/proc/sys/fs/binfmt_misc/register
"""
"""Shell commands that let the kernel open the emulator now (F), so that the root needs none."""

ENVIRONMENT = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "OPENBLAS_NUM_THREADS": "1", "QEMU_CPU": PROCESSOR}
"""Environment of what runs in the root."""

USE = f"""
import json, platform, sys
from pathlib import Path
import pytest
{FIT}
pl.export(pl.cards.load("dynamixel-xl330"), "mjx", "/tmp/mjx")
class Count:
    passed = 0
    def pytest_runtest_logreport(self, report):
        self.passed += report.when == "call" and report.passed
count = Count()
status = pytest.main(["-q", "-p", "no:cacheprovider", *{CORE_TESTS}], plugins=[count])
print(json.dumps(dict(machine=platform.machine(), python=platform.python_version(), module=Path(_core.__file__).name,
                      inertia=fit["inertia"].value, exported=len(list(Path("/tmp/mjx").iterdir())),
                      tests_passed=count.passed)))
sys.exit(status)
"""
"""What a user does: import, fit, export; and tests of the core. One process, since imports take most of the time."""


def missing_tools() -> list[str]:
    """Return the names of Debian's packages that are needed and not installed."""
    needed = {"debootstrap": "debootstrap", EMULATOR: "qemu-user-static"}
    return [package for tool, package in needed.items() if shutil.which(tool) is None]


def main(folder: Path) -> dict[str, str | float]:
    """Return what a user's commands gave in the root, and how many tests of the core passed there.

    Raises
    ------
    subprocess.CalledProcessError
        If a library has no wheel, or a command or test fails.
    """
    wheel = next(folder.glob("pellucid-*-abi3-*aarch64.whl"))
    with tempfile.TemporaryDirectory() as made:
        root = Path(made)
        unpack_debian(root)
        packages = root / "usr" / "local" / "lib" / f"python{PYTHON}" / "dist-packages"
        uv = Path(sys.executable).with_name("uv")
        install = [uv, "pip", "install", "--quiet", "--python-platform", LIBC, "--python-version", PYTHON]
        subprocess.run([*install, "--only-binary", ":all:", "--target", packages, wheel, "pytest"], check=True)
        if same := later_pythons().get(PYTHON):
            # The emulated one takes minutes to compile modules.
            subprocess.run([same, "-m", "compileall", "-q", packages], check=False, stdout=subprocess.DEVNULL)
        shutil.copytree(CHECKOUT / "tests", root / "checkout" / "tests", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copytree(CHECKOUT / "lab" / "src", root / "checkout" / "lab")  # tests share a study that the lab records
        shutil.copy2(CHECKOUT / "pyproject.toml", root / "checkout")
        start = time.perf_counter()
        run = ["/usr/bin/env", "-C", "/checkout", "PYTHONPATH=lab", "/usr/bin/python3", "-P", "-c", USE]
        used = json.loads(inside(root, run, ENVIRONMENT, REGISTER).splitlines()[-1])
        return {"wheel": wheel.name, "emulator": Path(EMULATOR).name, "seconds": time.perf_counter() - start, **used}


def unpack_debian(root: Path) -> None:
    """Unpack Debian's Python and what it depends on, without running what the packages run when they are installed."""
    subprocess.run(["debootstrap", "--arch=arm64", "--download-only", "--variant=minbase", "--include=python3", DEBIAN,
                    root], check=True, stdout=subprocess.DEVNULL)  # fmt: skip
    archives = root / "var" / "cache" / "apt" / "archives"
    for package in sorted(archives.glob("*.deb"), key=lambda path: (not path.name.startswith("base-files"), path.name)):
        subprocess.run(["dpkg-deb", "--extract", package, root], check=True)
    shutil.rmtree(archives)


if __name__ == "__main__":
    if missing := missing_tools():
        sys.exit(f"not installed: {', '.join(missing)}")
    print(json.dumps(main(Path(sys.argv[1] if len(sys.argv) > 1 else "dist")), indent=1))
