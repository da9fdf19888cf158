"""Write a page in the report's style, as one self-contained file: the answer first, then the evidence, then notes.

Fill in the templates that all pages of a report share.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from ..._atomic import remove_leftovers, write_text_atomically
from ..answer import REPEAT_TEXT, REPORT_COMMAND, Answer, AnswerPart, begun
from ..drawing.drawing import Drawing, set_height
from ..drawing.style import SANS_SERIF_FONTS, css_variables
from .forest import Table
from .quantities import name_words, typeset_sentence
from .values import marked_up, plain_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def render(template: str, **content: object) -> str:
    """Fill in a template of this folder."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(__package__, ""),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_finalize,
    )
    environment.filters["name_words"] = name_words
    environment.filters["plain"] = plain_text
    environment.filters["commands"] = _commands
    look = {
        "version": version("pellucid"),
        "light": css_variables(),
        "dark": css_variables(dark=True),
        "sans": SANS_SERIF_FONTS,
    }
    return environment.get_template(template).render(**look, **content)


def _finalize(shown: object) -> object:
    """Return what a template shows, with the values in plain text marked up."""
    return marked_up(shown) if isinstance(shown, str) and not isinstance(shown, Markup) else shown


def _commands(text: str) -> Markup:
    """Return a sentence as HTML, with what stands between backticks as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(_unbroken(part)) if i % 2 else marked_up(part) for i, part in enumerate(parts)
    )


def _unbroken(command: str) -> Markup:
    """Return a command as HTML in which no line breaks between the dashes of an option."""
    option = Markup('<span class="option">{}</span>')
    return Markup(" ").join(option.format(word) if word.startswith("--") else word for word in command.split(" "))


PAGE_FILE = "index.html"

MAX_OPEN_HEIGHT_PX = 2200.0
"""Sections are open while their estimated heights add up to this on a wide screen; those below are folded."""

MAX_LEAD_CHARACTERS = 270
"""Sentences of a headline stand on the first screen while they are no longer than this; the others follow below."""

MAX_PART_CHARACTERS = 64
"""Most characters of a number after a part's verdict; a longer one stands in the tables."""

MAX_SHOWN_PARTS = 8
"""Largest number of single verdicts that are shown with the answer; a table below has more."""

MAX_SHOWN_WARNINGS = 3
"""Largest number of verdicts that stand between the next steps and the evidence."""

NOTE_HEADINGS = {
    "wrong": "Must be mended",
    "warning": "Warnings",
    "note": "Remarks",
    "good": "What is sound",
    "file": "Notes on files",
}
"""Headings of the last section, in its order, by kind of note."""

_FILE_NOTE_PATTERN = re.compile(
    r"\.(?:csv|tsv|txt|json|mat|c3d|edf|bdf|xdf)\b|\brecordings? [^.]*found\b"
)


FIGURE_PX = 1040.0
"""Width of a figure on a wide screen [px]."""

FIRST_FIGURE_PX = 372.0
"""Largest height of the figure on the first screen [px]: ``max-height`` in head.html.j2."""

MAX_LOWERED_RATIO = 1.75
"""A figure is lowered for the first screen if it is at most so many times as high as the room there."""


@dataclass(frozen=True)
class Tile:
    """One number at the head of a page."""

    what: str  # name of the quantity
    figure: str  # number
    unit: str = ""
    more: str = ""  # short explanation


