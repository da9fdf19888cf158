"""EMG of files, or of a study's recordings: may it be used?"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..._errors import PellucidError
from ..._given import visible_text
from ...files.log import LogFinding
from ...files.stated_units import split_unit
from ...study.procedures.audit import Audit, audit, find_verdicts
from ...study.procedures.procedure import Progress, quiet
from ...study.procedures.registry import open_study
from ...study.study import STUDY_FILE, Study

QUALITY_QUESTION = "May this EMG be used?"
"""Question of `pellucid emg quality`."""


def audit_emg(
    files: Iterable[str | os.PathLike], *, rate: float | None = None, on_progress: Progress = quiet
) -> Audit:
    """Return the audit of the channels of EMG alone, and of the files that have such channels.

    Parameters
    ----------
    files : iterable of path-like
        Files of any format, folders of them, or folders of studies, of which the recordings are read.
    rate : float, optional
        Sampling rate of files without a column of time [Hz]; by default the one that study.toml states.
    on_progress : callable
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Audit

    Raises
    ------
    PellucidError
        If no channel of EMG is found.
    """
    given = tuple(map(os.fspath, files))
    studies = {path: open_study(path) for path in map(Path, given) if (path / STUDY_FILE).is_file()}
    stated = _stated_rates(studies.values())
    if rate is None and len(stated) == 1:
        (rate,) = stated
    found = audit(_recordings_of(map(Path, given), studies), rate=rate, on_progress=on_progress)
    stated = _stated_envelopes(studies.values())
    files = tuple(
        replace(f, findings=tuple(one for one in f.findings if one.kind != "envelope" or not _names(one) & stated))
        for f in found.files
    )
    found = replace(found, files=files, verdicts=tuple(find_verdicts(files)))
    verdicts = tuple(v for v in found.verdicts if v.holds.split(",")[0].split(" ")[0] == "emg")
    if not verdicts:
        names = ", ".join(v.channel for v in found.verdicts)
        raise PellucidError(f"emg quality: found no channel of EMG among {names}, expected one or more")
    named = {v.channel for v in verdicts}
    files = tuple(f for f in found.files if f.log is None or any(visible_text(c.name) in named for c in f.log.channels))
    return replace(
        found, files=files, verdicts=verdicts, paths=given, command="emg quality", question=QUALITY_QUESTION,
        **_stated_basis(studies, given),
    )  # fmt: skip


def _stated_basis(studies: Mapping[Path, Study], given: Sequence[str]) -> dict[str, Any]:
    """Return what studies state of their recordings; nothing where other files were given too."""
    if len(studies) < len(given):
        return {}
    stated = {study.config.simulated for study in studies.values()}
    people = {(path, r.participant) for path, study in studies.items() for r in study.recordings() if r.participant}
    simulated = stated.pop() if len(stated) == 1 else None
    return {"is_of_studies": True, "stated_simulated": simulated, "people": len(people)}


def _stated_envelopes(studies: Iterable[Study]) -> set[str]:
    """Return the columns that studies state as envelopes, in every recording with them."""
    recordings = [each for study in studies for r in study.recordings() for each in (r, *r.streams.values())]
    emg = [c for r in recordings for name, c in r.channels.items() if name.startswith("emg.")]
    return {str(c.column) for c in emg if c.unit != "V"} - {str(c.column) for c in emg if c.unit == "V"}


def _names(finding: LogFinding) -> set[str]:
    """Return the column of a finding, with its unit and, as study.toml may name it, without."""
    return {finding.channel, split_unit(finding.channel)[0]}


def _stated_rates(studies: Iterable[Study]) -> set[float]:
    """Return the rates that studies state of recordings without a column of time [Hz]."""
    configs = (study.config for study in studies)
    specs = [
        channels.get("time")
        for config in configs
        for channels in (config.channels, *(stream.channels for stream in config.streams.values()))
    ]
    return {spec.rate for spec in specs if spec is not None and spec.rate is not None}


def _recordings_of(given: Iterable[Path], studies: Mapping[Path, Study]) -> list[Path]:
    """Return the files that are named, and the files of the recordings of studies by their folder."""
    paths: list[Path] = []
    for path in given:
        if path in studies:
            recordings = studies[path].recordings()
            paths += [each.path for each in recordings]
            paths += [s.path for each in recordings for s in each.streams.values()]
        else:
            paths.append(path)
    return list(dict.fromkeys(paths))
