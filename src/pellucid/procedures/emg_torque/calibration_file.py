"""What calibration found, kept beside the study: a report draws it again without a minute of fitting.

It counts only while everything it was made from is the same to the last bit: recordings, study.toml, cards, version.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ...estimators.cross_validation import Score
from ...fit.parameter import Parameter, Verdict
from ...recordings.results import ResultRow
from ...recordings.study import STUDY_FILE, Study, checksum
from ..result import FigureTable, ParameterTable
from .calibrate import CalibrationFindings, Judged, TorqueTrace
from .muscle_findings import MuscleSummary

NAME = "calibration.json"
"""In the study's folder."""

DECIMALS = 5
"""Of torques and times that are kept."""


def keep_calibration(study: Study, found: CalibrationFindings) -> Path:
    """Write ``calibration.json``, whole or not at all.

    Parameters
    ----------
    study : Study
    found : CalibrationFindings
        Just found from it.

    Returns
    -------
    Path

    Raises
    ------
    OSError
        If the study's folder cannot be written.
    """
    plain = {name: getattr(found, name) for name in ("study", "headline", "confidence")}
    plain["checksums"] = dict(found.checksums)
    for name in ("tables", "verdicts", "rows", "judged", "muscles"):
        plain[name] = [asdict(each) for each in getattr(found, name)]
    traces = [
        {
            "what": trace.what,
            "recording": trace.recording,
            "time": np.round(trace.time, DECIMALS).tolist(),
            "reference": np.round(trace.reference, DECIMALS).tolist(),
            "predicted": {name: np.round(x, DECIMALS).tolist() for name, x in trace.predicted.items()},
            "half_width": {name: np.round(x, DECIMALS).tolist() for name, x in trace.half_width.items()},
        }
        for trace in found.traces
    ]
    text = json.dumps({"made_from": _made_from(study), **plain, "traces": traces})
    return write_text_atomically(study.folder / NAME, text + "\n")


def kept_calibration(study: Study) -> CalibrationFindings | None:
    """What was kept, without cards; None where nothing was, or it was made from something else.

    Parameters
    ----------
    study : Study

    Returns
    -------
    CalibrationFindings or None

    Raises
    ------
    RecordingError
        If a recording can no longer be read.
    """
    path = study.folder / NAME
    if not path.is_file():
        return None
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept.pop("made_from") != _made_from(study):
            return None
        return CalibrationFindings(
            **{key: kept[key] for key in ("study", "headline", "checksums", "confidence")},
            cards={},
            tables=tuple(map(_table, kept["tables"])),
            verdicts=tuple(Verdict(**verdict) for verdict in kept["verdicts"]),
            rows=tuple(ResultRow(**row) for row in kept["rows"]),
            judged=tuple(_judged(each) for each in kept["judged"]),
            traces=tuple(_trace(trace) for trace in kept["traces"]),
            muscles=tuple(MuscleSummary(**_tuples(each)) for each in kept["muscles"]),
        )
    except (ValueError, KeyError, TypeError):  # another version's, or somebody's own
        return None


def _judged(kept: dict) -> Judged:
    within = kept["within"]
    kept = {key: tuple(value) if isinstance(value, list) else value for key, value in kept.items()}
    return Judged(
        **{**_tuples(kept), "score": Score(**kept["score"]), "within": None if within is None else Score(**within)}
    )


def _trace(kept: dict) -> TorqueTrace:
    predicted, half = ({name: np.array(x) for name, x in kept[key].items()} for key in ("predicted", "half_width"))
    return TorqueTrace(
        kept["what"], kept["recording"], np.array(kept["time"]), np.array(kept["reference"]), predicted, half
    )


def _table(kept: dict) -> FigureTable | ParameterTable:
    if "parameters" in kept:
        return ParameterTable(kept["title"], tuple(Parameter(**_tuples(p)) for p in kept["parameters"]))
    return FigureTable(kept["title"], tuple(kept["heads"]), tuple(map(tuple, kept["rows"])))


def _tuples(kept: dict) -> dict:
    """JSON has no tuples."""
    return {key: _tuple(value) for key, value in kept.items()}


def _tuple(value):
    return tuple(map(_tuple, value)) if isinstance(value, list) else value


def _made_from(study: Study) -> str:
    """SHA-256 of everything that calibration looks at."""
    parts = [version("pellucid"), checksum(study.folder / STUDY_FILE)]
    for recording in study.recordings():
        parts += [recording.checksum, *(stream.checksum for stream in recording.streams.values())]
    parts += [
        checksum(path) for path in sorted(study.models_dir.glob("*.json")) if path.stem.endswith(("orthosis", "limb"))
    ]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
