"""Identify the machines named, or all of them, and write their cards into the package."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from pellucid.models.cards import FOLDER, library

CARD_FILES = {"joint": "joint.json", "robot": "tree.best.json"}
"""File name of the card that `pellucid identify` writes, by kind of machine."""

DIGITS = 9
"""Significant digits of the numbers in a card: far more than an estimate has."""

LEFT_OUT = ("statistical", "made_from")
"""Parts of a study's card that are excluded: they serve comparisons and later steps of the same study."""


def rounded(value: object) -> object:
    """Return a table with every number rounded to `DIGITS`."""
    if isinstance(value, dict):
        return {key: rounded(x) for key, x in value.items()}
    if isinstance(value, list):
        return [rounded(x) for x in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def make(name: str) -> Path:
    """Identify a machine from its public recordings with the usual settings, and write its card."""
    entry = library()[name]
    with tempfile.TemporaryDirectory() as scratch:
        study = Path(scratch, entry["dataset"])
        for arguments in (["init", study, "--dataset", entry["dataset"], "-q"], ["identify", study, "-q"]):
            subprocess.run([sys.executable, "-m", "pellucid", *arguments], check=True)
        table = json.loads((study / "models" / CARD_FILES[entry["kind"]]).read_text(encoding="utf-8"))
    kept = {key: rounded(value) for key, value in table.items() if key not in LEFT_OUT}
    path = FOLDER / f"{name}.json"
    path.write_text(json.dumps(kept, allow_nan=False, separators=(",", ":")) + "\n", encoding="utf-8")
    return path


if __name__ == "__main__":
    for chosen in sys.argv[1:] or sorted(library()):
        print(make(chosen))
