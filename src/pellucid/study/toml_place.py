"""Explain the problems of a study.toml, each with its line, table and key."""

from __future__ import annotations

import difflib
import re
import typing
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from .study_fields import DERIVED_PREFIX

MAX_LINE_LENGTH = 300
"""Keys are not searched in lines with more characters than this."""

MAX_EXPLAINED_PROBLEMS = 40
"""At most this many problems are explained; each is searched in every line of the file."""

MAX_MESSAGE_LENGTH = 1000
"""What a message quotes of a file ends after this many characters."""

_HEADER_PATTERN = re.compile(r"\s*(\[\[?)([^\[\]]+)\]\]?\s*(?:#.*)?$")
_KEY_PATTERN = re.compile(
    r"""\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*="""
)


def explain_errors(error: ValidationError, path: Path, text: str, root: type[BaseModel]) -> str:
    """Return one line of text per problem: file, line, table, key, found and expected values."""
    lines: dict[str, None] = {}
    problems = error.errors(include_url=False)
    for problem in problems[:MAX_EXPLAINED_PROBLEMS]:
        where = tuple(
            part
            for part in problem["loc"]
            if not (isinstance(part, str) and part.startswith(("function-", DERIVED_PREFIX)))
        )
        number = line_of(text, where)
        place = f"{path}{f', line {number}' if number else ''}: {format_place(where)}"
        message = _describe_problem(problem, where, root)
        if message:
            line = f"{place}: {message}" if format_place(where) else f"{place}{message}"
            lines[line if len(line) <= MAX_MESSAGE_LENGTH else f"{line[:MAX_MESSAGE_LENGTH]}..."] = None
    if len(problems) > MAX_EXPLAINED_PROBLEMS:
        lines[f"{path}: {len(problems) - MAX_EXPLAINED_PROBLEMS} further problems"] = None
    return "\n".join(lines)


def format_place(where: tuple[str | int, ...]) -> str:
    """Return a place as a person would write it: ``[rig.drive] kind``, ``[[recordings]] 2 name``."""
    if not where:
        return ""
    if where[0] == "recordings" and len(where) > 1:
        return f"[[recordings]] {int(where[1]) + 1} {'.'.join(map(str, where[2:]))}".rstrip()
    if where[:2] == ("rig", "joints") and len(where) > 2:
        return f"[[rig.joints]] {int(where[2]) + 1} {'.'.join(map(str, where[3:]))}".rstrip()
    if len(where) == 1:
        return str(where[0])
    if where[0] == "channels":
        return f"[channels] {'.'.join(map(str, where[1:]))}"
    return f"[{'.'.join(map(str, where[:-1]))}] {where[-1]}"


def line_of(text: str, where: tuple[str | int, ...]) -> int | None:
    """Return the 1-based line of the deepest part of `where` that `text` contains; None if it contains no part."""
    wanted: list[str] = []
    for part in where:
        wanted.extend(str(part).split(".") if isinstance(part, str) else [str(part)])
    table: list[str] = []
    counts: dict[str, int] = {}
    best, depth = None, 0
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > MAX_LINE_LENGTH:
            continue
        header = _HEADER_PATTERN.match(line)
        if header:
            name = header[2].strip()
            table = [part.strip().strip("\"'") for part in name.split(".")]
            if header[1] == "[[":
                counts[name] = counts.get(name, -1) + 1
                table.append(str(counts[name]))
            else:
                for array in (key.split(".") for key in counts):
                    if table[: len(array)] == array:
                        table.insert(len(array), str(counts[".".join(array)]))
            here = table
        else:
            key = _KEY_PATTERN.match(line)
            if not key:
                continue
            here = table + [part.strip().strip("\"'") for part in key[1].split(".")]
        if len(here) > depth and here == wanted[: len(here)]:
            best, depth = number, len(here)
    return best


def _describe_problem(problem: dict[str, Any], where: tuple, root: type[BaseModel]) -> str:
    kind, found = problem["type"], problem.get("input")
    if kind == "extra_forbidden":
        keys = _valid_keys(root, where[:-1])
        close = difflib.get_close_matches(str(where[-1]), keys, 1, 0.5)
        nearest = f'; the nearest valid one is "{close[0]}"' if close else f"; valid are {', '.join(keys)}"
        return f'unknown key "{where[-1]}"{nearest}'
    if kind == "missing":
        return "missing, and it has no default"
    if kind == "literal_error":
        return f"found {_shorten(found)}, expected {problem['ctx']['expected']}"
    if kind == "value_error":
        return str(problem["ctx"]["error"])
    if kind == "string_pattern_mismatch":
        return f"found {_shorten(found)}, expected letters, digits, - and _, without blanks"
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return f"found {_shorten(found)}, expected a table"
    if kind in ("less_than_equal", "greater_than_equal"):
        word, bound = ("at most", "le") if kind == "less_than_equal" else ("at least", "ge")
        return f"found {_shorten(found)}, expected {word} {problem['ctx'][bound]:g}"
    return f"found {_shorten(found)}: {problem['msg'][0].lower()}{problem['msg'][1:]}"


def _shorten(found: Any) -> str:
    text = repr(found)
    return text if len(text) <= 200 else f"{text[:200]}..."


def _valid_keys(model: Any, where: tuple) -> list[str]:
    """Return the keys that a person may write in the table at `where`."""
    models, skip = [model], False
    for part in where:
        if skip:  # this part is an array's index or a name that the user chose
            skip = False
            continue
        fields = [m.model_fields[part] for m in models if part in m.model_fields]
        models, skip = _inner_tables(fields[0].annotation) if fields else ([], False)
    return list(
        dict.fromkeys(key for m in models for key, field in m.model_fields.items() if not field.validation_alias)
    )


def _is_table(model: Any) -> bool:
    return isinstance(model, type) and issubclass(model, BaseModel)


def _inner_tables(annotation: Any) -> tuple[list[type[BaseModel]], bool]:
    """Return the models of the table inside an annotation, and whether it is in an array or under chosen names."""
    if _is_table(annotation):
        return [annotation], False
    found = [model for argument in typing.get_args(annotation) for model in _inner_tables(argument)[0]]
    return found, bool(found) and typing.get_origin(annotation) in (dict, tuple)
