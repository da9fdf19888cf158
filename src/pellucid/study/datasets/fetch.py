"""Find a data set's files on this machine, or download them."""

from __future__ import annotations

import os
from pathlib import Path

from ..._errors import DatasetError
from .registry import Dataset, info, shipped

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
            with _bar(file, progress) as bar:
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
    from ..study_place import checksum

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


def _bar(file: str, shown: bool):
    import contextlib

    if not shown:
        return contextlib.nullcontext(False)
    from .progress import Bar

    return Bar(file)
