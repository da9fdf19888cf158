"""Text of a study.toml from its tables, in the order of the manual and with comments."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

TABLE_ORDER = ("name", "simulated", "rig", "participants", "channels", "streams", "optical", "processing", "model")
"""Tables that study.toml begins with, in order; other tables follow, and the recordings are last."""

COMMENT_COLUMN = 32
"""Column at which comments begin."""


def study_text(said: Mapping[str, Any], comments: Mapping[str, str]) -> str:
    """The text of a study.toml."""
    keys = [key for key in TABLE_ORDER if key in said]
    keys += [key for key in said if key not in (*TABLE_ORDER, "recordings")]
    lines = [f"# {line}" for line in comments.get("", "").splitlines()]
    for key in keys:
        value = said[key]
        lines += _table(key, value, comments) if isinstance(value, Mapping) else [_line(key, value, key, comments)]
    for entry in said.get("recordings", ()):
        lines += ["", "[[recordings]]"]
        for key, value in entry.items():
            nested = isinstance(value, Mapping) and any(isinstance(v, Mapping) for v in value.values())
            pairs = ((f"{key}.{name}", v) for name, v in value.items()) if nested else [(key, value)]
            lines += [f"{name} = {_value(v)}" for name, v in pairs]
    return "\n".join(lines) + "\n"


def _table(path: str, table: Mapping[str, Any], comments: Mapping[str, str], head: str = "[{}]") -> Iterator[str]:
    """Lines of one table, then of those below it, and of lists of them; a channel is a table in one line."""
    lists = {k: v for k, v in table.items() if isinstance(v, list) and v and all(isinstance(x, Mapping) for x in v)}
    below = {k: v for k, v in table.items() if isinstance(v, Mapping) and "column" not in v}
    own = {k: v for k, v in table.items() if k not in below and k not in lists}
    if own or not (below or lists):
        yield ""
        yield _commented(head.format(path), comments.get(path))
    for key, value in own.items():
        yield _line(key, value, f"{path}.{key}", comments)
    for key, value in below.items():
        yield from _table(f"{path}.{key}", value, comments)
    for key, value in lists.items():
        for one in value:
            yield from _table(f"{path}.{key}", one, comments, "[[{}]]")


def _line(key: str, value: Any, path: str, comments: Mapping[str, str]) -> str:
    return _commented(f"{key} = {_value(value)}", comments.get(path))


def _commented(text: str, comment: str | None) -> str:
    return text if comment is None else f"{text:<{COMMENT_COLUMN - 1}} # {comment}"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)