@dataclass(frozen=True)
class Section:
    """A part of a page: paragraphs, then drawings, then tables, then links, then muted notes; all text is plain.

    `id` is the anchor; the `heading` stands in the navigation too; `links` are words and where they lead; `folded` are
    tables below a line that opens them; `verdicts`, of a kind each, stand last.
    """

    id: str
    heading: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    drawings: tuple[Drawing, ...] = ()
    notes: tuple[str, ...] = ()
    links: tuple[tuple[str, str], ...] = ()
    folded: tuple[tuple[str, Table], ...] = ()
    verdicts: tuple[tuple[str, str], ...] = ()

    @property
    def height_px(self) -> float:
        """Estimated height of the open section on a wide screen."""
        text = [*self.paragraphs, *self.notes, *(text for _, text in self.verdicts)]
        lines = sum(1 + len(plain_text(t)) // 95 for t in text)
        figures = sum(_drawn_height_px(drawing) for drawing in self.drawings)
        rows = sum(2 + len(table.rows) for table in self.tables)
        return 90.0 + 25.0 * lines + 12.0 * len(text) + figures + 38.0 * rows + 45.0 * len(self.folded)


@dataclass(frozen=True)
class NoteGroup:
    """Notes of one kind, at a page's end."""

    heading: str
    notes: tuple[tuple[str, str], ...]  # kind and text of each


@dataclass(frozen=True)
class Page:
    """Contents of a page as plain text: `kicker` above the title, the `answer` with its `figure`, then `tiles`.

    A page without an answer has a `headline` in its place.

    `verdicts`, of a kind each, tell what to know: the worst stand below the next steps, the others at the page's end.
    The sections of a `summary` stand on the first screen, side by side where their tables have room. So do the answers
    of `others`, results of the same study.
    """

    title: str
    kicker: str
    headline: str = ""
    tiles: tuple[Tile, ...] = ()
    sections: tuple[Section, ...] = ()
    footer: str = ""
    verdicts: tuple[tuple[str, str], ...] = ()
    answer: Answer | None = None
    figure: Drawing | None = None
    summary: tuple[Section, ...] = ()
    others: tuple[Answer, ...] = ()

    @property
    def said(self) -> str:
        """The answer in a sentence; without an answer the headline."""
        return self.headline if self.answer is None else typeset_sentence(begun(self.answer.said))

    @property
    def lead(self) -> str:
        """First sentences of what is said, which stand on the first screen."""
        return _split_headline(self.said)[0]

    @property
    def other_leads(self) -> tuple[tuple[Answer, str], ...]:
        """Return the answers of `others`, each with its first sentences."""
        return tuple((each, _split_headline(typeset_sentence(begun(each.said)))[0]) for each in self.others)

    @property
    def detail(self) -> str:
        """Further sentences of what is said, below the first screen; "" for none."""
        return _split_headline(self.said)[1]

    @property
    def unsaid_reason(self) -> str:
        """Why the answer is no, or cannot be said, where the first screen does not say it yet; "" otherwise."""
        if self.answer is None or self.answer.verdict == "yes" or not self.answer.reason:
            return ""
        reason = _split_headline(typeset_sentence(begun(self.answer.reason)))[0]
        said = [self.lead, *(f"{part.name}: {self.part_number(part)}" for part in self.shown_parts)]
        is_said = any(_bare(reason).casefold() in _bare(text).casefold() for text in said)
        return "" if is_said else f"Reason: {reason}"

    @property
    def shown_parts(self) -> tuple[AnswerPart, ...]:
        """Return the verdicts on single joints, conditions or claims, if there are several and not too many."""
        parts = () if self.answer is None else self.answer.parts
        return parts if 1 < len(parts) <= MAX_SHOWN_PARTS else ()

    def part_number(self, part: AnswerPart) -> str:
        """Return the number on which a part's verdict rests, to follow it; "" where it takes a sentence."""
        reason = part.reason.partition("; ")[0].rstrip(".")
        text = typeset_sentence(reason)
        text = text[:1].lower() + text[1:] if reason[:1].islower() else text
        return text if len(plain_text(text)) <= MAX_PART_CHARACTERS and re.search(r"\d", text) else ""

    @property
    def following(self) -> tuple[str, ...]:
        """Return the recommended next steps of all answers in sentences, except that of the report itself."""
        own = () if self.answer is None else self.answer.next
        further = [step for answer in self.others for step in answer.next if step.text != REPEAT_TEXT]
        steps = [step for step in (*own, *further) if step.name != REPORT_COMMAND]
        steps.sort(key=lambda step: step.text == REPEAT_TEXT)  # it follows the steps of all answers
        return tuple(dict.fromkeys(step.sentence for step in steps))

    @property
    def drawings(self) -> tuple[Drawing, ...]:
        """Every figure of the page, that of the answer first."""
        first = () if self.figure is None else (self.figure,)
        return (*first, *(drawing for section in self.sections for drawing in section.drawings))

    @property
    def warnings(self) -> tuple[tuple[str, str], ...]:
        """Verdicts below the next steps: the worst, at most `MAX_SHOWN_WARNINGS`."""
        return tuple(v for v in self.verdicts if v[0] in ("wrong", "warning"))[:MAX_SHOWN_WARNINGS]

    @property
    def note_groups(self) -> tuple[NoteGroup, ...]:
        """All other verdicts, grouped by kind; those on files last."""
        shown = self.warnings
        grouped: dict[str, list[tuple[str, str]]] = {}
        for kind, text in (v for v in self.verdicts if v not in shown):
            grouped.setdefault(_note_kind(kind, text), []).append((kind, text))
        return tuple(NoteGroup(NOTE_HEADINGS[kind], tuple(grouped[kind])) for kind in NOTE_HEADINGS if kind in grouped)

    @property
    def open_sections(self) -> frozenset[str]:
        """Ids of the sections that are open: the first ones, while they fit."""
        shown, room = [], MAX_OPEN_HEIGHT_PX
        for section in self.sections:
            room -= section.height_px
            if room < 0.0:
                break
            shown.append(section.id)
        return frozenset(shown)


def _bare(text: str) -> str:
    """Return a sentence as it is read, without its full stop."""
    return " ".join(plain_text(text).split()).rstrip(".")


def _split_headline(text: str) -> tuple[str, str]:
    """Return the sentences of a headline that fit on the first screen, and the others."""
    ends = [found.end() for found in re.finditer(r"[.;](?= )", text)]
    if len(plain_text(text)) <= MAX_LEAD_CHARACTERS or not ends:
        return text, ""
    fitting = [end for end in ends if len(plain_text(text[:end])) <= MAX_LEAD_CHARACTERS]
    end = fitting[-1] if fitting else ends[0]
    first, rest = text[:end], text[end:].strip()
    return f"{first[:-1]}." if first.endswith(";") else first, rest[:1].upper() + rest[1:]


def _drawn_height_px(drawing: Drawing) -> float:
    """Return the height of a figure with its caption on a wide screen."""
    width, height = drawing.figure.get_size_inches()
    return FIGURE_PX * height / width + 70.0


def _fit_first_screen(figure: Figure) -> None:
    """Lower a figure to the height that the first screen has for it, so that a browser need not draw it smaller.

    Its letters keep their size. A figure that is far higher, such as one with many rows, stays as it is.
    """
    width, height = figure.get_size_inches()
    least = width * FIRST_FIGURE_PX / FIGURE_PX
    if least < height <= MAX_LOWERED_RATIO * least:
        set_height(figure, least)


def _note_kind(kind: str, text: str) -> str:
    return "file" if kind in ("note", "good") and _FILE_NOTE_PATTERN.search(text) else kind


def without_drawing(sections: Sequence[Section], name: str) -> tuple[Section, ...]:
    """Return sections without the figure of a name, which the answer shows; sections left empty are dropped."""
    kept = (replace(s, drawings=tuple(d for d in s.drawings if d.name != name)) for s in sections)
    return tuple(s for s in kept if s.paragraphs or s.tables or s.drawings or s.notes or s.links or s.verdicts)


def write_page(folder: Path, page: Page, *, with_pdf: bool = False) -> Path:
    """Write a page: ``index.html`` without outside references, and every figure in its folder as SVG and, `with_pdf`,
    PDF.

    A PDF takes longer than the SVG, because fonts are subset.
    """
    folder = Path(folder)
    drawings = page.drawings
    anchors = [section.id for section in page.sections] + [f"fig-{drawing.name}" for drawing in drawings]
    twice = [anchor for anchor, count in Counter(anchors).items() if count > 1]
    if twice:
        raise ValueError(f"more than one part of the page is called {', '.join(map(repr, twice))}")
    folder.mkdir(parents=True, exist_ok=True)
    remove_leftovers(folder)
    if page.figure is not None:
        _fit_first_screen(page.figure.figure)
    for drawing in drawings:
        drawing.save(folder, with_pdf=with_pdf)
    text = render("page.html.j2", title=page.title, page=page, with_pdf=with_pdf)
    return write_text_atomically(folder / PAGE_FILE, text)
