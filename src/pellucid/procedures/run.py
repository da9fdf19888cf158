"""A study's commands: is it fit, what is found, and the report of it; each asks the procedures that the study names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import TYPE_CHECKING

from .._errors import IdentificationError, RecordingError
from ..fit.parameter import KINDS, Verdict
from ..recordings.duplicates import duplicates
from ..recordings.fault import Fault, grouped
from ..recordings.study import Study
from .procedure import Procedure, Progress, quiet
from .registry import PROCEDURES, asked
from .result import Result, found_by

if TYPE_CHECKING:
    from ..pages.page import Page


def check(study: Study) -> list[Fault]:
    """Every fault found in a study's recordings; empty where there is none.

    Parameters
    ----------
    study : Study

    Returns
    -------
    list of Fault
        `severity` "refuse" stops a procedure; of "cut" it is said what is left out, of "note" what is remarkable; what
        is found of "warn" is not to be believed as it is. The refusing ones first, then the warnings.

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
    faults = duplicates(study.recordings())
    for procedure in reversed(asked(study)):
        try:
            faults += procedure.cut(study) + procedure.faults(procedure.taken(study))
        except RecordingError:
            if not procedure.unfit(study):
                raise
            faults += [replace(fault, severity="refuse") for fault in procedure.unfit(study).values()]
    first = ("refuse", "warn")
    return sorted(dict.fromkeys(faults), key=lambda f: first.index(f.severity) if f.severity in first else len(first))


def identify(
    study: Study,
    *,
    families: Sequence[str] | None = None,
    on_progress: Callable[[str, float], None] | None = None,
    thorough: bool = True,
) -> Result:
    """Identify what a study's study.toml asks for: a joint, one with a carriage, a transfer function, a coupling...

    Parameters
    ----------
    study : Study
    families : sequence of str, optional
        Friction families of a joint; the study's own list if left out. Other procedures have methods of their own.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    thorough : bool
        Of a joint also weighted, robust, closed-loop and output-error estimates and simulations; False gives least
        squares, intervals and held-out errors only.

    Returns
    -------
    Result
        ``result["inertia"]`` is a parameter with its interval; ``result.save(study)`` writes cards and rows.

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
    procedure = _only(study, "identify")
    if procedure.name == "joint":
        return _run(procedure, study, on_progress, families=families, thorough=thorough)
    if families:
        raise IdentificationError("this study is identified by methods of its own; leave out --family")
    return _run(procedure, study, on_progress)


def calibrate(study: Study, on_progress: Callable[[str, float], None] | None = None) -> Result:
    """Calibrate torque from EMG by several methods, and judge them on what was not fitted.

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
        If the study asks for no torque from EMG, nothing can be fitted or judged, or cards are missing.
    RecordingError
        If a recording is not fit to be used.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.calibrate(pl.open("my-leg"))                             # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return _run(_only(study, "calibrate"), study, on_progress)


def assess(
    study: Study,
    on_progress: Callable[[str, float], None] | None = None,
    *,
    studies: int = 1000,
    executor: Executor | None = None,
) -> Result:
    """Do conditions change how people move? Indices, tests, effect sizes and how many participants it takes.

    Parameters
    ----------
    study : Study
        With a table ``[assessment]``.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    studies : int
        Simulated to plan the next one.
    executor : Executor, optional
        That simulates them, a cluster for instance.

    Returns
    -------
    Result

    Raises
    ------
    IdentificationError
        If the study asks for no assessment, or nobody took part in all conditions.
    RecordingError
        If a recording is not fit to be used.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.assess(pl.open("my-people"))                             # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return _run(_only(study, "assess"), study, on_progress, studies=studies, executor=executor)


def onset(study: Study, on_progress: Callable[[str, float], None] | None = None) -> Result:
    """When muscles become active: bursts of raw EMG, each beginning and end with its interval.

    Parameters
    ----------
    study : Study
        With a table ``[onset]``.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Result

    Raises
    ------
    IdentificationError
        If the study asks for no onsets.
    RecordingError
        If no recording has raw EMG with rest and activity in it.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.onset(pl.open("my-leg"))                                 # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return _run(_only(study, "onset"), study, on_progress)


def cocontraction(study: Study, on_progress: Callable[[str, float], None] | None = None) -> Result:
    """How much antagonists work against each other: indices of every pair, with intervals.

    Parameters
    ----------
    study : Study
        With a table ``[cocontraction]``.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Result

    Raises
    ------
    IdentificationError
        If the study asks for no co-contraction.
    RecordingError
        If a pair is not in every recording, or its EMG is not fit to be used.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.cocontraction(pl.open("my-leg"))                         # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return _run(_only(study, "cocontraction"), study, on_progress)


def synergies(study: Study, on_progress: Callable[[str, float], None] | None = None) -> Result:
    """Groups of muscles that move together: how many, which, and whether people and conditions share them.

    Parameters
    ----------
    study : Study
        With a table ``[synergies]``.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Result

    Raises
    ------
    IdentificationError
        If the study asks for no synergies, or has fewer than three muscles.
    RecordingError
        If a muscle is not in every recording, or its EMG is not fit to be used.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.synergies(pl.open("my-leg"))                         # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return _run(_only(study, "synergies"), study, on_progress)


