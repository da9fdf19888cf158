"""Find a data set's files on this machine, or download them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..._errors import DatasetError


class Bar:
    """Progress bar with the few methods Pooch calls, which also sets the file's size, `total` [byte]."""

    def __init__(self, title: str):
        from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn

        self._progress = Progress(TextColumn("{task.description}"), BarColumn(), DownloadColumn(), transient=True)
        self._task = self._progress.add_task(title, total=None)
        self.total: float | None = None

    def __enter__(self) -> Bar:
        self._progress.start()
        return self

    def __exit__(self, *_) -> None:
        self._progress.stop()

    def update(self, size: float) -> None:
        """Add `size` bytes."""
        self._progress.update(self._task, total=self.total, advance=size)

    def reset(self) -> None:
        """Set the progress back to 0."""
        self._progress.reset(self._task, total=self.total)

    def close(self) -> None:
        """Do nothing: Pooch calls this at the end, but the context ends the display."""


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
        raise DatasetError(f'no data set "{name}", expected one of {", ".join(known)}{nearest}') from None


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


DATA_VARIABLE = "PELLUCID_DATA"
"""Environment variable that names a folder with one subfolder per data set."""

CACHE_VARIABLE = "PELLUCID_CACHE"
"""Environment variable that names another folder for downloads."""


def path(name: str) -> Path:
    """Return the folder with the files of a data set.

    It is below ``PELLUCID_DATA`` if the files are there. Otherwise it is the folder of downloads, or the package itself
    if the data set comes with it.
    """
    dataset = info(name)
    own = shipped(name)
    for folder in [own] if own is not None else [*_given(dataset), _cache(dataset)]:
        if all((folder / file).is_file() for file in dataset.files):
            return folder
    raise DatasetError(f"{name}: its files are not on this machine. {_advice(dataset)}")


def fetch(name: str, base_url: str | None = None, progress: bool = False) -> Path:
    """Download the missing files of a data set, and check every file against its checksum."""
    import logging

    import pooch

    dataset = info(name)
    if shipped(name) is not None:
        return path(name)
    folder = _cache(dataset)
    origin = (base_url or dataset.origin).rstrip("/") + "/"
    elsewhere = {file: origin + place for file, place in dataset.paths.items()}
    sums = {file: known or None for file, known in dataset.files.items()}
    store = pooch.create(folder, origin, registry=sums, urls=elsewhere)
    # Pooch's own announcements are switched off, since the progress bar and the messages below replace them.
    pooch.get_logger().setLevel(logging.ERROR)
    for file in dataset.files:
        try:
            with Bar(file) if progress else nullcontext(False) as bar:
                store.fetch(file, downloader=pooch.HTTPDownloader(timeout=30, progressbar=bar))
        except ValueError as error:
            # Pooch compares checksums before it moves the file into place.
            raise DatasetError(
                f"{name}: {file} from {store.base_url} differs from the published file: expected the SHA-256 "
                f"{dataset.files[file]}; nothing was kept"
            ) from error
        except OSError as error:
            raise DatasetError(
                f"{name}: {file} could not be downloaded from {store.base_url}: {_reason(error)}. {_advice(dataset)}"
            ) from error
    return folder


def notes(name: str) -> tuple[str, ...]:
    """Return a note about each file in use whose checksum differs from the published one."""
    from ..study import checksum

    dataset, folder = info(name), path(name)
    found = {file: checksum(folder / file) for file in dataset.files}
    return tuple(
        f"{file} differs from the published file: found the SHA-256 {found[file]}, expected {expected}"
        for file, expected in dataset.files.items()
        if expected and found[file] != expected
    )


def _reason(error: OSError) -> str:
    import requests

    url = error.request.url if isinstance(error, requests.ConnectionError) and error.request is not None else None
    if isinstance(url, str):
        # The error's own text repeats the whole chain of calls below it.
        from urllib.parse import urlsplit

        return f"no connection to {urlsplit(url).hostname}"
    return str(error)


def _given(dataset: Dataset) -> list[Path]:
    root = os.environ.get(DATA_VARIABLE)
    return [Path(root) / folder for folder in dict.fromkeys((dataset.name, *dataset.folders))] if root else []


def _cache(dataset: Dataset) -> Path:
    root = os.environ.get(CACHE_VARIABLE)
    if root:
        return Path(root) / dataset.name
    import pooch

    return Path(pooch.os_cache("pellucid")) / dataset.name


def _advice(dataset: Dataset) -> str:
    root = os.environ.get(DATA_VARIABLE)
    where = f"{DATA_VARIABLE} is {root}" if root else f"{DATA_VARIABLE} is not set"
    return (
        f"Either run `pellucid datasets fetch {dataset.name}` with a connection to the internet, or download "
        f"{', '.join(dataset.files)} from {dataset.origin} into a folder {dataset.folders[0]} and set {DATA_VARIABLE} "
        f"to the folder above it ({where})"
    )
