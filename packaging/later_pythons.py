"""Find the Pythons from 3.12 on at hand, for which one wheel serves all; as a program, print the oldest."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path


def later_pythons() -> dict[str, str]:
    """Return one Python for each version from 3.12 on, the oldest first: those of pyenv, then those of the system."""
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    folders = (Path("/usr/bin"), Path("/usr/local/bin"))
    found = [*root.glob("versions/3.*/bin/python3"), *(path for each in folders for path in each.glob("python3.*"))]
    versions: dict[int, str] = {}
    for path in found:
        named = re.search(r"3\.(\d+)(?:\.\d+/bin/python3)?$", str(path))
        if named and int(named[1]) >= 12:
            versions.setdefault(int(named[1]), str(path))
    return {f"3.{minor}": versions[minor] for minor in sorted(versions)}


if __name__ == "__main__":
    print(next(iter(later_pythons().values()), ""))
    sys.exit(not later_pythons())
