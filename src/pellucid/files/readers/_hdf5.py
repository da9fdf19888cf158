"""Read the numeric datasets of an HDF5 file, whatever program wrote it."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, missing_package
from ._caps import max_columns, require_unpacked_size
from ._columns import Columns
from ._signals import LABEL_KEYS, RATE_KEYS, UNIT_KEYS, Signals, Stated, folded, texts_of

MAX_NUMBERS_A_SAMPLE = 500
"""An array of three or more dimensions with more numbers than this a sample holds pictures."""

MAX_NAME_BYTES = 1000
"""A dataset of texts with longer ones holds no names of columns."""

MAX_SETTINGS_BYTES = 1_000_000
"""An attribute with settings as JSON has at most so many characters."""


def read_datasets(path: Path) -> Columns:
    """Return the numeric datasets of an HDF5 file, named by their dotted paths.

    Samples run along the longer side of a matrix. A field of a compound dataset is a column of its own. Attributes of a
    dataset, or of a group that holds it, may name its columns and state their units and the sampling rate.
    """
    try:
        import h5py
    except ImportError:
        raise RecordingError(str(missing_package(f"{path.name}: a file in HDF5", "h5py", "files"))) from None
    reading = _Reading(path)
    try:
        with h5py.File(path, "r") as file:
            file.visititems(reading.visit)
            _, rate_of_file = reading.stated_by(file)
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # the library raises a dozen types for damaged files
        raise RecordingError(f"{path.name}: not readable as HDF5, truncated or damaged: {error}") from error
    if rate_of_file is not None:
        reading.signals.state_rate("", rate_of_file)
    reading.signals.add(reading.content, "")
    for place, rate in reading.rates.items():
        reading.signals.state_rate(place, rate)
    return reading.signals.columns()


class _Reading:
    """What was read of one file so far."""

    def __init__(self, path: Path):
        self.signals = Signals(path)
        self.content: dict[str, Any] = {}  # groups, numbers and texts by name
        self.rates: dict[str, float] = {}  # sampling rates by dotted path [Hz]
        self._path = path
        self._number_count = 0.0
        self._stated: dict[str, tuple[list[tuple[str, tuple[str, ...]]], float | None]] = {}

    def visit(self, place: str, item: Any) -> None:
        """Add a dataset; groups are added with their datasets."""
        import h5py

        if not isinstance(item, h5py.Dataset) or place.startswith("#") or is_matlab_object(item):
            return
        is_text = h5py.check_string_dtype(item.dtype) is not None
        if is_text and (not 1 < item.size <= max_columns() or item.dtype.itemsize > MAX_NAME_BYTES):
            return
        if not is_text and not _is_numeric(item.dtype):
            return
        require_inside(self._path, place, item)
        if not is_text and self._is_picture(place, item):
            return
        # A field of a compound dataset may hold several numbers.
        has_fields = item.dtype.fields is not None
        self._number_count += item.size * max(item.dtype.itemsize / 8.0, 1.0) if has_fields else item.size
        # A dataset in chunks is unpacked chunk by chunk, and a chunk may be larger than the dataset.
        chunk = math.prod(item.chunks or ()) * item.dtype.itemsize / 8.0
        require_unpacked_size(self._path, max(self._number_count, chunk))
        *groups, name = place.split("/")
        into = self.content
        for group in groups:
            into = into.setdefault(group, {})
        into[name] = [str(text) for text in np.ravel(item.asstr()[()])] if is_text else self._numbers(item, place)

    def _is_picture(self, place: str, item: Any) -> bool:
        """Whether a dataset holds pictures; a column then says so, one for the cameras of all demonstrations."""
        each = item.size / max(item.shape) if item.size and item.shape else 0
        if item.ndim < 3 or each <= MAX_NUMBERS_A_SAMPLE:
            return False
        name = place.replace("/", ".")
        if all(re.sub(r"\d+", "#", name) != re.sub(r"\d+", "#", other) for other in self.signals.values):
            self.signals.values[name] = (
                f"holds {each:g} numbers a sample, such as a picture, expected at most {MAX_NUMBERS_A_SAMPLE}"
            )
        return True

    def _numbers(self, item: Any, place: str) -> Any:
        """Return a dataset's numbers with what its attributes, and those of the groups around it, state of them."""
        array = np.asarray(item[()])
        if array.dtype.fields:
            return {field: array[field] for field in array.dtype.fields}
        labels: tuple[str, ...] = ()
        units: tuple[str, ...] = ()
        rate = None
        holder = item
        while holder is not None:
            lists, own_rate = self.stated_by(holder)
            for key, texts in lists:
                if key in LABEL_KEYS and not labels and array.ndim == 2 and len(texts) in array.shape:
                    labels = texts
                # A single unit that a group states may be that of another dataset.
                elif key in UNIT_KEYS and not units and (holder is item or (array.ndim == 2 and len(texts) > 1)):
                    units = texts
            rate = rate or own_rate
            holder = holder.parent if holder.name != "/" else None
        if rate is not None and array.ndim:
            self.rates[place.replace("/", ".")] = rate
        return Stated(array, labels, units)

    def stated_by(self, holder: Any) -> tuple[list[tuple[str, tuple[str, ...]]], float | None]:
        """Return the lists of texts among a dataset's or group's attributes, by folded key, and its sampling rate."""
        if holder.name not in self._stated:
            lists = [(folded(key), texts) for key in holder.attrs if (texts := texts_of(_attribute(holder, key)))]
            self._stated[holder.name] = lists, _rate(holder)
        return self._stated[holder.name]


def _attribute(holder: Any, key: str) -> Any:
    """Return an attribute's value; None if the library cannot read it."""
    try:
        value = holder.attrs[key]
    except Exception:  # an attribute of a type that the library does not know concerns no number
        return None
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _rate(holder: Any) -> float | None:
    """Return the sampling rate that an object's attributes state [Hz], also in settings as JSON; None without one."""
    for key in holder.attrs:
        value = _attribute(holder, key)
        if isinstance(value, str) and value.lstrip().startswith("{") and len(value) < MAX_SETTINGS_BYTES:
            try:
                found = _rate_in(json.loads(value))
            except (ValueError, RecursionError):
                continue
        else:
            found = _rate_in({key: value})
        if found is not None:
            return found
    return None


def _rate_in(settings: Any) -> float | None:
    """Return the sampling rate among nested settings; None without one."""
    if not isinstance(settings, Mapping):
        return None
    for key, value in settings.items():
        if folded(key) in RATE_KEYS:
            try:
                rate = float(np.asarray(value).item())
            except (TypeError, ValueError):
                continue
            if 0.0 < rate < math.inf:
                return rate
        elif (found := _rate_in(value)) is not None:
            return found
    return None


def is_matlab_object(item: Any) -> bool:
    """Whether MATLAB stores a table or another object here, of which the numbers are only a reference."""
    return "MATLAB_object_decode" in item.attrs


def _is_numeric(dtype: np.dtype) -> bool:
    """Whether a dataset of this type holds numbers, in fields or not."""
    return dtype.kind in "fiub" or dtype.fields is not None


def require_inside(path: Path, name: str, item: Any) -> None:
    """Refuse data that is stored in another file, because that may be any file of this computer."""
    if item.external or item.is_virtual:
        raise RecordingError(
            f"{path.name}: found that {name} is stored in another file, expected it in this one: copy the data into it"
        )
