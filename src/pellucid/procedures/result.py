"""What a procedure found, in one form that can be printed, saved, kept and drawn whatever was identified."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir, mkdtemp
from typing import TYPE_CHECKING, Self

from .._atomic import remove_leftovers
from .._errors import PellucidError
from ..fit.parameter import Parameter, Verdict, rank_verdicts
from ..models.card import Card, write_card
from ..models.emg_estimator import EmgEstimatorCard, write_estimator_card
from ..models.parameter_card import ParameterCard, write_parameter_card
from ..models.tree_card import TreeCard, write_tree_card
from ..recordings.kept import keep_result, read_kept
from ..recordings.lock import hold_lock
from ..recordings.results import ResultRow, replace_rows
from .card_sources import card_sources

if TYPE_CHECKING:
    from ..recordings.study import Study
    from .procedure import Procedure


@dataclass(frozen=True)
class ParameterTable:
    """Parameters with their intervals, under a title."""

    title: str
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True)
class FigureTable:
    """Figures under a title: `heads` name the columns with their units; None stands for a figure that is not there."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str | float | int | None, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Result:
    """Everything a procedure found; each procedure adds to it what its figures need.

    ``result["inertia"]`` is a parameter with its interval, ``print(result)`` what the command prints; a notebook shows
    it as tables.

    Attributes
    ----------
    study : str
        The study's name, first part of every figure's id.
    headline : str
        The result in one sentence.
    tables : tuple of ParameterTable or FigureTable
    verdicts : tuple of Verdict
        What the recordings do and do not show, worst first.
    rows : tuple of ResultRow
        Every figure, all of one command.
    cards : Mapping[str, Card or ParameterCard or TreeCard or EmgEstimatorCard]
        By the name of their file in ``models/``, without its ending.
    checksums : Mapping[str, str]
        SHA-256 of the files it came from, by recording.
    confidence : float
        Of the intervals.
    procedure, command : str
        That found it.
    made_from : str
        Fingerprint of everything it was made from; with it a kept result is known to be fresh.
    """

    study: str
    headline: str
    tables: tuple[ParameterTable | FigureTable, ...]
    verdicts: tuple[Verdict, ...]
    rows: tuple[ResultRow, ...] = field(repr=False)
    cards: Mapping[str, Card | ParameterCard | TreeCard | EmgEstimatorCard] = field(repr=False)
    checksums: Mapping[str, str] = field(repr=False)
    confidence: float = 0.95
    procedure: str = ""
    command: str = ""
    made_from: str = field(default="", repr=False)

    @property
    def estimates(self) -> Mapping[str, Parameter]:
        """Parameters by name; of several with one name, of several legs, say, each below the title of its table too."""
        found: dict[str, Parameter] = {}
        for table in self.tables:
            for parameter in table.parameters if isinstance(table, ParameterTable) else ():
                found.setdefault(parameter.name, parameter)
                found[f"{table.title}.{parameter.name}"] = parameter
        return found

    def __getitem__(self, name: str) -> Parameter:
        """A parameter by its name.

        Raises
        ------
        KeyError
            If there is none of that name; the message has those that there are.
        """
        found = self.estimates
        if name not in found:
            raise KeyError(f"{name!r}; found here: {', '.join(found) or 'no parameter'}")
        return found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.estimates)

    def __contains__(self, name: object) -> bool:
        return name in self.estimates

    def __str__(self) -> str:
        """What its command prints, 100 columns wide."""
        from .print_result import printed

        return printed(self)

    def _repr_html_(self) -> str:
        """Headline, tables and verdicts, for a notebook."""
        from .print_result import html_tables

        said = "".join(f"<li>{escape(v.said)}</li>" for v in self.verdicts)
        return f"<p>{escape(self.headline)}</p>{html_tables(self)}<ul>{said}</ul>"

    @property
    def each(self) -> tuple[Result, ...]:
        """The results that it is made of, one of each procedure."""
        return (self,)

    @property
    def prose(self) -> str:
        """What was found in sentences for a paper; empty, mostly."""
        return ""

    def written(self, study: Study) -> str:
        """Where its cards, and whatever else it writes, are."""
        return f"Model cards in {study.models_dir}"

    def for_page(self) -> Self:
        """The same without what no page draws, so that little is kept."""
        return self

    def save_more(self, study: Study) -> None:
        """Whatever a procedure writes beside cards and rows; nothing, mostly."""

    def save(self, study: Study) -> tuple[ResultRow, ...]:
        """Write every card, this command's rows in place of its earlier ones, and the result itself to be drawn later.

        Parameters
        ----------
        study : Study
            It was found from.

        Returns
        -------
        tuple of ResultRow
            What results.json now holds of its procedure.

        Raises
        ------
        OSError
            If the study's folder cannot be written.
        PellucidError
            If another command goes on writing this study's results for a minute.
        """
        # Cards, rows and what is kept come from one command, however many run at once.
        with hold_lock(study.results_path):
            remove_leftovers(study.made, study.models_dir, study.made / "kept", study.made / "tables")
            study.models_dir.mkdir(exist_ok=True)
            for name, card in self.cards.items():
                _write(study.models_dir / f"{name}.json", card)
            for command in dict.fromkeys(part.command for part in self.each):
                own = [row for part in self.each if part.command == command for row in part.rows]
                replace_rows(study.results_path, command, own)
            for part in self.each:
                part.save_more(study)
                if part.made_from:
                    keep_result(study.kept_path(part.procedure), part.made_from, part.for_page())
        return self.rows

    def save_somewhere(self, study: Study) -> tuple[Study, str]:
        """`save`, or where the study's folder cannot be written, or holds a results.json that cannot be read, in a new
        folder elsewhere: the study with the folder that it was saved to, and a sentence if that is not its own.

        Parameters
        ----------
        study : Study
            It was found from.

        Returns
        -------
        tuple of Study and str

        Raises
        ------
        OSError
            If no folder can be written at all.
        """
        try:
            self.save(study)
            return study, ""
        except (OSError, PellucidError) as error:
            said = f"{study.made} could not be written: {error}"
            for parent in (Path.cwd(), Path(gettempdir()), Path.home(), Path("/dev/shm")):
                try:
                    out = Path(mkdtemp(prefix=f"pellucid-{study.name}-", dir=parent))
                except OSError:
                    continue
                try:
                    self.save(replace(study, out=out))
                except (OSError, PellucidError):
                    rmtree(out, ignore_errors=True)
                    continue
                return replace(study, out=out), f"{said}; what was found is in {out} instead"
            raise

    @classmethod
    def kept(cls, study: Study, procedure: Procedure) -> Self | None:
        """What was saved of a procedure; None where nothing was, or what it was made from has changed since."""
        made_from = fingerprint(study, procedure)
        paths = dict.fromkeys(each.kept_path(procedure.name) for each in (study, replace(study, out=None)))
        found = next((found for path in paths if (found := read_kept(path, made_from)) is not None), None)
        return found if isinstance(found, cls) else None


def _write(path: Path, card: Card | ParameterCard | TreeCard | EmgEstimatorCard) -> None:
    if isinstance(card, TreeCard):
        write_tree_card(path, card)
    elif isinstance(card, EmgEstimatorCard):
        write_estimator_card(path, card)
    else:
        (write_card if isinstance(card, Card) else write_parameter_card)(path, card)


def fingerprint(study: Study, procedure: Procedure) -> str:
    """SHA-256 of everything that a procedure looks at: study.toml, recordings, cards, and Pellucid itself."""
    return study.fingerprint(procedure.inputs(study))


def found_by(procedure: Procedure, study: Study, result: Result) -> Result:
    """A result, and its cards, with what it was made from and by, its verdicts worst first."""
    sources = card_sources(study, procedure) if result.cards else {}
    return replace(
        result,
        cards={name: replace(card, made_from=sources) for name, card in result.cards.items()},
        verdicts=rank_verdicts(result.verdicts),
        procedure=procedure.name,
        command=procedure.command,
        made_from=fingerprint(study, procedure),
    )
