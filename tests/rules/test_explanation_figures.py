"""Each chapter of the explanation has a figure that its own functions draw: described, labelled, and light."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHAPTERS = [page for page in sorted((ROOT / "docs" / "explanation").glob("*.md")) if page.name != "index.md"]
MAX_BYTES = 40_000
MIN_WORDS = 5


@pytest.fixture(scope="module")
def figures():
    sys.path.insert(0, str(ROOT / "website"))
    try:
        import figures

        yield figures
    finally:
        sys.path.remove(str(ROOT / "website"))


def test_each_chapter_has_a_function_and_no_other_figure_is_kept(figures):
    assert set(figures.FIGURES) == {page.stem for page in CHAPTERS}
    assert {path.stem for path in figures.FOLDER.glob("*")} == set(figures.FIGURES)


@pytest.mark.parametrize("page", CHAPTERS, ids=lambda page: page.stem)
def test_a_chapter_shows_its_figure_with_alternative_text_and_a_caption(page):
    text = page.read_text(encoding="utf-8")
    picture = rf"!\[([^]]+)\]\(\.\./images/explanation/{page.stem}\.svg\)"
    shown = re.findall(rf"^{picture}\n\n\*([^*]+)\*$", text, re.MULTILINE)
    assert len(shown) == 1
    assert all(len(words.split()) >= MIN_WORDS for words in shown[0])


@pytest.mark.parametrize("page", CHAPTERS, ids=lambda page: page.stem)
def test_a_figure_is_light_labelled_and_readable_on_dark_pages(page):
    svg = (ROOT / "docs" / "images" / "explanation" / f"{page.stem}.svg").read_text(encoding="utf-8")
    assert len(svg.encode()) < MAX_BYTES
    assert re.search(r"<title>[^<]{20,}</title>", svg)
    assert "prefers-color-scheme:dark" in svg
    assert "nan" not in svg.replace("name", "").lower()
    labels = re.findall(r"<text[^>]*>([^<]+)</text>", svg)
    words = [label for label in labels if re.fullmatch(r"[^\d−⁻].*[a-z].*", label)]
    assert len(words) >= 3, labels  # a title and both axes
    sizes = re.findall(r"font:(\d+)px", svg)
    assert min(map(int, sizes)) >= 14


def test_a_figure_is_drawn_again_by_its_command(figures, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "FOLDER", tmp_path)
    monkeypatch.setattr(sys, "argv", ["figures.py", "muscles", "free-carriage"])
    figures.main()
    for name in ("muscles", "free-carriage"):
        kept = ROOT / "docs" / "images" / "explanation" / f"{name}.svg"
        made = (tmp_path / f"{name}.svg").read_text(encoding="utf-8")
        assert re.findall(r">([^<]+)</text>", made) == re.findall(r">([^<]+)</text>", kept.read_text(encoding="utf-8"))


def test_the_figure_of_the_supervision_shows_the_stored_results(figures):
    """Its bars are heights only: a figure of older results had the same words."""
    kept = ROOT / "docs" / "images" / "explanation" / "supervision.svg"
    assert figures.supervision() == kept.read_text(encoding="utf-8")


def test_an_unknown_figure_is_named(figures, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["figures.py", "colours"])
    with pytest.raises(SystemExit, match="found colours"):
        figures.main()
