"""Commands on a study: check it, run the procedures that it requests, and write its report.

`identify_several` identifies many studies in parallel, and `table_of` makes one table of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._domains import array_function
from ..._errors import ArgumentError, IdentificationError, PellucidError, RecordingError
from ..._processes import finished_results, with_one_blas_thread
from ...files.duplicates import find_duplicates
from ...files.fault import Fault, grouped_messages
from ...models.estimates import VERDICT_KINDS, Parameter, Verdict, rank_verdicts
from ...numerics.arguments import with_checked_arguments, with_one_rate
from ..answer import REPORT_COMMAND, Answer, Step, answer_lines, begun, next_lines, unanswered_message
from ..pages.quantities import unit_text, value_and_half_interval
from ..results import read_rows
from ..study import Study
from . import registry
from .card_sources import ResultT, found_by
from .complete_answer import complete_answer, without_further
from .procedure import CostedSteps, Procedure, Progress, quiet, take_recordings, typed_command, typed_commands
from .registry import as_study, asked, is_study
from .result import CombinedResult, ParameterTable, Result

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from numpy.typing import ArrayLike

    from ..pages.page import Page

RUN_COSTS = {"reading recordings": 0.08, "fitting": 0.92}
"""Measured processor time of reading recordings and of what a procedure makes of them, as shares."""

CHECK_READING_SHARE = 0.7
"""Share of a check's progress that reading the recordings, and finding their defects, takes."""


@with_checked_arguments
def check(study: Study, *, on_progress: Callable[[str, float], None] | None = None) -> list[Fault]:
    """Return the faults of a study's recordings; empty if there are none.

    Parameters
    ----------
    study : Study
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    list of Fault
        A fault with `severity` "refuse" stops a procedure, "cut" reports excluded samples, and "note" reports a
        peculiarity. With "warn" a result is not reliable. Faults that stop come first, then warnings.

    Raises
    ------
    RecordingError
        If a file cannot be read at all.

    Examples
    --------
    >>> import pellucid as pl
    >>> [fault.message for fault in pl.check(pl.open("my-elbow")) if fault.severity == "refuse"]
    []
    """
    study, tell = as_study(study, "check"), on_progress or quiet
    tell("reading recordings", 0.0)
    recordings = study.recordings(on_progress=lambda text, share: tell(text, CHECK_READING_SHARE * share))
    if not recordings:
        raise RecordingError(f"{study.folder}: study.toml has no recording, expected one or more in [[recordings]]")
    faults = find_duplicates(recordings)
    procedures = list(reversed(asked(study)))
    for i, procedure in enumerate(procedures):
        share = CHECK_READING_SHARE + (1.0 - CHECK_READING_SHARE) * i / len(procedures)
        tell(f"checking what {procedure.name.replace('_', ' ')} needs", share)
        unfit = procedure.unfit(study)
        faults += procedure.excluded_faults(study, unfit)
        try:
            taken = procedure.taken(study)
            faults += procedure.cut(study) + procedure.faults(taken, procedure.table_of(taken))
        except RecordingError:
            if not unfit:
                raise
            faults += [replace(fault, severity="refuse") for fault in unfit.values()]
    first = ("refuse", "warn")
    return sorted(dict.fromkeys(faults), key=lambda f: first.index(f.severity) if f.severity in first else len(first))


