"""The site has every page of docs/ and every notebook, and asks no other server for anything."""

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).parents[2]
SETTINGS = (ROOT / "website" / "mkdocs.yml").read_text(encoding="utf-8")
LISTED = re.findall(r": ([\w./-]+\.(?:md|ipynb))$", SETTINGS, flags=re.MULTILINE)


def test_every_page_is_in_the_menu_once():
    made = {"index.md", "api.md", "gallery.md", "CONTRIBUTING.md", "CHANGELOG.md", "packaging.md", "board.md"}
    generated = {file for file, _ in runpy.run_path(str(ROOT / "website" / "generated.py"))["PAGES"].values()}
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    notebooks = {f"examples/{path.name}" for path in (ROOT / "examples").glob("*.ipynb")}
    assert len(LISTED) == len(set(LISTED))
    assert set(LISTED) == made | generated | pages | notebooks


def test_no_page_asks_another_server():
    assert "font: false" in SETTINGS
    assert "http" not in SETTINGS


def test_headings_have_the_words_that_users_search_for():
    """The site's search weighs headings more than text."""
    headings = [
        line.lower()
        for path in (ROOT / "docs").rglob("*.md")
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.startswith("#")
    ]
    for words in ("lsl", "how many participants"):
        assert any(words in line for line in headings), words


def test_notebooks_are_files_that_the_plugin_renders_and_the_build_looks():
    """A hook that comes after the plugin, or a generated file, leaves a notebook as it is: JSON."""
    hook = (ROOT / "website" / "pages.py").read_text(encoding="utf-8")
    assert re.search(r"@event_priority\(\d+\)\ndef on_files", hook)
    assert "File(place, str(ROOT)" in hook
    assert re.search(r"def on_post_build.*?\.ipynb.*?raise PluginError", hook, re.DOTALL)
