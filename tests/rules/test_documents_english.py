"""Documents are written in the words of the field: no banned synonym, whole headings, short sentences, few words."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))

MADE = runpy.run_path(str(ROOT / "website" / "generated.py"))

BANNED = {
    "depends on": r"\bhangs? on\b",
    "tests, compares": r"\bjudge[sd]?\b(?! of| whether)",
    "states, shows": r"\b(is|are|was|were) told\b|\btells (apart|of|that|what|how)\b",
    "a noun": r"(?<=[,;:.] )[Ww]hat (is|are|was|were|it|they|a|an|the|no|does|do|has|have)\b",
    "is excluded": r"\bleft out\b",
    "the user, the wearer": r"\b([Ww]hoever|[Ww]ho wants|[Ww]ho wears)\b",
    "the interval covers": r"\bintervals? (holds?|held|that holds?)\b",
    "in addition to, next to": r"\bbeside\b",
    "baseline": r"\brivals?\b",
    "sampled": r"\bdrawn (people|persons?|participants?|wearers?|robots?|rigs?|joints?|elbows?|knees?|bod\w+|stud\w+)",
    "simulated": r"\bvirtual (people|persons?|participants?|wearers?|ones)\b",
    "results in": r"\bcomes? to (nothing|be)\b",
    "instead of": r"\bin place of\b",
    "back and forth": r"\bto and fro\b",
    "at most": r"\bat (the )?most it\b",
    "the name of the earlier thing": r"\bof (before|today)\b",
    "wrong": r"\blying\b",
    "is compared with": r"\bholds? against\b|\bheld? against\b",
    "a subject": r"(?m)^(Of|That|Whose|Whom) ",
}
"""Words that no peer's manual writes in this sense, by the words to write."""

HIDDEN_SUBJECT = re.compile(r"^#+ (What|Where|Who|And|Of|How sure|Which)\b.*", re.MULTILINE)
SEED = re.compile(r"\b20[2-3]\d(0[1-9]|1[0-2])[0-3]\d\b")
BARE_DECIMAL = re.compile(r"(?<![\d.\w/*\])])\.\d")
MAX_SENTENCE_WORDS = 30
MAX_LONG_SENTENCES = 75
"""Sentences above `MAX_SENTENCE_WORDS` in all documents; this number only falls."""
MAX_WORDS = 70_000
MAX_PAGE_WORDS = {"tutorials": 1000, "how-to": 400, "explanation": 2000}
MAX_OTHER_WORDS = 3000
MAX_IN_GENERATED = {"parameters": 14}
"""Banned synonyms in pages that are made of the code; these numbers only fall."""
UNLIMITED = ("docs/errata.md", "docs/reference/index.md")


def prose(page: Path) -> str:
    """Return the text of a page without blocks and comments, and with each piece of code as one word."""
    text = re.sub(r"```.*?```|<!--.*?-->", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"`[^`\n]*`", "x", text)


def sentences(text: str) -> list[str]:
    found = []
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*+]|\d+\.) )|\n(?=#)", text):
        if block.lstrip().startswith("|"):
            found += [cell.strip() for row in block.splitlines() for cell in row.strip("| ").split("|")]
        else:
            found += re.split(r"(?<=[.!?;:]) +(?=[A-Z*`x])", " ".join(block.split()))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_uses_no_banned_synonym(page):
    text = prose(page)
    found = [(words, m) for words, pattern in BANNED.items() for m in re.finditer(pattern, text)]
    assert [(words, text[max(0, m.start() - 30) : m.end() + 30]) for words, m in found] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_has_no_seed_no_bare_decimal_and_headings_with_a_subject(page):
    text = prose(page)
    assert [m[0] for m in (*HIDDEN_SUBJECT.finditer(text), *SEED.finditer(text), *BARE_DECIMAL.finditer(text))] == []


@pytest.mark.parametrize("kind", MADE["PAGES"])
def test_a_page_that_is_made_of_the_code_uses_few_banned_synonyms(kind):
    text = re.sub(r"```.*?```", " ", MADE["page"](kind), flags=re.DOTALL)
    text = re.sub(r"`[^`\n]*`", "x", text)
    found = [(words, m[0]) for words, pattern in BANNED.items() for m in re.finditer(pattern, text)]
    assert len(found) <= MAX_IN_GENERATED.get(kind, 0), found


def test_long_sentences_become_fewer():
    long = [each for page in PAGES for each in sentences(prose(page)) if len(each.split()) > MAX_SENTENCE_WORDS]
    assert len(long) <= MAX_LONG_SENTENCES, long


def test_documents_keep_to_their_words():
    words = {page.relative_to(ROOT).as_posix(): len(prose(page).split()) for page in PAGES}
    limits = {name: MAX_PAGE_WORDS.get(Path(name).parent.name, MAX_OTHER_WORDS) for name in words} | {"README.md": 600}
    assert {name: n for name, n in words.items() if name not in UNLIMITED and n > limits[name]} == {}
    assert sum(words.values()) <= MAX_WORDS