def run(
    study: Study,
    name: str | None = None,
    *,
    on_progress: Callable[[str, float], None] | None = None,
    **options: Mapping[str, object],
) -> Result:
    """Run every procedure that a study asks for, or those of one name.

    Parameters
    ----------
    study : Study
    name : str, optional
        Name of a procedure (``"joint"``) or of a command (``"identify"``), which may run several.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    **options
        Options of a procedure by its name: ``joint={"thorough": False}``.

    Returns
    -------
    Result
        The procedure's own result where one ran. Where several ran, all of them; ``result.parts`` has each.

    Raises
    ------
    IdentificationError
        If the study asks for nothing of that name, or the recordings cannot carry a result.
    RecordingError
        If a recording is not fit to be used.
    PellucidError
        If no procedure and no command has that name.
    """
    study = as_study(study, "run")
    unknown = options.keys() - {procedure.name for procedure in registry.ALL_PROCEDURES}
    if unknown:
        raise PellucidError(f"run: found options of {', '.join(sorted(unknown))}, expected those of procedures by name")
    tell, procedures, found = on_progress or quiet, _required(study, name), []
    steps = CostedSteps(tell, {procedure.name: procedure.cost for procedure in procedures})
    names = [procedure.name for procedure in procedures]
    for procedure in procedures:
        found.append(_run(procedure, study, steps.part(procedure.name), names, **options.get(procedure.name, {})))
    return found[0] if len(found) == 1 else CombinedResult.from_parts(found)


@with_checked_arguments
def identify(
    study: Study,
    *,
    families: Sequence[str] | None = None,
    on_progress: Callable[[str, float], None] | None = None,
    thorough: bool = True,
) -> Result:
    """Identify the models that study.toml requests: a joint, one with a carriage, a transfer function, a coupling...

    Parameters
    ----------
    study : Study
    families : sequence of str, optional
        Friction families of a joint; the study's own list by default. Other procedures have no families.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    thorough : bool
        Whether a joint also gets weighted, robust, closed-loop and output-error estimates and simulations; False gives
        only least squares, intervals and held-out errors.

    Returns
    -------
    Result
        ``result["inertia"]`` is a parameter with its interval; ``result.save(study)`` writes cards and rows. Where
        study.toml asks for several procedures, all of them run, and ``result.parts`` has the result of each.

    Raises
    ------
    RecordingError
        If a recording is not fit to identify from.
    IdentificationError
        If the recordings cannot carry a model, or nothing is asked of them that `identify` does.

    Examples
    --------
    >>> import pellucid as pl
    >>> study = pl.open("my-elbow")
    >>> result = pl.identify(study, families=["symmetric"], thorough=False)
    >>> round(result["inertia"].value, 2), result["inertia"].unit
    (0.2, 'kg*m^2')
    >>> low, high = result["gravity"].interval(0.95)
    >>> low < 1.5 < high
    True
    >>> _ = result.save(study)
    """
    study = as_study(study, "identify")
    procedures = _required(study, "identify")
    if families and not any(procedure.takes_families for procedure in procedures):
        raise IdentificationError("the procedures of this study have no friction families; omit --family")
    options = {each.name: {"families": families, "thorough": thorough} for each in procedures if each.takes_families}
    return run(study, "identify", on_progress=on_progress, **options)


