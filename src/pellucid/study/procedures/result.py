"""Common form of the result of any procedure, which can be printed, saved, kept and drawn.

Results of several procedures of one study as one result.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir, mkdtemp
from typing import TYPE_CHECKING, Protocol, Self, runtime_checkable

import numpy as np

from ..._atomic import remove_leftovers
from ..._errors import PellucidError
from ..._tabular import data_frame
from ...models.card import Card, write_card
from ...models.estimates import Parameter, Verdict, rank_verdicts
from ...models.parameter_card import ParameterCard, write_parameter_card
from ..answer import Answer, answer_lines, answer_of_findings
from ..kept import hold_lock, keep_result, read_kept
from ..results import ResultRow, replace_rows
from .findings import improving_steps
from .result_tables import FigureTable as FigureTable
from .result_tables import ParameterTable as ParameterTable

if TYPE_CHECKING:
    import pandas

    from ...models.tree_card import TreeCard
    from ..study import Study

@runtime_checkable
class DomainCard(Protocol):
    """A card of a kind that only its domain knows."""

    def write(self, path: Path) -> Path:
        """Write the card, whole or not at all."""


@dataclass(frozen=True, eq=False)
class HeldOutEffort:
    """The effort of one joint on recordings that were not fitted, measured and predicted; arrays of shape (n,).

    Attributes
    ----------
    joint : str
        Name of the joint; ``""`` for the only one.
    unit : str
        Unit of the effort.
    time : ndarray, shape (n,)
        Time [s]; it falls where another recording begins.
    measured, predicted : ndarray, shape (n,)
        Effort in its unit.
    """

    joint: str
    unit: str
    time: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray

    @property
    def error(self) -> float:
        """Norm of what the prediction misses over the norm of the effort [%]."""
        return self._error(self.predicted)

    @property
    def constant_error(self) -> float:
        """The same error of the constant effort that fits these recordings best, their mean [%]."""
        return self._error(np.full_like(self.measured, self.measured.mean()))

    def _error(self, predicted: np.ndarray) -> float:
        size = float(np.linalg.norm(self.measured))
        return 100.0 * float(np.linalg.norm(self.measured - predicted)) / size if size else float("nan")


class ProcedureWithInputs(Protocol):
    """Members of a procedure by which a kept result is found again."""

    @property
    def name(self) -> str:
        """Name of the procedure."""

    def inputs(self, study: Study) -> Iterable[Path]:
        """Return the files besides study.toml and recordings that it reads."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Result:
    """Result of a procedure; each procedure adds the data for its figures.

    ``result["inertia"]`` is a parameter with its interval. ``print(result)`` prints the output of the command with
    ``-v``, and a notebook shows tables.

    Attributes
    ----------
    study : str
        The study's name, first part of every figure's id.
    headline : str
        The result in one sentence.
    tables : tuple of ParameterTable or FigureTable
    verdicts : tuple of Verdict
        Verdicts on the result and on the recordings, worst first.
    rows : tuple of ResultRow
        Result rows of one command.
    cards : Mapping[str, Card or ParameterCard or TreeCard or DomainCard]
        Cards by the name of their file in ``models/``, without suffix.
    checksums : Mapping[str, str]
        SHA-256 of the recorded files, by recording.
    confidence : float
        Confidence level of the intervals.
    procedure, command : str
        Names of the procedure and of the command that made the result.
    made_from : str
        Fingerprint of all inputs, which shows whether a kept result is fresh.
    completed : Answer, optional
        The answer with the study's additions: basis, assumptions and recommended next steps.
    """

    study: str
    headline: str
    tables: tuple[ParameterTable | FigureTable, ...]
    verdicts: tuple[Verdict, ...]
    rows: tuple[ResultRow, ...] = field(repr=False)
    cards: Mapping[str, Card | ParameterCard | TreeCard | DomainCard] = field(repr=False)
    checksums: Mapping[str, str] = field(repr=False)
    confidence: float = 0.95
    procedure: str = ""
    command: str = ""
    made_from: str = field(default="", repr=False)
    completed: Answer | None = field(default=None, repr=False)

    @property
    def answer(self) -> Answer:
        """The answer to the command's question: verdict, sentence, numbers, basis, assumptions, next step."""
        return self.make_answer() if self.completed is None else self.completed

    @property
    def answers(self) -> tuple[Answer, ...]:
        """Answers of the single procedures."""
        return tuple(part.answer for part in self.each)

    def make_answer(self) -> Answer:
        """Return the answer that the result itself gives; a procedure that asks a question of its own overrides it."""
        answer = answer_of_findings(self.headline, ((v.kind, v.said) for v in rank_verdicts(self.verdicts)))
        return answer if answer.is_answered else replace(answer, next=improving_steps(self.verdicts))

    @property
    def estimates(self) -> Mapping[str, Parameter]:
        """Parameters by name; if several have one name, each is also listed with the title of its table."""
        found: dict[str, Parameter] = {}
        for table in self.tables:
            for parameter in table.parameters if isinstance(table, ParameterTable) else ():
                found.setdefault(parameter.name, parameter)
                found[f"{table.title}.{parameter.name}"] = parameter
        return found

    @property
    def flaw(self) -> str:
        """Sentence that says why the figures do not describe what was recorded; "" if nothing says so."""
        said = next((verdict.said for verdict in rank_verdicts(self.verdicts) if verdict.kind == "wrong"), "")
        first = re.split(r"(?<=[.!?]) (?=[A-Z])", said, maxsplit=1)[0]
        return first[:1].lower() + first[1:]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.study}: {self.headline}>"

    def to_frame(self) -> pandas.DataFrame:
        """Return every figure as a data frame: id, value, unit, split and note; needs pandas.

        Raises
        ------
        PellucidError
            If pandas is not installed; the message says what to install.
        """
        columns = ("id", "value", "unit", "split", "note")
        return data_frame({name: [getattr(row, name) for row in self.rows] for name in columns})

    def __getitem__(self, name: str) -> Parameter:
        """Return a parameter by its name.

        Raises
        ------
        KeyError
            If there is none of that name; the message lists the available ones.
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
        """Return the output of its command after ``-v``, 100 columns wide."""
        from .print_result import print_to_text

        return print_to_text(self)

    def _repr_html_(self) -> str:
        """Return answers, tables and verdicts for a notebook."""
        from .print_result import html_tables

        verdict_items = "".join(f"<li>{escape(v.said)}</li>" for v in self.verdicts)
        answers = "".join(f"<p>{'<br>'.join(map(escape, answer_lines(answer)))}</p>" for answer in self.answers)
        return f"{answers}{html_tables(self)}<ul>{verdict_items}</ul>"

    @property
    def each(self) -> tuple[Result, ...]:
        """Results of the single procedures."""
        return (self,)

    @property
    def held_out(self) -> tuple[HeldOutEffort, ...]:
        """Efforts of joints on held-out recordings; empty for procedures that predict none."""
        return ()

    @property
    def prose(self) -> str:
        """Findings in sentences for a paper; empty for most procedures."""
        return ""

    def written(self, study: Study) -> str:
        """Return the places of all files that the result writes, in words."""
        return f"Model cards in {study.models_dir}"

    def for_page(self) -> Self:
        """Return the result without data that no page draws, so that little is kept."""
        return self

    def save_more(self, study: Study) -> None:
        """Write files other than cards and rows; most procedures have none."""

    def save(self, study: Study) -> tuple[ResultRow, ...]:
        """Write every card, the result for later drawing, and this command's rows, which replace its earlier ones.

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
        # A lock ensures that cards, rows and the kept result come from one command, even if several run at once.
        with hold_lock(study.results_path):
            remove_leftovers(study.made, study.models_dir, study.made / "kept", study.made / "tables")
            study.models_dir.mkdir(exist_ok=True)
            for name, card in self.cards.items():
                _write(study.models_dir / f"{name}.json", card)
            for command in dict.fromkeys(part.command for part in self.each):
                parts = [part for part in self.each if part.command == command]
                answers = [{"procedure": part.procedure, **part.answer.table()} for part in parts]
                replace_rows(study.results_path, command, [row for part in parts for row in part.rows], answers)
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
            problem = f"{study.made} could not be written: {error}"
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
                return replace(study, out=out), f"{problem}; the results are in {out} instead"
            raise

    @classmethod
    def kept(cls, study: Study, procedure: ProcedureWithInputs) -> Self | None:
        """Return the saved result of a procedure; None if there is none, or if its inputs have changed since."""
        made_from = fingerprint(study, procedure)
        paths = dict.fromkeys(each.kept_path(procedure.name) for each in (study, replace(study, out=None)))
        found = next((found for path in paths if (found := read_kept(path, made_from)) is not None), None)
        if not isinstance(found, cls):
            return None
        return replace(found, completed=found.answer.in_folder(study.folder))


