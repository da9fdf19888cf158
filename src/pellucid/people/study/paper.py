"""Write what a paper needs of a study: figures, LaTeX tables, a methods paragraph, checksums and references.

Write an assessment's tables as CSV for a spreadsheet or R, and as LaTeX for a paper.
"""

from __future__ import annotations

import csv
import io
import math
import platform
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..._atomic import remove_leftovers, write_text_atomically
from ..._given import csv_cell, visible_text
from ...files.recording import Recording
from ...models.estimates import Parameter
from ...study.answer import answer_lines
from ...study.pages.quantities import MINUS_SIGN, unit_text
from ...study.procedures.print_result import latex, latex_text
from ...study.procedures.procedure import quiet
from ...study.procedures.result import Result
from ...study.procedures.result_tables import FigureTable, ParameterTable
from ...study.procedures.run import each_page
from ...study.study import Study
from .assessment_result import AssessmentResult
from .assessment_tables import (
    effect_size_table,
    effect_table,
    isochrony_table,
    needed_table,
    p_text,
    pair_table,
    sensitivity_table,
    summary_table,
)

PAPER_FOLDER = "paper"
"""Folder in the study's own that is written."""

SHOWN_CHECKSUM_LENGTH = 12
"""Digits of a checksum in the LaTeX table; ``recordings.csv`` has all of them."""

REPORTED_LIBRARIES = ("numpy", "scipy")
"""Libraries whose versions decide the last digits of a figure."""

METHOD_REFERENCES: Mapping[str, tuple[str, str]] = {
    "load": (
        "hamon2010",
        """@inproceedings{hamon2010,
  author = {Hamon, P. and Gautier, M. and Garrec, P.},
  title = {Dynamic identification of robots with a dry friction model depending on load and velocity},
  booktitle = {IEEE/RSJ International Conference on Intelligent Robots and Systems},
  year = {2010}
}""",
    ),
    "stribeck": (
        "armstrong1994",
        """@article{armstrong1994,
  author = {Armstrong-H{\\'e}louvry, B. and Dupont, P. and {Canudas de Wit}, C.},
  title = {A survey of models, analysis tools and compensation methods for the control of machines with friction},
  journal = {Automatica},
  volume = {30},
  number = {7},
  pages = {1083--1138},
  year = {1994}
}""",
    ),
}
"""Reference of each part of a model that has one, by a word that the part's parameters hold: its key and its entry."""


def write_paper(study: Study, *, on_progress: Callable[[str, float], None] | None = None) -> Path:
    """Write the parts of a paper into the folder ``paper``, and return the folder.

    Results are taken from what their commands kept, if that is fresh, or found again. The parts are ``figures/``
    (PDF and SVG), ``tables/`` (LaTeX and CSV), ``methods.tex``, ``references.bib``, ``recordings.csv`` with a
    SHA-256 of every file, and ``main.tex``, a document of all of them.
    """
    return write_paper_of(study, on_progress or quiet)[0]


def write_paper_of(study: Study, on_progress: Callable[[str, float], None]) -> tuple[Path, list[Result]]:
    """Write the parts of a paper as `write_paper` does; return the folder, and the results whose answers they state."""
    found = list(each_page(study, None, on_progress))
    folder = study.place(PAPER_FOLDER)
    for part in ("figures", "tables"):
        (folder / part).mkdir(parents=True, exist_ok=True)
        remove_leftovers(folder / part)
    drawings = [drawing for _, page in found for drawing in page.drawings]
    for drawing in drawings:
        drawing.save(folder / "figures", with_pdf=True)
    tables = paper_tables([result for result, _ in found])
    for name, table in tables.items():
        write_text_atomically(folder / "tables" / f"{name}.tex", latex(table))
        write_text_atomically(folder / "tables" / f"{name}.csv", csv_text(table.heads, table.rows, csv_shown))
    recordings = study.recordings()
    heads = ("recording", "file", "use", "sha256")
    rows = [(r.name, r.path.name, r.use, r.checksum) for r in recordings]
    write_text_atomically(folder / "recordings.csv", csv_text(heads, rows, csv_shown))
    short = [(*row[:-1], f"{row[-1][:SHOWN_CHECKSUM_LENGTH]}…") for row in rows]
    write_text_atomically(folder / "tables" / "recordings.tex", latex(FigureTable("Recordings", heads, tuple(short))))
    results = [result for result, _ in found]
    keys, references = references_of(study, results)
    write_text_atomically(folder / "references.bib", references)
    write_text_atomically(folder / "methods.tex", methods_text(study, results, recordings, keys))
    figures = [(drawing.name, drawing.caption) for drawing in drawings]
    write_text_atomically(folder / "main.tex", _main_text(study, figures, [*tables, "recordings"]))
    return folder, results