@with_checked_arguments
def calibrate(study: Study, on_progress: Callable[[str, float], None] | None = None) -> Result:
    """Calibrate several estimators of torque from EMG, and validate them on held-out data.

    Parameters
    ----------
    study : Study
        With a table ``[emg_torque]``, or ``[isolated_muscle]``: a muscle without EMG, at a known excitation.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Result

    Raises
    ------
    IdentificationError
        If the study requests no torque from EMG, has no data to fit or to validate, or lacks cards.
    RecordingError
        If a recording is not usable.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.calibrate(pl.open("my-leg"))                             # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return run(as_study(study, "calibrate"), "calibrate", on_progress=on_progress)


@with_checked_arguments
def assess(
    subject: Study | str | os.PathLike | object,
    on_progress: Callable[[str, float], None] | None = None,
    *,
    studies: int = 1000,
    executor: Executor | None = None,
    **table: object,
) -> Result | Any:
    """Compare people's movements under several conditions: indices, tests, effect sizes and required participants.

    Parameters
    ----------
    subject : Study, path-like, or data frame
        A study with a table ``[assessment]``; or a data frame (or a mapping of columns) with one row for each movement
        or participant, the columns ``participant`` and ``condition``, and one column for each index.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    studies : int
        Number of simulated studies for the power of the next one.
    executor : Executor, optional
        Runs the simulated studies, on a cluster for instance.
    **table
        For a data frame: ``analysis``, the analysis that was stated before the data were seen (``analysis.toml``,
        study.toml, or an equal mapping: control, design, margins, columns, and more). Or ``control``, the name of the
        control condition, and optionally ``indices``, ``participant``,
        ``condition``, ``factors`` (names of columns; movements are compared within the levels of the factors, by
        default of amplitude, target and direction), ``margins`` (largest relative change of each index that does not
        matter), ``alpha``, ``estimand``, ``people`` and ``max_left_out`` (largest share of movements or participants
        that may be missing). Columns of the design, such as amplitude, period, block and trial, are no indices.

    Returns
    -------
    Result or TableAssessment
        Of a study its result; of a data frame a mapping from index to comparison, with ``.certificates``.

    Raises
    ------
    IdentificationError
        If the study asks for no assessment, or nobody took part in all conditions.
    RecordingError
        If a recording is not fit to be used.
    PellucidError
        If the subject is neither a study nor a table, or a column is missing.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.assess("my-people")                                      # doctest: +SKIP
    >>> rows = {
    ...     "participant": ["A", "A", "B", "B", "C", "C"],
    ...     "condition": ["free", "worn"] * 3,
    ...     "duration": [1.0, 1.1, 0.9, 1.0, 1.2, 1.4],
    ... }
    >>> found = pl.assess(rows, control="free")
    >>> round(found["duration"].pairwise["worn"].change, 2)
    0.13
    >>> stated = {"control": "free", "margins": {"duration": "10 %"}, "estimand": "mean"}
    >>> pl.assess(rows, analysis=stated).certificates["worn"].verdict
    'cannot say'
    """
    if not is_study(subject):
        if "control" not in table and "analysis" not in table:
            raise PellucidError(
                f"assess: found {type(subject).__name__}, expected a study, or a data frame with analysis=FILE or "
                "control=NAME of the control condition"
            )
        return array_function("assess")(subject, **table)
    if table:
        raise PellucidError(f"assess: found {', '.join(table)} with a study, expected them in its study.toml")
    if studies < 1:
        raise IdentificationError(f"assess: found {studies} studies to simulate, expected 1 or more")
    study = as_study(subject, "assess")
    return run(study, "assess", on_progress=on_progress, assessment={"studies": studies, "executor": executor})


@with_checked_arguments
def onset(
    subject: Study | str | os.PathLike | Mapping[str, ArrayLike] | ArrayLike,
    on_progress: Callable[[str, float], None] | None = None,
    **options: object,
) -> Result | Any:
    """Find when muscles become active: bursts of raw EMG, each onset and end with its interval.

    Parameters
    ----------
    subject : Study, path-like, array_like of shape (n,), or mapping of str to array_like
        A study with a table ``[onset]``; or raw EMG of one muscle or of several by name [V].
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    **options
        For arrays: ``rate`` or ``fs``, the sampling rate [Hz], and optionally ``rest``, the beginning and end of a
        stretch of rest [s], ``level``, the intervals' probability, ``height``, ``shortest`` and ``pause``.

    Returns
    -------
    Result, Activations, or dict of str to Activations

    Raises
    ------
    IdentificationError
        If the study asks for no onsets.
    RecordingError
        If there is no raw EMG with rest and activity.
    PellucidError
        If the subject is neither a study nor an array, or `rate` is missing.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> result = pl.onset("my-leg")                                          # doctest: +SKIP
    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> emg = np.random.default_rng(0).standard_normal(t.size) * np.where((t > 1.0) & (t < 2.0), 1.0, 0.02)
    >>> found = pl.onset(emg, rate=1000.0)
    >>> round(found.bursts[0].onset.time, 1)
    1.0
    """
    if is_study(subject):
        return _run_study("onset", subject, on_progress, options)
    return array_function("onset")(subject, **_array_options("onset", subject, options))


@with_checked_arguments
def cocontraction(
    subject: Study | str | os.PathLike | ArrayLike,
    second: ArrayLike | Callable[[str, float], None] | None = None,
    *,
    on_progress: Callable[[str, float], None] | None = None,
    **options: object,
) -> Result | Any:
    """Return how much antagonists work against each other: indices of co-contraction with intervals.

    Parameters
    ----------
    subject : Study, path-like, or array_like of shape (n,)
        A study with a table ``[cocontraction]``; or the envelope of the first muscle [1].
    second : array_like, shape (n,), optional
        Envelope of the second muscle, for arrays [1].
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    **options
        For arrays: ``rate`` or ``fs``, the sampling rate [Hz], and optionally ``level``, the confidence level, and
        ``moments``, whether the arrays are moments of two muscle groups [N m] of opposite signs.

    Returns
    -------
    Result or Cocontraction

    Raises
    ------
    IdentificationError
        If the study asks for no co-contraction.
    RecordingError
        If a pair is not in every recording, its EMG is not fit to be used, or arrays do not fit together.
    PellucidError
        If the subject is neither a study nor an array, or `rate` is missing.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> result = pl.cocontraction("my-leg")                                  # doctest: +SKIP
    >>> t = np.arange(0.0, 10.0, 0.01)
    >>> found = pl.cocontraction(0.5 + 0.4 * np.sin(t), 0.5 + 0.4 * np.sin(t + 1.0), fs=100.0)
    >>> round(found.common.value)
    78
    """
    if is_study(subject):
        return _run_study("cocontraction", subject, second if callable(second) else on_progress, options)
    given = _array_options("cocontraction", subject, options)
    if second is None or callable(second):
        raise PellucidError("cocontraction: found one envelope, expected a second one of the antagonist")
    return array_function("cocontraction")(subject, second, **given)


@with_checked_arguments
def synergies(
    subject: Study | str | os.PathLike | Mapping[str, ArrayLike] | ArrayLike,
    on_progress: Callable[[str, float], None] | None = None,
    **options: object,
) -> Result | Any:
    """Find groups of muscles that are active together: how many, which, and how much of the EMG they explain.

    Parameters
    ----------
    subject : Study, path-like, mapping of str to array_like, or array_like of shape (n, m)
        A study with a table ``[synergies]``; or envelopes by muscle [1].
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    **options
        For arrays: ``rate`` or ``fs``, the sampling rate [Hz], and optionally ``muscles`` (names of the columns),
        ``number`` of synergies and ``heldout`` envelopes.

    Returns
    -------
    Result or FoundSynergies

    Raises
    ------
    IdentificationError
        If the study asks for no synergies, or there are too few muscles.
    RecordingError
        If a muscle is not in every recording, or its EMG is not fit to be used.
    PellucidError
        If the subject is neither a study nor envelopes, or `rate` is missing.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> result = pl.synergies("my-leg")                                      # doctest: +SKIP
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> push, pull = np.clip(np.sin(t), 0.0, None), np.clip(-np.sin(t), 0.0, None)
    >>> found = pl.synergies({"a": push, "b": 0.5 * push + 0.1 * pull, "c": pull, "d": 0.8 * pull}, fs=100.0)
    >>> found.weights.shape
    (2, 4)
    """
    if is_study(subject):
        return _run_study("synergies", subject, on_progress, options)
    return array_function("synergies")(subject, **_array_options("synergies", subject, options))


@with_checked_arguments
def activations(study: Study, on_progress: Callable[[str, float], None] | None = None) -> Result:
    """Estimate activations of all muscles that are close to their EMG and explain a measured torque; find lost
    electrodes.

    Parameters
    ----------
    study : Study
        With tables ``[activations]`` and ``[emg_torque]``.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Result

    Raises
    ------
    IdentificationError
        If the study requests no activations, or has no data to fit or to validate.
    RecordingError
        If a recording is not usable.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.activations(pl.open("my-leg"))                           # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return run(as_study(study, "activations"), "activations", on_progress=on_progress)


