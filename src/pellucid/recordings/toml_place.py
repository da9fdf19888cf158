"""Where in study.toml a problem stands, and how to say it."""

from __future__ import annotations

import difflib
import re
import typing
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

_HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")


def explain(error: ValidationError, path: Path, text: str, root: type[BaseModel]) -> str:
    """One line per problem: file, line, table and key, what was found and expected.

    Parameters
    ----------
    error : ValidationError
        What Pydantic found.
    path : Path
        The file, for the message.
    text : str
        Its content, to find lines in.
    root : type
        Model of the whole file, to find the nearest valid key in.

    Returns
    -------
    str
    """
    lines = []
    for problem in error.errors(include_url=False):
        where = tuple(part for part in problem["loc"] if not (isinstance(part, str) and part.startswith("function-")))
        number = line_of(text, where)
        place = f"{path}{f', line {number}' if number else ''}: {spell(where)}"
        message = _say(problem, where, root)
        if message and f"{place}: {message}" not in lines:
            lines.append(f"{place}: {message}" if spell(where) else f"{place}{message}")
    return "\n".join(lines)


def spell(where: tuple[str | int, ...]) -> str:
    """A place as a person would write it: ``[rig.drive] kind``, ``[[recordings]] 2 name``."""
    if not where:
        return ""
    if where[0] == "recordings" and len(where) > 1:
        return f"[[recordings]] {int(where[1]) + 1} {'.'.join(map(str, where[2:]))}".rstrip()
    if len(where) == 1:
        return str(where[0])
    if where[0] == "channels":
        return f"[channels] {'.'.join(map(str, where[1:]))}"
    return f"[{'.'.join(map(str, where[:-1]))}] {where[-1]}"


def line_of(text: str, where: tuple[str | int, ...]) -> int | None:
    """1-based line of the deepest part of `where` that is written in `text`; None if no part is.

    Parameters
    ----------
    text : str
        A TOML file.
    where : tuple of str or int
        Keys, with the index of an array's table after its name.
    """
    wanted: list[str] = []
    for part in where:
        wanted.extend(str(part).split(".") if isinstance(part, str) else [str(part)])
    table: list[str] = []
    counts: dict[str, int] = {}
    best, depth = None, 0
    for number, line in enumerate(text.splitlines(), 1):
        header = _HEADER.match(line)
        if header:
            table = [part.strip().strip("\"'") for part in header[2].split(".")]
            if header[1] == "[[":
                counts[header[2]] = counts.get(header[2], -1) + 1
                table.append(str(counts[header[2]]))
            elif table[0] in counts:
                table.insert(1, str(counts[table[0]]))
            here = table
        else:
            key = _KEY.match(line)
            if not key:
                continue
            here = table + [part.strip().strip("\"'") for part in key[1].split(".")]
        if len(here) > depth and here == wanted[: len(here)]:
            best, depth = number, len(here)
    return best


def _say(problem: dict[str, Any], where: tuple, root: type[BaseModel]) -> str:
    kind, found = problem["type"], problem.get("input")
    if kind == "extra_forbidden":
        keys = _keys(root, where[:-1])
        close = difflib.get_close_matches(str(where[-1]), keys, 1, 0.5)
        nearest = f'; the nearest valid one is "{close[0]}"' if close else f"; valid are {', '.join(keys)}"
        return f'unknown key "{where[-1]}"{nearest}'
    if kind == "missing":
        return "missing, and it has no default"
    if kind == "literal_error":
        return f"found {found!r}, expected {problem['ctx']['expected']}"
    if kind == "value_error":
        return str(problem["ctx"]["error"])
    if kind == "string_pattern_mismatch":
        return f"found {found!r}, expected letters, digits, - and _, without blanks"
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return f"found {found!r}, expected a table"
    return f"found {found!r}: {problem['msg'][0].lower()}{problem['msg'][1:]}"


def _keys(model: Any, where: tuple) -> list[str]:
    """Keys a person may write in the table at `where`."""
    skip = False
    for part in where:
        if skip:  # an array's index, or a name the user chose
            skip = False
            continue
        if not _is_table(model) or part not in model.model_fields:
            return []
        model, skip = _inner(model.model_fields[part].annotation)
    return [key for key, field in model.model_fields.items() if not field.validation_alias] if _is_table(model) else []


def _is_table(model: Any) -> bool:
    return isinstance(model, type) and issubclass(model, BaseModel)


def _inner(annotation: Any) -> tuple[Any, bool]:
    """Model of the table inside an annotation, and whether it stands in an array or under chosen names."""
    if _is_table(annotation):
        return annotation, False
    for argument in typing.get_args(annotation):
        found, _ = _inner(argument)
        if found is not None:
            return found, typing.get_origin(annotation) in (dict, tuple)
    return None, False
