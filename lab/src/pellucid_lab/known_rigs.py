"""Registry of rigs: their kinds, and the rigs whose files come with a package."""

from __future__ import annotations

from importlib import import_module
from importlib.resources import files
from pathlib import Path

from pellucid._errors import StudyError

from .elbow.rig import ElbowRig, drawn_rigs
from .rig import DEFAULT_KIND, KINDS, Rig, parse_tables
from .shipped_rigs import rig_packages, shipped_rig, shipped_rig_names, text_of_rig

DRAWN_RIG_COUNT = 5
"""Number of rigs that are drawn from the ranges of `DRAWN_RIG_MODEL`."""

DRAWN_RIG_MODEL = "able-elbow"
"""Name of the rig whose file has the ranges."""


def kind_of(kind: str) -> type[Rig] | None:
    """Return the class of a `kind` of rig, defined so far or in a folder's rig.py; None if there is none."""
    if kind in KINDS:
        return KINDS[kind]
    sources = {
        f"{package.__name__}.{folder.name}.rig": folder.joinpath("rig.py")
        for package in rig_packages()
        for folder in sorted(files(package).iterdir(), key=lambda folder: folder.name)
    }
    texts = {name: source.read_text(encoding="utf-8") for name, source in sources.items() if source.is_file()}
    # Folders that name the kind come first: the others may load much that it does not need.
    for name in sorted(texts, key=lambda name: f'"{kind}"' not in texts[name]):
        import_module(name)
        if kind in KINDS:
            break
    return KINDS.get(kind)


def parse_rig(text: str, name: str) -> Rig:
    """Return the rig that a file's text describes, of the kind that the text names."""
    tables = parse_tables(text, f"rig {name}")
    kind = tables.get("kind", DEFAULT_KIND)
    found = kind_of(kind) if isinstance(kind, str) else None
    if found is None:
        raise StudyError(f"rig {name}: found kind = {kind!r}, expected one of {', '.join(sorted(KINDS))}")
    return found.parse(text, name)


def rig_names() -> tuple[str, ...]:
    """Return the names of the virtual rigs that come with packages, and of those that are drawn."""
    return (*shipped_rig_names(), *(f"{DRAWN_RIG_MODEL}-drawn-{i + 1}" for i in range(DRAWN_RIG_COUNT)))


def load_rig(name: str | Path) -> Rig:
    """Return a virtual rig that comes with the package, by name, or the rig of a file that ends in .toml."""
    return parse_rig(rig_text(name), Path(name).stem if str(name).endswith(".toml") else str(name))


def rig_text(name: str | Path) -> str:
    """Return the text of a rig's file; that of a sampled rig is its model's text with the sampled values."""
    if str(name).endswith(".toml") and Path(name).is_file():
        return text_of_rig(Path(name))
    if name not in rig_names():
        raise StudyError(f"unknown rig {str(name)!r}; known: {', '.join(rig_names())}")
    base, _, drawn = str(name).partition("-drawn-")
    text = shipped_rig(base)
    if not drawn:
        return text
    original = ElbowRig.parse(text, base)
    return _with_values(text, original, drawn_rigs(original, DRAWN_RIG_COUNT)[int(drawn) - 1], drawn)


def _with_values(text: str, original: Rig, values: Rig, number: str) -> str:
    """Return the text of the original rig's file with the values of a sampled rig."""
    import re

    made, table = [f"# Drawn from the ranges at the end of this file: rig {number} of {DRAWN_RIG_COUNT}."], ""
    for line in text.splitlines():
        head = re.match(r"\[([\w.]+)\]", line)
        table = head[1] if head else table
        entry = re.match(r"(\w+) = [^#]*?(?= *(#|$))", line)
        if entry and f"{table}.{entry[1]}" in original["drawn"]:
            line = f"{entry[1]} = {values[table][entry[1]]!r}{line[entry.end() :]}"
        made.append(line)
    return "\n".join(made) + "\n"