@with_checked_arguments
def report(
    study: Study,
    result: Result | None = None,
    *,
    only_kept: bool = False,
    with_pdf: bool = False,
    on_progress: Callable[[str, float], None] | None = None,
) -> Path:
    """Write the report: one page on all identified, calibrated and assessed results, with every figure as a file.

    Parameters
    ----------
    study : Study
    result : Result, optional
        What was just found. Everything else is taken from what its command kept, if that is fresh, or found again.
    only_kept : bool
        Whether only what is given or kept is drawn, as the command does; nothing is then computed, and the page says
        which command makes what is missing.
    with_pdf : bool
        Whether every figure is also written as PDF, which takes longer than the page.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Path
        The page, ``report/index.html``: one file without outside references, the same bytes for the same result; in
        a new folder elsewhere where the study's cannot be written.

    Raises
    ------
    OSError
        If the study's folder cannot be written.
    PellucidError
        If a recording can no longer be read, or nothing can be identified from them; with `only_kept`, if nothing is
        kept.

    Examples
    --------
    >>> import pellucid as pl
    >>> study = pl.open("my-elbow")
    >>> pl.report(study, pl.identify(study, families=["symmetric"], thorough=False)).name
    'index.html'
    """
    study = as_study(study, "report")
    return write_report(study, result, only_kept=only_kept, with_pdf=with_pdf, on_progress=on_progress).page


