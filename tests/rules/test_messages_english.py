"""Messages, verdicts, docstrings and exported files are written in the words of the field, as the documents are."""

import ast
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("src", "lab/src", "research")
BANNED = runpy.run_path(str(Path(__file__).with_name("test_documents_english.py")))["BANNED"]
MAX_IN_FOLDER = {"src": 0, "lab/src": 0, "research": 0}
"""Banned synonyms in the strings of Python files; these numbers only fall."""
FEWEST_WORDS = 5
"""Shorter strings are names, keys and units."""
REMEDY = re.compile(
    r"[Ee]xpected|expects|; |: (check|correct|expect|give|identify|move|record|state|use|hold|export|install)\b"
    r"|not readable|no such file|truncated|damaged|could not be"
)
"""What an error says beside what was found: what was expected, what to do, or that a file is no such file."""
MAX_WITHOUT_REMEDY = 28
"""Errors of `src` that have none of these in their own words: most have it in a variable. This number only falls."""
CODE = re.compile(r"``[^`]*``|`[^`\n]*`|^ *\w+(, \w+)* : .*$", re.MULTILINE)
"""Pieces of code, and the lines that name a parameter and its type."""


def texts(path: Path) -> list[tuple[int, str]]:
    """Return the line and the text of every string of a Python file, pieces of code as one word."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            text = "".join(v.value if isinstance(v, ast.Constant) else "x" for v in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
        else:
            continue
        if len(text.split()) >= FEWEST_WORDS:
            found.append((node.lineno, CODE.sub("x", text)))
    return found


@pytest.mark.parametrize("folder", FOLDERS)
def test_messages_and_docstrings_use_few_banned_synonyms(folder):
    found = [
        f"{path.relative_to(ROOT)}:{line}: {words}: {m[0]!r}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, text in texts(path)
        for words, pattern in BANNED.items()
        for m in re.finditer(pattern, text)
    ]
    assert len(found) <= MAX_IN_FOLDER[folder], "\n".join(found)


def test_exported_files_use_no_banned_synonym():
    found = [
        f"{path.relative_to(ROOT)}: {words}: {m[0]!r}"
        for path in sorted((ROOT / "src").rglob("*.j2"))
        for words, pattern in BANNED.items()
        for m in re.finditer(pattern, path.read_text(encoding="utf-8"))
    ]
    assert found == []


def test_errors_state_what_was_expected_or_what_to_do():
    found = []
    for path in sorted((ROOT / "src" / "pellucid").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args):
                continue
            text = "".join(
                part.value
                for part in ast.walk(node.exc.args[0])
                if isinstance(part, ast.Constant) and isinstance(part.value, str)
            )
            name = ast.unparse(node.exc.func)
            is_own_text = len(text.split()) >= FEWEST_WORDS and not text.rstrip().endswith((":", "("))
            if name.endswith("Error") and is_own_text and not REMEDY.search(text):
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}: {text}")
    assert len(found) <= MAX_WITHOUT_REMEDY, "\n".join(found)
