"""Identify many studies in parallel, in processes or on a cluster, with one table of all results."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from ..._errors import PellucidError
from ..._processes import finished_results
from ...models.parameter import Parameter
from ..pages.quantities import unit_text, value_and_half_interval
from .procedure import Progress, quiet
from .result import ParameterTable

MAX_COLUMNS = 12
"""Largest number of parameters in the common table; those that most studies have are shown."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of one study: its headline and parameters, or the reason for its failure."""

    folder: str
    study: str = ""
    headline: str = ""
    parameters: tuple[Parameter, ...] = ()  # parameters of the study's first table
    warnings: int = 0  # number of findings worse than a note
    failure: str = ""  # reason for the failure; empty if there was none


def identify_several(
    folders: Sequence[Path],
    *,
    families: Sequence[str] | None = None,
    allow_outside: bool = False,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> tuple[Outcome, ...]:
    """Identify the studies in `folders` and save each, in their order; a failure does not stop the others.

    An `executor`, for instance of a cluster that sees the same folders, replaces this machine's processes.
    """
    tell = on_progress or quiet
    jobs = [(_identified, str(Path(folder).resolve()), families, allow_outside) for folder in folders]
    found: dict[int, Outcome] = {}
    tell(f"identifying {len(jobs)} studies", 0.0)
    for i, outcome in finished_results(jobs, executor=executor):
        found[i] = outcome
        tell(f"{folders[i]}: {outcome.failure or outcome.headline}".splitlines()[0], len(found) / len(jobs))
    return tuple(found[i] for i in range(len(jobs)))


def _identified(folder: str, families: Sequence[str] | None, allow_outside: bool) -> Outcome:
    from .registry import open_study
    from .run import identify

    try:
        study = open_study(folder, allow_outside=allow_outside)
        result = identify(study, families=families)
        result.save(study)
    except (PellucidError, OSError) as error:
        return Outcome(folder, failure=str(error))
    shown = next((t.parameters for t in result.tables if isinstance(t, ParameterTable)), ())
    warnings = sum(v.kind in ("wrong", "warning") for v in result.verdicts)
    return Outcome(folder, study.name, result.headline, tuple(shown), warnings)


def table_of(outcomes: Sequence[Outcome]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heads and rows of the common table, with a row for each study and half intervals of its parameters."""
    count: dict[tuple[str, str], int] = {}
    for outcome in outcomes:
        for p in outcome.parameters:
            count[p.name, p.unit] = count.get((p.name, p.unit), 0) + 1
    most = sorted(count, key=lambda key: -count[key])[:MAX_COLUMNS]
    columns = [key for key in count if key in most]
    heads = ("study", "warnings", *(f"{name} [{unit_text(unit) or '1'}]" for name, unit in columns))
    rows = []
    for outcome in outcomes:
        own = {(p.name, p.unit): p for p in outcome.parameters}
        cells = [_cell(own.get(key)) for key in columns]
        name = outcome.study or Path(outcome.folder).name
        rows.append((name, "failed" if outcome.failure else str(outcome.warnings), *cells))
    return heads, rows


def _cell(parameter: Parameter | None) -> str:
    if parameter is None:
        return "–"
    return value_and_half_interval(parameter, 0.95)