LACKING_REASON = (
    "not run yet, or run by other versions of Pellucid or its libraries, with other settings or on other recordings"
)
"""Why a page lacks an analysis that study.toml asks for."""


@dataclass(frozen=True)
class WrittenReport:
    """A report that was written: its page, the answers that it shows, and the commands of what it lacks."""

    page: Path
    answers: tuple[Answer, ...]
    lacking: str = ""

    @property
    def lines(self) -> tuple[str, ...]:
        """The answers, the place of the page and what to do next, in lines of text."""
        steps = [step for answer in self.answers for step in answer.next if step.name != REPORT_COMMAND]
        following = [f"Next: {self.lacking}"] if self.lacking else next_lines(steps)
        reasons = [begun(step.words.replace("`", "")) for step in steps if step.command and not self.lacking][:1]
        said = [line for answer in self.answers for line in answer_lines(answer)]
        lacks = [f"The page lacks analyses ({LACKING_REASON}): {self.lacking}"] if self.lacking else []
        return (*said, *lacks, f"Report: {self.page}", *following[:-1], *reasons, *following[-1:])


def write_report(
    study: Study,
    result: Result | None = None,
    *,
    only_kept: bool = False,
    with_pdf: bool = False,
    on_progress: Progress | None = None,
) -> WrittenReport:
    """Write the report as `report` does, and return it with the answers that it shows."""
    from ..pages.page import write_page

    missing: list[str] = []
    made = list(each_page(study, result, on_progress or quiet, missing if only_kept else None))
    commands = typed_commands(dict.fromkeys(missing), study.folder)
    if not made:
        raise PellucidError(
            f"{study.folder}: found no up-to-date results ({LACKING_REASON}); compute them with: {commands}"
        )
    page, answers = _one_page([page for _, page in made]), tuple(found.answer for found, _ in made)
    if missing:
        page = _with_step(page, Step(f"Compute what this page lacks ({LACKING_REASON})", line=commands))
    try:
        return WrittenReport(write_page(Path(study.report_dir), page, with_pdf=with_pdf), answers, commands)
    except OSError:
        # Computing it again may have taken minutes, so the report is written elsewhere if the folder is not writable.
        for parent in (Path.cwd(), Path(gettempdir()), Path.home()):
            with suppress(OSError):
                elsewhere = Path(mkdtemp(prefix=f"pellucid-{study.name}-report-", dir=parent))
                return WrittenReport(write_page(elsewhere, page, with_pdf=with_pdf), answers, commands)
        raise


