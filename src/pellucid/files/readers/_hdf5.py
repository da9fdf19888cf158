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
    signals, content = Signals(path), dict[str, Any]()
    rates: dict[str, float] = {}
    number_count = 0.0

    def visit(place: str, item: Any) -> None:
        nonlocal number_count
        if not isinstance(item, h5py.Dataset) or place.startswith("#") or is_matlab_object(item):
            return
        value = None
        if h5py.check_string_dtype(item.dtype) is not None and 1 < item.size <= max_columns():
            value = [str(text) for text in np.ravel(item.asstr()[()])]
        elif _is_numeric(item.dtype):
            require_inside(path, place, item)
            each = item.size / max(item.shape, default=1) if item.size else 0
            if item.ndim > 2 and each > MAX_NUMBERS_A_SAMPLE:
                # Of the cameras of many demonstrations, one speaks for all.
                name = place.replace("/", ".")
                if all(re.sub(r"\d+", "#", name) != re.sub(r"\d+", "#", other) for other in signals.values):
                    signals.values[name] = (
                        f"holds {each:g} numbers a sample, such as a picture, expected at most {MAX_NUMBERS_A_SAMPLE}"
                    )
                return
            # A field of a compound dataset may hold several numbers.
            number_count += item.size * max(item.dtype.itemsize / 8.0, 1.0) if item.dtype.fields else item.size
            # A dataset in chunks is unpacked chunk by chunk, and a chunk may be larger than the dataset.
            require_unpacked_size(path, max(number_count, math.prod(item.chunks or ()) * item.dtype.itemsize / 8.0))
            value = _stated(item, place, rates)
        if value is not None:
            *groups, name = place.split("/")
            into = content
            for group in groups:
                into = into.setdefault(group, {})
            into[name] = value

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
            rate_of_file = _rate(file)
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # the library raises a dozen types for damaged files
        raise RecordingError(f"{path.name}: not readable as HDF5, truncated or damaged: {error}") from error
    if rate_of_file is not None:
        signals.state_rate("", rate_of_file)
    signals.add(content, "")
    for place, rate in rates.items():
        signals.state_rate(place, rate)
    return signals.columns()


def _stated(item: Any, place: str, rates: dict[str, float]) -> Any:
    """Return a dataset's numbers with what its attributes, and those of the groups around it, state of them."""
    array = np.asarray(item[()])
    if array.dtype.fields:
        return {field: array[field] for field in array.dtype.fields}
    labels: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    rate = None
    holder = item
    while holder is not None:
        for key in holder.attrs:
            texts = texts_of(_attribute(holder, key))
            if folded(key) in LABEL_KEYS and not labels and array.ndim == 2 and len(texts) in array.shape:
                labels = texts
            # A single unit that a group states may be that of another dataset.
            elif folded(key) in UNIT_KEYS and not units and (holder is item or (array.ndim == 2 and len(texts) > 1)):
                units = texts
        rate = rate or _rate(holder)
        holder = holder.parent if holder.name != "/" else None
    if rate is not None and array.ndim:
        rates[place.replace("/", ".")] = rate
    return Stated(array, labels, units)


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
        raise RecordingError(f"{path.name}: found that {name} is stored in another file, expected it in this one")
