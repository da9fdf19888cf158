"""A virtual rig's file: its tables, whether anything is missing from them, and constants changed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Self

from .._errors import StudyError

RIGS = files(__package__) / "rigs"
"""The rigs that come with the package."""


@dataclass(frozen=True)
class Rig:
    """Everything a virtual rig is made of: the tables of its file, SI.

    Parameters
    ----------
    name : str
    tables : mapping of str to mapping
        As in a file of ``lab/rigs``.
    """

    name: str
    tables: Mapping[str, Mapping]

    def __getitem__(self, table: str) -> Mapping:
        return self.tables[table]

    def changed(self, values: Mapping[str, object], name: str | None = None) -> Self:
        """The same rig with some constants changed.

        Parameters
        ----------
        values : mapping of str to float
            By dotted path, ``"imu.magnetometer"`` or ``"subjects.S1.strap.stiffness"``, SI.
        name : str, optional
            Of the new rig; the old one's if left out.

        Returns
        -------
        Rig
            Of the same kind.

        Raises
        ------
        StudyError
            If the rig has no such constant.
        """
        tables = _copied(self.tables)
        for path, value in values.items():
            *parts, key = path.split(".")
            table = tables
            for part in parts:
                table = table.get(part, {})
            if key not in table:
                raise StudyError(f"rig {self.name} has no constant {path}")
            table[key] = value
        return replace(self, name=name or self.name, tables=tables)


def shipped_rig(name: str) -> str:
    """The text of a file of ``lab/rigs``, by its name without the ending."""
    return (RIGS / f"{name}.toml").read_text(encoding="utf-8")


def parse_tables(text: str, where: str) -> dict:
    """The tables of a rig's file, unchecked.

    Parameters
    ----------
    text : str
        TOML.
    where : str
        What messages begin with.

    Returns
    -------
    dict

    Raises
    ------
    StudyError
        If the text is not TOML.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{where}: not valid TOML: {error}") from error


def checked_tables(text: str, name: str, kind: str | None, needed: Mapping[str, tuple[str, ...]]) -> dict:
    """The tables of a rig's file, with nothing missing.

    Parameters
    ----------
    text : str
        TOML, SI.
    name : str
        Of the rig, for messages.
    kind : str or None
        What the file must call itself.
    needed : mapping of str to tuple of str
        What each table must say: ``""`` is the file's head, ``"subjects.*"`` every table below ``[subjects]``, at
        least one.

    Returns
    -------
    dict

    Raises
    ------
    StudyError
        If the file is not TOML, is of another kind, or lacks a table or a constant.
    """
    tables = parse_tables(text, f"rig {name}")
    if tables.get("kind") != kind:
        raise StudyError(f"rig {name}: found kind = {tables.get('kind')!r}, expected {kind!r}")
    for table, keys in needed.items():
        family, _, every = table.partition(".")
        found = tables.get(family, {}) if table else tables
        if every and not found:
            raise StudyError(f"rig {name}: found no [{family}.NAME], expected at least one")
        for title, entry in ((f"[{family}.{k}]", v) for k, v in found.items()) if every else [(f"[{table}]", found)]:
            missing = [key for key in keys if key not in entry]
            if missing:
                raise StudyError(f"rig {name}: {title} lacks {', '.join(missing)}")
    return tables


def _copied(tables: Mapping) -> dict:
    return {key: _copied(value) if isinstance(value, Mapping) else value for key, value in tables.items()}
