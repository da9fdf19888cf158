"""Conversion of arguments of public functions: numbers, texts with a unit, arrays of any library.

Each function returns the value in SI, or raises an error. The error names the function, the argument, the found value
and the expected one.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date, timedelta
from functools import wraps
from numbers import Integral, Real
from os import PathLike
from typing import Any, ParamSpec, TypeVar

import numpy as np

from .._errors import ArgumentError, IdentificationError, PellucidError, RecordingError
from ..units import parse_quantity, to_si_factor

MAX_SHOWN_LENGTH = 60
"""A value in a message has at most this many characters."""


def shown(value: object) -> str:
    """Return a value for a message: short values as they are, others by their type."""
    if isinstance(value, (str, bytes, Real, complex, type(None))):
        return repr(value)[:MAX_SHOWN_LENGTH]
    return f"a value of type {type(value).__name__}"


def number(where: str, name: str, value: Any, *, unit: str = "1", above: float = -np.inf) -> float:
    """Return a finite number above `above`. A text states its unit, such as ``"10 Hz"`` for the `unit` Hz."""
    such = "a number" if unit == "1" else f'a number [{unit}] or a text with its unit, such as "10 {unit}"'
    if isinstance(value, str):
        try:
            found = parse_quantity(value, unit, "")
        except PellucidError as error:
            raise ArgumentError(f"{where}: {name}: {error}") from None
    else:
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
            raise ArgumentError(f"{where}: {name}: found {shown(value)}, expected {such}")
        found = float(value)
    if not np.isfinite(found):
        raise IdentificationError(f"{where}: {name}: found {found:g}, expected a finite number")
    if not found > above:
        raise IdentificationError(f"{where}: {name}: found {found:g}, expected above {above:g}")
    return found


def whole_number(where: str, name: str, value: Any, least: int, most: int = 10**9) -> int:
    """Return a whole number from `least` to `most`."""
    found = number(where, name, value)
    if found != int(found) or not least <= found <= most:
        upto = "" if most == 10**9 else f", at most {most}"
        raise IdentificationError(f"{where}: {name}: found {found:g}, expected an integer of {least} or more{upto}")
    return int(found)


def choice(where: str, name: str, value: Any, options: Iterable[str]) -> str:
    """Return one of some texts."""
    options = tuple(options)
    if not isinstance(value, str) or value not in options:
        wrong = IdentificationError if isinstance(value, str) else ArgumentError
        raise wrong(f"{where}: {name}: found {shown(value)}, expected one of {', '.join(options)}")
    return value


def is_table(value: Any) -> bool:
    """Return whether a value has columns by name: a mapping, a data frame, or a structured array."""
    if isinstance(value, Mapping):
        return True
    if isinstance(value, np.ndarray):
        return value.dtype.names is not None
    return hasattr(value, "columns") and hasattr(value, "__getitem__")


def table_columns(value: Any) -> tuple[str, ...]:
    """Return the names of the columns of a table."""
    if isinstance(value, np.ndarray):
        return tuple(value.dtype.names or ())
    return tuple(map(str, value.keys() if isinstance(value, Mapping) else value.columns))


def real_array(where: str, name: str, values: Any, *, unit: str = "") -> np.ndarray:
    """Return values as an array of floats of any shape, in which a masked or missing sample is NaN.

    `unit` is the SI unit of values that state their own, such as Pint's. Times may be dates and durations, which become
    seconds [s] from the first one.
    """

    def refuse(found: str) -> ArgumentError:
        return ArgumentError(f"{where}: {name}: found {found}, expected an array of real numbers")

    if values is None or isinstance(values, (str, bytes, Mapping, set, frozenset)):
        raise refuse(shown(values))
    if hasattr(values, "units") and hasattr(values, "magnitude"):
        factor, offset = _stated_factor(where, name, str(values.units), unit)
        return factor * real_array(where, name, values.magnitude) + offset
    try:
        array = values if isinstance(values, np.ndarray) else np.ma.asarray(_without_markers(values))
    except (TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise refuse(f"{shown(values)} that is no array ({error})") from None
    missing = np.ma.getmaskarray(array)
    array = np.asarray(np.ma.getdata(array))
    if array.dtype.kind == "O":
        array, missing = _of_objects(array, missing, refuse)
    if array.dtype.kind in "mM":
        if name != "time":
            raise refuse("dates or durations")
        array = _seconds(array, missing)
    elif array.dtype.kind not in "iuf":
        kinds = {"c": "complex numbers", "b": "truth values", "U": "text", "S": "text", "V": "a structured array"}
        raise refuse(kinds.get(array.dtype.kind, f"values of type {array.dtype}"))
    return np.where(missing, np.nan, array.astype(float)) if missing.any() else array.astype(float)


def _without_markers(values: Any) -> Any:
    """Return values of pandas as an array in which a missing one is NaN; other values as they are."""
    if not hasattr(values, "to_numpy"):
        return values
    kind = getattr(getattr(values, "dtype", None), "kind", "O")
    return values.to_numpy(dtype=float, na_value=np.nan) if kind in "iuf" else values.to_numpy()


def _of_objects(array: np.ndarray, missing: np.ndarray, refuse: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return an array of Python's objects as one of numbers or of durations, and where a sample is missing."""
    flat = array.ravel().tolist()
    gone = missing.ravel() | np.array([x is None or str(x) in ("<NA>", "NaT") for x in flat], bool)
    known = [x for x, g in zip(flat, gone, strict=True) if not g]
    first = known[0] if known else 0.0
    try:
        if isinstance(first, date | timedelta):
            start = first if isinstance(first, date) else timedelta()
            lasts = [timedelta() if g else x - start for x, g in zip(flat, gone, strict=True)]
            made = np.array([each // timedelta(microseconds=1) for each in lasts], "timedelta64[us]")
        else:
            odd = next((x for x in known if isinstance(x, bool | np.bool_ | str | bytes)), None)
            if odd is not None:
                raise refuse(shown(odd))
            made = np.array([np.nan if g else float(x) for x, g in zip(flat, gone, strict=True)])
    except ArgumentError:
        raise
    except (TypeError, ValueError, ArithmeticError):
        odd = next((x for x in known if not isinstance(x, Real)), None)
        raise refuse(shown(odd)) from None
    return made.reshape(array.shape), gone.reshape(array.shape)


def _seconds(array: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Return dates or durations as seconds from the first one, NaN where there is none."""
    known = array[~(missing | np.isnat(array))]
    first = known[0] if known.size else array.dtype.type(0, "s")
    if array.dtype.kind == "m":
        return array / np.timedelta64(1, "s")
    return (array - first) / np.timedelta64(1, "s")


def _stated_factor(where: str, name: str, stated: str, unit: str) -> tuple[float, float]:
    try:
        return to_si_factor(stated.replace(" ", "").replace("**", "^"), unit or None, "")
    except PellucidError as error:
        raise ArgumentError(f"{where}: {name}: {error}") from None


def real_column(where: str, name: str, values: Any, *, unit: str = "") -> np.ndarray:
    """Return values as one column of floats, shape (n,), in which a masked or missing sample is NaN."""
    column = real_array(where, name, values, unit=unit)
    if column.ndim == 2 and column.shape[1] == 1:
        column = column[:, 0]
    if column.ndim != 1:
        raise RecordingError(f"{where}: {name}: found shape {column.shape}, expected (n,) or (n, 1)")
    return np.ascontiguousarray(column)


def held_out_share(where: str, held_out: Any) -> float | None:
    """Return the share of recordings or samples that `held_out` is; None if it is no share but says which ones."""
    if not isinstance(held_out, Real) or isinstance(held_out, (bool, np.bool_, Integral)):
        return None
    share = number(where, "held_out", held_out)
    if not 0.0 < share < 1.0:
        raise IdentificationError(f"{where}: held_out: found {share:g}, expected a share above 0 and below 1")
    return share


def held_out_names(where: str, names: Sequence[str], held_out: Any) -> set[str]:
    """Return the names of the recordings that `held_out` says: a share of the last ones, names, or numbers."""
    share = held_out_share(where, held_out)
    if share is not None:
        return set(names[len(names) - min(max(round(share * len(names)), 1), len(names) - 1) :])
    chosen = [held_out] if isinstance(held_out, (str, Integral)) else held_out
    is_several = isinstance(chosen, Sequence) and not isinstance(chosen, (str, bytes)) and len(chosen) > 0
    if not is_several or not all(map(_is_name_or_number, chosen)):
        raise ArgumentError(
            f"{where}: held_out: found {shown(held_out)}, expected recordings, their names or numbers, or a share"
        )
    for each in chosen:
        if each not in names if isinstance(each, str) else not -len(names) <= int(each) < len(names):
            raise IdentificationError(
                f"{where}: held_out: found {each!r}, expected a number from 0 to {len(names) - 1} or one of "
                f"{', '.join(names)}"
            )
    judged = {each if isinstance(each, str) else names[int(each)] for each in chosen}
    if len(judged) == len(names):
        raise IdentificationError(f"{where}: held_out: found all recordings, expected at least one that is fitted")
    return judged


def _is_name_or_number(value: Any) -> bool:
    return isinstance(value, (str, Integral)) and not isinstance(value, bool)


Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")


def with_checked_arguments(function: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
    """Return a public `function` that refuses an argument of another type than its annotation with an `ArgumentError`.

    Numbers, texts, paths, truth values, arrays, mappings and sequences are checked. Arguments of other classes are the
    function's own to check. A sampling rate may be given as ``rate`` or ``fs``, whichever the function has. An array
    with masked samples becomes one with NaN, and times that are dates become seconds.
    """
    signature = inspect.signature(function)
    parsed = {
        name: _alternatives(ast.parse(each.annotation, mode="eval").body)
        for name, each in signature.parameters.items()
        if isinstance(each.annotation, str) and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
    }

    @wraps(function)
    def checked(*arguments: Parameters.args, **options: Parameters.kwargs) -> Returned:
        given: dict[str, Any] = dict(options)
        for name, alias in (("rate", "fs"), ("fs", "rate")):
            if name in signature.parameters and alias not in signature.parameters:
                given = with_one_rate(function.__name__, given, name, alias)
        try:
            bound = signature.bind(*arguments, **given)
        except TypeError as error:
            from difflib import get_close_matches

            near = [
                f'; is "{close[0]}" meant?'
                for name in options
                if name not in signature.parameters and (close := get_close_matches(name, signature.parameters, 1))
            ]
            raise ArgumentError(f"{function.__name__}: {error}{near[0] if near else ''}") from None
        for name, value in bound.arguments.items():
            if name in parsed:
                bound.arguments[name] = _checked(function.__name__, name, value, parsed[name])
        return function(*bound.args, **bound.kwargs)

    return checked


def with_one_rate(where: str, options: dict[str, Any], name: str, alias: str) -> dict[str, Any]:
    """Return options in which a sampling rate that was given by its `alias` has its `name`."""
    if alias not in options:
        return options
    if name in options:
        raise ArgumentError(f"{where}: found {name} and {alias}, expected one of them: both are the sampling rate")
    return {(name if key == alias else key): value for key, value in options.items()}


def _alternatives(node: ast.expr) -> list[ast.expr]:
    """Return the types that an annotation ``A | B`` allows."""
    if isinstance(node, ast.BinOp):
        return [*_alternatives(node.left), *_alternatives(node.right)]
    return [node]


def _type_name(node: ast.expr) -> str:
    """Return the last part of a type's name; "None" for None."""
    if isinstance(node, ast.Subscript):
        return _type_name(node.value)
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else str(getattr(node, "value", ""))


_TYPES: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "None": ("None", lambda x: x is None),
    "bool": ("True or False", lambda x: isinstance(x, (bool, np.bool_)) or (isinstance(x, Integral) and x in (0, 1))),
    "int": ("an integer", lambda x: _is_number(x) and float(x).is_integer()),
    "float": ("a number", lambda x: _is_number(x)),
    "str": ("a text", lambda x: isinstance(x, str)),
    "Literal": ("a text", lambda x: isinstance(x, str)),
    "PathLike": ("a path", lambda x: isinstance(x, (str, PathLike))),
    "Path": ("a path", lambda x: isinstance(x, (str, PathLike))),
    "Callable": ("a function", callable),
    "ArrayLike": ("an array of real numbers", lambda x: True),
    "ndarray": ("an array of real numbers", lambda x: True),
    "Mapping": ("a mapping", lambda x: isinstance(x, Mapping) or (hasattr(x, "keys") and hasattr(x, "__getitem__"))),
    "Sequence": ("a sequence", lambda x: _is_sequence(x)),
    "Iterable": ("a sequence", lambda x: hasattr(x, "__iter__") and not isinstance(x, (str, bytes))),
    "tuple": ("a tuple", lambda x: _is_sequence(x)),
}
"""What each type of an annotation is called in messages, and whether a value is of it."""


def _is_number(value: Any) -> bool:
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    return isinstance(value, Real) and not isinstance(value, (bool, np.bool_))


def _is_sequence(value: Any) -> bool:
    is_other = isinstance(value, (str, bytes, Mapping, set, frozenset, type))
    is_scalar = isinstance(value, np.ndarray) and value.ndim == 0
    return hasattr(value, "__len__") and hasattr(value, "__getitem__") and not is_other and not is_scalar


def _checked(where: str, name: str, value: Any, allowed: list[ast.expr]) -> Any:
    """Return a value that one of the `allowed` types admits; raise an ArgumentError if none does."""
    wrong: ArgumentError | None = None
    for node in allowed:
        kind = _type_name(node)
        if kind not in _TYPES:
            return value
        if not _TYPES[kind][1](value):
            continue
        try:
            return _checked_parts(where, name, value, kind, node)
        except ArgumentError as error:
            wrong = wrong or error
    if wrong is not None:
        raise wrong
    expected = dict.fromkeys(_TYPES[_type_name(node)][0] for node in allowed)
    raise ArgumentError(f"{where}: {name}: found {shown(value)}, expected {' or '.join(expected)}")


def _checked_parts(where: str, name: str, value: Any, kind: str, node: ast.expr) -> Any:
    """Return a value of a type whose parts are checked, too; an array as one of floats if it was none before."""
    if kind in ("ArrayLike", "ndarray"):
        found = real_array(where, name, value)
        # An array of numbers stays as it is, with its type and its memory.
        is_plain = isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and not np.ma.isMaskedArray(value)
        return value if is_plain else found
    if not isinstance(node, ast.Subscript):
        return value
    parts = list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]
    if kind == "Mapping" and isinstance(value, Mapping):
        return {key: _checked(where, f"{name}: {key}", x, _alternatives(parts[1])) for key, x in value.items()}
    if kind in ("Sequence", "Iterable") and isinstance(value, (list, tuple, set, np.ndarray)):
        return [_checked(where, name, x, _alternatives(parts[0])) for x in value]
    if kind == "tuple":
        is_endless = any(getattr(part, "value", None) is Ellipsis for part in parts)
        if not is_endless and len(value) != len(parts):
            raise ArgumentError(f"{where}: {name}: found {len(value)} values, expected {len(parts)}")
        kinds = [parts[0]] * len(value) if is_endless else parts
        return tuple(_checked(where, name, x, _alternatives(part)) for x, part in zip(value, kinds, strict=True))
    return value
