"""Turn nested values, such as JSON objects and MAT structs, into columns with dotted names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ._caps import require_few_columns


def flatten(value: Any, prefix: str, into: dict[str, np.ndarray], path: Path) -> None:
    """Add the numeric leaves of `value`, which the file `path` holds, to `into`, each shape (n,) float64.

    Leaves that are not numeric are excluded.

    Samples run down a matrix's columns, and along the longest side of an array of more dimensions.
    """
    require_few_columns(path, len(into))
    if isinstance(value, Mapping):
        for key, item in value.items():
            flatten(item, f"{prefix}.{key}" if prefix else str(key), into, path)
    elif isinstance(value, (list, tuple)) and value and all(isinstance(item, Mapping) for item in value):
        fields = dict.fromkeys(key for item in value for key in item)
        require_few_columns(path, len(into) + len(fields))
        for key in fields:
            # An entry without this field has a missing sample; the column keeps its length.
            flatten([item.get(key) for item in value], f"{prefix}.{key}" if prefix else str(key), into, path)
    else:
        array = _numbers(value)
        if array is None or array.size == 0:
            return
        squeezed = np.squeeze(array)
        if squeezed.ndim <= 1:
            into[prefix] = np.ascontiguousarray(squeezed.reshape(-1))
        elif squeezed.ndim == 2:
            require_few_columns(path, len(into) + squeezed.shape[1])
            for column in range(squeezed.shape[1]):
                into[f"{prefix}.{column}"] = np.ascontiguousarray(squeezed[:, column])
        else:
            samples = np.moveaxis(squeezed, int(np.argmax(squeezed.shape)), 0)
            require_few_columns(path, len(into) + samples[0].size)
            for place in np.ndindex(samples.shape[1:]):
                into[".".join((prefix, *map(str, place)))] = np.ascontiguousarray(samples[:, *place])


def with_samples_down(array: np.ndarray) -> np.ndarray:
    """Return a matrix whose samples run along its longer side with the samples down its columns."""
    return array.T if array.ndim == 2 and array.shape[1] > array.shape[0] else array


def _numbers(value: Any) -> np.ndarray | None:
    if isinstance(value, np.ndarray):
        return value.astype(np.float64) if value.dtype.kind in "fiub" else None
    if isinstance(value, (list, tuple)):
        if not any(isinstance(v, (int, float, np.number, list, tuple)) for v in value):
            return None
        value = [np.nan if v is None else v for v in value]
    elif not isinstance(value, (int, float, np.number)):
        return None
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
