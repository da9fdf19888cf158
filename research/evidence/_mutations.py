"""Damage as it comes, by a seeded generator: to bytes, to texts of keys and values, to JSON."""

from __future__ import annotations

import json
import re
import struct

import numpy as np

NASTY_BYTES = (
    b"NaN", b"inf", b"-1e999", b"1e-320", b"1" * 5000, b"-1", b"0", b"", b"\x00\x00\x00\x00", b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f", b"=cmd|' /C calc'!A0", b"*/ #error", b"^^5c", b"$(touch x)", b"../../../etc/passwd",
    b"\xf0\x9f\x92\xa9", b"\xed\xa0\x80", b"[" * 2000, b"{\"a\":" * 500, b"<a>" * 500,
    b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b",,,,", b"\r",
    b"\n\n", b"\t", b";", b'"', b"'", b"#", b"true", b"null",
)  # fmt: skip
"""Byte strings that are inserted into files, each of which breaks some kind of parser."""

NASTY_TOML_VALUES = (
    "0", "-1", "1e30", "1e-30", "-1e308", "nan", "inf", "-inf", "1" * 400, "9223372036854775808", "0x7fffffffffffffff",
    "true", "false", '""', '"0"', '"-1 N*m"', '"1e30 s"', '"nan rad"', '"1 m^1000000000"', '"1e400 V"', '"(((((((((1"',
    '"10**10**10 m"', '"__import__(\'os\') m"', '"1 m" ', '"../../etc/passwd"', '"/etc/passwd"', '"*/ x /*"', '"^^5c"',
    '"=1+1"', '"<script>"', '"$\\\\frac"', '"\\u0000"', '"\\u202e"', '"a\\nb"', "[]", "{}", "[[]]", "[1, 2, 3, 4, 5]",
    "[nan, nan, nan]", '{ column = "q" }', '{ a = { a = { a = 1 } } }', "1979-05-27T07:32:00Z", "07:32:00",
    '"' + "a" * 5000 + '"', "[" * 300 + "]" * 300, '"%s%n"', '"{marker}{axis}{0.__class__}"', "-0.0", "5e-324", '"**"',
    '"*"',
)  # fmt: skip
"""TOML values that replace those of a file."""

NASTY_NUMBERS = (
    "0",
    "-1",
    "1e30",
    "1e-30",
    "-1e308",
    "nan",
    "inf",
    "1" * 400,
    "9223372036854775808",
    "5e-324",
    "1e9",
    "7",
)
"""Numbers that replace that of a quantity with a unit."""

JSON_VALUES = (
    None, True, 0, -1, 1e30, -1e308, 5e-324, float("nan"), float("inf"), 10**400, "", "0", "NaN", "*/ x /*", "^^5c",
    "=1+1", "<script>", "../../etc/passwd", "\x00", "\ud800", "a" * 5000, [], {}, [[]], [1, 2, 3],
    [None], {"a": 1}, {"value": 1},
    "sideways",
)  # fmt: skip


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """One to four damages to bytes."""
    made = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        _damage(made, rng)
    return bytes(made)


def _damage(made: bytearray, rng: np.random.Generator) -> None:
    n = len(made)
    if not n:
        made += NASTY_BYTES[int(rng.integers(len(NASTY_BYTES)))]
        return
    # Headers say how the rest is read: half of all damage is done to them.
    at = int(rng.integers(min(n, 1024) if rng.random() < 0.5 else n))
    kind, size = int(rng.integers(10)), int(rng.integers(1, 33))
    if kind == 0:
        del made[at:]
    elif kind == 1:
        made[at] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        made[at : at + size] = rng.bytes(size)
    elif kind == 3:
        del made[at : at + size]
    elif kind == 4:
        made[at:at] = made[at : at + 64 * size]
    elif kind == 5:
        made[at:at] = NASTY_BYTES[int(rng.integers(len(NASTY_BYTES)))]
    elif kind == 6:
        word = NASTY_BYTES[int(rng.integers(len(NASTY_BYTES)))]
        made[at : at + len(word)] = word
    elif kind == 7:
        number = int(rng.choice([0, 1, 255, 65535, 2**31 - 1, 2**31, 2**32 - 1]))
        where = at - at % 4
        made[where : where + 4] = struct.pack("<I", number)
    elif kind == 8:
        other = int(rng.integers(n))
        made[at : at + size] = made[other : other + size]
    else:
        numbers = list(re.finditer(rb"[-+]?\d+(?:\.\d+)?", bytes(made)))[:2000]
        if numbers:
            found = numbers[int(rng.integers(len(numbers)))]
            made[found.start() : found.end()] = NASTY_BYTES[int(rng.integers(len(NASTY_BYTES)))]


