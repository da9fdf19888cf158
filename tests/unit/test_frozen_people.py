"""People are as they were frozen: numbers and equations have the hashes of `docs/design/frozen-participants.md`."""

import hashlib
import json
import re
from pathlib import Path

import pytest

from pellucid_lab.pointing.rig import elbow_people

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "design" / "frozen-participants.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (numbers|equations) \| ([^|]+) \| `(\w+)` \|$", PAGE, flags=re.MULTILINE)
NOBODYS = {"kind", "robot", "emg", "force_sensor", "cameras"}
"""Tables of instruments and of the robot."""


def hashed(kind: str, what: str) -> str:
    """Return the hash of tables by name, or of a header without comments, descriptions and spaces."""
    if kind == "numbers":
        tables = elbow_people().tables
        text = json.dumps({name: tables[name] for name in what.split(", ")}, sort_keys=True)
    else:
        source = (ROOT / what).read_text(encoding="utf-8")
        bare = re.sub(r'"([^"\n]*)"', lambda found: '""' if " " in found[1] else found[0], source)
        text = re.sub(r"//.*|\s", "", bare)
    return hashlib.sha256(text.encode()).hexdigest()


@pytest.mark.parametrize(("kind", "what", "hash_"), ROWS)
def test_what_is_frozen_is_as_it_was(kind, what, hash_):
    assert hashed(kind, what) == hash_


def test_everything_about_people_is_frozen():
    named = [name for kind, what, _ in ROWS if kind == "numbers" for name in what.split(", ")]
    assert len(named) == len(set(named))
    open_ = sorted(set(elbow_people().tables) - NOBODYS - set(named))
    assert not open_, "add to docs/design/frozen-participants.md: " + "; ".join(
        f"| numbers | {name} | `{hashed('numbers', name)}` |" for name in open_
    )
    assert {what for kind, what, _ in ROWS if kind == "equations"}
