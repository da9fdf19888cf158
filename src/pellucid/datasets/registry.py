"""Which public data sets are known; what is known of each stands in registry.toml and a study.toml template."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from .._errors import DatasetError

_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Dataset:
    """One public data set."""

    name: str  # As ``init`` and ``fetch`` take it
    title: str  # title, citation, licence: What it is, what to cite, under which terms it is published
    citation: str
    licence: str
    origin: str  # URL the files' names are appended to, at a fixed commit
    folders: tuple[str, ...]  # Names its folder may have below ``PELLUCID_DATA``
    # Path below the origin, with its subfolders -> SHA-256, hexadecimal. A study has each at the same path below its
    # folder of recordings
    files: Mapping[str, str]
    # Of files that lie elsewhere below the origin: where
    paths: Mapping[str, str] = field(default_factory=dict)
    motion: Mapping[str, Any] | None = None  # How its files hold people's motions; of a set that is no study
    gait: Mapping[str, Any] | None = None  # Where a study's files show a knee that walks


def names() -> tuple[str, ...]:
    """Names of the data sets that studies are made of."""
    return tuple(name for name, dataset in _registry().items() if dataset.motion is None)


def motion_names() -> tuple[str, ...]:
    """Names of the data sets that hold how people move, and nothing that could be identified."""
    return tuple(name for name, dataset in _registry().items() if dataset.motion is not None)


def gait_names() -> tuple[str, ...]:
    """Names of the data sets that show a knee which walks."""
    return tuple(name for name, dataset in _registry().items() if dataset.gait is not None)


def info(name: str) -> Dataset:
    """What is known of a data set."""
    import difflib

    try:
        return _registry()[name]
    except KeyError:
        known = (*names(), *motion_names())
        close = difflib.get_close_matches(name, known, 1, 0.4)
        nearest = f'; the nearest is "{close[0]}"' if close else ""
        raise DatasetError(f'no data set "{name}", found {", ".join(known)}{nearest}') from None


def template(name: str) -> Path:
    """Path of the study.toml a study of this data set begins with."""
    if info(name).motion is not None:
        raise DatasetError(f"{name}: holds people's motions and no study; known as studies: {', '.join(names())}")
    return _HERE / f"{info(name).name}.toml"


def shipped(name: str) -> Path | None:
    """Folder of a data set that comes with the package; None where it does not."""
    folder = _HERE / "shipped" / info(name).name
    return folder if folder.is_dir() else None


@lru_cache(maxsize=1)
def _registry() -> dict[str, Dataset]:
    import tomllib

    raw = tomllib.loads((_HERE / "registry.toml").read_text(encoding="utf-8"))
    return {name: Dataset(name=name, **{**table, "folders": tuple(table["folders"])}) for name, table in raw.items()}
