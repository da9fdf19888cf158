"""Names and sentences are plain: what a script can see of it, counted by room, and may only fall.

A constant of one bare word says nothing to who has not read the file; a sentence that begins with "of" or "whose" is a
fragment; two constants on one line share a sentence. Where the numbers below are 0 they stay 0. Where a room improves,
lower its numbers here.
"""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

FIELD_TERMS = frozenset(
    """
    SEED SEEDS UNITS UNIT KIND KINDS ENDINGS APART LAWS FAMILIES METHODS MODELS NAMES RIGS COLUMNS COLORS COLOURS TERMS
    INDICES COMMANDS STATES MODES SIGNS AXES GRAVITY EPSILON VERSION SCHEMA LICENCE LICENSE FORMATS READERS WRITERS
    DTYPE DIGITS INCLUDE TEMPLATES MARGINS COMMENTS PRIOR PRIORS BOUNDS LIMITS DEFAULTS OPTIONS ROOT PATTERN JOINTS
    MUSCLES LINKS SENSORS FAULTS WATCHES PASS FAIL UNDECIDED
    """.split()  # noqa: SIM905
)
"""Single words that are terms of the field, or say what they hold."""

FRAGMENT = re.compile(
    r"^(of|whose|which|that|to whom|(by|in|with|from|below|above|beyond|over|within) (which|whom|where)|from where)\b"
    r"(?! is\b| are\b)",
    re.IGNORECASE,
)
"""Beginnings of sentences that lack their subject."""

KINDS = ("one-word constants", "fragments", "constants on one line")

ALLOWED: dict[str, tuple[int, int, int]] = {}
"""Numbers of `KINDS` that a room still has; a room that is not here has none."""


def _assigned(node: ast.stmt) -> list[str]:
    """Return the upper-case names that a statement assigns at once."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    names = [e.id for t in targets for e in (t.elts if isinstance(t, ast.Tuple) else [t]) if isinstance(e, ast.Name)]
    return [name for name in names if name.isupper()]


def findings(path: Path) -> list[tuple[str, int, str]]:
    """Return what is not plain in a Python file: kind, line, and what it is."""
    text = path.read_text(encoding="utf-8")
    tree, found = ast.parse(text), []
    for owner in (n for n in ast.walk(tree) if isinstance(n, (ast.Module, ast.ClassDef))):
        for node, after in zip(owner.body, [*owner.body[1:], None], strict=True):
            names = _assigned(node)
            for name in names:
                word = name.strip("_")
                if len(word) > 1 and "_" not in word and word not in FIELD_TERMS:
                    found.append((KINDS[0], node.lineno, name))
            if len(names) > 1 and isinstance(getattr(node, "value", None), ast.Tuple):
                found.append((KINDS[2], node.lineno, ", ".join(names)))
            if isinstance(node, (ast.Assign, ast.AnnAssign)) and isinstance(after, ast.Expr):
                sentence = getattr(after.value, "value", None)
                if isinstance(sentence, str) and FRAGMENT.match(sentence.strip()):
                    found.append((KINDS[1], after.lineno, sentence.strip().splitlines()[0]))
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            sentence = ast.get_docstring(node) or ""
            if FRAGMENT.match(sentence):
                found.append((KINDS[1], node.lineno, sentence.splitlines()[0]))
    previous_is_comment = False
    for i, line in enumerate(text.splitlines(), 1):
        comment, whole = re.search(r"(?:^|\s)# (.*)$", line), line.lstrip().startswith("#")
        begins = comment and not (whole and previous_is_comment) and line.count('"') % 2 == 0
        if begins and FRAGMENT.match(comment[1]):
            found.append((KINDS[1], i, f"# {comment[1]}"))
        previous_is_comment = whole
    return found


def header_findings(path: Path) -> list[tuple[str, int, str]]:
    """Return comments of fields in a C++ header that begin in the middle of a sentence."""
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    comments = ((i, re.search(r"///<? ?(.*)$", line)) for i, line in lines)
    return [(KINDS[1], i, found[1]) for i, found in comments if found and FRAGMENT.match(found[1])]


def by_room() -> dict[str, list[tuple[str, str]]]:
    """Return kind and place of every finding, by room."""
    rooms: dict[str, list[tuple[str, str]]] = {}
    sources = [(path, findings(path)) for path in sorted((ROOT / "src").rglob("*.py"))]
    sources += [(path, header_findings(path)) for path in sorted((ROOT / "include").rglob("*.hpp"))]
    for path, found in sources:
        parts = path.relative_to(ROOT).parts
        room = parts[0] if parts[0] == "include" else parts[2] if len(parts) > 3 else "pellucid"
        for kind, line, what in found:
            rooms.setdefault(room, []).append((kind, f"{path.relative_to(ROOT)}:{line}: {what}"))
    return rooms


FOUND = by_room()


@pytest.mark.parametrize("room", sorted({*FOUND, *ALLOWED}))
def test_a_room_says_it_no_less_plainly_than_before(room):
    counted = Counter(kind for kind, _ in FOUND.get(room, []))
    for kind, allowed in zip(KINDS, ALLOWED.get(room, (0, 0, 0)), strict=True):
        places = [place for one, place in FOUND.get(room, []) if one == kind]
        assert counted[kind] <= allowed, "\n".join((f"{room}: {kind}: {counted[kind]}, allowed {allowed}", *places))
        assert counted[kind] == allowed, f"{room}: {kind} fell to {counted[kind]}: lower {allowed} in ALLOWED"


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ('MOST = 3\n"""The largest number of trials."""\n', 0),
        ('MOST_TRIALS = 3\n"""Of trials, the largest number."""\n', 1),
        ("LOW_LEVEL, HIGH_LEVEL = 1, 2\n", 2),
        ('def spread(x):\n    """That which is left of x."""\n', 1),
        ("WIDTH_M = 3  # whose width it is\n", 1),
    ],
)
def test_each_kind_is_found(tmp_path, source, kind):
    (tmp_path / "told.py").write_text(source, encoding="utf-8")
    assert [found[0] for found in findings(tmp_path / "told.py")] == [KINDS[kind]]
