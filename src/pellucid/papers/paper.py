"""What a paper is: the numbers that it prints, and its figures computed again. Each has a folder, and that is the list.

A folder has ``printed.toml`` and ``paper.py`` with one subclass of `Paper`; nothing else names it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import ClassVar

from .._errors import PellucidError
from ..pages.page import Page, Section, Tile
from .figure import Figures, Reproduced
from .printed import PrintedPaper, paper_packages, papers, printed
from .row_sections import row_sections

Progress = Callable[[str, float], None]
"""Called with a text and the share done, 0 to 1."""


class Paper(ABC):
    """A published study. An object is one reproduction: `figures` computes it, and keeps what its page draws.

    Only `figures` must be there. A subclass is a dataclass where it has settings: seeds, people, processes.

    Attributes
    ----------
    title, kicker : str
        Of the page, and what stands above it; "" takes the paper's own title.
    over : str
        What a figure's range is over, as the head of its column.
    printed_of, ours_of : str
        Whom or what the printed figures are of, and those computed here.
    remarks : bool
        Whether the table of all figures shows their notes, rather than their verdicts.
    splits : mapping of str to tuple of str
        "fitted", "heldout" or "simulated", whichever has a part of a row's id first; what none has is "heldout".
    main : tuple of str
        How the ids of those figures begin that are told when all is done.

    Examples
    --------
    >>> from pellucid.papers.figure import figure
    >>> class Pendulum(Paper):
    ...     def figures(self, tell):
    ...         yield figure("pendulum", "period", "Period", "s", 2.006, self.printed.values["period"])
    """

    title: ClassVar[str] = ""
    kicker: ClassVar[str] = "Reproduction of a paper"
    over: ClassVar[str] = "Range"
    printed_of: ClassVar[str] = "real people and machines"
    ours_of: ClassVar[str] = "virtual ones"
    remarks: ClassVar[bool] = False
    splits: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    main: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """Of its folder, as ``reproduce`` takes it."""
        return type(self).__module__.split(".")[-2]

    @cached_property
    def printed(self) -> PrintedPaper:
        """Every number that the paper prints and this package uses."""
        return printed(self.name)

    @abstractmethod
    def figures(self, tell: Progress) -> Iterable[Reproduced]:
        """Compute every figure, in the order in which the page has them; `tell` is called with how far it is."""

    def headline(self, figures: Figures) -> str:
        """What came out, in a few sentences."""
        about = self.printed
        return f"{about.authors}: {about.title}, {about.journal}, {about.year}."

    def tiles(self, figures: Figures) -> tuple[Tile, ...]:
        """The numbers at the head of the page."""
        return ()

    def sections(self, figures: Figures) -> tuple[Section, ...]:
        """Tables and drawings of the paper, above the table of all figures."""
        return ()

    def footer(self) -> str:
        """What stands below everything: seeds, errata."""
        return ""

    def closing(self, figures: Figures) -> tuple[Section, ...]:
        """What can be recomputed from print, and every figure."""
        return row_sections(
            tuple(figures.values()), over=self.over, remarks=self.remarks, printed_of=self.printed_of,
            ours_of=self.ours_of,
        )  # fmt: skip

    def page(self, figures: Figures) -> Page:
        """The page; its parts are the methods above."""
        sections = (*self.sections(figures), *self.closing(figures))
        title = self.title or self.printed.title
        return Page(title, self.kicker, self.headline(figures), self.tiles(figures), sections, self.footer())

    def write_more(self, out: Path) -> None:
        """Write whatever else belongs into the folder."""
        return

    def split(self, row: str) -> str:
        """What the row of an id is evaluated on: "fitted", "heldout" or "simulated"."""
        return next((split for split, parts in self.splits.items() if any(p in row for p in parts)), "heldout")

    def is_main(self, row: str) -> bool:
        """Whether the row of an id is told when all is done."""
        return row.startswith(self.main) and row.count(".") <= 3


def paper(name: str) -> type[Paper]:
    """The paper of a folder."""
    if name not in papers():
        raise PellucidError(f"unknown paper {name!r}; known: {', '.join(papers())}")
    module = import_module(f"{paper_packages()[name].__name__}.{name}.paper")
    found = [c for c in vars(module).values() if isinstance(c, type) and c.__module__ == module.__name__]
    found = [c for c in found if issubclass(c, Paper)]
    if len(found) != 1:
        raise PellucidError(f"papers/{name}/paper.py: found {len(found)} subclasses of Paper, expected one")
    return found[0]
