"""What the site has beside docs/: the README as home page, other pages of the root, notebooks, the API, and a gallery.

mkdocs calls the functions whose names begin with ``on_``. Nothing is written into docs/.
"""

from __future__ import annotations

import ast
import re
import runpy
from collections.abc import Iterator
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]

GALLERY = ROOT / "build" / "gallery"
"""Where `make site` lets the demo write its pages, whole reports that the gallery shows."""

PACKAGES = (ROOT / "src" / "pellucid", ROOT / "lab" / "src" / "pellucid_lab")
"""Packages whose stubs list the public names."""

ROOT_PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "CONTRIBUTING.md", "CHANGELOG.md": "CHANGELOG.md",
              "packaging/README.md": "packaging.md", "examples/board/README.md": "board.md"}  # fmt: skip
"""Pages of the root, and their names on the site."""

GENERATED = runpy.run_path(str(Path(__file__).with_name("generated.py")))
"""The module of pages that are made of the code."""

REFERENCE_PAGES = {"commands": "commands.md", "studytoml": "study-toml.md"}
"""Pages of the reference to which links of docs/ lead, by the heading of `reference/index.md` about each."""

TEX = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
"""An equation as the Markdown extension leaves it: TeX between brackets, `\\(` within a line and `\\[` on its own."""


@event_priority(100)
def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made, or that lie outside docs/.

    It comes before every plugin, so that `mkdocs-jupyter` finds the notebooks among the files and renders them.
    """
    for source, name in ROOT_PAGES.items():
        files.append(File.generated(config, name, content=moved_links((ROOT / source).read_text("utf-8"))))
    for notebook in sorted((ROOT / "examples").glob("*.ipynb")):
        # A file with its folder, not a generated one, whose content mkdocs-jupyter does not find.
        place = notebook.relative_to(ROOT).as_posix()
        files.append(File(place, str(ROOT), config.site_dir, config.use_directory_urls))
    for name, (file, _) in GENERATED["PAGES"].items():
        files.append(File.generated(config, file, content=GENERATED["page"](name)))
    files.append(File.generated(config, "api.md", content="\n".join(api_page())))
    files.append(File.generated(config, "gallery.md", content="\n".join(gallery_page())))
    files.append(File.generated(config, "site.css", abs_src_path=str(Path(__file__).with_name("site.css"))))
    for path in sorted(GALLERY.rglob("*")):
        if path.is_file() and path.suffix in (".html", ".svg", ".png", ".pdf"):
            name = f"gallery/{path.relative_to(GALLERY).as_posix()}"
            files.append(File.generated(config, name, abs_src_path=str(path), inclusion=InclusionLevel.INCLUDED))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links of docs/ to pages of the root, and commands that print a page, lead to that page of the site."""
    up = "../" * page.file.src_uri.count("/")
    for name, (file, _) in GENERATED["PAGES"].items():
        title = GENERATED["page"](name).partition("\n")[0].lstrip("# ")
        markdown = markdown.replace(f"`python website/generated.py {name}`", f"[{title}]({up}{file})")
    for anchor, file in REFERENCE_PAGES.items():
        markdown = markdown.replace(f"reference/index.md#{anchor})", f"reference/{file})")
    for source, name in ROOT_PAGES.items():
        markdown = markdown.replace(f"]({up}../{source}", f"]({up}{name}")
    return markdown


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Write equations as MathML, which browsers draw without a script."""

    def as_mathml(match: re.Match) -> str:
        tex = match[3].replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">").strip()
        return convert(tex, display="block" if match[2] == "[" else "inline")

    return TEX.sub(as_mathml, html)


def on_post_build(config: MkDocsConfig) -> None:
    """Refuse a site in which a notebook is no page."""
    site = Path(config.site_dir)
    raw = [path.relative_to(site).as_posix() for path in site.rglob("*.ipynb")]
    names = [path.stem for path in ROOT.glob("examples/*.ipynb")]
    lacking = [name for name in names if not (site / f"examples/{name}.html").is_file()]
    if raw or lacking:
        found = ", ".join(raw or lacking)
        raise PluginError(f"found notebooks that are not rendered: {found}; expected a page of each")


def moved_links(text: str) -> str:
    """Return a page of the root with its links as they are on the site."""
    text = re.sub(r"\]\(docs/", "](", text).replace("](packaging/README.md)", "](packaging.md)")
    return re.sub(r"\[([^]]+)\]\((LICENSE|CITATION.cff)\)", r"\1", text)


def api_page() -> Iterator[str]:
    """Every public name, with what its docstring says."""
    yield "# Public functions and classes\n"
    yield "`import pellucid as pl`; each name below is an attribute of it. Units are SI, angles in rad.\n"
    sources = {name: source for package in PACKAGES for name, source in stub_sources(package)}
    sources["open"] = sources.pop("open_study")
    for name in sorted(sources, key=str.lower):
        yield f"::: {sources[name]}\n"
        yield f"    options:\n      heading: pl.{name}\n      toc_label: {name}\n"


def stub_sources(package: Path) -> Iterator[tuple[str, str]]:
    """Yield each name that a package's stub imports, with its full path."""
    for node in ast.parse((package / "__init__.pyi").read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                yield alias.name, f"{package.name}.{node.module}.{alias.name}"


def gallery_page() -> Iterator[str]:
    """The reports that the demo wrote, each with its title and first sentence."""
    yield "# Gallery of reports\n"
    yield "Whole pages as `make demo` writes them, of a real servo's recordings and of a virtual robot.\n"
    pages = sorted(GALLERY.rglob("index.html"), key=lambda p: (len(p.parts), p))
    if not pages:
        yield "This copy of the site was built without them: `make site` lets the demo write them first."
    yield '<div class="gallery" markdown>\n'
    for path in pages:
        html = path.read_text("utf-8")
        title = re.sub(r"<[^>]+>", "", re.search(r"<h1[^>]*>(.*?)</h1>", html, re.DOTALL)[1]).strip()
        where = f"gallery/{path.relative_to(GALLERY).as_posix()}"
        picture = path.with_name("page.png")
        yield "<div markdown>\n"
        if picture.exists():
            yield f"[![{title}]({Path(where).with_name('page.png').as_posix()})]({where})\n"
        yield f"**[{title}]({where})**\n"
        yield "</div>\n"
    yield "</div>"
