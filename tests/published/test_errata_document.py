"""docs/errata.md, entry by entry: each says what is wrong, and names tests that prove it."""

import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
TEXT = (TESTS.parent / "docs" / "errata.md").read_text(encoding="utf-8")
WRITTEN = {n for p in TESTS.rglob("test_*.py") for n in re.findall(r"^def (test_\w+)", p.read_text("utf-8"), re.M)}


@pytest.mark.parametrize(("paper", "count"), [("A", 16), ("B", 13), ("C", 15)])
def test_every_erratum_is_explained_and_proved(paper, count):
    parts = re.split(rf"^### {paper}(\d+)\b", TEXT, flags=re.MULTILINE)[1:]
    assert parts[::2] == [str(n) for n in range(1, count + 1)]
    for number, text in zip(parts[::2], parts[1::2], strict=True):
        text = text.split("\n## ")[0]  # the next paper begins there
        named = re.findall(r"`(test_\w+)`", text)
        assert any(n.startswith(f"test_{paper.lower()}{number}_") for n in named), number
        assert set(named) <= WRITTEN, number
        for heading in ("Printed", "Why it cannot be", "Instead"):
            assert f"**{heading}.**" in text, (number, heading)


def test_every_proof_is_named():
    proofs = {n for n in WRITTEN if re.match(r"test_[abc]\d+_", n)}
    assert proofs <= set(re.findall(r"`(test_\w+)`", TEXT))
