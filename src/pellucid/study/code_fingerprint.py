"""Fingerprint of all code that computes, which shows whether changed code may give other results.

Nothing here loads NumPy: a report that need not be drawn is answered without it.
"""

from __future__ import annotations

import json
import os
import re
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, distribution, requires
from importlib.util import find_spec
from pathlib import Path

PACKAGE_NAME = __name__.partition(".")[0]
"""Name of this package, and of its distribution."""


COMPUTING_EXTRAS = ("posterior", "statistics")
"""Extras whose libraries a study's results depend on; the others read files, draw, simulate or test."""


@cache
def code_fingerprint() -> str:
    """Return the SHA-256 of all code that computes, because other code may find other results.

    It covers the package's sources, its compiled core, and the versions of the libraries that it requires.
    """
    digest = sha256(installed_version(PACKAGE_NAME).encode())
    folder = _source_file(PACKAGE_NAME).parent
    sources = sorted(os.path.join(place, name) for place, _, names in os.walk(folder) for name in names)
    for source in (*(name for name in sources if name.endswith(".py")), _source_file(f"{PACKAGE_NAME}._core")):
        with open(source, "rb") as file:  # a Path for each of a thousand files takes as long as reading them
            digest.update(file.read())
    digest.update(json.dumps(library_versions()).encode())
    return digest.hexdigest()


def _source_file(module: str) -> Path:
    """Return a module's file, without loading it."""
    found = find_spec(module)
    if found is None or found.origin is None:
        raise ImportError(f"found no file of the module {module}, expected one: Pellucid is not installed as a whole")
    return Path(found.origin)


def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that the package computes with, by name; of optional ones if installed."""
    found = {}
    for requirement in requires(PACKAGE_NAME) or ():
        name = re.match(r"[\w.-]+", requirement)[0]
        extra = re.search(r"extra == ['\"](.+?)['\"]", requirement)
        if name != PACKAGE_NAME and (extra is None or extra[1] in COMPUTING_EXTRAS):
            with suppress(PackageNotFoundError):
                found[name] = installed_version(name)
    return found


def installed_version(name: str) -> str:
    """Return the version of an installed distribution, from the one line of its metadata that says it.

    `importlib.metadata.version` parses all of the metadata, forty times as a report is asked for again.
    """
    of = distribution(name)
    line = re.search(r"^Version: (.+)$", of.read_text("METADATA") or "", re.MULTILINE)
    return line[1].strip() if line else of.version
