"""Recognise a logger by its vocabulary: its specific names show quantities, units and encodings of its columns.

Each file in `start/fingerprints/` describes one logger and states its source. A fingerprint is evidence in addition to
names, stated units and physics; it decides nothing alone.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..._errors import PellucidError
from ..._given import parse_toml, read_given
from ...files.name_evidence import QUANTITY_WORDS, words_of
from ...files.stated_units import split_unit

FINGERPRINTS_FOLDER = Path(__file__).parent.parent / "fingerprints"
"""Folder with one file per logger."""

COMMAND_QUANTITIES = frozenset({"reference", "desired_velocity", "desired_torque", "desired_current"})
"""Quantities that a controller asks for."""

FINGERPRINT_QUANTITIES = frozenset(QUANTITY_WORDS) | COMMAND_QUANTITIES | {"marker", "ignore"}
"""Quantities that a column of a fingerprint may have: named quantities, commands, markers, and ``ignore``."""

ENCODINGS = frozenset({"twos_complement 16", "twos_complement 32", "sign_bit 10", "sign_bit 11", "sign_bit 15"})
"""Ways in which registers write negative numbers."""

SIDES = ("motor", "output")
"""Sides of a gear."""

MAX_NAME_LENGTH = 200
"""Longer names belong to no logger, and would make patterns slow [characters]."""

MAX_COLUMNS = 2000
"""So many columns of a table are compared; a logger shows itself in the first ones."""


@dataclass(frozen=True)
class FingerprintColumn:
    """What a logger's documentation says of one of its columns.

    Attributes
    ----------
    pattern : str
        Regular expression of the whole folded name.
    quantity : str
        Quantity, one of `FINGERPRINT_QUANTITIES`.
    unit : str or None
        Unit as study.toml writes it; None if the logger leaves it open.
    scale : float or None
        One number of the column in `unit`, such as 0.00269 A per number of a register.
    other_scales : tuple of float
        Scales that other models of the same maker have under the same name.
    counts_per_turn : int or None
        Counts of one turn of an encoder.
    encoding : str or None
        How negative numbers are written, one of `ENCODINGS`.
    wrap : float or None
        Number at which the column rolls over to 0.
    side : str or None
        Side of the gear, ``"motor"`` or ``"output"``.
    is_command : bool
        Whether the column was asked for and not measured.
    joint_group : int or None
        Group of the pattern that names the joint; if it is empty, the next one that is not.
    joint : str or None
        Name of the joint as the table writes it, of a column that was matched.
    """

    pattern: str
    quantity: str
    unit: str | None = None
    scale: float | None = None
    other_scales: tuple[float, ...] = ()
    counts_per_turn: int | None = None
    encoding: str | None = None
    wrap: float | None = None
    side: str | None = None
    is_command: bool = False
    joint_group: int | None = None
    joint: str | None = None


@dataclass(frozen=True)
class Fingerprint:
    """Vocabulary of one logger.

    Attributes
    ----------
    name : str
        Name of the logger.
    source : str
        Address of the documentation or of the source code that states names and units.
    columns : tuple of FingerprintColumn
        Columns that the logger writes; the first entry that fits a name counts.
    min_matched : int
        At least so many entries must match columns of a table.
    requires : tuple of str
        Patterns each of which must match a column.
    facts : Mapping[str, str]
        Pattern of a fact's text by the pattern of its label. A fact that fits counts as one matched entry.
    """

    name: str
    source: str
    columns: tuple[FingerprintColumn, ...]
    min_matched: int = 2
    requires: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class MatchedFingerprint:
    """A logger that a table's names show.

    Attributes
    ----------
    name : str
        Name of the logger.
    source : str
        Address of the documentation or of the source code that states names and units.
    columns : Mapping[str, FingerprintColumn]
        What is documented of each recognised column, by its name in the table.
    matched_entries : int
        Number of entries of the fingerprint that matched columns or facts.
    entries : int
        Number of entries of the fingerprint.
    """

    name: str
    source: str
    columns: Mapping[str, FingerprintColumn]
    matched_entries: int
    entries: int


def find_fingerprint(names: Sequence[str], facts: Mapping[str, str] | None = None) -> MatchedFingerprint | None:
    """Return the fingerprint that recognises most columns of a table; None if no logger's vocabulary is there.

    Of two that recognise equally many, the one counts whose entries matched in the larger share.

    Parameters
    ----------
    names : Sequence[str]
        Names of the table's columns as the file writes them.
    facts : Mapping[str, str], optional
        Settings that the file states, texts by their labels.

    Returns
    -------
    MatchedFingerprint or None
        Logger and what is documented of its columns.

    Examples
    --------
    >>> found = find_fingerprint(["time", "Present Position", "Present Current", "Realtime Tick"])
    >>> found.name, found.columns["Present Current"].unit
    ('Dynamixel X series, control table', 'A')
    >>> find_fingerprint(["time", "position", "velocity", "torque"]) is None
    True
    """
    folded = {name: fold_name(name) for name in names[:MAX_COLUMNS] if len(name) <= MAX_NAME_LENGTH}
    texts = set(folded.values())
    possible = [path for path, requires in _requirements() if _has_each(requires, texts)]
    found = [_match(_read_once(path), folded, facts or {}) for path in possible]
    return max(
        (each for each in found if each is not None),
        key=lambda each: (len(each.columns), each.matched_entries / each.entries),
        default=None,
    )


def fold_name(name: str) -> str:
    """Return a column's name as patterns see it: without its unit, its words in lower case with one blank between.

    Examples
    --------
    >>> fold_name("AxisAct_A1 [deg]"), fold_name("axis0.encoder.pos_estimate")
    ('axis act a 1', 'axis 0 encoder pos estimate')
    """
    return " ".join(words_of(split_unit(name)[0]))


def _match(fingerprint: Fingerprint, folded: Mapping[str, str], facts: Mapping[str, str]) -> MatchedFingerprint | None:
    columns: dict[str, FingerprintColumn] = {}
    matched: set[object] = set()
    for name, text in folded.items():
        for entry in fingerprint.columns:
            match = _compiled(entry.pattern).fullmatch(text)
            if match is None:
                continue
            joint = _joint(match, entry.joint_group, name) if entry.joint_group else None
            columns[name] = replace(entry, joint=joint) if joint else entry
            matched.add(entry.pattern)
            break
    for label, pattern in fingerprint.facts.items():
        if any(
            _compiled(label).fullmatch(" ".join(words_of(key))) and _compiled(pattern).search(text.casefold())
            for key, text in facts.items()
        ):
            matched.add((label, pattern))
    if len(matched) < fingerprint.min_matched:
        return None
    entries = len(fingerprint.columns) + len(fingerprint.facts)
    return MatchedFingerprint(fingerprint.name, fingerprint.source, columns, len(matched), entries)


def _joint(match: re.Match[str], first: int, name: str) -> str | None:
    """Return the first group from `first` on that is not empty, as the name writes it; None if all are empty."""
    group = next((k for k in range(first, match.re.groups + 1) if match[k]), None)
    if group is None:
        return None
    # Folding keeps letters and digits in their order, so that their number tells the place in the name.
    start, end = (len(match.string[:place].replace(" ", "")) for place in match.span(group))
    places = [place.start() for place in re.finditer(r"[^\W_]", name)]
    written = name[places[start] : places[end - 1] + 1] if end <= len(places) else ""
    return written if words_of(written) == match[group].split() else match[group]


def _has_each(requires: Sequence[str], texts: set[str]) -> bool:
    """Whether each pattern matches a folded name."""
    return all(any(map(_compiled(pattern).fullmatch, texts)) for pattern in requires)


@lru_cache(maxsize=1)
def _requirements() -> tuple[tuple[Path, tuple[str, ...]], ...]:
    """Return what each file requires. The columns of most files are never read, which takes most of the time."""
    found = []
    for path in sorted(FINGERPRINTS_FOLDER.glob("*.toml")):
        head, _, _ = read_given(path).decode("utf-8").partition("\n[[columns]]")
        found.append((path, tuple(parse_toml(head, path.name).get("requires", ()))))
    return tuple(found)


@lru_cache(maxsize=256)
def _read_once(path: Path) -> Fingerprint:
    return read_fingerprint(path)


def load_fingerprints() -> tuple[Fingerprint, ...]:
    """Return all fingerprints that ship with the package, by the names of their files."""
    return tuple(_read_once(path) for path, _ in _requirements())


def read_fingerprint(path: Path) -> Fingerprint:
    """Return the fingerprint in a file; raise a PellucidError that names the file and the entry if it is not valid."""
    raw = parse_toml(read_given(path).decode("utf-8"), path.name)
    _refuse_unknown(raw, set(Fingerprint.__dataclass_fields__), path.name)
    for key in ("name", "source", "columns"):
        if not raw.get(key):
            raise PellucidError(f"{path.name}: found no {key}, expected it")
    if not str(raw["source"]).startswith("https://"):
        raise PellucidError(f"{path.name}: found source {raw['source']!r}, expected an address with https://")
    columns = tuple(_read_column(table, f"{path.name}, columns {n}") for n, table in enumerate(raw["columns"], 1))
    requires, facts = tuple(raw.get("requires", ())), dict(raw.get("facts", {}))
    for pattern in (*requires, *facts, *facts.values()):
        _check_pattern(pattern, path.name)
    return Fingerprint(raw["name"], raw["source"], columns, int(raw.get("min_matched", 2)), requires, facts)


def _read_column(table: dict[str, Any], where: str) -> FingerprintColumn:
    _refuse_unknown(table, set(FingerprintColumn.__dataclass_fields__) - {"joint"}, where)
    for key in ("pattern", "quantity"):
        if key not in table:
            raise PellucidError(f"{where}: found no {key}, expected it")
    groups = _check_pattern(table["pattern"], where)
    if table["quantity"] not in FINGERPRINT_QUANTITIES:
        raise PellucidError(f"{where}: found quantity {table['quantity']!r}, expected one of names' quantities")
    if table.get("encoding") not in (None, *ENCODINGS):
        raise PellucidError(f"{where}: found encoding {table['encoding']!r}, expected one of {sorted(ENCODINGS)}")
    if table.get("side") not in (None, *SIDES):
        raise PellucidError(f"{where}: found side {table['side']!r}, expected one of {list(SIDES)}")
    if not 0 <= table.get("joint_group", 0) <= groups:
        raise PellucidError(f"{where}: found joint_group {table['joint_group']}, expected a group of the pattern")
    is_command = table.get("is_command", table["quantity"] in COMMAND_QUANTITIES)
    others = tuple(table.get("other_scales", ()))
    return FingerprintColumn(**{**table, "is_command": is_command, "other_scales": others})


def _refuse_unknown(table: Mapping[str, Any], known: set[str], where: str) -> None:
    unknown = sorted(set(table) - known)
    if unknown:
        raise PellucidError(f"{where}: found the key {unknown[0]!r}, expected one of {sorted(known)}")


def _check_pattern(pattern: str, where: str) -> int:
    """Return the number of groups of a pattern; raise a PellucidError if it is not valid."""
    try:
        return _compiled(pattern).groups
    except re.error as error:
        raise PellucidError(f"{where}: pattern {pattern!r} is no regular expression: {error}") from error


@lru_cache(maxsize=4096)
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern)
