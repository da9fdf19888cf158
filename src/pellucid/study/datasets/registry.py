"""The registry of public data sets. registry.toml and a study.toml template describe each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..._errors import DatasetError

_DATASETS_FOLDER = Path(__file__).parent
"""Folder with a file for each data set."""


@dataclass(frozen=True)
class Dataset:
    """One public data set."""

    name: str  # name for ``init`` and ``fetch``
    title: str  # description of the recordings
    citation: str  # source to cite
    licence: str  # terms of its publication
    origin: str  # URL at a fixed commit, to which the files' names are appended
    folders: tuple[str, ...]  # possible names of its folder below ``PELLUCID_DATA``
    # SHA-256 of each file, hexadecimal, by its path below the origin; empty if none is stated. A study has the file at
    # the same path below its folder of recordings
    files: Mapping[str, str]
    # Path below the origin of each file that lies elsewhere there
    paths: Mapping[str, str] = field(default_factory=dict)
    unverified: str = ""  # reason why no checksum is stated, for a data set without
    motion: Mapping[str, Any] | None = None  # format of files with people's motions, for a data set without a study
    gait: Mapping[str, Any] | None = None  # place of a walking knee in a study's files


def names() -> tuple[str, ...]:
    """Return the names of the data sets with a study."""
    return tuple(name for name, dataset in _registry().items() if dataset.motion is None)


def motion_names() -> tuple[str, ...]:
    """Return the names of the data sets with people's motions, from which nothing can be identified."""
    return tuple(name for name, dataset in _registry().items() if dataset.motion is not None)


def gait_names() -> tuple[str, ...]:
    """Return the names of the data sets with a walking knee."""
    return tuple(name for name, dataset in _registry().items() if dataset.gait is not None)


def info(name: str) -> Dataset:
    """Return the entry of a data set."""
    import difflib

    try:
        return _registry()[name]
    except KeyError:
        known = (*names(), *motion_names())
        close = difflib.get_close_matches(name, known, 1, 0.4)
        nearest = f'; the nearest is "{close[0]}"' if close else ""
        raise DatasetError(f'no data set "{name}", found {", ".join(known)}{nearest}') from None


def template(name: str) -> Path:
    """Return the path of the study.toml template of a data set."""
    if info(name).motion is not None:
        raise DatasetError(f"{name}: holds people's motions and no study; known as studies: {', '.join(names())}")
    return _DATASETS_FOLDER / f"{info(name).name}.toml"


def shipped(name: str) -> Path | None:
    """Return the folder of a data set that comes with the package; None for another one."""
    folder = _DATASETS_FOLDER / "shipped" / info(name).name
    return folder if folder.is_dir() else None


@lru_cache(maxsize=1)
def _registry() -> dict[str, Dataset]:
    import tomllib

    raw = tomllib.loads((_DATASETS_FOLDER / "registry.toml").read_text(encoding="utf-8"))
    return {name: Dataset(name=name, **{**table, "folders": tuple(table["folders"])}) for name, table in raw.items()}
