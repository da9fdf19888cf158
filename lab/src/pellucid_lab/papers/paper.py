"""The base class of reproduced papers: the numbers that a paper prints, and its figures computed again.

Each paper is a folder with ``printed.toml``, and ``paper.py`` with one subclass of `Paper`. The folders are the list of
papers; nothing else names one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import ClassVar

from pellucid._errors import PellucidError
from pellucid.study.answer import Answer, AnswerPart, Basis, Step, answer_of_parts
from pellucid.study.pages.page import Page, Section, Tile, without_drawing

from .figure import Figures, Reproduced
from .printed import PrintedPaper, papers, printed
from .row_sections import row_sections

Progress = Callable[[str, float], None]
"""Called with a text and the share done, 0 to 1."""


class Paper(ABC):
    """A published study. An object is one reproduction: `figures` computes it and keeps the data of its page.

    A subclass must define `figures` alone. If it has settings (seeds, people, processes), it is a dataclass.

    Attributes
    ----------
    title, kicker, opening : str
        The page's title, the line above it, and the first sentence of the answer. An empty title means the paper's own.
    over : str
        Heading of the column of ranges.
    printed_of, ours_of : str
        Subjects of the printed figures, and of those computed here.
    remarks : bool
        Whether the table of all figures shows their notes instead of their verdicts.
    splits : mapping of str to tuple of str
        For "fitted", "heldout" and "simulated", parts of row ids. The first entry with a part of an id is its split;
        an id without any is "heldout".
    main : tuple of str
        Prefixes of the ids that the terminal prints at the end.
    answer_figure : str
        Name of the figure that is shown with the headline; by default the first one.

    Examples
    --------
    >>> from pellucid_lab.papers.figure import figure
    >>> class Pendulum(Paper):
    ...     def figures(self, tell):
    ...         yield figure("pendulum", "period", "Period", "s", 2.006, self.printed.values["period"])
    """

    title: ClassVar[str] = ""
    kicker: ClassVar[str] = "Reproduction of a paper"
    opening: ClassVar[str] = ""
    over: ClassVar[str] = "Range"
    printed_of: ClassVar[str] = "real people and machines"
    ours_of: ClassVar[str] = "virtual ones"
    remarks: ClassVar[bool] = False
    splits: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    main: ClassVar[tuple[str, ...]] = ()
    answer_figure: ClassVar[str] = ""

    @property
    def name(self) -> str:
        """Name of the paper's folder, as ``reproduce`` takes it."""
        return type(self).__module__.split(".")[-2]

    @cached_property
    def printed(self) -> PrintedPaper:
        """Every number that the paper prints and this package uses."""
        return printed(self.name)

    @abstractmethod
    def figures(self, tell: Progress) -> Iterable[Reproduced]:
        """Compute every figure, in the page's order; `tell` is called with a text and the share done."""

    def headline(self, figures: Figures) -> str:
        """Return the page's first sentences: the result with its numbers."""
        about = self.printed
        return f"{about.authors}: {about.title}, {about.journal}, {about.year}."

    def tiles(self, figures: Figures) -> tuple[Tile, ...]:
        """Return the numbers at the head of the page."""
        return ()

    def sections(self, figures: Figures) -> tuple[Section, ...]:
        """Return the sections with tables and drawings, above the table of all figures."""
        return ()

    def footer(self) -> str:
        """Return the page's last line: seeds, errata."""
        return ""

    def closing(self, figures: Figures) -> tuple[Section, ...]:
        """Return the last two sections: figures recomputed from print, and the table of all figures."""
        return row_sections(
            tuple(figures.values()), over=self.over, remarks=self.remarks, printed_of=self.printed_of,
            ours_of=self.ours_of,
        )  # fmt: skip

    def page(self, figures: Figures) -> Page:
        """Return the whole page."""
        sections = (*self.sections(figures), *self.closing(figures))
        title = self.title or self.printed.title
        drawings = [drawing for section in sections for drawing in section.drawings]
        named = (drawing for drawing in drawings if drawing.name == self.answer_figure)
        drawn = next(named, drawings[0] if drawings else None)
        return Page(
            title,
            f"{self.kicker}, re-enacted on a virtual rig: {self.printed.citation}",
            "",
            self.tiles(figures),
            sections if drawn is None else without_drawing(sections, drawn.name),
            self.footer(),
            answer=self.answer(figures),
            figure=drawn,
        )

    def claims(self, figures: Figures) -> tuple[AnswerPart, ...]:
        """Return whether each claim of the paper holds here; without any, whether the printed figures agree."""
        return ()

    def answer(self, figures: Figures) -> Answer:
        """Return whether the paper's claims hold on simulated data, claim by claim."""
        claims = self.claims(figures)
        compared = [row.verdict for row in figures.values() if row.verdict in ("agrees", "differs")]
        agreed = compared.count("agrees")
        counted = f"{agreed} of the {len(compared)} printed figures that are compared agree."
        parts = claims or (
            (AnswerPart("printed figures", "yes" if agreed == len(compared) else "no", counted),) if compared else ()
        )
        listed = "; ".join(f"{claim.name}: {claim}" for claim in claims)
        said = f"{listed}. " if claims else f"{counted} " if compared else ""
        about = self.printed
        read = Step(f"Read what {about.authors} cannot have meant in print, with a test for each: docs/errata.md")
        failing = ", ".join(part.name for part in parts if part.verdict != "yes") or "all of them"
        return answer_of_parts(
            "Do the claims of the paper hold on simulated data?",
            f"{self.opening} {said}{self.headline(figures)}".strip(),
            parts,
            basis=Basis(len(figures), len(figures), "figure", "simulated rigs and people", is_simulated=True),
            improve=(Step(f"Test the claims that do not hold here on your own recordings: {failing}"), read),
            next=(read,),
            without_parts="nothing of it is compared",
        )

    def write_more(self, out: Path) -> None:
        """Write further files into the folder `out`."""
        return

    def split(self, row: str) -> str:
        """Return the data that a row is evaluated on, by its id: "fitted", "heldout" or "simulated"."""
        return next((split for split, parts in self.splits.items() if any(p in row for p in parts)), "heldout")

    def is_main(self, row: str) -> bool:
        """Return whether the terminal prints the row of an id at the end."""
        return row.startswith(self.main) and row.count(".") <= 3


def paper(name: str) -> type[Paper]:
    """Return the class of the paper in a folder."""
    if name not in papers():
        raise PellucidError(f"unknown paper {name!r}; known: {', '.join(papers())}")
    module = import_module(f"{papers()[name].package.__name__}.{name}.paper")
    found = [c for c in vars(module).values() if isinstance(c, type) and c.__module__ == module.__name__]
    found = [c for c in found if issubclass(c, Paper)]
    if len(found) != 1:
        raise PellucidError(f"papers/{name}/paper.py: found {len(found)} subclasses of Paper, expected one")
    return found[0]