def activations(study: Study, on_progress: Callable[[str, float], None] | None = None) -> Result:
    """Activations of all muscles, near their EMG, with which a measured torque follows; electrodes that are lost.

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
        If the study asks for no activations, or there is nothing to fit or to judge.
    RecordingError
        If a recording is not fit to be used.

    Examples
    --------
    >>> import pellucid as pl
    >>> result = pl.activations(pl.open("my-leg"))                           # doctest: +SKIP
    >>> print(result)                                                        # doctest: +SKIP
    """
    return _run(_only(study, "activations"), study, on_progress)


def report(
    study: Study, result: Result | None = None, *, on_progress: Callable[[str, float], None] | None = None
) -> Path:
    """Write the report: all that was identified, calibrated and assessed, on one page, with every figure beside it.

    Parameters
    ----------
    study : Study
    result : Result, optional
        What was just found. Everything else is taken from what its command kept, if that is fresh, or found again.
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
        If a recording can no longer be read, or nothing can be identified from them.

    Examples
    --------
    >>> import pellucid as pl
    >>> study = pl.open("my-elbow")
    >>> pl.report(study, pl.identify(study, families=["symmetric"], thorough=False)).name
    'index.html'
    """
    from ..pages.page import write_page

    tell, procedures, pages = on_progress or quiet, asked(study), []
    for i, procedure in enumerate(procedures):
        given = result is not None and result.procedure == procedure.name
        found = result if given else Result.kept(study, procedure)
        if found is not None:
            tell("drawing", (i + 0.8) / len(procedures))
            try:
                pages.append(procedure.page(study, found))
                continue
            except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError):
                # What cannot be drawn is found again.
                if given:
                    raise
        tell(f"{procedure.command} again: nothing that you kept is fresh", i / len(procedures))
        found = _run(procedure, study, lambda text, share, i=i: tell(text, (i + 0.8 * share) / len(procedures)))
        tell("drawing", (i + 0.8) / len(procedures))
        pages.append(procedure.page(study, found))
    page = _one_page(pages)
    try:
        return write_page(Path(study.report_dir), page)
    except OSError:
        # What was found again may have taken minutes: it is drawn where there is room.
        for parent in (Path.cwd(), Path(gettempdir()), Path.home()):
            with suppress(OSError):
                return write_page(Path(mkdtemp(prefix=f"pellucid-{study.name}-report-", dir=parent)), page)
        raise


def _run(procedure: Procedure, study: Study, on_progress: Progress | None, **options) -> Result:
    tell = on_progress or quiet
    twice = duplicates(study.recordings())
    if twice:
        raise RecordingError("\n".join(fault.message for fault in twice))
    found = procedure.run(procedure.taken(study), tell, **options)
    cut = tuple(Verdict("note", text) for text in grouped(procedure.cut(study)))
    found = found_by(procedure, study, replace(found, verdicts=found.verdicts + cut))
    tell("done", 1.0)
    return found


def _only(study: Study, command: str) -> Procedure:
    """What the study asks of a command."""
    found = asked(study, command)
    whole = any(p.table is not None and p.table.several for p in found)
    if command == "identify" and len(study.rig.joints) > 1 and not whole:
        raise IdentificationError(study.rig.refusal)
    if found:
        return found[0]
    tables = [f"[{p.name}]" for p in PROCEDURES if p.command == command and p.table is not None]
    wanted = ["[rig.drive]"] if command == "identify" else tables
    others = ", ".join(dict.fromkeys(p.command for p in asked(study)))
    raise IdentificationError(
        f"{study.folder}: study.toml has no table {' or '.join(wanted)} and asks for nothing that {command} does; use: "
        f"pellucid {others} {study.folder}"
    )


def _one_page(pages: list[Page]) -> Page:
    """All on the first, whose name stays; the others' headlines and sections say what they are of."""
    first, *others = pages
    headlines, sections = [first.headline], list(first.sections)
    for page in others:
        what = page.title.rpartition(": ")[2]
        headlines.append(f"{what[:1].upper()}{what[1:]}: {page.headline}")
        known = {section.heading for section in sections}
        sections += [replace(s, heading=f"{s.heading}: {what}") if s.heading in known else s for s in page.sections]
    tiles = tuple(tile for page in pages for tile in page.tiles)
    verdicts = sorted((v for page in pages for v in page.verdicts), key=lambda v: KINDS.index(v[0]))
    return replace(first, headline=" ".join(headlines), tiles=tiles, sections=tuple(sections), verdicts=tuple(verdicts))