def each_page(
    study: Study, result: Result | None, tell: Progress, missing: list[str] | None = None
) -> Iterator[tuple[Result, Page]]:
    """Yield the result and the page of every procedure that a study asks for.

    A result is the given one, or what its command kept, if that is fresh, or is found again. With a list `missing`
    nothing is found again: the command of what is not kept is added to it.
    """
    procedures = asked(study)
    names = [procedure.name for procedure in procedures]
    for i, procedure in enumerate(procedures):
        parts = () if result is None else [part for part in result.each if part.procedure == procedure.name]
        given = bool(parts)
        found = parts[0] if given else Result.kept(study, procedure)
        if found is not None:
            found = replace(found, completed=without_further(found.answer))
            tell("drawing", (i + 0.8) / len(procedures))
            try:
                page = procedure.page(study, found)
            except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError):
                # A kept result that cannot be drawn is computed again.
                if given:
                    raise
            else:
                yield found, page
                continue
        if missing is not None and not _cannot_be_kept(study, procedure):
            missing.append(procedure.command)
            continue
        tell(f"{procedure.command} again, because its kept results are outdated", i / len(procedures))
        found = _run(procedure, study, lambda text, share, i=i: tell(text, (i + 0.8 * share) / len(procedures)), names)
        tell("drawing", (i + 0.8) / len(procedures))
        yield found, procedure.page(study, found)


def _cannot_be_kept(study: Study, procedure: Procedure) -> bool:
    """Return whether a procedure's command has run without a kept result.

    The result of a plug-in may contain objects that cannot be stored; it is computed again.
    """
    if study.kept_path(procedure.name).is_file() or not study.results_path.is_file():
        return False
    return any(row.command == procedure.command for row in read_rows(study.results_path))


