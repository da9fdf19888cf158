"""The site has every page of docs/ and every notebook, and asks no other server for anything."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
SETTINGS = (ROOT / "website" / "mkdocs.yml").read_text(encoding="utf-8")
LISTED = re.findall(r": ([\w./-]+\.(?:md|ipynb))$", SETTINGS, flags=re.MULTILINE)


def test_every_page_is_in_the_menu_once():
    made = {"index.md", "api.md", "gallery.md", "CONTRIBUTING.md", "CHANGELOG.md", "packaging.md", "board.md"}
    pages = {path.name for path in (ROOT / "docs").glob("*.md")}
    notebooks = {f"examples/{path.name}" for path in (ROOT / "examples").glob("*.ipynb")}
    assert len(LISTED) == len(set(LISTED))
    assert set(LISTED) == made | pages | notebooks


def test_no_page_asks_another_server():
    assert "font: false" in SETTINGS
    assert "http" not in SETTINGS
