"""Names and sentences are plain: what a script can see of it.

A constant of one bare word says nothing to who has not read the file; a sentence that begins with "of" or "whose" is a
fragment; two constants on one line share a sentence.
"""

import ast
import re
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


SOURCES = [
    *((path, findings) for path in sorted([*(ROOT / "src").rglob("*.py"), *(ROOT / "lab" / "src").rglob("*.py")])),
    *((path, header_findings) for path in sorted((ROOT / "include").rglob("*.hpp"))),
]
"""Every file of the product, with the function that finds what is not plain in it."""


def test_every_file_is_plain():
    assert len(SOURCES) > 700
    found = [
        f"{path.relative_to(ROOT)}:{line}: {kind}: {what}" for path, find in SOURCES for kind, line, what in find(path)
    ]
    assert not found, "\n".join(found)


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