def _array_options(caller: str, subject: object, options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of an array function; PellucidError where the subject is no array or the rate is missing."""
    if not isinstance(subject, (Mapping, np.ndarray, list, tuple)) and not hasattr(subject, "__array__"):
        raise PellucidError(
            f"{caller}: found {type(subject).__name__}, expected a study (a path, or what pellucid.open "
            "returns) or arrays"
        )
    options = with_one_rate(caller, options, "fs", "rate")
    if "fs" not in options:
        raise PellucidError(f"{caller}: found arrays without a sampling rate, expected rate= in Hz")
    for name, samples in subject.items() if isinstance(subject, Mapping) else [("", subject)]:
        where = f"{caller}, {name}" if name else caller
        try:
            array = np.asarray(samples, dtype=np.float64)
        except (TypeError, ValueError):
            raise ArgumentError(f"{where}: found samples that are no numbers, expected an array of them") from None
        if not array.size:
            raise PellucidError(f"{where}: found no samples, expected some")
    return options


def _run_study(command: str, subject: object, on_progress: Progress | None, options: Mapping[str, object]) -> Result:
    """Run a command on the study that a subject names; PellucidError if options of arrays are given with it."""
    if options:
        raise PellucidError(f"{command}: found {', '.join(options)} with a study, expected them in its study.toml")
    return run(as_study(subject, command), command, on_progress=on_progress)


@with_one_blas_thread
def _run(
    procedure: Procedure, study: Study, on_progress: Progress | None, beside: Sequence[str] = (), **options
) -> Result:
    tell = on_progress or quiet
    steps = CostedSteps(tell, RUN_COSTS)
    taken = take_recordings(procedure, study, steps.part("reading recordings"))
    found = procedure.run(taken, procedure.table_of(taken), steps.part("fitting"), **options)
    completed = complete_result(procedure, study, found, taken.left_out, beside)
    tell("done", 1.0)
    return completed


def complete_result(
    procedure: Procedure, study: Study, found: ResultT, left_out: Collection[str], beside: Sequence[str] = ()
) -> ResultT:
    """Return what a procedure found, with verdicts on the recordings and the study's answer.

    Recordings that it `left_out` are named. The procedures `beside` it run on the same study.
    """
    cut_notes = procedure.cut(study)
    warned = [
        Verdict("warning", text)
        for text in grouped_messages([fault for fault in cut_notes if fault.severity == "warn"])
    ]
    cut = [
        Verdict("note", text)
        for text in grouped_messages([fault for fault in cut_notes if fault.severity not in ("warn", "refuse")])
    ]
    verdicts = (*rank_verdicts((*found.verdicts, *warned)), *cut)
    found = found_by(procedure, study, replace(found, verdicts=verdicts))
    answer = complete_answer(study, found, left_out, beside)
    return replace(found, completed=answer, headline=answer.sentence)


def _required(study: Study, name: str | None) -> tuple[Procedure, ...]:
    """Return the procedures of that command or name that the study asks for; IdentificationError if there is none."""
    known = dict.fromkeys(known_name for p in registry.ALL_PROCEDURES for known_name in (p.command, p.name))
    if name is not None and name not in known:
        raise PellucidError(f"run: found {name!r}, expected a procedure or a command: {', '.join(known)}")
    found = asked(study, name)
    whole = any(p.takes_each_joint or (p.table is not None and p.table.several) for p in found)
    identifies = name == "identify" or any(p.command == "identify" for p in found)
    if identifies and len(study.rig.joints) > 1 and not whole:
        raise IdentificationError(study.rig.refusal)
    if found:
        return found
    of_name = [p for p in registry.ALL_PROCEDURES if name in (p.command, p.name)]
    tables = ["[rig.drive]" if p.table is None else f"[{p.name}]" for p in of_name]
    wanted = ["[rig.drive]"] if name == "identify" else dict.fromkeys(tables)
    others = tuple(dict.fromkeys(p.command for p in asked(study)))
    raise IdentificationError(
        f"{study.folder}: study.toml has no table {' or '.join(wanted)}, so that "
        f"{typed_command(name or '')} does not apply; use: {typed_commands(others, study.folder)}"
    )


def _with_step(page: Page, step: Step) -> Page:
    """Return a page with a further step; on a page without an answer it is a warning."""
    if page.answer is None:
        return replace(page, verdicts=(("warning", step.sentence), *page.verdicts))
    return replace(page, answer=replace(page.answer, next=(*page.answer.next, step)))


def _one_page(pages: list[Page]) -> Page:
    """Return one page of all: the first one's answer, then the others' in a section each, then all sections."""
    from ..pages.page import Section
    from ..pages.quantities import capitalised

    first, *others = pages
    answers, sections = [], list(first.sections)
    for i, page in enumerate(others, start=1):
        what = page.title.rpartition(": ")[2]
        known = {section.heading for section in sections}
        sections += [replace(s, heading=f"{s.heading}: {what}") if s.heading in known else s for s in page.sections]
        words = page.said if page.answer is None else page.answer.whole
        drawn = () if page.figure is None else (page.figure,)
        names = {drawing.name for one in (*pages[:i], *pages[i + 1 :]) for drawing in one.drawings}
        drawings = tuple(replace(d, name=f"{d.name}-{i}") if d.name in names else d for d in drawn)
        answers.append(Section(f"answer-{i}", capitalised(what), (words,), drawings=drawings))
    more = tuple(page.answer for page in others if page.answer is not None)
    tiles = tuple(tile for page in pages for tile in page.tiles)
    verdicts = sorted((v for page in pages for v in page.verdicts), key=lambda v: VERDICT_KINDS.index(v[0]))
    return replace(first, tiles=tiles, sections=(*answers, *sections), verdicts=tuple(verdicts), others=more)


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
    flaw: str = ""  # why its question could not be answered; empty if it was


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

    try:
        study = open_study(folder, allow_outside=allow_outside)
        result = identify(study, families=families)
        result.save(study)
    except (PellucidError, OSError) as error:
        return Outcome(folder, failure=str(error))
    shown = next((t.parameters for t in result.tables if isinstance(t, ParameterTable)), ())
    warnings = sum(v.kind in ("wrong", "warning") for v in result.verdicts)
    flaw = unanswered_message(result.answers)
    return Outcome(folder, study.name, result.headline, tuple(shown), warnings, flaw=flaw)


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