def _write(path: Path, card: Card | ParameterCard | TreeCard | DomainCard) -> None:
    from ...models.tree_card import TreeCard, write_tree_card

    if isinstance(card, TreeCard):
        write_tree_card(path, card)
    elif isinstance(card, DomainCard):
        card.write(path)
    else:
        (write_card if isinstance(card, Card) else write_parameter_card)(path, card)


def fingerprint(study: Study, procedure: ProcedureWithInputs) -> str:
    """Return the SHA-256 of all inputs of a procedure: study.toml, recordings, cards, and Pellucid itself."""
    return study.fingerprint(procedure.inputs(study))


@dataclass(frozen=True, kw_only=True, repr=False)
class CombinedResult(Result):
    """Results of several procedures of one study.

    Attributes
    ----------
    parts : tuple of Result
        One of each procedure, in the order in which the report shows them.
    """

    parts: tuple[Result, ...] = field(repr=False)

    @classmethod
    def from_parts(cls, parts: Sequence[Result]) -> Self:
        """Return one result of all `parts`, which are of one study."""
        first = parts[0]
        return cls(
            study=first.study,
            headline=" ".join(f"{part.headline.rstrip('.')}." for part in parts),
            tables=tuple(table for part in parts for table in part.tables),
            verdicts=rank_verdicts(tuple(verdict for part in parts for verdict in part.verdicts)),
            rows=tuple(row for part in parts for row in part.rows),
            cards={name: card for part in parts for name, card in part.cards.items()},
            checksums={name: checksum for part in parts for name, checksum in part.checksums.items()},
            confidence=first.confidence,
            procedure=" and ".join(part.procedure for part in parts),
            command=" and ".join(dict.fromkeys(part.command for part in parts)),
            parts=tuple(parts),
        )

    @property
    def each(self) -> tuple[Result, ...]:
        """Results of the single procedures."""
        return self.parts

    @property
    def held_out(self) -> tuple[HeldOutEffort, ...]:
        """Efforts of joints on held-out recordings, of all parts."""
        return tuple(held for part in self.parts for held in part.held_out)

    @property
    def prose(self) -> str:
        """Sentences of all parts for a paper."""
        return "\n\n".join(part.prose for part in self.parts if part.prose)

    def written(self, study: Study) -> str:
        """Return the places of all files that the parts write, in words."""
        return "; ".join(dict.fromkeys(part.written(study) for part in self.parts))