def paper_tables(results: Sequence[Result]) -> dict[str, FigureTable]:
    """Return the tables of results by a file name for each; parameters have their intervals."""
    found: dict[str, FigureTable] = {}
    for result in results:
        for table in result.tables:
            shown = _parameter_table(table, result.confidence) if isinstance(table, ParameterTable) else table
            name = re.sub(r"[^a-z0-9]+", "_", f"{result.procedure}_{table.title}".lower()).strip("_")
            at = name if name not in found else f"{name}_{sum(other.startswith(name) for other in found)}"
            if shown.rows:
                found[at] = shown
    return found


def _parameter_table(table: ParameterTable, confidence: float) -> FigureTable:
    """Return a table of parameters with values and intervals to the digits that the intervals determine."""
    rows = tuple(_parameter_row(parameter, confidence) for parameter in table.parameters)
    return FigureTable(table.title, ("parameter", "value", f"{confidence:.0%} interval", "unit"), rows)


def _parameter_row(parameter: Parameter, confidence: float) -> tuple[str, str, str, str]:
    low, high = parameter.interval(confidence)
    digits = _decimals(high - low)
    value, start, end = (f"{x:.{digits}f}".replace("-", MINUS_SIGN) for x in (parameter.value, low, high))
    return parameter.name.replace("_", " "), value, f"{start} to {end}", unit_text(parameter.unit)


def _decimals(width: float) -> int:
    """Return how many decimals show two digits of an interval's width."""
    return max(0, 1 - math.floor(math.log10(width))) if math.isfinite(width) and width > 0.0 else 4


def references_of(study: Study, results: Sequence[Result]) -> tuple[list[str], str]:
    """Return the keys that the methods cite, and the text of the BibTeX file."""
    entries = {
        "pellucid": "@software{pellucid,\n  author = {{The Pellucid developers}},\n  title = {Pellucid},\n"
        f"  version = {{{version('pellucid')}}},\n  note = {{From recordings to a transparent exoskeleton}}\n}}"
    }
    if study.config.citation:
        said = latex_text(study.config.citation)
        entries["recordings"] = f"@misc{{recordings,\n  title = {{{{{said}}}}},\n  note = {{Recordings}}\n}}"
    names = " ".join(name for result in results for name in result.estimates)
    for word, (key, entry) in METHOD_REFERENCES.items():
        if word in names:
            entries[key] = entry
    return list(entries), "\n\n".join(entries.values()) + "\n"


def methods_text(study: Study, results: Sequence[Result], recordings: Sequence[Recording], keys: Sequence[str]) -> str:
    """Return the paragraph of methods as LaTeX: recordings, processing, estimation, versions and checksums."""
    uses = Counter(recording.use for recording in recordings)
    rates = sorted({round(recording.fs) for recording in recordings})
    spans = sum(float(recording.time[-1] - recording.time[0]) for recording in recordings)
    people = sorted({recording.participant for recording in recordings if recording.participant})
    conditions = sorted({recording.condition for recording in recordings if recording.condition})
    rate = f"{rates[0]} Hz" if len(rates) == 1 else f"{rates[0]} to {rates[-1]} Hz"
    sentences = [
        f"The study {latex_text(study.name)} has {len(recordings)} recordings of {spans:.0f} s together, at {rate}"
        + (r"~\cite{recordings}" if "recordings" in keys else "") + ".",
        f"{uses.get('fit', 0)} of them were fitted; {uses.get('validate', 0)} were held out and used in no fit.",
    ]  # fmt: skip
    if people:
        sentences.append(f"{len(people)} participants took part.")
    if conditions:
        sentences.append(f"Conditions were {latex_text(', '.join(conditions))}.")
    for result in results:
        sentences.append(latex_text(f"By pellucid {result.command}: {' '.join(answer_lines(result.answer))}"))
        processing = next((said for card in result.cards.values() if (said := getattr(card, "processing", ""))), "")
        if processing:
            sentences.append(latex_text(f"Signals were processed as follows: {_one_sentence(processing)}"))
        sentences.append(latex_text(f"Intervals have a confidence level of {result.confidence:.0%}."))
        if result.prose:
            sentences.append(latex_text(result.prose))
    libraries = ", ".join(f"{name} {version(name)}" for name in REPORTED_LIBRARIES)
    cited = [key for key in keys if key not in ("pellucid", "recordings")]
    if cited:
        sentences.append(rf"Friction models that were compared follow \cite{{{','.join(cited)}}}.")
    sentences.append(
        rf"All figures were computed with Pellucid {latex_text(version('pellucid'))}~\cite{{pellucid}} under Python "
        f"{platform.python_version()} with {latex_text(libraries)}. recordings.csv has the SHA-256 of every recording, "
        "and results.json every figure with the checksum of the files that it was computed from."
    )
    return "\n".join(dict.fromkeys(sentences)) + "\n"


