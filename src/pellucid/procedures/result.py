"""What a procedure found, in one form that can be printed, saved and drawn whatever was identified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..fit.parameter import Parameter, Verdict
from ..models.parameter_card import ParameterCard, write_parameter_card
from ..recordings.results import ResultRow, write_rows
from ..recordings.study import Study


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
class Findings:
    """Everything a procedure found; each kind of study adds to it what its figures need.

    Attributes
    ----------
    study : str
        The study's name, first part of every figure's id.
    headline : str
        The result in one sentence.
    tables : tuple of ParameterTable or FigureTable
    verdicts : tuple of Verdict
        What the recordings do and do not show.
    rows : tuple of ResultRow
        Every figure, all of one command.
    cards : Mapping[str, ParameterCard]
        By the name of their file in ``models/``, without its ending.
    checksums : Mapping[str, str]
        SHA-256 of the files it came from, by recording.
    confidence : float
        Of the intervals.
    """

    study: str
    headline: str
    tables: tuple[ParameterTable | FigureTable, ...]
    verdicts: tuple[Verdict, ...]
    rows: tuple[ResultRow, ...]
    cards: Mapping[str, ParameterCard]
    checksums: Mapping[str, str]
    confidence: float = 0.95


def save_findings(study: Study, found: Findings, command: str) -> tuple[ResultRow, ...]:
    """Write ``models/<name>.json`` for every card, and this command's rows in place of its earlier ones.

    Parameters
    ----------
    study : Study
    found : Findings
    command : str
        ``"identify"`` or ``"calibrate"``.

    Returns
    -------
    tuple of ResultRow
        What results.json now holds of this command.
    """
    study.models_dir.mkdir(exist_ok=True)
    for name, card in found.cards.items():
        write_parameter_card(study.models_dir / f"{name}.json", card)
    write_rows(study.results_path, command, found.rows)
    return found.rows
