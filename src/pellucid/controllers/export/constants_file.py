"""Read the numbers of a controller back from the ``pellucid_constants.h`` that an export wrote."""

from __future__ import annotations

import math
import re
from pathlib import Path

from ..._errors import PellucidError
from ..._given import read_given
from ..supervised import SUPERVISOR_NAMES

CONSTANTS_FILE = "pellucid_constants.h"
"""File of an exported folder that holds the law's and the supervisor's numbers."""

MAX_CONSTANTS_BYTES = 1_000_000
"""Largest size of that file that is read [B]."""

MAX_FLOAT = 3.4028234e38
"""Magnitude from which on a number stands for the absence of a limit: it is that of the largest float."""

_NUMBER_PATTERN = re.compile(r"^\s*(-?[0-9.]+(?:e[+-]?[0-9]+)?)f, /\* (\w+) \[", re.MULTILINE)


def read_constants(folder: Path) -> dict[str, float]:
    """Return the numbers of an exported controller of one joint, by name, SI.

    Parameters
    ----------
    folder : Path
        Folder that `pellucid.export` wrote.

    Returns
    -------
    dict of str to float
        Numbers of the law and then of its supervisor, in the core's order, rounded to float32. The largest float is
        returned as infinity, which it stands for.

    Raises
    ------
    PellucidError
        If the file is missing, lacks a number of the supervisor, or states a number twice.
    """
    path = Path(folder) / CONSTANTS_FILE
    try:
        text = read_given(path, MAX_CONSTANTS_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise PellucidError(f"{path}: not readable: {error}") from None
    found = numbers_in(text, str(path))
    lacking = [name for name in SUPERVISOR_NAMES if name not in found]
    if lacking:
        raise PellucidError(f"{path}: found no {', '.join(lacking[:5])}, expected every number of the supervisor")
    return found


def numbers_in(text: str, where: str) -> dict[str, float]:
    """Return the numbers in the text of such a file by name, SI; errors say `where` it is from."""
    found: dict[str, float] = {}
    for number, name in _NUMBER_PATTERN.findall(text):
        if name in found:
            raise PellucidError(f"{where}: {name}: found it twice, expected it once")
        value = float(number)
        found[name] = math.copysign(math.inf, value) if abs(value) >= MAX_FLOAT else value
    return found