def _one_sentence(text: str) -> str:
    """Return a text that ends in a full stop."""
    text = " ".join(visible_text(text).split())
    return text if text.endswith((".", "!", "?")) else f"{text}."


def csv_figure(cell: object) -> str:
    """Return a cell as a program reads it: figures as numbers with an ASCII minus sign, nothing for NaN."""
    if isinstance(cell, float):
        return "" if np.isnan(cell) else f"{cell:.7g}"
    return csv_cell(str(cell).replace(MINUS_SIGN, "-"))


def csv_shown(cell: object) -> str:
    """Return a cell with the characters that a paper shows."""
    return csv_cell(str(cell))


def _main_text(study: Study, figures: Sequence[tuple[str, str]], tables: Sequence[str]) -> str:
    """Return a LaTeX document of all parts."""
    lines = [
        r"\documentclass{article}", r"\usepackage[utf8]{inputenc}", r"\usepackage{booktabs,graphicx}",
        r"\begin{document}", rf"\section*{{{latex_text(study.name)}}}", r"\input{methods}",
        *(rf"\input{{tables/{name}}}" for name in tables),
    ]  # fmt: skip
    for name, caption in figures:
        lines += [
            r"\begin{figure}", r"\centering", rf"\includegraphics[width=\linewidth]{{figures/{name}}}",
            rf"\caption{{{latex_text(caption)}}}", r"\end{figure}",
        ]  # fmt: skip
    return "\n".join([*lines, r"\bibliographystyle{plain}", r"\bibliography{references}", r"\end{document}"]) + "\n"


def write_tables(folder: Path, found: AssessmentResult) -> tuple[Path, ...]:
    """Write every table for a paper as CSV and as LaTeX, and values of participants and movements as CSV."""
    folder.mkdir(parents=True, exist_ok=True)
    named = {
        "indices": paper_table(found),
        "changes": effect_table(found),
        "pairs": pair_table(found),
        "isochrony": isochrony_table(found),
        "filters": sensitivity_table(found),
        "participants_needed": needed_table(found),
        "participants_by_effect": effect_size_table(found),
    }
    texts: dict[str, str] = {}
    for name, table in named.items():
        if table.rows:
            texts[f"{name}.csv"] = csv_text(table.heads, table.rows)
            texts[f"{name}.tex"] = latex(table)
    texts["participants.csv"] = csv_text(*participant_values(found))
    texts["movements.csv"] = csv_text(*movement_values(found))
    for name, text in texts.items():
        write_text_atomically(folder / name, text)
    return tuple(folder / name for name in texts)


def paper_table(found: AssessmentResult) -> FigureTable:
    """The summary with Friedman's test of every index."""
    summary = summary_table(found)
    rows = []
    for row, each in zip(summary.rows, found.assessed.values(), strict=True):
        test = each.comparison.friedman
        test_cells = (None, None, None)
        if test is not None:
            test_cells = f"{test.statistic:.2f}", test.degrees_of_freedom, p_text(each.comparison.p_value)
        rows.append((*row, *test_cells))
    return FigureTable(summary.title, (*summary.heads, "χ²", "df", "p"), tuple(rows))


def participant_values(found: AssessmentResult) -> tuple[tuple[str, ...], list[tuple]]:
    """Every participant's value of every index in every condition, in SI, one a row."""
    rows = [
        (each.name, each.table.index.unit, person, condition, float(value))
        for each in found.assessed.values()
        for person, own in zip(each.table.participants, each.table.values, strict=True)
        for condition, value in zip(each.table.conditions, own, strict=True)
    ]
    return ("index", "unit", "participant", "condition", "value"), rows


def movement_values(found: AssessmentResult) -> tuple[tuple[str, ...], list[tuple]]:
    """Every movement that was used, one a row: whose it is, when, and all its values in SI."""
    names = tuple(dict.fromkeys(name for m in found.measured for name in m.values))
    heads = ("participant", "condition", "recording", "start", f"amplitude_{found.along.shown}", "direction", *names)
    rows = [
        (m.participant, m.condition, m.recording, round(m.movement.start, 4), *m.cell, *map(m.values.get, names))
        for m in found.measured
    ]
    return heads, rows


def csv_text(heads: Sequence[str], rows: Sequence[Sequence[object]], cell_text: Callable = csv_figure) -> str:
    """Return a table as comma-separated text, each cell as `cell_text` gives it, and nothing where there is None."""
    made = io.StringIO()
    writer = csv.writer(made, lineterminator="\n")
    for row in (heads, *rows):
        writer.writerow(["" if cell is None else cell_text(cell) for cell in row])
    return made.getvalue()