def damaged_toml(text: str, rng: np.random.Generator) -> bytes:
    """One to three keys with other values, lost, doubled or misplaced; sometimes damaged bytes."""
    if rng.random() < 0.15:
        return damaged(text.encode(), rng)
    lines = text.splitlines()
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        at = int(rng.integers(len(lines)))
        key, equals, value = lines[at].partition("=")
        kind = int(rng.integers(12))
        numbers = list(re.finditer(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", value))
        if kind >= 9 and numbers:
            # A number that is none of this machine's, in its place and with its unit.
            found = numbers[int(rng.integers(len(numbers)))]
            other = NASTY_NUMBERS[int(rng.integers(len(NASTY_NUMBERS)))]
            lines[at] = f"{key}={value[: found.start()]}{other}{value[found.end() :]}"
        elif kind <= 3 and equals:
            lines[at] = f"{key}= {NASTY_TOML_VALUES[int(rng.integers(len(NASTY_TOML_VALUES)))]}"
        elif kind == 4 and equals:
            # A value within a table, or a list's.
            inner = list(re.finditer(r'"[^"]*"|[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?', value))
            if inner:
                found = inner[int(rng.integers(len(inner)))]
                other = NASTY_TOML_VALUES[int(rng.integers(len(NASTY_TOML_VALUES)))]
                lines[at] = f"{key}={value[: found.start()]}{other}{value[found.end() :]}"
        elif kind == 5:
            del lines[at]
            lines = lines or [""]
        elif kind == 6:
            lines.insert(int(rng.integers(len(lines))), lines[at])
        elif kind == 7 and lines[at].startswith("["):
            lines[at] = lines[at].replace("[", "[[").replace("]", "]]") if rng.random() < 0.5 else "[x]"
        else:
            key = ("a", "name", "unit", "file", "kind", "columns")[int(rng.integers(6))]
            lines.insert(at, f"{key} = {NASTY_TOML_VALUES[int(rng.integers(len(NASTY_TOML_VALUES)))]}")
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def damaged_json(text: str, rng: np.random.Generator) -> bytes:
    """One to three values changed, lost or added anywhere in the tree; sometimes damaged bytes."""
    if rng.random() < 0.15:
        return damaged(text.encode(), rng)
    tree = json.loads(text)
    for _ in range(int(rng.integers(1, 4))):
        node = tree
        while isinstance(node, (dict, list)) and node:
            keys = list(node) if isinstance(node, dict) else range(len(node))
            key = keys[int(rng.integers(len(keys)))]
            if not isinstance(node[key], (dict, list)) or not node[key] or rng.random() < 0.2:
                if rng.random() < 0.15:
                    del node[key]
                elif rng.random() < 0.1 and isinstance(node, dict):
                    node["extra"] = JSON_VALUES[int(rng.integers(len(JSON_VALUES)))]
                elif isinstance(node[key], float) and rng.random() < 0.4:
                    node[key] *= float(rng.choice([-1.0, 0.0, 1e6, 1e-6, 1e300]))
                else:
                    node[key] = JSON_VALUES[int(rng.integers(len(JSON_VALUES)))]
                break
            node = node[key]
    return json.dumps(tree).encode("utf-8", "surrogatepass")
