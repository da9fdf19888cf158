"""The list of rigs: kinds by the folders of this package, and the files of constants that come with it."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.resources import files
from pathlib import Path

from .._errors import StudyError
from .._given import read_given
from .rig import BENCH, KINDS, Rig, parse_tables
from .rig_schema import require_like

RIGS = files(__package__) / "rigs"
"""The rigs that come with the package."""

MOST_BYTES = 3_000_000
"""Of a rig's file [B]."""

DRAWN, DRAWN_FROM = 5, "able-elbow"
"""How many rigs are drawn from the ranges of the one with a carriage."""


def kind_of(kind: str) -> type[Rig] | None:
    """The class of a `kind` of rig: of those defined so far, or of ``lab/<folder>/rig.py``; None if there is none."""
    for folder in sorted(files(__package__).iterdir(), key=lambda folder: folder.name):
        if kind in KINDS:
            break
        if folder.joinpath("rig.py").is_file():
            import_module(f".{folder.name}.rig", __package__)
    return KINDS.get(kind)


def parse_rig(text: str, name: str) -> Rig:
    """A rig of whatever kind its file is."""
    tables = parse_tables(text, f"rig {name}")
    kind = tables.get("kind", BENCH)
    found = kind_of(kind) if isinstance(kind, str) else None
    if found is None:
        raise StudyError(f"rig {name}: found kind = {kind!r}, expected one of {', '.join(sorted(KINDS))}")
    own = _own(kind)
    if own is not None:
        require_like(tables, own, f"rig {name}:", found.free)
    return found.parse(text, name)


@cache
def _own(kind: str) -> dict | None:
    """The tables of the package's own rig of a kind."""
    files = (parse_tables(file.read_text(encoding="utf-8"), file.name) for file in RIGS.iterdir())
    return next((tables for tables in files if tables.get("kind", BENCH) == kind), None)


def shipped_rig(name: str) -> str:
    """The text of a file of ``lab/rigs``, by its `name` without the ending."""
    return (RIGS / f"{name}.toml").read_text(encoding="utf-8")


def rig_names() -> tuple[str, ...]:
    """Names of the virtual rigs that come with the package."""
    own = sorted(file.name.removesuffix(".toml") for file in RIGS.iterdir())
    return (*own, *(f"{DRAWN_FROM}-drawn-{i + 1}" for i in range(DRAWN)))


def load_rig(name: str | Path) -> Rig:
    """A virtual rig by name, or from a file of one's own."""
    return parse_rig(rig_text(name), Path(name).stem if str(name).endswith(".toml") else str(name))


def rig_text(name: str | Path) -> str:
    """The text of a rig's file; a drawn rig's is its model's with the drawn values in their places."""
    if str(name).endswith(".toml") and Path(name).is_file():
        return text_of_rig(Path(name))
    if name not in rig_names():
        raise StudyError(f"unknown rig {str(name)!r}; known: {', '.join(rig_names())}")
    base, _, drawn = str(name).partition("-drawn-")
    text = shipped_rig(base)
    if not drawn:
        return text
    from .elbow.rig import ElbowRig, drawn_rigs

    original = ElbowRig.parse(text, base)
    return _with_values(text, original, drawn_rigs(original, DRAWN)[int(drawn) - 1], drawn)


def text_of_rig(path: Path) -> str:
    """What a rig's file says, as it is."""
    try:
        return read_given(path, MOST_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise StudyError(f"{path}: not readable: {error}") from None


def _with_values(text: str, original: Rig, values: Rig, number: str) -> str:
    import re

    made, table = [f"# Drawn from the ranges at the end of this file: rig {number} of {DRAWN}."], ""
    for line in text.splitlines():
        head = re.match(r"\[([\w.]+)\]", line)
        table = head[1] if head else table
        entry = re.match(r"(\w+) = [^#]*?(?= *(#|$))", line)
        if entry and f"{table}.{entry[1]}" in original["drawn"]:
            line = f"{entry[1]} = {values[table][entry[1]]!r}{line[entry.end() :]}"
        made.append(line)
    return "\n".join(made) + "\n"
