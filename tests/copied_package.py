"""A copy of the package to which a test adds something, and Python that imports the copy and not what is installed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pellucid
from pellucid import _core

ROOT = Path(__file__).parents[1]
# An editable install finds the package before any path does.
ALONE = "import sys\nsys.meta_path[:] = [f for f in sys.meta_path if 'Redirecting' not in type(f).__name__]\n"


def copied_package(folder: Path) -> Path:
    """``folder/src/pellucid`` with its core, ``pellucid_lab`` beside it, the core's headers beside ``folder/src``."""
    package = folder / "src" / "pellucid"
    here = Path(pellucid.__file__).parent
    shutil.copytree(here, package)  # with its bytecode, which stays valid: times are copied, too
    shutil.copy(_core.__file__, package)
    import pellucid_lab

    shutil.copytree(Path(pellucid_lab.__file__).parent, package.parent / "pellucid_lab")
    if not (package / "include").is_dir():
        shutil.copytree(here.parents[1] / "include", folder / "include")
    return package


def run_copied(source: Path, code: str, *arguments: object) -> subprocess.CompletedProcess:
    """Run code with the package that is below `source`."""
    return subprocess.run(
        [sys.executable, "-c", ALONE + code, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(source), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
